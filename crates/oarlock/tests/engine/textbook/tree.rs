//! The same agreement on a body with balls and free joints.

use super::support::chance::Chance;
use super::support::record::{times, Scene};
use super::support::textbook::{run_both, side_by_side, unscented, SAME_FILTER_SIGMA};
use super::support::tree::{spanned, standing, TREE};
use super::support::wave::Wave;
use super::support::{belief, body, model, plain, start_std};
use oarlock::config::Config;

const ALL: [&str; 4] = ["gyro_bias", "accel_bias", "surge", "heave"];

/// Both filters over `steps` samples at 100 Hz.
fn assert_agrees(what: &str, text: &str, config: &Config, steps: usize, seed: u64) {
    let model = model(text);
    let body = body(&model, config);
    let mut chance = Chance::new(seed);
    let wave = Wave::random(&model, 0.8, 0.8, &mut chance);
    let surge = |t: f64| if config.estimate.is_empty() { 0.0 } else { (2.9 * t).sin() };
    let motion = |t: f64| wave.at(t);
    let scene = Scene { body: &body, motion: &motion, surge: &surge, azimuth_rad: 0.3, noise: 1.0 };
    let (worst, errors) = run_both(&scene, config, steps, (0.5, &mut chance), &mut unscented);
    let error = errors.rows(0, body.layout.partition.pose).amax();
    assert!(error < 0.1, "the oracle itself went astray: {error}");
    worst.assert_below(what, SAME_FILTER_SIGMA);
}

#[test]
fn every_kind_of_joint_over_500_steps() {
    assert_agrees("tree", TREE, &plain(&[]), 500, 1);
}

#[test]
fn with_biases_and_base_accelerations() {
    assert_agrees("tree, all states", TREE, &plain(&ALL), 400, 2);
}

#[test]
fn with_distances_and_orientations() {
    assert_agrees("tree, spanned", &spanned(), &plain(&[]), 300, 5);
    assert_agrees("tree, spanned, all states", &spanned(), &plain(&ALL), 200, 6);
}

#[test]
fn with_an_azimuth_and_another_spread() {
    let text = TREE.replace("azimuth_fixed = true", "azimuth_fixed = false");
    let config = Config { alpha: 0.7, beta: 1.1, kappa: 2.0, ..plain(&["surge"]) };
    assert_agrees("tree, alpha 0.7, beta 1.1, kappa 2", &text, &config, 300, 3);
}

/// Body and field turn together (P5).
#[test]
fn on_a_ball_that_stands_still_with_an_azimuth() {
    assert_agrees("standing tree", &standing(TREE), &plain(&[]), 300, 4);
    assert_agrees("standing tree, all states", &standing(TREE), &plain(&ALL), 200, 7);
}

/// Rotation vectors cross half a turn, where the shortest one jumps to the other side.
#[test]
fn across_half_a_turn() {
    let text = TREE.replace("density = 4.0", "density = 8.0");
    let model = model(&text);
    let (config, mut chance) = (plain(&[]), Chance::new(8));
    let body = body(&model, &config);
    let mut wave = Wave::random(&model, 0.4, 0.5, &mut chance);
    for first in [3, 6] {
        wave.coordinates[first].0 = 2.9;
        wave.coordinates[first].1.push([0.5, 0.4, 0.0]);
    }
    let motion = |t: f64| wave.at(t);
    let scene = Scene { body: &body, motion: &motion, surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
    let samples = scene.samples(&times(0.01, 0.01, 300), &mut chance);
    let start = belief(&body, 0.0, scene.state(0.0), &start_std(&body));
    let (mut before, mut jumps) = (start.mean.clone(), 0);
    let (worst, _) = side_by_side(&body, &config, &start, &samples, &mut unscented, &mut |now| {
        jumps += [3, 6].iter().filter(|&&q| (now.mean[q] - before[q]).abs() > 3.0).count();
        before.copy_from_slice(&now.mean);
    });
    assert!(jumps > 1, "half a turn was meant to be crossed: {jumps}");
    worst.assert_below("tree, across half a turn", SAME_FILTER_SIGMA);
}
