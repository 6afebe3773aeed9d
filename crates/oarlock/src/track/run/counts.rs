//! Counts of the readings of every stream over all samples of a run, whichever of them are rows of the output.

use super::super::faults::{Fault, FAULT};
use super::super::magnetic::{Field, FIELD};
use super::super::subject::Subject;
use crate::estimate::filter::{Info, Verdict};
use crate::recording::{Feeds, Recording, Sample};
use crate::sensor::Quantity;

/// Begin and end of a disturbance, s, and the samples in it.
pub type Spell = ([f64; 2], u64);

/// Readings of one stream. A reading is one number of one quantity that the model uses, such as one axis of a gyroscope.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamCount {
    /// Name of the stream.
    pub name: String,
    /// Readings in each of its rows. A magnetometer that never gave a reading is not counted.
    pub channels: usize,
    /// Readings that are numbers.
    pub received: u64,
    /// Readings that the filter used.
    pub used: u64,
    /// Readings that the filter tested and did not use: outliers, disturbed fields, faults.
    pub rejected: u64,
    /// The longest row of samples with outliers of motion sensors.
    pub outliers: Outliers,
    /// Samples by the judgement of the magnetometer, in the order of [`FIELD`]. The first counts samples without a reading.
    pub fields: [u64; FIELD.len()],
    /// The longest one of its magnetic field.
    pub spell: Option<Spell>,
    /// Samples with readings by fault, in the order of [`FAULT`].
    pub faults: [u64; FAULT.len()],
    /// Whether its magnetometer gave a reading; `None` if the model has none.
    pub magnetometer: Option<bool>,
}

/// Time of the first of some samples in a row, s, and their number.
pub type Outliers = (f64, u64);

/// Sums of a source.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    used: u64,
    rejected: u64,
    /// The row of outliers that lasts, and the longest one.
    outliers: [Outliers; 2],
    fields: [u64; FIELD.len()],
    faults: [u64; FAULT.len()],
    /// The disturbance that lasts, and the longest one.
    spells: [Option<Spell>; 2],
}

/// A field that is right for less than this has not ended a disturbance, s.
const BRIEF_S: f64 = 1.0;

impl Sums {
    fn take_outlier(&mut self, time_s: f64, is_outlier: bool) {
        let [now, longest] = &mut self.outliers;
        *now = match (is_outlier, now.1) {
            (false, _) => (time_s, 0),
            (true, 0) => (time_s, 1),
            (true, count) => (now.0, count + 1),
        };
        if now.1 > longest.1 {
            *longest = *now;
        }
    }

    fn take_field(&mut self, time_s: f64, field: Field) {
        self.fields[field as usize] += 1;
        if matches!(field, Field::Missing | Field::Undisturbed) {
            return;
        }
        let [now, longest] = &mut self.spells;
        *now = Some(match *now {
            Some(([from_s, to_s], count)) if time_s - to_s < BRIEF_S => ([from_s, time_s], count + 1),
            _ => ([time_s; 2], 1),
        });
        let length_s = |spell: &Option<Spell>| spell.map_or(-1.0, |([from_s, to_s], _)| to_s - from_s);
        if length_s(now) > length_s(longest) {
            *longest = *now;
        }
    }
}

/// The sums while a run proceeds.
#[derive(Debug, Clone, Default)]
pub(super) struct Tally {
    /// Per row of the measurement vector: readings received. And per coordinate: readings of its input.
    rows: Vec<u64>,
    inputs: Vec<u64>,
    sources: Vec<Sums>,
}

impl Tally {
    /// Counts what a sample contains.
    pub fn receive(&mut self, sample: &Sample) {
        self.rows.resize(sample.z.len(), 0);
        self.inputs.resize(sample.inputs.len(), 0);
        count_numbers(&mut self.rows, &sample.z);
        count_numbers(&mut self.inputs, &sample.inputs);
    }

    /// Counts what an update did with the readings of each source. Readings of rest and contact come from no sensor.
    pub fn judge(
        &mut self,
        subject: &Subject,
        (time_s, info): (f64, &Info),
        troubles: impl Iterator<Item = (Field, Fault)>,
    ) {
        self.sources.resize(info.sources.len(), Sums::default());
        for ((sums, source), (field, fault)) in self.sources.iter_mut().zip(&info.sources).zip(troubles) {
            sums.used += u64::from(source.used);
            sums.rejected += u64::from(source.rejected);
            sums.take_field(time_s, field);
            sums.faults[fault as usize] += u64::from(source.used + source.rejected > 0);
        }
        let mut outliers = vec![false; info.sources.len()];
        for (p, quantity) in subject.quantities.iter().enumerate() {
            let is_motion = !matches!(quantity, Quantity::Mag | Quantity::Rest | Quantity::Contact);
            outliers[subject.source_of_part[p]] |= is_motion && info.parts[p] == Verdict::Outlier;
        }
        for ((sums, source), is_outlier) in self.sources.iter_mut().zip(&info.sources).zip(outliers) {
            if source.used + source.rejected > 0 {
                sums.take_outlier(time_s, is_outlier);
            }
        }
        for p in [Quantity::Rest, Quantity::Contact].into_iter().flat_map(|q| subject.parts_of(q)) {
            let (sums, rows) = (&mut self.sources[subject.source_of_part[p]], subject.groups.parts[p].len() as u64);
            match info.parts[p] {
                Verdict::Missing => {}
                Verdict::Accepted => sums.used -= rows,
                _ => sums.rejected -= rows,
            }
        }
    }

    /// The counts of every stream, in the recording's order.
    pub fn counts(&self, subject: &Subject, recording: &Recording) -> Vec<StreamCount> {
        recording.feeds().map(|(name, feeds)| self.count(subject, name, &feeds)).collect()
    }

    fn count(&self, subject: &Subject, name: &str, feeds: &Feeds) -> StreamCount {
        let sum = |counts: &[u64], at: std::ops::Range<usize>| counts.get(at).map_or(0, |c| c.iter().sum());
        let mut count = StreamCount {
            name: name.to_string(),
            channels: 0,
            received: 0,
            used: 0,
            rejected: 0,
            outliers: (0.0, 0),
            fields: [0; FIELD.len()],
            spell: None,
            faults: [0; FAULT.len()],
            magnetometer: None,
        };
        if let Some(coordinate) = feeds.input {
            let received = sum(&self.inputs, coordinate..coordinate + 1);
            return StreamCount { channels: 1, received, used: received, ..count };
        }
        for first in &feeds.rows {
            let part = subject.part_of_row[*first];
            let received = sum(&self.rows, subject.groups.parts[part].clone());
            let is_magnetometer = subject.quantities[part] == Quantity::Mag;
            if is_magnetometer {
                count.magnetometer = Some(received > 0);
            }
            if received > 0 || !is_magnetometer {
                count.channels += subject.groups.parts[part].len();
                count.received += received;
            }
        }
        if let Some(source) = feeds.source {
            let has_magnetometer = subject.parts_of(Quantity::Mag).any(|p| subject.source_of_part[p] == source);
            count.magnetometer = count.magnetometer.or(has_magnetometer.then_some(false));
            if let Some(sums) = self.sources.get(source) {
                let Sums { used, rejected, outliers: [_, outliers], fields, faults, spells: [_, spell] } = *sums;
                count = StreamCount { used, rejected, outliers, fields, spell, faults, ..count };
            }
        }
        count
    }
}

fn count_numbers(counts: &mut [u64], values: &[f64]) {
    for (count, value) in counts.iter_mut().zip(values) {
        *count += u64::from(!value.is_nan());
    }
}
