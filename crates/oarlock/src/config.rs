//! Tuning numbers, each with its default. The defaults live here and nowhere else.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// What to do with the joints' driving noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProcessNoise {
    /// White jerk: the covariance of an integrated random acceleration.
    Jerk,
    /// Eq. 6 of the paper: rank one, an acceleration that jumps at each sample.
    Paper,
}

/// What to do with magnetometers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Magnetometer {
    /// Not used.
    Off,
    /// Used unless the field's norm, its dip or the innovation is odd.
    Gated,
    /// Used whatever norm and dip are, and tested like a sensor that feels motion.
    On,
}

/// What is known only roughly and not estimated: mounts, lengths, places of units, zeros of encoders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Consider {
    /// It is taken as exact.
    Off,
    /// It widens the bands as far as innovations that last tell that it is wrong.
    Learnt,
    /// It widens the bands as far as the model file's standard deviations say.
    Always,
}

/// Which filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FilterKind {
    /// Unscented: readings at sigma points, right to second order.
    Ukf,
    /// Extended: readings linearised at the mean by their exact Jacobian. About 1.7 times as fast as `ukf`, and as good
    /// to a few per cent while readings are straight over the spread of the belief, as they are at 100 Hz with loops of some millimetres. It
    /// takes curvature for information. From 0.5 rad of ignorance its first update is off by more than it says, 1.6 times as far as
    /// that of `ukf`; with loops of 0.1 mm it goes astray where `ukf` does not.
    Ekf,
    /// Factorised, in the manner of Ruffaldi et al. (2014): small unscented filters along the tree, one for the trunk and one for each
    /// limb with it, pass messages to each other. What limbs have in common beyond the trunk is dropped after every sample. Nearly as
    /// good as `ukf`, and cheaper the more limbs there are; the same filter where the tree does not branch.
    Factorised,
}

/// How to track.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Slow states: `gyro_bias`, `accel_bias` and names of base accelerations. Those that a model lacks are left out.
    pub estimate: Vec<String>,
    /// Use the closed loops.
    pub closures: bool,
    /// How joints are driven.
    pub process_noise: ProcessNoise,
    /// Trust in magnetometers.
    pub magnetometer: Magnetometer,
    /// Which filter; see [`FilterKind`] for where they differ.
    pub filter: FilterKind,
    /// Start posture by joint, rad or m, instead of the rest posture; the first samples are fitted from there.
    pub initial_q: Option<Vec<f64>>,
    /// Spread of the sigma points of `ukf`, (0, 1].
    pub alpha: f64,
    /// Weight of the second-order part, at least alpha^2.
    pub beta: f64,
    /// Usually 0.
    pub kappa: f64,
    /// Stamps closer than this form one sample, s.
    pub merge_s: f64,
    /// Samples fitted together to find the start, s.
    pub start_window_s: f64,
    /// Test innovations at a tail probability of 1e-6.
    pub gate: bool,
    /// A reading rejected for longer than this is believed again, s.
    pub gate_patience_s: f64,
    /// Memory, s, with which driving noise of joints and base and the usual size of innovations are learnt; none keeps
    /// the model's.
    pub learning_memory_s: Option<f64>,
    /// What to make of mounts, lengths, places of units and zeros of encoders that are not estimated.
    pub consider: Consider,
    /// How often the full belief is kept, s.
    pub belief_interval_s: f64,
    /// Keep every sample (none), or the first one of each 1/rate s.
    pub output_rate_hz: Option<f64>,
}

impl Default for Config {
    fn default() -> Self {
        Config {
            estimate: DEFAULT_ESTIMATE.map(String::from).to_vec(),
            closures: true,
            process_noise: ProcessNoise::Jerk,
            magnetometer: Magnetometer::Gated,
            filter: FilterKind::Ukf,
            initial_q: None,
            alpha: 0.3,
            beta: 2.0,
            kappa: 0.0,
            merge_s: 5e-4,
            start_window_s: 0.1,
            gate: true,
            gate_patience_s: 0.05,
            learning_memory_s: Some(3.0),
            consider: Consider::Learnt,
            belief_interval_s: 1.0,
            output_rate_hz: None,
        }
    }
}

/// What is estimated beside the joints unless told otherwise.
pub const DEFAULT_ESTIMATE: [&str; 3] = ["gyro_bias", "accel_bias", "surge"];

impl Config {
    /// Refuses numbers that make no sense, saying which and what would.
    pub fn check(&self) -> Result<()> {
        let positive = [
            ("merge_s", self.merge_s, "s, for example 0.0005"),
            ("start_window_s", self.start_window_s, "s, for example 0.1"),
            ("gate_patience_s", self.gate_patience_s, "s, for example 0.05"),
            ("learning_memory_s", self.learning_memory_s.unwrap_or(1.0), "s, for example 3, or none"),
            ("belief_interval_s", self.belief_interval_s, "s, for example 1"),
            ("output_rate_hz", self.output_rate_hz.unwrap_or(1.0), "Hz, or none for every sample"),
        ];
        for (key, value, unit) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::Data(format!("config: {key} = {value}: expected a positive number ({unit})")));
            }
        }
        if !(self.alpha > 0.0 && self.alpha <= 1.0) {
            return Err(Error::Data(format!(
                "config: alpha = {}: expected a number in (0, 1], for example 0.3",
                self.alpha
            )));
        }
        if !(self.beta >= self.alpha * self.alpha && self.beta.is_finite()) {
            return Err(Error::Data(format!(
                "config: beta = {}: expected at least alpha^2 = {} (else a weight is negative); 2 is right for a Gaussian",
                self.beta,
                self.alpha * self.alpha
            )));
        }
        if !(self.kappa >= 0.0 && self.kappa.is_finite()) {
            return Err(Error::Data(format!("config: kappa = {}: expected 0 or more", self.kappa)));
        }
        Ok(())
    }
}
