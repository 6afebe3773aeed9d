//! Finding the posture again when sensors come back after a silence.
//!
//! Meanwhile joints may have moved so far that sigma points spread over half a turn, and an update from there can settle
//! in a wrong posture with great confidence. The first readings after a silence are therefore fitted by
//! Levenberg-Marquardt with the belief as prior, from its mean, the rest posture and the middle of all limits, and the
//! belief takes the best fit and its linearised covariance.

use super::Tracker;
use crate::estimate::belief::Belief;
use crate::estimate::filter::{log_likelihood, SourceInfo, Verdict};
use crate::estimate::start::{Fit, Prior, StartFit, StartSample};
use crate::model::Axis;
use std::f64::consts::TAU;

/// A source that says nothing for longer than this was silent, s.
const SILENCE_S: f64 = 0.2;
/// A joint less certain than this (rad or m) when a source comes back is looked for anew.
const UNCERTAIN_STD: f64 = 0.1;

impl Tracker {
    /// Whether a source speaks again that feels a joint which has become uncertain meanwhile.
    pub(super) fn must_regain(&self, belief: &Belief) -> bool {
        let returned =
            |s: &usize| self.moment.active[*s] && !self.is_loop(*s) && belief.time_s - belief.seen_s[*s] > SILENCE_S;
        let feels_uncertain = |s: usize| {
            let mut felt = (0..self.depends[s].len()).filter(|&j| self.depends[s][j]);
            felt.any(|j| self.is_uncertain(belief, j))
        };
        (0..self.moment.active.len()).filter(returned).any(feels_uncertain)
    }

    /// Only joints with rates can run away.
    fn is_uncertain(&self, belief: &Belief, joint: usize) -> bool {
        let joint = &self.body.model.joints[joint];
        // Where a free joint is, no sensor has to tell.
        let coordinates = joint.turn().unwrap_or(joint.first)..joint.coordinates().end;
        let slots = self.body.layout.coordinates[coordinates].iter().flatten().filter(|s| s.rates.is_some());
        slots.into_iter().any(|s| belief.covariance.at(s.q, s.q) > UNCERTAIN_STD * UNCERTAIN_STD)
    }

    /// Silences the loops that would have to find more joints than they have equations: their ends then meet in many
    /// postures, and linearised at one of them a loop would claim to know it.
    pub(super) fn hush_loops(&mut self, belief: &Belief) {
        for l in 0..self.loops.len() {
            let source = self.loops[l].source;
            let rows = self.body.suite.sources[source].rows.clone();
            // Two directions in space differ by two angles, told by three numbers.
            let equations = if rows.len() > 3 { rows.len() - 1 } else { rows.len() };
            let joints = 0..self.body.model.joints.len();
            let alone = joints.filter(|&j| self.depends[source][j] && self.is_left_alone(belief, j));
            let alone: usize = alone.map(|j| self.body.model.joints[j].kind.width()).sum();
            if alone > equations {
                self.moment.active[source] = false;
                self.z[rows].fill(f64::NAN);
            }
        }
    }

    fn is_loop(&self, source: usize) -> bool {
        self.loops.iter().any(|l| l.source == source)
    }

    /// Whether a joint that is a state is felt by loops only.
    fn is_left_alone(&self, belief: &Belief, joint: usize) -> bool {
        let feels = |s: &usize| self.depends[*s][joint] && belief.time_s - belief.seen_s[*s] <= SILENCE_S;
        let felt = (0..self.depends.len()).filter(feels).any(|s| !self.is_loop(s));
        self.body.layout.coordinates[self.body.model.joints[joint].first].is_some() && !felt
    }

    /// Remembers who spoke.
    pub(super) fn mark_seen(&self, belief: &mut Belief) {
        for (seen, _) in belief.seen_s.iter_mut().zip(&self.moment.active).filter(|(_, &active)| active) {
            *seen = belief.time_s;
        }
    }

    /// Fits this sample; false if that leads nowhere, and the belief is as it was.
    pub(super) fn regain(&mut self, belief: &mut Belief) -> bool {
        let mut z = self.z.clone();
        for (rows, _) in self.groups.parts.iter().zip(&self.excluded).filter(|(_, &excluded)| excluded) {
            z[rows.clone()].fill(f64::NAN);
        }
        let Some(mut fit) = self.best_fit(belief, &z) else { return false };
        // A fit from afar may have come round by whole turns; where limits leave one of them only, that is the angle.
        for (axis, q) in self.free_hinges().filter(|(axis, _)| axis.limits[1] - axis.limits[0] < TAU) {
            fit.mean[q] = axis.nearest(fit.mean[q]);
        }
        belief.mean = fit.mean;
        belief.covariance = fit.covariance;
        self.mark_seen(belief);
        self.report_fit(&z, fit.cost);
        true
    }

    fn best_fit(&self, belief: &Belief, z: &[f64]) -> Option<Fit> {
        let guess = Prior::of(&belief.mean, &belief.covariance)?;
        let evidence = [StartSample { after_s: 0.0, moment: &self.moment, z }];
        let posture = |value: fn(&Axis) -> f64| {
            let mut mean = belief.mean.clone();
            self.body.moving().for_each(|(_, axis, slots)| mean[slots.q] = value(axis));
            mean
        };
        let rest = posture(|axis| axis.rest);
        let middle = posture(|axis| if axis.turns { axis.rest } else { 0.5 * (axis.limits[0] + axis.limits[1]) });
        let starts = [belief.mean.clone(), rest, middle].map(|first| (&guess, first));
        // One sample tells little: of good fits the best is taken, not the first.
        let fits = starts.iter().filter_map(|(_, first)| {
            StartFit::new(&self.body, &evidence, &self.std, &guess)
                .fit(first)
                .filter(|fit| self.is_good(fit, &evidence))
        });
        let best = fits.min_by(|a, b| a.cost.total_cmp(&b.cost));
        best.or_else(|| self.seek(&evidence, &starts).map(|found| found.fit))
    }

    /// The fit used all rows that were there, and has no innovation to speak of.
    fn report_fit(&mut self, z: &[f64], cost: f64) {
        self.info = self.blank_info();
        self.info.log_likelihood = log_likelihood(cost, z.iter().filter(|z| !z.is_nan()).count());
        for (source, rows) in self.info.sources.iter_mut().zip(&self.groups.sources) {
            let used = z[rows.clone()].iter().filter(|z| !z.is_nan()).count();
            let there = self.z[rows.clone()].iter().filter(|z| !z.is_nan()).count();
            let (used, there, all) = (used as u8, there as u8, rows.len() as u8);
            *source = SourceInfo { nis: f64::NAN, used, rejected: there - used, missing: all - there };
        }
        for ((part, rows), &excluded) in self.info.parts.iter_mut().zip(&self.groups.parts).zip(&self.excluded) {
            let there = self.z[rows.clone()].iter().any(|z| !z.is_nan());
            *part = match (there, excluded) {
                (false, _) => Verdict::Missing,
                (true, true) => Verdict::Excluded,
                (true, false) => Verdict::Accepted,
            };
        }
    }
}
