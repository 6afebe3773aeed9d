//! Samples as they come from broken cables, wrong units and other clocks.

use oarlock::estimate::belief::Belief;
use oarlock::recording::Sample;
use oarlock::track::{Status, Tracker};
use oarlock::Error;
use proptest::prelude::*;

/// Finite, with variances.
pub fn is_sound(belief: &Belief) -> bool {
    let mut variances = (0..belief.mean.len()).map(|i| belief.covariance.at(i, i));
    belief.mean.iter().all(|x| x.is_finite()) && variances.all(|v| v > 0.0 && v.is_finite())
}

/// Numbers of any size, and what is no number.
pub fn odd() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -20.0..20.0_f64,
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(f64::NEG_INFINITY),
        1 => Just(0.0),
        2 => any::<f64>(),
        1 => (-300.0..300.0_f64).prop_map(|e| 10_f64.powf(e)),
    ]
}

/// Mostly a next stamp, at times one from another clock.
pub fn odd_time() -> impl Strategy<Value = f64> {
    prop_oneof![6 => 0.0..0.3_f64, 1 => Just(0.0), 1 => Just(-0.5), 1 => 0.0..1e5_f64, 1 => odd()]
}

/// Samples of so many rows and inputs, each of which `values` draws.
pub fn odd_samples(
    values: impl Strategy<Value = f64>,
    inputs: impl Strategy<Value = f64>,
    [rows, coordinates]: [usize; 2],
) -> impl Strategy<Value = Vec<Sample>> {
    let sample = (odd_time(), prop::collection::vec(values, rows), prop::collection::vec(inputs, coordinates));
    prop::collection::vec(sample, 1..25).prop_map(|samples| {
        let mut clock = 0.0;
        let one = |(step, z, inputs): (f64, Vec<f64>, Vec<f64>)| {
            let time_s = clock + step;
            clock = if time_s.is_finite() { time_s } else { clock };
            Sample { time_s, z, inputs, offset_s: Vec::new() }
        };
        samples.into_iter().map(one).collect()
    })
}

/// Steps through and checks that whatever was taken in left a belief that is sound.
pub fn step_through(tracker: &mut Tracker, samples: &[Sample], is_sound: fn(&Tracker) -> bool) {
    for sample in samples {
        match tracker.step(sample) {
            Ok(Status::Tracking) => assert!(is_sound(tracker), "{:?}", tracker.belief()),
            Ok(_) | Err(Error::Diverged { .. } | Error::Data(_)) => {}
            Err(other) => panic!("{other}"),
        }
    }
}
