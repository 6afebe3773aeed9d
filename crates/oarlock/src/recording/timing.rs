//! What time stamps tell of a recording: whether its sensors tick together, at which rates, and how exact the stamps are.

use super::own_rows::lacks;
use super::rows::Rows;
use super::{Channel, Gathering, Recording, Sample, Stream};
use crate::config::Config;
use crate::corrections::Clock;
use crate::error::Result;
use crate::model::Model;
use crate::sensor::{Quantity, Suite};
use std::cell::LazyCell;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Sensors tick together if a sample for each instant gives at most this many times the readings of the fullest stream:
/// lost packets make the fullest stream shorter.
const TOGETHER: f64 = 1.25;
/// Up to this many times, every instant is a sample if all streams are inertial units: readings at ticks lose accuracy
/// over their offsets. With encoders ticks are as accurate and need half the time, because joints and closures are read together.
const EVERY_INSTANT: f64 = 2.25;
/// A rate within this share of a multiple of 5 Hz is that multiple, and any other a whole number of Hz.
const NICE_SHARE: f64 = 0.002;
/// Ticks may be slower than the fastest stream by this share: its surplus readings have slots between them.
const SLOWER_SHARE: f64 = 0.02;
/// A silence is longer than this many usual steps.
const SILENT_STEPS: f64 = 20.0;
/// A smaller standard deviation of time stamps is rounding, s.
const LEAST_STD_S: f64 = 1e-6;

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
        let fit = || self.streams.iter().map(|s| RegularClock::of(&self.times(s))).collect::<Vec<_>>();
        let clocks = LazyCell::new(fit);
        let mut found = config.clone();
        let is_inertial_only = self.streams.iter().all(is_inertial);
        let together = census.share <= TOGETHER && (is_inertial_only || census.even_rows);
        let sample_rate_hz = config.sample_rate_hz.unwrap_or_else(|| {
            if together || (is_inertial_only && census.share <= EVERY_INSTANT) {
                return 0.0;
            }
            let row_hz = config.row_rate_hz().unwrap_or_else(|| self.clean_rate_hz(&clocks));
            row_hz * (self.fastest_hz(&clocks, |_| true) / row_hz - SLOWER_SHARE).ceil().max(1.0)
        });
        let apart = sample_rate_hz > 0.0 || (config.sample_rate_hz.is_none() && !together);
        found.sample_rate_hz = Some(sample_rate_hz);
        found.output_rate_hz.get_or_insert_with(|| if apart { self.clean_rate_hz(&clocks) } else { 0.0 });
        found.inputs.get_or_insert_with(|| self.inputs(if apart { &[] } else { &census.complete }));
        let jitter = || {
            let std = |(s, clock): (&Stream, &Option<RegularClock>)| Some((s.name.clone(), clock.as_ref()?.jitter_s));
            self.streams.iter().zip(clocks.iter()).filter_map(std).filter(|(_, std_s)| *std_s > LEAST_STD_S).collect()
        };
        found.stamp_std_s.get_or_insert_with(|| if apart { jitter() } else { BTreeMap::new() });
        Ok(found)
    }

    /// Goes through the instants of the recording once.
    fn census(&self, config: &Config) -> Result<Census> {
        let instants = Gathering::of(&Config { sample_rate_hz: None, ..config.clone() });
        let recording = Recording::new(self.model, self.suite, self.streams.to_vec(), self.clocks, instants)?;
        let (mut cursor, mut sample, mut taken) = (recording.start(), Sample::empty(self.model, self.suite), 0);
        let inputs: Vec<usize> = self.model.joints.iter().filter(|j| j.input).map(|j| j.first).collect();
        let (mut present, mut samples, mut instants) = (vec![0_usize; inputs.len()], 0_usize, 0_usize);
        let rows = config.row_rate_hz().map(Rows::new);
        let (mut even_rows, mut row) = (true, f64::NAN);
        while recording.next(&mut cursor, &mut sample) {
            samples += 1;
            if cursor.taken() > taken {
                instants += 1;
                let here = rows.map_or(f64::NAN, |rows| rows.slot(sample.time_s));
                even_rows &= here == row || rows.is_none_or(|rows| rows.number(sample.time_s).is_some());
                row = here;
            }
            taken = cursor.taken();
            for (count, &c) in present.iter_mut().zip(&inputs) {
                *count += usize::from(!sample.inputs[c].is_nan());
            }
        }
        let rows = |s: &Stream| (0..s.time_s.len()).filter(|row| !is_magnetic_only(s, *row)).count();
        let fullest = self.streams.iter().map(rows).max().unwrap_or(0);
        let complete = inputs.iter().zip(present).filter(|(_, count)| *count == samples).map(|(&c, _)| c).collect();
        Ok(Census { share: instants as f64 / fullest.max(1) as f64, even_rows, complete })
    }

    /// Input joints that stay inputs: the complete ones (by coordinate), and those that have no stream and that no usable
    /// reading depends on.
    fn inputs(&self, complete: &[usize]) -> Vec<String> {
        let recorded = |j: usize| self.streams.iter().any(|s| super::input_joint(self.model, &s.name) == Some(j));
        let matters = |j: usize| recorded(j) || (0..self.depends.len()).any(|s| self.depends[s][j] && self.is_held(s));
        let joints = self.model.joints.iter().enumerate().filter(|(_, joint)| joint.input);
        let kept = joints.filter(|(j, joint)| complete.contains(&joint.first) || !matters(*j));
        kept.map(|(_, joint)| joint.name.clone()).collect()
    }

    /// Whether recorded streams measure at least half of the joints of a source that are no inputs. Without them a closure
    /// determines neither of its sides.
    fn is_held(&self, source: usize) -> bool {
        let recorded = |s: &usize| self.streams.iter().any(|stream| stream.name == self.suite.sources[*s].name);
        let measured = |j: usize| (0..self.depends.len()).filter(recorded).any(|s| self.depends[s][j]);
        let joints = self.model.joints.iter().enumerate().filter(|(j, joint)| self.depends[source][*j] && !joint.input);
        let (held, all) = joints.fold((0, 0), |(held, all), (j, _)| (held + usize::from(measured(j)), all + 1));
        2 * held >= all
    }

    /// Rate of the fastest inertial unit, or of the fastest stream, as a person would write it, Hz.
    fn clean_rate_hz(&self, clocks: &[Option<RegularClock>]) -> f64 {
        let inertial_hz = self.fastest_hz(clocks, is_inertial);
        nice(if inertial_hz > 0.0 { inertial_hz } else { self.fastest_hz(clocks, |_| true) })
    }

    fn fastest_hz(&self, clocks: &[Option<RegularClock>], of: impl Fn(&Stream) -> bool) -> f64 {
        let chosen = self.streams.iter().zip(clocks).filter(|(s, _)| of(s));
        chosen.filter_map(|(_, clock)| Some(1.0 / clock.as_ref()?.step_s)).fold(0.0, f64::max)
    }

    fn times(&self, stream: &Stream) -> Vec<f64> {
        let clock = self.clocks.get(&stream.name).copied().unwrap_or_default();
        let rows = stream.time_s.iter().enumerate().filter(|(row, _)| !is_magnetic_only(stream, *row));
        rows.map(|(_, stamp_s)| clock.true_s(stamp_s)).collect()
    }
}

fn is_inertial(stream: &Stream) -> bool {
    stream.channels.iter().any(|c: &Channel| c.quantity.is_inertial() || c.quantity == Quantity::Orientation)
}

/// Whether a row of an inertial unit has a reading of its magnetometer alone. A magnetometer with rows of its own does not
/// make the unit faster.
fn is_magnetic_only(stream: &Stream, row: usize) -> bool {
    lacks(stream, row, |_, c| matches!(c.quantity, Quantity::Gyro | Quantity::Accel))
}

/// What one pass through the instants counts.
struct Census {
    /// Number of instants for each reading of the fullest stream.
    share: f64,
    /// Whether rows at the output rate fall on instants.
    even_rows: bool,
    /// Coordinates of inputs that every sample reads.
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

fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Most stamps that a clock is fitted to.
const MOST_STAMPS: usize = 4096;
/// Stamps from which the first guess comes, and the number of steps that it averages.
const FIRST_STAMPS: usize = 512;
const LAG: usize = 8;
/// Lost readings lengthen steps, so the true one is looked for within this share of the guess.
const GUESS_SHARE: f64 = 0.07;

/// The regular clock behind some time stamps.
struct RegularClock {
    step_s: f64,
    start_s: f64,
    /// Standard deviation of the stamps about it, s.
    jitter_s: f64,
}

impl RegularClock {
    /// Fits t = start + step k with whole k. The rate at which the first stamps have most in common (a periodogram) comes
    /// first, then lines through twice as many as long as there are more: so k is known although stamps jitter and readings
    /// are lost. `None` for fewer than two stamps.
    fn of(times: &[f64]) -> Option<RegularClock> {
        let times = longest_run(times);
        let lag = LAG.min(times.len().checked_sub(1).filter(|steps| *steps > 0)?);
        let guess_s = median(times.windows(lag + 1).map(|w| (w[lag] - w[0]) / lag as f64).collect())?;
        let mut clock = Self::in_step(&times[..FIRST_STAMPS.min(times.len())], guess_s);
        let mut count = FIRST_STAMPS;
        loop {
            clock.fit(&times[..count.min(times.len())]);
            if count >= times.len() {
                break;
            }
            count *= 2;
        }
        let off = times.iter().map(|&t| (t - clock.start_s - clock.step_s * clock.number(t)).abs());
        // 1.4826 median deviations of a normal distribution are its standard deviation.
        clock.jitter_s = 1.4826 * median(off.collect())?;
        Some(clock)
    }

    /// The clock near a guess that most stamps are in step with.
    fn in_step(times: &[f64], guess_s: f64) -> RegularClock {
        let (first, last) = (times[0], times[times.len() - 1]);
        let finest_hz = 0.2 / (last - first);
        let half = (GUESS_SHARE / (guess_s * finest_hz)).ceil() as i32;
        let turn = |hz: f64| {
            let angles = times.iter().map(|t| ((t - first) * hz).fract() * TAU);
            angles.fold((0.0, 0.0), |(sin, cos), x| (sin + x.sin(), cos + x.cos()))
        };
        let rates = (-half..=half).map(|i| 1.0 / guess_s + f64::from(i) * finest_hz).filter(|hz| *hz > 0.0);
        let best = rates.map(|hz| (hz, turn(hz))).max_by(|(_, a), (_, b)| a.0.hypot(a.1).total_cmp(&b.0.hypot(b.1)));
        let (best_hz, (sin, cos)) = best.unwrap_or((1.0 / guess_s, turn(1.0 / guess_s)));
        RegularClock { step_s: 1.0 / best_hz, start_s: first + sin.atan2(cos) / TAU / best_hz, jitter_s: 0.0 }
    }

    /// Number of the step nearest to a time.
    fn number(&self, time_s: f64) -> f64 {
        ((time_s - self.start_s) / self.step_s).round()
    }

    /// Least squares through stamps whose numbers are known.
    fn fit(&mut self, times: &[f64]) {
        let mean = |f: &dyn Fn(f64) -> f64| times.iter().map(|&t| f(t)).sum::<f64>() / times.len() as f64;
        let (mean_k, mean_t) = (mean(&|t| self.number(t)), mean(&|t| t));
        let spread = mean(&|t| (self.number(t) - mean_k).powi(2));
        let step_s = mean(&|t| (self.number(t) - mean_k) * (t - mean_t)) / spread;
        if step_s > 0.0 && step_s.is_finite() {
            (self.step_s, self.start_s) = (step_s, mean_t - step_s * mean_k);
        }
    }
}

/// The longest part without a silence, in which a clock may start anew.
fn longest_run(times: &[f64]) -> &[f64] {
    let steps = times.windows(2).map(|w| w[1] - w[0]).collect();
    let silence_s = SILENT_STEPS * median(steps).unwrap_or(f64::INFINITY);
    let runs = times.chunk_by(|a, b| b - a < silence_s);
    let longest = runs.max_by_key(|run| run.len()).unwrap_or(times);
    &longest[..longest.len().min(MOST_STAMPS)]
}

#[cfg(test)]
mod tests {
    use super::{nice, RegularClock};

    #[test]
    fn rates_are_those_that_a_person_would_write() {
        for (rate_hz, expected) in [(124.97, 125.0), (286.0, 286.0), (97.3, 97.0), (59.99, 60.0), (0.498, 0.5)] {
            assert!((nice(rate_hz) - expected).abs() < 1e-12, "{rate_hz}: {}", nice(rate_hz));
        }
    }

    /// Stamps every 3.5 ms with up to 1 ms of jitter, of which every fifteenth is lost.
    #[test]
    fn a_clock_is_found_behind_jitter_and_lost_readings() {
        let jitter = |i: i32| 1.0e-3 * (f64::from(i) * 2.4).sin();
        let times: Vec<f64> =
            (0..4000).filter(|i| i % 15 != 7).map(|i| 5.0 + 0.0035 * f64::from(i) + jitter(i)).collect();
        let clock = RegularClock::of(&times).unwrap();
        assert!((clock.step_s / 0.0035 - 1.0).abs() < 1e-4, "{}", clock.step_s);
        // A sine's median deviation is 0.71 of its height.
        assert!((clock.jitter_s / (1.4826 * 0.71 * 1.0e-3) - 1.0).abs() < 0.1, "{}", clock.jitter_s);
        let regular: Vec<f64> = (0..400).map(|i| 0.01 * f64::from(i)).collect();
        assert!(RegularClock::of(&regular).unwrap().jitter_s < 1e-12);
        assert!(RegularClock::of(&[1.0]).is_none());
    }
}
