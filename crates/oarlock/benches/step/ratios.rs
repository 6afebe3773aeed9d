//! Steps of every filter against the textbook's, taken in turn so that all meet the same machine.

use super::bodies::{cases, Case};
use super::figures::keep;
use super::is_filtered;
use criterion::Criterion;
use oarlock::config::FilterKind;
use oarlock::kernels::arch::Arch;
use oarlock_oracle::race::{quantile, race};
use serde_json::{json, Value};
use std::time::{Duration, Instant};

/// For each body.
const TIME: Duration = Duration::from_secs(5);

/// The textbook's filter as any of us might write it: not to be beaten by making it slow.
const EXPECTED: &str =
    "The textbook's filter takes about 405 us at 41 states on one core of a 3.7 GHz Zen 4; if it is slower \
    here by more than this machine is, the ratios flatter.";

pub fn of_steps(_: &mut Criterion) {
    if is_filtered() {
        return;
    }
    println!("time of a step, us: median (10 % quantile)\n{EXPECTED}");
    println!(
        "{:32} {:>4} {:>4} {:>18} {:>18} {:>9} {:>9}",
        "body and filter", "n", "m", "oarlock", "textbook ukf", "ratio", "p10 ratio"
    );
    let rows: Vec<Value> = cases().iter().flat_map(ratios).collect();
    keep("ratios", &rows);
}

fn ratios(case: &Case) -> Vec<Value> {
    let (ukf, samples) = case.running(FilterKind::Ukf);
    let (n, m) = (ukf.body.layout.dim(), ukf.body.suite.len());
    let mut portable = ukf.clone();
    portable.use_arch(Arch::PORTABLE);
    let names = ["ukf", "ekf", "factorised", "ukf, portable instructions"];
    let [ekf, factorised] = [FilterKind::Ekf, FilterKind::Factorised].map(|filter| case.running(filter).0);
    let trackers = [ukf, ekf, factorised, portable];
    let begun = Instant::now();
    let times = race(&trackers, &case.config, samples, &mut || begun.elapsed() < TIME).expect("these readings fit");
    let both = |times: &[f64]| [0.5, 0.1].map(|share| quantile(times, share));
    let textbook = both(&times.textbook);
    println!("{}", case.name);
    let mut rows = Vec::new();
    for (name, times) in names.iter().zip(&times.ours) {
        let ours = both(times);
        let [ratio, ratio_p10] = [0, 1].map(|i| textbook[i] / ours[i]);
        let beside = |[half, tenth]: [f64; 2]| format!("{half:.1} ({tenth:.1})");
        println!("  {name:30} {n:4} {m:4} {:>18} {:>18} {ratio:9.1} {ratio_p10:9.1}", beside(ours), beside(textbook));
        rows.push(json!({"body": case.name, "n": n, "m": m, "filter": name, "us": ours[0], "us_p10": ours[1],
            "textbook_us": textbook[0], "textbook_us_p10": textbook[1], "ratio": ratio, "ratio_p10": ratio_p10}));
    }
    rows
}
