//! Steps against the textbook filter, taken in turn so that both meet the same machine.

use super::bodies::{cases, running, sample, Case, NEXT, RATE_HZ};
use super::body::Naive;
use super::ukf::{Ukf, Weights};
use super::{microseconds, quantile};
use criterion::Criterion;
use nalgebra::{DMatrix, DVector};
use oarlock::lane::arch::Arch;
use oarlock::recording::Sample;
use oarlock::track::Tracker;
use std::hint::black_box;

pub fn of_steps(_: &mut Criterion) {
    println!("median time of a step, us");
    println!(
        "{:32} {:>4} {:>4} {:>8} {:>10} {:>10} {:>7}",
        "body", "n", "m", "oarlock", "portable", "textbook", "ratio"
    );
    cases().iter().for_each(ratio);
}

/// The textbook filter from the belief of `tracker`.
fn textbook<'a>(tracker: &'a Tracker, case: &Case) -> Ukf<'a> {
    let (body, belief) = (&tracker.body, tracker.belief().expect("it runs"));
    let (n, c) = (belief.mean.len(), &case.config);
    Ukf {
        body: Naive::new(&body.model, body.model.default_parameters(), &body.layout.names),
        mean: DVector::from_row_slice(&belief.mean),
        covariance: DMatrix::from_row_slice(n, n, belief.covariance.as_slice()),
        weights: Weights::new(n, c.alpha, c.beta, c.kappa),
    }
}

/// Rows of the closures read zero.
fn with_loops(tracker: &Tracker, sample: &Sample) -> Vec<f64> {
    sample.z.iter().map(|z| if z.is_nan() { 0.0 } else { *z }).take(tracker.body.suite.len()).collect()
}

fn ratio(case: &Case) {
    let tracker = running(case);
    let next = sample(&tracker, NEXT);
    let (std, z) = (tracker.body.suite.std(), with_loops(&tracker, &next));
    let (n, m) = (tracker.body.layout.dim(), std.len());
    let (mut ours, mut portably, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..(8_000 / n).min(201) {
        for (arch, times) in [(Arch::best(), &mut ours), (Arch::PORTABLE, &mut portably)] {
            let mut fast = tracker.clone();
            fast.use_arch(arch);
            times.push(microseconds(|| {
                fast.step(black_box(&next)).expect("these readings fit the model");
            }));
        }
        let mut plain = textbook(&tracker, case);
        theirs.push(microseconds(|| {
            plain.predict(1.0 / RATE_HZ);
            plain.update(black_box(&z), &std, &next.inputs);
        }));
    }
    let [ours, portably, theirs] = [&mut ours, &mut portably, &mut theirs].map(|times| quantile(times, 0.5));
    println!("{:32} {n:4} {m:4} {ours:8.1} {portably:10.1} {theirs:10.1} {:7.1}", case.name, theirs / ours);
}
