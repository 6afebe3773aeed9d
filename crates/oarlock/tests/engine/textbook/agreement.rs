//! The filter of the product equals the textbook's, step for step.

use super::support::chance::Chance;
use super::support::record::Scene;
use super::support::stroke::Stroke;
use super::support::textbook::{run_both, unscented, SAME_FILTER_SIGMA};
use super::support::{body, model, plain, SCULLER};
use oarlock::config::Config;

/// Both filters on a sculler over `steps` samples at 100 Hz.
fn assert_agrees(what: &str, config: &Config, steps: usize, seed: u64) {
    let body = body(&model(SCULLER), config);
    let stroke = Stroke::new(&body, 2.2);
    let surges = if config.estimate.is_empty() { 0.0 } else { 2.0 };
    let surge = |t: f64| surges * (2.9 * t).sin();
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &surge, azimuth_rad: 0.5, noise: 1.0 };
    let (worst, errors) = run_both(&scene, config, steps, (0.5, &mut Chance::new(seed)), &mut unscented);
    let error = errors.rows(0, 2).abs().sum();
    assert!(error < 0.05, "the oracle itself went astray: {error}");
    worst.assert_below(what, SAME_FILTER_SIGMA);
}

#[test]
fn joints_and_azimuth_over_2000_steps() {
    assert_agrees("41 states", &plain(&[]), 2_000, 1);
}

#[test]
fn with_biases_and_surge() {
    assert_agrees("72 states", &plain(&["gyro_bias", "accel_bias", "surge"]), 500, 2);
}

#[test]
fn without_closures() {
    let config = Config { closures: false, ..plain(&["surge"]) };
    assert_agrees("42 states, open loops", &config, 30, 3);
}

#[test]
fn with_another_spread() {
    let config = Config { alpha: 0.7, beta: 1.1, kappa: 2.0, ..plain(&[]) };
    assert_agrees("alpha 0.7, beta 1.1, kappa 2", &config, 200, 4);
}
