//! On a linear system the filter is Kalman's and the smoother is least squares over everything measured.

use crate::support;

mod carried;
mod least_squares;
mod oscillator;
mod system;

use nalgebra::{DMatrix, DVector};
use oarlock::estimate::belief::Belief;
use oarlock::estimate::filter::{Filter, Gate, Info, Measurement, RowGroups, UpdateSettings};
use oarlock::estimate::sigma::Spread;
use oarlock::estimate::smoother::Smoother;
use oarlock::estimate::transition::Transition;
use support::chance::Chance;
use support::textbook::Worst;
use system::{dense, matrix, start, Linear, ROWS, STATES};

/// Both sides round differently. Short steps leave the driving noise of a pose small beside that of its acceleration, which
/// costs some digits more.
const SAME_SIGMA: f64 = 1e-10;

const OPEN: UpdateSettings = UpdateSettings {
    spread: Spread { alpha: 0.3, beta: 2.0, kappa: 0.0 },
    gate: Gate { on: false, slack: 1.0, patience_s: 1.0, strict_patience_s: 1.0 },
};

/// One instant of a made-up recording.
struct Sample {
    time_s: f64,
    z: [f64; ROWS],
}

/// Stamps at unequal distances; readings that are missing now and then, some samples altogether.
fn samples(count: usize, seed: u64) -> Vec<Sample> {
    let mut chance = Chance::new(seed);
    let mut time_s = 0.0;
    let one = |k| {
        if k > 0 {
            time_s += chance.between(0.05, 0.4);
        }
        let mut z = [0; ROWS].map(|_| 2.0 * chance.normal());
        for x in &mut z {
            if k % 7 == 3 || chance.uniform() < 0.3 {
                *x = f64::NAN;
            }
        }
        Sample { time_s, z }
    };
    (0..count).map(one).collect()
}

type Make = fn(&Linear, &RowGroups) -> Filter<Linear>;

/// The filter's way over the samples: per step the transition, the prediction and what came of it.
struct Way {
    first: Belief,
    steps: Vec<(Transition, Belief, Belief)>,
}

fn filtered(system: &Linear, samples: &[Sample]) -> Way {
    filtered_by(Filter::new, system, samples)
}

fn filtered_by(make: Make, system: &Linear, samples: &[Sample]) -> Way {
    let groups = RowGroups { parts: vec![0..2, 2..ROWS], sources: vec![0..2, 2..ROWS], inertial: vec![0, 1] };
    let mut filter = make(system, &groups);
    let mut info = Info::new(&groups, ROWS);
    let mut belief = start();
    let mut update = |filter: &mut Filter<Linear>, belief: &mut Belief, z: &[f64]| {
        let (std, no, level) = (system.noise_std, [false; 2], [None; 2]);
        let measured =
            Measurement { z, std: &std, excluded: &no, strict: &no, direction_tests: &level, groups: &groups };
        filter.update(system, &(), belief, measured, OPEN, &mut info).unwrap();
    };
    update(&mut filter, &mut belief, &samples[0].z);
    let first = belief.clone();
    let mut steps = Vec::new();
    for sample in &samples[1..] {
        let mut transition = Transition::default();
        filter.predict(system, &mut belief, sample.time_s, &mut transition);
        let predicted = belief.clone();
        update(&mut filter, &mut belief, &sample.z);
        steps.push((transition, predicted, belief.clone()));
    }
    Way { first, steps }
}

/// An estimate, and Kalman's filter of it as every textbook has it.
struct Kalman {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Kalman {
    fn predict(&mut self, system: &Linear, dt: f64) {
        let (f, offset, q) = dense(system, dt);
        self.mean = &f * &self.mean + offset;
        self.covariance = &f * &self.covariance * f.transpose() + q;
    }

    fn update(&mut self, system: &Linear, z: &[f64]) {
        let (h, v, r) = system.seen(z, &self.mean);
        if v.is_empty() {
            return;
        }
        let inner = &h * &self.covariance * h.transpose() + &r;
        let gain = &self.covariance * h.transpose() * inner.try_inverse().expect("positive");
        self.mean += &gain * v;
        let keep = DMatrix::identity(STATES, STATES) - &gain * h;
        self.covariance = &keep * &self.covariance * keep.transpose() + &gain * r * gain.transpose();
    }

    fn show(&self, worst: &mut Worst, ours: &Belief) {
        worst.see(ours, &(DVector::from_row_slice(&ours.mean) - &self.mean), &self.covariance);
    }
}

#[test]
fn every_filter_is_kalmans() {
    assert_is_kalmans("unscented", Filter::new);
    assert_is_kalmans("extended", Filter::extended);
}

fn assert_is_kalmans(what: &str, make: Make) {
    let (system, samples) = (Linear::new(), samples(500, 1));
    let way = filtered_by(make, &system, &samples);
    let prior = start();
    let mut kalman = Kalman { mean: DVector::from_row_slice(&prior.mean), covariance: matrix(&prior.covariance) };
    kalman.update(&system, &samples[0].z);
    let mut worst = Worst::default();
    kalman.show(&mut worst, &way.first);
    for (pair, (_, _, belief)) in samples.windows(2).zip(&way.steps) {
        kalman.predict(&system, pair[1].time_s - pair[0].time_s);
        kalman.update(&system, &pair[1].z);
        kalman.show(&mut worst, belief);
    }
    worst.assert_below(&format!("{what} filter against Kalman, 500 samples"), SAME_SIGMA);
}

#[test]
fn smoother_is_least_squares_over_all_samples() {
    let (system, samples) = (Linear::new(), samples(60, 2));
    let way = filtered(&system, &samples);
    let whole = least_squares::solve(&system, &samples);
    let last = &way.steps.last().unwrap().2;
    let mut worst = Worst::default();
    let mut smoothed = vec![last.clone()];
    let mut smoother = Smoother::new(STATES);
    for k in (0..way.steps.len()).rev() {
        let (transition, predicted, _) = &way.steps[k];
        let mut belief = if k == 0 { way.first.clone() } else { way.steps[k - 1].2.clone() };
        let next = smoothed.last().unwrap();
        smoother.back(&system, &mut belief, transition, predicted, next).unwrap();
        smoothed.push(belief);
    }
    smoothed.reverse();
    assert_eq!(smoothed.len(), samples.len());
    for (k, belief) in smoothed.iter().enumerate() {
        whole.at(k).show(&mut worst, belief);
    }
    worst.assert_below("smoother against least squares, every one of 60 samples", SAME_SIGMA);
    let mut moved = Worst::default();
    whole.at(0).show(&mut moved, &way.first);
    assert!(moved.mean.max(moved.covariance) > 0.1, "smoothing did nothing: {}", moved.mean);
}
