//! A hypothesis in compact form, stored for the smoother.

use crate::estimate::belief::Belief;
use crate::kernels::dense::Square;
use crate::track::hypothesis::Hypothesis;

/// A hypothesis whose symmetric covariance is stored as its upper triangle.
#[derive(Debug, Clone)]
pub(super) struct Packed {
    /// All but the covariance.
    known: Hypothesis,
    upper: Vec<f64>,
}

impl Packed {
    pub(super) fn of(known: &Hypothesis) -> Self {
        let upper = upper(&known.belief.covariance);
        let Hypothesis { belief, sources, rivals, links, .. } = known;
        let belief = Belief { covariance: Square::zeros(0), ..belief.clone() };
        let (sources, rivals, links) = (sources.clone(), rivals.clone(), links.clone());
        Packed { known: Hypothesis { belief, sources, slopes: Vec::new(), rivals, links, ..*known }, upper }
    }

    /// Replaces the filtered by the smoothed estimate.
    pub(super) fn replace(&mut self, smoothed: &Belief) {
        self.upper = upper(&smoothed.covariance);
        self.known.belief = Belief { covariance: Square::zeros(0), ..smoothed.clone() };
        self.known.rivals.clear();
    }

    pub(super) fn time_s(&self) -> f64 {
        self.known.belief.time_s
    }

    pub(super) fn whole(&self) -> Hypothesis {
        let n = self.known.belief.mean.len();
        let (mut covariance, mut rest) = (Square::zeros(n), self.upper.as_slice());
        for i in 0..n {
            let (row, below) = rest.split_at(n - i);
            covariance.row_mut(i)[i..].copy_from_slice(row);
            rest = below;
        }
        covariance.mirror_upper();
        let mut whole = self.known.clone();
        whole.belief.covariance = covariance;
        whole
    }
}

fn upper(covariance: &Square) -> Vec<f64> {
    let n = covariance.n();
    // Collected without its size, it would take half as much again.
    let mut upper = Vec::with_capacity(n * (n + 1) / 2);
    (0..n).for_each(|i| upper.extend_from_slice(&covariance.row(i)[i..]));
    upper
}
