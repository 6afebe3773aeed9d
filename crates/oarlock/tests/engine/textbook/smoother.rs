//! The smoother of the product equals Rauch, Tung and Striebel's as textbooks print it, in dense matrices.

use super::support::chance::Chance;
use super::support::record::{punch_holes, streams, times, Scene};
use super::support::stroke::Stroke;
use super::support::textbook::Worst;
use super::support::{body, dense, model, plain, settled, SCULLER};
use nalgebra::{DMatrix, DVector};
use oarlock::body::Body;
use oarlock::config::Config;
use oarlock::estimate::belief::Belief;
use oarlock::estimate::transition::Transition;
use oarlock::estimate::System;
use oarlock::track::run::track;
use oarlock::track::Calibration;

/// As between the filters: closures of 2 mm beside accelerations of 5 rad/s2 take about eight of sixteen digits.
const SAME_SMOOTHER_SIGMA: f64 = 1e-8;
const SAMPLES: usize = 150;

struct Smoothed {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Smoothed {
    fn of(belief: &Belief) -> Self {
        let n = belief.mean.len();
        Smoothed {
            mean: DVector::from_row_slice(&belief.mean),
            covariance: DMatrix::from_row_slice(n, n, belief.covariance.as_slice()),
        }
    }

    /// One step back: K = P F' (F P F' + Q)^-1.
    fn back(self, body: &Body, filtered: &Belief, time_s: f64) -> Self {
        let (n, here) = (filtered.mean.len(), Smoothed::of(filtered));
        let (mut transition, variance) = (Transition::default(), here.covariance.diagonal());
        let dt = time_s - filtered.time_s;
        body.transition(dt, &filtered.mean, variance.as_slice(), &mut transition);
        assert!(transition.turnings.is_empty(), "of hinges and slides");
        let (f, offset, q) = dense(&transition, n);
        let predicted = &f * &here.covariance * f.transpose() + q;
        // Divided by its own deviations first: a plain solve then keeps its digits.
        let scale = DMatrix::from_diagonal(&predicted.diagonal().map(|v| 1.0 / v.sqrt()));
        let scaled = (&scale * &predicted * &scale).cholesky().expect("positive");
        let gain = (&scale * scaled.solve(&(&scale * &f * &here.covariance))).transpose();
        Smoothed {
            mean: &here.mean + &gain * (self.mean - (&f * &here.mean + offset)),
            covariance: &here.covariance + &gain * (self.covariance - predicted) * gain.transpose(),
        }
    }

    fn show(&self, worst: &mut Worst, ours: &Belief) {
        worst.see(ours, &(DVector::from_row_slice(&ours.mean) - &self.mean), &self.covariance);
    }
}

fn assert_is_the_textbooks(what: &str, config: Config) {
    // Every belief is kept.
    let Config { sample_rate_hz, inputs, .. } = settled();
    let config = Config { belief_interval_s: 1e-6, sample_rate_hz, inputs, ..config };
    let model = model(SCULLER);
    let body = body(&model, &config);
    let stroke = Stroke::new(&body, 2.2);
    let surge = |t: f64| 2.0 * (2.9 * t).sin();
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &surge, azimuth_rad: 0.5, noise: 1.0 };
    let mut chance = Chance::new(61);
    let mut samples = scene.samples(&times(2.0, 0.01, SAMPLES), &mut chance);
    punch_holes(&body, &mut samples[30..], &mut chance);
    let nominal = Calibration::default();
    let run = track(model, streams(&body, &samples), &nominal, &config, None, &mut |_| true).unwrap();
    let smooth = run.smooth(&mut |_| true).unwrap();
    let (filtered, ours): (Vec<Belief>, Vec<Belief>) = (run.beliefs().collect(), smooth.beliefs().collect());
    assert_eq!((filtered.len(), ours.len()), (SAMPLES, SAMPLES));
    let mut textbook = Smoothed::of(filtered.last().unwrap());
    let (mut worst, mut moved) = (Worst::default(), Worst::default());
    for k in (0..SAMPLES).rev() {
        if k + 1 < SAMPLES {
            textbook = textbook.back(&body, &filtered[k], filtered[k + 1].time_s);
        }
        textbook.show(&mut worst, &ours[k]);
        textbook.show(&mut moved, &filtered[k]);
    }
    worst.assert_below(what, SAME_SMOOTHER_SIGMA);
    assert!(moved.mean > 1.0, "smoothing did nothing: {}", moved.mean);
}

#[test]
fn smoother_is_the_textbooks() {
    assert_is_the_textbooks("41 states", plain(&[]));
    assert_is_the_textbooks("72 states, all learnt and gated", Config::default());
}
