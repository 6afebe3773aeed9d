//! What the filter believes at one instant.

use crate::kernels::dense::Square;

/// Time, mean and covariance, and which parts are rejected: the one thing that an update replaces.
#[derive(Debug, PartialEq)]
pub struct Belief {
    /// On the recording's clock, s.
    pub time_s: f64,
    /// State.
    pub mean: Vec<f64>,
    /// In the tangent space at the mean.
    pub covariance: Square,
    /// Per part of the measurement vector: since when it has been rejected without a break, NaN if it is not.
    pub rejected_since_s: Vec<f64>,
}

impl Belief {
    /// With nothing rejected, for so many parts of the measurement vector.
    pub fn new(time_s: f64, mean: Vec<f64>, covariance: Square, parts: usize) -> Self {
        Belief { time_s, mean, covariance, rejected_since_s: vec![f64::NAN; parts] }
    }
}

impl Clone for Belief {
    fn clone(&self) -> Self {
        Belief {
            mean: self.mean.clone(),
            covariance: self.covariance.clone(),
            rejected_since_s: self.rejected_since_s.clone(),
            ..*self
        }
    }

    /// Into the memory that is there: beliefs are copied at every step of a stretch that is filtered again.
    fn clone_from(&mut self, from: &Self) {
        // All fields, so that a new one cannot be forgotten.
        let Belief { time_s, mean, covariance, rejected_since_s } = self;
        mean.clone_from(&from.mean);
        covariance.clone_from(&from.covariance);
        rejected_since_s.clone_from(&from.rejected_since_s);
        *time_s = from.time_s;
    }
}

impl Belief {
    /// Variances of all states into `variance`.
    pub fn variances(&self, variance: &mut [f64]) {
        self.covariance.diagonal(variance);
        variance.iter_mut().for_each(|x| *x = x.max(0.0));
    }
}
