//! Time of a step of the filter and of its parts, of whole recordings, and beside the textbook's filter in the same run.

// The macros of the benchmark make public functions.
#![allow(missing_docs)]

mod bodies;
mod figures;
mod latency;
mod parts;
mod ratios;
mod recordings;
#[path = "../../tests/support/mod.rs"]
mod support;

use criterion::{criterion_group, criterion_main, Criterion};
use std::time::Duration;

/// Whether only some benchmarks are asked for, by name: then the tables are left out.
fn is_filtered() -> bool {
    std::env::args().skip(1).any(|a| !a.starts_with('-'))
}

fn short() -> Criterion {
    Criterion::default()
        .measurement_time(Duration::from_secs(1))
        .warm_up_time(Duration::from_millis(300))
        .sample_size(20)
        .without_plots()
}

criterion_group! {
    name = benches;
    config = short();
    targets = ratios::of_steps, latency::of_live_steps, parts::kinematics, parts::updates, parts::steps,
        recordings::tracked, recordings::smoothed
}
criterion_main!(benches);
