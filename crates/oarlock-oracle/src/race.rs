//! Times the engine's filters and the textbook filter in turn on the same machine.

use super::ukf::Ukf;
use oarlock::recording::Sample;
use oarlock::track::Tracker;
use oarlock::{Config, Error};
use std::hint::black_box;
use std::time::Instant;

/// Consecutive steps of each tracker, as in use; and of the textbook filter, which is slower.
const STRETCH: usize = 25;
const TEXTBOOK_STRETCH: usize = 3;

/// Duration of every step, us.
pub struct Times {
    /// Per tracker.
    pub ours: Vec<Vec<f64>>,
    /// The textbook's unscented filter.
    pub textbook: Vec<f64>,
}

/// Steps all `trackers`, which must be running, over `samples`, repeatedly from their present state, until `goes_on`
/// returns false. The textbook filter runs the first steps of every stretch from the first tracker's state estimate.
/// The time to build it does not count.
pub fn race(
    trackers: &[Tracker],
    config: &Config,
    samples: &[Sample],
    goes_on: &mut dyn FnMut() -> bool,
) -> Result<Times, Error> {
    let mut times = Times { ours: vec![Vec::new(); trackers.len()], textbook: Vec::new() };
    loop {
        let mut running = trackers.to_vec();
        for stretch in samples.chunks(STRETCH) {
            if let Some(first) = running.first() {
                textbook_steps(first, config, stretch, &mut times.textbook);
            }
            for (tracker, spent) in running.iter_mut().zip(&mut times.ours) {
                for sample in stretch {
                    let (us, done) = timed(|| tracker.step(black_box(sample)));
                    done?;
                    spent.push(us);
                }
            }
            if !goes_on() {
                return Ok(times);
            }
        }
    }
}

fn textbook_steps(from: &Tracker, config: &Config, samples: &[Sample], spent: &mut Vec<f64>) {
    let (Some(belief), body) = (from.belief(), from.body()) else {
        return;
    };
    let (std, spread) = (body.suite.std(), [config.alpha, config.beta, config.kappa]);
    let (mean, covariance) = (&belief.mean, belief.covariance.as_slice());
    let mut plain = Ukf::of_model(&body.model, &body.layout.names, mean, covariance, spread);
    let mut before_s = belief.time_s;
    for sample in samples.iter().take(TEXTBOOK_STRETCH) {
        let z = with_loops(from, config, sample);
        let (us, ()) = timed(|| {
            plain.predict(sample.time_s - before_s);
            plain.update(black_box(&z), &std, &sample.inputs);
        });
        before_s = sample.time_s;
        spent.push(us);
    }
}

/// Readings with zeros for the closures, if these are in use.
fn with_loops(tracker: &Tracker, config: &Config, sample: &Sample) -> Vec<f64> {
    let (mut z, sources) = (sample.z.clone(), &tracker.body().suite.sources);
    if config.closures {
        let loops = sources.len() - tracker.body().model.closures.len();
        sources[loops..].iter().for_each(|source| z[source.rows.clone()].fill(0.0));
    }
    z
}

/// The result of `run` and its duration, us.
pub fn timed<T>(run: impl FnOnce() -> T) -> (f64, T) {
    let begun = Instant::now();
    let done = run();
    (1e6 * begun.elapsed().as_secs_f64(), done)
}

/// The given quantile; NaN without values.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = share * sorted.len().saturating_sub(1) as f64;
    sorted.get(place.round() as usize).copied().unwrap_or(f64::NAN)
}
