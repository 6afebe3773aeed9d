//! Readings at points near a mean (sigma points), computed on the rigid pieces of the tree. `body::read` uses it.

use super::kind::{Reads, Sits};
use super::{Seat, Sides, Suite, Worn};
use crate::kernels::lane::{Lane, LANES};
use crate::kinematics::near::{Mean, Near, PerturbedMotion, Reach, Wanted};
use crate::kinematics::pieces::Pieces;
use crate::kinematics::JointMotion;
use crate::model::Point;
use crate::rotation::{Mat3, Vec3};

/// Pose of an inertial unit at the mean, in the axes of its piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// Piece from sensor.
    pub rotation: Mat3<f64>,
    /// Position in the piece, m.
    pub arm: Vec3<f64>,
}

impl Stand {
    /// Placeholder for sensors without a pose of their own.
    pub const ANY: Stand = Stand { rotation: Mat3([[0.0; 3]; 3]), arm: Vec3([0.0; 3]) };
}

/// All sensors and closures on their pieces.
#[derive(Debug, Clone)]
pub struct Seats {
    seats: Vec<Seat>,
    reaches: Vec<Reach>,
}

/// Bodies near the mean, with the mean itself.
#[derive(Debug, Clone, Copy)]
pub struct Around<'a, T> {
    /// The rigid pieces of the tree.
    pub pieces: &'a Pieces,
    /// Motion of the pieces at the mean.
    pub mean: &'a Mean,
    /// Motion of the pieces where it differs from the mean's.
    pub near: &'a Near<T>,
    /// Values of the joints.
    pub joints: JointMotion<'a, T>,
    /// Rotation vectors of the mounts.
    pub mounts: &'a [Vec3<T>],
    /// Headings of the references of orientation sensors, rad.
    pub headings: &'a [T],
    /// Per source: the reference of readings that are differences from one.
    pub references: &'a [Mat3<f64>],
    /// What differs from the mean.
    pub perturbed: PerturbedMotion,
    /// Poses of the units at the mean.
    pub stands: &'a [Stand],
    /// Readings at the mean.
    pub center: &'a [f64],
    /// Sources to predict.
    pub active: &'a [bool],
}

/// What one sensor predicts its rows from, and where it writes them.
pub(crate) struct Nearby<'a, const FUSED: bool> {
    pub around: &'a Around<'a, Lane<FUSED>>,
    /// Its pose at the mean.
    pub stand: &'a Stand,
    /// Whether a pose that it depends on differs from the mean's.
    pub posed: bool,
    /// Workspace with one vector per piece.
    pub trail: &'a mut [Vec3<Lane<FUSED>>],
    /// All rows.
    pub out: &'a mut [Lane],
}

/// Positions of the frames on the pieces, and the states that move the frames.
pub(crate) struct Homes<'a> {
    pub pieces: &'a Pieces,
    /// Place of each frame on its piece.
    pub reaches: &'a [Reach],
    /// State of an estimated parameter.
    pub length: &'a dyn Fn(usize) -> usize,
    /// First state of an estimated mount.
    pub mount: &'a dyn Fn(usize) -> usize,
    /// State of an estimated heading.
    pub heading: &'a dyn Fn(usize) -> usize,
}

impl Homes<'_> {
    /// The piece of a frame, and a point of the frame in the piece's axes.
    pub fn place(&self, frame: usize, point: &Point) -> (usize, Point) {
        let home = &self.pieces.homes[frame];
        (home.piece, home.point(point))
    }

    /// Piece from frame.
    pub fn rotation(&self, frame: usize) -> &Mat3<f64> {
        &self.pieces.homes[frame].rotation
    }

    /// One more than the last state that moves the point in its frame.
    pub fn own(&self, point: &Point) -> usize {
        point.moved_by().map(|l| (self.length)(l) + 1).max().unwrap_or(0)
    }

    /// One more than the last state of the mount.
    pub fn own_mount(&self, number: Option<usize>) -> usize {
        number.map_or(0, |i| (self.mount)(i) + 3)
    }

    /// One more than the state of the heading.
    pub fn own_heading(&self, number: Option<usize>) -> usize {
        number.map_or(0, |i| (self.heading)(i) + 1)
    }

    /// Both sides on their pieces, and the states that they depend on.
    pub fn sides(&self, sides: &Sides<Point>) -> (Sides<Point>, Reach) {
        let placed = sides.each_ref().map(|(frame, point)| self.place(*frame, point));
        let [a, b] = [0, 1].map(|i| self.reach(sides[i].0, self.own(&placed[i].1)));
        (placed, Reach { last: a.last.max(b.last), input: a.input || b.input, ..a })
    }

    /// The states that a sensor on a frame depends on; its own states are below `own`.
    pub fn reach(&self, frame: usize, own: usize) -> Reach {
        let reach = self.reaches[frame];
        Reach { last: reach.last.max(own), ..reach }
    }
}

impl Suite {
    /// Places the sensors on the pieces of a tree. `reaches` are those of the frames. `length`, `mount` and `heading`
    /// give the state of an estimated parameter, the first state of an estimated mount and the state of an estimated
    /// heading.
    pub fn seats(
        &self,
        pieces: &Pieces,
        reaches: &[Reach],
        length: impl Fn(usize) -> usize,
        mount: impl Fn(usize) -> usize,
        heading: impl Fn(usize) -> usize,
    ) -> Seats {
        let homes = Homes { pieces, reaches, length: &length, mount: &mount, heading: &heading };
        let sources = self.readers.iter().zip(&self.sources);
        let (seats, reaches) = sources.map(|(reader, source)| reader.seat(source.rows.start, &homes)).unzip();
        Seats { seats, reaches }
    }
}

impl Seats {
    /// Marks what the `active` sources need of their pieces.
    pub fn mark(&self, active: &[bool], wanted: &mut [Wanted]) {
        self.seats.iter().zip(active).filter(|(_, on)| **on).for_each(|(seat, _)| seat.mark(wanted));
    }

    /// A vector in the axes of source `i`, if it has axes; `None` otherwise. The vector is given in the axes of every
    /// piece.
    pub fn seen_by(&self, i: usize, v: &[Vec3<f64>], mounts: &[Vec3<f64>]) -> Option<Vec3<f64>> {
        self.seats[i].seen_by(v, mounts)
    }

    /// Computes the poses of the units at the mean.
    #[inline(always)]
    pub fn settle(&self, worn: Worn<f64>, active: &[bool], stands: &mut [Stand]) {
        for ((seat, stand), _) in self.seats.iter().zip(stands).zip(active).filter(|(_, on)| **on) {
            seat.settle(worn, stand);
        }
    }

    /// Second-order part of the accelerometers' readings, in the posture of the mean. Allocates nothing.
    #[inline(always)]
    pub fn second_order<const FUSED: bool>(
        &self,
        near: &Near<Lane<FUSED>>,
        stands: &[Stand],
        active: &[bool],
        out: &mut [Lane],
    ) {
        for ((seat, stand), _) in self.seats.iter().zip(stands).zip(active).filter(|(_, on)| **on) {
            seat.curve(near, stand, out);
        }
    }

    /// Predicts the rows of every active source into `out`; copies the mean's where nothing differs. `trail` is
    /// workspace with one vector per piece. Allocates nothing.
    #[inline(always)]
    pub fn predict<const FUSED: bool>(
        &self,
        around: Around<Lane<FUSED>>,
        trail: &mut [Vec3<Lane<FUSED>>],
        out: &mut [Lane],
    ) {
        for (i, seat) in self.seats.iter().enumerate().filter(|(i, _)| around.active[*i]) {
            let posed = around.perturbed.touches(&self.reaches[i]);
            seat.predict(Nearby { around: &around, stand: &around.stands[i], posed, trail, out });
        }
    }
}

impl<const FUSED: bool> Nearby<'_, FUSED> {
    /// Readings at the mean.
    #[inline(always)]
    pub(super) fn keep(&mut self, first: Option<usize>, count: usize) {
        let Some(first) = first else { return };
        for (out, x) in self.out[first..first + count].iter_mut().zip(&self.around.center[first..first + count]) {
            *out = Lane([*x; LANES]);
        }
    }

    /// A point of a piece in root axes, m.
    #[inline(always)]
    pub(super) fn place(&mut self, piece: usize, point: &Point) -> Vec3<Lane<FUSED>> {
        let point = match point.constant() {
            Some(point) => point.everywhere(),
            None => point.at(self.around.joints.lengths),
        };
        self.raised::<false>(piece, point)
    }

    /// Velocity of a point of a piece whose motion is wanted, in root axes, m/s.
    #[inline(always)]
    pub(super) fn velocity(&mut self, piece: usize, point: &Point) -> Vec3<Lane<FUSED>> {
        let Around { pieces, mean, near, joints, .. } = self.around;
        let point = match point.constant() {
            Some(point) => point.everywhere(),
            None => point.at(joints.lengths),
        };
        pieces.velocity(piece, point, mean, joints, near)
    }

    /// The first of two points minus the second, in root axes, m.
    #[inline(always)]
    pub(super) fn gap(&mut self, [(a, at), (b, bt)]: &Sides<Point>) -> Vec3<Lane<FUSED>> {
        self.place(*a, at) - self.place(*b, bt)
    }

    /// A direction of a piece in root axes.
    #[inline(always)]
    pub(super) fn direction(&mut self, piece: usize, axis: Vec3<Lane<FUSED>>) -> Vec3<Lane<FUSED>> {
        self.raised::<true>(piece, axis)
    }

    #[inline(always)]
    fn raised<const DIRECTION: bool>(&mut self, piece: usize, v: Vec3<Lane<FUSED>>) -> Vec3<Lane<FUSED>> {
        let Around { pieces, mean, near, joints, .. } = self.around;
        pieces.raised::<Lane<FUSED>, DIRECTION>(piece, v, mean, joints, near, self.trail)
    }

    /// Writes a vector into three rows.
    #[inline(always)]
    pub(super) fn put(&mut self, row: usize, v: Vec3<Lane<FUSED>>) {
        put(self.out, row, v);
    }
}

/// Writes a vector into three rows.
#[inline(always)]
pub(super) fn put<const FUSED: bool>(out: &mut [Lane], row: usize, v: Vec3<Lane<FUSED>>) {
    let out = &mut out[row..row + 3];
    for (out, x) in out.iter_mut().zip(v.0) {
        *out = x.cast();
    }
}
