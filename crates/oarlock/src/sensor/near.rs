//! Readings at points near a mean: the sensors as they sit on the rigid pieces of the tree.

use super::kind::{Reads, Sits};
use super::{Seat, Suite, Worn};
use crate::kernels::lane::{Lane, Real, LANES};
use crate::kinematics::near::{Mean, Near, PerturbedMotion, Reach, Wanted};
use crate::kinematics::pieces::Pieces;
use crate::kinematics::JointMotion;
use crate::model::Point;
use crate::rotation::{Mat3, Vec3};

/// How an inertial unit stands at the mean, in the axes of its piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// Piece from sensor.
    pub rotation: Mat3<f64>,
    /// From the piece's origin, m.
    pub arm: Vec3<f64>,
}

impl Stand {
    /// Of a sensor that does not care.
    pub const ANY: Stand = Stand { rotation: Mat3([[0.0; 3]; 3]), arm: Vec3([0.0; 3]) };
}

/// All sensors and closures on their pieces.
#[derive(Debug, Clone)]
pub struct Seats {
    seats: Vec<Seat>,
    reaches: Vec<Reach>,
}

/// Bodies around the mean.
#[derive(Debug, Clone, Copy)]
pub struct Around<'a, T> {
    /// That moves.
    pub pieces: &'a Pieces,
    /// In the middle.
    pub mean: &'a Mean,
    /// What differs.
    pub near: &'a Near<T>,
    /// Values of the joints.
    pub joints: JointMotion<'a, T>,
    /// Rotation vectors of the mounts.
    pub mounts: &'a [Vec3<T>],
    /// By which the references of orientation sensors are turned about the vertical, rad.
    pub headings: &'a [T],
    /// Of every source whose readings are differences from one.
    pub references: &'a [Mat3<f64>],
    /// What differs at all.
    pub perturbed: PerturbedMotion,
    /// How the units stand at the mean.
    pub stands: &'a [Stand],
    /// Readings at the mean.
    pub center: &'a [f64],
    /// Sources that are asked for.
    pub active: &'a [bool],
}

/// Where the pieces of a tree are, and which states move its frames.
pub(crate) struct Homes<'a> {
    pub pieces: &'a Pieces,
    /// Of the frames.
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

    /// One more than the last state that moves a point in its frame.
    pub fn own(&self, point: &Point) -> usize {
        point.moved_by().map(|l| (self.length)(l) + 1).max().unwrap_or(0)
    }

    /// One more than the last state of a mount.
    pub fn own_mount(&self, number: Option<usize>) -> usize {
        number.map_or(0, |i| (self.mount)(i) + 3)
    }

    /// One more than the state of a heading.
    pub fn own_heading(&self, number: Option<usize>) -> usize {
        number.map_or(0, |i| (self.heading)(i) + 1)
    }

    /// On which states a sensor on a frame depends, those of its own being below `own`.
    pub fn reach(&self, frame: usize, own: usize) -> Reach {
        let reach = self.reaches[frame];
        Reach { last: reach.last.max(own), ..reach }
    }
}

/// On which states a sensor depends that has two sides.
pub(super) fn both(a: Reach, b: Reach) -> Reach {
    Reach { last: a.last.max(b.last), input: a.input || b.input, ..a }
}

impl Suite {
    /// The sensors on the pieces of a tree. `reaches` are those of the frames; `length`, `mount` and `heading` give the state of an
    /// estimated parameter, the first one of an estimated mount and that of an estimated heading.
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
    /// Marks what the `active` sources ask of their pieces.
    pub fn mark(&self, active: &[bool], wanted: &mut [Wanted]) {
        self.seats.iter().zip(active).filter(|(_, on)| **on).for_each(|(seat, _)| seat.mark(wanted));
    }

    /// A vector in the axes of source `i`, if that has its own, given in those of every piece.
    pub fn seen_by(&self, i: usize, v: &[Vec3<f64>], mounts: &[Vec3<f64>]) -> Option<Vec3<f64>> {
        self.seats[i].seen_by(v, mounts)
    }

    /// How the units stand at the mean.
    #[inline(always)]
    pub fn settle(&self, worn: Worn<f64>, active: &[bool], stands: &mut [Stand]) {
        for ((seat, stand), _) in self.seats.iter().zip(stands).zip(active).filter(|(_, on)| **on) {
            seat.settle(worn, stand);
        }
    }

    /// Second-order part of the accelerometers' readings, at the mean's posture. Allocates nothing.
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

    /// Predicts the rows of every active source into `out`, from the mean's where nothing differs; `trail` is room for a vector a piece.
    /// Allocates nothing.
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
    /// What the mean reads.
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
