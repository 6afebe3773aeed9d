//! How long a live step takes at worst: samples come one after the other, each is worked off at once.

use super::bodies::cases;
use super::figures::keep;
use super::is_filtered;
use criterion::Criterion;
use oarlock::config::FilterKind;
use oarlock_oracle::race::{quantile, timed};
use serde_json::json;

const STEPS: usize = 20_000;

pub fn of_live_steps(_: &mut Criterion) {
    if is_filtered() {
        return;
    }
    println!("\ntime of a live step from Rust, us, over {STEPS} steps");
    println!("{:32} {:>4} {:>6} {:>8} {:>8} {:>8}", "body", "n", "filter", "p50", "p99", "p99.9");
    let mut rows = Vec::new();
    for case in cases().iter().filter(|c| c.name.starts_with("sculler")) {
        for (name, filter) in
            [("ukf", FilterKind::Ukf), ("ekf", FilterKind::Ekf), ("factorised", FilterKind::Factorised)]
        {
            let (start, samples) = case.running(filter);
            let (mut tracker, n) = (start.clone(), start.body.layout.dim());
            let mut times = Vec::with_capacity(STEPS);
            while times.len() < STEPS {
                tracker.clone_from(&start);
                for sample in samples {
                    let (us, done) = timed(|| tracker.step(sample));
                    done.expect("these readings fit the model");
                    times.push(us);
                }
            }
            let [p50, p99, p99_9] = [0.5, 0.99, 0.999].map(|share| quantile(&times, share));
            println!("{:32} {n:4} {name:>6} {p50:8.1} {p99:8.1} {p99_9:8.1}", case.name);
            rows.push(json!({"body": case.name, "n": n, "filter": name, "p50_us": p50, "p99_us": p99,
                "p99_9_us": p99_9}));
        }
    }
    keep("latency", &rows);
}
