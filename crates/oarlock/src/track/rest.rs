//! Rest detection: while an inertial unit rests, its angular velocity is measured as zero, which determines the
//! gyroscope's bias.
//!
//! Rule and thresholds are those of VQF (Laidig and Seel 2023, section 3.4), except the waiting time. Rest is not taken
//! as certain but enters as a reading of zero with a standard deviation, so that a shorter waiting time is safe.

use super::hypothesis::SourceMemory;
use super::readings::Readings;
use crate::body::Body;
use crate::sensor::{Quantity, Source};
use std::ops::Range;

/// Time constant of the low-pass filter that readings are compared with, s.
const SMOOTHED_OVER_S: f64 = 0.5;
/// Time without motion after which a unit counts as at rest, s.
const AFTER_S: f64 = 0.5;
/// Largest deviation from the low-passed reading at rest, rad/s (2 deg/s) and m/s2.
const GYRO_RAD_S: f64 = 0.035;
const ACCEL_M_S2: f64 = 0.5;
/// Shortest interval between readings of rest, s. More frequent ones carry no new information.
const EVERY_S: f64 = 0.1;

/// Memory of a unit for rest detection; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RestState {
    /// Low-passed readings, rad/s and m/s2.
    pub gyro: [f64; 3],
    pub accel: [f64; 3],
    /// Start of the rest, s.
    pub since_s: f64,
    /// Time of the last reading of rest, s.
    pub used_s: f64,
}

/// Rest detector of all units.
#[derive(Debug, Clone)]
pub(super) struct Rest(Vec<Unit>);

/// An inertial unit with rest detection: its source and its rows.
#[derive(Debug, Clone)]
struct Unit {
    source: usize,
    rest: Range<usize>,
    gyro: Range<usize>,
    accel: Range<usize>,
}

impl Rest {
    pub fn new(body: &Body) -> Self {
        let unit = |(source, s): (usize, &Source)| {
            let rows = |q: Quantity| s.parts.iter().find(|p| p.quantity == q).map(|p| p.rows.clone());
            let (rest, gyro, accel) = (rows(Quantity::Rest)?, rows(Quantity::Gyro)?, rows(Quantity::Accel)?);
            Some(Unit { source, rest, gyro, accel })
        };
        Rest(body.suite.sources.iter().enumerate().filter_map(unit).collect())
    }

    /// Writes the readings of units at rest into the sample.
    pub fn notice(&self, sources: &mut [SourceMemory], readings: &mut Readings, time_s: f64) {
        for unit in &self.0 {
            let of_unit = [&readings.z[unit.gyro.clone()], &readings.z[unit.accel.clone()]];
            let SourceMemory { rest, seen_s, .. } = &mut sources[unit.source];
            let rests = rest.remember(of_unit, time_s, time_s - *seen_s);
            readings.z[unit.rest.clone()].fill(if rests { 0.0 } else { f64::NAN });
        }
    }
}

impl RestState {
    pub const NONE: RestState =
        RestState { gyro: [f64::NAN; 3], accel: [f64::NAN; 3], since_s: f64::NAN, used_s: f64::NAN };

    /// Updates a unit's memory with its readings. True if it rests and the last reading of rest is old enough.
    fn remember(&mut self, [gyro, accel]: [&[f64]; 2], time_s: f64, dt: f64) -> bool {
        if gyro.iter().chain(accel).any(|x| x.is_nan()) {
            return false;
        }
        let share = if self.gyro[0].is_nan() { 1.0 } else { 1.0 - (-dt.max(0.0) / SMOOTHED_OVER_S).exp() };
        let calm =
            follow(&mut self.gyro, gyro, share) < GYRO_RAD_S && follow(&mut self.accel, accel, share) < ACCEL_M_S2;
        if !calm || gyro.iter().any(|w| w.abs() > GYRO_RAD_S) {
            self.since_s = f64::NAN;
            return false;
        }
        if self.since_s.is_nan() {
            self.since_s = time_s;
        }
        let due = self.used_s.is_nan() || time_s - self.used_s >= EVERY_S;
        let rests = due && time_s - self.since_s >= AFTER_S;
        if rests {
            self.used_s = time_s;
        }
        rests
    }
}

/// Low-passes one reading and returns the remaining distance.
fn follow(smoothed: &mut [f64; 3], reading: &[f64], share: f64) -> f64 {
    let mut away: f64 = 0.0;
    for (m, x) in smoothed.iter_mut().zip(reading) {
        *m = if share == 1.0 { *x } else { *m + share * (x - *m) };
        away += (x - *m) * (x - *m);
    }
    away.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still_for(seconds: f64, gyro: [f64; 3]) -> usize {
        let mut unit = RestState::NONE;
        let samples = (seconds * 100.0) as usize;
        (0..samples).filter(|&k| unit.remember([&gyro, &[0.0, 0.0, 9.8]], k as f64 * 0.01, 0.01)).count()
    }

    #[test]
    fn rest_is_told_after_half_a_second_ten_times_a_second() {
        assert_eq!(still_for(0.49, [0.01, 0.0, 0.0]), 0);
        assert_eq!(still_for(1.5, [0.01, 0.0, 0.0]), 10);
    }

    #[test]
    fn a_steady_turn_is_no_rest() {
        assert_eq!(still_for(3.0, [0.1, 0.0, 0.0]), 0);
    }

    #[test]
    fn a_move_ends_rest_and_a_gap_does_not() {
        let mut unit = RestState::NONE;
        let still = [0.0, 0.0, 9.8];
        let mut at = |t: f64, gyro: [f64; 3]| unit.remember([&gyro, &still], t, 0.01);
        assert!(!at(0.0, [0.0; 3]));
        assert!(at(0.6, [0.0; 3]));
        assert!(!at(0.7, [f64::NAN; 3]));
        assert!(at(0.8, [0.0; 3]));
        assert!(!at(0.9, [0.5, 0.0, 0.0]));
        assert!(!at(1.0, [0.0; 3]));
    }
}
