//! Time of one step of the filter on the sculler, with and without biases, and of the kinematics under it.

use criterion::{criterion_group, criterion_main, BatchSize, Criterion};
use oarlock::kinematics::{FrameMotion, JointMotion, Tree};
use oarlock::lane::{Lane, Real};
use oarlock::recording::Sample;
use oarlock::rotation::Vec3;
use oarlock::track::loops::readings;
use oarlock::track::{Calibration, Tracker};
use oarlock::{Config, Model};
use std::hint::black_box;
use std::sync::Arc;

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
    let q: Vec<f64> = model.joints.iter().enumerate().map(|(j, joint)| joint.rest + sway(j)).collect();
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

fn kinematics(c: &mut Criterion) {
    let model = model();
    let tree = Tree::new(&model, &model.default_parameters());
    let lanes = vec![Lane::splat(0.3); model.joints.len()];
    let root = FrameMotion::resting(Vec3::splat([0.0, 9.80665, 0.0]));
    let (mut frames, all) = (vec![root; tree.len()], vec![true; tree.len()]);
    c.bench_function("kinematics of 26 frames, 8 sigma points", |b| {
        b.iter(|| {
            let joints = JointMotion { q: black_box(&lanes), qd: &lanes, qdd: &lanes };
            tree.motions(root, joints, &all, &mut frames);
        })
    });
}

criterion_group!(benches, steps, kinematics);
criterion_main!(benches);
