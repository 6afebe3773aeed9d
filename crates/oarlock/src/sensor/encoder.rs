//! Encoder: reads a joint that is a state (eq. 10).

use super::{Quantity, RowGroups};

/// Reads one joint.
#[derive(Debug, Clone)]
pub struct Encoder {
    /// Index of the joint's coordinate.
    pub coordinate: usize,
    /// rad or m.
    pub std: f64,
}

impl Encoder {
    /// One row that bears the sensor's own name.
    pub fn rows(&self) -> RowGroups {
        vec![(Quantity::Joint, &[""], vec![self.std])]
    }
}
