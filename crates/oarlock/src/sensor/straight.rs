//! How gyroscopes and accelerometers answer to rates, accelerations and the states that only add to them.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::near::Parts;
use super::slopes::Places;
use super::{Reader, Suite, Worn};
use crate::estimate::straight::Straight;
use crate::kinematics::slopes::{Kind, Slopes};
use crate::kinematics::FrameMotion;
use crate::lane::arch::madd;
use crate::rotation::{Mat3, Vec3};

/// What makes a reading answer to a state.
#[derive(Debug, Clone, Copy)]
enum Cause {
    /// A slope of the tree, by its number.
    Slope(usize),
    /// A base acceleration.
    Base([f64; 3]),
}

/// An inertial unit: which trios of rows are its own, and why they answer to their states.
#[derive(Debug, Clone)]
struct Unit {
    source: usize,
    frame: usize,
    spins: Vec<usize>,
    accel: Option<usize>,
}

/// Causes of all slopes.
#[derive(Debug, Clone)]
pub struct Causes {
    units: Vec<Unit>,
    causes: Vec<Cause>,
}

/// A body at the mean.
#[derive(Debug, Clone, Copy)]
pub struct Still<'a> {
    /// All frames.
    pub frames: &'a [FrameMotion<f64>],
    /// Their slopes.
    pub slopes: &'a Slopes,
    /// Lengths and mounts.
    pub worn: Worn<'a, f64>,
}

impl Suite {
    /// Room for the slopes of all inertial units by states from `from` on: by the tree's `slopes` and the `places` of others. `bias` gives the state of
    /// the bias that adds to a part, by its first row.
    pub fn straight(
        &self,
        (n, from): (usize, usize),
        slopes: &Slopes,
        places: &Places,
        bias: impl Fn(usize) -> Option<usize>,
    ) -> (Straight, Causes) {
        let mut straight = Straight { n, ..Straight::default() };
        let mut all = Causes { units: Vec::new(), causes: Vec::new() };
        for (source, reader) in self.readers.iter().enumerate() {
            let Reader::Imu(s) = reader else { continue };
            let mut chain = slopes.chain(s.frame);
            chain.retain(|&k| slopes.slope(k).column >= from);
            let by_slope = |k: &usize| (slopes.slope(*k).column, Cause::Slope(*k));
            let spins = |k: &&usize| matches!(slopes.slope(**k).kind, Kind::Turn | Kind::Rate);
            let Parts { gyro, accel, rest, .. } = s.parts(self.sources[source].rows.start);
            let mut unit = Unit { source, frame: s.frame, spins: Vec::new(), accel: None };
            for row in gyro.into_iter().chain(rest) {
                unit.spins.push(straight.trios.len());
                let added = bias(row).filter(|_| gyro == Some(row));
                all.push(&mut straight, row, chain.iter().filter(spins).map(by_slope).collect(), added);
            }
            if let Some(row) = accel {
                unit.accel = Some(straight.trios.len());
                let bases = places.bases.iter().map(|(state, axis)| (*state, Cause::Base(*axis)));
                all.push(&mut straight, row, chain.iter().map(by_slope).chain(bases).collect(), bias(row));
            }
            all.units.push(unit);
        }
        (straight, all)
    }

    /// Their numbers. Allocates nothing.
    #[inline(always)]
    pub fn straighten<const FUSED: bool>(&self, causes: &Causes, at: Still, active: &[bool], straight: &mut Straight) {
        for unit in causes.units.iter().filter(|u| active[u.source]) {
            let Reader::Imu(s) = &self.readers[unit.source] else { continue };
            let motion = &at.frames[unit.frame];
            let axes = s.root_from_sensor(motion, at.worn.mounts);
            let straight_on = transposed(&axes);
            for trio in &unit.spins {
                let of = straight.trios[*trio].slopes.clone();
                for (slope, cause) in straight.slopes[of.clone()].iter_mut().zip(&causes.causes[of]) {
                    let Cause::Slope(k) = *cause else { continue };
                    slope.rows = seen::<FUSED>(&straight_on, at.slopes.slope(k).spin, [0.0; 4]);
                }
            }
            let Some(trio) = unit.accel else { continue };
            let arm = s.offset.turned(&motion.rotation, at.worn.lengths);
            let velocity = at.slopes.velocity[unit.frame] + motion.angular_velocity.cross(arm);
            let by_spun = crossed(&axes, motion.position + arm);
            let by_spin = crossed(&axes, velocity + velocity);
            let of = straight.trios[trio].slopes.clone();
            for (slope, cause) in straight.slopes[of.clone()].iter_mut().zip(&causes.causes[of]) {
                slope.rows = match *cause {
                    Cause::Base(axis) => seen::<FUSED>(&straight_on, Vec3(axis), [0.0; 4]),
                    Cause::Slope(k) => {
                        let slope = at.slopes.slope(k);
                        let mut sum = seen::<FUSED>(&straight_on, slope.push, [0.0; 4]);
                        if matches!(slope.kind, Kind::Turn | Kind::Rate | Kind::Accel) {
                            sum = seen::<FUSED>(&by_spun, slope.spun, sum);
                        }
                        if matches!(slope.kind, Kind::Turn | Kind::Rate) {
                            sum = seen::<FUSED>(&by_spin, slope.spin, sum);
                        }
                        sum
                    }
                };
            }
        }
    }
}

impl Causes {
    fn push(&mut self, straight: &mut Straight, row: usize, mut found: Vec<(usize, Cause)>, added: Option<usize>) {
        found.sort_by_key(|(state, _)| std::cmp::Reverse(*state));
        let states: Vec<usize> = found.iter().map(|f| f.0).collect();
        straight.push(row, &states, added);
        self.causes.extend(found.into_iter().map(|f| f.1));
    }
}

/// Three columns, of which the last number is none.
type Columns = [[f64; 4]; 3];

/// `sum` and a matrix, given by its columns, times a vector.
#[inline(always)]
fn seen<const FUSED: bool>(columns: &Columns, v: Vec3<f64>, mut sum: [f64; 4]) -> [f64; 4] {
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
