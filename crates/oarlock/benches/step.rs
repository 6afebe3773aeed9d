//! Time of one step of the filter on the sculler, with and without biases, and of the kinematics under it.

// The macros of the benchmark make public functions.
#![allow(missing_docs)]

// The baseline: the plain filter of the tests, written from the textbook.
#[allow(dead_code)]
#[path = "../tests/textbook/body.rs"]
mod body;
#[path = "../tests/support/so3.rs"]
mod so3;
#[allow(dead_code)]
#[path = "../tests/textbook/ukf.rs"]
mod ukf;

use body::Naive;
use criterion::{criterion_group, criterion_main, BatchSize, Criterion};
use nalgebra::{DMatrix, DVector};
use oarlock::kinematics::{FrameMotion, JointMotion, Tree};
use oarlock::lane::{Lane, Real};
use oarlock::recording::Sample;
use oarlock::rotation::Vec3;
use oarlock::track::loops::readings;
use oarlock::track::{Calibration, Tracker};
use oarlock::{Config, Model};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;
use ukf::{Ukf, Weights};

const SCULLER: &str = include_str!("../../../python/oarlock/models/sculler.toml");
const RATE_HZ: f64 = 125.0;

fn model() -> Arc<Model> {
    Arc::new(Model::from_toml(SCULLER, "sculler.toml").expect("the shipped model is valid"))
}

/// Readings of a body that sways a little about its rest posture, oar readings included.
fn sample(tracker: &Tracker, index: usize) -> Sample {
    let model = &tracker.body.model;
    let time_s = index as f64 / RATE_HZ;
    let sway = |j: usize| 0.05 * (2.0 * time_s + j as f64).sin();
    let q: Vec<f64> = model.joints.iter().enumerate().map(|(j, joint)| joint.rest[0] + sway(j)).collect();
    let still = vec![0.0; q.len()];
    let mut sample = tracker.empty_sample();
    sample.time_s = time_s;
    sample.z.copy_from_slice(&readings(&tracker.body, &q, &still, &still));
    for (j, joint) in model.joints.iter().enumerate().filter(|(_, j)| j.input) {
        sample.inputs[j] = q[j] + joint.input_std;
    }
    sample
}

/// A tracker that has found its start, and the sample that comes next.
fn running(config: &Config) -> (Tracker, Sample) {
    let mut tracker = Tracker::new(model(), &Calibration::default(), config).expect("the shipped model tracks");
    let mut index = 0;
    while tracker.belief().is_none() || index < 250 {
        let sample = sample(&tracker, index);
        tracker.step(&sample).expect("these readings fit the model");
        index += 1;
    }
    let next = sample(&tracker, index);
    (tracker, next)
}

fn steps(c: &mut Criterion) {
    let bare = Config { estimate: Vec::new(), ..Config::default() };
    for (name, config) in [("step, biases and surge", Config::default()), ("step, joints alone", bare)] {
        let (tracker, next) = running(&config);
        let n = tracker.body.layout.dim();
        c.bench_function(&format!("{name}, {n} states"), |b| {
            let run = |mut t: Tracker| {
                t.step(black_box(&next)).expect("these readings fit the model");
                t
            };
            b.iter_batched(|| tracker.clone(), run, BatchSize::LargeInput)
        });
    }
}

/// The textbook filter from the belief of `tracker`.
fn textbook<'a>(tracker: &'a Tracker, config: &Config) -> Ukf<'a> {
    let (body, belief) = (&tracker.body, tracker.belief().expect("it runs"));
    let n = belief.mean.len();
    Ukf {
        body: Naive::new(&body.model, body.model.default_parameters(), &body.layout.names),
        mean: DVector::from_row_slice(&belief.mean),
        covariance: DMatrix::from_row_slice(n, n, belief.covariance.as_slice()),
        weights: Weights::new(n, config.alpha, config.beta, config.kappa),
    }
}

/// Rows of the closures read zero.
fn with_loops(tracker: &Tracker, sample: &Sample) -> Vec<f64> {
    sample.z.iter().map(|z| if z.is_nan() { 0.0 } else { *z }).take(tracker.body.suite.len()).collect()
}

fn microseconds(mut run: impl FnMut()) -> f64 {
    let begun = Instant::now();
    run();
    1e6 * begun.elapsed().as_secs_f64()
}

/// Median times of a step of both filters, taken in turn so that both meet the same machine, and their ratio.
fn ratio(config: &Config) {
    let (tracker, next) = running(config);
    let (std, z) = (tracker.body.suite.std(), with_loops(&tracker, &next));
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..201 {
        let mut fast = tracker.clone();
        ours.push(microseconds(|| {
            fast.step(black_box(&next)).expect("these readings fit the model");
        }));
        let mut plain = textbook(&tracker, config);
        theirs.push(microseconds(|| {
            plain.predict(1.0 / RATE_HZ);
            plain.update(black_box(&z), &std, &next.inputs);
        }));
    }
    let median = |v: &mut Vec<f64>| {
        v.sort_by(f64::total_cmp);
        v[v.len() / 2]
    };
    let (ours, theirs) = (median(&mut ours), median(&mut theirs));
    let n = tracker.body.layout.dim();
    println!("{n} states: step {ours:.0} us, textbook {theirs:.0} us, ratio {:.1}", theirs / ours);
}

fn ratios(_: &mut Criterion) {
    ratio(&Config::default());
    ratio(&Config { estimate: Vec::new(), ..Config::default() });
}

fn kinematics(c: &mut Criterion) {
    let model = model();
    let tree = Tree::new(&model, &model.default_parameters());
    let lanes = vec![Lane::splat(0.3); model.joints.len()];
    let root = FrameMotion::resting(Vec3::splat([0.0, 9.80665, 0.0]));
    let (mut frames, all) = (vec![root; tree.len()], vec![true; tree.len()]);
    c.bench_function("kinematics of 26 frames, 8 sigma points", |b| {
        b.iter(|| {
            let joints = JointMotion { q: black_box(&lanes), qd: &lanes, qdd: &lanes, lengths: &[], anchors: &[] };
            tree.motions(root, joints, &all, &mut frames);
        })
    });
}

criterion_group!(benches, ratios, steps, kinematics);
criterion_main!(benches);
