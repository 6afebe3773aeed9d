//! Readings at points near a mean (sigma points), computed on the rigid pieces of the tree. `body::read` uses it.

use super::kind::{Reads, Sits};
use super::{Seat, Suite, Worn};
use crate::kernels::lane::{Lane, Real, LANES};
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

    /// The states that a sensor on a frame depends on; its own states are below `own`.
    pub fn reach(&self, frame: usize, own: usize) -> Reach {
        let reach = self.reaches[frame];
        Reach { last: reach.last.max(own), ..reach }
    }
}

/// The states that a sensor with two sides depends on.
pub(super) fn both(a: Reach, b: Reach) -> Reach {
    Reach { last: a.last.max(b.last), input: a.input || b.input, ..a }
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
            seat.predict(&around, &around.stands[i], posed, trail, out);
        }
    }
}

impl<T: Real> Around<'_, T> {
    /// Readings at the mean.
    #[inline(always)]
    pub(super) fn keep(&self, out: &mut [Lane], first: Option<usize>, count: usize) {
        let Some(first) = first else { return };
        for (out, x) in out[first..first + count].iter_mut().zip(&self.center[first..first + count]) {
            *out = Lane([*x; LANES]);
        }
    }

    /// A point of a piece in root axes, m.
    #[inline(always)]
    pub(super) fn place(&self, piece: usize, point: &Point, trail: &mut [Vec3<T>]) -> Vec3<T> {
        let point = match point.constant() {
            Some(point) => point.everywhere(),
            None => point.at(self.joints.lengths),
        };
        self.pieces.raised::<T, false>(piece, point, self.mean, &self.joints, self.near, trail)
    }

    /// A direction of a piece in root axes.
    #[inline(always)]
    pub(super) fn direction(&self, piece: usize, axis: Vec3<T>, trail: &mut [Vec3<T>]) -> Vec3<T> {
        self.pieces.raised::<T, true>(piece, axis, self.mean, &self.joints, self.near, trail)
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
