//! Position sensor: reads a point of a frame in root axes.

use super::{Quantity, RowGroups};
use crate::kinematics::FrameMotion;
use crate::lane::Real;

/// Reads one point.
#[derive(Debug, Clone)]
pub struct Position {
    /// Index of the frame.
    pub frame: usize,
    /// In the frame, m.
    pub point: [f64; 3],
    /// m.
    pub std: f64,
}

impl Position {
    /// x, y, z.
    pub fn rows(&self) -> RowGroups {
        vec![(Quantity::Position, &["x", "y", "z"], vec![self.std; 3])]
    }

    /// The point in root axes, m.
    #[inline(always)]
    pub fn predict<T: Real>(&self, frame: &FrameMotion<T>, out: &mut [T]) {
        let point = frame.position + frame.rotation.apply_f64(self.point);
        out.copy_from_slice(&point.0);
    }
}
