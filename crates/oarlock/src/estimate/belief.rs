//! What the filter believes at one instant.

use crate::kernels::dense::Square;

/// Time, mean and covariance, and what was learnt of noise: the one thing that an update replaces.
#[derive(Debug, PartialEq)]
pub struct Belief {
    /// On the recording's clock, s.
    pub time_s: f64,
    /// State.
    pub mean: Vec<f64>,
    /// In the tangent space at the mean.
    pub covariance: Square,
    /// Per driven coordinate (`System::driven`): how much stronger its driving noise is than the model says (variance).
    pub drive: Vec<f64>,
    /// Per part of the measurement vector: usual size of its innovations, as a factor on what is expected (variance).
    pub usual_nis: Vec<f64>,
    /// How much larger the noise of inertial units is than the model says (variance).
    pub inflation: f64,
    /// Usual size of the innovations of all inertial units together, as a factor on what is expected (variance).
    pub surprise: f64,
    /// Per part of the measurement vector: since when it has been rejected without a break, NaN if it is not.
    pub rejected_since_s: Vec<f64>,
}

impl Belief {
    /// With nothing learnt and nothing rejected, for so many driven coordinates and parts of the measurement vector.
    pub fn new(time_s: f64, mean: Vec<f64>, covariance: Square, (driven, parts): (usize, usize)) -> Self {
        Belief {
            time_s,
            mean,
            covariance,
            drive: vec![1.0; driven],
            usual_nis: vec![1.0; parts],
            inflation: 1.0,
            surprise: 1.0,
            rejected_since_s: vec![f64::NAN; parts],
        }
    }
}

impl Clone for Belief {
    fn clone(&self) -> Self {
        Belief {
            mean: self.mean.clone(),
            covariance: self.covariance.clone(),
            drive: self.drive.clone(),
            usual_nis: self.usual_nis.clone(),
            rejected_since_s: self.rejected_since_s.clone(),
            ..*self
        }
    }

    /// Into the memory that is there: beliefs are copied at every step of a stretch that is filtered again.
    fn clone_from(&mut self, from: &Self) {
        // All fields, so that a new one cannot be forgotten.
        let Belief { time_s, mean, covariance, drive, usual_nis, inflation, surprise, rejected_since_s } = self;
        mean.clone_from(&from.mean);
        covariance.clone_from(&from.covariance);
        drive.clone_from(&from.drive);
        usual_nis.clone_from(&from.usual_nis);
        rejected_since_s.clone_from(&from.rejected_since_s);
        (*time_s, *inflation, *surprise) = (from.time_s, from.inflation, from.surprise);
    }
}

impl Belief {
    /// Variances of all states into `variance`.
    pub fn variances(&self, variance: &mut [f64]) {
        self.covariance.diagonal(variance);
        variance.iter_mut().for_each(|x| *x = x.max(0.0));
    }
}
