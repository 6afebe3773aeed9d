//! What the filter believes at one instant.

use super::dense::Square;

/// Time, mean and covariance: the one thing that a step replaces.
#[derive(Debug, Clone, PartialEq)]
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
    pub habit: Vec<f64>,
    /// Per source: when it last said anything, NaN if it never did.
    pub seen_s: Vec<f64>,
    /// Per part of the measurement vector: since when it has been rejected without a break, NaN if it is not.
    pub rejected_since_s: Vec<f64>,
}
