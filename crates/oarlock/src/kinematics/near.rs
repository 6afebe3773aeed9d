//! Motions near a mean, in the axes of each piece: points share with the mean the posture of what they do not move.
//!
//! In its own axes a piece's arms, its joint's axis and its sensors stand still, so a step down the tree only turns vectors:
//! w = C' w + z q', w' = C' w' + (C' w) x z q' + z q'', a = C' (a + w' x r + w x (w x r)), by joint rotations C. Places of points are
//! found on the way up, from their piece to one that stands as the mean's does.

use super::pieces::{Facing, Piece, Pieces};
use super::slopes::Slopes;
use super::{three, FrameMotion, JointMotion, Tree};
use crate::lane::Real;
use crate::model::JointKind;
use crate::rotation::{Mat3, Vec3};

/// What a piece feels, in its own axes.
#[derive(Debug, Clone, Copy)]
pub struct Own<T> {
    /// Angular velocity, rad/s.
    pub spin: Vec3<T>,
    /// Angular acceleration, rad/s2.
    pub spun: Vec3<T>,
    /// Acceleration of its origin minus gravity, m/s2.
    pub felt: Vec3<T>,
    /// The magnetic field, uT.
    pub field: Vec3<T>,
}

impl<T: Real> Own<T> {
    /// At rest, where nothing is felt.
    pub fn nothing() -> Self {
        Own { spin: Vec3::zero(), spun: Vec3::zero(), felt: Vec3::zero(), field: Vec3::zero() }
    }

    /// What is felt `arm` away, the same for all.
    #[inline(always)]
    pub fn felt_at(&self, arm: Vec3<f64>) -> Vec3<T> {
        if arm.0 == [0.0; 3] {
            return self.felt;
        }
        let w = self.spin;
        self.felt + self.spun.cross_equal(arm) + w.cross(w.cross_equal(arm))
    }

    /// What is felt `arm` away.
    #[inline(always)]
    pub fn felt_off(&self, arm: Vec3<T>) -> Vec3<T> {
        self.felt + self.spun.cross(arm) + self.spin.cross(self.spin.cross(arm))
    }
}

/// A joint's rotation. Of a hinge, its cosine and sine where they meet the parent's first two axes, with their signs; of a ball,
/// row by row.
pub type Turn<T> = [T; 9];

/// On which states a frame's pose depends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reach {
    /// One more than the last of them, in the frame's whole chain.
    pub last: usize,
    /// The same of its own joint alone.
    pub own: usize,
    /// Whether an input moves it.
    pub input: bool,
    /// Whether one moves its own joint.
    pub own_input: bool,
}

/// What of a piece is not the mean's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Differs {
    /// Rotation and position.
    pub pose: bool,
    /// Velocities and accelerations.
    pub motion: bool,
    /// The magnetic field in its axes.
    pub field: bool,
}

/// What differs from the mean: states from `from` on, inputs, and what that does to the root.
#[derive(Debug, Clone, Copy)]
pub struct Apart {
    /// First state that may differ.
    pub from: usize,
    /// Inputs do.
    pub inputs: bool,
    /// Rates, accelerations or the root's motion do.
    pub motion: bool,
    /// The magnetic field does.
    pub field: bool,
}

impl Apart {
    /// Whether this touches what reaches so far.
    #[inline(always)]
    pub fn touches(&self, reach: &Reach) -> bool {
        reach.last > self.from || (self.inputs && reach.input)
    }
}

/// What is asked of a piece.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wanted {
    /// Anything.
    pub place: bool,
    /// Velocities and accelerations.
    pub motion: bool,
    /// The magnetic field.
    pub field: bool,
}

/// How all pieces stand and move at the mean.
#[derive(Debug, Clone)]
pub struct Mean {
    /// Behind the joint, in root axes.
    pub stances: Vec<FrameMotion<f64>>,
    /// Of the joint.
    pub turns: Vec<Turn<f64>>,
    /// The magnetic field in root axes, uT.
    pub field: Vec3<f64>,
}

impl Mean {
    /// Room for so many pieces.
    pub fn new(count: usize) -> Self {
        let stances = vec![FrameMotion::resting(Vec3::zero()); count];
        Mean { stances, turns: vec![[0.0; 9]; count], field: Vec3::zero() }
    }

    #[inline(always)]
    fn spin_into<T: Real>(&self, piece: usize, own: &mut Own<T>) {
        let at = &self.stances[piece];
        own.spin = at.rotation.apply_transposed(at.angular_velocity).everywhere();
        own.spun = at.rotation.apply_transposed(at.angular_acceleration).everywhere();
        own.felt = at.rotation.apply_transposed(at.proper_acceleration).everywhere();
    }

    /// The magnetic field in the axes of a piece.
    #[inline(always)]
    pub fn field_in<T: Real>(&self, piece: usize) -> Vec3<T> {
        self.stances[piece].rotation.apply_transposed(self.field).everywhere()
    }
}

/// Room for what differs.
#[derive(Debug, Clone)]
pub struct Near<T> {
    /// Where motion or field differ.
    pub own: Vec<Own<T>>,
    turns: Vec<Turn<T>>,
    /// What differs.
    pub differs: Vec<Differs>,
}

impl<T: Real> Near<T> {
    /// Room for so many pieces.
    pub fn new(count: usize) -> Self {
        let turns = vec![[T::splat(0.0); 9]; count];
        Near { own: vec![Own::nothing(); count], turns, differs: vec![Differs::default(); count] }
    }
}

/// What a pass is asked for, and where it starts.
#[derive(Debug, Clone, Copy)]
pub struct Pass<'a> {
    /// Of every piece.
    pub wanted: &'a [Wanted],
    /// On what each piece's pose depends.
    pub reaches: &'a [Reach],
    /// From the mean.
    pub apart: Apart,
    /// In the middle.
    pub mean: &'a Mean,
}

impl Tree {
    /// What moves each frame: `state` and `length` give the state of a coordinate and of an estimated parameter.
    pub fn reaches(
        &self,
        state: impl Fn(usize) -> Option<usize>,
        length: impl Fn(usize) -> usize,
        input: impl Fn(usize) -> bool,
    ) -> Vec<Reach> {
        let mut reaches: Vec<Reach> = Vec::with_capacity(self.links.len());
        for link in &self.links {
            let parent = reaches.get(link.parent).copied().unwrap_or_default();
            let coordinates = || link.joint.iter().flat_map(|j| j.first..j.first + j.kind.width());
            let own = coordinates().filter_map(&state).map(|s| s + 1).max().unwrap_or(0);
            let arms = link.before.iter().chain(&link.after).flat_map(|f| f.translation.moved_by());
            let arms = arms.map(|l| length(l) + 1).max().unwrap_or(0);
            let own_input = coordinates().any(&input);
            reaches.push(Reach {
                last: parent.last.max(own).max(arms),
                own,
                input: parent.input || own_input,
                own_input,
            });
        }
        reaches
    }
}

impl Pieces {
    /// Takes over how the pieces that are wanted stand. Allocates nothing.
    #[inline(always)]
    pub fn settle(&self, slopes: &Slopes, anchors: &[Mat3<f64>], wanted: &[Wanted], mean: &mut Mean) {
        for (k, piece) in self.pieces.iter().enumerate().filter(|(k, _)| *k == 0 || wanted[*k].place) {
            mean.stances[k] = slopes.stances[piece.frame];
            let Some(joint) = &piece.joint else { continue };
            match joint.kind {
                JointKind::Hinge => piece.bend(slopes.sin_cos[piece.frame], &mut mean.turns[k]),
                JointKind::Ball | JointKind::Free => {
                    put_rows(anchors.get(joint.turn).copied().unwrap_or(Mat3::identity()), &mut mean.turns[k]);
                }
                JointKind::Slide | JointKind::Fixed => {}
            }
        }
    }

    /// A vector of the root in the axes of every piece. Allocates nothing.
    pub fn lower(&self, joints: JointMotion<f64>, v: Vec3<f64>, out: &mut [Vec3<f64>]) {
        let mut turn = [0.0; 9];
        out[0] = v;
        for (k, piece) in self.pieces.iter().enumerate().skip(1) {
            piece.turn(&joints, &mut turn);
            out[k] = piece.lowered(&turn, out[piece.parent]);
        }
    }

    /// Marks what carries the pieces that are wanted.
    pub fn mark_ancestors(&self, wanted: &mut [Wanted]) {
        for k in (1..self.len()).rev() {
            let (own, above) = (wanted[k], &mut wanted[self.parent(k)]);
            above.place |= own.place;
            above.motion |= own.motion;
            above.field |= own.field;
        }
    }

    /// Fills `near` with what differs from the mean. Allocates nothing.
    #[inline(always)]
    pub fn pass<T: Real>(&self, pass: Pass, joints: JointMotion<T>, root: Own<T>, near: &mut Near<T>) {
        let Pass { wanted, reaches, apart, mean } = pass;
        near.own[0] = root;
        near.differs[0] = Differs { pose: false, motion: apart.motion, field: apart.field };
        for (k, piece) in self.pieces.iter().enumerate().skip(1) {
            let (wanted, reach) = (wanted[k], reaches[k]);
            let pose = wanted.place && apart.touches(&reach);
            let motion = wanted.motion && (pose || apart.motion);
            let field = wanted.field && (pose || apart.field);
            near.differs[k] = Differs { pose, motion, field };
            if !(pose || motion || field) {
                continue;
            }
            if reach.own > apart.from || (apart.inputs && reach.own_input) {
                piece.turn(&joints, &mut near.turns[k]);
            } else {
                piece.keep(&mean.turns[k], &mut near.turns[k]);
            }
            let (known, turn) = (near.differs[piece.parent], &near.turns[k]);
            let (above, below) = near.own.split_at_mut(k);
            let (from, to) = (&mut above[piece.parent], &mut below[0]);
            if motion {
                if !known.motion {
                    mean.spin_into(piece.parent, from);
                }
                piece.carried(from, turn, &joints, to);
            }
            if field {
                if !known.field {
                    from.field = mean.field_in(piece.parent);
                }
                to.field = piece.lowered(turn, from.field);
            }
        }
    }

    /// A point of a piece in root axes; with `ROD`, a direction.
    #[inline(always)]
    pub fn raised<T: Real, const ROD: bool>(
        &self,
        mut at: usize,
        mut x: Vec3<T>,
        mean: &Mean,
        joints: &JointMotion<T>,
        near: &Near<T>,
    ) -> Vec3<T> {
        while near.differs[at].pose {
            let piece = &self.pieces[at];
            x = piece.raised::<T, ROD>(&near.turns[at], x, joints);
            at = piece.parent;
        }
        let stance = &mean.stances[at];
        let turned = stance.rotation.apply_lanes(x);
        if ROD {
            turned
        } else {
            turned + stance.position.everywhere()
        }
    }
}

impl Piece {
    /// Of the joint's own angles.
    #[inline(always)]
    pub fn turn<T: Real>(&self, joints: &JointMotion<T>, turn: &mut Turn<T>) {
        let Some(joint) = &self.joint else { return };
        match joint.kind {
            JointKind::Hinge => self.bend(joints.q[joint.first].scale(joint.sign).sin_cos(), turn),
            JointKind::Ball => put_rows(joint.ball(joints, joint.first), turn),
            JointKind::Free => put_rows(joint.ball(joints, joint.first + 3), turn),
            JointKind::Slide | JointKind::Fixed => {}
        }
    }

    #[inline(always)]
    fn keep<T: Real>(&self, from: &Turn<f64>, turn: &mut Turn<T>) {
        let count = match self.joint.as_ref().map(|j| j.kind) {
            Some(JointKind::Hinge) => 4,
            Some(JointKind::Ball | JointKind::Free) => 9,
            _ => 0,
        };
        for (to, from) in turn.iter_mut().zip(&from[..count]) {
            *to = T::splat(*from);
        }
    }

    /// Of a hinge by its sine and cosine.
    #[inline(always)]
    pub fn bend<T: Real>(&self, (sin, cos): (T, T), turn: &mut Turn<T>) {
        let [x, y, _] = self.facing.as_ref().map_or([1.0; 3], |f| f.signs);
        (turn[0], turn[1]) = (cos.scale(x), sin.scale(y));
        (turn[2], turn[3]) = (cos.scale(y), sin.scale(x));
    }

    /// A vector of the parent in the joint's axes, before the joint turns.
    #[inline(always)]
    fn faced<T: Real>(&self, v: Vec3<T>) -> Vec3<T> {
        match &self.facing {
            Some(Facing { axes: [a, b, c], signs: [x, y, z] }) => {
                Vec3([v.0[*a].scale(*x), v.0[*b].scale(*y), v.0[*c].scale(*z)])
            }
            None => self.entry.rotation.transposed_apply(v),
        }
    }

    /// Back again.
    #[inline(always)]
    fn unfaced<T: Real>(&self, v: Vec3<T>) -> Vec3<T> {
        match &self.facing {
            Some(Facing { axes, signs }) => {
                let mut out = v;
                for k in 0..3 {
                    out.0[axes[k]] = v.0[k].scale(signs[k]);
                }
                out
            }
            None => self.entry.rotation.apply_lanes(v),
        }
    }

    /// A vector of the parent in the piece's axes.
    #[inline(always)]
    fn lowered<T: Real>(&self, turn: &Turn<T>, v: Vec3<T>) -> Vec3<T> {
        match self.joint.as_ref().map(|j| j.kind) {
            Some(JointKind::Hinge) => {
                let [x, y, z] = match &self.facing {
                    Some(Facing { axes: [a, b, c], signs }) => [v.0[*a], v.0[*b], v.0[*c].scale(signs[2])],
                    None => self.faced(v).0,
                };
                Vec3([turn[0].madd(x, turn[1] * y), turn[2].madd(y, -(turn[3] * x)), z])
            }
            Some(JointKind::Ball | JointKind::Free) => rows(turn).apply_transposed(self.faced(v)),
            _ => self.faced(v),
        }
    }

    /// A point or, with `ROD`, a direction of the piece in the parent's axes.
    #[inline(always)]
    fn raised<T: Real, const ROD: bool>(&self, turn: &Turn<T>, v: Vec3<T>, joints: &JointMotion<T>) -> Vec3<T> {
        let Some(joint) = &self.joint else { return v };
        let first = joint.first;
        let outside = match joint.kind {
            JointKind::Hinge => {
                let [x, y, z] = v.0;
                let u = [turn[0].madd(x, -(turn[3] * y)), turn[1].madd(x, turn[2] * y), z];
                match &self.facing {
                    Some(Facing { axes: [a, b, c], signs }) => {
                        let mut out = v;
                        (out.0[*a], out.0[*b], out.0[*c]) = (u[0], u[1], u[2].scale(signs[2]));
                        out
                    }
                    None => self.entry.rotation.apply_lanes(Vec3(u)),
                }
            }
            JointKind::Slide if !ROD => {
                let [x, y, z] = v.0;
                self.unfaced(Vec3([x, y, z + joints.q[first].scale(joint.sign)]))
            }
            JointKind::Slide | JointKind::Fixed => self.unfaced(v),
            JointKind::Ball => self.unfaced(rows(turn).apply(v)),
            JointKind::Free if ROD => self.unfaced(rows(turn).apply(v)),
            JointKind::Free => self.unfaced(rows(turn).apply(v) + three(joints.q, first)),
        };
        if ROD {
            return outside;
        }
        match self.entry.translation.constant() {
            Some(arm) => outside + arm.everywhere(),
            None => outside + self.entry.translation.at(joints.lengths),
        }
    }

    /// Velocities and accelerations behind the joint.
    #[inline(always)]
    fn carried<T: Real>(&self, from: &Own<T>, turn: &Turn<T>, joints: &JointMotion<T>, to: &mut Own<T>) {
        let felt = match self.entry.translation.constant() {
            Some(arm) => from.felt_at(arm),
            None => from.felt_off(self.entry.translation.at(joints.lengths)),
        };
        let Some(joint) = &self.joint else { return };
        let (first, sign) = (joint.first, joint.sign);
        match joint.kind {
            JointKind::Hinge => {
                let [x, y, z] = self.lowered(turn, from.spin).0;
                let [xd, yd, zd] = self.lowered(turn, from.spun).0;
                let (qd, qdd) = (joints.qd[first].scale(sign), joints.qdd[first].scale(sign));
                to.spin = Vec3([x, y, z + qd]);
                to.spun = Vec3([y.madd(qd, xd), yd + -(x * qd), zd + qdd]);
                to.felt = self.lowered(turn, felt);
            }
            JointKind::Slide => {
                let zero = T::splat(0.0);
                let along = |v: &[T], by: f64| Vec3([zero, zero, v[first].scale(by)]);
                (to.spin, to.spun, to.felt) = (self.faced(from.spin), self.faced(from.spun), self.faced(felt));
                let twice = along(joints.qd, 2.0 * sign);
                to.felt = to.felt_off(along(joints.q, sign)) + to.spin.cross(twice) + along(joints.qdd, sign);
            }
            JointKind::Fixed => {}
            JointKind::Ball => {
                (to.spin, to.spun, to.felt) = (self.faced(from.spin), self.faced(from.spun), self.faced(felt));
                to.rolled(turn, three(joints.qd, first), three(joints.qdd, first));
            }
            JointKind::Free => {
                (to.spin, to.spun, to.felt) = (self.faced(from.spin), self.faced(from.spun), self.faced(felt));
                let [p, v, a] = [joints.q, joints.qd, joints.qdd].map(|x| three(x, first));
                to.felt = to.felt_off(p) + to.spin.cross(v + v) + a;
                to.rolled(turn, three(joints.qd, first + 3), three(joints.qdd, first + 3));
            }
        }
    }
}

impl<T: Real> Own<T> {
    /// By a ball whose rates are these, in the axes behind it.
    #[inline(always)]
    fn rolled(&mut self, turn: &Turn<T>, w: Vec3<T>, wd: Vec3<T>) {
        let turn = rows(turn);
        let spin = turn.apply_transposed(self.spin);
        self.spun = turn.apply_transposed(self.spun) + spin.cross(w) + wd;
        self.spin = spin + w;
        self.felt = turn.apply_transposed(self.felt);
    }
}

impl super::Moved {
    /// Joint from child.
    #[inline(always)]
    fn ball<T: Real>(&self, joints: &JointMotion<T>, first: usize) -> Mat3<T> {
        let turn = Mat3::about(three(joints.q, first));
        match joints.anchors.get(self.turn) {
            Some(anchor) => anchor.everywhere().then(&turn),
            None => turn,
        }
    }
}

#[inline(always)]
fn rows<T: Real>(turn: &Turn<T>) -> Mat3<T> {
    let [a, b, c, d, e, f, g, h, i] = *turn;
    Mat3([[a, b, c], [d, e, f], [g, h, i]])
}

#[inline(always)]
fn put_rows<T: Real>(m: Mat3<T>, turn: &mut Turn<T>) {
    let [[a, b, c], [d, e, f], [g, h, i]] = m.0;
    *turn = [a, b, c, d, e, f, g, h, i];
}
