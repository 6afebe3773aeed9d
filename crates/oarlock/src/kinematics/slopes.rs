//! Exact derivatives of every frame's motion by joints and lengths, in one recursion. The Jacobian of the readings uses
//! it.
//!
//! Everything behind a joint moves as one rigid piece. The derivative by one coordinate is therefore six vectors,
//! written at the root's origin, that are valid for the whole piece: the derivatives of a spatial acceleration
//! (Featherstone 2008, chapter 2; Carpentier and Mansard 2018), here of the specific force. Let the joint be at o with
//! axis e. Let the carrier have angular velocity w with derivative wd, and velocity v and proper acceleration a at o.
//! The derivative by
//!
//! - an angle rotates the piece by e and not the carrier's motion: spin = -e x w, spun = -e x wd + w x spin;
//! - a rate adds spin = e, spun = (w + w') x e, with the child's angular velocity w';
//! - an acceleration adds spun = e;
//!
//! and push = -e x a (only for an angle) - spun x o - 2 spin x v. For a slide, push is wd x e + w x (w x e), 2 w x e
//! and e. The velocity of the point p changes by e x (its velocity) (only for an angle) + spin x p + drift; for a slide drift is
//! w x e and, by its rate, e.

use super::{Fixed, FrameMotion, JointMotion, Link, Moved, Tree};
use crate::model::{JointKind, Point};
use crate::rotation::Vec3;
use std::ops::Range;

/// Which vectors of a slope are not zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// By an angle: all of them.
    Turn,
    /// By an angular rate: all but `turn` and `shift`.
    Rate,
    /// By an angular acceleration: `spun` and `push`.
    Accel,
    /// By a position or a length: `shift`, `push` and `drift`.
    Shift,
    /// By the rate or acceleration of a position: `push` and, by the rate, `drift`.
    Push,
}

/// Derivative of the motion of everything behind a joint by one number, in root axes.
#[derive(Debug, Clone, Copy)]
pub struct Slope {
    /// Column of the Jacobian.
    pub column: usize,
    /// Which vectors are not zero.
    pub kind: Kind,
    /// Rotation about the root's origin.
    pub turn: Vec3<f64>,
    /// Translation of a point at the root's origin.
    pub shift: Vec3<f64>,
    /// Angular velocity, for an observer on the piece.
    pub spin: Vec3<f64>,
    /// Angular acceleration, as it enters accelerations.
    pub spun: Vec3<f64>,
    /// Proper acceleration at the root's origin.
    pub push: Vec3<f64>,
    /// Velocity of a point at the root's origin, without that by `turn`.
    pub drift: Vec3<f64>,
}

impl Slope {
    /// Derivative of a position, m.
    #[inline(always)]
    pub fn place(&self, place: Vec3<f64>) -> Vec3<f64> {
        match self.kind {
            Kind::Turn => self.shift + self.turn.cross(place),
            _ => self.shift,
        }
    }

    /// Derivative of the velocity of a point at `place`, m/s.
    #[inline(always)]
    pub fn speed(&self, place: Vec3<f64>, velocity: Vec3<f64>) -> Vec3<f64> {
        self.turn.cross(velocity) + self.spin.cross(place) + self.drift
    }
}

/// Columns of a Jacobian, and their scale factors.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Columns {
    /// Per coordinate: its value, rate and acceleration.
    pub coordinates: Vec<[Option<(usize, f64)>; 3]>,
    /// Per estimated length: its column.
    pub lengths: Vec<usize>,
}

/// All slopes of a tree.
#[derive(Debug, Clone)]
pub struct Slopes {
    columns: Columns,
    slopes: Vec<Slope>,
    /// Slopes of the frame's own link.
    own: Vec<Range<usize>>,
    parents: Vec<usize>,
    /// Per frame: its motion directly after its joint.
    pub stances: Vec<FrameMotion<f64>>,
    /// Sine and cosine of a hinge's angle.
    pub sin_cos: Vec<(f64, f64)>,
}

impl Slopes {
    /// Numbers of the slopes of a frame's motion: its own and those of its ancestors.
    pub fn chain(&self, mut frame: usize) -> Vec<usize> {
        let mut found = Vec::new();
        while frame != 0 {
            found.extend(self.own[frame].clone());
            frame = self.parents[frame];
        }
        found
    }

    /// A slope by its number.
    #[inline(always)]
    pub fn slope(&self, number: usize) -> &Slope {
        &self.slopes[number]
    }
}

/// Derivatives of a point by the lengths that it depends on, on a frame with this motion: column, shift and push.
#[inline(always)]
fn stretched(
    point: &Point,
    motion: &FrameMotion<f64>,
    columns: &[usize],
    mut see: impl FnMut(usize, Vec3<f64>, Vec3<f64>),
) {
    for (number, slope) in point.slopes() {
        let shift = motion.rotation.apply_f64(*slope);
        see(columns[*number], shift, rigid_acceleration(motion, shift));
    }
}

/// Acceleration of a point at `arm`, relative to the frame's origin.
#[inline(always)]
pub fn rigid_acceleration(motion: &FrameMotion<f64>, arm: Vec3<f64>) -> Vec3<f64> {
    let w = motion.angular_velocity;
    motion.angular_acceleration.cross(arm) + w.cross(w.cross(arm))
}

fn three(v: &[f64], first: usize) -> Vec3<f64> {
    Vec3([v[first], v[first + 1], v[first + 2]])
}

/// Current frame of the recursion.
struct Walk<'a> {
    columns: &'a Columns,
    slopes: &'a mut [Slope],
    next: usize,
    motion: FrameMotion<f64>,
    sin_cos: (f64, f64),
}

const ZERO: Vec3<f64> = Vec3([0.0; 3]);

impl Walk<'_> {
    fn push(&mut self, column: usize, kind: Kind, vectors: [Vec3<f64>; 6]) {
        let [turn, shift, spin, spun, push, drift] = vectors;
        self.slopes[self.next] = Slope { column, kind, turn, shift, spin, spun, push, drift };
        self.next += 1;
    }

    fn carried(&mut self, fixed: &Fixed, joints: &JointMotion<f64>) {
        let columns = self.columns;
        let here = self.motion;
        stretched(&fixed.translation, &here, &columns.lengths, |column, shift, push| {
            let drift = here.angular_velocity.cross(shift);
            self.push(column, Kind::Shift, [ZERO, shift, ZERO, ZERO, push, drift]);
        });
        self.motion.carried(fixed, joints.lengths);
    }

    fn moved(&mut self, joint: &Moved, joints: &JointMotion<f64>) {
        let (first, here) = (joint.first, self.motion);
        let z = here.rotation.column(2) * joint.sign;
        match joint.kind {
            JointKind::Fixed => {}
            JointKind::Hinge => {
                self.sin_cos = (joints.q[first] * joint.sign).sin_cos();
                self.motion.moved(joint, joints, Some(self.sin_cos));
                self.turn(first, z, &here);
            }
            JointKind::Slide => {
                self.motion.moved(joint, joints, None);
                self.slide(first, z, &here);
            }
            JointKind::Ball => self.ball(first, joint.turn, joints),
            JointKind::Free => {
                let [p, v, a] = [joints.q, joints.qd, joints.qdd].map(|x| three(x, first));
                self.motion.placed(p, v, a);
                (0..3).for_each(|k| self.slide(first + k, here.rotation.column(k), &here));
                self.ball(first + 3, joint.turn, joints);
            }
        }
    }

    fn ball(&mut self, first: usize, number: usize, joints: &JointMotion<f64>) {
        let here = self.motion;
        let [r, w, wd] = [joints.q, joints.qd, joints.qdd].map(|x| three(x, first));
        self.motion.balled(joints.anchors.get(number), r, w, wd);
        let turned = self.motion.rotation;
        (0..3).for_each(|k| self.turn(first + k, turned.column(k), &here));
    }

    /// Slopes of a rotation about `axis`, carried by `here`.
    fn turn(&mut self, coordinate: usize, axis: Vec3<f64>, here: &FrameMotion<f64>) {
        let [value, rate, accel] = self.columns.coordinates[coordinate];
        let (origin, velocity, w) = (here.position, here.velocity, here.angular_velocity);
        let push = |spin: Vec3<f64>, spun: Vec3<f64>| origin.cross(spun) + velocity.cross(spin + spin);
        if let Some((column, scale)) = value {
            let e = axis * scale;
            let spin = w.cross(e);
            let spun = here.angular_acceleration.cross(e) + w.cross(spin);
            let push = push(spin, spun) + here.proper_acceleration.cross(e);
            let drift = origin.cross(spin) + velocity.cross(e);
            self.push(column, Kind::Turn, [e, origin.cross(e), spin, spun, push, drift]);
        }
        if let Some((column, scale)) = rate {
            let e = axis * scale;
            let spun = (w + self.motion.angular_velocity).cross(e);
            self.push(column, Kind::Rate, [ZERO, ZERO, e, spun, push(e, spun), origin.cross(e)]);
        }
        if let Some((column, scale)) = accel {
            let e = axis * scale;
            self.push(column, Kind::Accel, [ZERO, ZERO, ZERO, e, origin.cross(e), ZERO]);
        }
    }

    /// Slopes of a translation along `axis`, carried by `here`.
    fn slide(&mut self, coordinate: usize, axis: Vec3<f64>, here: &FrameMotion<f64>) {
        let [value, rate, accel] = self.columns.coordinates[coordinate];
        if let Some((column, scale)) = value {
            let e = axis * scale;
            let drift = here.angular_velocity.cross(e);
            self.push(column, Kind::Shift, [ZERO, e, ZERO, ZERO, rigid_acceleration(here, e), drift]);
        }
        if let Some((column, scale)) = rate {
            let e = axis * scale;
            self.push(column, Kind::Push, [ZERO, ZERO, ZERO, ZERO, here.angular_velocity.cross(e + e), e]);
        }
        if let Some((column, scale)) = accel {
            self.push(column, Kind::Push, [ZERO, ZERO, ZERO, ZERO, axis * scale, ZERO]);
        }
    }
}

impl Link {
    /// Number of the link's own slopes.
    fn slope_count(&self, columns: &Columns) -> usize {
        let there = |c: usize| columns.coordinates[c].iter().flatten().count();
        let joint = self.joint.map_or(0, |j| (j.first..j.first + j.kind.width()).map(there).sum());
        let fixed = [&self.before, &self.after].into_iter().flatten().map(|f| f.translation.slopes().len());
        joint + fixed.sum::<usize>()
    }
}

impl Tree {
    /// Workspace for the slopes of this tree.
    pub fn slopes(&self, columns: Columns) -> Slopes {
        let mut own = Vec::with_capacity(self.len());
        let mut total = 0;
        for link in &self.links {
            let count = link.slope_count(&columns);
            own.push(total..total + count);
            total += count;
        }
        let none = Slope {
            column: 0,
            kind: Kind::Push,
            turn: ZERO,
            shift: ZERO,
            spin: ZERO,
            spun: ZERO,
            push: ZERO,
            drift: ZERO,
        };
        let (still, lengths) = (vec![0.0; columns.coordinates.len()], vec![0.0; columns.lengths.len()]);
        let rest = FrameMotion::resting(ZERO);
        let mut slopes = Slopes {
            columns,
            slopes: vec![none; total],
            own,
            parents: self.links.iter().map(|l| l.parent).collect(),
            stances: vec![rest; self.len()],
            sin_cos: vec![(0.0, 1.0); self.len()],
        };
        // Columns and kinds do not depend on the pose.
        let joints = JointMotion { q: &still, qd: &still, qdd: &still, lengths: &lengths, anchors: &[] };
        self.motions_with_slopes(rest, joints, &vec![true; self.len()], &mut vec![rest; self.len()], &mut slopes);
        slopes
    }

    /// Like `motions`, with the slopes of every frame that is `needed`. The root's velocity is zero. Allocates nothing.
    pub fn motions_with_slopes(
        &self,
        root: FrameMotion<f64>,
        joints: JointMotion<f64>,
        needed: &[bool],
        frames: &mut [FrameMotion<f64>],
        slopes: &mut Slopes,
    ) {
        frames[0] = root;
        let Slopes { columns, slopes, own, stances, sin_cos, .. } = slopes;
        stances[0] = root;
        for (i, link) in self.links.iter().enumerate().skip(1).filter(|(i, _)| needed[*i]) {
            let (motion, next) = (frames[link.parent], own[i].start);
            let mut walk = Walk { columns, slopes, next, motion, sin_cos: (0.0, 1.0) };
            if let Some(before) = &link.before {
                walk.carried(before, &joints);
            }
            if let Some(joint) = &link.joint {
                walk.moved(joint, &joints);
            }
            (stances[i], sin_cos[i]) = (walk.motion, walk.sin_cos);
            if let Some(after) = &link.after {
                walk.carried(after, &joints);
            }
            frames[i] = walk.motion;
        }
    }
}
