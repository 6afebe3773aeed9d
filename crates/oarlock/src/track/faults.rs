//! Detects faulty readings: clipped at the end of a sensor's range, or stuck (repeated to the bit).
//!
//! A clipped reading is only a bound of the true value, so its row is removed. A sensor whose readings change by its
//! noise does not repeat them for long: it is stuck, or its last packet was sent again. Coarse readings of a resting
//! body do repeat, and so does a chip that is slower than its unit; therefore the longest run of repeats that ended by
//! itself is stored. A repeated reading of a magnetometer is an old one and is used once.

use super::entry::Entry;
use super::hypothesis::SourceMemory;
use super::readings::Readings;
use super::subject::Subject;
use crate::body::Body;
use crate::estimate::filter::{Info, Verdict};
use crate::model::{Imu, SensorKind};
use crate::recording::Sample;
use crate::sensor::Quantity;

/// A reading beyond this share of the range is clipped. The margin allows for a logger that rescales readings.
const END_OF_RANGE: f64 = 0.98;
/// A gyroscope or accelerometer that repeats for longer than this is stuck, s.
const STUCK_S: f64 = 0.2;
/// The same for a magnetometer, whose chip is often slower than its unit, s.
const MAG_STUCK_S: f64 = 2.0;
/// ... and for this multiple of the longest earlier run,
const LONGER: f64 = 5.0;
/// ... and this number of samples.
const REPEATS: f64 = 8.0;
/// Share of the run during which other sensors must have changed.
const OTHERS_SHARE: f64 = 0.5;

/// Names of [`Fault`] in its order.
pub const FAULT: [&str; 3] = ["none", "clipped", "stuck"];

/// Fault of a sensor's reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// Nothing.
    None,
    /// Clipped on an axis. That axis was not used.
    Clipped,
    /// Stuck: repeated to the bit and not used.
    Stuck,
}

impl Fault {
    /// `none`, `clipped`, `stuck`.
    pub fn name(self) -> &'static str {
        FAULT[self as usize]
    }
}

/// The latest reading of a sensor and its repeats; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Repeats {
    pub reading: [f64; 3],
    /// Time of the reading, s.
    pub came_s: f64,
    /// Number of repeats since.
    pub repeated: f64,
    /// Smallest change so far.
    pub quantum: f64,
    /// Longest run of repeats that ended by itself, s.
    pub longest_s: f64,
}

/// Memory of an inertial unit for the detection of stuck readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FaultState {
    pub gyro: Repeats,
    pub accel: Repeats,
    pub mag: Repeats,
}

impl FaultState {
    pub const NONE: FaultState = FaultState { gyro: Repeats::NONE, accel: Repeats::NONE, mag: Repeats::NONE };

    fn of(&self, quantity: Quantity) -> Option<&Repeats> {
        match quantity {
            Quantity::Gyro => Some(&self.gyro),
            Quantity::Accel => Some(&self.accel),
            Quantity::Mag => Some(&self.mag),
            _ => None,
        }
    }

    fn of_mut(&mut self, quantity: Quantity) -> Option<&mut Repeats> {
        match quantity {
            Quantity::Gyro => Some(&mut self.gyro),
            Quantity::Accel => Some(&mut self.accel),
            Quantity::Mag => Some(&mut self.mag),
            _ => None,
        }
    }

    /// Time of the last change of a quantity's reading; NaN without readings.
    pub fn changed_s(&self, quantity: Quantity) -> f64 {
        self.of(quantity).map_or(f64::NAN, |repeats| repeats.came_s)
    }
}

/// Detector of faulty readings.
#[derive(Debug, Clone)]
pub(super) struct Faults {
    /// Per row: lower and upper corrected reading from which its sensor is clipped.
    ends: Vec<[f64; 2]>,
    /// Per part: its fault in this sample.
    found: Vec<Fault>,
}

/// Range of every row's sensor.
fn ranges(body: &Body) -> Vec<f64> {
    let mut ranges = vec![f64::INFINITY; body.suite.len()];
    for sensor in &body.model.sensors {
        let SensorKind::Imu(Imu { noise, .. }) = &sensor.kind else { continue };
        let Some(source) = body.suite.sources.iter().find(|s| s.name == sensor.name) else { continue };
        for part in &source.parts {
            let range = match part.quantity {
                Quantity::Gyro => noise.gyro_range,
                Quantity::Accel => noise.accel_range,
                _ => None,
            };
            ranges[part.rows.clone()].fill(range.unwrap_or(f64::INFINITY));
        }
    }
    ranges
}

/// Per source: the fault of its reading.
pub(super) fn by_source<'a>(subject: &'a Subject, info: &'a Info) -> impl Iterator<Item = Fault> + 'a {
    (0..subject.groups.sources.len()).map(|s| {
        let parts = subject.source_of_part.iter().zip(&info.parts).filter(move |(source, _)| **source == s);
        let fault = |verdict: &Verdict| match verdict {
            Verdict::Clipped => Fault::Clipped,
            Verdict::Stuck => Fault::Stuck,
            _ => Fault::None,
        };
        parts.map(|(_, verdict)| fault(verdict)).max().unwrap_or(Fault::None)
    })
}

impl Faults {
    pub fn new(subject: &Subject, entry: &Entry) -> Self {
        let ends = |(row, range): (usize, &f64)| [-1.0, 1.0].map(|sign| entry.along(row, sign * END_OF_RANGE * range));
        let ends = ranges(&subject.body).iter().enumerate().map(ends).collect();
        Faults { ends, found: vec![Fault::None; subject.groups.parts.len()] }
    }

    /// Removes clipped rows.
    pub fn silence_clipped(&mut self, subject: &Subject, readings: &mut Readings) {
        for (fault, rows) in self.found.iter_mut().zip(&subject.groups.parts) {
            *fault = Fault::None;
            for r in rows.clone() {
                let [low, high] = self.ends[r];
                if readings.z[r] <= low || readings.z[r] >= high {
                    readings.z[r] = f64::NAN;
                    *fault = Fault::Clipped;
                }
            }
        }
    }

    /// What became of each part of a sample that was searched for faults.
    pub fn verdicts(&self, subject: &Subject, sample: &Sample) -> Vec<Verdict> {
        let of = |(fault, rows): (&Fault, &std::ops::Range<usize>)| match fault {
            Fault::Clipped => Verdict::Clipped,
            Fault::Stuck => Verdict::Stuck,
            Fault::None if sample.z[rows.clone()].iter().any(|z| z.is_nan()) => Verdict::Missing,
            Fault::None => Verdict::Accepted,
        };
        self.found.iter().zip(&subject.groups.parts).map(of).collect()
    }

    /// Removes stuck sensors.
    pub fn silence_stuck(
        &mut self,
        subject: &Subject,
        sources: &mut [SourceMemory],
        readings: &mut Readings,
        time_s: f64,
    ) {
        let mut silenced = false;
        for (p, rows) in subject.groups.parts.iter().enumerate() {
            let (s, quantity) = (subject.source_of_part[p], subject.quantities[p]);
            let Some(memory) = sources[s].faults.of_mut(quantity) else { continue };
            let reading = readings.three(rows.start);
            if reading.iter().any(|x| x.is_nan()) {
                continue;
            }
            if !memory.take(reading, time_s) || memory.quantum >= subject.std[rows.start] {
                continue;
            }
            let memory = *memory;
            let stuck = memory.is_stuck(quantity, time_s) && others_go_on(sources, memory.came_s, time_s);
            if stuck {
                self.found[p] = Fault::Stuck;
            }
            if stuck || quantity == Quantity::Mag {
                readings.silence(rows);
                silenced = true;
            }
        }
        if silenced {
            readings.mark_active(subject);
        }
    }

    /// Adds the removed rows to the report.
    pub fn report(&self, subject: &Subject, readings: &Readings, info: &mut Info) {
        for (p, fault) in self.found.iter().enumerate() {
            info.parts[p] = match fault {
                Fault::None => continue,
                Fault::Clipped => Verdict::Clipped,
                Fault::Stuck => Verdict::Stuck,
            };
            let kept = subject.groups.parts[p].clone().filter(|&r| readings.z[r].is_nan()).count() as u8;
            let source = &mut info.sources[subject.source_of_part[p]];
            let kept = kept.min(source.missing);
            source.missing -= kept;
            source.rejected += kept;
        }
    }
}

/// Whether another gyroscope or accelerometer has changed for a sufficient share of the time since this reading.
fn others_go_on(sources: &[SourceMemory], since_s: f64, time_s: f64) -> bool {
    let late_s = since_s + OTHERS_SHARE * (time_s - since_s);
    sources.iter().any(|s| s.faults.gyro.came_s > late_s || s.faults.accel.came_s > late_s)
}

impl Repeats {
    const NONE: Repeats = Repeats {
        reading: [f64::NAN; 3],
        came_s: f64::NAN,
        repeated: f64::NAN,
        quantum: f64::NAN,
        longest_s: f64::NAN,
    };

    /// Adds a reading; true if it repeats the last one.
    fn take(&mut self, reading: [f64; 3], time_s: f64) -> bool {
        let change = |(x, before): (&f64, &f64)| Some((x - before).abs()).filter(|change| *change > 0.0);
        let smallest = reading.iter().zip(&self.reading).filter_map(change).fold(f64::INFINITY, f64::min);
        if self.came_s.is_nan() {
            (self.quantum, self.longest_s) = (f64::INFINITY, 0.0);
        } else if smallest == f64::INFINITY {
            self.repeated += 1.0;
            return true;
        } else {
            self.quantum = self.quantum.min(smallest);
            let run_s = time_s - self.came_s;
            if self.repeated > 0.0 && run_s < STUCK_S {
                self.longest_s = self.longest_s.max(run_s);
            }
        }
        (self.reading, self.came_s, self.repeated) = (reading, time_s, 0.0);
        false
    }

    fn is_stuck(&self, quantity: Quantity, time_s: f64) -> bool {
        let least_s = if quantity == Quantity::Mag { MAG_STUCK_S } else { STUCK_S };
        let for_s = time_s - self.came_s;
        self.repeated >= REPEATS && for_s > least_s.max(LONGER * self.longest_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Share of samples detected as stuck for a unit at 100 Hz with readings `value(k)`.
    fn stuck(samples: usize, value: impl Fn(usize) -> f64) -> usize {
        let mut unit = Repeats::NONE;
        let said = |k: &usize| {
            let time_s = 0.01 * *k as f64;
            unit.take([value(*k), 0.0, 1.0], time_s) && unit.is_stuck(Quantity::Gyro, time_s)
        };
        (0..samples).filter(said).count()
    }

    #[test]
    fn a_frozen_sensor_is_stuck_after_a_fifth_of_a_second() {
        assert_eq!(stuck(200, |k| if k < 100 { k as f64 } else { 99.0 }), 200 - 99 - 21);
    }

    #[test]
    fn a_slow_chip_is_not_stuck() {
        assert_eq!(stuck(1000, |k| (k / 10) as f64), 0);
    }

    #[test]
    fn an_axis_that_rests_is_not_stuck() {
        assert_eq!(stuck(1000, |k| (k as f64).sin()), 0);
    }
}
