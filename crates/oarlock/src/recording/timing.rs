//! What time stamps tell of a recording: whether its sensors tick together, at which rates, and how exact the stamps are.

use super::{Channel, Recording, Sample, Stream};
use crate::config::Config;
use crate::corrections::Clock;
use crate::error::Result;
use crate::model::Model;
use crate::sensor::{Quantity, Suite};
use std::collections::BTreeMap;

/// Sensors tick together if a sample for each instant gives at most this many times the readings of the fullest stream:
/// lost packets make the fullest stream shorter.
const TOGETHER: f64 = 1.25;
/// A rate within this share of a multiple of 5 Hz is that multiple, and any other a whole number of Hz.
const NICE_SHARE: f64 = 0.002;
/// Ticks may be slower than the fastest stream by this share: its surplus readings have slots between them.
const SLOWER_SHARE: f64 = 0.02;
/// A smaller standard deviation of time stamps is rounding, s.
const LEAST_STD_S: f64 = 1e-6;
/// Output rows count as even if they are within this of their rate's times, s.
const EVEN_S: f64 = 1e-6;

/// A recording's streams with the body that they belong to.
pub struct Streams<'a> {
    /// The model as its file has it.
    pub model: &'a Model,
    /// Its sensors.
    pub suite: &'a Suite,
    /// Per source and joint: whether the source's readings depend on the joint.
    pub depends: &'a [Vec<bool>],
    /// The streams.
    pub streams: &'a [Stream],
    /// Clocks by stream.
    pub clocks: &'a BTreeMap<String, Clock>,
}

impl Streams<'_> {
    /// The configuration with all that it leaves to be found from the time stamps.
    pub fn settle(&self, config: &Config) -> Result<Config> {
        let census = self.census(config)?;
        let mut found = config.clone();
        let together = census.together && (config.row_rate_hz().is_none() || census.even_rows);
        let sample_rate_hz = config.sample_rate_hz.unwrap_or_else(|| {
            if together {
                return 0.0;
            }
            let row_hz = config.row_rate_hz().unwrap_or_else(|| self.clean_rate_hz());
            row_hz * (self.fastest_hz(|_| true) / row_hz - SLOWER_SHARE).ceil().max(1.0)
        });
        let apart = sample_rate_hz > 0.0;
        found.sample_rate_hz = Some(sample_rate_hz);
        found.output_rate_hz.get_or_insert_with(|| if apart { self.clean_rate_hz() } else { 0.0 });
        found.inputs.get_or_insert_with(|| self.inputs(if apart { &[] } else { &census.complete }));
        let jitter = || {
            let stds = self.streams.iter().map(|s| (s.name.clone(), jitter_s(&self.times(s))));
            stds.filter(|(_, std_s)| *std_s > LEAST_STD_S).collect()
        };
        found.stamp_std_s.get_or_insert_with(|| if apart { jitter() } else { BTreeMap::new() });
        Ok(found)
    }

    /// Goes through the instants of the recording once.
    fn census(&self, config: &Config) -> Result<Census> {
        let instants = Config { sample_rate_hz: None, ..config.clone() }.gathering();
        let recording = Recording::new(self.model, self.suite, self.streams.to_vec(), self.clocks, instants)?;
        let (mut cursor, mut sample) = (recording.start(), Sample::empty(self.model, self.suite));
        let inputs: Vec<usize> = self.model.joints.iter().filter(|j| j.input).map(|j| j.first).collect();
        let (mut present, mut instants, mut even_rows) = (vec![0_usize; inputs.len()], 0_usize, true);
        let rate_hz = config.row_rate_hz().unwrap_or(f64::INFINITY);
        let mut row = f64::NAN;
        while recording.next(&mut cursor, &mut sample) {
            instants += 1;
            for (count, &c) in present.iter_mut().zip(&inputs) {
                *count += usize::from(!sample.inputs[c].is_nan());
            }
            let slot = (sample.time_s * rate_hz + rate_hz * EVEN_S).floor();
            if slot != row {
                even_rows &= (sample.time_s - slot / rate_hz).abs() < EVEN_S;
                row = slot;
            }
        }
        let fullest = self.streams.iter().map(|s| s.time_s.len()).max().unwrap_or(0);
        let complete = inputs.iter().zip(present).filter(|(_, count)| *count == instants).map(|(&c, _)| c).collect();
        Ok(Census { together: instants as f64 <= TOGETHER * fullest as f64, even_rows, complete })
    }

    /// Input joints that stay inputs: the complete ones (by coordinate), and those that no stream tells of and no reading
    /// depends on.
    fn inputs(&self, complete: &[usize]) -> Vec<String> {
        let told = |j: usize| self.streams.iter().any(|s| super::input_joint(self.model, &s.name) == Some(j));
        let matters = |j: usize| told(j) || self.depends.iter().any(|joints| joints[j]);
        let joints = self.model.joints.iter().enumerate().filter(|(_, joint)| joint.input);
        let kept = joints.filter(|(j, joint)| complete.contains(&joint.first) || !matters(*j));
        kept.map(|(_, joint)| joint.name.clone()).collect()
    }

    /// Rate of the fastest inertial unit, or of the fastest stream, as a person would write it, Hz.
    fn clean_rate_hz(&self) -> f64 {
        let is_inertial = |c: &Channel| c.quantity.is_inertial() || c.quantity == Quantity::Orientation;
        let inertial_hz = self.fastest_hz(|s| s.channels.iter().any(is_inertial));
        nice(if inertial_hz > 0.0 { inertial_hz } else { self.fastest_hz(|_| true) })
    }

    fn fastest_hz(&self, of: impl Fn(&Stream) -> bool) -> f64 {
        let rates = self.streams.iter().filter(|s| of(s)).filter_map(|s| Some(1.0 / median_step_s(&self.times(s))?));
        rates.fold(0.0, f64::max)
    }

    fn times(&self, stream: &Stream) -> Vec<f64> {
        let clock = self.clocks.get(&stream.name).copied().unwrap_or_default();
        stream.time_s.iter().map(|stamp_s| clock.true_s(stamp_s)).collect()
    }
}

/// What one pass through the instants counts.
struct Census {
    together: bool,
    /// Whether rows at the output rate fall on instants.
    even_rows: bool,
    /// Coordinates of inputs that every instant reads.
    complete: Vec<usize>,
}

/// A rate as a person would write it, Hz.
fn nice(rate_hz: f64) -> f64 {
    if rate_hz < 1.0 {
        return if rate_hz > 0.0 { 1.0 / (1.0 / rate_hz).round() } else { 1.0 };
    }
    let five = 5.0 * (rate_hz / 5.0).round();
    if (five - rate_hz).abs() <= NICE_SHARE * rate_hz {
        five
    } else {
        rate_hz.round()
    }
}

fn median_step_s(times: &[f64]) -> Option<f64> {
    median(times.windows(2).map(|pair| pair[1] - pair[0]).collect())
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Standard deviation of time stamps about a regular clock, s: from the median distance of neighbours from whole multiples of
/// the usual interval.
fn jitter_s(times: &[f64]) -> f64 {
    let Some(step_s) = median_step_s(times).filter(|step_s| *step_s > 0.0) else { return 0.0 };
    let off = |pair: &[f64]| {
        let steps = (pair[1] - pair[0]) / step_s;
        (steps - steps.round().max(1.0)).abs() * step_s
    };
    // 1.4826 medians of a normal distribution are its standard deviation; a difference has two stamps.
    1.4826 / std::f64::consts::SQRT_2 * median(times.windows(2).map(off).collect()).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::{jitter_s, nice};

    #[test]
    fn rates_are_those_that_a_person_would_write() {
        for (rate_hz, expected) in [(124.97, 125.0), (286.0, 286.0), (97.3, 97.0), (59.99, 60.0), (0.498, 0.5)] {
            assert!((nice(rate_hz) - expected).abs() < 1e-12, "{rate_hz}: {}", nice(rate_hz));
        }
    }

    #[test]
    fn jitter_is_found_beside_lost_readings() {
        // Alternating by 1 ms either way: neighbours differ by 2 ms from the interval, as those of a normal distribution
        // with 0.95 ms do in the median.
        let times: Vec<f64> =
            (0..400).filter(|i| i % 20 != 7).map(|i| 0.01 * f64::from(i) + 1e-3 * f64::from(i % 2)).collect();
        assert!((jitter_s(&times) - 1.05e-3).abs() < 2e-4, "{}", jitter_s(&times));
        let regular: Vec<f64> = (0..400).map(|i| 0.01 * f64::from(i)).collect();
        assert!(jitter_s(&regular) < 1e-12);
    }
}
