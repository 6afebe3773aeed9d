//! The start: fits the first samples from several initial postures and sets the initial covariance.

use super::hypothesis::Hypothesis;
use super::postures::Postures;
use super::subject::Subject;
use crate::body::{three, Body, Moment};
use crate::error::{Error, Result};
use crate::estimate::belief::Belief;
use crate::estimate::start::{Fit, Prior, StartFit, StartSample};
use crate::kernels::dense::Square;
use crate::model::{Axis, JointKind};
use crate::rotation::turn::{norm, plus, Turn};
use crate::rotation::Vec3;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Number of samples per source, evenly spread over the window, that enter the fit.
const MOST_SAMPLES: usize = 8;
/// Factor on the prior's standard deviations in the fit.
pub(super) const WIDENED: f64 = 4.0;
/// Prior standard deviation of the field's azimuth, rad; initial guesses are a quarter turn apart.
const AZIMUTH_STD: f64 = 1.0;
/// Prior standard deviation of an orientation sensor's heading, rad: that of a uniform angle, pi / sqrt(3).
const HEADING_STD: f64 = 1.8;
/// Smallest initial standard deviation of the azimuth, rad.
const AZIMUTH_START_STD: f64 = 0.2;
/// Standard deviation of the heading at the start without a magnetometer, rad. The heading is zero by definition; this
/// avoids a division by zero in the update.
const GAUGE_STD: f64 = 1e-3;

/// A sample of the start window, without excluded readings.
#[derive(Debug)]
pub(super) struct Seen {
    pub time_s: f64,
    pub moment: Moment,
    pub z: Vec<f64>,
}

/// Context of the start fit.
#[derive(Debug)]
pub(super) struct Start<'s> {
    pub subject: &'s Subject,
    /// Start posture of the configuration.
    pub initial_q: Option<&'s [f64]>,
}

impl Start<'_> {
    /// The hypothesis at the first sample of a window, before its update.
    pub fn fit(&self, window: Vec<Seen>) -> Result<Hypothesis> {
        let (subject, postures) = (self.subject, Postures { subject: self.subject });
        let begin_s = window.first().map_or(f64::NAN, |first| first.time_s);
        let seen = self.thinned(window);
        let evidence: Vec<StartSample<Moment>> =
            seen.iter().map(|s| StartSample { after_s: s.time_s - begin_s, moment: &s.moment, z: &s.z }).collect();
        let guesses = self.guesses()?;
        let starts: Vec<(&Prior, Vec<f64>)> = guesses.iter().map(|guess| (guess, guess.mean.clone())).collect();
        let found = postures.seek(&evidence, &starts).ok_or_else(|| {
            let text = format!(
                "no start found at {begin_s:.3} s: the first readings give no finite posture; check the streams and \
                 their units"
            );
            Error::Diverged { time_s: begin_s, text }
        })?;
        let (fit, others) = match found.good {
            true => {
                let mut problem = StartFit::new(&subject.body, &evidence, &subject.std, found.guess);
                postures.all_postures(&mut problem, found.fit)
            }
            false => (found.fit, Vec::new()),
        };
        let cost = fit.cost;
        let compass = seen.iter().any(|s| subject.has_compass(&s.z));
        let mut first = self.hypothesis(fit, begin_s, compass);
        for (other, line) in others.into_iter().zip(1..) {
            let score = -0.5 * (other.cost - cost);
            let rival = self.hypothesis(other, begin_s, compass);
            first.rivals.push(Hypothesis { score, line, ..rival });
        }
        Ok(first)
    }

    /// Picks about `MOST_SAMPLES` samples per source, evenly spread. Units with clocks of their own give samples of one
    /// unit each.
    fn thinned(&self, all: Vec<Seen>) -> Vec<Seen> {
        let sources = &self.subject.groups.sources;
        let speaks = |z: &[f64], s: usize| sources[s].clone().any(|r| !z[r].is_nan());
        let count = |s: usize| all.iter().filter(|seen| speaks(&seen.z, s)).count();
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
        all.into_iter().filter(|seen| wanted(&seen.z)).collect()
    }

    /// Initial guesses: the configured start posture, the rest posture, the zero posture and the middle of all limits,
    /// each with four headings of the field or of the body. The configured posture comes first. The others follow
    /// because it may be wrong.
    fn guesses(&self) -> Result<Vec<Prior>> {
        let body = &self.subject.body;
        let rest: Vec<f64> = body.axes.iter().map(|axis| axis.rest).collect();
        let count = rest.len();
        let asked = asked_posture(self.initial_q, body)?;
        let middle = body.axes.iter().map(|a| if a.turns { 0.0 } else { 0.5 * (a.limits[0] + a.limits[1]) }).collect();
        let mut postures: Vec<Vec<f64>> = asked.into_iter().chain([rest, vec![0.0; count], middle]).collect();
        postures.dedup();
        let turns_whole = !body.floating.is_empty();
        let sides = if body.layout.azimuth.is_some() || turns_whole { 4 } else { 1 };
        let guess = |posture: &Vec<f64>, side: usize| guess(body, posture, side as f64 * FRAC_PI_2);
        Ok(postures.iter().flat_map(|p| (0..sides).map(move |side| guess(p, side))).collect())
    }

    fn hypothesis(&self, mut fit: Fit, time_s: f64, compass: bool) -> Hypothesis {
        let (body, layout) = (&self.subject.body, &self.subject.body.layout);
        let mut std = start_std(body, 1.0);
        let fitted = |i: usize| fit.covariance.at(i, i).max(0.0).sqrt();
        let hinges = body.model.joints.iter().filter(|j| j.kind.width() == 1);
        for (joint, slots) in hinges.filter_map(|j| Some((j, layout.coordinates[j.first]?))) {
            // Directions that the first samples do not determine keep the start distribution of the joint or its
            // limits.
            let axis = &body.axes[joint.first];
            std[slots.q] = std[slots.q].max(fitted(slots.q).min(axis.start_spread()));
            if joint.kind == JointKind::Hinge && body.model.encoder(joint.first).is_none() {
                fit.mean[slots.q] = axis.nearest(fit.mean[slots.q]);
            }
        }
        if let Some(i) = layout.azimuth {
            std[i] = AZIMUTH_START_STD.max(fitted(i).min(AZIMUTH_STD));
            fit.mean[i] = wrapped(fit.mean[i]);
        }
        for &(i, _) in &layout.headings {
            std[i] = AZIMUTH_START_STD.max(fitted(i).min(HEADING_STD));
            fit.mean[i] = wrapped(fit.mean[i]);
        }
        let mut covariance = Square::zeros(std.len());
        for (i, s) in std.iter().enumerate() {
            *covariance.at_mut(i, i) = s * s;
        }
        self.place_turns(&fit, compass, &mut covariance);
        let parts = self.subject.groups.parts.len();
        let belief = Belief::new(time_s, fit.mean, covariance, parts);
        Hypothesis::new(belief, self.subject.groups.sources.len())
    }

    /// Rotations: the standard deviation in each direction is the fit's, limited between the start's and the prior's.
    /// If the joint gives its own start standard deviation, both limits are equal to it.
    fn place_turns(&self, fit: &Fit, compass: bool, covariance: &mut Square) {
        for (c, slots) in &self.subject.body.layout.turns {
            let axes = &self.subject.body.axes[*c..c + 3];
            let block = Matrix3::from_fn(|i, j| fit.covariance.at(slots.q + i, slots.q + j));
            let mut eigen = SymmetricEigen::new(block);
            let least = axes[0].process.start_std[0];
            for (value, direction) in eigen.eigenvalues.iter_mut().zip(eigen.eigenvectors.column_iter()) {
                let most = spread_along(axes, direction.into());
                *value = value.clamp(least.min(most).powi(2), most * most);
            }
            let mut block = eigen.recompose();
            if let Some((_, outer)) = self.subject.body.floating.iter().find(|(f, _)| f == c).filter(|_| !compass) {
                let up = outer
                    .then(&Turn::exp(three(&fit.mean, slots.q)).matrix())
                    .apply_transposed(Vec3(self.subject.body.model.world.up));
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
}

/// The start posture of the configuration.
pub(super) fn asked_posture(initial_q: Option<&[f64]>, body: &Body) -> Result<Option<Vec<f64>>> {
    let count = body.axes.len();
    match initial_q {
        Some(q) if q.len() == count && q.iter().all(|x| x.is_finite()) => Ok(Some(q.to_vec())),
        Some(q) => Err(Error::Data(format!(
            "config: initial_q holds {} numbers; expected {count} finite ones, a value (rad or m) per coordinate of '{}'",
            q.len(),
            body.model.name
        ))),
        None => Ok(None),
    }
}

/// Standard deviation of a rotation vector along a unit vector before any measurement, the other directions being known.
fn spread_along(axes: &[Axis], direction: [f64; 3]) -> f64 {
    let spreads = [0, 1, 2].map(|i| axes[i].start_spread());
    if spreads[1..].iter().all(|s| *s == spreads[0]) {
        return spreads[0];
    }
    1.0 / norm([0, 1, 2].map(|i| direction[i] / spreads[i]))
}

/// Wraps an angle to [-pi, pi).
fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(2.0 * PI) - PI
}

/// A posture without measurements, with the field and floating bodies rotated by `side` rad about the vertical.
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
    for &(i, _) in &body.layout.headings {
        std[i] = HEADING_STD;
    }
    Prior::uncorrelated(mean, &std)
}

/// Standard deviations at the start; those of the rates are multiplied by `widened`.
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
        if let Some(mount) = body.model.sensors[*i].kind.mount() {
            std[*first..first + 3].fill(mount.std_rad);
        }
    }
    for slot in &body.layout.errors {
        std[slot.first..slot.first + 3].fill(slot.error.start_std);
    }
    for slot in &body.layout.pushes {
        let base = &body.model.base_accelerations[slot.number];
        std[slot.state] = base.start_std;
        slot.rate.into_iter().for_each(|rate| std[rate] = base.rate_std());
    }
    std
}
