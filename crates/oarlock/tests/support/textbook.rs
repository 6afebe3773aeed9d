//! The engine's filter beside a plain one from the textbook, step for step.

use super::chance::Chance;
use super::record::{punch_holes, refer, times, with_loops, Scene};
use super::{belief, start_std, tracker, worse};
use nalgebra::{DMatrix, DVector};
use oarlock::body::Body;
use oarlock::config::Config;
use oarlock::estimate::belief::Belief;
use oarlock::motion::{is_observed, is_turn_observed};
use oarlock::recording::Sample;
use oarlock::track::hypothesis::Hypothesis;
use oarlock::track::Status;
use oarlock_oracle::ukf::Ukf;

/// Rounding differs between the two forms of the same equations, and closures of 2 mm beside accelerations of 5 rad/s2
/// make covariances whose condition number takes about eight of sixteen digits.
pub const SAME_FILTER_SIGMA: f64 = 1e-8;

/// The largest differences from a plain estimate so far, in its standard deviations.
#[derive(Default)]
pub struct Worst {
    pub mean: f64,
    pub covariance: f64,
}

impl Worst {
    /// `away` is the difference of the means, `theirs` the plain covariance.
    pub fn see(&mut self, ours: &Belief, away: &DVector<f64>, theirs: &DMatrix<f64>) {
        let sigma = theirs.diagonal().map(f64::sqrt);
        for i in 0..sigma.len() {
            self.mean = worse(self.mean, away[i].abs() / sigma[i]);
            for j in 0..sigma.len() {
                let gap = (ours.covariance.at(i, j) - theirs[(i, j)]).abs();
                self.covariance = worse(self.covariance, gap / (sigma[i] * sigma[j]));
            }
        }
    }

    pub fn assert_below(&self, what: &str, sigma: f64) {
        println!("{what}: mean {:.2e} sigma, covariance {:.2e} sigma sigma", self.mean, self.covariance);
        assert!(self.mean < sigma, "{what}: mean {:e}", self.mean);
        assert!(self.covariance < sigma, "{what}: covariance {:e}", self.covariance);
    }
}

/// A plain update: the filter, readings with the noise of each, inputs.
pub type Update<'u> = &'u mut dyn FnMut(&mut Ukf, &[f64], &[f64], &[f64]);

pub fn textbook_from<'a>(start: &Belief, body: &'a Body, config: &Config) -> Ukf<'a> {
    let (names, spread) = (&body.layout.names, [config.alpha, config.beta, config.kappa]);
    Ukf::of_model(&body.model, names, &start.mean, start.covariance.as_slice(), spread)
}

/// Both filters from the same start over the samples: how far apart they ever were, and the textbook's at the end. `see` is shown
/// our belief behind every sample.
pub fn side_by_side<'a>(
    body: &'a Body,
    config: &Config,
    start: &Belief,
    samples: &[Sample],
    update: Update,
    see: &mut dyn FnMut(&Belief),
) -> (Worst, Ukf<'a>) {
    let mut tracker = tracker(&body.model, config);
    tracker.resume(Hypothesis::new(start.clone(), body.suite.sources.len())).unwrap();
    let mut textbook = textbook_from(start, body, config);
    let noise = textbook.body.std();
    assert_eq!(noise, body.suite.std());
    let (mut worst, mut before_s) = (Worst::default(), start.time_s);
    for sample in samples {
        textbook.predict(sample.time_s - before_s);
        before_s = sample.time_s;
        let mut z = if config.closures { with_loops(&sample.z, body, &sample.inputs) } else { sample.z.clone() };
        refer(&mut z, body, |name, measured| textbook.body.refer(name, measured));
        update(&mut textbook, &z, &noise, &sample.inputs);
        assert_eq!(tracker.step(sample).unwrap(), Status::Tracking);
        let ours = tracker.belief().unwrap();
        assert_no_spring(body, ours);
        worst.see(ours, &textbook.away(&DVector::from_row_slice(&ours.mean)), &textbook.covariance);
        see(ours);
    }
    (worst, textbook)
}

/// Both filters over `steps` samples at 100 Hz with gaps, from a start that is off by about `share` of its standard
/// deviations: how far apart they ever were, and the textbook's errors at the end.
pub fn run_both(
    scene: &Scene,
    config: &Config,
    steps: usize,
    (share, chance): (f64, &mut Chance),
    update: Update,
) -> (Worst, DVector<f64>) {
    let body = scene.body;
    let mut samples = scene.samples(&times(0.01, 0.01, steps), chance);
    punch_holes(body, &mut samples, chance);
    let std = start_std(body);
    let away = DVector::from_iterator(std.len(), std.iter().map(|s| share * s * chance.normal()));
    let truth = belief(body, 0.0, scene.state(0.0), &std);
    let mean = textbook_from(&truth, body, config).at(&away);
    let start = belief(body, 0.0, mean.as_slice().to_vec(), &std);
    let (worst, textbook) = side_by_side(body, config, &start, &samples, update, &mut |_| {});
    let truth = DVector::from_vec(scene.state(samples[steps - 1].time_s));
    (worst, textbook.away(&truth))
}

/// The textbook's unscented update.
pub fn unscented(textbook: &mut Ukf, z: &[f64], std: &[f64], inputs: &[f64]) {
    textbook.update(z, std, inputs);
}

/// The textbook side knows no spring for joints that nothing observes; none may set in here.
fn assert_no_spring(body: &Body, belief: &Belief) {
    let variance = |q: usize| belief.covariance.at(q, q);
    for (_, axis, slots) in body.moving().filter(|(_, axis, _)| !axis.turns) {
        assert!(is_observed(axis, variance(slots.q)), "{}", body.layout.names[slots.q]);
    }
    for (c, slots) in &body.layout.turns {
        let variances = [0, 1, 2].map(|i| variance(slots.q + i));
        assert!(is_turn_observed(&body.axes[*c..c + 3], &variances), "{}", body.layout.names[slots.q]);
    }
}
