//! Other postures that the first readings allow as well.
//!
//! Where a link carries no sensor, two points a link apart are told and what lies between them can bend to either side: two postures fit the
//! first samples alike, or nearly so, and only movement tells which one it is. Both are tracked until it has.

use super::Tracker;
use crate::body::Body;
use crate::estimate::start::{Fit, Problem};
use crate::model::{Axis, JointKind};

/// A hinge that the first samples tell no better than this may bend the other way as well, rad.
const UNCERTAIN_STD: f64 = 0.02;
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

impl Tracker {
    /// A fit, or a better one of another posture, and those others that are nearly as good, each in a valley of its own.
    pub(super) fn all_postures(&self, problem: &mut Problem<Body>, fit: Fit) -> (Fit, Vec<Fit>) {
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
            let mut from = best.mean.clone();
            for (d, (axis, q)) in doubtful.iter().enumerate() {
                from[*q] = axis.limits[0] + scattered(k, d) * (axis.limits[1] - axis.limits[0]);
            }
            let fitted = problem.fit(&from).map(|other| patiently(problem, other));
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
    fn is_apart(&self, problem: &mut Problem<Body>, a: &Fit, b: &Fit) -> bool {
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

/// Number k of points that fill (0, 1) evenly in every dimension (Kronecker 1884): 3, 7, 11 ... are no squares.
fn scattered(k: usize, dimension: usize) -> f64 {
    (k as f64 * (3.0 + 4.0 * dimension as f64).sqrt()).fract()
}

/// Goes on from a fit that may only have crept along a valley, until that gains nothing.
fn patiently(problem: &mut Problem<Body>, fit: Fit) -> Fit {
    let mut best = fit;
    for _ in 0..MOST_REFITS {
        match problem.fit(&best.mean) {
            Some(next) if next.cost < best.cost - NO_GAIN => best = next,
            _ => break,
        }
    }
    best
}
