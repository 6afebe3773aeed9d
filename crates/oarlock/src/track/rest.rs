//! Rest: while an inertial unit's readings stay where they are, its angular velocity is zero, which tells its gyroscope's bias.
//!
//! The rule and its thresholds are those of VQF (Laidig and Seel 2023, section 3.4), but for the waiting time: rest is not
//! taken as certain, only as a reading of zero with a standard deviation, so that a shorter wait does no harm.

use super::Tracker;
use crate::estimate::belief::{Belief, MEMORY};
use crate::sensor::Quantity;

/// Time constant of the low-pass that readings are compared with, s.
const SMOOTHED_OVER_S: f64 = 0.5;
/// Rest is believed after so long, s.
const AFTER_S: f64 = 0.5;
/// Farther from the low-passed reading than this is no rest, rad/s (2 deg/s) and m/s2.
const GYRO_RAD_S: f64 = 0.035;
const ACCEL_M_S2: f64 = 0.5;
/// Readings of rest are no more frequent than this, s: neighbours say the same.
const EVERY_S: f64 = 0.1;

/// Places in a source's memory: smoothed gyroscope, smoothed accelerometer, since when it rests, when that was last used.
const GYRO: usize = 0;
const ACCEL: usize = 3;
const SINCE: usize = 6;
const USED: usize = 7;

impl Tracker {
    /// Fills in the rows of units that rest.
    pub(super) fn notice_rest(&mut self, belief: &mut Belief) {
        for s in 0..self.body.suite.sources.len() {
            let source = &self.body.suite.sources[s];
            let rows = |q: Quantity| source.parts.iter().find(|p| p.quantity == q).map(|p| p.rows.clone());
            let (Some(rest), Some(gyro), Some(accel)) =
                (rows(Quantity::Rest), rows(Quantity::Gyro), rows(Quantity::Accel))
            else {
                continue;
            };
            let readings = [&self.z[gyro], &self.z[accel]];
            let rests = remember(&mut belief.memory[s], readings, belief.time_s, belief.time_s - belief.seen_s[s]);
            self.z[rest].fill(if rests { 0.0 } else { f64::NAN });
        }
    }
}

/// Takes in a unit's readings; whether it rests and has not said so just now.
fn remember(memory: &mut [f64; MEMORY], [gyro, accel]: [&[f64]; 2], time_s: f64, dt: f64) -> bool {
    if gyro.iter().chain(accel).any(|x| x.is_nan()) {
        return false;
    }
    let share = if memory[GYRO].is_nan() { 1.0 } else { 1.0 - (-dt.max(0.0) / SMOOTHED_OVER_S).exp() };
    let mut follow = |first: usize, reading: &[f64]| {
        let mut away: f64 = 0.0;
        for (m, x) in memory[first..first + 3].iter_mut().zip(reading) {
            *m = if share == 1.0 { *x } else { *m + share * (x - *m) };
            away += (x - *m) * (x - *m);
        }
        away.sqrt()
    };
    let calm = follow(GYRO, gyro) < GYRO_RAD_S && follow(ACCEL, accel) < ACCEL_M_S2;
    if !calm || gyro.iter().any(|w| w.abs() > GYRO_RAD_S) {
        memory[SINCE] = f64::NAN;
        return false;
    }
    if memory[SINCE].is_nan() {
        memory[SINCE] = time_s;
    }
    let due = memory[USED].is_nan() || time_s - memory[USED] >= EVERY_S;
    let rests = due && time_s - memory[SINCE] >= AFTER_S;
    if rests {
        memory[USED] = time_s;
    }
    rests
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still_for(seconds: f64, gyro: [f64; 3]) -> usize {
        let mut memory = [f64::NAN; MEMORY];
        let samples = (seconds * 100.0) as usize;
        (0..samples).filter(|&k| remember(&mut memory, [&gyro, &[0.0, 0.0, 9.8]], k as f64 * 0.01, 0.01)).count()
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
        let mut memory = [f64::NAN; MEMORY];
        let still = [0.0, 0.0, 9.8];
        let mut at = |t: f64, gyro: [f64; 3]| remember(&mut memory, [&gyro, &still], t, 0.01);
        assert!(!at(0.0, [0.0; 3]));
        assert!(at(0.6, [0.0; 3]));
        assert!(!at(0.7, [f64::NAN; 3]));
        assert!(at(0.8, [0.0; 3]));
        assert!(!at(0.9, [0.5, 0.0, 0.0]));
        assert!(!at(1.0, [0.0; 3]));
    }
}
