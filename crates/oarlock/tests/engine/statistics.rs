//! On data drawn from the filter's own model its errors and innovations are as large as it says.
//!
//! Over R independent runs the normalised squared errors (NEES) of n states at one instant add up to a chi-square variable
//! with R n degrees of freedom. Innovations are white, so the normalised squared innovations (NIS) of all steps add up to
//! one with as many degrees as there were readings. Both must lie in the interval that holds 99.9 % of such a variable;
//! the seeds are fixed, so a correct filter passes always or never.

use crate::support;

use oarlock::config::Config;
use oarlock::track::{Calibration, Tracker};
use support::chance::Chance;
use support::chi_square::interval_999;
use support::nature::{nees, Nature};
use support::tree::narrow;
use support::{belief, body, model, plain, start_std, CHAIN};

const RUNS: usize = 100;
const STEPS: usize = 150;
const STEP_S: f64 = 0.01;

/// Sums over all runs.
struct Sums {
    /// At the end of each run.
    nees: f64,
    states: usize,
    nis: f64,
    /// Over the inertial readings of a sensor alone.
    one_sensor: f64,
    readings: usize,
    /// Of all runs, that of every driven joint.
    drive: Vec<f64>,
}

fn simulate(text: &str, config: &Config) -> Sums {
    let model = model(text);
    let body = body(&model, config);
    let (n, std) = (body.layout.dim(), start_std(&body));
    let mut sums = Sums { nees: 0.0, states: 0, nis: 0.0, one_sensor: 0.0, readings: 0, drive: Vec::new() };
    for run in 0..RUNS {
        let mean = vec![0.0; n];
        let mut nature = Nature::about(&body, &mean, &std, Chance::new(1_000 + run as u64));
        let mut tracker = Tracker::new(model.clone(), &Calibration::default(), config).unwrap();
        tracker.resume(belief(&body, 0.0, mean, &std)).unwrap();
        for k in 1..=STEPS {
            nature.live(STEP_S);
            tracker.step(&nature.read(k as f64 * STEP_S)).unwrap();
            sums.nis += tracker.info().nis;
            sums.one_sensor += tracker.info().sources[1].nis;
            sums.readings += tracker.info().sources.iter().map(|s| usize::from(s.used)).sum::<usize>();
        }
        let now = tracker.belief().unwrap();
        sums.nees += nees(&body, now, &nature.state);
        sums.states += n;
        sums.drive.extend_from_slice(&now.drive);
    }
    sums
}

fn assert_inside(what: &str, sum: f64, degrees: usize) {
    let (low, high) = interval_999(degrees);
    let one = degrees as f64;
    println!("{what}: {:.4} each, bounds {:.4} to {:.4}", sum / one, low / one, high / one);
    assert!(low < sum && sum < high, "{what}: {sum} of {degrees} outside {low} to {high}");
}

#[test]
fn errors_and_innovations_are_as_large_as_said() {
    let sums = simulate(CHAIN, &plain(&["gyro_bias", "accel_bias"]));
    assert_eq!(sums.readings, RUNS * STEPS * 18);
    assert_inside("NEES", sums.nees, sums.states);
    assert_inside("NIS", sums.nis, sums.readings);
    assert_inside("NIS of the second sensor", sums.one_sensor, sums.readings / 2);
}

/// A free root whose place is measured, a ball, a hinge and a slide, base accelerations that decay and that walk.
#[test]
fn on_a_manifold_they_are_as_large_as_said_too() {
    let sums = simulate(&narrow(), &plain(&["gyro_bias", "accel_bias", "surge", "heave"]));
    assert_eq!(sums.readings, RUNS * STEPS * 31);
    assert_inside("NEES of all kinds of joints", sums.nees, sums.states);
    assert_inside("NIS of all kinds of joints", sums.nis, sums.readings);
    assert_inside("NIS of the second sensor of them", sums.one_sensor, RUNS * STEPS * 9);
}

/// Learning replaces a noise that is right by an estimate of it. An estimate that scatters can only cost: the errors grow a
/// little against what is said, the innovations likewise. A tenth is what a memory of three seconds may cost.
const COST_OF_LEARNING: f64 = 0.1;

#[test]
fn learning_what_is_right_already_costs_little() {
    let config = Config { learning_memory_s: Some(3.0), gate: true, ..plain(&["gyro_bias", "accel_bias"]) };
    let sums = simulate(CHAIN, &config);
    let (nees, nis) = (sums.nees / sums.states as f64, sums.nis / sums.readings as f64);
    let logs: Vec<f64> = sums.drive.iter().map(|d| d.ln()).collect();
    let mean = logs.iter().sum::<f64>() / logs.len() as f64;
    let scatter = (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / logs.len() as f64).sqrt();
    let refused = RUNS * STEPS * 18 - sums.readings;
    println!("learning: NEES {nees:.4}, NIS {nis:.4} each, ln(drive) {mean:.3} +- {scatter:.3}, {refused} refused");
    assert!((nees - 1.0).abs() < COST_OF_LEARNING, "{nees}");
    assert!((nis - 1.0).abs() < COST_OF_LEARNING, "{nis}");
    assert_eq!(refused, 0, "the gate refuses one in many millions");
}
