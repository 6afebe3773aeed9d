//! A damped oscillator that implements what `System` requires and nothing more; every filter of it is Kalman's.

use super::support::chance::Chance;
use super::support::textbook::Worst;
use super::{OPEN, SAME_SIGMA};
use nalgebra::{DMatrix, DVector, Matrix2, RowVector2, Vector2};
use oarlock::estimate::belief::Belief;
use oarlock::estimate::filter::{Filter, Info, Measurement, RowGroups};
use oarlock::estimate::transition::{Block, Transition};
use oarlock::estimate::{FastSystem, Partition, Points, System};
use oarlock::kernels::dense::Square;
use oarlock::kernels::lane::{Lane, Real};

/// Natural frequency, rad/s, and decay, 1/s.
const OMEGA: f64 = 3.0;
const DECAY: f64 = 0.2;
const PROCESS_VARIANCE: [f64; 2] = [1e-4, 4e-3];
const START_VARIANCE: [f64; 2] = [0.5, 2.0];
/// Half the deflection and a third of the velocity are measured together, with this standard deviation.
const READS: [f64; 2] = [0.5, 1.0 / 3.0];
const STD: f64 = 0.05;

struct Oscillator;

fn motion(t: f64) -> [[f64; 2]; 2] {
    let damped = (OMEGA * OMEGA - DECAY * DECAY).sqrt();
    let (sin, cos) = (damped * t).sin_cos();
    let (s, keep) = (sin / damped, (-DECAY * t).exp());
    [[keep * (cos + DECAY * s), keep * s], [-keep * OMEGA * OMEGA * s, keep * (cos - DECAY * s)]]
}

impl System for Oscillator {
    type Moment = ();
    type Scratch = ();

    fn partition(&self) -> Partition {
        Partition { pose: 1, rate: 1, linear: 0 }
    }

    fn row_count(&self) -> usize {
        1
    }

    fn scratch(&self) {}

    fn transition(&self, dt: f64, _: &[f64], _: &[f64], out: &mut Transition) {
        let [position, velocity] = motion(dt);
        let mut block = Block::walk(0, PROCESS_VARIANCE[0]);
        (block.index, block.len) = ([0, 1, 1], 2);
        block.factor = [[position[0], position[1], 0.0], [velocity[0], velocity[1], 0.0], [0.0; 3]];
        block.noise[1][1] = PROCESS_VARIANCE[1];
        out.clear();
        out.blocks.push(block);
    }

    fn readings(&self, _: &(), _: &mut (), at: Points, out: &mut [Lane]) {
        out[0] = at.at(0).scale(READS[0]) + at.at(1).scale(READS[1]);
    }

    fn linearise(&self, _: &(), _: &mut (), mean: &[f64], center: &mut [f64], jacobian: &mut [f64]) {
        center[0] = READS[0] * mean[0] + READS[1] * mean[1];
        jacobian.copy_from_slice(&READS);
    }
}

impl FastSystem for Oscillator {}

fn start() -> Belief {
    let [x, v] = START_VARIANCE;
    Belief {
        mean: vec![1.0, 0.0],
        covariance: Square::from_rows(2, vec![x, 0.0, 0.0, v]).expect("square"),
        rejected_since_s: vec![f64::NAN],
        ..super::start()
    }
}

#[test]
fn a_system_needs_six_methods() {
    assert_is_kalmans("unscented", Filter::new);
    assert_is_kalmans("extended", Filter::extended);
    assert_is_kalmans("factorised", Filter::factorised);
}

fn assert_is_kalmans(what: &str, make: fn(&Oscillator, &RowGroups) -> Filter<Oscillator>) {
    let one = || std::iter::once(0..1).collect::<Vec<_>>();
    let groups = RowGroups { parts: one(), sources: one(), inertial: vec![] };
    let (mut filter, mut info) = (make(&Oscillator, &groups), Info::new(&groups, 1));
    let (mut belief, mut chance, mut transition) = (start(), Chance::new(7), Transition::default());
    let (mut mean, mut covariance) = (Vector2::new(1.0, 0.0), Matrix2::from_diagonal(&START_VARIANCE.into()));
    let (h, q) = (RowVector2::from(READS), Matrix2::from_diagonal(&PROCESS_VARIANCE.into()));
    let mut worst = Worst::default();
    for _ in 0..300 {
        let dt = chance.between(0.02, 0.3);
        let to_s = belief.time_s + dt;
        filter.predict(&Oscillator, &mut belief, to_s, &mut transition);
        let [position, velocity] = motion(dt);
        let f = Matrix2::new(position[0], position[1], velocity[0], velocity[1]);
        (mean, covariance) = (f * mean, f * covariance * f.transpose() + q);
        let z = [chance.normal()];
        let measured = Measurement {
            z: &z,
            std: &[STD],
            excluded: &[false],
            strict: &[false],
            direction_tests: &[None],
            groups: &groups,
        };
        filter.update(&Oscillator, &(), &mut belief, measured, OPEN, &mut info).unwrap();
        let variance = (h * covariance * h.transpose())[0] + STD * STD;
        let gain = covariance * h.transpose() / variance;
        mean += gain * (z[0] - (h * mean)[0]);
        covariance -= gain * variance * gain.transpose();
        let away = DVector::from_fn(2, |i, _| belief.mean[i] - mean[i]);
        worst.see(&belief, &away, &DMatrix::from_column_slice(2, 2, covariance.as_slice()));
    }
    worst.assert_below(&format!("{what} filter of an oscillator against Kalman's"), SAME_SIGMA);
}
