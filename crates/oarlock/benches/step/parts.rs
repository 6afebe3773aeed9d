//! Steps and what they are made of.

use super::bodies::{cases, Case};
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion};
use oarlock::config::FilterKind;
use oarlock::estimate::{FastSystem, PerturbedStates, Points, System};
use oarlock::kernels::arch::{Arch, Kernel};
use oarlock::kernels::lane::{Lane, LANES};
use oarlock::recording::Sample;
use oarlock::track::Tracker;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Whole steps, one after the other as in use.
pub fn steps(c: &mut Criterion) {
    let mut group = c.benchmark_group("step");
    for case in cases() {
        let (start, samples) = case.running(FilterKind::Ukf);
        let (mut tracker, mut next) = (start.clone(), 0);
        group.bench_function(BenchmarkId::from_parameter(start.body.layout.dim()), |b| {
            b.iter_custom(|steps| {
                let mut spent = Duration::ZERO;
                for _ in 0..steps {
                    if next == samples.len() {
                        (next, tracker) = (0, start.clone());
                    }
                    spent += timed_step(&mut tracker, &samples[next]);
                    next += 1;
                }
                spent
            })
        });
    }
    group.finish();
}

/// Steps that predict over next to no time: almost all of it is the update.
pub fn updates(c: &mut Criterion) {
    let mut group = c.benchmark_group("update");
    for case in cases() {
        let (start, samples) = case.running(FilterKind::Ukf);
        let mut next = samples[0].clone();
        next.time_s = start.belief().expect("it runs").time_s + 1e-9;
        group.bench_function(BenchmarkId::from_parameter(start.body.layout.dim()), |b| {
            b.iter_custom(|steps| (0..steps).map(|_| timed_step(&mut start.clone(), &next)).sum())
        });
    }
    group.finish();
}

fn timed_step(tracker: &mut Tracker, sample: &Sample) -> Duration {
    let begun = Instant::now();
    tracker.step(black_box(sample)).expect("these readings fit the model");
    begun.elapsed()
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
        let perturbed = PerturbedStates { from: 0, inputs: true };
        self.tracker.body.readings_near_mean::<FUSED>(self.moment, self.scratch, self.at, perturbed, self.out);
    }
}

/// Kinematics and readings of eight sigma points.
pub fn kinematics(c: &mut Criterion) {
    let mut group = c.benchmark_group("kinematics");
    for case in cases() {
        one_batch(&mut group, &case);
    }
    group.finish();
}

fn one_batch(c: &mut BenchmarkGroup<WallTime>, case: &Case) {
    let tracker = case.running(FilterKind::Ukf).0;
    let body = &tracker.body;
    let (n, mut scratch, mut moment) = (body.layout.dim(), body.scratch(), body.moment());
    moment.active.fill(true);
    moment.needed.fill(true);
    moment.moving.fill(true);
    let mean = &tracker.belief().expect("it runs").mean;
    let delta: Vec<Lane> = (0..n).map(|i| Lane(std::array::from_fn(|k| 1e-3 * (i + 7 * k) as f64))).collect();
    let off = vec![Lane([0.0; LANES]); body.input_std().len()];
    let mut out = vec![Lane([0.0; LANES]); body.suite.len()];
    body.readings_at_mean::<false>(&moment, &mut scratch, Points { mean, delta: &delta, off: &off }, &mut out);
    c.bench_function(BenchmarkId::from_parameter(n), |b| {
        b.iter(|| {
            let at = Points { mean, delta: black_box(&delta), off: &off };
            let batch = Batch { tracker: &tracker, moment: &moment, scratch: &mut scratch, at, out: &mut out };
            Arch::best().run(batch);
        })
    });
}
