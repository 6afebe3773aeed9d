//! What an update reports: innovations, NIS and what became of each part. For the tracker's notes and for tests.

use super::RowGroups;

/// Report of one source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceInfo {
    /// Normalised innovation squared over the used rows; NaN if none was used.
    pub nis: f64,
    /// Rows used.
    pub used: u8,
    /// Rows present but rejected.
    pub rejected: u8,
    /// Rows missing.
    pub missing: u8,
}

/// What an update did with a part of the measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// No reading.
    Missing,
    /// Used.
    Accepted,
    /// Rejected before the update.
    Excluded,
    /// Rejected by its [`super::DirectionTest`].
    WrongDirection,
    /// Rejected: its innovation is too large.
    Outlier,
    /// Some or all rows withheld: at the end of the sensor's range.
    Clipped,
    /// Withheld: the reading repeats to the bit.
    Stuck,
}

/// The report of one update.
#[derive(Debug, Clone, PartialEq)]
pub struct Info {
    /// Reading minus predicted reading, NaN where missing.
    pub innovation: Vec<f64>,
    /// Of all used rows.
    pub nis: f64,
    /// Joint NIS of all used rows of inertial units, and their number.
    pub inertial: (f64, usize),
    /// In the order of the sources.
    pub sources: Vec<SourceInfo>,
    /// In the order of the parts.
    pub parts: Vec<Verdict>,
    /// Log-likelihood of the readings ([`super::log_likelihood`]); a rejected part counts at its threshold.
    pub log_likelihood: f64,
    /// Whether the belief was reset before this update, because its sensors contradicted it.
    pub lost: bool,
}

impl Info {
    /// For `groups`; nothing reported yet.
    pub fn new(groups: &RowGroups, rows: usize) -> Self {
        let none = SourceInfo { nis: f64::NAN, used: 0, rejected: 0, missing: 0 };
        Info {
            innovation: vec![f64::NAN; rows],
            nis: f64::NAN,
            inertial: (f64::NAN, 0),
            sources: vec![none; groups.sources.len()],
            parts: vec![Verdict::Missing; groups.parts.len()],
            log_likelihood: 0.0,
            lost: false,
        }
    }
}

/// The estimate is not a number, or its covariance not positive definite.
#[derive(Debug, Clone, PartialEq)]
pub struct Diverged {
    /// Which of them, and where.
    pub what: String,
}
