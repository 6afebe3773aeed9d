//! The covariance form of the update says what the information form says.

use super::support::chance::Chance;
use super::support::record::{punch_holes, times, Scene};
use super::support::stroke::Stroke;
use super::support::textbook::{side_by_side as textbook_beside, unscented, SAME_FILTER_SIGMA};
use super::support::tree::TREE;
use super::support::wave::Wave;
use super::support::{belief, body, model, plain, start_std, tracker, worse, SCULLER};
use oarlock::config::Config;
use oarlock::recording::Sample;
use oarlock::track::{Calibration, Status, Tracker};

const STEP_S: f64 = 0.01;
const FULL_BODY: &str = include_str!("../../../../python/oarlock/model/shipped/qmt_full_body.toml");

/// How far apart the two forms ever were, in standard deviations.
#[derive(Default)]
struct Told {
    mean: f64,
    covariance: f64,
    in_covariance_form: usize,
}

/// Both forms over `steps` samples, each from its own belief; some have gaps.
fn side_by_side(scene: &Scene, config: &Config, steps: usize, chance: &mut Chance) -> Told {
    let (body, mut tracker) = (scene.body, tracker(&scene.body.model, config));
    let mut begun_s = 0.0;
    while tracker.hypothesis().is_none() {
        begun_s += STEP_S;
        assert!(begun_s < 2.0);
        tracker.step(&scene.samples(&[begun_s], chance)[0]).unwrap();
    }
    let start = tracker.hypothesis().unwrap();
    let mut both = [false, true].map(|wanted| {
        let mut tracker = Tracker::new(body.model.clone(), &Calibration::default(), config).unwrap();
        tracker.use_covariance_form(wanted);
        tracker.resume(start.clone()).unwrap();
        tracker
    });
    let mut told = Told::default();
    let mut done = 0;
    while done < steps {
        let now: Vec<f64> = (0..steps.min(1000)).map(|k| begun_s + (done + k + 1) as f64 * STEP_S).collect();
        let mut samples = scene.samples(&now, chance);
        punch_holes(body, &mut samples[..now.len() / 2], chance);
        samples.iter().for_each(|sample| compare(&mut both, sample, &mut told));
        done += samples.len();
    }
    told
}

fn compare(both: &mut [Tracker; 2], sample: &Sample, told: &mut Told) {
    both.iter_mut().for_each(|tracker| assert_eq!(tracker.step(sample).unwrap(), Status::Tracking));
    let [a, b] = [&both[0], &both[1]].map(|tracker| tracker.belief().unwrap());
    let sigma: Vec<f64> = (0..a.mean.len()).map(|i| a.covariance.at(i, i).sqrt()).collect();
    for i in 0..sigma.len() {
        told.mean = worse(told.mean, (a.mean[i] - b.mean[i]).abs() / sigma[i]);
        for j in 0..=i {
            let gap = (a.covariance.at(i, j) - b.covariance.at(i, j)).abs();
            told.covariance = worse(told.covariance, gap / (sigma[i] * sigma[j]));
        }
    }
    told.in_covariance_form += usize::from(both[1].had_covariance_form());
}

fn assert_same(what: &str, text: &str, config: &Config, steps: usize, seed: u64) -> Told {
    let model = model(text);
    let (body, mut chance) = (body(&model, config), Chance::new(seed));
    let wave = Wave::random(&model, 0.5, 0.8, &mut chance);
    let scene = Scene { body: &body, motion: &|t| wave.at(t), surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
    let told = side_by_side(&scene, config, steps, &mut chance);
    println!(
        "{what}, {} states: mean {:.1e}, covariance {:.1e}, {} of {steps} in covariance form",
        body.layout.dim(),
        told.mean,
        told.covariance,
        told.in_covariance_form
    );
    assert!(told.mean < SAME_FILTER_SIGMA && told.covariance < SAME_FILTER_SIGMA, "{what}");
    told
}

#[test]
fn on_a_full_body() {
    let told = assert_same("full body", FULL_BODY, &plain(&["gyro_bias", "accel_bias"]), 300, 1);
    assert_eq!(told.in_covariance_form, 300);
}

#[test]
#[ignore = "long"]
fn on_a_full_body_over_100_000_steps() {
    assert_same("full body", FULL_BODY, &plain(&["gyro_bias", "accel_bias"]), 100_000, 3);
}

#[test]
fn on_a_tree_with_biases() {
    assert_same("tree", TREE, &plain(&["gyro_bias", "accel_bias", "surge", "heave"]), 500, 2);
}

/// By itself, the filter takes the covariance form here.
#[test]
fn and_what_the_textbook_says() {
    // The textbook's filter knows neither rest nor contact.
    let text: Vec<_> = FULL_BODY.lines().filter(|l| !l.starts_with("rest_std") && !l.starts_with("contact")).collect();
    let (model, config) = (model(&text.join("\n")), plain(&["gyro_bias"]));
    let (body, mut chance) = (body(&model, &config), Chance::new(4));
    assert!(body.layout.dim() > 128, "{}", body.layout.dim());
    let wave = Wave::random(&model, 0.5, 0.8, &mut chance);
    let scene = Scene { body: &body, motion: &|t| wave.at(t), surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
    let samples = scene.samples(&times(STEP_S, STEP_S, 30), &mut chance);
    // So well known that no spring sets in, which the textbook's filter lacks as well.
    let std: Vec<_> = start_std(&body).iter().map(|std| 0.1 * std).collect();
    let start = belief(&body, 0.0, scene.state(0.0), &std);
    let (worst, _) = textbook_beside(&body, &config, &start, &samples, &mut unscented, &mut |_| {});
    worst.assert_below("full body", SAME_FILTER_SIGMA);
}

/// Loops of a micrometre, and encoders of a nanoradian: of the difference P - W'W nothing would be left.
fn with_exact_readings(estimate: &[&str], steps: usize, seed: u64) -> usize {
    let own = "std_m = 1e-6\nstd_axis = 1e-6";
    let text = SCULLER.replace("std_m = 0.002\nstd_axis = 0.005", own).replace("std = 0.001  # rad", "std = 1e-9");
    assert!(text.contains(own) && text.contains("std = 1e-9"));
    let (model, config, mut chance) = (model(&text), plain(estimate), Chance::new(seed));
    let body = body(&model, &config);
    let stroke = Stroke::new(&body, 2.2);
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &|_| 0.0, azimuth_rad: 0.5, noise: 1.0 };
    let told = side_by_side(&scene, &config, steps, &mut chance);
    assert_eq!(told.in_covariance_form, 0);
    // Even two runs in one form are apart by 1e-6: rounding decides here.
    let apart = (told.mean, told.covariance);
    assert!(apart.0 < 1e-4 && apart.1 < 1e-4, "{estimate:?}: {apart:?}");
    body.layout.dim() - body.layout.partition.pose
}

#[test]
fn exact_readings_are_left_to_the_information_form() {
    with_exact_readings(&[], 2_000, 5);
}

/// The columns that only the information form needs fill whole vectors, or do not.
#[test]
fn whatever_the_number_of_states() {
    let estimates: [&[&str]; 4] = [&["surge"], &["gyro_bias"], &["gyro_bias", "accel_bias"], &["gyro_bias", "surge"]];
    let mut left: Vec<_> = estimates.iter().map(|estimate| with_exact_readings(estimate, 50, 6) % 4).collect();
    left.sort_unstable();
    left.dedup();
    assert_eq!(left, [0, 1, 2, 3]);
}
