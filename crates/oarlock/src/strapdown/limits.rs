//! Limits of joints as evidence: one-sided, with a soft edge. `filter` reads them at every tenth update.

use super::filter::{dot, Means, State, StrapdownFilter};
use super::joint::Turns;
use super::readings::white;
use super::skeleton::{Link, Pose};
use crate::body::Body;
use crate::model::Joint;
use crate::rotation::{Mat3, Vec3};
use std::f64::consts::{PI, TAU};

/// How long a joint stays where it is beyond its limits, s: the correlation time of what a limit says.
const LIMIT_TIME_S: f64 = 5.0;
/// Coordinates that change by more than this for a turn of the joint are near a singular posture, and their limits say nothing.
const STEEPEST: f64 = 4.0;
/// A coordinate that changes by less than this for a turn about the vertical says nothing of headings.
const LEAST_SHARE: f64 = 0.5;
/// By how much less a joint must be beyond its limits to begin in the other of two solutions, rad.
const MIRRORED_RAD: f64 = 0.5;
/// Turn for the derivative of a ball's excess, rad.
const STEP_RAD: f64 = 1e-4;

/// How far a joint is beyond a limit, rad, and its derivative by a turn of the child in its own axes.
type Excess = (f64, Vec3<f64>);

impl StrapdownFilter {
    /// Three hinges have each orientation twice. Where coordinates begin `near` the one that is beyond limits, and the other is not, they begin
    /// near that.
    pub fn leave_mirror(&self, body: &Body, means: &Means, near: &mut [f64]) {
        for (l, link) in self.skeleton.links.iter().enumerate() {
            let slots = link.turns.coordinates().map(|c| c.and_then(|c| body.layout.coordinates[c]).map(|s| s.q));
            let ([Some(a), Some(b), Some(c)], 3) = (slots, link.joints.len()) else { continue };
            let (relative, _) = self.relative(means, l);
            let own = link.turns.angles(&relative, [near[a], near[b], near[c]]).q;
            let mut other = link.turns.angles(&relative, [own[0] + PI, PI - own[1], own[2] + PI]).q;
            for (q, joint) in other.iter_mut().zip(&link.joints) {
                let middle = 0.5 * (joint.limits[0] + joint.limits[1]);
                *q -= TAU * ((*q - middle) / TAU).round();
            }
            let beyond = |q: [f64; 3]| -> f64 {
                let of = |(joint, q): (&Joint, f64)| (q - joint.limits[1]).max(joint.limits[0] - q).max(0.0);
                link.joints.iter().zip(q).map(of).sum()
            };
            if beyond(other) + MIRRORED_RAD < beyond(own) {
                (near[a], near[b], near[c]) = (other[0], other[1], other[2]);
            }
        }
    }

    /// A joint may be beyond its limits by as much as these differ between people. What is beyond that turns the headings of its links, which
    /// nothing else measures; tilts come from gravity, and what contradicts these is a wrong mount.
    pub(super) fn read_limits(&mut self, state: &mut State, l: usize, step_s: f64) {
        let link = &self.skeleton.links[l];
        let is_unknown = |l: usize| match self.skeleton.links[l].pose {
            Pose::Unit(u) => self.silent[u] || self.let_go[u],
            Pose::State(..) => true,
            Pose::Between(..) | Pose::Driven => false,
        };
        if link.joints.is_empty() || is_unknown(l) || link.parent.is_some_and(is_unknown) {
            return;
        }
        let (relative, child) = self.relative(&state.means, l);
        let (std, up) = (self.links.limit_std_rad, self.skeleton.up);
        for (excess, by_turn) in excesses(link, &relative, std) {
            let by_heading = dot(child.apply(by_turn), up);
            if by_heading.abs() < LEAST_SHARE {
                continue;
            }
            let row = up * by_heading;
            let rows = self.turn_rows(&state.means, l, &Mat3([row.0, [0.0; 3], [0.0; 3]]));
            let variance = white(std, LIMIT_TIME_S, step_s);
            self.correction.read(&state.covariance, &rows, 1, [std - excess, 0.0, 0.0], [variance; 3]);
            self.rows = rows;
        }
    }
}

/// Where a joint is beyond its limits by more than `least`, rad.
fn excesses(link: &Link, relative: &Mat3<f64>, least: f64) -> Vec<Excess> {
    let all: Vec<Excess> = match (&link.turns, &link.joints[..]) {
        (Turns::Ball(..), [ball]) => {
            let at = |turn: Vec3<f64>| {
                let turned = relative.times(&Mat3::about(turn));
                ball.beyond(link.turns.angles(&turned, [0.0; 3]).q).angle
            };
            let here = at(Vec3([0.0; 3]));
            if here <= least {
                return Vec::new();
            }
            let slope = |k: usize| {
                let step = |sign: f64| at(Vec3(std::array::from_fn(|i| if i == k { sign * STEP_RAD } else { 0.0 })));
                (step(1.0) - step(-1.0)) / (2.0 * STEP_RAD)
            };
            vec![(here, Vec3([0, 1, 2].map(slope)))]
        }
        (Turns::Hinges(_), hinges) => {
            let angles = link.turns.angles(relative, [0.0; 3]);
            let beyond = hinges.iter().enumerate().map(|(k, hinge)| {
                let [low, high] = hinge.limits;
                // From the middle of the range, so that a turn and a full turn more are the same.
                let off = (angles.q[k] - 0.5 * (low + high) + PI).rem_euclid(TAU) - PI;
                (off.abs() - 0.5 * (high - low), Vec3(angles.by_turn.0[k]) * off.signum())
            });
            beyond.collect()
        }
        _ => Vec::new(),
    };
    let is_clear = |(excess, slope): &Excess| *excess > least && slope.0.iter().all(|x| x.abs() < STEEPEST);
    all.into_iter().filter(is_clear).collect()
}
