//! The factorised filter of the product equals the plain one, step for step.

use super::bodies::{limb_of, walker};
use super::plain::{update, Parts};
use super::support::chance::Chance;
use super::support::record::Scene;
use super::support::stroke::{Posture, Stroke};
use super::support::textbook::{run_both, SAME_FILTER_SIGMA};
use super::support::tree::standing;
use super::support::wave::Wave;
use super::support::{body, model, plain, SCULLER};
use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};

fn parts(body: &Body) -> Parts {
    let states: Vec<usize> = body.layout.names.iter().map(|name| limb_of(name)).collect();
    let rows = body.suite.sources.iter().flat_map(|s| s.rows.clone().map(|_| limb_of(&s.name)));
    Parts::new(&states, &rows.collect::<Vec<_>>())
}

fn assert_same(name: &str, body: &Body, motion: &dyn Fn(f64) -> Posture, config: &Config, steps: usize, seed: u64) {
    let surge = |t: f64| if config.estimate.is_empty() { 0.0 } else { (2.9 * t).sin() };
    let scene = Scene { body, motion, surge: &surge, azimuth_rad: 0.3, noise: 1.0 };
    let (parts, spread) = (parts(body), [config.alpha, config.beta, config.kappa]);
    let (worst, _) = run_both(&scene, config, steps, (0.2, &mut Chance::new(seed)), &mut |plain, z, std, inputs| {
        update(plain, &parts, spread, z, std, inputs);
    });
    worst.assert_below(&format!("{name}, {} states", body.layout.dim()), SAME_FILTER_SIGMA);
}

#[test]
fn on_a_sculler() {
    for (estimate, steps) in [(&[][..], 100), (&["gyro_bias", "accel_bias", "surge"], 60)] {
        let config = Config { filter: FilterKind::Factorised, ..plain(estimate) };
        let body = body(&model(SCULLER), &config);
        let stroke = Stroke::new(&body, 2.2);
        assert_same("sculler", &body, &|t| stroke.at(t), &config, steps, 1);
    }
}

#[test]
fn on_balls_and_free_joints() {
    // Lengths are not among what the plain readings take for states.
    let all = ["gyro_bias", "accel_bias", "surge"];
    for (estimate, steps) in [(&[][..], 100), (&all, 60)] {
        for (name, text) in [("walker", walker()), ("standing walker", standing(&walker()))] {
            let config = Config { filter: FilterKind::Factorised, ..plain(estimate) };
            let body = body(&model(&text), &config);
            let wave = Wave::random(&body.model, 0.6, 0.8, &mut Chance::new(2));
            assert_same(name, &body, &|t| wave.at(t), &config, steps, 3);
        }
    }
}
