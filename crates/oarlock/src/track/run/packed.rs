//! A belief that is kept for later, in half the room.

use crate::estimate::belief::Belief;
use crate::kernels::dense::Square;

/// A belief whose covariance, which is exactly symmetric, is kept by its upper triangle.
#[derive(Debug, Clone)]
pub(super) struct Packed {
    /// All but the covariance, and without doubt: what is considered moves no estimate.
    belief: Belief,
    upper: Vec<f64>,
}

impl Packed {
    pub(super) fn of(belief: &Belief) -> Self {
        let n = belief.mean.len();
        let upper = (0..n).flat_map(|i| &belief.covariance.row(i)[i..]).copied().collect();
        let belief = Belief { covariance: Square::zeros(0), doubt: Vec::new(), ..belief.clone() };
        Packed { belief, upper }
    }

    pub(super) fn time_s(&self) -> f64 {
        self.belief.time_s
    }

    pub(super) fn whole(&self) -> Belief {
        let n = self.belief.mean.len();
        let (mut covariance, mut rest) = (Square::zeros(n), self.upper.as_slice());
        for i in 0..n {
            let (row, below) = rest.split_at(n - i);
            covariance.row_mut(i)[i..].copy_from_slice(row);
            rest = below;
        }
        covariance.mirror_upper();
        Belief { covariance, ..self.belief.clone() }
    }
}
