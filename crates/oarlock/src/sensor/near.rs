//! Readings near a mean: sensors as they sit on their pieces, which need no rotations of the links.

use super::{Reader, Suite, Worn};
use crate::kernels::lane::{Lane, Real, LANES};
use crate::kinematics::near::{Mean, Near, PerturbedMotion, Reach, Wanted};
use crate::kinematics::pieces::Pieces;
use crate::kinematics::JointMotion;
use crate::model::Point;
use crate::rotation::{Mat3, Vec3};

/// First row of each of an inertial unit's parts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parts {
    pub gyro: Option<usize>,
    pub accel: Option<usize>,
    pub mag: Option<usize>,
    pub rest: Option<usize>,
}

/// An inertial unit on its piece.
#[derive(Debug, Clone)]
struct Unit {
    piece: usize,
    /// Piece from sensor.
    rotation: Mat3<f64>,
    arm: Point,
    /// Number among the units whose mount is estimated.
    mount: Option<usize>,
    /// On which states its own mount and arm depend.
    own_reach: usize,
    parts: Parts,
}

/// A sensor or a closure as it sits on its pieces.
#[derive(Debug, Clone)]
enum Seat {
    Unit(Unit),
    Encoder { row: usize, coordinate: usize },
    Position { row: usize, piece: usize, point: Point },
    Loop { row: usize, sides: [(usize, Point); 2], axes: Option<[[f64; 3]; 2]> },
}

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
    /// What differs at all.
    pub perturbed: PerturbedMotion,
    /// How the units stand at the mean.
    pub stands: &'a [Stand],
    /// Readings at the mean.
    pub center: &'a [f64],
    /// Sources that are asked for.
    pub active: &'a [bool],
}

impl Suite {
    /// The sensors on the pieces of a tree. `reaches` are those of the frames; `length` and `mount` give the state of an estimated
    /// parameter and the first one of an estimated mount.
    pub fn seats(
        &self,
        pieces: &Pieces,
        reaches: &[Reach],
        length: impl Fn(usize) -> usize,
        mount: impl Fn(usize) -> usize,
    ) -> Seats {
        let own = |point: &Point| point.moved_by().map(|l| length(l) + 1).max().unwrap_or(0);
        let far = |frame: usize, own: usize| {
            let reach = reaches[frame];
            Reach { last: reach.last.max(own), ..reach }
        };
        let (mut seats, mut found) = (Vec::new(), Vec::new());
        for (reader, source) in self.readers.iter().zip(&self.sources) {
            let row = source.rows.start;
            let (seat, reach) = match reader {
                Reader::Imu(s) => {
                    let home = &pieces.homes[s.frame];
                    let arm = home.point(&s.offset);
                    let own_reach = own(&arm).max(s.mount.map_or(0, |i| mount(i) + 3));
                    let unit = Unit {
                        piece: home.piece,
                        rotation: home.rotation.times(&s.rotation),
                        arm,
                        mount: s.mount,
                        own_reach,
                        parts: s.parts(row),
                    };
                    (Seat::Unit(unit), far(s.frame, own_reach))
                }
                Reader::Encoder(s) => {
                    let reach = Reach { last: usize::MAX, input: true, ..Reach::default() };
                    (Seat::Encoder { row, coordinate: s.coordinate }, reach)
                }
                Reader::Position(s) => {
                    let home = &pieces.homes[s.frame];
                    let point = home.point(&s.point);
                    let reach = far(s.frame, own(&point));
                    (Seat::Position { row, piece: home.piece, point }, reach)
                }
                Reader::Closure(s) => {
                    let side = |(frame, point): &(usize, Point)| {
                        let home = &pieces.homes[*frame];
                        (home.piece, home.point(point))
                    };
                    let sides = [side(&s.sides[0]), side(&s.sides[1])];
                    let [a, b] = [0, 1].map(|i| far(s.sides[i].0, own(&sides[i].1)));
                    let reach = Reach { last: a.last.max(b.last), input: a.input || b.input, ..a };
                    let homes = [0, 1].map(|i| &pieces.homes[s.sides[i].0]);
                    let axes = s.axes.map(|axes| [0, 1].map(|i| homes[i].rotation.apply_f64(axes[i]).0));
                    (Seat::Loop { row, sides, axes }, reach)
                }
            };
            seats.push(seat);
            found.push(reach);
        }
        Seats { seats, reaches: found }
    }
}

impl Seats {
    /// Marks what the `active` sources ask of their pieces.
    pub fn mark(&self, active: &[bool], wanted: &mut [Wanted]) {
        for (seat, _) in self.seats.iter().zip(active).filter(|(_, on)| **on) {
            match seat {
                Seat::Unit(s) => {
                    let piece = &mut wanted[s.piece];
                    piece.place = true;
                    piece.motion |= s.parts.gyro.or(s.parts.accel).or(s.parts.rest).is_some();
                    piece.field |= s.parts.mag.is_some();
                }
                Seat::Encoder { .. } => {}
                Seat::Position { piece, .. } => wanted[*piece].place = true,
                Seat::Loop { sides, .. } => sides.iter().for_each(|s| wanted[s.0].place = true),
            }
        }
    }

    /// A vector in the axes of source `i`, if that is an inertial unit, given in those of every piece.
    pub fn seen_by(&self, i: usize, v: &[Vec3<f64>], mounts: &[Vec3<f64>]) -> Option<Vec3<f64>> {
        let Seat::Unit(s) = &self.seats[i] else { return None };
        let nominal = s.rotation.apply_transposed(v[s.piece]);
        let mount = s.mount.and_then(|i| mounts.get(i));
        Some(mount.map_or(nominal, |turn| Mat3::about(*turn).apply_transposed(nominal)))
    }

    /// How the units stand at the mean.
    #[inline(always)]
    pub fn settle(&self, worn: Worn<f64>, active: &[bool], stands: &mut [Stand]) {
        for ((seat, stand), &on) in self.seats.iter().zip(stands).zip(active) {
            if let (Seat::Unit(s), true) = (seat, on) {
                stand.rotation = match s.mount.and_then(|i| worn.mounts.get(i)) {
                    Some(turn) => s.rotation.times(&Mat3::about(*turn)),
                    None => s.rotation,
                };
                stand.arm = s.arm.at(worn.lengths);
            }
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
            let Seat::Unit(Unit { piece, parts: Parts { accel: Some(row), .. }, .. }) = seat else { continue };
            put(out, *row, stand.rotation.transposed_apply(near.own[*piece].felt_at(stand.arm)));
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
            match seat {
                Seat::Unit(s) => s.predict(&around, &around.stands[i], posed, out),
                Seat::Encoder { row, coordinate } => out[*row] = around.joints.q[*coordinate].cast(),
                Seat::Position { row, .. } if !posed => around.keep(out, Some(*row), 3),
                Seat::Position { row, piece, point } => put(out, *row, around.place(*piece, point, trail)),
                Seat::Loop { row, axes, .. } if !posed => {
                    around.keep(out, Some(*row), if axes.is_some() { 6 } else { 3 })
                }
                Seat::Loop { row, sides: [(a, at), (b, bt)], axes } => {
                    put(out, *row, around.place(*a, at, trail) - around.place(*b, bt, trail));
                    if let Some([za, zb]) = axes {
                        put(out, row + 3, around.direction(*a, *za, trail) - around.direction(*b, *zb, trail));
                    }
                }
            }
        }
    }
}

impl<T: Real> Around<'_, T> {
    /// What the mean reads.
    #[inline(always)]
    fn keep(&self, out: &mut [Lane], first: Option<usize>, count: usize) {
        let Some(first) = first else { return };
        for (out, x) in out[first..first + count].iter_mut().zip(&self.center[first..first + count]) {
            *out = Lane([*x; LANES]);
        }
    }

    #[inline(always)]
    fn place(&self, piece: usize, point: &Point, trail: &mut [Vec3<T>]) -> Vec3<T> {
        let point = match point.constant() {
            Some(point) => point.everywhere(),
            None => point.at(self.joints.lengths),
        };
        self.pieces.raised::<T, false>(piece, point, self.mean, &self.joints, self.near, trail)
    }

    #[inline(always)]
    fn direction(&self, piece: usize, axis: [f64; 3], trail: &mut [Vec3<T>]) -> Vec3<T> {
        self.pieces.raised::<T, true>(piece, Vec3::splat(axis), self.mean, &self.joints, self.near, trail)
    }
}

impl Unit {
    #[inline(always)]
    fn predict<const FUSED: bool>(&self, around: &Around<Lane<FUSED>>, stand: &Stand, posed: bool, out: &mut [Lane]) {
        let (differs, own) = (around.near.differs[self.piece], &around.near.own[self.piece]);
        let worn = posed && self.own_reach > around.perturbed.from;
        let axes = Axes { nominal: &self.rotation, stand: &stand.rotation, turn: self.turned(around, worn) };
        let Parts { gyro, accel, mag, rest } = self.parts;
        if !differs.motion {
            around.keep(out, gyro, 3);
            around.keep(out, accel, 3);
            around.keep(out, rest, 3);
        } else {
            if let Some(row) = accel {
                let felt = if worn { own.felt_off(self.arm.at(around.joints.lengths)) } else { own.felt_at(stand.arm) };
                put(out, row, axes.seen(felt));
            }
            if let Some(row) = gyro.or(rest) {
                let spin = axes.seen(own.spin);
                put(out, row, spin);
                if let Some(row) = rest {
                    put(out, row, spin);
                }
            }
        }
        let Some(row) = mag else { return };
        if differs.field || worn {
            let field = if differs.field { own.field } else { around.mean.field_in(self.piece) };
            put(out, row, axes.seen(field));
        } else {
            around.keep(out, mag, 3);
        }
    }

    /// How its own mount differs.
    #[inline(always)]
    fn turned<T: Real>(&self, around: &Around<T>, worn: bool) -> Option<Mat3<T>> {
        match self.mount {
            Some(i) if worn && i < around.mounts.len() => Some(Mat3::about(around.mounts[i])),
            _ => None,
        }
    }
}

/// Axes of a unit: as at the mean, or turned from how they nominally are.
struct Axes<'a, T> {
    nominal: &'a Mat3<f64>,
    stand: &'a Mat3<f64>,
    turn: Option<Mat3<T>>,
}

impl<T: Real> Axes<'_, T> {
    #[inline(always)]
    fn seen(&self, v: Vec3<T>) -> Vec3<T> {
        match &self.turn {
            Some(turn) => turn.apply_transposed(self.nominal.transposed_apply(v)),
            None => self.stand.transposed_apply(v),
        }
    }
}

#[inline(always)]
fn put<const FUSED: bool>(out: &mut [Lane], row: usize, v: Vec3<Lane<FUSED>>) {
    let out = &mut out[row..row + 3];
    for (out, x) in out.iter_mut().zip(v.0) {
        *out = x.cast();
    }
}
