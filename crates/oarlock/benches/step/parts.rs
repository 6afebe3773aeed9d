//! Steps and what they are made of.

use super::bodies::{cases, running, sample, Case, NEXT};
use criterion::{BatchSize, Criterion};
use oarlock::estimate::{Points, System, Vary};
use oarlock::lane::arch::{Arch, Kernel};
use oarlock::lane::{Lane, LANES};
use oarlock::track::Tracker;
use std::hint::black_box;

/// Whole steps.
pub fn steps(c: &mut Criterion) {
    timed(c, "step", sample);
}

/// Steps that predict over next to no time: almost all of it is the update.
pub fn updates(c: &mut Criterion) {
    timed(c, "update", |tracker, k| {
        let mut next = sample(tracker, k);
        next.time_s = tracker.belief().expect("it runs").time_s + 1e-9;
        next
    });
}

fn timed(c: &mut Criterion, what: &str, next: impl Fn(&Tracker, usize) -> oarlock::recording::Sample) {
    for case in cases() {
        let tracker = running(&case);
        let next = next(&tracker, NEXT);
        c.bench_function(&format!("{what}, {} states, {}", tracker.body.layout.dim(), case.name), |b| {
            let run = |mut t: Tracker| {
                t.step(black_box(&next)).expect("these readings fit the model");
                t
            };
            b.iter_batched(|| tracker.clone(), run, BatchSize::LargeInput)
        });
    }
}

/// Readings of one batch of sigma points that differ in everything.
struct Batch<'a> {
    tracker: &'a Tracker,
    moment: &'a oarlock::body::Moment,
    scratch: &'a mut oarlock::body::read::BodyScratch,
    at: Points<'a>,
    out: &'a mut [Lane],
}

impl Kernel for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let vary = Vary { from: 0, inputs: true };
        self.tracker.body.readings_near::<FUSED>(self.moment, self.scratch, self.at, vary, self.out);
    }
}

/// Kinematics and readings of eight sigma points.
pub fn kinematics(c: &mut Criterion) {
    for case in cases() {
        one_batch(c, &case);
    }
}

fn one_batch(c: &mut Criterion, case: &Case) {
    let tracker = running(case);
    let body = &tracker.body;
    let (n, mut scratch, mut moment) = (body.layout.dim(), body.scratch(), body.moment());
    moment.active.fill(true);
    moment.needed.fill(true);
    moment.moving.fill(true);
    let mean = &tracker.belief().expect("it runs").mean;
    let delta: Vec<Lane> = (0..n).map(|i| Lane(std::array::from_fn(|k| 1e-3 * (i + 7 * k) as f64))).collect();
    let off = vec![Lane([0.0; LANES]); body.input_std().len()];
    let mut out = vec![Lane([0.0; LANES]); body.suite.len()];
    body.settle::<false>(&moment, &mut scratch, Points { mean, delta: &delta, off: &off }, &mut out);
    c.bench_function(&format!("readings of {LANES} sigma points, {} frames, {}", body.tree.len(), case.name), |b| {
        b.iter(|| {
            let at = Points { mean, delta: black_box(&delta), off: &off };
            let batch = Batch { tracker: &tracker, moment: &moment, scratch: &mut scratch, at, out: &mut out };
            Arch::best().run(batch);
        })
    });
}
