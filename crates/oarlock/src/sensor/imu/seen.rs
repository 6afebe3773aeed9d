//! Derivatives of an inertial unit's readings in its own axes.

use super::{ACCEL, MAG};
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::slopes::{rigid_acceleration, Kind as SlopeKind};
use crate::kinematics::FrameMotion;
use crate::model::Point;
use crate::rotation::turn::right_jacobian;
use crate::rotation::{Mat3, Vec3};
use crate::sensor::slopes::{times, transposed, Cause, Columns, Group, Moving};

/// An inertial unit, and the rotation from root axes to its own.
pub(super) struct Seen<'a> {
    at: Moving<'a>,
    motion: &'a FrameMotion<f64>,
    straight: Columns,
    by_spun: Columns,
    by_spin: Columns,
    by_turn: Columns,
    /// True readings of its gyroscope, accelerometer and magnetometer, in root axes.
    felt: [Vec3<f64>; 3],
}

impl<'a> Seen<'a> {
    #[inline(always)]
    pub(super) fn new<const FUSED: bool>(at: Moving<'a>, frame: usize, offset: &Point, axes: &Mat3<f64>) -> Self {
        let motion = &at.frames[frame];
        let arm = offset.turned(&motion.rotation, at.worn.lengths);
        let velocity = motion.velocity_at(arm);
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
    pub(super) fn write<const FUSED: bool>(&self, group: &Group, mount: Option<&Vec3<f64>>, out: &mut SparseJacobian) {
        for (slope, (cause, _)) in out.rows_of(group.triple).iter_mut().zip(&group.causes) {
            slope.rows = match (*cause, group.part) {
                (Cause::Slope(k), ACCEL) => self.accel::<FUSED>(k),
                (Cause::Slope(k), MAG) => times::<FUSED>(&self.by_turn, self.at.slopes.slope(k).turn, [0.0; 4]),
                (Cause::Slope(k), _) => self.turned::<FUSED>(self.at.slopes.slope(k).spin),
                (Cause::Stretch(by), _) => {
                    self.turned::<FUSED>(rigid_acceleration(self.motion, self.motion.rotation.apply_f64(by)))
                }
                (Cause::Base(axis), _) => self.turned::<FUSED>(Vec3(axis)),
                // The magnetometer's own state is the azimuth.
                (Cause::Own, _) => self.turned::<FUSED>(self.at.magnetic_slope),
                (Cause::Mount(k), part) => {
                    let [x, y, z, _] = self.turned::<FUSED>(self.felt[part]);
                    let own = right_jacobian(mount.map_or([0.0; 3], |m| m.0)).column(k);
                    let [x, y, z] = Vec3([x, y, z]).cross(own).0;
                    [x, y, z, 0.0]
                }
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
        if matches!(slope.kind, SlopeKind::Turn | SlopeKind::Rate | SlopeKind::Accel) {
            sum = times::<FUSED>(&self.by_spun, slope.spun, sum);
        }
        if matches!(slope.kind, SlopeKind::Turn | SlopeKind::Rate) {
            sum = times::<FUSED>(&self.by_spin, slope.spin, sum);
        }
        sum
    }
}

/// Matrix of the map v -> v x p in the sensor's axes.
#[inline(always)]
fn crossed(axes: &Mat3<f64>, p: Vec3<f64>) -> Columns {
    let [a, b, c] = axes.0.map(Vec3);
    let [x, y, z] = p.0;
    transposed(&Mat3([(c * y + b * -z).0, (a * z + c * -x).0, (b * x + a * -y).0]))
}
