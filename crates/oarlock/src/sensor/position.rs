//! Position sensor: reads a point of a frame in root axes.

use super::{Quantity, RowGroups, Worn};
use crate::kernels::lane::Real;
use crate::kinematics::FrameMotion;
use crate::model::Point;

/// Reads one point.
#[derive(Debug, Clone)]
pub struct Position {
    /// Index of the frame.
    pub frame: usize,
    /// In the frame, m.
    pub point: Point,
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
    pub fn predict<T: Real>(&self, frame: &FrameMotion<T>, worn: Worn<T>, out: &mut [T]) {
        let point = frame.position + self.point.turned(&frame.rotation, worn.lengths);
        [out[0], out[1], out[2]] = point.0;
    }
}
