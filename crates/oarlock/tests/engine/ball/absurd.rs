//! Whatever comes in, a step of a body with balls ends with an answer.

use super::hypotheses::{Pair, PAIR};
use super::support::tree::TREE;
use super::support::{absurd, body, model, start_std, started, tracker};
use oarlock::config::Config;
use oarlock::recording::Sample;
use oarlock::track::hypothesis::Hypothesis;
use oarlock::track::{Status, Tracker};
use oarlock::Error;
use proptest::prelude::*;

/// With rotation vectors no longer than half a turn.
fn is_sound(tracker: &Tracker, one: &Hypothesis) -> bool {
    let turns = tracker.body().layout.turns.iter();
    let length = |q: usize| one.belief.mean[q..q + 3].iter().map(|x| x * x).sum::<f64>().sqrt();
    absurd::is_sound(&one.belief)
        && turns.into_iter().all(|(_, slots)| length(slots.q) < std::f64::consts::PI + 1e-9)
        && one.rivals.iter().all(|rival| rival.rivals.is_empty() && is_sound(tracker, rival))
}

/// Without infinities, which are refused at once, and with nothing for inputs.
fn odd_samples(size: [usize; 2]) -> impl Strategy<Value = Vec<Sample>> {
    let finite = absurd::odd().prop_map(|x| if x.is_infinite() { 0.0 } else { x });
    absurd::odd_samples(finite, Just(f64::NAN), size)
}

fn step_through(tracker: &mut Tracker, samples: &[Sample]) {
    absurd::step_through(tracker, samples, |tracker| is_sound(tracker, tracker.hypothesis().unwrap()));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 30, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    #[ignore = "long"]
    fn absurd_samples_are_answered(samples in odd_samples([31, 11]), gate in any::<bool>()) {
        let model = model(TREE);
        let config = Config { gate, ..Config::default() };
        step_through(&mut tracker(&model, &config), &samples);
        let body = body(&model, &config);
        step_through(&mut started(&body, &config, vec![0.0; body.layout.dim()], &start_std(&body)), &samples);
    }

    #[test]
    fn absurd_samples_without_a_compass_are_answered(samples in odd_samples([12, 6]), gate in any::<bool>()) {
        let config = Config { gate, ..Config::default() };
        step_through(&mut tracker(&model(PAIR), &config), &samples);
    }

    /// Hypotheses are alive when the absurdities begin.
    #[test]
    #[ignore = "long"]
    fn absurd_samples_among_hypotheses_are_answered(samples in odd_samples([12, 6]), after in 11_usize..40, gate in any::<bool>()) {
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
    assert!(tracker.hypothesis().unwrap().rivals.len() > 3);
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
    let good = tracker.hypothesis().unwrap().clone();
    assert!(good.rivals.len() > 3);
    let mut short = good.clone();
    short.rivals[1].belief.mean.pop();
    let mut broken = good.clone();
    broken.rivals[0].belief.mean[2] = f64::NAN;
    let mut other = good.clone();
    other.rivals[2].sources.clear();
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
            Ok(Status::Tracking) => assert!(is_sound(&tracker, tracker.hypothesis().unwrap()), "{k}"),
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
                Status::Tracking => assert!(is_sound(&tracker, tracker.hypothesis().unwrap()), "{k}"),
                other => assert!(other == Status::Starting, "{k}: {other:?}"),
            }
        }
    }
}
