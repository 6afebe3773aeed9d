//! The posture that explains readings best, and others that they allow as well.
//!
//! A fit from one guess may end in a valley that is not the right one, so several are tried until one explains the readings in a posture for
//! a body; limits of joints tell mirror images apart.
//! Where a link carries no sensor, two points a link apart are told and what lies between them can bend to either side: two postures fit the
//! first samples alike, or nearly so, and only movement tells which one it is. Both are tracked until it has.

use super::Tracker;
use crate::body::{Body, Moment};
use crate::estimate::start::{Fit, Prior, StartFit, StartSample};
use crate::model::{Axis, JointKind};

/// A cost per reading below which other guesses need not be tried.
const GOOD_COST: f64 = 2.0;
/// So far beyond its limits, as a share of what lies between them, hardly a joint stands: that is one standard deviation.
const CONTORTED: f64 = 0.25;
/// Times the noise before it counts as it is: first straight from each guess, then, if nothing good was found, sharpening. Sensors are
/// some thousand times finer than what is known of a posture at first.
const BLURS: [&[f64]; 2] = [&[], &[1000.0, 100.0, 10.0]];
/// A hinge that the first samples tell no better than this may bend the other way as well, rad.
const UNCERTAIN_STD: f64 = 0.02;
/// A cost per reading beyond which a fit explains nothing, and postures are tried anywhere.
const ASTRAY_COST: f64 = 30.0;
/// A contorted posture must explain the readings so much better than one that is not.
const CONTORTED_COSTS: f64 = 10.0;
/// How many other postures of doubtful hinges are tried, spread evenly between their limits.
const TRIES: usize = 16;
/// Postures whose hinges are this close are one, rad.
const SAME: f64 = 0.15;
/// A posture whose fit costs so much more is none: it is e^-10 times as likely.
const HOPELESS: f64 = 20.0;
/// A fit goes on while that lowers its cost by more than this: a thousandth of what one reading may cost.
const NO_GAIN: f64 = 1e-3;
/// How often it goes on at most.
const MOST_REFITS: usize = 25;

/// What was found, from which guess, and whether it explains the readings in a posture for a body.
pub(super) struct Found<'a> {
    pub(super) fit: Fit,
    pub(super) guess: &'a Prior,
    pub(super) good: bool,
}

impl Tracker {
    /// The first good fit from these starts, each with what is known before; else from starts scattered between all limits; else the one
    /// that costs least.
    pub(super) fn seek<'a>(
        &self,
        evidence: &[StartSample<Moment>],
        starts: &[(&'a Prior, Vec<f64>)],
    ) -> Option<Found<'a>> {
        let hinges: Vec<(&Axis, usize)> = self.free_hinges().collect();
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
            let mut problem = StartFit::new(&self.body, evidence, &self.std, guess);
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

    /// Whether a fit explains the readings in a posture for a body.
    pub(super) fn is_good(&self, fit: &Fit, evidence: &[StartSample<Moment>]) -> bool {
        fit.mean.iter().all(|x| x.is_finite())
            && fit.cost < GOOD_COST * readings(evidence)
            && !self.is_contorted(&fit.mean)
    }

    /// Cost, and more of it for a posture that is none for a body.
    fn rank(&self, fit: &Fit) -> f64 {
        fit.cost * if self.is_contorted(&fit.mean) { CONTORTED_COSTS } else { 1.0 }
    }

    /// Whether a hinge stands where hardly a body gets it: readings may as well come from the mirror image of a posture, in which hinges in
    /// a row reach the same place from the other side.
    pub(super) fn is_contorted(&self, mean: &[f64]) -> bool {
        self.free_hinges().any(|(axis, q)| beyond(axis, mean[q]) > CONTORTED)
    }

    /// The same with every hinge that is beyond its limits in the middle of them.
    fn eased(&self, mean: &[f64]) -> Vec<f64> {
        let mut eased = mean.to_vec();
        for (axis, q) in self.free_hinges().filter(|(axis, q)| beyond(axis, mean[*q]) > 0.0) {
            eased[q] = 0.5 * (axis.limits[0] + axis.limits[1]);
        }
        eased
    }

    /// A fit, or a better one of another posture, and those others that are nearly as good, each in a valley of its own.
    pub(super) fn all_postures(&self, problem: &mut StartFit<Body>, fit: Fit) -> (Fit, Vec<Fit>) {
        let std = |q: usize| fit.covariance.at(q, q).sqrt();
        let doubtful: Vec<(&Axis, usize)> = self.free_hinges().filter(|(_, q)| std(*q) > UNCERTAIN_STD).collect();
        // A hinge that only walks is told by loops alone, and hardly ever well at the first sample.
        let driven = |q: usize| self.body.moving().any(|(_, _, slots)| slots.q == q && slots.rates.is_some());
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

    /// Whether a fit from halfway between two falls to one of them: in a valley that nothing measures it stays where it is.
    fn is_apart(&self, problem: &mut StartFit<Body>, a: &Fit, b: &Fit) -> bool {
        let halfway: Vec<f64> = a.mean.iter().zip(&b.mean).map(|(a, b)| 0.5 * (a + b)).collect();
        let fell = problem.fit(&halfway);
        fell.is_some_and(|f| !self.differ(&f.mean, &a.mean) || !self.differ(&f.mean, &b.mean))
    }

    /// Whether two states are of different postures of the hinges.
    pub(super) fn differ(&self, a: &[f64], b: &[f64]) -> bool {
        self.free_hinges().any(|(axis, q)| (axis.nearest(a[q]) - axis.nearest(b[q])).abs() > SAME)
    }

    /// Hinges that no encoder reads, and their states.
    pub(super) fn free_hinges(&self) -> impl Iterator<Item = (&Axis, usize)> + '_ {
        let joints = self.body.model.joints.iter();
        let hinges = joints.filter(|j| j.kind == JointKind::Hinge && !self.is_encoded(&j.name));
        hinges.filter_map(|j| Some((&self.body.axes[j.first], self.body.layout.coordinates[j.first]?.q)))
    }
}

/// How many there are.
fn readings(evidence: &[StartSample<Moment>]) -> f64 {
    evidence.iter().flat_map(|e| e.z).filter(|z| !z.is_nan()).count() as f64
}

/// How far an angle is beyond a hinge's limits, as a share of what lies between them; negative inside.
fn beyond(axis: &Axis, angle: f64) -> f64 {
    let [low, high] = axis.limits;
    ((axis.nearest(angle) - 0.5 * (low + high)).abs() / (high - low)) - 0.5
}

/// The same with these hinges elsewhere between their limits: number k of points that fill every dimension evenly (Kronecker 1884; 3, 7, 11 ...
/// are no squares).
fn scattered(mean: &[f64], hinges: &[(&Axis, usize)], k: usize) -> Vec<f64> {
    let mut elsewhere = mean.to_vec();
    for (d, (axis, q)) in hinges.iter().enumerate() {
        let share = (k as f64 * (3.0 + 4.0 * d as f64).sqrt()).fract();
        elsewhere[*q] = axis.limits[0] + share * (axis.limits[1] - axis.limits[0]);
    }
    elsewhere
}

/// Goes on from a fit that may only have crept along a valley, until that gains nothing.
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
