//! The filter's arithmetic: both sets of instructions agree, and loops that hardly give do not break it.

use crate::support;

use oarlock::config::Config;
use oarlock::kernels::arch::Arch;
use oarlock::recording::Sample;
use oarlock::track::{Status, Tracker};
use support::chance::Chance;
use support::record::{punch_holes, times, Scene};
use support::stroke::Stroke;
use support::tree::TREE;
use support::wave::Wave;
use support::{body, model, plain, start_std, started, tracker, worse, SCULLER};

/// As for the textbook filter: roundings, through covariances that lose eight of sixteen digits.
const SAME_FILTER_SIGMA: f64 = 1e-8;
const STEP_S: f64 = 0.01;
/// A stroke of 2.2 s.
const PERIOD: usize = 220;

/// Samples of the sculler over one stroke.
fn stroke(text: &str, config: &Config) -> Vec<Sample> {
    let body = body(&model(text), config);
    let stroke = Stroke::new(&body, PERIOD as f64 * STEP_S);
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &|_| 0.0, azimuth_rad: 0.5, noise: 1.0 };
    scene.samples(&times(STEP_S, STEP_S, PERIOD), &mut Chance::new(21))
}

fn tree(config: &Config) -> Vec<Sample> {
    let model = model(TREE);
    let (body, mut chance) = (body(&model, config), Chance::new(22));
    let wave = Wave::random(&model, 0.5, 0.8, &mut chance);
    let motion = |t: f64| wave.at(t);
    let scene = Scene { body: &body, motion: &motion, surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
    scene.samples(&times(STEP_S, STEP_S, PERIOD), &mut chance)
}

/// A tracker that starts beside the truth.
fn begun(text: &str, config: &Config, arch: Arch) -> Tracker {
    let body = body(&model(text), config);
    let std = start_std(&body);
    let mut mean = vec![0.0; std.len()];
    body.moving().for_each(|(_, axis, slots)| mean[slots.q] = axis.rest);
    if text == SCULLER {
        let stroke = Stroke::new(&body, PERIOD as f64 * STEP_S);
        let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &|_| 0.0, azimuth_rad: 0.5, noise: 1.0 };
        mean = scene.state(0.0);
    }
    let mut tracker = started(&body, config, mean, &std);
    tracker.use_arch(arch);
    tracker
}

/// How far apart two trackers ever are on the same samples, in standard deviations.
fn apart(text: &str, samples: &[Sample], config: &Config) -> f64 {
    let [mut best, mut portable] = [Arch::best(), Arch::PORTABLE].map(|arch| begun(text, config, arch));
    let mut worst: f64 = 0.0;
    for sample in samples {
        assert_eq!(best.step(sample).unwrap(), portable.step(sample).unwrap());
        let (a, b) = (best.belief().unwrap(), portable.belief().unwrap());
        for i in 0..a.mean.len() {
            worst = worse(worst, (a.mean[i] - b.mean[i]).abs() / b.covariance.at(i, i).sqrt());
        }
        let ([a, b], there) = ([best.info().nis, portable.info().nis], portable.info().inertial.1 > 0);
        assert!(!there || (a - b).abs() <= 1e-6 * b.max(1.0), "{a} {b}");
    }
    worst
}

#[test]
fn both_sets_of_instructions_say_the_same() {
    let config = Config { gate: false, ..Config::default() };
    let mut samples = stroke(SCULLER, &config);
    punch_holes(&body(&model(SCULLER), &config), &mut samples, &mut Chance::new(23));
    let (sculler, tree) = (apart(SCULLER, &samples, &config), apart(TREE, &tree(&config), &config));
    println!("sculler {sculler:.1e}, tree {tree:.1e} sigma apart");
    assert!(sculler < SAME_FILTER_SIGMA && tree < SAME_FILTER_SIGMA);
}

/// Loops of this standard deviation (m, and of axes), and encoders a thousand times as good.
fn stiff(std: f64) -> String {
    let loops = format!("std_m = {std:e}\nstd_axis = {std:e}");
    let text = SCULLER.replace("std_m = 0.002\nstd_axis = 0.005", &loops);
    assert!(text.contains(&loops));
    text.replace("std = 0.001  # rad", &format!("std = {:e}", std / 1000.0))
}

/// Strokes one behind the other; the trunk's angle must still be known at the end.
fn row(std: f64, steps: usize) {
    let (text, config) = (stiff(std), plain(&[]));
    let samples = stroke(&text, &config);
    let mut tracker = tracker(&model(&text), &config);
    for k in 0..steps {
        let mut sample = samples[k % PERIOD].clone();
        sample.time_s = (k + 1) as f64 * STEP_S;
        let status = tracker.step(&sample).unwrap_or_else(|e| panic!("{std:e}, step {k}: {e}"));
        assert!(k < 20 || status == Status::Tracking);
    }
    let belief = tracker.belief().unwrap();
    let variances = (0..belief.mean.len()).map(|i| belief.covariance.at(i, i));
    assert!(variances.into_iter().all(|v| v > 0.0 && v.is_finite()));
    let truth = Stroke::new(tracker.body(), PERIOD as f64 * STEP_S).at(steps as f64 * STEP_S);
    // A hundredth of a radian is many of its standard deviations, and far less than a stroke moves it.
    assert!((belief.mean[1] - truth.q[1]).abs() < 0.01, "{} {}", belief.mean[1], truth.q[1]);
}

#[test]
fn loops_that_hardly_give_break_nothing() {
    row(1e-3, 2_000);
    row(1e-6, 2_000);
}

#[test]
#[ignore = "long"]
fn loops_that_hardly_give_break_nothing_over_100_000_steps() {
    row(1e-3, 100_000);
    row(1e-6, 100_000);
}
