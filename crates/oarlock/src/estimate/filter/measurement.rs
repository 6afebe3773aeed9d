//! What an update is given: readings, how their rows are grouped, and how they are tested. For [`super::Filter`] and its callers.

use crate::estimate::sigma::Spread;
use std::ops::Range;

/// How rows of the measurement vector are grouped.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RowGroups {
    /// Rows that are accepted or rejected together.
    pub parts: Vec<Range<usize>>,
    /// Rows that are reported together; each source consists of whole parts.
    pub sources: Vec<Range<usize>>,
    /// All rows of inertial units, whose joint consistency is reported.
    pub inertial: Vec<usize>,
}

/// A test of a part along one direction, such as the dip of the magnetic field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionTest {
    /// Unit vector over the part's three rows, which have the same noise.
    pub along: [f64; 3],
    /// Deviation along this direction, in the unit of the rows.
    pub off: f64,
    /// Largest deviation that passes ...
    pub tolerance: f64,
    /// ... or so many standard deviations of the predicted reading, whichever is larger.
    pub sigmas: f64,
}

/// Readings of one instant, and how they are to be tested.
#[derive(Debug, Clone, Copy)]
pub struct Measurement<'a> {
    /// Readings; NaN is missing.
    pub z: &'a [f64],
    /// Standard deviation of each row's noise.
    pub std: &'a [f64],
    /// Per part: rejected without a test.
    pub excluded: &'a [bool],
    /// Per part: tested at the bare quantile, and with its own patience.
    pub strict: &'a [bool],
    /// Per part: a further test along one direction.
    pub direction_tests: &'a [Option<DirectionTest>],
    /// Groups of rows.
    pub groups: &'a RowGroups,
}

/// How innovations are tested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gate {
    /// Whether innovations are tested.
    pub on: bool,
    /// A part is an outlier if its NIS exceeds the 1e-6 quantile times this factor.
    pub slack: f64,
    /// A part that has been rejected for longer than this is accepted again, s: the belief may be wrong, not the sensor.
    pub patience_s: f64,
    /// The same for strict parts, s.
    pub strict_patience_s: f64,
}

/// Settings of an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpdateSettings {
    /// Scaling of the sigma points.
    pub spread: Spread,
    /// Innovation tests.
    pub gate: Gate,
}
