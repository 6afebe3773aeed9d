//! What several tests share: models, seeded noise, a sculler who holds the oars, samples and streams of them.
#![allow(dead_code)] // each test takes the part that it needs

pub mod absurd;
pub mod chance;
pub mod chi_square;
pub mod extended;
pub mod nature;
pub mod record;
pub mod stroke;
pub mod textbook;
pub mod tree;
pub mod wave;

pub use oarlock_oracle::so3;

use nalgebra::{DMatrix, DVector};
use oarlock::body::Body;
use oarlock::config::{Config, Magnetometer};
use oarlock::estimate::belief::Belief;
use oarlock::estimate::transition::Transition;
use oarlock::kernels::dense::Square;
use oarlock::model::{Model, Structure};
use oarlock::track::hypothesis::Hypothesis;
use oarlock::track::{Calibration, Tracker};
use std::sync::Arc;

pub const SCULLER: &str = include_str!("../../../../python/oarlock/model/shipped/sculler.toml");

/// The sculler for `stroke::Stroke`, whose arms follow the handles with more jerk than the file expects.
pub fn lively_sculler() -> String {
    SCULLER.replace("density = 11.2", "density = 40.0")
}

/// Settings that leave nothing to be found from time stamps: every instant is a sample, and all input joints of the sculler are
/// inputs even where their readings are missing.
pub fn settled() -> Config {
    let oars =
        ["r", "l"].into_iter().flat_map(|side| ["phi", "alpha", "theta"].map(|angle| format!("{side}_oar_{angle}")));
    Config { sample_rate_hz: Some(0.0), inputs: Some(oars.collect()), ..Config::default() }
}

/// Two links on crossed hinges, one inertial unit each, biases that are known.
pub const CHAIN: &str = r#"
format = 1
name = "chain"
description = "two links on crossed hinges"
[world]
up = [0, 1, 0]
forward = [0, 0, 1]
gravity_m_s2 = 9.80665
magnetic_norm_ut = 47.0
magnetic_dip_rad = "60*pi/180"
magnetic_azimuth_rad = 0.5
azimuth_fixed = true
[process]
hinge = { kind = "jerk", density = 2.0, start_std = [0.05, 0.2, 1.0] }
[[joint]]
name = "first"
kind = "hinge"
[[joint]]
name = "second"
kind = "hinge"
[[frame]]
name = "upper"
parent = "root"
dh = { a = 0.4, alpha = "pi/2", d = 0.1, theta = 0.3 }
joint = "first"
[[frame]]
name = "lower"
parent = "upper"
dh = { a = 0.3, alpha = 0.2, d = 0, theta = -0.4 }
joint = "second"
[[sensor]]
name = "upper"
kind = "imu"
frame = "upper"
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.05
mag_std_ut = 1.0
mount.offset = [-0.2, 0.03, 0.01]
[[sensor]]
name = "lower"
kind = "imu"
frame = "lower"
gyro_std_rad_s = 0.01
accel_std_m_s2 = 0.05
mag_std_ut = 1.0
mount.offset = [-0.1, -0.02, 0.04]
mount.rpy = [0.4, -0.2, 1.0]
"#;

/// A model as a tree, whatever its text says: these tests are of trees.
pub fn model(text: &str) -> Arc<Model> {
    let mut model = Model::from_toml(text, "model.toml").unwrap_or_else(|e| panic!("{e}"));
    model.structure = Some(Structure::Tree);
    Arc::new(model)
}

/// A model at its own parameters and mounts.
pub fn body(model: &Arc<Model>, config: &Config) -> Body {
    let parameters = model.default_parameters();
    let mounts = vec![None; model.sensors.len()];
    Body::new(model.clone(), &parameters, &mounts, config).unwrap_or_else(|e| panic!("{e}"))
}

/// Every reading counts in full: no gate, no test of the field's norm.
pub fn plain(estimate: &[&str]) -> Config {
    Config {
        estimate: estimate.iter().map(|s| s.to_string()).collect(),
        gate: false,
        magnetometer: Magnetometer::On,
        ..Config::default()
    }
}

pub fn vectors(name: &str) -> serde_json::Value {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/vectors");
    let text = std::fs::read_to_string(root.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    serde_json::from_str(&text).expect("valid JSON")
}

pub fn numbers(value: &serde_json::Value) -> Vec<f64> {
    let list = value.as_array().expect("a list");
    list.iter().map(|x| x.as_f64().expect("a number")).collect()
}

/// A belief with independent states, nothing learnt and nothing rejected.
pub fn belief(body: &Body, time_s: f64, mean: Vec<f64>, std: &[f64]) -> Belief {
    let mut covariance = Square::zeros(std.len());
    for (i, s) in std.iter().enumerate() {
        *covariance.at_mut(i, i) = s * s;
    }
    let parts = body.groups().parts.len();
    Belief::new(time_s, mean, covariance, parts)
}

/// The same, with nothing remembered of its sources.
pub fn fresh(body: &Body, time_s: f64, mean: Vec<f64>, std: &[f64]) -> Hypothesis {
    Hypothesis::new(belief(body, time_s, mean, std), body.suite.sources.len())
}

/// Standard deviations to start with: those of the model, walking joints and azimuth at 0.2 rad.
pub fn start_std(body: &Body) -> Vec<f64> {
    let mut std = vec![0.2; body.layout.dim()];
    for (_, axis, slots) in body.moving() {
        if let Some((rate, accel)) = slots.rates {
            let start = axis.process.start_std;
            (std[slots.q], std[rate], std[accel]) = (start[0], start[1], start[2]);
        }
    }
    for slot in &body.layout.errors {
        std[slot.first..slot.first + 3].fill(slot.error.start_std);
    }
    for slot in &body.layout.pushes {
        let base = &body.model.base_accelerations[slot.number];
        std[slot.state] = base.start_std;
        slot.rate.into_iter().for_each(|rate| std[rate] = base.rate_std());
    }
    std
}

/// A tracker without a calibration.
pub fn tracker(model: &Arc<Model>, config: &Config) -> Tracker {
    Tracker::new(model.clone(), &Calibration::default(), config).unwrap()
}

/// The same, started at a state.
pub fn started(body: &Body, config: &Config, mean: Vec<f64>, std: &[f64]) -> Tracker {
    let mut tracker = tracker(&body.model, config);
    tracker.resume(fresh(body, 0.0, mean, std)).unwrap();
    tracker
}

/// Numbers as they are stored, so that a missing one equals another.
pub fn bits(x: &[f64]) -> Vec<u64> {
    x.iter().map(|x| x.to_bits()).collect()
}

/// The larger one, and NaN if either is.
pub fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() {
        f64::NAN
    } else {
        a.max(b)
    }
}

/// F, what is added to the mean, and Q, from the blocks of a motion of `n` states.
pub fn dense(transition: &Transition, n: usize) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
    let (mut f, mut offset, mut q) = (DMatrix::zeros(n, n), DVector::zeros(n), DMatrix::zeros(n, n));
    for b in &transition.blocks {
        for r in 0..b.len {
            offset[b.index[r]] = b.offset[r];
            for c in 0..b.len {
                f[(b.index[r], b.index[c])] = b.factor[r][c];
                q[(b.index[r], b.index[c])] = b.noise[r][c];
            }
        }
    }
    (f, offset, q)
}
