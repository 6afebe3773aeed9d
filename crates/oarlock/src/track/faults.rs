//! Readings that are no measurements: at the end of a sensor's range, or repeated to the bit.
//!
//! A reading at the end of the range says only that the truth is beyond; its row says nothing. A sensor whose readings have once changed
//! by less than its noise cannot repeat itself for long: it is stuck, or its last packet is sent again. Coarse readings of a body at
//! rest do repeat themselves, and so does a chip that is slower than its unit; the longest run that ended by itself is remembered.
//! A magnetometer's repeated reading is an old one, and counts once.

use super::Tracker;
use crate::body::Body;
use crate::estimate::belief::{Belief, MEMORY};
use crate::estimate::filter::{Info, Verdict};
use crate::model::SensorKind;
use crate::recording::Sample;
use crate::sensor::Quantity;

/// A reading beyond this share of the range is at its end: calibration may have scaled it.
const END_OF_RANGE: f64 = 0.98;
/// Repeated for longer than this a gyroscope or accelerometer is stuck, s.
const STUCK_S: f64 = 0.2;
/// The same of a magnetometer, whose chip is often slower than its unit, s.
const MAG_STUCK_S: f64 = 2.0;
/// ... and for so many times as long as the longest run before.
const LONGER: f64 = 5.0;
/// ... and so many samples.
const REPEATS: f64 = 8.0;
/// Of the longest run, while others went on.
const OTHERS_SHARE: f64 = 0.5;

/// What may be wrong with a sensor's reading, in the order of [`Fault`].
pub const FAULT: [&str; 3] = ["none", "clipped", "stuck"];

/// What is wrong with a sensor's reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// Nothing.
    None,
    /// At the end of the range on an axis, which was not used.
    Clipped,
    /// Repeated to the bit, and not used.
    Stuck,
}

impl Fault {
    /// `none`, `clipped`, `stuck`.
    pub fn name(self) -> &'static str {
        FAULT[self as usize]
    }
}

/// The place in a source's memory at which a quantity's latest reading begins; behind it, when it came, how often it was repeated, the
/// smallest change and the longest run so far.
fn place(quantity: Quantity) -> Option<usize> {
    match quantity {
        Quantity::Gyro => Some(8),
        Quantity::Accel => Some(15),
        Quantity::Mag => Some(22),
        _ => None,
    }
}
const CAME: usize = 3;
const REPEATED: usize = 4;
const QUANTUM: usize = 5;
const LONGEST: usize = 6;

/// The largest reading of every row that its sensor can give.
pub(super) fn ranges(body: &Body) -> Vec<f64> {
    let mut ranges = vec![f64::INFINITY; body.suite.len()];
    for sensor in &body.model.sensors {
        let SensorKind::Imu { noise, .. } = &sensor.kind else { continue };
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

impl Tracker {
    /// Of every source, what was wrong with its reading.
    pub fn source_faults<'a>(&'a self, info: &'a Info) -> impl Iterator<Item = Fault> + 'a {
        self.groups.sources.iter().map(|source| {
            let parts = self.groups.parts.iter().zip(&info.parts).filter(|(rows, _)| source.contains(&rows.start));
            let fault = |verdict: &Verdict| match verdict {
                Verdict::Clipped => Fault::Clipped,
                Verdict::Stuck => Fault::Stuck,
                _ => Fault::None,
            };
            parts.map(|(_, verdict)| fault(verdict)).max().unwrap_or(Fault::None)
        })
    }

    /// Silences rows at the end of their range. Called with the readings alone in `z`.
    pub(super) fn notice_clipping(&mut self, sample: &Sample) {
        for (fault, rows) in self.faults.iter_mut().zip(&self.groups.parts) {
            *fault = Fault::None;
            for r in rows.clone().filter(|&r| sample.z[r].abs() >= END_OF_RANGE * self.range[r]) {
                self.z[r] = f64::NAN;
                *fault = Fault::Clipped;
            }
        }
    }

    /// Silences sensors that repeat themselves.
    pub(super) fn notice_faults(&mut self, belief: &mut Belief) {
        let mut silenced = false;
        for s in 0..self.body.suite.sources.len() {
            for k in 0..self.body.suite.sources[s].parts.len() {
                let (rows, quantity) = {
                    let part = &self.body.suite.sources[s].parts[k];
                    (part.rows.clone(), part.quantity)
                };
                let Some(first) = place(quantity) else { continue };
                let reading = [self.z[rows.start], self.z[rows.start + 1], self.z[rows.start + 2]];
                if reading.iter().any(|x| x.is_nan()) {
                    continue;
                }
                let memory = &mut belief.memory[s];
                if !repeats(memory, first, reading, belief.time_s) || memory[first + QUANTUM] >= self.std[rows.start] {
                    continue;
                }
                let stuck = is_stuck(memory, first, quantity, belief.time_s) && self.others_go_on(belief, s, first);
                if stuck {
                    let p = self.groups.parts.iter().position(|part| *part == rows);
                    p.into_iter().for_each(|p| self.faults[p] = Fault::Stuck);
                }
                if stuck || quantity == Quantity::Mag {
                    self.z[rows].fill(f64::NAN);
                    silenced = true;
                }
            }
        }
        if silenced {
            self.mark_active();
        }
    }

    /// Marks who has something to say.
    pub(super) fn mark_active(&mut self) {
        for (i, source) in self.body.suite.sources.iter().enumerate() {
            self.moment.active[i] = self.z[source.rows.clone()].iter().any(|z| !z.is_nan());
        }
        self.body.mark(&mut self.moment);
    }

    /// Whether another inertial reading has changed since a part's did, for a good part of the time.
    fn others_go_on(&self, belief: &Belief, source: usize, first: usize) -> bool {
        let since_s = belief.memory[source][first + CAME];
        let late_s = since_s + OTHERS_SHARE * (belief.time_s - since_s);
        let came = |memory: &[f64; MEMORY]| [8, 15].iter().any(|place| memory[place + CAME] > late_s);
        belief.memory.iter().any(came)
    }

    /// When a part's reading last changed; NaN if it never spoke.
    pub(super) fn changed_s(&self, belief: &Belief, part: usize) -> f64 {
        let first = self.groups.parts[part].start;
        let source = self.groups.sources.iter().position(|s| s.contains(&first));
        let place = place(self.quantities[part]);
        source.zip(place).map_or(f64::NAN, |(s, place)| belief.memory[s][place + CAME])
    }

    /// Puts into the report what was kept from the filter.
    pub(super) fn report_faults(&mut self) {
        for p in 0..self.faults.len() {
            let verdict = &mut self.info.parts[p];
            match self.faults[p] {
                Fault::None => {
                    if self.turned[p] && *verdict == Verdict::Excluded {
                        *verdict = Verdict::Turned;
                    }
                    continue;
                }
                Fault::Clipped => *verdict = Verdict::Clipped,
                Fault::Stuck => *verdict = Verdict::Stuck,
            }
            let rows = &self.groups.parts[p];
            let kept = rows.clone().filter(|&r| self.z[r].is_nan()).count() as u8;
            let source = self.groups.sources.iter().position(|s| s.contains(&rows.start));
            if let Some(info) = source.map(|s| &mut self.info.sources[s]) {
                let kept = kept.min(info.missing);
                info.missing -= kept;
                info.rejected += kept;
            }
        }
    }
}

/// Takes in a reading; whether it is the last one again.
fn repeats(memory: &mut [f64; MEMORY], first: usize, reading: [f64; 3], time_s: f64) -> bool {
    let memory = &mut memory[first..];
    let change = |(x, before): (&f64, &f64)| Some((x - before).abs()).filter(|change| *change > 0.0);
    let smallest = reading.iter().zip(&memory[..3]).filter_map(change).fold(f64::INFINITY, f64::min);
    if memory[CAME].is_nan() {
        (memory[QUANTUM], memory[LONGEST]) = (f64::INFINITY, 0.0);
    } else if smallest == f64::INFINITY {
        memory[REPEATED] += 1.0;
        return true;
    } else {
        memory[QUANTUM] = memory[QUANTUM].min(smallest);
        let run_s = time_s - memory[CAME];
        if memory[REPEATED] > 0.0 && run_s < STUCK_S {
            memory[LONGEST] = memory[LONGEST].max(run_s);
        }
    }
    memory[..3].copy_from_slice(&reading);
    (memory[CAME], memory[REPEATED]) = (time_s, 0.0);
    false
}

fn is_stuck(memory: &[f64; MEMORY], first: usize, quantity: Quantity, time_s: f64) -> bool {
    let memory = &memory[first..];
    let least_s = if quantity == Quantity::Mag { MAG_STUCK_S } else { STUCK_S };
    let for_s = time_s - memory[CAME];
    memory[REPEATED] >= REPEATS && for_s > least_s.max(LONGER * memory[LONGEST])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Share of samples found stuck of a unit at 100 Hz whose reading is `value(k)`.
    fn stuck(samples: usize, value: impl Fn(usize) -> f64) -> usize {
        let mut memory = [f64::NAN; MEMORY];
        let said = |k: &usize| {
            let time_s = 0.01 * *k as f64;
            let same = repeats(&mut memory, 8, [value(*k), 0.0, 1.0], time_s);
            same && is_stuck(&memory, 8, Quantity::Gyro, time_s)
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
