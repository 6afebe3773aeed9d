//! Steps for callgrind to count: `python -m bench.counted` runs this under it.
//!
//! Arguments: the name of a body, and how many steps.
#![allow(missing_docs)]

#[path = "step/bodies.rs"]
mod bodies;
#[path = "../tests/support/mod.rs"]
mod support;

use oarlock::config::FilterKind;
use oarlock::recording::Sample;
use oarlock::track::Tracker;
use std::hint::black_box;

/// A function of its own, whose name callgrind is given.
#[inline(never)]
fn counted_step(tracker: &mut Tracker, sample: &Sample) {
    tracker.step(black_box(sample)).expect("these readings fit the model");
}

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let [name, steps] = asked.as_slice() else {
        return println!("counts nothing by itself: run `python -m bench.counted`");
    };
    let all = bodies::cases().into_iter().chain([bodies::upper_body()]);
    let case = all.into_iter().find(|case| case.name == name).expect("the name of a case").with_errors();
    let (mut tracker, samples) = case.running(FilterKind::Ukf);
    for sample in &samples[..steps.parse().expect("a number of steps")] {
        counted_step(&mut tracker, sample);
    }
    let body = tracker.body();
    println!("{} states, {} readings", body.layout.dim(), body.suite.len());
}
