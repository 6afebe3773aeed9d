//! Whole recordings: tracked, and smoothed.

use super::bodies::{cases, Case};
use super::support::record::streams;
use criterion::{BenchmarkId, Criterion, Throughput};
use oarlock::config::FilterKind;
use oarlock::track::run::{track, Run};
use oarlock::track::Calibration;
use std::hint::black_box;

/// As many for every size as end in time.
fn count(case: &Case) -> usize {
    4_000 / case.start.belief.mean.len()
}

/// Filtered from a known start, streams merged and results kept, as `oarlock.track` does.
pub fn tracked(c: &mut Criterion) {
    each(c, "track", &mut |case, b| b.iter(|| run(black_box(case))));
}

/// The way back: filtered again stretch by stretch, and smoothed.
pub fn smoothed(c: &mut Criterion) {
    each(c, "smooth", &mut |case, b| {
        let run = run(case);
        b.iter(|| black_box(&run).smooth(&mut |_| true).expect("it was tracked"));
    });
}

fn each(c: &mut Criterion, what: &str, bench: &mut dyn FnMut(&Case, &mut criterion::Bencher)) {
    let mut group = c.benchmark_group(what);
    group.sample_size(10);
    for case in cases() {
        let n = case.start.belief.mean.len();
        group.throughput(Throughput::Elements(count(&case) as u64));
        group.bench_function(BenchmarkId::from_parameter(n), |b| bench(&case, b));
    }
    group.finish();
}

fn run(case: &Case) -> Run {
    let tracker = case.tracker(FilterKind::Ukf);
    let streams = streams(tracker.body(), &case.samples[..count(case)]);
    let start = Some(case.start.clone());
    track(case.model.clone(), streams, &Calibration::default(), &case.config, start, &mut |_| true)
        .expect("these readings fit the model")
}
