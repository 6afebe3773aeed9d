//! How every reading answers to the motion of its frame and to how the sensor is worn: rows of the Jacobian.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::near::Parts;
use super::{Reader, Suite, Worn};
use crate::kernels::arch::madd;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::slopes::{rigid_acceleration, Kind, Slopes};
use crate::kinematics::FrameMotion;
use crate::model::Point;
use crate::rotation::turn::right_jacobian;
use crate::rotation::{Mat3, Vec3};

/// Where numbers that are no joints stand in the Jacobian.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Places {
    /// The first column that is asked for.
    pub from: usize,
    /// Per coordinate: its value.
    pub coordinates: Vec<Option<usize>>,
    /// Per estimated length.
    pub lengths: Vec<usize>,
    /// Per estimated mount: the first of three.
    pub mounts: Vec<usize>,
    /// Of the magnetic field's azimuth.
    pub azimuth: Option<usize>,
    /// Base accelerations, and their directions in root axes.
    pub bases: Vec<(usize, [f64; 3])>,
    /// Per bias: the first row that it adds to, and its first state.
    pub biases: Vec<(usize, usize)>,
}

/// How a body stands and moves, and how that answers to its joints and lengths.
#[derive(Debug, Clone, Copy)]
pub struct Moving<'a> {
    /// All frames.
    pub frames: &'a [FrameMotion<f64>],
    /// Their slopes.
    pub slopes: &'a Slopes,
    /// Lengths and mounts.
    pub worn: Worn<'a, f64>,
    /// uT, root axes.
    pub magnetic_field: Vec3<f64>,
    /// Per rad of azimuth.
    pub magnetic_slope: Vec3<f64>,
}

/// What makes a reading answer to a number.
#[derive(Debug, Clone, Copy)]
enum Cause {
    /// A slope of the tree, by its number.
    Slope(usize),
    /// A length that moves the sensor in its frame: m per unit, in the frame's axes.
    Stretch([f64; 3]),
    /// One of the three numbers of a mount.
    Mount(usize),
    Azimuth,
    /// A base acceleration.
    Base([f64; 3]),
    /// It is read as it is.
    Itself,
}

/// What three rows, or one, read.
#[derive(Debug, Clone, Copy)]
enum Rows {
    Gyro,
    Accel,
    Mag,
    Point,
    Axis,
    Joint,
}

/// Rows of a sensor that answer to the same numbers.
#[derive(Debug, Clone)]
struct Group {
    triple: usize,
    rows: Rows,
    /// Of every slope; a loop's second side counts negatively.
    causes: Vec<(Cause, usize)>,
}

/// Why the slopes of a Jacobian are there.
#[derive(Debug, Clone)]
pub struct Causes {
    /// Per source.
    groups: Vec<Vec<Group>>,
}

impl Suite {
    /// Room for the rows of a Jacobian that has `n` columns of states and others behind them.
    pub fn causes(&self, n: usize, slopes: &Slopes, places: &Places) -> (SparseJacobian, Causes) {
        let mut straight = SparseJacobian { n, ..SparseJacobian::default() };
        let groups = self.readers.iter().zip(&self.sources).map(|(reader, source)| {
            let mut found = Vec::new();
            for (row, count, rows, causes) in reader.causes(source.rows.start, slopes, places) {
                let mut causes: Vec<_> = causes.into_iter().filter(|(column, ..)| *column >= places.from).collect();
                causes.sort_by_key(|(column, ..)| std::cmp::Reverse(*column));
                let bias = places.biases.iter().find(|(first, _)| *first == row).map(|b| b.1);
                if !causes.is_empty() || bias.is_some() {
                    let columns: Vec<usize> = causes.iter().map(|c| c.0).collect();
                    found.push(Group {
                        triple: straight.triples.len(),
                        rows,
                        causes: causes.iter().map(|c| c.1).collect(),
                    });
                    straight.push(row, count, &columns, bias);
                }
            }
            found
        });
        let groups = groups.collect();
        (straight, Causes { groups })
    }

    /// Writes the rows of every `active` source: derivatives of what `predict` gives. Allocates nothing.
    #[inline(always)]
    pub fn slopes<const FUSED: bool>(&self, causes: &Causes, at: Moving, active: &[bool], out: &mut SparseJacobian) {
        let sources = self.readers.iter().zip(&causes.groups).zip(active);
        for ((reader, groups), _) in sources.filter(|(_, on)| **on) {
            match reader {
                Reader::Imu(s) => {
                    let motion = &at.frames[s.frame];
                    let axes = s.root_from_sensor(motion, at.worn.mounts);
                    let unit = Seen::new::<FUSED>(at, s.frame, &s.offset, &axes);
                    let mount = s.mount.and_then(|i| at.worn.mounts.get(i));
                    for group in groups {
                        unit.write::<FUSED>(group, mount, out);
                    }
                }
                Reader::Encoder(_) => {
                    for group in groups {
                        out.rows_of(group.triple).iter_mut().for_each(|s| s.rows = [1.0, 0.0, 0.0, 0.0]);
                    }
                }
                Reader::Position(s) => {
                    for group in groups {
                        write_sides(group, at, &[(s.frame, &s.point, [0.0; 3])], out);
                    }
                }
                Reader::Closure(s) => {
                    let [(a, at_a), (b, at_b)] = &s.sides;
                    let [za, zb] = s.axes.unwrap_or_default();
                    for group in groups {
                        write_sides(group, at, &[(*a, at_a, za), (*b, at_b, zb)], out);
                    }
                }
            }
        }
    }

    /// Writes out the rows of every `active` source in full.
    pub fn scatter(
        &self,
        causes: &Causes,
        active: &[bool],
        straight: &SparseJacobian,
        width: usize,
        jacobian: &mut [f64],
    ) {
        for ((source, groups), _) in self.sources.iter().zip(&causes.groups).zip(active).filter(|(_, on)| **on) {
            jacobian[source.rows.start * width..source.rows.end * width].fill(0.0);
            groups.iter().for_each(|g| straight.scatter(g.triple, width, jacobian));
        }
    }
}

/// First row, how many, what they read, and the columns that they answer to, with the side of a loop.
type Found = (usize, usize, Rows, Vec<(usize, (Cause, usize))>);

impl Reader {
    fn causes(&self, row: usize, slopes: &Slopes, places: &Places) -> Vec<Found> {
        let chain = |frame: usize, side: usize, kinds: &[Kind]| -> Vec<(usize, (Cause, usize))> {
            let chain = slopes.chain(frame).into_iter().filter(|&k| kinds.contains(&slopes.slope(k).kind));
            chain.map(|k| (slopes.slope(k).column, (Cause::Slope(k), side))).collect()
        };
        let stretches = |point: &Point, side: usize| -> Vec<(usize, (Cause, usize))> {
            point.slopes().iter().map(|(l, slope)| (places.lengths[*l], (Cause::Stretch(*slope), side))).collect()
        };
        match self {
            Reader::Imu(s) => {
                let Parts { gyro, accel, mag, rest } = s.parts(row);
                let mount = || {
                    let first = s.mount.map(|i| places.mounts[i]);
                    first.into_iter().flat_map(|m| (0..3).map(move |k| (m + k, (Cause::Mount(k), 0))))
                };
                let mut found = Vec::new();
                for row in gyro.into_iter().chain(rest) {
                    let spins = chain(s.frame, 0, &[Kind::Turn, Kind::Rate]);
                    found.push((row, 3, Rows::Gyro, spins.into_iter().chain(mount()).collect()));
                }
                if let Some(row) = accel {
                    let mut all = chain(s.frame, 0, &[Kind::Turn, Kind::Rate, Kind::Accel, Kind::Shift, Kind::Push]);
                    all.extend(stretches(&s.offset, 0));
                    all.extend(places.bases.iter().map(|(column, axis)| (*column, (Cause::Base(*axis), 0))));
                    found.push((row, 3, Rows::Accel, all.into_iter().chain(mount()).collect()));
                }
                if let Some(row) = mag {
                    let turns = chain(s.frame, 0, &[Kind::Turn]).into_iter().chain(mount());
                    let azimuth = places.azimuth.map(|column| (column, (Cause::Azimuth, 0)));
                    found.push((row, 3, Rows::Mag, turns.chain(azimuth).collect()));
                }
                found
            }
            Reader::Encoder(s) => {
                let own = places.coordinates[s.coordinate].map(|column| (column, (Cause::Itself, 0)));
                vec![(row, 1, Rows::Joint, own.into_iter().collect())]
            }
            Reader::Position(s) => {
                let mut all = chain(s.frame, 0, &[Kind::Turn, Kind::Shift]);
                all.extend(stretches(&s.point, 0));
                vec![(row, 3, Rows::Point, all)]
            }
            Reader::Closure(s) => {
                let (mut gap, mut axes) = (Vec::new(), Vec::new());
                for (side, (frame, point)) in s.sides.iter().enumerate() {
                    gap.extend(chain(*frame, side, &[Kind::Turn, Kind::Shift]));
                    gap.extend(stretches(point, side));
                    axes.extend(chain(*frame, side, &[Kind::Turn]));
                }
                let turned = s.axes.map(|_| (row + 3, 3, Rows::Axis, axes));
                std::iter::once((row, 3, Rows::Point, gap)).chain(turned).collect()
            }
        }
    }
}

/// Rows of a loop or of a position: frame, point and axis of each side.
#[inline(always)]
fn write_sides(group: &Group, at: Moving, sides: &[(usize, &Point, [f64; 3])], out: &mut SparseJacobian) {
    let mut places = [Vec3::zero(); 2];
    for (to, (frame, point, axis)) in places.iter_mut().zip(sides) {
        let motion = &at.frames[*frame];
        *to = match group.rows {
            Rows::Axis => motion.rotation.apply_f64(*axis),
            _ => motion.position + point.turned(&motion.rotation, at.worn.lengths),
        };
    }
    for (slope, (cause, side)) in out.rows_of(group.triple).iter_mut().zip(&group.causes) {
        let v = match (*cause, group.rows) {
            (Cause::Slope(k), Rows::Axis) => at.slopes.slope(k).turn.cross(places[*side]),
            (Cause::Slope(k), _) => at.slopes.slope(k).place(places[*side]),
            (Cause::Stretch(by), _) => at.frames[sides[*side].0].rotation.apply_f64(by),
            _ => Vec3::zero(),
        };
        let [x, y, z] = if *side == 0 { v.0 } else { (v * -1.0).0 };
        slope.rows = [x, y, z, 0.0];
    }
}

/// Three columns, of which the last number is none.
type Columns = [[f64; 4]; 3];

/// An inertial unit, and what takes vectors in root axes to its own.
struct Seen<'a> {
    at: Moving<'a>,
    motion: &'a FrameMotion<f64>,
    straight: Columns,
    by_spun: Columns,
    by_spin: Columns,
    by_turn: Columns,
    /// What its gyroscope, accelerometer and magnetometer feel, root axes.
    felt: [Vec3<f64>; 3],
}

impl<'a> Seen<'a> {
    #[inline(always)]
    fn new<const FUSED: bool>(at: Moving<'a>, frame: usize, offset: &Point, axes: &Mat3<f64>) -> Self {
        let motion = &at.frames[frame];
        let arm = offset.turned(&motion.rotation, at.worn.lengths);
        let velocity = at.slopes.velocity[frame] + motion.angular_velocity.cross(arm);
        Seen {
            at,
            motion,
            straight: transposed(axes),
            by_spun: crossed(axes, motion.position + arm),
            by_spin: crossed(axes, velocity + velocity),
            by_turn: crossed(axes, at.magnetic_field * -1.0),
            felt: [motion.angular_velocity, motion.proper_acceleration_at(arm), at.magnetic_field],
        }
    }

    #[inline(always)]
    fn write<const FUSED: bool>(&self, group: &Group, mount: Option<&Vec3<f64>>, out: &mut SparseJacobian) {
        for (slope, (cause, _)) in out.rows_of(group.triple).iter_mut().zip(&group.causes) {
            slope.rows = match (*cause, group.rows) {
                (Cause::Slope(k), Rows::Accel) => self.accel::<FUSED>(k),
                (Cause::Slope(k), Rows::Mag) => times::<FUSED>(&self.by_turn, self.at.slopes.slope(k).turn, [0.0; 4]),
                (Cause::Slope(k), _) => self.turned::<FUSED>(self.at.slopes.slope(k).spin),
                (Cause::Stretch(by), _) => {
                    self.turned::<FUSED>(rigid_acceleration(self.motion, self.motion.rotation.apply_f64(by)))
                }
                (Cause::Base(axis), _) => self.turned::<FUSED>(Vec3(axis)),
                (Cause::Azimuth, _) => self.turned::<FUSED>(self.at.magnetic_slope),
                (Cause::Mount(k), rows) => {
                    let felt = match rows {
                        Rows::Accel => self.felt[1],
                        Rows::Mag => self.felt[2],
                        _ => self.felt[0],
                    };
                    let [x, y, z, _] = self.turned::<FUSED>(felt);
                    let own = right_jacobian(mount.map_or([0.0; 3], |m| m.0)).column(k);
                    let [x, y, z] = Vec3([x, y, z]).cross(own).0;
                    [x, y, z, 0.0]
                }
                (Cause::Itself, _) => [0.0; 4],
            };
        }
    }

    #[inline(always)]
    fn turned<const FUSED: bool>(&self, v: Vec3<f64>) -> [f64; 4] {
        times::<FUSED>(&self.straight, v, [0.0; 4])
    }

    #[inline(always)]
    fn accel<const FUSED: bool>(&self, k: usize) -> [f64; 4] {
        let slope = self.at.slopes.slope(k);
        let mut sum = self.turned::<FUSED>(slope.push);
        if matches!(slope.kind, Kind::Turn | Kind::Rate | Kind::Accel) {
            sum = times::<FUSED>(&self.by_spun, slope.spun, sum);
        }
        if matches!(slope.kind, Kind::Turn | Kind::Rate) {
            sum = times::<FUSED>(&self.by_spin, slope.spin, sum);
        }
        sum
    }
}

/// `sum` and a matrix, given by its columns, times a vector.
#[inline(always)]
fn times<const FUSED: bool>(columns: &Columns, v: Vec3<f64>, mut sum: [f64; 4]) -> [f64; 4] {
    for k in 0..3 {
        for i in 0..4 {
            sum[i] = madd::<FUSED>(columns[k][i], v.0[k], sum[i]);
        }
    }
    sum
}

/// The transpose of a matrix.
#[inline(always)]
fn transposed(axes: &Mat3<f64>) -> Columns {
    axes.0.map(|[x, y, z]| [x, y, z, 0.0])
}

/// What takes v to v x p in the axes.
#[inline(always)]
fn crossed(axes: &Mat3<f64>, p: Vec3<f64>) -> Columns {
    let [a, b, c] = axes.0.map(Vec3);
    let [x, y, z] = p.0;
    transposed(&Mat3([(c * y + b * -z).0, (a * z + c * -x).0, (b * x + a * -y).0]))
}
