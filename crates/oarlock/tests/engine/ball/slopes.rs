//! Derivatives of the mean by the parameters of a score (dx/dp) while updates move the references of rotations (P3, P4): against differences of
//! whole runs, and against a heading that nothing measures.

use super::support::chance::Chance;
use super::support::record::{times, Scene};
use super::support::tree::TREE;
use super::support::wave::Wave;
use super::support::{body, model, plain, so3};
use nalgebra::Vector3;
use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};
use oarlock::estimate::System;
use oarlock::model::SensorKind;
use oarlock::recording::Sample;
use oarlock::rotation::turn::Turn;
use oarlock::track::hypothesis::Hypothesis;
use oarlock::track::{Calibration, Tracker};

/// Amplitude, rad and m, and frequency, Hz: a ball turns at up to 10 rad/s.
const SWING: [f64; 2] = [0.7, 1.0];
/// As the model files say nothing.
const MOUNT_STD_RAD: f64 = 0.1;

/// A body without noise, gate and learning, at a state estimate from its own start fit.
struct Moving {
    body: Body,
    config: Config,
    start: Hypothesis,
    rest: Vec<Sample>,
}

impl Moving {
    /// Over 2 s at `hz`, of which the first 0.4 s lead to the start.
    fn new(text: &str, hz: f64, seed: u64) -> Self {
        let config = Config { filter: FilterKind::Ekf, ..plain(&[]) };
        let body = body(&model(text), &config);
        let wave = Wave::random(&body.model, SWING[0], SWING[1], &mut Chance::new(seed));
        let scene = Scene { body: &body, motion: &|t| wave.at(t), surge: &|_| 0.0, azimuth_rad: 0.3, noise: 0.0 };
        let samples = scene.samples(&times(0.0, 1.0 / hz, (2.0 * hz) as usize), &mut Chance::new(1));
        let (first, rest) = samples.split_at((0.4 * hz) as usize);
        let mut tracker = scoring(&body, &Calibration::default(), &config);
        first.iter().for_each(|sample| assert!(tracker.step(sample).is_ok()));
        let start = tracker.hypothesis().unwrap().clone();
        Moving { rest: rest.to_vec(), body, config, start }
    }

    fn end(&self, known: &Calibration, start: Hypothesis) -> Hypothesis {
        let mut tracker = scoring(&self.body, known, &self.config);
        tracker.resume(start).unwrap();
        self.rest.iter().for_each(|sample| assert!(tracker.step(sample).is_ok()));
        tracker.hypothesis().unwrap().clone()
    }

    /// A mount turned about an axis of its unit.
    fn turned(&self, unit: usize, axis: usize, by_rad: f64) -> Calibration {
        let sensor = &self.body.model.sensors[unit];
        let SensorKind::Imu(imu) = &sensor.kind else { panic!("a unit") };
        let turn = Turn::exp([0, 1, 2].map(|k| if k == axis { by_rad } else { 0.0 })).matrix();
        let offset = imu.mount.offset.each_ref().map(|x| x.eval(&self.body.parameters));
        let mounts = [(sensor.name.clone(), (imu.mount.rotation.times(&turn), offset))].into();
        Calibration { mounts, ..Calibration::default() }
    }

    /// By how much dx/dp of a mount's angle at the end differs from differences of two runs, relative to these; all states in their
    /// standard deviations.
    fn miss(&self, end: &Hypothesis, parameter: usize, (unit, axis): (usize, usize)) -> f64 {
        let n = end.belief.mean.len();
        let before = slopes(&self.start, parameter);
        let [up, down] = [STEP_RAD, -STEP_RAD].map(|by| {
            let mut start = self.start.clone();
            let led: Vec<f64> = before.iter().map(|s| s * by / MOUNT_STD_RAD).collect();
            self.body.shift(&mut start.belief.mean, &led);
            let mut away = vec![0.0; n];
            let moved = self.end(&self.turned(unit, axis, by), start);
            self.body.difference(&moved.belief.mean, &end.belief.mean, &mut away);
            away
        });
        let carried = slopes(end, parameter);
        let [mut missed, mut all] = [0.0; 2];
        for i in 0..n {
            let slope = (up[i] - down[i]) / (2.0 * STEP_RAD);
            let variance = end.belief.covariance.at(i, i);
            missed += (carried[i] / MOUNT_STD_RAD - slope).powi(2) / variance;
            all += slope * slope / variance;
        }
        (missed / all).sqrt()
    }
}

fn scoring(body: &Body, known: &Calibration, config: &Config) -> Tracker {
    let mut tracker = Tracker::new(body.model.clone(), known, config).unwrap();
    tracker.keep_score(known, (0.0, 1.0)).unwrap();
    tracker
}

/// Length of each state's row of derivatives.
fn width(one: &Hypothesis) -> usize {
    one.slopes.len() / one.belief.mean.len()
}

/// dx/dp of one parameter.
fn slopes(one: &Hypothesis, parameter: usize) -> Vec<f64> {
    one.slopes.chunks(width(one)).map(|row| row[parameter]).collect()
}

/// Units of the tree. Before their mounts, the parameters are three places for each.
const UNITS: usize = 3;
/// Third powers of it are nothing beside it.
const STEP_RAD: f64 = 1e-3;
/// Slopes leave out that the gain changes with the parameter, which matters after far starts: seed 5 misses by up to 0.22. Here
/// it is at most 0.022.
const CHANGES_OF_THE_GAIN: f64 = 0.03;

#[test]
fn slopes_of_fast_balls_are_differences_of_estimates() {
    // As much process noise as the motion needs.
    let tree = ["2.0", "3.0", "4.0"]
        .iter()
        .fold(TREE.to_string(), |text, density| text.replace(&format!("density = {density}"), "density = 20.0"));
    for seed in [6, 7, 8] {
        let moving = Moving::new(&tree, 400.0, seed);
        let end = moving.end(&Calibration::default(), moving.start.clone());
        for k in 0..3 * UNITS {
            let miss = moving.miss(&end, 3 * UNITS + k, (k / 3, k % 3));
            assert!(miss < CHANGES_OF_THE_GAIN, "seed {seed}, unit {}, axis {}: {miss}", k / 3, k % 3);
        }
    }
}

/// A thrown body without a compass.
const THROWN: &str = r#"
format = 1
name = "thrown"
joint = [
    { name = "trunk", kind = "free" },
    { name = "shoulder", kind = "ball" },
    { name = "hip", kind = "ball" },
]
frame = [
    { name = "trunk", parent = "root", transform = {}, joint = "trunk" },
    { name = "arm", parent = "trunk", transform = { translation = [0.1, -0.2, 0.3] }, joint = "shoulder" },
    { name = "leg", parent = "trunk", transform = { translation = [0.1, 0.1, -0.3] }, joint = "hip" },
]
sensor = [
    { name = "trunk", kind = "imu", frame = "trunk", gyro_std_rad_s = 1e-3, accel_std_m_s2 = 0.1,
      mount.offset = [0.02, 0.05, 0] },
    { name = "arm", kind = "imu", frame = "arm", gyro_std_rad_s = 1e-3, accel_std_m_s2 = 0.1,
      mount.offset = [0.05, 0, -0.25] },
    { name = "leg", kind = "imu", frame = "leg", gyro_std_rad_s = 1e-3, accel_std_m_s2 = 0.1,
      mount.offset = [0, 0.05, -0.3] },
]
[world]
up = [0, 0, 1]
forward = [1, 0, 0]
"#;

/// Accelerations of 5 m/s2 that turn with the heading, over 160 updates.
const ROUNDING: f64 = 1e-10;

/// The same trunk on a ball that stands still, with a compass on each unit.
fn hung() -> String {
    let field = "magnetic_norm_ut = 47.0\nmagnetic_dip_rad = \"60*pi/180\"\nmagnetic_azimuth_rad = 0.3\n";
    let compass = THROWN.replace("accel_std_m_s2 = 0.1,", "accel_std_m_s2 = 0.1, mag_std_ut = 1.0,");
    compass.replace("kind = \"free\"", "kind = \"ball\"") + field
}

/// What a turn of the whole body, and of the field, about the vertical changes, per rad.
fn heading(body: &Body, mean: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; mean.len()];
    let (coordinate, slots) = body.layout.turns[0];
    if coordinate == 3 {
        let place = body.layout.coordinates[0].unwrap();
        let (rate, accel) = place.rates.unwrap();
        for at in [place.q, rate, accel] {
            out[at..at + 3].copy_from_slice(Vector3::z().cross(&so3::three(mean, at)).as_slice());
        }
    }
    let up = so3::exp(so3::three(mean, slots.q)).transpose() * Vector3::z();
    out[slots.q..slots.q + 3].copy_from_slice(up.as_slice());
    body.layout.azimuth.into_iter().for_each(|i| out[i] = 1.0);
    out
}

#[test]
fn an_error_of_a_heading_that_nothing_measures_remains_one() {
    for text in [THROWN.to_string(), hung()] {
        let moving = Moving::new(&text, 100.0, 5);
        let led = heading(&moving.body, &moving.start.belief.mean);
        let (mut astray, width) = (moving.start.clone(), width(&moving.start));
        led.iter().zip(astray.slopes.chunks_mut(width)).for_each(|(led, row)| row[0] += led);
        let [end, astray] = [moving.start.clone(), astray].map(|start| moving.end(&Calibration::default(), start));
        let expected = heading(&moving.body, &end.belief.mean);
        // Slopes are affine in what they were: the difference is what became of the heading.
        let [without, with] = [&end, &astray].map(|one| slopes(one, 0));
        for i in 0..expected.len() {
            let away = with[i] - without[i] - expected[i];
            assert!(away.abs() < ROUNDING * (1.0 + expected[i].abs()), "{}: {away}", moving.body.layout.names[i]);
        }
    }
}
