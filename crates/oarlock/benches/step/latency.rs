//! How long a live step takes at worst: samples come one after the other, each is worked off at once.

use super::bodies::{cases, running, sample, NEXT};
use super::{microseconds, quantile};
use criterion::Criterion;

const STEPS: usize = 20_000;

pub fn of_live_steps(_: &mut Criterion) {
    println!("time of a live step, us, over {STEPS} steps");
    println!("{:32} {:>4} {:>8} {:>8} {:>8}", "body", "n", "median", "p99", "p99.9");
    for case in cases().iter().filter(|c| c.name.starts_with("sculler")) {
        let mut tracker = running(case);
        let n = tracker.body.layout.dim();
        let mut times: Vec<f64> = (NEXT..NEXT + STEPS)
            .map(|k| {
                let next = sample(&tracker, k);
                microseconds(|| {
                    tracker.step(&next).expect("these readings fit the model");
                })
            })
            .collect();
        let [half, most, nearly_all] = [0.5, 0.99, 0.999].map(|share| quantile(&mut times, share));
        println!("{:32} {n:4} {half:8.1} {most:8.1} {nearly_all:8.1}", case.name);
    }
}
