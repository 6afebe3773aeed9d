//! Vibration: raises the noise of a sensor by what it reads beyond the band of limbs. Steps and notes use it.
//!
//! An engine, a telephone or a loose mount shakes a unit faster than limbs move, and sampling folds faster vibration back. The motion of a
//! model cannot follow, so this power is noise. It is measured in the readings of each sensor alone: a factor from joint innovations
//! would also reduce the weight of sensors that are calm.

use super::hypothesis::SourceMemory;
use super::readings::Readings;
use super::subject::Subject;
use crate::sensor::Quantity;

/// Third differences of white noise have this variance as a multiple of its own. Of motion up to 10 Hz they keep less than a hundredth at 100 Hz.
const GAIN: f64 = 20.0;
/// Memory of the power, s.
const MEMORY_S: f64 = 0.5;
/// Power up to this multiple of the variance of the sensor's noise counts as noise.
const CHANCE: f64 = 2.0;
/// Power beyond this multiple is named vibration.
const NAMED: f64 = 25.0;
/// A longer interval between readings starts anew, s: the band beyond limbs is not sampled.
const LONGEST_S: f64 = 0.0125;

/// Fast changes of a sensor's readings; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shaken {
    /// The last three readings, the latest first.
    pub(super) readings: [[f64; 3]; 3],
    /// Time of the last reading, s.
    pub(super) came_s: f64,
    /// Mean square of an axis beyond the band of limbs.
    pub(super) power: f64,
    /// Its largest value.
    pub(super) peak: f64,
    /// How long it was named vibration, s.
    pub(super) shaken_s: f64,
}

/// Memory of an inertial unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VibrationState {
    /// Of the gyroscope.
    pub(super) gyro: Shaken,
    /// Of the accelerometer.
    pub(super) accel: Shaken,
}

impl VibrationState {
    pub(super) const NONE: VibrationState = VibrationState { gyro: Shaken::NONE, accel: Shaken::NONE };

    fn of(&mut self, quantity: Quantity) -> Option<&mut Shaken> {
        match quantity {
            Quantity::Gyro => Some(&mut self.gyro),
            Quantity::Accel => Some(&mut self.accel),
            _ => None,
        }
    }

    pub(super) fn numbers(&mut self) -> impl Iterator<Item = &mut f64> {
        [&mut self.gyro, &mut self.accel].into_iter().flat_map(|shaken| {
            let Shaken { readings, came_s, power, peak, shaken_s } = shaken;
            readings.iter_mut().flatten().chain([came_s, power, peak, shaken_s])
        })
    }
}

/// Follows the readings of all inertial units.
pub(super) fn notice(subject: &Subject, sources: &mut [SourceMemory], readings: &Readings, time_s: f64) {
    for (p, rows) in subject.groups.parts.iter().enumerate() {
        let s = subject.source_of_part[p];
        let Some(shaken) = sources[s].vibration.of(subject.quantities[p]) else { continue };
        let reading = readings.three(rows.start);
        if reading.iter().all(|x| !x.is_nan()) {
            shaken.take(reading, time_s + readings.offset_s[s], subject.std[rows.start].powi(2));
        }
    }
}

/// Adds the power of vibration to the noise.
pub(super) fn raise(subject: &Subject, sources: &[SourceMemory], readings: &mut Readings) {
    for (p, rows) in subject.groups.parts.iter().enumerate() {
        let mut vibration = sources[subject.source_of_part[p]].vibration;
        let Some(shaken) = vibration.of(subject.quantities[p]) else { continue };
        let excess = shaken.power - CHANCE * subject.std[rows.start].powi(2);
        if excess > 0.0 {
            readings.std[rows.clone()].iter_mut().for_each(|std| *std = std.hypot(excess.sqrt()));
        }
    }
}

impl Shaken {
    const NONE: Shaken =
        Shaken { readings: [[f64::NAN; 3]; 3], came_s: f64::NAN, power: f64::NAN, peak: f64::NAN, shaken_s: f64::NAN };

    fn take(&mut self, reading: [f64; 3], time_s: f64, variance: f64) {
        let dt = time_s - self.came_s;
        self.came_s = time_s;
        if !(dt > 0.0 && dt < LONGEST_S) {
            self.readings = [reading, [f64::NAN; 3], [f64::NAN; 3]];
            return;
        }
        let [a, b, c] = self.readings;
        self.readings = [reading, a, b];
        let square = (0..3).map(|i| (reading[i] - 3.0 * (a[i] - b[i]) - c[i]).powi(2)).sum::<f64>() / (3.0 * GAIN);
        if square.is_nan() {
            return;
        }
        let old = if self.power.is_nan() { variance } else { self.power };
        self.power = old + dt / MEMORY_S * (square - old);
        self.peak = self.power.max(self.peak);
        if self.power > NAMED * variance {
            self.shaken_s = dt + if self.shaken_s.is_nan() { 0.0 } else { self.shaken_s };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const STEP_S: f64 = 0.01;

    fn after(signal: impl Fn(f64) -> f64) -> Shaken {
        let mut shaken = Shaken::NONE;
        for k in 0..500 {
            let t = STEP_S * f64::from(k);
            shaken.take([signal(t), 0.0, -signal(t)], t, 0.01);
        }
        shaken
    }

    #[test]
    fn limbs_do_not_vibrate() {
        let shaken = after(|t| 10.0 * (TAU * 2.0 * t).sin() + (TAU * 8.0 * t).sin());
        assert!(shaken.power < 0.01 && shaken.shaken_s.is_nan(), "{shaken:?}");
    }

    #[test]
    fn a_rotor_vibrates() {
        let shaken = after(|t| 3.0 * (TAU * 35.0 * t).sin());
        assert!(shaken.power > 3.0 && shaken.shaken_s > 4.5, "{shaken:?}");
    }
}
