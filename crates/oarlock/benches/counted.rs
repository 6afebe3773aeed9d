//! Steps for callgrind to count: `python -m oarlock_lab.bench.counted` runs this under it.
//!
//! Arguments: the name of a body, and how many steps.
#![allow(missing_docs)]

#[path = "step/bodies.rs"]
mod bodies;
#[path = "../tests/support/mod.rs"]
mod support;

use bodies::{cases, Case};
use oarlock::config::FilterKind;
use oarlock::recording::Sample;
use oarlock::sensor::Quantity;
use oarlock::track::Tracker;
use std::hint::black_box;
use support::chance::Chance;

/// A function of its own, whose name callgrind is given.
#[inline(never)]
fn counted_step(tracker: &mut Tracker, sample: &Sample) {
    tracker.step(black_box(sample)).expect("these readings fit the model");
}

/// Errors that real units have and that the model does not contain.
fn add_errors(case: &mut Case) {
    let chance = &mut Chance::new(2);
    for part in support::body(&case.model, &case.config).suite.sources.iter().flat_map(|source| &source.parts) {
        let std = match part.quantity {
            Quantity::Gyro => 0.01,
            Quantity::Accel => 0.1,
            _ => continue,
        };
        for row in part.rows.clone() {
            let error = std * chance.normal();
            case.samples.iter_mut().for_each(|sample| sample.z[row] += error);
        }
    }
}

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let [name, steps] = asked.as_slice() else {
        return println!("counts nothing by itself: run `python -m oarlock_lab.bench.counted`");
    };
    let mut case = cases().into_iter().find(|case| case.name == name).expect("the name of a case");
    add_errors(&mut case);
    let (mut tracker, samples) = case.running(FilterKind::Ukf);
    for sample in &samples[..steps.parse().expect("a number of steps")] {
        counted_step(&mut tracker, sample);
    }
    let body = tracker.body();
    println!("{} states, {} readings", body.layout.dim(), body.suite.len());
}
