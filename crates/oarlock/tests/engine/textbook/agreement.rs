//! The filter of the product equals the textbook's, step for step.

use super::support::chance::Chance;
use super::support::record::{punch_holes, times, Scene};
use super::support::stroke::Stroke;
use super::support::{belief, body, model, plain, start_std, worse, SCULLER};
use super::ukf::Ukf;
use nalgebra::DVector;
use oarlock::config::Config;
use oarlock::estimate::belief::Belief;
use oarlock::motion::is_observed;
use oarlock::recording::Sample;
use oarlock::track::{Calibration, Status, Tracker};

/// Rounding differs between the two forms of the same equations, and closures of 2 mm beside accelerations of 5 rad/s2
/// make covariances whose condition number takes about eight of sixteen digits.
const SAME_FILTER_SIGMA: f64 = 1e-8;

pub struct Worst {
    pub mean: f64,
    pub covariance: f64,
}

impl Worst {
    pub fn see(&mut self, ours: &Belief, textbook: &Ukf) {
        let sigma = textbook.covariance.diagonal().map(f64::sqrt);
        let away = textbook.away(&DVector::from_row_slice(&ours.mean));
        for i in 0..sigma.len() {
            let gap = away[i].abs() / sigma[i];
            self.mean = worse(self.mean, gap);
            for j in 0..sigma.len() {
                let gap = (ours.covariance.at(i, j) - textbook.covariance[(i, j)]).abs();
                self.covariance = worse(self.covariance, gap / (sigma[i] * sigma[j]));
            }
        }
    }
}

/// Rows as the textbook sees them: a loop reads zero where its oar's angles are there.
fn with_loops(sample: &Sample, body: &oarlock::body::Body, config: &Config) -> Vec<f64> {
    let mut z = sample.z.clone();
    let joint = |name: String| body.model.joints.iter().position(|j| j.name == name).unwrap();
    for source in body.suite.sources.iter().filter(|s| s.name.ends_with("_grip")) {
        let side = source.name[..1].to_string();
        let angles = ["phi", "alpha"].map(|a| sample.inputs[joint(format!("{side}_oar_{a}"))]);
        if config.closures && angles.iter().all(|a| !a.is_nan()) {
            z[source.rows.clone()].fill(0.0);
        }
    }
    z
}

pub fn textbook_from<'a>(start: &Belief, body: &'a oarlock::body::Body, config: &Config) -> Ukf<'a> {
    let (names, spread) = (&body.layout.names, [config.alpha, config.beta, config.kappa]);
    Ukf::of_model(&body.model, names, &start.mean, start.covariance.as_slice(), spread)
}

/// Both filters from the same start over the samples: how far apart they ever were, and the textbook's at the end. `see` is shown
/// our belief behind every sample.
pub fn side_by_side<'a>(
    body: &'a oarlock::body::Body,
    config: &Config,
    start: &Belief,
    samples: &[Sample],
    see: &mut dyn FnMut(&Belief),
) -> (Worst, Ukf<'a>) {
    let mut tracker = Tracker::new(body.model.clone(), &Calibration::default(), config).unwrap();
    tracker.resume(start.clone()).unwrap();
    let mut textbook = textbook_from(start, body, config);
    let noise = textbook.body.std();
    assert_eq!(noise, body.suite.std());
    let (mut worst, mut before_s) = (Worst { mean: 0.0, covariance: 0.0 }, start.time_s);
    for sample in samples {
        textbook.predict(sample.time_s - before_s);
        before_s = sample.time_s;
        textbook.update(&with_loops(sample, body, config), &noise, &sample.inputs);
        assert_eq!(tracker.step(sample).unwrap(), Status::Tracking);
        let ours = tracker.belief().unwrap();
        assert_no_spring(body, ours);
        worst.see(ours, &textbook);
        see(ours);
    }
    (worst, textbook)
}

/// Both filters on a sculler over `steps` samples at 100 Hz.
fn run_both(config: &Config, steps: usize, seed: u64) -> Worst {
    let model = model(SCULLER);
    let body = body(&model, config);
    let stroke = Stroke::new(&body, 2.2);
    let scene = Scene {
        body: &body,
        motion: &|t| stroke.at(t),
        surge: &|t| {
            if config.estimate.is_empty() {
                0.0
            } else {
                2.0 * (2.9 * t).sin()
            }
        },
        azimuth_rad: 0.5,
        noise: 1.0,
    };
    let mut chance = Chance::new(seed);
    let mut samples = scene.samples(&times(0.01, 0.01, steps), &mut chance);
    punch_holes(&body, &mut samples, &mut chance);
    let std = start_std(&body);
    let away = chance.normals(std.len());
    let truth = scene.state(0.0);
    let mean = (0..std.len()).map(|i| truth[i] + 0.5 * std[i] * away[i]).collect();
    let start = belief(&body, 0.0, mean, &std);
    let (worst, textbook) = side_by_side(&body, config, &start, &samples, &mut |_| {});
    let truth = scene.state(samples[steps - 1].time_s);
    let error: f64 = (0..2).map(|i| (textbook.mean[i] - truth[i]).abs()).sum();
    assert!(error < 0.05, "the oracle itself went astray: {error}");
    worst
}

/// The textbook side knows no spring for joints that nothing observes; none may set in here.
pub fn assert_no_spring(body: &oarlock::body::Body, belief: &Belief) {
    for (c, axis, slots) in body.moving() {
        let turn = body.layout.turns.iter().find(|(first, _)| (*first..first + 3).contains(&c));
        let variance = match turn {
            Some((_, turn)) => (0..3).map(|i| belief.covariance.at(turn.q + i, turn.q + i)).sum(),
            None => belief.covariance.at(slots.q, slots.q),
        };
        assert!(is_observed(axis, variance), "{}", body.layout.names[slots.q]);
    }
}

pub fn assert_same(what: &str, worst: &Worst) {
    println!("{what}: mean {:.2e} sigma, covariance {:.2e} sigma sigma", worst.mean, worst.covariance);
    assert!(worst.mean <= SAME_FILTER_SIGMA, "{what}: mean {:e}", worst.mean);
    assert!(worst.covariance <= SAME_FILTER_SIGMA, "{what}: covariance {:e}", worst.covariance);
}

#[test]
fn joints_and_azimuth_over_2000_steps() {
    let worst = run_both(&plain(&[]), 2_000, 1);
    assert_same("41 states", &worst);
}

#[test]
fn with_biases_and_surge() {
    let worst = run_both(&plain(&["gyro_bias", "accel_bias", "surge"]), 500, 2);
    assert_same("72 states", &worst);
}

#[test]
fn without_closures() {
    let config = Config { closures: false, ..plain(&["surge"]) };
    let worst = run_both(&config, 30, 3);
    assert_same("42 states, open loops", &worst);
}

#[test]
fn with_another_spread() {
    let config = Config { alpha: 0.7, beta: 1.1, kappa: 2.0, ..plain(&[]) };
    let worst = run_both(&config, 200, 4);
    assert_same("alpha 0.7, beta 1.1, kappa 2", &worst);
}
