//! A belief that its sensors contradict is lost: it is given up and the posture fitted anew.
//!
//! One sensor that disagrees may be at fault, and what it says is believed again after a while. If most of them disagree, the
//! belief is at fault, however certain it claims to be: a chain of hinges that has passed a pose in which two of its axes
//! coincide may move a thousand standard deviations at each update, and farther each time.

use super::begin::{start_std, WIDENED};
use super::north::forget_north;
use super::Tracker;
use crate::body::three;
use crate::estimate::belief::Belief;
use crate::kernels::dense::Square;
use crate::model::JointKind;
use crate::rotation::turn::Turn;
use crate::rotation::Vec3;
use crate::sensor::Quantity;

/// How far off the heading of a body without a compass may be behind a loss, rad: it is counted on from what was believed.
const HEADING_STD: f64 = 0.5;
/// Who has not spoken for so many times the gate's patience has no part in a verdict.
const RECENT: f64 = 4.0;
/// What a fit of one sample says of a posture is uncertain by this share of the prior's standard deviation, whatever its linearised
/// covariance claims: near a pose without a free direction that is as wrong as what led astray.
const DOUBT: f64 = 0.1;

impl Tracker {
    /// Whether most gyroscopes and accelerometers that spoke recently have been rejected up to now, one that speaks in this sample
    /// beyond patience. What counts is each one's last verdict: units with clocks of their own speak one in a sample.
    pub(super) fn is_lost(&self, belief: &Belief) -> bool {
        let patience_s = self.filter.patience_s(self.settings.gate);
        let feels_motion = |q: Quantity| matches!(q, Quantity::Gyro | Quantity::Accel);
        let parts = self.groups.parts.iter().zip(&belief.rejected_since_s).enumerate();
        let (mut there, mut rejected, mut waited) = (0, 0, false);
        for (p, (rows, since_s)) in parts.filter(|(p, _)| feels_motion(self.quantities[*p])) {
            let speaks = self.z[rows.clone()].iter().any(|z| !z.is_nan());
            let spoke = speaks || belief.time_s - self.changed_s(belief, p) <= RECENT * patience_s;
            there += usize::from(spoke);
            rejected += usize::from(spoke && !since_s.is_nan());
            waited |= speaks && belief.time_s - since_s > patience_s;
        }
        self.config.gate && waited && 2 * rejected > there
    }

    /// Posture and motion become as little known as before the first sample, around the posture that was believed; what was learnt
    /// is forgotten. Slow states, lengths and mounts stay.
    pub(super) fn give_up(&self, belief: &mut Belief) {
        let std = start_std(&self.body, WIDENED);
        let heading = self.headings(belief);
        for joint in &self.body.model.joints {
            let wraps = joint.kind == JointKind::Hinge && !self.is_encoded(&joint.name);
            for c in joint.coordinates() {
                let (axis, Some(slots)) = (&self.body.axes[c], self.body.layout.coordinates[c]) else { continue };
                let value = belief.mean[slots.q];
                belief.mean[slots.q] = match (wraps, axis.turns) {
                    (true, _) => axis.nearest(value),
                    (false, true) => value,
                    (false, false) => value.clamp(axis.limits[0], axis.limits[1]),
                };
                forget(&mut belief.covariance, slots.q, axis.prior_std());
                for state in slots.rates.into_iter().flat_map(|(rate, accel)| [rate, accel]) {
                    belief.mean[state] = 0.0;
                    forget(&mut belief.covariance, state, std[state]);
                }
            }
        }
        for (q, up, variance) in heading {
            keep_heading(&mut belief.covariance, q, up, variance + HEADING_STD * HEADING_STD);
        }
        belief.drive.fill(1.0);
        belief.usual_nis.fill(1.0);
        (belief.inflation, belief.surprise) = (1.0, 1.0);
        (belief.roughness, belief.leftover) = (1.0, 1.0);
        belief.rejected_since_s.fill(f64::NAN);
        // Whoever speaks next is heard as after a silence: with clocks of their own, one unit in a sample.
        belief.seen_s.fill(f64::NEG_INFINITY);
        belief.memory.iter_mut().for_each(forget_north);
    }

    /// Behind a fit that began anew.
    pub(super) fn doubt(&self, belief: &mut Belief) {
        for (_, axis, slots) in self.body.moving() {
            let std = DOUBT * axis.prior_std();
            *belief.covariance.at_mut(slots.q, slots.q) += std * std;
        }
    }

    /// Of every rotation vector that turns the whole body, while no compass speaks: its state, the vertical in its axes and
    /// the variance about it.
    fn headings(&self, belief: &Belief) -> Vec<(usize, Vec3<f64>, f64)> {
        if self.magnetic_rows().any(|r| !self.z[r].is_nan()) {
            return Vec::new();
        }
        let heading = |(c, outer): &(usize, crate::rotation::Mat3<f64>)| {
            let q = self.body.layout.coordinates[*c]?.q;
            let turned = outer.then(&Turn::exp(three(&belief.mean, q)).matrix());
            let up = turned.apply_transposed(Vec3(self.body.model.world.up));
            let pairs = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
            let variance = pairs.map(|(i, j)| up.0[i] * up.0[j] * belief.covariance.at(q + i, q + j)).sum();
            Some((q, up, variance))
        };
        self.body.floating.iter().filter_map(heading).collect()
    }
}

/// Nothing is known of a state but its standard deviation.
pub(super) fn forget(covariance: &mut Square, state: usize, std: f64) {
    for k in 0..covariance.n() {
        *covariance.at_mut(state, k) = 0.0;
        *covariance.at_mut(k, state) = 0.0;
    }
    *covariance.at_mut(state, state) = std * std;
}

/// Puts a variance about the vertical into three states that know as little in all directions.
fn keep_heading(covariance: &mut Square, q: usize, up: Vec3<f64>, variance: f64) {
    let excess = variance - covariance.at(q, q);
    for i in 0..3 {
        for j in 0..3 {
            *covariance.at_mut(q + i, q + j) += excess.min(0.0) * up.0[i] * up.0[j];
        }
    }
}
