//! The unscented and the extended filter on the same recordings, and where they differ.

use super::support::chance::Chance;
use super::support::chi_square::interval_999;
use super::support::nature::Sums;
use super::support::record::{on_a_stroke, times, Scene};
use super::support::stroke::Stroke;
use super::support::{body, lively_sculler, model, plain, start_std, tracker, worse, CHAIN};
use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};
use oarlock::estimate::System;

const BOTH: [FilterKind; 2] = [FilterKind::Ukf, FilterKind::Ekf];

/// What a straight line may cost where the readings are nearly straight.
const NEARLY: f64 = 1.05;

/// Start, gates, learning, holes and smoother as they come: at a hundred readings a second curvature is small beside noise.
#[test]
fn on_a_stroke_they_are_as_good_as_each_other() {
    let errors = BOTH.map(on_a_stroke);
    for [filtered, smoothed] in &errors {
        assert!(smoothed < filtered);
        assert!(*filtered < NEARLY * errors[0][0] && *smoothed < NEARLY * errors[0][1]);
    }
}

/// Over runs drawn from the filter's own model.
fn sums(config: &Config, std: &dyn Fn(&Body) -> Vec<f64>, steps: usize) -> Sums {
    let body = body(&model(CHAIN), config);
    Sums::of(&body, config, &std(&body), [60, steps], 500)
}

#[test]
fn errors_are_as_large_as_said_where_readings_are_nearly_straight() {
    for filter in BOTH {
        let config = Config { filter, ..plain(&["gyro_bias", "accel_bias"]) };
        let sums = sums(&config, &start_std, 100);
        let ((low, high), [nees, nis]) = (interval_999(sums.states), sums.shares());
        println!("{filter:?}: NEES {nees:.4}, {} in {low:.1} to {high:.1}, NIS {nis:.4}", sums.nees);
        assert!(low < sums.nees && sums.nees < high, "{filter:?}: {nees}");
    }
}

/// A prior of half a radian: over it the first readings are far from linear, which sigma points see to second order only.
#[test]
fn where_readings_are_far_from_linear_the_extended_filter_is_more_overconfident() {
    let wide = |body: &Body| {
        let mut std = start_std(body);
        std[..body.layout.partition.pose].fill(0.5);
        std
    };
    let nees = BOTH.map(|filter| sums(&Config { filter, ..plain(&[]) }, &wide, 1).shares()[0]);
    println!("first update from 0.5 rad, NEES: ukf {:.2}, ekf {:.2}", nees[0], nees[1]);
    // A first guess half a radian off is why the start is fitted and not filtered.
    assert!(nees[0] > 10.0 && nees[1] > nees[0], "{nees:?}");
}

/// The largest error of a pose on six seconds of strokes whose loops and oars' encoders are as exact as `std`, m and rad.
fn worst_with_loops(filter: FilterKind, std: f64) -> f64 {
    let tight = |key: &str, value: &str| (format!("{key} = {value}"), format!("{key} = {std}"));
    let replaced = [tight("std_m", "0.002"), tight("std_axis", "0.005")];
    let text = replaced.iter().fold(lively_sculler(), |text, (from, to)| text.replace(from, to));
    let mut model = (*model(&text)).clone();
    model.joints.iter_mut().for_each(|j| j.input_std = std);
    let config = Config { filter, estimate: Vec::new(), ..Config::default() };
    let body = body(&model.into(), &config);
    let stroke = Stroke::new(&body, 2.2);
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &|_| 0.0, azimuth_rad: 0.5, noise: 1.0 };
    let mut tracker = tracker(&body.model, &config);
    let mut worst = 0.0;
    for sample in &scene.samples(&times(0.0, 0.01, 600), &mut Chance::new(12)) {
        tracker.step(sample).unwrap();
        let Some(now) = tracker.belief() else { continue };
        let mut away = vec![0.0; now.mean.len()];
        body.difference(&now.mean, &scene.state(sample.time_s), &mut away);
        worst = away[..body.layout.partition.pose].iter().fold(worst, |w, x| worse(w, x.abs()));
    }
    worst
}

/// A loop's direction turns while the belief moves; taken as known to a tenth of a millimetre where it was a sample ago, it
/// holds the joints where they were. Sigma points see the bend.
#[test]
fn loops_that_are_far_too_exact_lead_the_extended_filter_astray() {
    for (std, holds) in [(1e-3, true), (3e-4, true), (1e-4, false)] {
        let worst = BOTH.map(|filter| worst_with_loops(filter, std));
        println!("loops of {std} m, worst error: ukf {:.4}, ekf {:.4}", worst[0], worst[1]);
        // A few standard deviations of a hand's angles at the start, which are the largest.
        assert!(worst[0] < 0.03);
        assert_eq!(worst[1] < 0.03, holds, "{std}: {}", worst[1]);
    }
}
