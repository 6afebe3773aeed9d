//! The engine's extended filter equals the plain one, step for step.

use super::plain::update;
use super::support::chance::Chance;
use super::support::record::Scene;
use super::support::stroke::{Posture, Stroke};
use super::support::textbook::{run_both, SAME_FILTER_SIGMA};
use super::support::tree::{spanned, standing, TREE};
use super::support::wave::Wave;
use super::support::{body, model, plain, SCULLER};
use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};

/// The plain filter's Jacobian is good to twelve digits.
fn assert_same(name: &str, body: &Body, motion: &dyn Fn(f64) -> Posture, config: &Config, steps: usize, seed: u64) {
    let surge = |t: f64| if config.estimate.is_empty() { 0.0 } else { (2.9 * t).sin() };
    let scene = Scene { body, motion, surge: &surge, azimuth_rad: 0.3, noise: 1.0 };
    let (worst, _) = run_both(&scene, config, steps, (0.5, &mut Chance::new(seed)), &mut update);
    worst.assert_below(&format!("{name}, {} states", body.layout.dim()), SAME_FILTER_SIGMA);
}

#[test]
fn on_a_sculler() {
    for (estimate, steps) in [(&[][..], 120), (&["gyro_bias", "accel_bias", "surge"], 30)] {
        let config = Config { filter: FilterKind::Ekf, ..plain(estimate) };
        let body = body(&model(SCULLER), &config);
        let stroke = Stroke::new(&body, 2.2);
        assert_same("sculler", &body, &|t| stroke.at(t), &config, steps, 1);
    }
}

#[test]
fn on_distances_and_orientations() {
    let config = Config { filter: FilterKind::Ekf, ..plain(&["surge"]) };
    let body = body(&model(&spanned()), &config);
    let wave = Wave::random(&body.model, 0.8, 0.8, &mut Chance::new(4));
    assert_same("spanned tree", &body, &|t| wave.at(t), &config, 100, 5);
}

#[test]
fn on_balls_and_free_joints() {
    let all = ["gyro_bias", "accel_bias", "surge", "heave"];
    for (estimate, steps) in [(&[][..], 150), (&all, 60)] {
        let free = TREE.replace("azimuth_fixed = true", "azimuth_fixed = false");
        for (name, text) in [("tree", free), ("standing tree", standing(TREE))] {
            let config = Config { filter: FilterKind::Ekf, ..plain(estimate) };
            let body = body(&model(&text), &config);
            let wave = Wave::random(&body.model, 0.8, 0.8, &mut Chance::new(2));
            assert_same(name, &body, &|t| wave.at(t), &config, steps, 3);
        }
    }
}
