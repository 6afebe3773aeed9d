//! How late a magnetometer's readings are against the gyroscope of their unit, for `magnetic`.
//!
//! A magnetometer averages, is read at a rate of its own and often repeated, so that its readings are 5 to 20 ms late. In a turn the field
//! then seems rotated about the axis of the turn: at 6 rad/s and a steep field, 15 ms are 15 deg of heading, and turns to one side do not
//! average out. The unit's own gyroscope rotates the low-passed field into the present axes. What the readings deviate from it, in proportion to
//! the change of the field's derivative, is the lag: neither the posture nor the direction of the field enters.

use super::iron::dot;
use super::lasting_variance;
use crate::rotation::{Mat3, Vec3};

/// Standard deviation of the lag before any reading, s: a period of a magnetometer that is read at 50 to 100 Hz.
const PRIOR_S: f64 = 0.015;
/// Time over which readings are compared with those before, s. Iron in the room changes the field over longer times.
const COMPARED_S: f64 = 0.5;
/// Standard deviation of what iron changes meanwhile, as a share of the field's norm.
const BENT: f64 = 0.05;
/// A longer interval between the gyroscope's readings starts anew, s: the rotation meanwhile is not known.
const LONGEST_S: f64 = 0.05;
/// Chi-square of one degree of freedom that chance exceeds once in a thousand: below it there is no lag.
const CHANCE: f64 = 10.8;

/// The lag of a magnetometer; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::track) struct LagState {
    /// Time of the gyroscope's last reading, s, and that reading, rad/s.
    pub came_s: f64,
    pub rate: [f64; 3],
    /// Time of the last field, s.
    pub read_s: f64,
    /// Low-passed field in the present axes, uT, and by how much a lag changes it, uT/s.
    pub field_ut: [f64; 3],
    pub slope: [f64; 3],
    /// Mean and variance of the lag, s.
    pub mean_s: f64,
    pub variance_s2: f64,
}

impl LagState {
    pub const NONE: LagState = LagState {
        came_s: f64::NAN,
        rate: [f64::NAN; 3],
        read_s: f64::NAN,
        field_ut: [f64::NAN; 3],
        slope: [f64::NAN; 3],
        mean_s: f64::NAN,
        variance_s2: f64::NAN,
    };

    pub fn numbers(&mut self) -> impl Iterator<Item = &mut f64> {
        let LagState { came_s, rate, read_s, field_ut, slope, mean_s, variance_s2 } = self;
        let vectors = rate.iter_mut().chain(field_ut).chain(slope);
        [came_s, read_s, mean_s, variance_s2].into_iter().chain(vectors)
    }

    /// The lag, s: the mean, reduced as far as it may be chance.
    fn known_s(&self) -> f64 {
        let chi_square = self.mean_s * self.mean_s / self.variance_s2;
        if chi_square > CHANCE {
            self.mean_s * (1.0 - CHANCE / chi_square)
        } else {
            0.0
        }
    }

    /// The field now, of one that was read with the lag.
    pub fn undo(&self, field: Vec3<f64>, time_s: f64) -> Vec3<f64> {
        let known_s = self.known_s();
        if known_s == 0.0 || time_s - self.came_s > LONGEST_S {
            return field;
        }
        Mat3::about(Vec3(self.rate) * -known_s).apply(field)
    }

    /// Rotates the low-passed field by a reading of the gyroscope, rad/s.
    pub fn turn(&mut self, rate: Vec3<f64>, time_s: f64) {
        let dt = time_s - self.came_s;
        let mean_rate = (Vec3(self.rate) + rate) * 0.5;
        (self.came_s, self.rate) = (time_s, rate.0);
        if dt > 0.0 && dt < LONGEST_S {
            let turn = Mat3::about(mean_rate * -dt);
            self.field_ut = turn.apply(Vec3(self.field_ut)).0;
            self.slope = turn.apply(Vec3(self.slope)).0;
        } else {
            self.read_s = f64::NAN;
        }
    }

    /// Adds a field, uT. Without a gyroscope's reading at the same time it is ignored.
    pub fn follow(&mut self, field: Vec3<f64>, norm_ut: f64, time_s: f64) {
        if self.came_s != time_s {
            return;
        }
        let slope = Vec3(self.rate).cross(field);
        let dt = self.came_s - self.read_s;
        self.read_s = self.came_s;
        if dt.is_nan() {
            (self.field_ut, self.slope) = (field.0, slope.0);
            return;
        }
        if self.mean_s.is_nan() {
            (self.mean_s, self.variance_s2) = (0.0, PRIOR_S * PRIOR_S);
        }
        let (off, by) = (field - Vec3(self.field_ut), slope - Vec3(self.slope));
        self.learn(off - by * self.mean_s, by, (BENT * norm_ut).powi(2), dt);
        let share = 1.0 - (-dt / COMPARED_S).exp();
        self.field_ut = (Vec3(self.field_ut) + off * share).0;
        self.slope = (Vec3(self.slope) + by * share).0;
    }

    /// A residual that the lag changes by `by` per second.
    fn learn(&mut self, residual: Vec3<f64>, by: Vec3<f64>, noise: f64, dt: f64) {
        let noise = lasting_variance(noise, dot(residual, residual), dt);
        let expected = noise + self.variance_s2 * dot(by, by);
        self.mean_s += self.variance_s2 / expected * dot(by, residual);
        self.variance_s2 *= noise / expected;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIELD_UT: f64 = 45.0;
    const STEP_S: f64 = 0.01;

    /// The lag that is found in a minute, of a unit that swings about two axes. One reading of the gyroscope in `missing` is not there.
    fn found_without_s(lag_s: f64, iron: Vec3<f64>, missing: i32) -> f64 {
        let rate = |t: f64| Vec3([4.0 * (5.0 * t).sin(), 0.0, 3.0 * (3.0 * t).cos()]);
        let mut state = LagState::NONE;
        let mut field = Vec3([0.4 * FIELD_UT, 0.0, -(0.84f64.sqrt()) * FIELD_UT]);
        for k in 0..6000 {
            let t = STEP_S * f64::from(k);
            let late = Mat3::about(rate(t - 0.5 * lag_s) * lag_s).apply(field);
            if k % missing != 0 {
                state.turn(rate(t), t);
            }
            state.follow(late + iron, FIELD_UT, t);
            field = Mat3::about(rate(t + 0.5 * STEP_S) * -STEP_S).apply(field);
        }
        state.known_s()
    }

    fn found_s(lag_s: f64, iron: Vec3<f64>) -> f64 {
        found_without_s(lag_s, iron, i32::MAX)
    }

    #[test]
    fn a_missing_reading_of_the_gyroscope_loses_nothing() {
        let found_s = found_without_s(0.015, Vec3([0.0; 3]), 50);
        assert!(found_s > 0.0125 && found_s < 0.0155, "{found_s}");
    }

    #[test]
    fn a_late_magnetometer_is_found() {
        // The prior and the reduction of what may be chance leave a tenth.
        let found_s = found_s(0.015, Vec3([0.0; 3]));
        assert!(found_s > 0.0135 && found_s < 0.0152, "{found_s}");
    }

    #[test]
    fn iron_is_no_lag() {
        assert_eq!(found_s(0.0, Vec3([2.0, -3.0, 2.0])), 0.0);
    }

    #[test]
    fn a_punctual_magnetometer_is_not_corrected_to_the_bit() {
        assert_eq!(found_s(0.0, Vec3([0.0; 3])), 0.0);
    }

    #[test]
    fn a_field_is_brought_to_the_present() {
        let state = LagState { came_s: 1.0, rate: [0.0, 0.0, 2.0], mean_s: 0.01, variance_s2: 1e-12, ..LagState::NONE };
        let now = state.undo(Vec3([10.0, 0.0, 5.0]), 1.0);
        assert!((now.0[1] + 0.2).abs() < 1e-3 && now.0[2] == 5.0, "{now:?}");
    }
}
