//! Inertial unit: angular velocity, specific force and magnetic field in its own axes (eq. 8, with the offset of the
//! unit from its link's origin and gravity felt once).

use super::near::Parts;
use super::{Quantity, RowGroups, Surroundings, Wearing, Worn};
use crate::kernels::lane::Real;
use crate::kinematics::FrameMotion;
use crate::model::{ImuNoise, Point, SensorKind};
use crate::rotation::{Mat3, Vec3};

/// Link from sensor, and the sensor's origin in the link's frame (m).
pub type MountValue = (Mat3<f64>, [f64; 3]);

/// An inertial unit on a frame.
#[derive(Debug, Clone)]
pub struct Imu {
    /// Index of its frame.
    pub frame: usize,
    pub(super) rotation: Mat3<f64>,
    pub(super) offset: Point,
    pub(super) noise: ImuNoise,
    /// Number among the units whose mount is estimated.
    pub(super) mount: Option<usize>,
}

impl Imu {
    /// From the model's description, unless `mount` says better.
    pub fn new(kind: &SensorKind, worn: &Wearing, given: &Option<MountValue>, mount: Option<usize>) -> Self {
        let SensorKind::Imu { frame, mount: nominal, noise } = kind else {
            unreachable!("called for inertial units only")
        };
        let own = || (nominal.rotation, Point::of(&nominal.offset, worn.parameters, worn.estimated));
        let (rotation, offset) = given.map_or_else(own, |(rotation, offset)| (rotation, Point::fixed(offset)));
        Imu { frame: *frame, rotation, offset, noise: *noise, mount }
    }

    /// Rows in the order gyro, accel, mag, rest of what the unit has.
    pub fn rows(&self) -> RowGroups {
        let groups: [(Quantity, &'static [&'static str], Option<f64>); 4] = [
            (Quantity::Gyro, &["gyro_x", "gyro_y", "gyro_z"], self.noise.gyro_std),
            (Quantity::Accel, &["accel_x", "accel_y", "accel_z"], self.noise.accel_std),
            (Quantity::Mag, &["mag_x", "mag_y", "mag_z"], self.noise.mag_std),
            (Quantity::Rest, &["rest_x", "rest_y", "rest_z"], self.noise.rest_std),
        ];
        groups.into_iter().filter_map(|(q, names, std)| Some((q, names, vec![std?; 3]))).collect()
    }

    /// The unit's axes; `mounts` are the rotation vectors of the mounts that are estimated.
    #[inline(always)]
    pub fn root_from_sensor<T: Real>(&self, frame: &FrameMotion<T>, mounts: &[Vec3<T>]) -> Mat3<T> {
        let nominal = frame.rotation.times_f64(&self.rotation);
        match self.mount.and_then(|i| mounts.get(i)) {
            Some(turn) => nominal.then(&Mat3::about(*turn)),
            None => nominal,
        }
    }

    /// Readings in sensor axes.
    #[inline(always)]
    pub fn predict<T: Real>(&self, frame: &FrameMotion<T>, around: &Surroundings<T>, worn: Worn<T>, out: &mut [T]) {
        let root_from_sensor = self.root_from_sensor(frame, worn.mounts);
        let mut at = 0;
        if self.noise.gyro_std.is_some() {
            put(&root_from_sensor, frame.angular_velocity, out, &mut at);
        }
        if self.noise.accel_std.is_some() {
            let arm = self.offset.turned(&frame.rotation, worn.lengths);
            put(&root_from_sensor, frame.proper_acceleration_at(arm), out, &mut at);
        }
        if self.noise.mag_std.is_some() {
            put(&root_from_sensor, around.magnetic_field, out, &mut at);
        }
        if self.noise.rest_std.is_some() {
            put(&root_from_sensor, frame.angular_velocity, out, &mut at);
        }
    }

    /// First row of each of its parts, the first of all being `row`.
    pub(super) fn parts(&self, row: usize) -> Parts {
        let mut next = row;
        let mut part = |std: Option<f64>| {
            std.map(|_| {
                next += 3;
                next - 3
            })
        };
        let noise = &self.noise;
        Parts {
            gyro: part(noise.gyro_std),
            accel: part(noise.accel_std),
            mag: part(noise.mag_std),
            rest: part(noise.rest_std),
        }
    }
}

/// A vector in the axes of a sensor.
#[inline(always)]
fn put<T: Real>(root_from_sensor: &Mat3<T>, v: Vec3<T>, out: &mut [T], at: &mut usize) {
    [out[*at], out[*at + 1], out[*at + 2]] = root_from_sensor.apply_transposed(v).0;
    *at += 3;
}
