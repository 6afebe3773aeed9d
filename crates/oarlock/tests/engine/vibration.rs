//! A unit that is shaken keeps its heading: accelerations in its own axes contain no information about it (P4).

use crate::support;

use oarlock::config::{Config, Magnetometer};
use std::f64::consts::TAU;
use support::chance::Chance;
use support::record::{times, Scene};
use support::wave::Wave;
use support::{body, model, tracker};

const BROAD: &str = include_str!("../../../../python/oarlock/model/shipped/broad.toml");
const STEP_S: f64 = 0.0035;
const SHAKEN_FROM_S: f64 = 5.0;

/// An unbalanced rotor shakes a resting unit: 3 m/s2 at 60 Hz.
const ROTOR_HZ: f64 = 60.0;
const ROTOR_M_S2: f64 = 3.0;

/// Without a magnetometer: change of the heading while the unit is shaken for five seconds, and its standard deviations before and after,
/// rad.
fn turned_by_shaking() -> (f64, [f64; 2]) {
    let model = model(BROAD);
    let config = Config { magnetometer: Magnetometer::Off, ..Config::default() };
    let body = body(&model, &config);
    let wave = Wave::still(&model);
    let motion = |t| wave.at(t);
    let scene = Scene { body: &body, motion: &motion, surge: &|_| 0.0, azimuth_rad: 0.0, noise: 0.2 };
    let mut samples = scene.samples(&times(0.0, STEP_S, (10.0 / STEP_S) as usize), &mut Chance::new(5));
    for sample in samples.iter_mut().filter(|s| s.time_s >= SHAKEN_FROM_S) {
        let (sin, cos) = (TAU * ROTOR_HZ * sample.time_s).sin_cos();
        sample.z[3] += ROTOR_M_S2 * cos;
        sample.z[4] += ROTOR_M_S2 * sin;
    }
    let heading = body.layout.turns[0].1.q + 2;
    let mut tracker = tracker(&model, &config);
    let (mut before, mut after) = ((f64::NAN, f64::NAN), (f64::NAN, f64::NAN));
    for sample in &samples {
        let mut see = |s: &oarlock::recording::Sample, b: &oarlock::track::hypothesis::Hypothesis| {
            after = (b.belief.mean[heading], b.belief.covariance.at(heading, heading).sqrt());
            if s.time_s < SHAKEN_FROM_S {
                before = after;
            }
        };
        tracker.step_with(sample, &mut |s, b, _| see(s, b)).unwrap();
    }
    (after.0 - before.0, [before.1, after.1])
}

#[test]
fn vibration_contains_no_information_about_the_heading() {
    let (turned_rad, [before, after]) = turned_by_shaking();
    println!("turned by {turned_rad:.3} rad; standard deviation {before:.3}, then {after:.3} rad");
    assert!(
        after > before,
        "the heading drifts with the gyroscope's noise, and nothing measures it: {before}, {after}"
    );
    assert!(turned_rad.abs() < 3.0 * after, "{turned_rad} is beyond three standard deviations of {after}");
}
