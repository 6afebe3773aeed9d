//! Whatever comes in, a step of a body with balls ends with an answer.

use super::hypotheses::{Pair, PAIR};
use super::support::tree::TREE;
use super::support::{belief, body, model, start_std};
use oarlock::config::Config;
use oarlock::estimate::belief::Belief;
use oarlock::model::Model;
use oarlock::recording::Sample;
use oarlock::track::{Calibration, Status, Tracker};
use oarlock::Error;
use proptest::prelude::*;
use std::sync::Arc;

fn tracker(model: &Arc<Model>, config: &Config) -> Tracker {
    Tracker::new(model.clone(), &Calibration::default(), config).unwrap()
}

/// Finite, with variances, and rotation vectors no longer than half a turn.
fn is_sound(tracker: &Tracker, belief: &Belief) -> bool {
    let n = belief.mean.len();
    let variances = (0..n).map(|i| belief.covariance.at(i, i));
    let turns = tracker.body.layout.turns.iter();
    let length = |q: usize| belief.mean[q..q + 3].iter().map(|x| x * x).sum::<f64>().sqrt();
    belief.mean.iter().all(|x| x.is_finite())
        && variances.into_iter().all(|v| v > 0.0 && v.is_finite())
        && turns.into_iter().all(|(_, slots)| length(slots.q) < std::f64::consts::PI + 1e-9)
        && belief.rivals.iter().all(|rival| rival.rivals.is_empty() && is_sound(tracker, rival))
}

/// Numbers as they come from broken cables and wrong units.
fn odd() -> impl Strategy<Value = f64> {
    prop_oneof![
        5 => -20.0..20.0_f64,
        1 => Just(f64::NAN),
        1 => Just(0.0),
        1 => any::<f64>(),
        1 => (-300.0..300.0_f64).prop_map(|e| 10_f64.powf(e)),
    ]
}

/// Mostly a next stamp, at times one from another clock.
fn odd_time() -> impl Strategy<Value = f64> {
    prop_oneof![6 => 0.0..0.3_f64, 1 => Just(0.0), 1 => Just(-0.5), 1 => 0.0..1e5_f64, 1 => odd()]
}

fn odd_samples(rows: usize, inputs: usize) -> impl Strategy<Value = Vec<Sample>> {
    let sample = (odd_time(), prop::collection::vec(odd(), rows));
    prop::collection::vec(sample, 1..20).prop_map(move |samples| {
        let mut clock = 0.0;
        let one = |(step, z): (f64, Vec<f64>)| {
            let time_s = clock + step;
            clock = if time_s.is_finite() { time_s } else { clock };
            Sample { time_s, z, inputs: vec![f64::NAN; inputs] }
        };
        samples.into_iter().map(one).collect()
    })
}

fn step_through(tracker: &mut Tracker, samples: &[Sample]) {
    for sample in samples {
        match tracker.step(sample) {
            Ok(Status::Tracking) => assert!(is_sound(tracker, tracker.belief().unwrap())),
            Ok(_) | Err(Error::Diverged { .. } | Error::Data(_)) => {}
            Err(other) => panic!("{other}"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 30, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    #[ignore = "long"]
    fn absurd_samples_are_answered(samples in odd_samples(31, 11), gate in any::<bool>()) {
        let model = model(TREE);
        let config = Config { gate, ..Config::default() };
        step_through(&mut tracker(&model, &config), &samples);
        let mut resumed = tracker(&model, &config);
        let body = body(&model, &config);
        let start = belief(&body, 0.0, vec![0.0; body.layout.dim()], &start_std(&body));
        resumed.resume(start).unwrap();
        step_through(&mut resumed, &samples);
    }

    #[test]
    fn absurd_samples_without_a_compass_are_answered(samples in odd_samples(12, 6), gate in any::<bool>()) {
        let config = Config { gate, ..Config::default() };
        step_through(&mut tracker(&model(PAIR), &config), &samples);
    }

    /// Hypotheses are alive when the absurdities begin.
    #[test]
    #[ignore = "long"]
    fn absurd_samples_among_hypotheses_are_answered(samples in odd_samples(12, 6), after in 11_usize..40, gate in any::<bool>()) {
        let mut pair = Pair::new(2.0, 1);
        pair.config.gate = gate;
        let mut tracker = pair.tracker();
        let sane = pair.samples(0.5);
        step_through(&mut tracker, &sane[..after]);
        let from = sane[after].time_s;
        let later: Vec<Sample> = samples.into_iter().map(|s| Sample { time_s: s.time_s + from, ..s }).collect();
        step_through(&mut tracker, &later);
    }
}

/// Readings of any size while hypotheses compete, with nothing that would refuse them.
#[test]
fn huge_readings_do_not_break_the_contest() {
    let mut pair = Pair::new(2.0, 1);
    pair.config.gate = false;
    let samples = pair.samples(0.5);
    let mut tracker = pair.tracker();
    step_through(&mut tracker, &samples[..15]);
    assert!(tracker.belief().unwrap().rivals.len() > 3);
    for exponent in 0..300 {
        for row in [0, 4, 8, 11] {
            let mut tracker = tracker.clone();
            let mut sample = samples[15].clone();
            sample.z[row] = 10_f64.powi(exponent);
            step_through(&mut tracker, &[sample, samples[16].clone()]);
        }
    }
}

/// What a belief brings along must fit as well as itself.
#[test]
fn rivals_of_another_model_are_refused() {
    let pair = Pair::new(2.0, 1);
    let mut tracker = pair.tracker();
    let samples = pair.samples(0.3);
    step_through(&mut tracker, &samples[..15]);
    let good = tracker.belief().unwrap().clone();
    assert!(good.rivals.len() > 3);
    let mut short = good.clone();
    short.rivals[1].mean.pop();
    let mut broken = good.clone();
    broken.rivals[0].mean[2] = f64::NAN;
    let mut other = good.clone();
    other.rivals[2].seen_s.clear();
    for bad in [short, broken, other] {
        assert!(matches!(pair.tracker().resume(bad), Err(Error::Data(_))));
    }
    assert!(pair.tracker().resume(good).is_ok());
}

/// Nothing said for longer and longer, with single samples between.
#[test]
fn long_gaps_are_survived() {
    let pair = Pair::new(1.0, 1);
    let mut tracker = pair.tracker();
    let samples = pair.samples(2.0);
    let mut shift = 0.0;
    for (k, sample) in samples.iter().enumerate() {
        if k % 25 == 24 {
            shift += 10_f64.powi((k / 25) as i32 - 2);
        }
        let sample = Sample { time_s: sample.time_s + shift, ..sample.clone() };
        match tracker.step(&sample) {
            Ok(Status::Tracking) => assert!(is_sound(&tracker, tracker.belief().unwrap()), "{k}"),
            Ok(_) | Err(Error::Diverged { .. }) => {}
            Err(other) => panic!("{other}"),
        }
    }
    for time_s in [1e9, 1.7e18, 1e300] {
        let mut tracker = tracker.clone();
        let last = tracker.step(&Sample { time_s, ..samples[100].clone() });
        assert!(matches!(last, Ok(Status::Tracking) | Err(Error::Diverged { .. })), "{last:?}");
    }
}

#[test]
fn nothing_at_all_is_no_number_short() {
    for text in [TREE, PAIR] {
        let model = model(text);
        let mut tracker = tracker(&model, &Config::default());
        for k in 0..300 {
            let sample = Sample { time_s: 0.05 * f64::from(k), ..tracker.empty_sample() };
            match tracker.step(&sample).unwrap() {
                Status::Tracking => assert!(is_sound(&tracker, tracker.belief().unwrap()), "{k}"),
                other => assert!(other == Status::Starting, "{k}: {other:?}"),
            }
        }
    }
}
