//! Detects a lost track, where most sensors contradict the state estimate, and resets the filter.
//!
//! If one sensor disagrees, it may be faulty, and the gate accepts it again after its patience. If most of them
//! disagree, the state estimate is wrong, however small its covariance. A chain of hinges that passes a singular pose
//! (two axes coincide) may move by a thousand standard deviations at each update, and farther each time.

use super::begin::{start_std, WIDENED};
use super::hypothesis::Hypothesis;
use super::magnetic::{IronState, LagState};
use super::readings::Readings;
use super::subject::Subject;
use crate::body::three;
use crate::estimate::belief::Belief;
use crate::kernels::dense::Square;
use crate::model::JointKind;
use crate::rotation::turn::Turn;
use crate::rotation::Vec3;
use crate::sensor::Quantity;

/// Standard deviation of the heading after a reset without a magnetometer, rad. The heading continues from the previous
/// estimate.
const HEADING_STD: f64 = 0.5;
/// A source without readings for this multiple of the gate's patience does not vote.
const RECENT: f64 = 4.0;
/// Lower limit of a standard deviation after a fit of one sample, as a share of the prior's. Near a singular pose the
/// linearised covariance of the fit is far too small.
const DOUBT: f64 = 0.1;

/// Whether most gyroscopes, accelerometers and orientation sensors with recent readings have been rejected without a
/// break, one of them in this sample for longer than the patience. Each sensor votes with its last verdict, because
/// units with clocks of their own give samples of one unit each.
pub(super) fn is_lost(subject: &Subject, readings: &Readings, one: &Hypothesis, patience_s: f64) -> bool {
    let belief = &one.belief;
    let (mut there, mut rejected, mut waited) = (0, 0, false);
    for (p, since_s) in belief.rejected_since_s.iter().enumerate() {
        let quantity = subject.quantities[p];
        if !matches!(quantity, Quantity::Gyro | Quantity::Accel | Quantity::Orientation) {
            continue;
        }
        let speaks = readings.speak(&subject.groups.parts[p]);
        let changed_s = one.sources[subject.source_of_part[p]].faults.changed_s(quantity);
        let spoke = speaks || belief.time_s - changed_s <= RECENT * patience_s;
        there += usize::from(spoke);
        rejected += usize::from(spoke && !since_s.is_nan());
        waited |= speaks && belief.time_s - since_s > patience_s;
    }
    waited && 2 * rejected > there
}

/// Resets posture and motion to the uncertainty before the first sample, around the current posture. Slow states, lengths and mounts are kept.
pub(super) fn give_up(subject: &Subject, readings: &Readings, one: &mut Hypothesis) {
    let (body, belief) = (&subject.body, &mut one.belief);
    let std = start_std(body, WIDENED);
    let heading = headings(subject, readings, belief);
    for joint in &body.model.joints {
        let wraps = joint.kind == JointKind::Hinge && subject.body.model.encoder(joint.first).is_none();
        for c in joint.coordinates() {
            let (axis, Some(slots)) = (&body.axes[c], body.layout.coordinates[c]) else { continue };
            let value = belief.mean[slots.q];
            belief.mean[slots.q] = match (wraps, axis.turns || axis.travels) {
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
    belief.rejected_since_s.fill(f64::NAN);
    for source in &mut one.sources {
        // The next reading of each source is treated as one after a dropout. Units with clocks of their own give
        // samples of one unit each.
        source.seen_s = f64::NEG_INFINITY;
        source.field.forget_dip();
        // The unit may have been exchanged for another one.
        (source.iron, source.lag) = (IronState::NONE, LagState::NONE);
    }
}

/// Restores what a fit must not change.
pub(super) fn doubt_fit(subject: &Subject, belief: &mut Belief) {
    for (_, axis, slots) in subject.body.moving() {
        let std = DOUBT * axis.prior_std();
        *belief.covariance.at_mut(slots.q, slots.q) += std * std;
    }
}

/// Every rotation vector that rotates the whole body, if no magnetometer is in use: its state, the vertical in its axes
/// and the variance about the vertical.
fn headings(subject: &Subject, readings: &Readings, belief: &Belief) -> Vec<(usize, Vec3<f64>, f64)> {
    let body = &subject.body;
    if subject.has_compass(&readings.z) {
        return Vec::new();
    }
    let heading = |(c, outer): &(usize, crate::rotation::Mat3<f64>)| {
        let q = body.layout.coordinates[*c]?.q;
        let turned = outer.then(&Turn::exp(three(&belief.mean, q)).matrix());
        let up = turned.apply_transposed(Vec3(body.model.world.up));
        let pairs = (0..3).flat_map(|i| (0..3).map(move |j| (i, j)));
        let variance = pairs.map(|(i, j)| up.0[i] * up.0[j] * belief.covariance.at(q + i, q + j)).sum();
        Some((q, up, variance))
    };
    body.floating.iter().filter_map(heading).collect()
}

/// Resets one state to a standard deviation without correlations.
pub(super) fn forget(covariance: &mut Square, state: usize, std: f64) {
    for k in 0..covariance.n() {
        *covariance.at_mut(state, k) = 0.0;
        *covariance.at_mut(k, state) = 0.0;
    }
    *covariance.at_mut(state, state) = std * std;
}

/// Sets the variance about the vertical in three states whose covariance is isotropic.
fn keep_heading(covariance: &mut Square, q: usize, up: Vec3<f64>, variance: f64) {
    let excess = variance - covariance.at(q, q);
    for i in 0..3 {
        for j in 0..3 {
            *covariance.at_mut(q + i, q + j) += excess.min(0.0) * up.0[i] * up.0[j];
        }
    }
}
