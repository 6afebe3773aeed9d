//! Stance detection: while a link stands on the ground, the velocity of its contact point is measured as zero.
//!
//! The detector compares turn rate and specific force with those of a body at rest, as those of Skog, Haendel, Nilsson
//! and Rantakokko (2010), but reading by reading: a low-pass filter would remember the impact of the heel through most of
//! the stance. A foot that rests in the air has no velocity either.

use super::hypothesis::SourceMemory;
use super::readings::Readings;
use crate::body::Body;
use crate::sensor::{Quantity, Source};
use std::ops::Range;

/// Turn rate, rad/s, and difference of the specific force from gravity, m/s2, of a standing foot: usual size.
const GYRO_RAD_S: f64 = 0.5;
const ACCEL_M_S2: f64 = 1.0;
/// A stance begins below the first and ends above the second: sum of both squares, relative to the usual ones.
const BEGINS_BELOW: f64 = 1.0;
const ENDS_ABOVE: f64 = 2.0;
/// Time after which a stance is certain enough, s. The foot of a swinging leg is as quiet for an instant only.
const AFTER_S: f64 = 0.07;
/// Shortest interval between readings, s: errors of the velocity, such as a shoe that rolls, last as long.
const EVERY_S: f64 = 0.05;

/// Memory of a unit for stance detection; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StanceState {
    /// Start of the stance, s.
    pub since_s: f64,
    /// Time of the last reading, s.
    pub used_s: f64,
}

/// Stance detector of all units with a contact.
#[derive(Debug, Clone)]
pub(super) struct Stance {
    units: Vec<Unit>,
    gravity_m_s2: f64,
}

/// A unit with a contact: its source and its rows.
#[derive(Debug, Clone)]
struct Unit {
    source: usize,
    contact: Range<usize>,
    gyro: Range<usize>,
    accel: Range<usize>,
}

impl Stance {
    pub fn new(body: &Body, is_on: bool) -> Self {
        let unit = |(source, s): (usize, &Source)| {
            let rows = |q: Quantity| s.parts.iter().find(|p| p.quantity == q).map(|p| p.rows.clone());
            let (contact, gyro, accel) = (rows(Quantity::Contact)?, rows(Quantity::Gyro)?, rows(Quantity::Accel)?);
            Some(Unit { source, contact, gyro, accel })
        };
        let units = body.suite.sources.iter().enumerate().filter(|_| is_on).filter_map(unit).collect();
        Stance { units, gravity_m_s2: body.model.world.gravity_m_s2 }
    }

    /// Writes the readings of standing points into the sample.
    pub fn notice(&self, sources: &mut [SourceMemory], readings: &mut Readings, time_s: f64) {
        for unit in &self.units {
            let [turn, force] = [&unit.gyro, &unit.accel].map(|rows| norm(&readings.z[rows.clone()]));
            let stands = sources[unit.source].stance.remember(turn, force - self.gravity_m_s2, time_s);
            readings.z[unit.contact.clone()].fill(if stands { 0.0 } else { f64::NAN });
        }
    }
}

impl StanceState {
    pub const NONE: StanceState = StanceState { since_s: f64::NAN, used_s: f64::NAN };

    /// Updates a unit's memory with its turn rate (rad/s) and the excess of its specific force over gravity (m/s2). True
    /// if its link stands and the last reading is old enough.
    fn remember(&mut self, turn: f64, excess: f64, time_s: f64) -> bool {
        let unrest = (turn / GYRO_RAD_S).powi(2) + (excess / ACCEL_M_S2).powi(2);
        if unrest.is_nan() {
            return false;
        }
        let limit = if self.since_s.is_nan() { BEGINS_BELOW } else { ENDS_ABOVE };
        if unrest > limit {
            self.since_s = f64::NAN;
            return false;
        }
        if self.since_s.is_nan() {
            self.since_s = time_s;
        }
        let due = self.used_s.is_nan() || time_s - self.used_s >= EVERY_S;
        let stands = due && time_s - self.since_s >= AFTER_S;
        if stands {
            self.used_s = time_s;
        }
        stands
    }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of readings in this time at 100 Hz.
    fn stood_for(seconds: f64, turn: f64, excess: f64) -> usize {
        let mut unit = StanceState::NONE;
        let samples = (seconds * 100.0).round() as usize;
        (0..samples).filter(|&k| unit.remember(turn, excess, k as f64 * 0.01)).count()
    }

    #[test]
    fn a_stance_counts_after_a_short_time_and_then_twenty_times_a_second() {
        assert_eq!(stood_for(0.07, 0.3, 0.5), 0);
        assert!((17..=19).contains(&stood_for(1.0, 0.3, 0.5)));
    }

    #[test]
    fn a_swinging_foot_does_not_stand() {
        assert_eq!(stood_for(1.0, 0.0, 1.1), 0);
        assert_eq!(stood_for(1.0, 0.6, 0.0), 0);
    }

    #[test]
    fn a_stance_ends_later_than_it_begins() {
        let mut unit = StanceState::NONE;
        assert!(!unit.remember(0.3, 0.0, 0.0));
        assert!(unit.remember(0.6, 0.0, 0.1));
        assert!(!unit.remember(f64::NAN, 0.0, 0.2));
        assert!(unit.remember(0.6, 0.0, 0.3));
        assert!(!unit.remember(0.8, 0.0, 0.4));
        assert!(!unit.remember(0.6, 0.0, 0.5));
    }
}
