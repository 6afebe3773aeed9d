//! Time of a step of the filter and of its parts, beside the plain textbook filter of the tests in the same run.

// The macros of the benchmark make public functions.
#![allow(missing_docs)]

mod bodies;
mod latency;
mod parts;
mod ratios;

// The baseline: the plain filter of the tests, written from the textbook.
#[allow(dead_code)]
#[path = "../../tests/textbook/body.rs"]
mod body;
#[path = "../../tests/support/so3.rs"]
mod so3;
#[allow(dead_code)]
#[path = "../../tests/textbook/ukf.rs"]
mod ukf;

use criterion::{criterion_group, criterion_main, Criterion};
use std::time::{Duration, Instant};

/// Time that something takes, us.
fn microseconds(run: impl FnOnce()) -> f64 {
    let begun = Instant::now();
    run();
    1e6 * begun.elapsed().as_secs_f64()
}

/// The value below which a share of all lies; sorts them.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    values[(share * last as f64).round() as usize]
}

fn short() -> Criterion {
    Criterion::default()
        .measurement_time(Duration::from_secs(2))
        .warm_up_time(Duration::from_millis(500))
        .sample_size(50)
}

criterion_group! {
    name = benches;
    config = short();
    targets = ratios::of_steps, latency::of_live_steps, parts::kinematics, parts::updates, parts::steps
}
criterion_main!(benches);
