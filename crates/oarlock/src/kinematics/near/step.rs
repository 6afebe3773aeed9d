//! Recursion step over one joint: the motion of the next piece, and positions on it.

use super::super::pieces::Piece;
use super::super::{three, JointMotion, Moved};
use super::{Own, Turn};
use crate::kernels::lane::Real;
use crate::model::JointKind;
use crate::rotation::{Mat3, Vec3};

/// Axis of the parent about which a hinge rotates. A compile-time constant avoids the lookup.
macro_rules! about {
    ($axis:expr, $what:ident($($given:expr),*)) => {
        match $axis {
            0 => $what::<T, 0>($($given),*),
            1 => $what::<T, 1>($($given),*),
            _ => $what::<T, 2>($($given),*),
        }
    };
}

impl Piece {
    /// Rotation of the joint at its coordinates.
    #[inline(always)]
    pub fn turn<T: Real>(&self, joints: &JointMotion<T>, turn: &mut Turn<T>) {
        let Some(joint) = &self.joint else { return };
        match joint.kind {
            JointKind::Hinge => {
                let (sin, cos) = joints.q[joint.first].scale(joint.sign * self.ways.flip).sin_cos();
                (turn[0], turn[1]) = (cos, sin);
            }
            JointKind::Ball => put_rows(joint.ball(joints, joint.first), turn),
            JointKind::Free => put_rows(joint.ball(joints, joint.first + 3), turn),
            JointKind::Slide | JointKind::Fixed => {}
        }
    }

    #[inline(always)]
    pub fn keep<T: Real>(&self, from: &Turn<f64>, turn: &mut Turn<T>) {
        let count = match self.joint.as_ref().map(|j| j.kind) {
            Some(JointKind::Hinge) => 2,
            Some(JointKind::Ball | JointKind::Free) => 9,
            _ => 0,
        };
        for (to, from) in turn.iter_mut().zip(&from[..count]) {
            *to = T::splat(*from);
        }
    }

    /// Rotates a vector from the parent's axes to the joint's.
    #[inline(always)]
    fn entered<T: Real>(&self, v: Vec3<T>) -> Vec3<T> {
        match &self.ways.entry {
            Some(entry) => entry.transposed_apply(v),
            None => v,
        }
    }

    /// Rotates a vector from the parent's axes to the piece's.
    #[inline(always)]
    pub fn lowered<T: Real>(&self, turn: &Turn<T>, v: Vec3<T>) -> Vec3<T> {
        let v = self.entered(v);
        match self.joint.as_ref().map(|j| j.kind) {
            Some(JointKind::Hinge) => about!(self.ways.axis, bent(turn[0], turn[1], v)),
            Some(JointKind::Ball | JointKind::Free) => rows(turn).apply_transposed(v),
            _ => v,
        }
    }

    /// Transforms a point or, with `ROD`, a direction from the piece's to the parent's axes.
    #[inline(always)]
    pub fn raised<T: Real, const ROD: bool>(&self, turn: &Turn<T>, v: Vec3<T>, joints: &JointMotion<T>) -> Vec3<T> {
        let Some(joint) = &self.joint else { return v };
        let first = joint.first;
        let inside = match joint.kind {
            JointKind::Hinge => about!(self.ways.axis, bent(turn[0], -turn[1], v)),
            JointKind::Slide if !ROD => v + self.along(joints.q[first].scale(joint.sign)),
            JointKind::Slide | JointKind::Fixed => v,
            JointKind::Ball => rows(turn).apply(v),
            JointKind::Free if ROD => rows(turn).apply(v),
            JointKind::Free => rows(turn).apply(v) + three(joints.q, first),
        };
        let outside = match &self.ways.entry {
            Some(entry) => entry.apply_lanes(inside),
            None => inside,
        };
        if ROD {
            return outside;
        }
        match self.arm.constant() {
            Some(arm) => outside + arm.everywhere(),
            None => outside + self.arm.at(joints.lengths),
        }
    }

    /// A point of the piece and its velocity relative to the piece, as the parent sees both.
    #[inline(always)]
    pub fn raised_moving<T: Real>(
        &self,
        turn: &Turn<T>,
        point: Vec3<T>,
        velocity: Vec3<T>,
        joints: &JointMotion<T>,
    ) -> (Vec3<T>, Vec3<T>) {
        let Some(joint) = &self.joint else { return (point, velocity) };
        let (first, along) = (joint.first, |v: &[T]| self.along(v[joint.first].scale(joint.sign)));
        let own = match joint.kind {
            JointKind::Hinge => along(joints.qd).cross(point),
            JointKind::Slide => along(joints.qd),
            JointKind::Fixed => Vec3::zero(),
            JointKind::Ball => three(joints.qd, first).cross(point),
            JointKind::Free => {
                three(joints.qd, first + 3).cross(point) + rows(turn).apply_transposed(three(joints.qd, first))
            }
        };
        (self.raised::<T, false>(turn, point, joints), self.raised::<T, true>(turn, velocity + own, joints))
    }

    /// A vector of this length along the axis of a hinge or slide.
    #[inline(always)]
    fn along<T: Real>(&self, by: T) -> Vec3<T> {
        let mut v = Vec3::zero();
        v.0[self.ways.axis] = by.scale(self.ways.flip);
        v
    }

    /// Velocities and accelerations after the joint.
    #[inline(always)]
    pub fn carried<T: Real>(&self, from: &Own<T>, turn: &Turn<T>, joints: &JointMotion<T>, to: &mut Own<T>) {
        let Some(joint) = &self.joint else { return };
        if joint.kind == JointKind::Hinge {
            return self.hinged(joint, from, turn, joints, to);
        }
        let felt = match self.arm.constant() {
            Some(arm) => from.felt_at(arm),
            None => from.felt_off(self.arm.at(joints.lengths)),
        };
        (to.spin, to.spun, to.felt) = (self.entered(from.spin), self.entered(from.spun), self.entered(felt));
        let (first, sign) = (joint.first, joint.sign);
        match joint.kind {
            JointKind::Hinge | JointKind::Fixed => {}
            JointKind::Slide => {
                let (p, a) = (self.along(joints.q[first].scale(sign)), self.along(joints.qdd[first].scale(sign)));
                let v = self.along(joints.qd[first].scale(sign));
                to.felt = to.felt_off(p) + to.spin.cross(v + v) + a;
            }
            JointKind::Ball => to.rolled(turn, three(joints.qd, first), three(joints.qdd, first)),
            JointKind::Free => {
                let (p, v, a) = (three(joints.q, first), three(joints.qd, first), three(joints.qdd, first));
                to.felt = to.felt_off(p) + to.spin.cross(v + v) + a;
                to.rolled(turn, three(joints.qd, first + 3), three(joints.qdd, first + 3));
            }
        }
    }

    /// A hinge, for half of the lanes at a time: nine numbers of all lanes need more registers than a core has.
    #[inline(always)]
    fn hinged<T: Real>(&self, joint: &Moved, from: &Own<T>, turn: &Turn<T>, joints: &JointMotion<T>, to: &mut Own<T>) {
        let (constant, sign) = (self.arm.constant(), joint.sign * self.ways.flip);
        let lengths = if constant.is_none() { self.arm.at(joints.lengths) } else { Vec3::zero() };
        let (qd, qdd) = (&joints.qd[joint.first], &joints.qdd[joint.first]);
        for half in 0..T::HALVES {
            let mut own = from.motion_half(half);
            own.felt = match constant {
                Some(arm) => own.felt_at(arm),
                None => own.felt_off(lengths.half(half)),
            };
            let [cos, sin] = [turn[0].half(half), turn[1].half(half)];
            let rates = [qd.half(half).scale(sign), qdd.half(half).scale(sign)];
            if let Some(entry) = &self.ways.entry {
                own.spin = entry.transposed_apply(own.spin);
                own.spun = entry.transposed_apply(own.spun);
                own.felt = entry.transposed_apply(own.felt);
            }
            match self.ways.axis {
                0 => to.spun::<0>(half, own, [cos, sin], rates),
                1 => to.spun::<1>(half, own, [cos, sin], rates),
                _ => to.spun::<2>(half, own, [cos, sin], rates),
            }
        }
    }
}

/// Rotates the axes of a vector about one of them.
#[inline(always)]
fn bent<T: Real, const AXIS: usize>(cos: T, sin: T, v: Vec3<T>) -> Vec3<T> {
    let (next, last) = ((AXIS + 1) % 3, (AXIS + 2) % 3);
    let mut out = v;
    out.0[next] = cos.madd(v.0[next], sin * v.0[last]);
    out.0[last] = cos.madd(v.0[last], -(sin * v.0[next]));
    out
}

impl<T: Real> Own<T> {
    /// Half of the lanes, without the magnetic field.
    #[inline(always)]
    fn motion_half(&self, half: usize) -> Own<T::Half> {
        Own { spin: self.spin.half(half), spun: self.spun.half(half), felt: self.felt.half(half), field: Vec3::zero() }
    }

    /// Sets half of the lanes to the motion after a hinge with this cosine, sine and rates.
    #[inline(always)]
    fn spun<const AXIS: usize>(
        &mut self,
        half: usize,
        from: Own<T::Half>,
        [cos, sin]: [T::Half; 2],
        [qd, qdd]: [T::Half; 2],
    ) {
        let (next, last) = ((AXIS + 1) % 3, (AXIS + 2) % 3);
        let mut w = bent::<T::Half, AXIS>(cos, sin, from.spin);
        let mut wd = bent::<T::Half, AXIS>(cos, sin, from.spun);
        wd.0[next] = w.0[last].madd(qd, wd.0[next]);
        wd.0[last] = (-w.0[next]).madd(qd, wd.0[last]);
        wd.0[AXIS] += qdd;
        w.0[AXIS] += qd;
        self.spin.set_half(half, w);
        self.spun.set_half(half, wd);
        self.felt.set_half(half, bent::<T::Half, AXIS>(cos, sin, from.felt));
    }

    /// Motion after a ball with these rates, in its child's axes.
    #[inline(always)]
    fn rolled(&mut self, turn: &Turn<T>, w: Vec3<T>, wd: Vec3<T>) {
        let turn = rows(turn);
        let spin = turn.apply_transposed(self.spin);
        self.spun = turn.apply_transposed(self.spun) + spin.cross(w) + wd;
        self.spin = spin + w;
        self.felt = turn.apply_transposed(self.felt);
    }
}

impl Moved {
    /// Rotation from child to joint.
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
pub(super) fn put_rows<T: Real>(m: Mat3<T>, turn: &mut Turn<T>) {
    let [[a, b, c], [d, e, f], [g, h, i]] = m.0;
    *turn = [a, b, c, d, e, f, g, h, i];
}
