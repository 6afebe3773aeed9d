//! The start: a fit of the first samples from several guesses, and how far to trust it.

use super::consider::Considering;
use super::Tracker;
use crate::body::{three, Body, Moment};
use crate::error::{Error, Result};
use crate::estimate::belief::{Belief, MEMORY};
use crate::estimate::start::{Fit, Prior, StartFit, StartSample};
use crate::estimate::System;
use crate::kernels::dense::Square;
use crate::model::{JointKind, SensorKind};
use crate::recording::Sample;
use crate::rotation::turn::{plus, Turn};
use crate::rotation::Vec3;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Samples of the window in which the fit hears of each source, spread evenly.
const MOST_SAMPLES: usize = 8;
/// The fit's prior is this much wider than what the filter starts from.
pub(super) const WIDENED: f64 = 4.0;
/// Standard deviation of the azimuth before anything is known, rad; a quarter turn lies between the guesses.
const AZIMUTH_STD: f64 = 1.0;
/// Least standard deviation of the azimuth that the filter starts from, rad.
const AZIMUTH_START_STD: f64 = 0.2;
/// Without a compass the heading at the start is zero by definition; so little that no update divides by nothing, rad.
const GAUGE_STD: f64 = 1e-3;

impl Tracker {
    /// The belief at the first of the `window`'s samples, before its update.
    pub(super) fn fit_start(&mut self, window: &[Sample]) -> Result<Belief> {
        let seen = {
            let all = window.iter().map(|s| self.as_evidence(s)).collect();
            self.thinned(all)
        };
        let evidence: Vec<StartSample<Moment>> = seen
            .iter()
            .map(|(time_s, moment, z)| StartSample { after_s: time_s - window[0].time_s, moment, z })
            .collect();
        let guesses = self.guesses()?;
        let starts: Vec<(&Prior, Vec<f64>)> = guesses.iter().map(|guess| (guess, guess.mean.clone())).collect();
        let found = self.seek(&evidence, &starts).ok_or_else(|| {
            let t = window[0].time_s;
            let text = format!("no start found at {t:.3} s: the first readings are not numbers for this model");
            Error::Diverged { time_s: t, text }
        })?;
        let (fit, others) = match found.good {
            true => self.all_postures(&mut StartFit::new(&self.body, &evidence, &self.std, found.guess), found.fit),
            false => (found.fit, Vec::new()),
        };
        let cost = fit.cost;
        let compass = seen.iter().any(|(_, _, z)| self.magnetic_rows().any(|r| !z[r].is_nan()));
        let mut belief = self.belief_from(fit, window[0].time_s, compass);
        for (other, line) in others.into_iter().zip(1..) {
            let score = -0.5 * (other.cost - cost);
            let rival = self.belief_from(other, window[0].time_s, compass);
            belief.rivals.push(Belief { score, line, ..rival });
        }
        Ok(belief)
    }

    /// Of every source not many more than `MOST_SAMPLES`, spread evenly: units with clocks of their own give samples of one unit each.
    fn thinned(&self, all: Vec<(f64, Moment, Vec<f64>)>) -> Vec<(f64, Moment, Vec<f64>)> {
        let sources = &self.groups.sources;
        let speaks = |z: &[f64], s: usize| sources[s].clone().any(|r| !z[r].is_nan());
        let count = |s: usize| all.iter().filter(|(.., z)| speaks(z, s)).count();
        let strides: Vec<usize> = (0..sources.len()).map(|s| count(s).div_ceil(MOST_SAMPLES).max(1)).collect();
        let mut heard = vec![0usize; sources.len()];
        let mut wanted = |z: &[f64]| {
            let mut due = false;
            for s in (0..sources.len()).filter(|&s| speaks(z, s)) {
                due |= heard[s].is_multiple_of(strides[s]);
                heard[s] += 1;
            }
            due
        };
        all.into_iter().filter(|(.., z)| wanted(z)).collect()
    }

    fn as_evidence(&mut self, sample: &Sample) -> (f64, Moment, Vec<f64>) {
        self.prepare(sample);
        let mut z = self.z.clone();
        for (rows, _) in self.groups.parts.iter().zip(&self.excluded).filter(|(_, &excluded)| excluded) {
            z[rows.clone()].fill(f64::NAN);
        }
        (sample.time_s, self.moment.clone(), z)
    }

    /// The posture asked for, if any, the rest posture, the zero posture and the middle of all limits, each with the field, or the body,
    /// from four sides. What was asked for comes first; where it leads to no good fit it may be wrong itself.
    fn guesses(&self) -> Result<Vec<Prior>> {
        let body = &self.body;
        let rest: Vec<f64> = body.axes.iter().map(|axis| axis.rest).collect();
        let count = rest.len();
        let asked = match &self.config.initial_q {
            Some(q) if q.len() == count && q.iter().all(|x| x.is_finite()) => Some(q.clone()),
            Some(q) => {
                return Err(Error::Data(format!(
                    "config: initial_q holds {} numbers; expected {count} finite ones, a value (rad or m) per coordinate of '{}'",
                    q.len(),
                    body.model.name
                )))
            }
            None => None,
        };
        let middle = body.axes.iter().map(|axis| 0.5 * (axis.limits[0] + axis.limits[1])).collect();
        let mut postures: Vec<Vec<f64>> = asked.into_iter().chain([rest, vec![0.0; count], middle]).collect();
        postures.dedup();
        let turns_whole = !body.floating.is_empty();
        let sides = if body.layout.azimuth.is_some() || turns_whole { 4 } else { 1 };
        let guess = |posture: &Vec<f64>, side: usize| guess(body, posture, side as f64 * FRAC_PI_2);
        Ok(postures.iter().flat_map(|p| (0..sides).map(move |side| guess(p, side))).collect())
    }

    fn belief_from(&self, mut fit: Fit, time_s: f64, compass: bool) -> Belief {
        let layout = &self.body.layout;
        let mut std = start_std(&self.body, 1.0);
        let fitted = |i: usize| fit.covariance.at(i, i).max(0.0).sqrt();
        let hinges = self.body.model.joints.iter().filter(|j| j.kind.width() == 1);
        for (joint, slots) in hinges.filter_map(|j| Some((j, layout.coordinates[j.first]?))) {
            // What the first samples do not tell is known from the joint's own start or its limits alone.
            let axis = &self.body.axes[joint.first];
            std[slots.q] = std[slots.q].max(fitted(slots.q).min(axis.start_spread()));
            if joint.kind == JointKind::Hinge && !self.is_encoded(&joint.name) {
                fit.mean[slots.q] = axis.nearest(fit.mean[slots.q]);
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
        self.place_turns(&fit, compass, &mut covariance);
        let parts = self.groups.parts.len();
        Belief {
            time_s,
            mean: fit.mean,
            covariance,
            drive: vec![1.0; self.body.driven().len()],
            usual_nis: vec![1.0; parts],
            inflation: 1.0,
            surprise: 1.0,
            roughness: 1.0,
            leftover: 1.0,
            seen_s: vec![time_s; self.groups.sources.len()],
            rejected_since_s: vec![f64::NAN; parts],
            memory: vec![[f64::NAN; MEMORY]; self.groups.sources.len()],
            doubt: self.considering.as_ref().map_or_else(Vec::new, Considering::fresh),
            line: 0,
            score: 0.0,
            rivals: Vec::new(),
        }
    }

    /// Rotations: each direction as far as the fit knows it, between the start's own deviation and the prior's. Where the joint itself
    /// says how far it starts from rest, that is both.
    fn place_turns(&self, fit: &Fit, compass: bool, covariance: &mut Square) {
        for (c, slots) in &self.body.layout.turns {
            let axis = &self.body.axes[*c];
            let block = Matrix3::from_fn(|i, j| fit.covariance.at(slots.q + i, slots.q + j));
            let mut eigen = SymmetricEigen::new(block);
            let (least, most) = (axis.process.start_std[0], axis.start_spread());
            eigen.eigenvalues.apply(|v| *v = v.clamp(least.min(most).powi(2), most * most));
            let mut block = eigen.recompose();
            if let Some((_, outer)) = self.body.floating.iter().find(|(f, _)| f == c).filter(|_| !compass) {
                let up = outer
                    .then(&Turn::exp(three(&fit.mean, slots.q)).matrix())
                    .apply_transposed(Vec3(self.body.model.world.up));
                let up = Vector3::from(up.0);
                let level = Matrix3::identity() - up * up.transpose();
                block = level * block * level + up * up.transpose() * (GAUGE_STD * GAUGE_STD);
            }
            for i in 0..3 {
                for j in 0..3 {
                    *covariance.at_mut(slots.q + i, slots.q + j) = block[(i, j)];
                }
            }
        }
    }

    /// Whether an encoder tells whole turns of a joint.
    pub(super) fn is_encoded(&self, joint: &str) -> bool {
        let model = &self.body.model;
        let reads = |s: &crate::model::Sensor| matches!(s.kind, SensorKind::Encoder { joint: j, .. } if model.joints[j].name == joint);
        model.sensors.iter().any(reads)
    }
}

/// The same angle in [-pi, pi).
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(2.0 * PI) - PI
}

/// A posture before anything is measured, with the field and floating bodies turned by `side` rad about the vertical.
fn guess(body: &Body, posture: &[f64], side: f64) -> Prior {
    let mut mean = vec![0.0; body.layout.dim()];
    let mut std = start_std(body, WIDENED);
    for (c, axis, slots) in body.moving() {
        mean[slots.q] = posture[c];
        let known = axis.place || axis.process.start_known;
        std[slots.q] = if known { axis.process.start_std[0] } else { 2.0 * axis.prior_std() };
    }
    for &(c, outer) in &body.floating {
        if let Some(slots) = body.layout.coordinates[c] {
            let up = outer.apply_transposed(Vec3(body.model.world.up)).0;
            let turned = plus(up.map(|x| x * side), three(&mean, slots.q));
            mean[slots.q..slots.q + 3].copy_from_slice(&turned);
        }
    }
    for ((_, state), length) in body.layout.lengths.iter().zip(body.lengths()) {
        mean[*state] = length;
    }
    if let Some(i) = body.layout.azimuth {
        mean[i] = body.model.world.magnetic_azimuth_rad + side;
        std[i] = AZIMUTH_STD;
    }
    Prior::uncorrelated(mean, &std)
}

/// Standard deviations at the start, those of the rates `widened`.
pub(super) fn start_std(body: &Body, widened: f64) -> Vec<f64> {
    let mut std = vec![AZIMUTH_START_STD; body.layout.dim()];
    for (_, axis, slots) in body.moving() {
        std[slots.q] = axis.process.start_std[0];
        if let Some((rate, accel)) = slots.rates {
            std[rate] = widened * axis.process.start_std[1];
            std[accel] = widened * axis.process.start_std[2];
        }
    }
    for (i, state) in &body.layout.lengths {
        std[*state] = body.model.parameters[*i].std.unwrap_or(0.0);
    }
    for (i, first) in &body.layout.mounts {
        if let SensorKind::Imu { mount, .. } = &body.model.sensors[*i].kind {
            std[*first..first + 3].fill(mount.std_rad);
        }
    }
    for slot in body.layout.biases() {
        std[slot.first..slot.first + 3].fill(slot.start_std);
    }
    for slot in &body.layout.pushes {
        let base = &body.model.base_accelerations[slot.number];
        std[slot.state] = base.start_std;
        slot.rate.into_iter().for_each(|rate| std[rate] = base.rate_std());
    }
    std
}
