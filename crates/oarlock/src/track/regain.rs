//! Fits the posture again after a dropout.
//!
//! During a dropout joints may move so far that sigma points spread over half a turn. An update from there can converge
//! to a wrong posture with a small covariance. The first readings after a dropout are therefore fitted by
//! Levenberg-Marquardt with the state estimate as prior, from its mean, the rest posture and the middle of all limits.
//! The state estimate takes the best fit and its linearised covariance.

use super::hypothesis::Hypothesis;
use super::loops::{Loops, SILENCE_S};
use super::postures::Postures;
use super::readings::Readings;
use super::subject::Subject;
use crate::estimate::belief::Belief;
use crate::estimate::filter::{log_likelihood, Info, SourceInfo, Verdict};
use crate::estimate::start::{Fit, Prior, StartFit, StartSample};
use crate::model::Axis;
use std::f64::consts::TAU;

/// A joint with a larger standard deviation (rad or m) is fitted again when a source returns.
const UNCERTAIN_STD: f64 = 0.1;

/// Whether a source returns that depends on a joint which has become uncertain.
pub(super) fn is_due(subject: &Subject, loops: &Loops, readings: &Readings, one: &Hypothesis) -> bool {
    let active = &readings.moment.active;
    let silent = |s: usize| one.belief.time_s - one.sources[s].seen_s > SILENCE_S;
    let returned = |s: &usize| active[*s] && !loops.contain(*s) && silent(*s);
    let feels_uncertain = |s: usize| {
        let mut felt = (0..subject.depends[s].len()).filter(|&j| subject.depends[s][j]);
        felt.any(|j| is_uncertain(subject, &one.belief, j))
    };
    (0..active.len()).filter(returned).any(feels_uncertain)
}

/// Only joints with rates can become this uncertain.
fn is_uncertain(subject: &Subject, belief: &Belief, joint: usize) -> bool {
    let joint = &subject.body.model.joints[joint];
    // The position of a free joint needs no sensor.
    let coordinates = joint.turn().unwrap_or(joint.first)..joint.coordinates().end;
    let slots = subject.body.layout.coordinates[coordinates].iter().flatten().filter(|s| s.rates.is_some());
    slots.into_iter().any(|s| belief.covariance.at(s.q, s.q) > UNCERTAIN_STD * UNCERTAIN_STD)
}

/// Fits this sample. Returns the report; `None` if no fit succeeds, and the state estimate is then unchanged.
pub(super) fn regain(subject: &Subject, readings: &Readings, excluded: &[bool], belief: &mut Belief) -> Option<Info> {
    let z = readings.without(subject, excluded);
    let mut fit = best_fit(subject, readings, belief, &z)?;
    // A fit from far away may be off by whole turns. Where the limits contain only one of them, the fit is moved there.
    for (axis, q) in subject.free_hinges().filter(|(axis, _)| axis.limits[1] - axis.limits[0] < TAU) {
        fit.mean[q] = axis.nearest(fit.mean[q]);
    }
    belief.mean = fit.mean;
    belief.covariance = fit.covariance;
    Some(report(subject, readings, excluded, &z, fit.cost))
}

fn best_fit(subject: &Subject, readings: &Readings, belief: &Belief, z: &[f64]) -> Option<Fit> {
    let (body, postures) = (&subject.body, Postures { subject });
    let guess = Prior::of(&belief.mean, &belief.covariance)?;
    let evidence = [StartSample { after_s: 0.0, moment: &readings.moment, z }];
    let posture = |value: fn(&Axis) -> f64| {
        let mut mean = belief.mean.clone();
        body.moving().for_each(|(_, axis, slots)| mean[slots.q] = value(axis));
        mean
    };
    let rest = posture(|axis| axis.rest);
    let middle = posture(|axis| if axis.turns { axis.rest } else { 0.5 * (axis.limits[0] + axis.limits[1]) });
    let starts = [belief.mean.clone(), rest, middle].map(|first| (&guess, first));
    // One sample carries little information, so the best of the good fits is taken instead of the first.
    let fits = starts.iter().filter_map(|(_, first)| {
        let fit = StartFit::new(body, &evidence, &subject.std, &guess).fit(first);
        fit.filter(|fit| postures.is_good(fit, &evidence))
    });
    let best = fits.min_by(|a, b| a.cost.total_cmp(&b.cost));
    best.or_else(|| postures.seek(&evidence, &starts).map(|found| found.fit))
}

/// Report of a fit: all available rows are used, with innovations of zero.
fn report(subject: &Subject, readings: &Readings, excluded: &[bool], z: &[f64], cost: f64) -> Info {
    let groups = &subject.groups;
    let mut info = Info::new(groups, subject.rows());
    info.log_likelihood = log_likelihood(cost, z.iter().filter(|z| !z.is_nan()).count());
    for (source, rows) in info.sources.iter_mut().zip(&groups.sources) {
        let used = z[rows.clone()].iter().filter(|z| !z.is_nan()).count();
        let there = readings.z[rows.clone()].iter().filter(|z| !z.is_nan()).count();
        let (used, there, all) = (used as u8, there as u8, rows.len() as u8);
        *source = SourceInfo { nis: f64::NAN, used, rejected: there - used, missing: all - there };
    }
    for ((part, rows), &excluded) in info.parts.iter_mut().zip(&groups.parts).zip(excluded) {
        *part = match (readings.speak(rows), excluded) {
            (false, _) => Verdict::Missing,
            (true, true) => Verdict::Excluded,
            (true, false) => Verdict::Accepted,
        };
    }
    info
}
