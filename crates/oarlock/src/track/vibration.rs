//! Recognises vibration of inertial units: power beyond the band of limbs. Notes use it.
//!
//! An engine, a telephone or a loose mount shakes a unit faster than limbs move, and sampling folds faster vibration back. Third
//! differences of the readings show this power. Each gyroscope and each accelerometer is judged by its own readings alone.

use crate::recording::{Channel, Stream};

/// Third differences of white noise have this variance as a multiple of its own. Of motion up to 10 Hz they keep less than a hundredth at 100 Hz.
const GAIN: f64 = 20.0;
/// Memory of the power, s.
const MEMORY_S: f64 = 0.5;
/// Power beyond this multiple of the variance of the sensor's noise is vibration.
const NAMED: f64 = 25.0;
/// A longer interval between readings starts anew, s: the band beyond limbs is not sampled.
const LONGEST_S: f64 = 0.0125;

/// How a sensor vibrated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Vibration {
    /// Share of the recording in which it vibrated.
    pub share: f64,
    /// Largest root mean square of an axis beyond the band of limbs.
    pub peak: f64,
}

/// Fast changes of a sensor's readings.
#[derive(Debug)]
struct Shaken {
    /// The last three readings, the latest first.
    readings: [[f64; 3]; 3],
    came_s: f64,
    /// Mean square of an axis beyond the band of limbs, and its largest value.
    power: f64,
    peak: f64,
    /// Time with vibration, s.
    shaken_s: f64,
}

/// The vibration of a gyroscope or accelerometer whose noise has this variance; `None` without readings.
pub(super) fn of(stream: &Stream, channel: &Channel, variance: f64) -> Option<Vibration> {
    let first_s = stream.time_s.get(0)?;
    let mut shaken = Shaken::still(variance);
    let mut reading = [0.0; 3];
    for (row, time_s) in stream.time_s.iter().enumerate() {
        channel.values.read(3 * row, &mut reading);
        if reading.iter().all(|x| !x.is_nan()) {
            shaken.take(reading, time_s, variance);
        }
    }
    Some(Vibration { share: shaken.shaken_s / (shaken.came_s - first_s), peak: shaken.peak.sqrt() })
}

impl Shaken {
    const fn still(variance: f64) -> Self {
        Shaken { readings: [[f64::NAN; 3]; 3], came_s: f64::NAN, power: variance, peak: variance, shaken_s: 0.0 }
    }

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
        self.power += dt / MEMORY_S * (square - self.power);
        self.peak = self.power.max(self.peak);
        if self.power > NAMED * variance {
            self.shaken_s += dt;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::Quantity;
    use std::f64::consts::TAU;

    const STEP_S: f64 = 0.01;

    fn vibration(signal: impl Fn(f64) -> f64) -> Vibration {
        let times_s: Vec<f64> = (0..500).map(|k| STEP_S * f64::from(k)).collect();
        let values: Vec<f64> = times_s.iter().flat_map(|&t| [signal(t), 0.0, -signal(t)]).collect();
        let channel = Channel { quantity: Quantity::Gyro, values: values.into() };
        let stream = Stream { name: "unit".into(), time_s: times_s.into(), channels: Vec::new() };
        of(&stream, &channel, 0.01).unwrap()
    }

    #[test]
    fn limbs_do_not_vibrate() {
        assert_eq!(vibration(|t| 10.0 * (TAU * 2.0 * t).sin() + (TAU * 8.0 * t).sin()).share, 0.0);
    }

    #[test]
    fn a_rotor_vibrates() {
        let vibration = vibration(|t| 3.0 * (TAU * 35.0 * t).sin());
        assert!(vibration.peak > 1.7 && vibration.share > 0.9, "{vibration:?}");
    }

    #[test]
    fn a_gap_does_not_vibrate() {
        let jump = |t: f64| if (1.0..2.0).contains(&t) { f64::NAN } else { 5.0 * t };
        assert_eq!(vibration(jump).share, 0.0);
    }
}
