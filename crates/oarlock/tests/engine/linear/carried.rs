//! What an update makes of derivatives of the mean, against the gain of the textbook: S+ = (1 - K H) S - K f.

use super::system::{matrix, start, Linear, ROWS, STATES};
use super::{samples, support, Make, OPEN};
use nalgebra::{DMatrix, DVector};
use oarlock::estimate::filter::{Filter, Info, Measurement, RowGroups};
use oarlock::estimate::information::{Carried, Force};
use oarlock::estimate::transition::Transition;
use support::chance::Chance;

/// Both sides round differently.
const SAME: f64 = 1e-11;
const WIDTH: usize = 8;

/// The largest difference over many updates, in which readings are missing and some are rejected.
fn worst(make: Make) -> f64 {
    let system = Linear::new();
    let groups = RowGroups { parts: vec![0..2, 2..ROWS], sources: vec![0..2, 2..ROWS], inertial: vec![0, 1] };
    let (mut filter, mut info, mut belief) = (make(&system, &groups), Info::new(&groups, ROWS), start());
    let mut chance = Chance::new(8);
    let mut carried = Carried::new(STATES, ROWS, WIDTH);
    let mut worst: f64 = 0.0;
    for (k, sample) in samples(60, 3).iter().enumerate().skip(1) {
        filter.predict(&system, &mut belief, sample.time_s, &mut Transition::default());
        if sample.z.iter().all(|z| z.is_nan()) {
            continue;
        }
        let (excluded, before) = ([k % 5 == 2, k % 6 == 1], belief.clone());
        let f = DMatrix::from_fn(ROWS, WIDTH, |_, _| chance.normal());
        let s = DMatrix::from_fn(STATES, WIDTH, |_, _| chance.normal());
        let force =
            |row: usize, parameter: usize| Force { row, parameter, by: f[(row, parameter)] / system.noise_std[row] };
        let forces: Vec<Force> =
            (0..ROWS).flat_map(|r| (0..WIDTH).map(move |k| (r, k))).map(|(r, k)| force(r, k)).collect();
        let (std, level) = (system.noise_std, [None; 2]);
        let (z, groups) = (&sample.z, &groups);
        let measured =
            Measurement { z, std: &std, excluded: &excluded, strict: &[false; 2], direction_tests: &level, groups };
        filter.update(&system, &(), &mut belief, measured, OPEN, &mut info).unwrap();
        let mut slopes: Vec<f64> = s.transpose().as_slice().to_vec();
        filter.carry(&forces, &[], &mut carried, &mut slopes);

        let mut used = *z;
        for (part, _) in groups.parts.iter().zip(excluded).filter(|(_, excluded)| *excluded) {
            used[part.clone()].fill(f64::NAN);
        }
        let (h, _, noise) = system.seen(&used, &DVector::zeros(STATES));
        let kept: Vec<usize> = (0..ROWS).filter(|&r| !used[r].is_nan()).collect();
        let p = matrix(&before.covariance);
        let gain = &p * h.transpose() * (&h * &p * h.transpose() + noise).try_inverse().unwrap();
        let expected = &s - &gain * (&h * &s + f.select_rows(&kept));
        for i in 0..STATES {
            (0..WIDTH).for_each(|k| worst = worst.max((slopes[i * WIDTH + k] - expected[(i, k)]).abs()));
        }
    }
    worst
}

#[test]
fn derivatives_of_the_mean_follow_the_gain() {
    for make in [Filter::new as Make, Filter::extended] {
        let worst = worst(make);
        assert!(worst < SAME, "{worst:.1e}");
    }
}
