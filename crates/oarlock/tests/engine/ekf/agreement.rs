//! The engine's extended filter equals the plain one, step for step.

use super::body::Naive;
use super::plain::update;
use super::support::chance::Chance;
use super::support::record::{punch_holes, times, with_loops, Scene};
use super::support::stroke::{Posture, Stroke};
use super::support::tree::TREE;
use super::support::wave::Wave;
use super::support::{belief, body, model, plain, start_std, worse, SCULLER};
use super::ukf::{Ukf, Weights};
use nalgebra::{DMatrix, DVector};
use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};
use oarlock::track::{Calibration, Status, Tracker};

/// As for the unscented filter: rounding, at condition numbers that take eight of sixteen digits. The plain one's Jacobian is good
/// to twelve.
const SAME_FILTER_SIGMA: f64 = 1e-8;

/// Both filters at 100 Hz: the largest difference of means and of covariances.
fn run_both(body: &Body, motion: &dyn Fn(f64) -> Posture, config: &Config, steps: usize, seed: u64) -> (f64, f64) {
    let surge = |t: f64| if config.estimate.is_empty() { 0.0 } else { (2.9 * t).sin() };
    let scene = Scene { body, motion, surge: &surge, azimuth_rad: 0.3, noise: 1.0 };
    let mut chance = Chance::new(seed);
    let mut samples = scene.samples(&times(0.01, 0.01, steps), &mut chance);
    punch_holes(body, &mut samples, &mut chance);
    let std = start_std(body);
    let n = std.len();
    let mut plain = Ukf::new(
        Naive::new(&body.model, body.model.default_parameters(), &body.layout.names),
        DVector::from_vec(scene.state(0.0)),
        DMatrix::from_diagonal(&DVector::from_vec(std.iter().map(|s| s * s).collect())),
        Weights::new(n, 1.0, 2.0, 0.0),
    );
    plain.mean = plain.at(&DVector::from_vec(std.iter().map(|s| 0.5 * s * chance.normal()).collect()));
    let mut tracker = Tracker::new(body.model.clone(), &Calibration::default(), config).unwrap();
    tracker.resume(belief(body, 0.0, plain.mean.as_slice().to_vec(), &std)).unwrap();
    let noise = plain.body.std();
    let (mut means, mut covariances, mut before) = (0.0, 0.0, 0.0);
    for sample in &samples {
        plain.predict(sample.time_s - before);
        before = sample.time_s;
        let z = with_loops(&sample.z, body, &sample.inputs);
        update(&mut plain, &z, &noise, &sample.inputs);
        assert_eq!(tracker.step(sample).unwrap(), Status::Tracking);
        let ours = tracker.belief().unwrap();
        let away = plain.away(&DVector::from_row_slice(&ours.mean));
        let sigma = plain.covariance.diagonal().map(f64::sqrt);
        for i in 0..n {
            means = worse(means, away[i].abs() / sigma[i]);
            for j in 0..n {
                let gap = (ours.covariance.at(i, j) - plain.covariance[(i, j)]).abs();
                covariances = worse(covariances, gap / (sigma[i] * sigma[j]));
            }
        }
    }
    (means, covariances)
}

fn assert_same(what: &str, (means, covariances): (f64, f64)) {
    println!("{what}: mean {means:.2e} sigma, covariance {covariances:.2e} sigma sigma");
    assert!(means < SAME_FILTER_SIGMA, "{what}: mean {means:e}");
    assert!(covariances < SAME_FILTER_SIGMA, "{what}: covariance {covariances:e}");
}

#[test]
fn on_a_sculler() {
    for (estimate, steps) in [(&[][..], 120), (&["gyro_bias", "accel_bias", "surge"], 30)] {
        let config = Config { filter: FilterKind::Ekf, ..plain(estimate) };
        let body = body(&model(SCULLER), &config);
        let stroke = Stroke::new(&body, 2.2);
        let apart = run_both(&body, &|t| stroke.at(t), &config, steps, 1);
        assert_same(&format!("sculler, {} states", body.layout.dim()), apart);
    }
}

#[test]
fn on_balls_and_free_joints() {
    let all = ["gyro_bias", "accel_bias", "surge", "heave"];
    for (estimate, steps) in [(&[][..], 150), (&all, 60)] {
        let text = TREE.replace("azimuth_fixed = true", "azimuth_fixed = false");
        let config = Config { filter: FilterKind::Ekf, ..plain(estimate) };
        let body = body(&model(&text), &config);
        let wave = Wave::random(&body.model, 0.8, 0.8, &mut Chance::new(2));
        let apart = run_both(&body, &|t| wave.at(t), &config, steps, 3);
        assert_same(&format!("tree, {} states", body.layout.dim()), apart);
    }
}
