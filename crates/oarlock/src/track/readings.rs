//! Readings of one sample on their way into the filter; stages remove those that are not measurements.

use super::hypothesis::SourceMemory;
use super::subject::Subject;
use crate::body::{Body, Moment};
use crate::recording::Sample;
use std::ops::Range;

/// Readings of one sample, and the inputs of the measurement model.
#[derive(Debug, Clone)]
pub(super) struct Readings {
    /// In the order of the measurement vector; missing or removed readings are NaN.
    pub z: Vec<f64>,
    pub moment: Moment,
    /// Per source: time of its readings after that of the sample, s.
    pub offset_s: Vec<f64>,
    /// Standard deviation of each row's noise in this sample.
    pub std: Vec<f64>,
}

impl Readings {
    pub fn new(body: &Body) -> Self {
        let offset_s = vec![0.0; body.suite.sources.len()];
        Readings { z: vec![f64::NAN; body.suite.len()], moment: body.moment(), offset_s, std: body.suite.std() }
    }

    /// Copies the readings of a sample.
    pub fn take(&mut self, sample: &Sample) {
        self.z.copy_from_slice(&sample.z);
        let offsets = sample.offset_s.iter().copied().chain(std::iter::repeat(0.0));
        self.offset_s.iter_mut().zip(offsets).for_each(|(own, s)| *own = s);
        for (input, &value) in self.moment.inputs.iter_mut().zip(&sample.inputs) {
            *input = if value.is_nan() { 0.0 } else { value };
        }
    }

    /// Whether any of these rows has a reading.
    pub fn speak(&self, rows: &Range<usize>) -> bool {
        self.z[rows.clone()].iter().any(|z| !z.is_nan())
    }

    pub fn silence(&mut self, rows: &Range<usize>) {
        self.z[rows.clone()].fill(f64::NAN);
    }

    /// Three rows from `first` on.
    pub fn three(&self, first: usize) -> [f64; 3] {
        [self.z[first], self.z[first + 1], self.z[first + 2]]
    }

    /// Removes readings that depend on a missing input.
    pub fn silence_what_needs_missing_inputs(&mut self, subject: &Subject, sample: &Sample) {
        let joints = &subject.body.model.joints;
        for (source, depends) in subject.body.suite.sources.iter().zip(&subject.depends) {
            let mut needed = (0..joints.len()).filter(|&j| joints[j].input && depends[j]);
            if needed.any(|j| sample.inputs[joints[j].first].is_nan()) {
                self.silence(&source.rows);
            }
        }
    }

    /// Converts the readings of orientation sensors into references; their rows become differences from these.
    pub fn refer(&mut self, subject: &Subject) {
        subject.body.suite.refer(&mut self.z, &mut self.moment.references);
    }

    /// Marks the sources that have readings.
    pub fn mark_active(&mut self, subject: &Subject) {
        for (i, source) in subject.body.suite.sources.iter().enumerate() {
            self.moment.active[i] = self.speak(&source.rows);
        }
        subject.body.mark(&mut self.moment);
    }

    /// Stores the time of each source's reading.
    pub fn mark_seen(&self, sources: &mut [SourceMemory], time_s: f64) {
        for (source, _) in sources.iter_mut().zip(&self.moment.active).filter(|(_, &active)| active) {
            source.seen_s = time_s;
        }
    }

    /// Removes excluded parts.
    pub fn without(&self, subject: &Subject, excluded: &[bool]) -> Vec<f64> {
        let mut z = self.z.clone();
        for (rows, _) in subject.groups.parts.iter().zip(excluded).filter(|(_, &excluded)| excluded) {
            z[rows.clone()].fill(f64::NAN);
        }
        z
    }
}
