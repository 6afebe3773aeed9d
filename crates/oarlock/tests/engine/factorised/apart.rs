//! One limb is the unscented filter, and limbs that share nothing are so many of them.

use super::bodies::chains;
use super::support::chance::Chance;
use super::support::record::{punch_holes, times, Scene};
use super::support::wave::Wave;
use super::support::{body, model, plain, start_std, started, worse, CHAIN};
use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};
use oarlock::estimate::belief::Belief;
use oarlock::recording::Sample;
use oarlock::track::{Status, Tracker};

/// Of the same equations, summed up in another order.
const SAME_FILTER_SIGMA: f64 = 1e-8;
const BIASES: [&str; 2] = ["gyro_bias", "accel_bias"];

fn samples(body: &Body, steps: usize, seed: u64) -> (Vec<Sample>, Vec<f64>) {
    let mut chance = Chance::new(seed);
    let wave = Wave::random(&body.model, 0.5, 0.8, &mut chance);
    let motion = |t: f64| wave.at(t);
    let scene = Scene { body, motion: &motion, surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
    let mut samples = scene.samples(&times(0.01, 0.01, steps), &mut chance);
    punch_holes(body, &mut samples, &mut chance);
    (samples, scene.state(0.0))
}

fn tracker(body: &Body, config: &Config, mean: Vec<f64>) -> Tracker {
    started(body, config, mean, &start_std(body))
}

/// Mean and covariance, in standard deviations of `b`; state i of `b` is state `of[i]` of `a`.
fn apart(a: &Belief, b: &Belief, of: &[usize]) -> f64 {
    let std = |i: usize| b.covariance.at(i, i).sqrt();
    let mut worst = 0.0;
    for i in 0..of.len() {
        worst = worse(worst, (a.mean[of[i]] - b.mean[i]).abs() / std(i));
        for j in 0..of.len() {
            let gap = (a.covariance.at(of[i], of[j]) - b.covariance.at(i, j)).abs();
            worst = worse(worst, gap / (std(i) * std(j)));
        }
    }
    worst
}

#[test]
fn where_nothing_falls_apart_it_is_the_unscented_filter() {
    let unscented = plain(&BIASES);
    let factorised = Config { filter: FilterKind::Factorised, ..unscented.clone() };
    let body = body(&model(CHAIN), &unscented);
    let (samples, start) = samples(&body, 200, 1);
    let [mut one, mut other] = [&unscented, &factorised].map(|c| tracker(&body, c, start.clone()));
    let all: Vec<usize> = (0..start.len()).collect();
    for sample in &samples {
        assert_eq!([&mut one, &mut other].map(|t| t.step(sample).unwrap()), [Status::Tracking; 2]);
        let gap = apart(other.belief().unwrap(), one.belief().unwrap(), &all);
        assert!(gap < SAME_FILTER_SIGMA, "{gap:e}");
    }
}

/// Everything that only some sources read, by the names of rows and states.
fn only(sample: &Sample, whole: &Body, one: &Body) -> Sample {
    let (all, own) = (whole.suite.row_names(), one.suite.row_names());
    let z = own.iter().map(|name| sample.z[all.iter().position(|n| n == name).unwrap()]).collect();
    Sample { time_s: sample.time_s, z, ..Sample::empty(&one.model, &one.suite) }
}

#[test]
fn bodies_that_share_nothing_are_two_filters() {
    let unscented = plain(&BIASES);
    let factorised = Config { filter: FilterKind::Factorised, ..unscented.clone() };
    let both = body(&model(&chains(&["r", "l"])), &factorised);
    let (samples, start) = samples(&both, 200, 4);
    let mut together = tracker(&both, &factorised, start.clone());
    let alone = ["r", "l"].map(|side| body(&model(&chains(&[side])), &unscented));
    let states = alone.each_ref().map(|one| -> Vec<usize> {
        let place = |name: &String| both.layout.names.iter().position(|n| n == name).unwrap();
        one.layout.names.iter().map(place).collect()
    });
    let mut singles = [0, 1].map(|k| {
        let own = states[k].iter().map(|&i| start[i]).collect();
        tracker(&alone[k], &unscented, own)
    });
    let mut worst = 0.0;
    for sample in &samples {
        together.step(sample).unwrap();
        let (ours, mut nis) = (together.belief().unwrap(), 0.0);
        for k in 0..2 {
            let seen = only(sample, &both, &alone[k]);
            assert_eq!(singles[k].step(&seen).unwrap(), Status::Tracking);
            worst = worse(worst, apart(ours, singles[k].belief().unwrap(), &states[k]));
            nis += if singles[k].info().nis.is_nan() { 0.0 } else { singles[k].info().nis };
            for &i in &states[0] {
                states[1].iter().for_each(|&j| assert_eq!(ours.covariance.at(i, j), 0.0));
            }
        }
        assert!((together.info().nis - nis).abs() <= SAME_FILTER_SIGMA * (1.0 + nis));
    }
    println!("two bodies in one filter and in two: {worst:.1e} sigma");
    assert!(worst < SAME_FILTER_SIGMA, "{worst:e}");
}
