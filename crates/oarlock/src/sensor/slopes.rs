//! How every reading answers to the motion of its frame and to how the sensor is worn: rows of the Jacobian.

use super::closure::Loop;
use super::imu::Imu;
use super::position::Position;
use super::{Reader, Suite, Worn};
use crate::kinematics::slopes::{stretched, Kind, Slope, Slopes};
use crate::kinematics::FrameMotion;
use crate::rotation::turn::right_jacobian;
use crate::rotation::Vec3;

/// Where numbers that are no joints stand in the Jacobian.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Places {
    /// Numbers in a row of the Jacobian.
    pub width: usize,
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
}

/// How a body stands and moves, and how that answers to its joints and lengths.
#[derive(Debug, Clone, Copy)]
pub struct Moving<'a> {
    /// All frames.
    pub frames: &'a [FrameMotion<f64>],
    /// Their slopes.
    pub slopes: &'a Slopes,
    /// Of the readings' other columns.
    pub places: &'a Places,
    /// Lengths and mounts.
    pub worn: Worn<'a, f64>,
    /// uT, root axes.
    pub magnetic_field: Vec3<f64>,
    /// Per rad of azimuth.
    pub magnetic_slope: Vec3<f64>,
}

/// Rows of one sensor.
struct Rows<'a> {
    jacobian: &'a mut [f64],
    width: usize,
}

impl Rows<'_> {
    #[inline(always)]
    fn add(&mut self, first: usize, column: usize, v: Vec3<f64>) {
        let at = first * self.width + column;
        let [x, y, z] = v.0;
        self.jacobian[at] += x;
        self.jacobian[at + self.width] += y;
        self.jacobian[at + 2 * self.width] += z;
    }
}

impl Suite {
    /// Writes the rows of every `active` source: derivatives of what `predict` gives. Allocates nothing.
    pub fn slopes(&self, at: Moving, active: &[bool], jacobian: &mut [f64]) {
        let width = at.places.width;
        for ((reader, source), _) in self.readers.iter().zip(&self.sources).zip(active).filter(|(_, &on)| on) {
            let jacobian = &mut jacobian[source.rows.start * width..source.rows.end * width];
            jacobian.fill(0.0);
            let mut rows = Rows { jacobian, width };
            match reader {
                Reader::Imu(s) => s.slopes(at, &mut rows),
                Reader::Encoder(s) => {
                    if let Some(column) = at.places.coordinates[s.coordinate] {
                        rows.jacobian[column] = 1.0;
                    }
                }
                Reader::Position(s) => s.slopes(at, &mut rows),
                Reader::Closure(s) => s.slopes(at, &mut rows),
            }
        }
    }
}

impl Imu {
    fn slopes(&self, at: Moving, rows: &mut Rows) {
        let (motion, field) = (&at.frames[self.frame], at.magnetic_field);
        let root_from_sensor = self.root_from_sensor(motion, at.worn.mounts);
        let seen = |v: Vec3<f64>| root_from_sensor.apply_transposed(v);
        let parts = [self.noise.gyro_std, self.noise.accel_std, self.noise.mag_std, self.noise.rest_std];
        let mut first = 0;
        let [gyro, accel, mag, rest] = parts.map(|std| {
            std.map(|_| {
                first += 3;
                first - 3
            })
        });
        let arm = self.offset.turned(&motion.rotation, at.worn.lengths);
        let place = motion.position + arm;
        let velocity = at.slopes.velocity[self.frame] + motion.angular_velocity.cross(arm);
        at.slopes.felt_by(self.frame, |s: &Slope| {
            if matches!(s.kind, Kind::Turn | Kind::Rate) {
                let spin = seen(s.spin);
                gyro.into_iter().chain(rest).for_each(|row| rows.add(row, s.column, spin));
            }
            if let Some(row) = accel {
                rows.add(row, s.column, seen(s.acceleration(place, velocity)));
            }
            if let (Some(row), Kind::Turn) = (mag, s.kind) {
                rows.add(row, s.column, seen(field.cross(s.turn)));
            }
        });
        if let Some(row) = accel {
            stretched(&self.offset, motion, &at.places.lengths, |column, _, push| rows.add(row, column, seen(push)));
            at.places.bases.iter().for_each(|(column, axis)| rows.add(row, *column, seen(Vec3(*axis))));
        }
        if let (Some(row), Some(column)) = (mag, at.places.azimuth) {
            rows.add(row, column, seen(at.magnetic_slope));
        }
        if let Some((number, value)) = self.mount.and_then(|i| Some((i, at.worn.mounts.get(i)?))) {
            let jacobian = right_jacobian(value.0);
            let read = [motion.angular_velocity, motion.proper_acceleration_at(arm), field, motion.angular_velocity];
            for (row, v) in [gyro, accel, mag, rest].into_iter().zip(read) {
                let Some(row) = row else { continue };
                (0..3).for_each(|k| rows.add(row, at.places.mounts[number] + k, seen(v).cross(jacobian.column(k))));
            }
        }
    }
}

impl Position {
    fn slopes(&self, at: Moving, rows: &mut Rows) {
        let motion = &at.frames[self.frame];
        let place = motion.position + self.point.turned(&motion.rotation, at.worn.lengths);
        at.slopes.felt_by(self.frame, |s| {
            if matches!(s.kind, Kind::Turn | Kind::Shift) {
                rows.add(0, s.column, s.place(place));
            }
        });
        stretched(&self.point, motion, &at.places.lengths, |column, shift, _| rows.add(0, column, shift));
    }
}

impl Loop {
    fn slopes(&self, at: Moving, rows: &mut Rows) {
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let (frame, point) = &self.sides[side];
            let motion = &at.frames[*frame];
            let place = motion.position + point.turned(&motion.rotation, at.worn.lengths);
            let axis = self.axes.map(|axes| motion.rotation.apply_f64(axes[side]));
            at.slopes.felt_by(*frame, |s| {
                if matches!(s.kind, Kind::Turn | Kind::Shift) {
                    rows.add(0, s.column, s.place(place) * sign);
                }
                if let (Some(axis), Kind::Turn) = (axis, s.kind) {
                    rows.add(3, s.column, s.turn.cross(axis) * sign);
                }
            });
            let lengths = &at.places.lengths;
            stretched(point, motion, lengths, |column, shift, _| rows.add(0, column, shift * sign));
        }
    }
}
