//! The start: a fit of the first samples from several guesses, and how far to trust it.

use super::Tracker;
use crate::body::{Body, Moment};
use crate::error::{Error, Result};
use crate::estimate::belief::Belief;
use crate::estimate::dense::Square;
use crate::estimate::start::{Evidence, Fit, Guess, Problem};
use crate::estimate::System;
use crate::model::{Joint, JointKind, Sensor, SensorKind};
use crate::motion::prior_std;
use crate::recording::Sample;
use std::f64::consts::{FRAC_PI_2, PI};

/// Samples of the window that the fit uses, spread evenly.
const MOST_SAMPLES: usize = 8;
/// The fit's prior is this much wider than what the filter starts from.
const WIDENED: f64 = 4.0;
/// Standard deviation of the azimuth before anything is known, rad; a quarter turn lies between the guesses.
const AZIMUTH_STD: f64 = 1.0;
/// Least standard deviation of the azimuth that the filter starts from, rad.
const AZIMUTH_START_STD: f64 = 0.2;
/// A cost per reading below which other guesses need not be tried.
const GOOD_COST: f64 = 2.0;

impl Tracker {
    /// The belief at the first of the `window`'s samples, before its update.
    pub(super) fn fit_start(&mut self, window: &[Sample]) -> Result<Belief> {
        let stride = window.len().div_ceil(MOST_SAMPLES);
        let seen: Vec<(f64, Moment, Vec<f64>)> = window.iter().step_by(stride).map(|s| self.as_evidence(s)).collect();
        let evidence: Vec<Evidence<Moment>> =
            seen.iter().map(|(time_s, moment, z)| Evidence { after_s: time_s - window[0].time_s, moment, z }).collect();
        let readings = seen.iter().flat_map(|s| &s.2).filter(|z| !z.is_nan()).count();
        let mut best: Option<Fit> = None;
        for guess in self.guesses()? {
            let fit = Problem::new(&self.body, &evidence, &self.std, &guess).fit(&guess.mean);
            if let Some(fit) = fit.filter(|f| best.as_ref().is_none_or(|b| f.cost < b.cost)) {
                let good = fit.cost < GOOD_COST * readings as f64;
                best = Some(fit);
                if good {
                    break;
                }
            }
        }
        let fit = best.ok_or_else(|| {
            let t = window[0].time_s;
            let text = format!("no start found at {t:.3} s: the first readings are not numbers for this model");
            Error::Diverged { time_s: t, text }
        })?;
        Ok(self.belief_from(fit, window[0].time_s))
    }

    fn as_evidence(&mut self, sample: &Sample) -> (f64, Moment, Vec<f64>) {
        self.prepare(sample);
        let mut z = self.z.clone();
        for (rows, _) in self.groups.parts.iter().zip(&self.barred).filter(|(_, &barred)| barred) {
            z[rows.clone()].fill(f64::NAN);
        }
        (sample.time_s, self.moment.clone(), z)
    }

    /// Rest posture (or the one asked for) and the zero posture, each with the field from four sides.
    fn guesses(&self) -> Result<Vec<Guess>> {
        let body = &self.body;
        let joints = &body.model.joints;
        let rest: Vec<f64> = joints.iter().map(|j| j.rest).collect();
        let postures = match &self.config.initial_q {
            Some(q) if q.len() == joints.len() && q.iter().all(|x| x.is_finite()) => vec![q.clone()],
            Some(q) => {
                return Err(Error::Data(format!(
                    "config: initial_q holds {} numbers; expected {} finite ones, a value (rad or m) per joint of '{}'",
                    q.len(),
                    joints.len(),
                    body.model.name
                )))
            }
            None if rest.iter().all(|&q| q == 0.0) => vec![rest],
            None => vec![rest, vec![0.0; joints.len()]],
        };
        let sides = if body.layout.azimuth.is_some() { 4 } else { 1 };
        let guess = |posture: &Vec<f64>, side: usize| {
            guess(body, posture, body.model.world.magnetic_azimuth_rad + side as f64 * FRAC_PI_2)
        };
        Ok(postures.iter().flat_map(|p| (0..sides).map(move |side| guess(p, side))).collect())
    }

    fn belief_from(&self, mut fit: Fit, time_s: f64) -> Belief {
        let layout = &self.body.layout;
        let mut std = start_std(&self.body, 1.0);
        let fitted = |i: usize| fit.covariance.at(i, i).max(0.0).sqrt();
        for (joint, slots) in self.joints() {
            // What the first samples do not tell is known from the limits alone.
            std[slots.q] = std[slots.q].max(fitted(slots.q).min(prior_std(joint)));
            if joint.kind == JointKind::Hinge && !self.is_encoded(&joint.name) {
                let middle = 0.5 * (joint.limits[0] + joint.limits[1]);
                fit.mean[slots.q] = middle + wrapped(fit.mean[slots.q] - middle);
            }
        }
        if let Some(i) = layout.azimuth {
            std[i] = AZIMUTH_START_STD.max(fitted(i).min(AZIMUTH_STD));
            fit.mean[i] = wrapped(fit.mean[i]);
        }
        let mut covariance = Square::zeros(std.len());
        for (i, s) in std.iter().enumerate() {
            *covariance.at_mut(i, i) = s * s;
        }
        let rejected_since_s = vec![f64::NAN; self.groups.parts.len()];
        let habit = vec![1.0; self.groups.parts.len()];
        let drive = vec![1.0; self.body.driven().len()];
        let seen_s = vec![time_s; self.groups.sources.len()];
        Belief { time_s, mean: fit.mean, covariance, drive, habit, seen_s, rejected_since_s }
    }

    /// Whether an encoder tells whole turns of a joint.
    fn is_encoded(&self, joint: &str) -> bool {
        let model = &self.body.model;
        let reads =
            |s: &Sensor| matches!(s.kind, SensorKind::Encoder { joint: j, .. } if model.joints[j].name == joint);
        model.sensors.iter().any(reads)
    }

    /// Joints that are states, with their places.
    pub(super) fn joints(&self) -> impl Iterator<Item = (&Joint, crate::state::JointSlots)> {
        let both = self.body.model.joints.iter().zip(&self.body.layout.joints);
        both.filter_map(|(joint, slots)| Some((joint, (*slots)?)))
    }
}

/// The same angle in [-pi, pi).
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(2.0 * PI) - PI
}

fn guess(body: &Body, posture: &[f64], azimuth: f64) -> Guess {
    let mut mean = vec![0.0; body.layout.dim()];
    let mut std = start_std(body, WIDENED);
    for ((joint, slots), &q) in body.model.joints.iter().zip(&body.layout.joints).zip(posture) {
        if let Some(slots) = slots {
            mean[slots.q] = q;
            std[slots.q] = 2.0 * prior_std(joint);
        }
    }
    if let Some(i) = body.layout.azimuth {
        mean[i] = azimuth;
        std[i] = AZIMUTH_STD;
    }
    Guess::apart(mean, &std)
}

/// Standard deviations at the start, those of the rates `widened`.
fn start_std(body: &Body, widened: f64) -> Vec<f64> {
    let mut std = vec![AZIMUTH_START_STD; body.layout.dim()];
    for (joint, slots) in body.model.joints.iter().zip(&body.layout.joints) {
        let Some(slots) = slots else { continue };
        std[slots.q] = joint.process.start_std[0];
        if let Some((rate, accel)) = slots.rates {
            std[rate] = widened * joint.process.start_std[1];
            std[accel] = widened * joint.process.start_std[2];
        }
    }
    for slot in body.layout.slow() {
        std[slot.first..slot.first + slot.len].fill(slot.start_std);
    }
    std
}
