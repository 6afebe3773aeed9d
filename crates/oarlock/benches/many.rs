//! Independent recordings side by side against one after the other, in turn so that both meet the same machine.

#[path = "step/figures.rs"]
mod figures;
#[allow(missing_docs)]
#[path = "../tests/support/mod.rs"]
mod support;

use oarlock::recording::Stream;
use oarlock::track::many::{track_many, Job};
use oarlock::track::Calibration;
use oarlock::{Config, Model};
use oarlock_oracle::race::quantile;
use serde_json::json;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;
use support::chance::Chance;
use support::record::{streams, times, Scene};
use support::stroke::Stroke;

const RATE_HZ: f64 = 125.0;
const SAMPLES: usize = 1_000;
/// As many for each thread, so that none idles at the end.
const RECORDINGS: usize = 8;
const ROUNDS: usize = 7;

fn recordings(model: &Arc<Model>, config: &Config) -> Vec<Vec<Stream>> {
    let body = support::body(model, config);
    let stroke = Stroke::new(&body, 2.2);
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
    let made = (0..RECORDINGS as u64).map(|seed| {
        let samples = scene.samples(&times(0.0, 1.0 / RATE_HZ, SAMPLES), &mut Chance::new(seed + 1));
        streams(&body, &samples)
    });
    made.collect()
}

fn seconds(jobs: Vec<Job>, threads: usize) -> f64 {
    let begun = Instant::now();
    let done = track_many(black_box(jobs), Some(threads), &mut |_| true).expect("nobody stops it");
    let spent = begun.elapsed().as_secs_f64();
    assert!(done.iter().all(Result::is_ok), "these recordings fit the model");
    spent
}

fn main() {
    let model = support::model(support::SCULLER);
    let config = Config::default();
    let job = |streams| Job {
        model: model.clone(),
        streams,
        calibration: Calibration::default(),
        config: config.clone(),
        smooth: false,
    };
    let jobs: Vec<Job> = recordings(&model, &config).into_iter().map(job).collect();
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut widths = vec![1, 2, cores];
    widths.dedup();
    let mut spent = vec![Vec::new(); widths.len()];
    for _ in 0..ROUNDS {
        for (spent, &threads) in spent.iter_mut().zip(&widths) {
            spent.push(seconds(jobs.clone(), threads));
        }
    }
    let spent: Vec<f64> = spent.iter().map(|s| quantile(s, 0.5)).collect();
    let row = |(&threads, s): (&usize, &f64)| {
        let steps_s = (RECORDINGS * SAMPLES) as f64 / s;
        json!({"threads": threads, "cores": cores, "n": 72, "steps_s": steps_s, "ratio": spent[0] / s})
    };
    figures::keep("many", &widths.iter().zip(&spent).map(row).collect::<Vec<_>>());
    println!("{RECORDINGS} recordings of {SAMPLES} samples, {cores} cores, medians of {ROUNDS} rounds:");
    for (threads, s) in widths.iter().zip(&spent) {
        let steps = (RECORDINGS * SAMPLES) as f64 / s;
        println!("  {threads} threads: {steps:.0} samples/s, ratio {:.2}", spent[0] / s);
    }
}
