//! On data drawn from the filter's own model its errors and innovations are as large as it says.
//!
//! Over R independent runs the normalised squared errors (NEES) of n states at one instant add up to a chi-square variable
//! with R n degrees of freedom. Innovations are white, so the normalised squared innovations (NIS) of all steps add up to
//! one with as many degrees as there were readings. Both must lie in the interval that holds 99.9 % of such a variable;
//! the seeds are fixed, so a correct filter passes always or never.

use crate::support;

use oarlock::config::Config;
use support::chi_square::interval_999;
use support::nature::Sums;
use support::tree::{narrow, narrow_of, spanned};
use support::{body, model, plain, start_std, CHAIN};

const RUNS: usize = 100;
const STEPS: usize = 150;

fn simulate(text: &str, config: &Config) -> Sums {
    let body = body(&model(text), config);
    Sums::of(&body, config, &start_std(&body), [RUNS, STEPS], 1_000)
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

/// Distances, and orientations with slow errors and an unknown heading.
#[test]
fn distances_and_orientations_are_as_good_as_said() {
    let text = narrow_of(&spanned()).replace("std_rad = 0.03", "std_rad = 0.015");
    let sums = simulate(&text, &plain(&["gyro_bias", "accel_bias", "surge", "heave"]));
    assert_eq!(sums.readings, RUNS * STEPS * 42);
    assert_inside("NEES with distances and orientations", sums.nees, sums.states);
    assert_inside("NIS with distances and orientations", sums.nis, sums.readings);
}
