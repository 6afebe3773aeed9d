//! Whole recordings: tracked, and smoothed.

use super::bodies::{cases, Case};
use super::support::record::streams;
use criterion::{BenchmarkId, Criterion, Throughput};
use oarlock::config::FilterKind;
use oarlock::recording::Sample;
use oarlock::track::run::{track, Run};
use oarlock::track::{Calibration, Tracker};
use std::hint::black_box;

/// As many for every size as end in time.
fn count(states: usize) -> usize {
    4_000 / states
}

/// Filtered from where the filter has settled, streams merged and results kept, as `oarlock.track` does.
pub fn tracked(c: &mut Criterion) {
    each(c, "track", &mut |case, tracker, samples, b| b.iter(|| run(case, tracker, black_box(samples))));
}

/// The way back: filtered again stretch by stretch, and smoothed.
pub fn smoothed(c: &mut Criterion) {
    each(c, "smooth", &mut |case, tracker, samples, b| {
        let run = run(case, tracker, samples);
        b.iter(|| black_box(&run).smooth(&mut |_| true).expect("it was tracked"));
    });
}

type Bench<'a> = &'a mut dyn FnMut(&Case, &Tracker, &[Sample], &mut criterion::Bencher);

fn each(c: &mut Criterion, what: &str, bench: Bench) {
    let mut group = c.benchmark_group(what);
    group.sample_size(10);
    for case in cases() {
        let (tracker, samples) = case.running(FilterKind::Ukf);
        let n = tracker.body().layout.dim();
        group.throughput(Throughput::Elements(count(n) as u64));
        group.bench_function(BenchmarkId::from_parameter(n), |b| bench(&case, &tracker, &samples[..count(n)], b));
    }
    group.finish();
}

fn run(case: &Case, tracker: &Tracker, samples: &[Sample]) -> Run {
    let (streams, start) = (streams(tracker.body(), samples), tracker.hypothesis().cloned());
    track(case.model.clone(), streams, &Calibration::default(), &case.config, start, &mut |_| true)
        .expect("these readings fit the model")
}
