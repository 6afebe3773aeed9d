//! Finds the posture that fits the readings best, and alternative postures that fit nearly as well. `begin` uses it.
//!
//! A fit from one guess may end in a wrong local minimum, so several guesses are tried until one explains the readings
//! in a plausible posture. Joint limits distinguish mirrored postures. If a link carries no sensor, the chain between
//! its neighbours can bend to either side: two postures fit the first samples about equally well, and only motion
//! distinguishes them. Both are tracked until then.

use super::subject::Subject;
use crate::body::{three, Body, Moment};
use crate::estimate::start::{Fit, Prior, StartFit, StartSample};
use crate::model::Axis;

/// Cost per reading below which no further guesses are tried.
const GOOD_COST: f64 = 2.0;
/// Excess over the limits, as a share of their range, that counts as one standard deviation.
const CONTORTED: f64 = 0.25;
/// Factors on the noise: first 1 from each guess; if no fit is good, from large to 1. Sensors are about a thousand
/// times more precise than the first guess of a posture.
const BLURS: [&[f64]; 2] = [&[], &[1000.0, 100.0, 10.0]];
/// A hinge with a larger standard deviation after the first samples may also bend the other way, rad.
const UNCERTAIN_STD: f64 = 0.02;
/// Cost per reading above which a fit explains nothing, and random postures are tried.
const ASTRAY_COST: f64 = 30.0;
/// Factor by which a posture beyond its limits must fit better than one inside.
const CONTORTED_COSTS: f64 = 10.0;
/// Number of alternative postures of uncertain hinges, evenly spread between their limits.
const TRIES: usize = 16;
/// Postures with all hinges closer than this are the same, rad.
const SAME: f64 = 0.15;
/// A posture with this much more cost is discarded: it is e^-10 times as likely.
const HOPELESS: f64 = 20.0;
/// A fit continues while its cost falls by more than this: a thousandth of the limit for one reading.
const NO_GAIN: f64 = 1e-3;
/// Largest number of continuations.
const MOST_REFITS: usize = 25;

/// A fit, the index of its guess, and whether it explains the readings in a plausible posture.
pub(super) struct Found<'a> {
    pub(super) fit: Fit,
    pub(super) guess: &'a Prior,
    pub(super) good: bool,
}

/// Search for postures of a subject.
#[derive(Debug, Clone, Copy)]
pub(super) struct Postures<'s> {
    pub(super) subject: &'s Subject,
}

impl Postures<'_> {
    /// The first good fit from these guesses, each with its prior; otherwise from guesses spread between all limits;
    /// otherwise the fit with the lowest cost.
    pub(super) fn seek<'a>(
        &self,
        evidence: &[StartSample<Moment>],
        starts: &[(&'a Prior, Vec<f64>)],
    ) -> Option<Found<'a>> {
        let hinges: Vec<(&Axis, usize)> = self.subject.free_hinges().collect();
        let mut best: Option<Found> = None;
        let given =
            BLURS.iter().flat_map(|blurs| starts.iter().map(move |(guess, from)| (*blurs, *guess, from.clone())));
        let hinges = &hinges;
        let anywhere = starts.iter().take(1).flat_map(|(guess, from)| {
            (1..=TRIES).map(move |k| (BLURS[BLURS.len() - 1], *guess, scattered(from, hinges, k)))
        });
        for (k, (blurs, guess, from)) in given.chain(anywhere).enumerate() {
            let astray = best.as_ref().is_none_or(|b| self.rank(&b.fit) > ASTRAY_COST * readings(evidence));
            if k >= BLURS.len() * starts.len() && !astray {
                break;
            }
            let mut problem = StartFit::new(&self.subject.body, evidence, &self.subject.std, guess);
            let first = problem.fit_with_decreasing_noise(&from, blurs);
            let contorted = first.as_ref().filter(|fit| self.is_contorted(&fit.mean));
            let eased = contorted.and_then(|fit| problem.fit_with_decreasing_noise(&self.eased(&fit.mean), blurs));
            for fit in [first, eased].into_iter().flatten().filter(|fit| fit.mean.iter().all(|x| x.is_finite())) {
                let good = self.is_good(&fit, evidence);
                if good || best.as_ref().is_none_or(|b| self.rank(&fit) < self.rank(&b.fit)) {
                    best = Some(Found { fit, guess, good });
                }
                if good {
                    return best;
                }
            }
        }
        best
    }

    /// Whether a fit explains the readings in a plausible posture.
    pub(super) fn is_good(&self, fit: &Fit, evidence: &[StartSample<Moment>]) -> bool {
        fit.mean.iter().all(|x| x.is_finite())
            && fit.cost < GOOD_COST * readings(evidence)
            && !self.is_contorted(&fit.mean)
    }

    /// Cost with a penalty for an implausible posture.
    fn rank(&self, fit: &Fit) -> f64 {
        fit.cost * if self.is_contorted(&fit.mean) { CONTORTED_COSTS } else { 1.0 }
    }

    /// Whether a hinge, or a ball with a cone, is far beyond its limits. The fit may then be a mirrored posture, in which
    /// consecutive joints reach the same position from the other side.
    pub(super) fn is_contorted(&self, mean: &[f64]) -> bool {
        let bent = self.subject.free_hinges().any(|(axis, q)| beyond(axis, mean[q]) > CONTORTED);
        bent || self.subject.coned_balls().any(|(ball, q)| ball.beyond(three(mean, q)).share() > CONTORTED)
    }

    /// The same posture with every hinge beyond its limits moved to their middle, and every such ball to its rest.
    fn eased(&self, mean: &[f64]) -> Vec<f64> {
        let mut eased = mean.to_vec();
        for (ball, q) in self.subject.coned_balls().filter(|(ball, q)| ball.beyond(three(mean, *q)).angle > 0.0) {
            eased[q..q + 3].copy_from_slice(&ball.rest);
        }
        for (axis, q) in self.subject.free_hinges().filter(|(axis, q)| beyond(axis, mean[*q]) > 0.0) {
            eased[q] = 0.5 * (axis.limits[0] + axis.limits[1]);
        }
        eased
    }

    /// A fit, or a better one in another posture, and the alternatives that are nearly as good, each a local minimum of
    /// its own.
    pub(super) fn all_postures(&self, problem: &mut StartFit<Body>, fit: Fit) -> (Fit, Vec<Fit>) {
        let std = |q: usize| fit.covariance.at(q, q).sqrt();
        let doubtful: Vec<(&Axis, usize)> =
            self.subject.free_hinges().filter(|(_, q)| std(*q) > UNCERTAIN_STD).collect();
        // Only closures determine a random-walk hinge, and the first sample rarely does so well.
        let driven = |q: usize| self.subject.body.moving().any(|(_, _, slots)| slots.q == q && slots.rates.is_some());
        if !doubtful.iter().any(|(_, q)| driven(*q)) {
            return (fit, Vec::new());
        }
        let mut best = patiently(problem, fit);
        let mut others: Vec<Fit> = Vec::new();
        for k in 1..=TRIES {
            let fitted = problem.fit(&scattered(&best.mean, &doubtful, k)).map(|other| patiently(problem, other));
            let Some(other) = fitted.filter(|o| o.cost < best.cost + HOPELESS && !self.is_contorted(&o.mean)) else {
                continue;
            };
            let apart = self.differ(&best.mean, &other.mean) && self.is_apart(problem, &best, &other);
            let worse = if other.cost < best.cost { std::mem::replace(&mut best, other) } else { other };
            if apart && others.iter().all(|o| self.differ(&o.mean, &worse.mean)) {
                others.push(worse);
            }
        }
        others.retain(|o| self.differ(&o.mean, &best.mean) && o.cost < best.cost + HOPELESS);
        (best, others)
    }

    /// Whether a fit from halfway between two returns to one of them. In a direction that nothing measures it stays
    /// where it is.
    fn is_apart(&self, problem: &mut StartFit<Body>, a: &Fit, b: &Fit) -> bool {
        let halfway: Vec<f64> = a.mean.iter().zip(&b.mean).map(|(a, b)| 0.5 * (a + b)).collect();
        let fell = problem.fit(&halfway);
        fell.is_some_and(|f| !self.differ(&f.mean, &a.mean) || !self.differ(&f.mean, &b.mean))
    }

    /// Whether two states differ in the posture of the hinges.
    pub(super) fn differ(&self, a: &[f64], b: &[f64]) -> bool {
        self.subject.free_hinges().any(|(axis, q)| (axis.nearest(a[q]) - axis.nearest(b[q])).abs() > SAME)
    }
}

/// Number of distinct postures.
fn readings(evidence: &[StartSample<Moment>]) -> f64 {
    evidence.iter().flat_map(|e| e.z).filter(|z| !z.is_nan()).count() as f64
}

/// Excess of an angle over a hinge's limits, as a share of their range; negative inside.
fn beyond(axis: &Axis, angle: f64) -> f64 {
    let [low, high] = axis.limits;
    ((axis.nearest(angle) - 0.5 * (low + high)).abs() / (high - low)) - 0.5
}

/// Other values of these hinges between their limits: point number k of a sequence that fills every dimension evenly
/// (Kronecker 1884; the numbers 3, 7, 11 ... are no squares).
fn scattered(mean: &[f64], hinges: &[(&Axis, usize)], k: usize) -> Vec<f64> {
    let mut elsewhere = mean.to_vec();
    for (d, (axis, q)) in hinges.iter().enumerate() {
        let share = (k as f64 * (3.0 + 4.0 * d as f64).sqrt()).fract();
        elsewhere[*q] = axis.limits[0] + share * (axis.limits[1] - axis.limits[0]);
    }
    elsewhere
}

/// Continues a fit that may have converged slowly along a narrow valley, until its cost no longer falls.
fn patiently(problem: &mut StartFit<Body>, fit: Fit) -> Fit {
    let mut best = fit;
    for _ in 0..MOST_REFITS {
        match problem.fit(&best.mean) {
            Some(next) if next.cost < best.cost - NO_GAIN => best = next,
            _ => break,
        }
    }
    best
}
