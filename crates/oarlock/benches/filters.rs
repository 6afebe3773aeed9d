//! Time of one step of each filter on the sculler, beside the textbook's unscented filter, and what a Jacobian costs.

// The baseline: the plain filter of the tests, written from the textbook.
#[allow(dead_code)]
#[path = "../tests/textbook/body.rs"]
mod body;
#[allow(missing_docs)]
#[path = "../tests/support/mod.rs"]
mod support;
#[allow(dead_code)]
#[path = "../tests/textbook/ukf.rs"]
mod ukf;

use body::Naive;
use nalgebra::{DMatrix, DVector};
use oarlock::config::FilterKind;
use oarlock::estimate::System;
use oarlock::recording::Sample;
use oarlock::track::{Calibration, Tracker};
use oarlock::{Config, Model};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;
use support::chance::Chance;
use support::record::{times, Scene};
use support::so3;
use support::stroke::Stroke;
use ukf::{Ukf, Weights};

const RATE_HZ: f64 = 125.0;
/// Steps of every filter, and how many of them in a row.
const STEPS: usize = 1_000;
const STRETCH: usize = 25;

/// Samples until the start is found and forgotten.
const WARM: usize = 250;

/// Samples of a stroke.
fn samples(model: &Arc<Model>, config: &Config) -> Vec<Sample> {
    let body = support::body(model, config);
    let stroke = Stroke::new(&body, 2.2);
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
    scene.samples(&times(0.0, 1.0 / RATE_HZ, WARM + STEPS), &mut Chance::new(1))
}

fn microseconds(run: impl FnOnce()) -> f64 {
    let begun = Instant::now();
    run();
    1e6 * begun.elapsed().as_secs_f64()
}

fn textbook_step(tracker: &Tracker, next: &Sample, config: &Config) -> f64 {
    let (body, belief) = (&tracker.body, tracker.belief().expect("it runs"));
    let n = belief.mean.len();
    let mut plain = Ukf {
        body: Naive::new(&body.model, body.model.default_parameters(), &body.layout.names),
        mean: DVector::from_row_slice(&belief.mean),
        covariance: DMatrix::from_row_slice(n, n, belief.covariance.as_slice()),
        weights: Weights::new(n, config.alpha, config.beta, config.kappa),
    };
    let z: Vec<f64> = next.z.iter().map(|z| if z.is_nan() { 0.0 } else { *z }).collect();
    let std = body.suite.std();
    microseconds(|| {
        plain.predict(1.0 / RATE_HZ);
        plain.update(black_box(&z), &std, &next.inputs);
    })
}

fn linearisation(tracker: &Tracker, next: &Sample) -> f64 {
    let body = &tracker.body;
    let mean = &tracker.belief().expect("it runs").mean;
    let mut moment = body.moment();
    moment.active.fill(true);
    moment.needed.fill(true);
    moment.inputs.iter_mut().zip(&next.inputs).for_each(|(to, x)| *to = if x.is_nan() { 0.0 } else { *x });
    let (rows, width) = (body.row_count(), mean.len() + body.input_std().len());
    let (mut center, mut jacobian, mut scratch) = (vec![0.0; rows], vec![0.0; rows * width], body.scratch());
    microseconds(|| body.linearise(&moment, &mut scratch, black_box(mean), &mut center, &mut jacobian))
}

fn median(v: &mut [f64]) -> f64 {
    v.sort_by(f64::total_cmp);
    v[v.len() / 2]
}

fn compare(model: &Arc<Model>, estimate: &[&str]) {
    let estimate: Vec<String> = estimate.iter().map(|e| e.to_string()).collect();
    let kinds = [FilterKind::Ukf, FilterKind::Ekf, FilterKind::Iekf];
    let configs = kinds.map(|filter| Config { filter, estimate: estimate.clone(), ..Config::default() });
    let samples = samples(model, &configs[0]);
    let made = configs.iter().map(|c| Tracker::new(model.clone(), &Calibration::default(), c));
    let mut trackers: Vec<Tracker> = made.map(|t| t.expect("the shipped model tracks")).collect();
    let mut spent = vec![Vec::new(); 5];
    let step = |tracker: &mut Tracker, sample: &Sample| {
        tracker.step(black_box(sample)).expect("these readings fit the model");
    };
    let (start, rest) = samples.split_at(WARM);
    trackers.iter_mut().for_each(|t| start.iter().for_each(|s| step(t, s)));
    // In turn, so that all meet the same machine, and a few steps in a row, as in use.
    for stretch in rest.chunks_exact(STRETCH) {
        spent[3].extend(stretch.iter().map(|next| textbook_step(&trackers[0], next, &configs[0])));
        spent[4].extend(stretch.iter().map(|next| linearisation(&trackers[0], next)));
        for (tracker, spent) in trackers.iter_mut().zip(&mut spent) {
            spent.extend(stretch.iter().map(|next| microseconds(|| step(tracker, next))));
        }
    }
    let [ukf, ekf, iekf, textbook, jacobian] = [0, 1, 2, 3, 4].map(|i| median(&mut spent[i]));
    let body = &trackers[0].body;
    println!("{} states, {} readings:", body.layout.dim(), body.row_count());
    for (name, time) in [("ukf", ukf), ("ekf", ekf), ("iekf", iekf)] {
        println!("  {name}: {time:.1} us, textbook {textbook:.0} us, ratio {:.1}", textbook / time);
    }
    println!("  readings and Jacobian alone: {jacobian:.1} us");
}

fn main() {
    let model = Arc::new(Model::from_toml(support::SCULLER, "sculler.toml").expect("the shipped model is valid"));
    compare(&model, &[]);
    compare(&model, &["gyro_bias", "accel_bias", "surge"]);
}
