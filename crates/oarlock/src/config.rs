//! Settings of the tracker with their defaults, the only place where defaults are defined. Python's `Config` mirrors
//! them.

use crate::error::{Error, Result};
use crate::model::Structure;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// Process noise of the joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProcessNoise {
    /// White jerk: the covariance of an integrated random acceleration.
    Jerk,
    /// Eq. 6 of the paper: rank one, an acceleration that changes at each sample.
    Paper,
}

/// Use of magnetometers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Magnetometer {
    /// Not used.
    Off,
    /// Used unless norm, dip or innovation is an outlier.
    Gated,
    /// Used whatever norm and dip are; innovations are tested as those of a motion sensor.
    On,
}

/// Kind of filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FilterKind {
    /// Unscented: readings at sigma points, correct to second order.
    Ukf,
    /// Extended: readings linearised at the mean by their exact Jacobian. About 1.7 times as fast as `ukf`. The
    /// accuracy is the same within a few per cent while readings are nearly linear over the spread of the estimate, as
    /// at 100 Hz with closures of some millimetres. It neglects curvature: with a prior of 0.5 rad its first update is
    /// overconfident, 1.6 times as much as that of `ukf`; with closures of 0.1 mm it loses the posture where `ukf` does
    /// not.
    Ekf,
    /// Factorised, after Ruffaldi et al. (2014): one small unscented filter for each limb together with the trunk. The
    /// filters exchange messages. Correlations between limbs beyond the trunk are dropped after every sample. Nearly as
    /// accurate as `ukf`, and faster the more limbs there are; identical where the tree does not branch.
    Factorised,
}

/// Settings of the tracker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// How the model is tracked; none: as the model file says.
    pub structure: Option<Structure>,
    /// Slow states: `gyro_bias`, `accel_bias` and names of base accelerations. Names that the model lacks are ignored.
    #[serde(deserialize_with = "names")]
    pub estimate: Vec<String>,
    /// Use the closures.
    pub closures: bool,
    /// Use the contacts with the ground that the model declares.
    pub contacts: bool,
    /// Process noise of the joints.
    pub process_noise: ProcessNoise,
    /// Use of magnetometers.
    pub magnetometer: Magnetometer,
    /// Kind of filter; see [`FilterKind`].
    pub filter: FilterKind,
    /// Start posture by joint, rad or m, instead of the rest posture. The first samples are fitted from there.
    pub initial_q: Option<Vec<f64>>,
    /// Spread of the sigma points of `ukf`, (0, 1].
    pub alpha: f64,
    /// Weight of the second-order part, at least alpha^2.
    pub beta: f64,
    /// Usually 0.
    pub kappa: f64,
    /// Time stamps closer than this are one instant, s.
    pub merge_s: f64,
    /// Rate, Hz, of the samples into which readings are gathered, each used at its own time; 0: every instant is a
    /// sample. None: found from the time stamps; for a live tracker 0.
    pub sample_rate_hz: Option<f64>,
    /// Input joints whose encoder readings are taken as they are. The others are states that their encoders measure. None:
    /// those read at every sample; for a live tracker all that the model marks.
    #[serde(deserialize_with = "optional_names")]
    pub inputs: Option<Vec<String>>,
    /// Per stream: standard deviation of its time stamps, s. None: found from the time stamps; for a live tracker zero.
    pub stamp_std_s: Option<BTreeMap<String, f64>>,
    /// Time that a live tracker waits for readings that come late, s.
    pub wait_s: f64,
    /// Duration of the first samples that are fitted together as the start, s.
    pub start_window_s: f64,
    /// Reject innovations with a tail probability below 1e-6.
    pub gate: bool,
    /// Patience: readings rejected for longer than this are accepted again, s.
    pub gate_patience_s: f64,
    /// Interval at which the full state estimate is stored, s.
    pub belief_interval_s: f64,
    /// Rate of the rows of a track, Hz; 0: a row for every sample. None: found from the time stamps.
    pub output_rate_hz: Option<f64>,
}

impl Default for Config {
    fn default() -> Self {
        Config {
            structure: None,
            estimate: DEFAULT_ESTIMATE.map(String::from).to_vec(),
            closures: true,
            contacts: true,
            process_noise: ProcessNoise::Jerk,
            magnetometer: Magnetometer::Gated,
            filter: FilterKind::Ukf,
            initial_q: None,
            alpha: 0.3,
            beta: 2.0,
            kappa: 0.0,
            merge_s: 5e-4,
            sample_rate_hz: None,
            inputs: None,
            stamp_std_s: None,
            wait_s: 0.03,
            start_window_s: 0.1,
            gate: true,
            gate_patience_s: 0.05,
            belief_interval_s: 1.0,
            output_rate_hz: None,
        }
    }
}

/// Names in a list, or in a text with commas; "none" is no name.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a list of names, or a text with commas between them")]
enum Names {
    List(Vec<String>),
    Text(String),
}

fn optional_names<'de, D: Deserializer<'de>>(given: D) -> std::result::Result<Option<Vec<String>>, D::Error> {
    let listed = |names| match names {
        Names::List(names) => names,
        Names::Text(text) => {
            let names = text.split(',').map(str::trim).filter(|name| !matches!(*name, "" | "none"));
            names.map(String::from).collect()
        }
    };
    Ok(Option::deserialize(given)?.map(listed))
}

fn names<'de, D: Deserializer<'de>>(given: D) -> std::result::Result<Vec<String>, D::Error> {
    Ok(optional_names(given)?.unwrap_or_default())
}

/// Highest rate of samples and rows, Hz: sensors of bodies are slower, and a row takes a kilobyte.
const HIGHEST_RATE_HZ: f64 = 20_000.0;

/// States that are estimated by default, beside the joints.
pub const DEFAULT_ESTIMATE: [&str; 3] = ["gyro_bias", "accel_bias", "surge"];

impl Config {
    /// Rate of the rows, Hz; None: every sample is a row.
    pub fn row_rate_hz(&self) -> Option<f64> {
        self.output_rate_hz.filter(|hz| *hz > 0.0)
    }

    /// Refuses invalid numbers and names the valid ones.
    pub fn check(&self) -> Result<()> {
        let rate = |rate: Option<f64>| rate.filter(|hz| *hz != 0.0).unwrap_or(1.0);
        let positive = [
            ("merge_s", self.merge_s, "s, for example 0.0005"),
            ("start_window_s", self.start_window_s, "s, for example 0.1"),
            ("gate_patience_s", self.gate_patience_s, "s, for example 0.05"),
            ("belief_interval_s", self.belief_interval_s, "s, for example 1"),
            ("output_rate_hz", rate(self.output_rate_hz), "Hz, or 0 for every sample"),
            ("sample_rate_hz", rate(self.sample_rate_hz), "Hz, or 0 for every instant"),
        ];
        for (key, value, unit) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::Data(format!("config: {key} = {value}: expected a positive number ({unit})")));
            }
        }
        for (key, hz) in [("output_rate_hz", self.output_rate_hz), ("sample_rate_hz", self.sample_rate_hz)] {
            if let Some(hz) = hz.filter(|hz| *hz > HIGHEST_RATE_HZ) {
                return Err(Error::Data(format!("config: {key} = {hz}: expected at most {HIGHEST_RATE_HZ} Hz")));
            }
        }
        let stds = self.stamp_std_s.iter().flatten();
        if let Some((stream, std)) = { stds }.find(|(_, std)| !(**std >= 0.0 && std.is_finite())) {
            return Err(Error::Data(format!("config: stamp_std_s of '{stream}' = {std}: expected 0 s or more")));
        }
        if !(self.wait_s >= 0.0 && self.wait_s.is_finite()) {
            return Err(Error::Data(format!(
                "config: wait_s = {}: expected 0 s or more, for example 0.03",
                self.wait_s
            )));
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
