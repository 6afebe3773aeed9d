//! Several hypotheses side by side, while a ball joint's heading is unknown.
//!
//! Without a magnetometer the first samples tell how two bodies lean, not how they are turned about the vertical against each
//! other. That shows when they move, through what the joint forbids; but a filter that begins a half turn off may never
//! find it. So the unknown direction is cut into twelve, each with a filter of its own, and the likeliest one is reported, with
//! the spread of all that are still alive.

use super::lost::forget;
use super::Tracker;
use crate::body::three;
use crate::estimate::belief::{Belief, BRANCHES};
use crate::estimate::filter::{Diverged, Info};
use crate::estimate::transition::{congruence, Block};
use crate::estimate::System;
use crate::kernels::arch::Arch;
use crate::kinematics::FrameMotion;
use crate::recording::Sample;
use crate::rotation::turn::{norm, plus, Turn};
use crate::rotation::{Mat3, Vec3};
use crate::state::Slots;
use crate::Result;
use nalgebra::{Matrix3, SymmetricEigen};
use std::f64::consts::TAU;

/// A direction less certain than this opens a bank, rad: a filter finds its way from closer.
const UNCERTAIN_STD: f64 = 0.6;
/// A hypothesis e^-10 times as likely as the best is given up.
const HOPELESS: f64 = 10.0;
/// Hypotheses whose joint is as close as this have become one, rad.
const SAME: f64 = 0.05;
/// Cosine above which an unknown direction counts as the vertical.
const UPRIGHT: f64 = 0.8;

impl Tracker {
    /// Takes every hypothesis on to the sample; the likeliest leads.
    pub(super) fn advance_all(&mut self, belief: &mut Belief, sample: &Sample) -> Result<()> {
        self.learns = belief.rivals.is_empty();
        if belief.rivals.is_empty() {
            self.advance(belief, sample, &mut |_, _| {})?;
            self.open_bank(belief);
            return Ok(());
        }
        self.compete(belief, &mut |tracker, one| tracker.advance(one, sample, &mut |_, _| {}))
    }

    /// The first sample's update, for every hypothesis.
    pub(super) fn update_all(&mut self, belief: &mut Belief, sample: &Sample) -> Result<()> {
        self.learns = belief.rivals.is_empty();
        if belief.rivals.is_empty() {
            self.prepare(sample);
            return self.update(belief);
        }
        self.compete(belief, &mut |tracker, one| {
            tracker.prepare(sample);
            tracker.update(one)
        })
    }

    fn compete(&mut self, belief: &mut Belief, go: &mut dyn FnMut(&mut Self, &mut Belief) -> Result<()>) -> Result<()> {
        let rivals = std::mem::take(&mut belief.rivals);
        let mut alive = Vec::new();
        let mut failed = None;
        for mut one in std::iter::once(belief.clone()).chain(rivals) {
            match go(self, &mut one) {
                Ok(()) => {
                    one.score += self.info.log_likelihood;
                    alive.push((one, self.info.clone()));
                }
                Err(e) => failed = Some(e),
            }
        }
        alive.retain(|(one, _)| one.score.is_finite());
        match (self.settle(alive), failed) {
            (Some(leader), _) => *belief = leader,
            (None, Some(e)) => return Err(e),
            (None, None) => return Err(super::diverged(Diverged { what: "no hypothesis fits".into() }, belief.time_s)),
        }
        Ok(())
    }

    /// The likeliest leads, and its report is the report; hopeless ones and those that have become another are given up.
    fn settle(&mut self, mut all: Vec<(Belief, Info)>) -> Option<Belief> {
        all.sort_by(|(a, _), (b, _)| b.score.total_cmp(&a.score));
        let mut all = all.into_iter();
        let (mut leader, info) = all.next()?;
        self.info = info;
        let best = std::mem::take(&mut leader.score);
        let mut rivals: Vec<Belief> = Vec::new();
        for (mut one, _) in all {
            one.score -= best;
            let distinct = std::iter::once(&leader).chain(&rivals).all(|other| !self.agree(&one, other));
            if one.score > -HOPELESS && distinct {
                rivals.push(one);
            }
        }
        leader.rivals = rivals;
        Some(leader)
    }

    fn agree(&self, a: &Belief, b: &Belief) -> bool {
        let mut away = vec![0.0; a.mean.len()];
        self.body.difference(&a.mean, &b.mean, &mut away);
        // Which way the whole body has turned is nobody's business.
        let mut inner = self.body.layout.turns.iter().filter(|(c, _)| !self.floats(*c));
        inner.all(|(_, slots)| norm(three(&away, slots.q)) < SAME) && !self.differ(&a.mean, &b.mean)
    }

    /// Cuts the least certain direction of a joint that sensors feel into hypotheses.
    pub(super) fn open_bank(&self, belief: &mut Belief) {
        if !belief.rivals.is_empty() {
            return;
        }
        for (c, slots) in &self.body.layout.turns {
            let spread = |i: usize| belief.covariance.at(slots.q + i, slots.q + i);
            if spread(0) + spread(1) + spread(2) < UNCERTAIN_STD * UNCERTAIN_STD || !self.is_felt(*c) {
                continue;
            }
            let block = Matrix3::from_fn(|i, j| belief.covariance.at(slots.q + i, slots.q + j));
            let eigen = SymmetricEigen::new(block);
            let most = eigen.eigenvalues.imax();
            if eigen.eigenvalues[most] > UNCERTAIN_STD * UNCERTAIN_STD {
                let direction = eigen.eigenvectors.column(most);
                let direction = self.upright(belief, *c, [direction[0], direction[1], direction[2]]);
                self.fan_out(belief, *c, direction);
                return;
            }
        }
    }

    /// The vertical itself, if the direction is nearly that: turned about anything else, a body would lean otherwise.
    fn upright(&self, belief: &Belief, coordinate: usize, direction: [f64; 3]) -> [f64; 3] {
        let Some((_, root_from_joint)) = self.carrier(&belief.mean, coordinate) else { return direction };
        let Some(slots) = self.body.layout.coordinates[coordinate] else { return direction };
        let turned = root_from_joint.times(&Turn::exp(three(&belief.mean, slots.q)).matrix());
        let up = turned.apply_transposed(Vec3(self.body.model.world.up)).0;
        let cosine: f64 = up.iter().zip(direction).map(|(a, b)| a * b).sum();
        if cosine.abs() > UPRIGHT {
            up
        } else {
            direction
        }
    }

    /// Whether an inertial unit speaks whose readings the joint turns. A floating body's own heading is nobody's business.
    fn is_felt(&self, coordinate: usize) -> bool {
        let joint = self.body.model.joints.iter().position(|j| j.coordinates().contains(&coordinate));
        let sources = self.body.suite.sources.iter().zip(&self.moment.active).zip(&self.depends);
        let felt = joint.is_some_and(|j| {
            sources.into_iter().any(|((source, &active), depends)| active && source.is_inertial() && depends[j])
        });
        felt && !self.floats(coordinate)
    }

    /// Whether a rotation vector turns the whole body.
    fn floats(&self, coordinate: usize) -> bool {
        self.body.floating.iter().any(|(c, _)| *c == coordinate)
    }

    /// Turns a joint, and its rates so that the body behind it goes on turning as it did.
    fn turn_joint(&self, mean: &mut [f64], coordinate: usize, by: [f64; 3]) {
        let Some(Slots { q, rates }) = self.body.layout.coordinates[coordinate] else { return };
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

    /// Angular velocity and acceleration of what carries a joint, in the axes that the joint's rotation leads to.
    fn outer_motion(&self, mean: &[f64], coordinate: usize) -> Option<(Vec3<f64>, Vec3<f64>)> {
        let (carrier, root_from_joint) = self.carrier(mean, coordinate)?;
        let seen = |v: Vec3<f64>| root_from_joint.apply_transposed(v);
        Some((seen(carrier.angular_velocity), seen(carrier.angular_acceleration)))
    }

    /// Motion of the frame that carries a joint, and root from joint.
    fn carrier(&self, mean: &[f64], coordinate: usize) -> Option<(FrameMotion<f64>, Mat3<f64>)> {
        let model = &self.body.model;
        let moves = |f: &&crate::model::Frame| {
            f.joint.is_some_and(|(j, _)| model.joints[j].coordinates().contains(&coordinate))
        };
        let frame = model.frames.iter().find(moves)?;
        let carrier = self.body.motions_at(mean, &self.moment)[frame.parent];
        let before = frame.before.as_ref().map_or(Mat3::identity(), |t| t.evaluate(&self.body.parameters).0);
        Some((carrier, carrier.rotation.times(&before)))
    }

    fn fan_out(&self, belief: &mut Belief, coordinate: usize, direction: [f64; 3]) {
        let Some(slots) = self.body.layout.coordinates[coordinate] else { return };
        let q = slots.q;
        let outer = |i: usize, j: usize| direction[i] * direction[j];
        let across = [0, 1, 2].map(|i| [0, 1, 2].map(|j| f64::from(i == j) - outer(i, j)));
        congruence(Arch::best(), &Block::linear([q, q + 1, q + 2], across), &mut belief.covariance);
        let step = TAU / BRANCHES as f64;
        for i in 0..3 {
            for j in 0..3 {
                *belief.covariance.at_mut(q + i, q + j) += outer(i, j) * step * step / 4.0;
            }
        }
        // A rate seen from another heading is another one.
        let axis = &self.body.axes[coordinate];
        for i in 0..3 {
            let Some((rate, accel)) = slots.rates else { break };
            for (state, std) in [(rate + i, axis.process.start_std[1]), (accel + i, axis.process.start_std[2])] {
                forget(&mut belief.covariance, state, std);
            }
        }
        belief.score = 0.0;
        belief.line = 0;
        let rivals = (1..BRANCHES).map(|k| {
            let mut rival = belief.clone();
            self.turn_joint(&mut rival.mean, coordinate, direction.map(|x| x * step * k as f64));
            rival.line = k;
            rival
        });
        belief.rivals = rivals.collect();
    }
}
