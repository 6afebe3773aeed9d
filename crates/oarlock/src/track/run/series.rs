//! Estimates and reports of every output row, in compact arrays: an hour has half a million rows.

use super::super::faults::Fault;
use super::super::magnetic::Field;
use crate::estimate::filter::{Info, SourceInfo};
use std::sync::Arc;

/// Report of one source in one update, in five bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// Rows used.
    pub used: u8,
    /// Rejected rows.
    pub rejected: u8,
    /// Missing rows.
    pub missing: u8,
    /// How its magnetometer's reading was judged.
    pub field: Field,
    /// Fault of its readings.
    pub fault: Fault,
}

impl Report {
    fn of(source: &SourceInfo, field: Field, fault: Fault) -> Self {
        let SourceInfo { used, rejected, missing, .. } = *source;
        Report { used, rejected, missing, field, fault }
    }
}

/// Numbers in a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Widths {
    pub states: usize,
    pub coordinates: usize,
    pub inputs: usize,
    pub sources: usize,
}

/// Estimates over time. The filtered and the smoothed series share what smoothing does not change.
#[derive(Debug, Clone, Default)]
pub struct Series {
    /// Time of every row, s.
    pub time_s: Vec<f64>,
    /// State, row-major.
    pub mean: Vec<f64>,
    /// Standard deviation of the state, row-major.
    pub std: Vec<f64>,
    /// Per row and coordinate: 1 where it is observed.
    pub observed: Vec<u8>,
    /// Of strapdown links, per row: turns off the hinges' axes, rotation vectors in the order of `Run::locked_frames`, rad.
    pub off_axis: Vec<f64>,
    /// Readings of input joints, in the order of `Run::input_coordinates`; NaN where missing.
    pub inputs: Arc<Vec<f64>>,
    /// Per row and source: normalised innovation squared of the used rows; NaN if none was used.
    pub nis: Arc<Vec<f64>>,
    /// Report per row and source.
    pub reports: Arc<Vec<Report>>,
    /// Per row: normalised innovation squared of all inertial readings, and their number.
    pub inertial: Arc<Vec<(f64, u32)>>,
}

impl Series {
    /// Readings without estimates.
    pub(super) fn read(&self) -> Series {
        Series {
            time_s: self.time_s.clone(),
            inputs: self.inputs.clone(),
            nis: self.nis.clone(),
            reports: self.reports.clone(),
            inertial: self.inertial.clone(),
            ..Series::default()
        }
    }

    /// The same rows with empty estimates, except the last row, which smoothing does not change.
    pub(super) fn blank(&self) -> Series {
        let width = self.mean.len() / self.time_s.len().max(1);
        let (mean, std) = (last(&self.mean, width), last(&self.std, width));
        Series { mean, std, observed: self.observed.clone(), off_axis: self.off_axis.clone(), ..self.read() }
    }

    /// Size of the estimates in bytes.
    pub fn bytes(&self) -> usize {
        std::mem::size_of_val(&*self.mean) + std::mem::size_of_val(&*self.std)
    }

    /// Memory for this many rows: what grows by doubling leaves holes of the same size behind. It is not touched before it is used.
    pub(super) fn reserve(&mut self, rows: usize, widths: Widths) {
        let Widths { states, coordinates, inputs, sources } = widths;
        self.time_s.reserve_exact(rows);
        self.mean.reserve_exact(rows * states);
        self.std.reserve_exact(rows * states);
        self.observed.reserve_exact(rows * coordinates);
        Arc::make_mut(&mut self.inputs).reserve_exact(rows * inputs);
        Arc::make_mut(&mut self.nis).reserve_exact(rows * sources);
        Arc::make_mut(&mut self.reports).reserve_exact(rows * sources);
        Arc::make_mut(&mut self.inertial).reserve_exact(rows);
    }

    /// Appends the report of an update.
    pub(super) fn report(&mut self, info: &Info, troubles: impl Iterator<Item = (Field, Fault)>) {
        Arc::make_mut(&mut self.nis).extend(info.sources.iter().map(|source| source.nis));
        let reports =
            info.sources.iter().zip(troubles).map(|(source, (field, fault))| Report::of(source, field, fault));
        Arc::make_mut(&mut self.reports).extend(reports);
        let (nis, count) = info.inertial;
        Arc::make_mut(&mut self.inertial).push((nis, count as u32));
    }
}

/// Zeros, except the last row.
fn last(from: &[f64], width: usize) -> Vec<f64> {
    let mut to = vec![0.0; from.len()];
    let start = from.len() - width;
    to[start..].copy_from_slice(&from[start..]);
    to
}
