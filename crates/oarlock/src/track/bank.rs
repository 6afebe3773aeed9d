//! Bank of hypotheses: parallel filters while a ball joint's heading is unknown.
//!
//! Without a magnetometer the first samples determine the inclination of two bodies but not their relative heading.
//! Motion determines it through the constraints of the joint, but a filter that starts half a turn off may never
//! converge. The unknown direction is therefore divided into twelve hypotheses with a filter each. The likeliest one is
//! reported, with the spread of all that are still followed.

use super::hypothesis::Hypothesis;
use super::lost::forget;
use super::postures::Postures;
use super::subject::Subject;
use crate::body::{three, Moment};
use crate::estimate::belief::Belief;
use crate::estimate::filter::Info;
use crate::estimate::transition::{congruence, Block};
use crate::estimate::System;
use crate::kernels::arch::Arch;
use crate::kinematics::FrameMotion;
use crate::rotation::turn::{norm, plus, Turn};
use crate::rotation::{Mat3, Vec3};
use crate::state::Slots;
use nalgebra::{Matrix3, SymmetricEigen};
use std::f64::consts::TAU;

/// A larger standard deviation of a direction starts a bank, rad. A single filter converges from a smaller one.
const UNCERTAIN_STD: f64 = 0.6;
/// A hypothesis less likely than e^-10 times the best is discarded.
const HOPELESS: f64 = 10.0;
/// Hypotheses with the joint closer than this are merged, rad.
const SAME: f64 = 0.05;
/// Cosine above which an unknown direction counts as the vertical.
const UPRIGHT: f64 = 0.8;

/// Largest number of hypotheses of a split.
const BRANCHES: u64 = 12;

/// Creates and discards hypotheses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bank<'s> {
    pub subject: &'s Subject,
    /// Number in the last sample.
    pub moment: &'s Moment,
}

impl Bank<'_> {
    /// Makes the likeliest hypothesis the leader, with its report; discards unlikely and duplicate ones.
    pub fn settle(&self, mut all: Vec<(Hypothesis, Info)>) -> Option<(Hypothesis, Info)> {
        all.retain(|(one, _)| one.score.is_finite());
        all.sort_by(|(a, _), (b, _)| b.score.total_cmp(&a.score));
        let mut all = all.into_iter();
        let (mut leader, info) = all.next()?;
        let best = std::mem::take(&mut leader.score);
        let mut rivals: Vec<Hypothesis> = Vec::new();
        for (mut one, _) in all {
            one.score -= best;
            let mut others = std::iter::once(&leader).chain(&rivals);
            let distinct = others.all(|other| !self.agree(&one.belief, &other.belief));
            if one.score > -HOPELESS && distinct {
                rivals.push(one);
            }
        }
        leader.rivals = rivals;
        Some((leader, info))
    }

    fn agree(&self, a: &Belief, b: &Belief) -> bool {
        let mut away = vec![0.0; a.mean.len()];
        self.subject.body.difference(&a.mean, &b.mean, &mut away);
        // The heading of the whole body is arbitrary.
        let mut inner = self.subject.body.layout.turns.iter().filter(|(c, _)| !self.subject.floats(*c));
        let postures = Postures { subject: self.subject };
        inner.all(|(_, slots)| norm(three(&away, slots.q)) < SAME) && !postures.differ(&a.mean, &b.mean)
    }

    /// Splits the least certain direction of an observed joint into hypotheses.
    pub fn open(&self, one: &mut Hypothesis) {
        if !one.rivals.is_empty() {
            return;
        }
        for (c, slots) in &self.subject.body.layout.turns {
            let covariance = &one.belief.covariance;
            let spread = |i: usize| covariance.at(slots.q + i, slots.q + i);
            if spread(0) + spread(1) + spread(2) < UNCERTAIN_STD * UNCERTAIN_STD || !self.is_felt(*c) {
                continue;
            }
            let block = Matrix3::from_fn(|i, j| covariance.at(slots.q + i, slots.q + j));
            let eigen = SymmetricEigen::new(block);
            let most = eigen.eigenvalues.imax();
            if eigen.eigenvalues[most] > UNCERTAIN_STD * UNCERTAIN_STD {
                let direction = eigen.eigenvectors.column(most);
                let direction = self.upright(&one.belief, *c, [direction[0], direction[1], direction[2]]);
                self.fan_out(one, *c, direction);
                return;
            }
        }
    }

    /// The vertical, if the direction is close to it: a rotation about another axis would change the inclination.
    fn upright(&self, belief: &Belief, coordinate: usize, direction: [f64; 3]) -> [f64; 3] {
        let Some((_, root_from_joint)) = self.carrier(&belief.mean, coordinate) else { return direction };
        let Some(slots) = self.subject.body.layout.coordinates[coordinate] else { return direction };
        let turned = root_from_joint.times(&Turn::exp(three(&belief.mean, slots.q)).matrix());
        let up = turned.apply_transposed(Vec3(self.subject.body.model.world.up)).0;
        let cosine: f64 = up.iter().zip(direction).map(|(a, b)| a * b).sum();
        if cosine.abs() > UPRIGHT {
            up
        } else {
            direction
        }
    }

    /// Whether a recent inertial unit depends on the joint. The heading of a floating body is arbitrary and does not
    /// count.
    fn is_felt(&self, coordinate: usize) -> bool {
        let joint = self.subject.body.model.joints.iter().position(|j| j.coordinates().contains(&coordinate));
        let sources = self.subject.body.suite.sources.iter().zip(&self.moment.active).zip(&self.subject.depends);
        let felt = joint.is_some_and(|j| {
            sources.into_iter().any(|((source, &active), depends)| active && source.is_inertial() && depends[j])
        });
        felt && !self.subject.floats(coordinate)
    }

    /// Rotates a joint and its rates so that the body behind it keeps its motion.
    fn turn_joint(&self, mean: &mut [f64], coordinate: usize, by: [f64; 3]) {
        let Some(Slots { q, rates }) = self.subject.body.layout.coordinates[coordinate] else { return };
        let outer = self.outer_motion(mean, coordinate);
        let (before, r) = (Turn::exp(three(mean, q)).matrix(), plus(three(mean, q), by));
        let after = Turn::exp(r).matrix();
        mean[q..q + 3].copy_from_slice(&r);
        let (Some((rate, accel)), Some((spin, spun))) = (rates, outer) else { return };
        let seen = |m: &Mat3<f64>| (m.apply_transposed(spin), m.apply_transposed(spun));
        let ((w0, a0), (w1, a1)) = (seen(&before), seen(&after));
        let (w, wd) = (Vec3(three(mean, rate)), Vec3(three(mean, accel)));
        let w_new = w + w0 - w1;
        let wd_new = wd + a0 + w0.cross(w) - a1 - w1.cross(w_new);
        mean[rate..rate + 3].copy_from_slice(&w_new.0);
        mean[accel..accel + 3].copy_from_slice(&wd_new.0);
    }

    /// Angular velocity and acceleration of the joint's parent, in the axes after the joint's rotation.
    fn outer_motion(&self, mean: &[f64], coordinate: usize) -> Option<(Vec3<f64>, Vec3<f64>)> {
        let (carrier, root_from_joint) = self.carrier(mean, coordinate)?;
        let seen = |v: Vec3<f64>| root_from_joint.apply_transposed(v);
        Some((seen(carrier.angular_velocity), seen(carrier.angular_acceleration)))
    }

    /// Motion of the frame that carries a joint, and the rotation from joint to root.
    fn carrier(&self, mean: &[f64], coordinate: usize) -> Option<(FrameMotion<f64>, Mat3<f64>)> {
        let model = &self.subject.body.model;
        let moves = |f: &&crate::model::Frame| {
            f.joint.is_some_and(|(j, _)| model.joints[j].coordinates().contains(&coordinate))
        };
        let frame = model.frames.iter().find(moves)?;
        let carrier = self.subject.body.motions_at(mean, self.moment)[frame.parent];
        let before = frame.before.as_ref().map_or(Mat3::identity(), |t| t.evaluate(&self.subject.body.parameters).0);
        Some((carrier, carrier.rotation.times(&before)))
    }

    fn fan_out(&self, one: &mut Hypothesis, coordinate: usize, direction: [f64; 3]) {
        let Some(slots) = self.subject.body.layout.coordinates[coordinate] else { return };
        let (q, belief) = (slots.q, &mut one.belief);
        let outer = |i: usize, j: usize| direction[i] * direction[j];
        let across = [0, 1, 2].map(|i| [0, 1, 2].map(|j| f64::from(i == j) - outer(i, j)));
        congruence(Arch::best(), &Block::linear([q, q + 1, q + 2], across), &mut belief.covariance);
        let step = TAU / BRANCHES as f64;
        for i in 0..3 {
            for j in 0..3 {
                *belief.covariance.at_mut(q + i, q + j) += outer(i, j) * step * step / 4.0;
            }
        }
        // The rates change with the heading.
        let axis = &self.subject.body.axes[coordinate];
        for i in 0..3 {
            let Some((rate, accel)) = slots.rates else { break };
            for (state, std) in [(rate + i, axis.process.start_std[1]), (accel + i, axis.process.start_std[2])] {
                forget(&mut belief.covariance, state, std);
            }
        }
        one.score = 0.0;
        one.line = 0;
        let rivals = (1..BRANCHES).map(|k| {
            let mut rival = one.clone();
            self.turn_joint(&mut rival.belief.mean, coordinate, direction.map(|x| x * step * k as f64));
            rival.line = k;
            rival
        });
        one.rivals = rivals.collect();
    }
}
