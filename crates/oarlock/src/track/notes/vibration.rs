//! Notes on sensors that vibrated.
//!
//! Noise, an engine, a telephone or a loose mount change readings faster than limbs move, and sampling folds faster vibration back. Third
//! differences of the readings show this power. Each gyroscope and each accelerometer is judged by its own readings alone.

use crate::recording::{Channel, Stream};
use crate::sensor::{Quantity, Source};
use crate::track::run::Run;

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
struct Vibration {
    /// Share of the recording in which it vibrated.
    share: f64,
    /// Largest root mean square of an axis beyond the band of limbs.
    peak: f64,
}

/// Fast changes of a sensor's readings; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shaken {
    /// The last three readings, the latest first.
    readings: [[f64; 3]; 3],
    /// Time of the last one, s.
    came_s: f64,
    /// Mean square of an axis beyond the band of limbs.
    power: f64,
}

/// Share of the time above which a note reports vibration.
const SHARE: f64 = 0.05;

/// One note for each sensor that vibrated.
pub(super) fn notes(run: &Run) -> Vec<String> {
    let sources = &run.tracker().body().suite.sources;
    let of_stream = |stream: &Stream| {
        let source = sources.iter().find(|s| s.name == stream.name);
        source.map_or_else(Vec::new, |source| of_source(source, stream))
    };
    run.recording().streams().flat_map(of_stream).collect()
}

fn of_source(source: &Source, stream: &Stream) -> Vec<String> {
    let note = |(quantity, what, unit)| {
        let channel = stream.channels.iter().find(|c| c.quantity == quantity)?;
        let std =
            source.std[source.parts.iter().find(|p| p.quantity == quantity)?.rows.start - source.parts[0].rows.start];
        let found = vibration_of(stream, channel, std * std)?;
        (found.share > SHARE).then(|| {
            format!(
                "{}: its {what} vibrated faster than limbs move in {:.0} % of the time, by up to {:.1} {unit} (RMS); mount \
                 the unit more firmly, and away from engines and telephones",
                source.name,
                100.0 * found.share,
                found.peak
            )
        })
    };
    let kinds = [(Quantity::Gyro, "gyroscope", "rad/s"), (Quantity::Accel, "accelerometer", "m/s2")];
    kinds.into_iter().filter_map(note).collect()
}

/// The vibration of a gyroscope or accelerometer whose noise has this variance; `None` without readings.
fn vibration_of(stream: &Stream, channel: &Channel, variance: f64) -> Option<Vibration> {
    let first_s = stream.time_s.get(0)?;
    let (mut shaken, mut peak, mut shaken_s, mut reading) = (Shaken::NONE, 0.0f64, 0.0, [0.0; 3]);
    for (row, time_s) in stream.time_s.iter().enumerate() {
        channel.values.read(3 * row, &mut reading);
        if reading.iter().all(|x| !x.is_nan()) {
            let dt = shaken.take(reading, time_s, variance).unwrap_or(0.0);
            peak = peak.max(shaken.power);
            shaken_s += if shaken.power > NAMED * variance { dt } else { 0.0 };
        }
    }
    Some(Vibration { share: shaken_s / (shaken.came_s - first_s), peak: peak.sqrt() })
}

impl Shaken {
    const NONE: Shaken = Shaken { readings: [[f64::NAN; 3]; 3], came_s: f64::NAN, power: f64::NAN };

    /// Adds a reading; the interval before it, s, if the power follows it.
    fn take(&mut self, reading: [f64; 3], time_s: f64, variance: f64) -> Option<f64> {
        let dt = time_s - self.came_s;
        self.came_s = time_s;
        if !(dt > 0.0 && dt < LONGEST_S) {
            self.readings = [reading, [f64::NAN; 3], [f64::NAN; 3]];
            return None;
        }
        let [a, b, c] = self.readings;
        self.readings = [reading, a, b];
        let square = (0..3).map(|i| (reading[i] - 3.0 * (a[i] - b[i]) - c[i]).powi(2)).sum::<f64>() / (3.0 * GAIN);
        if square.is_nan() {
            return None;
        }
        let old = if self.power.is_nan() { variance } else { self.power };
        // A single reading is no vibration: an impossible one must not excuse itself.
        let square = square.min(NAMED * old.max(variance));
        self.power = old + dt / MEMORY_S * (square - old);
        Some(dt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const STEP_S: f64 = 0.01;

    fn vibration(signal: impl Fn(f64) -> f64) -> Vibration {
        let times_s: Vec<f64> = (0..500).map(|k| STEP_S * f64::from(k)).collect();
        let values: Vec<f64> = times_s.iter().flat_map(|&t| [signal(t), 0.0, -signal(t)]).collect();
        let channel = Channel { quantity: Quantity::Gyro, values: values.into() };
        let stream = Stream { name: "unit".into(), time_s: times_s.into(), channels: Vec::new() };
        vibration_of(&stream, &channel, 0.01).unwrap()
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
