//! Poses, angular rates and accelerations of all frames in one pass down the tree.
//!
//! Everything is expressed in root axes. A frame is reached from its parent by a fixed transform, the joint's motion
//! about or along z, and another fixed transform; the recursion is eq. 9 of Ruffaldi, Peppoloni and Filippeschi with
//! the prismatic and Coriolis terms that the printed equation leaves out, and gravity entering once, at the root.

pub mod slopes;

use crate::lane::Real;
use crate::model::{JointKind, Model, Point, Transform};
use crate::rotation::{Mat3, Vec3};

/// A fixed transform with numbers in place of expressions.
#[derive(Debug, Clone)]
struct Fixed {
    rotation: Mat3<f64>,
    translation: Point,
}

/// What moves a link: its joint's first coordinate, sign and kind, and the joint's number among those that turn freely.
#[derive(Debug, Clone, Copy)]
struct Moved {
    first: usize,
    sign: f64,
    kind: JointKind,
    turn: usize,
}

#[derive(Debug, Clone)]
struct Link {
    parent: usize,
    before: Option<Fixed>,
    joint: Option<Moved>,
    after: Option<Fixed>,
}

/// The tree at one set of parameter values.
#[derive(Debug, Clone)]
pub struct Tree {
    links: Vec<Link>,
}

/// How a frame stands and moves, in root axes.
#[derive(Debug, Clone, Copy)]
pub struct FrameMotion<T> {
    /// Root from frame.
    pub rotation: Mat3<T>,
    /// Origin, m.
    pub position: Vec3<T>,
    /// rad/s.
    pub angular_velocity: Vec3<T>,
    /// rad/s2.
    pub angular_acceleration: Vec3<T>,
    /// Acceleration of the origin minus gravity, m/s2: what an accelerometer there would feel.
    pub proper_acceleration: Vec3<T>,
}

impl<T: Real> FrameMotion<T> {
    /// A root at rest that feels `proper_acceleration` (m/s2).
    #[inline(always)]
    pub fn resting(proper_acceleration: Vec3<T>) -> Self {
        FrameMotion {
            rotation: Mat3::identity(),
            position: Vec3::zero(),
            angular_velocity: Vec3::zero(),
            angular_acceleration: Vec3::zero(),
            proper_acceleration,
        }
    }

    /// Acceleration at a point that is fixed in the frame, `arm` away in root axes.
    #[inline(always)]
    pub fn proper_acceleration_at(&self, arm: Vec3<T>) -> Vec3<T> {
        let w = self.angular_velocity;
        self.proper_acceleration + self.angular_acceleration.cross(arm) + w.cross(w.cross(arm))
    }

    #[inline(always)]
    fn carried(&mut self, fixed: &Fixed, lengths: &[T]) {
        let arm = fixed.translation.turned(&self.rotation, lengths);
        self.proper_acceleration = self.proper_acceleration_at(arm);
        self.position += arm;
        self.rotation = self.rotation.times_f64(&fixed.rotation);
    }

    #[inline(always)]
    fn moved(&mut self, joint: &Moved, joints: &JointMotion<T>) {
        let Moved { first, sign, kind, turn } = *joint;
        let scaled = || [joints.q, joints.qd, joints.qdd].map(|v| v[first].scale(sign));
        let vectors = |at: usize| [joints.q, joints.qd, joints.qdd].map(|v| three(v, at));
        match kind {
            JointKind::Hinge => {
                let [q, qd, qdd] = scaled();
                self.turned(q, qd, qdd);
            }
            JointKind::Slide => {
                let [q, qd, qdd] = scaled();
                self.slid(q, qd, qdd);
            }
            JointKind::Fixed => {}
            JointKind::Ball => {
                let [r, w, wd] = vectors(first);
                self.balled(joints.anchors.get(turn), r, w, wd);
            }
            JointKind::Free => {
                let [p, v, a] = vectors(first);
                self.placed(p, v, a);
                let [r, w, wd] = vectors(first + 3);
                self.balled(joints.anchors.get(turn), r, w, wd);
            }
        }
    }

    #[inline(always)]
    fn turned(&mut self, q: T, qd: T, qdd: T) {
        let z = self.rotation.column(2);
        let (sin, cos) = q.sin_cos();
        self.rotation = self.rotation.turned_about_z(sin, cos);
        let spin = z * qd;
        self.angular_acceleration += z * qdd + self.angular_velocity.cross(spin);
        self.angular_velocity += spin;
    }

    /// By `anchor` and then `r`; `w` and `wd` are the child's rate and its derivative in the child's axes.
    #[inline(always)]
    fn balled(&mut self, anchor: Option<&Mat3<f64>>, r: Vec3<T>, w: Vec3<T>, wd: Vec3<T>) {
        let turn = Mat3::about(r);
        self.rotation = match anchor {
            Some(anchor) => self.rotation.times_f64(anchor).then(&turn),
            None => self.rotation.then(&turn),
        };
        let spin = self.rotation.apply(w);
        self.angular_acceleration += self.rotation.apply(wd) + self.angular_velocity.cross(spin);
        self.angular_velocity += spin;
    }

    /// To a place in its own axes, with its velocity and acceleration there.
    #[inline(always)]
    fn placed(&mut self, p: Vec3<T>, v: Vec3<T>, a: Vec3<T>) {
        let (arm, v, a) = (self.rotation.apply(p), self.rotation.apply(v), self.rotation.apply(a));
        let coriolis = self.angular_velocity.cross(v + v);
        self.proper_acceleration = self.proper_acceleration_at(arm) + coriolis + a;
        self.position += arm;
    }

    #[inline(always)]
    fn slid(&mut self, q: T, qd: T, qdd: T) {
        let z = self.rotation.column(2);
        let arm = z * q;
        let coriolis = self.angular_velocity.cross(z * qd.scale(2.0));
        self.proper_acceleration = self.proper_acceleration_at(arm) + coriolis + z * qdd;
        self.position += arm;
    }
}

/// Joint coordinates of one instant: angles (rad), positions (m), rotation vectors (rad), and their rates. The rates of a
/// rotation vector are the child's angular velocity against its parent in the child's axes, and that one's derivative.
#[derive(Debug, Clone, Copy)]
pub struct JointMotion<'a, T> {
    /// rad or m.
    pub q: &'a [T],
    /// Per s.
    pub qd: &'a [T],
    /// Per s2.
    pub qdd: &'a [T],
    /// Values of the parameters that are estimated.
    pub lengths: &'a [T],
    /// Per joint that turns freely: the rotation from which its rotation vector counts; none at all: from no rotation.
    pub anchors: &'a [Mat3<f64>],
}

#[inline(always)]
fn three<T: Copy>(v: &[T], first: usize) -> Vec3<T> {
    Vec3([v[first], v[first + 1], v[first + 2]])
}

impl Tree {
    /// The model's tree at `parameters` (in the order of `model.parameters`).
    pub fn new(model: &Model, parameters: &[f64]) -> Self {
        Self::with_lengths(model, parameters, &[])
    }

    /// The same; the parameters of index `estimated` come with every motion.
    pub fn with_lengths(model: &Model, parameters: &[f64], estimated: &[usize]) -> Self {
        let fixed = |t: &Option<Transform>| {
            t.as_ref().map(|t| Fixed {
                rotation: t.evaluate(parameters).0,
                translation: Point::reached_by(t, parameters, estimated),
            })
        };
        let moved = |(j, sign): (usize, f64)| {
            let turn = model.joints[..j].iter().filter(|j| j.kind.turns_freely()).count();
            Moved { first: model.joints[j].first, sign, kind: model.joints[j].kind, turn }
        };
        let links = model.frames.iter().map(|f| Link {
            parent: f.parent,
            before: fixed(&f.before),
            joint: f.joint.map(moved),
            after: fixed(&f.after),
        });
        Tree { links: links.collect() }
    }

    /// How many frames there are, the root included.
    pub fn len(&self) -> usize {
        self.links.len()
    }

    /// A tree has at least its root.
    pub fn is_empty(&self) -> bool {
        self.links.is_empty()
    }

    /// Marks in `needed` the ancestors of the marked frames.
    pub fn mark_ancestors(&self, needed: &mut [bool]) {
        for i in (1..self.links.len()).rev() {
            if needed[i] {
                needed[self.links[i].parent] = true;
            }
        }
    }

    /// Fills `frames` for every frame that is `needed`, from the motion of the root. Allocates nothing.
    pub fn motions<T: Real>(
        &self,
        root: FrameMotion<T>,
        joints: JointMotion<T>,
        needed: &[bool],
        frames: &mut [FrameMotion<T>],
    ) {
        frames[0] = root;
        for (i, link) in self.links.iter().enumerate().skip(1) {
            if !needed[i] {
                continue;
            }
            let mut frame = frames[link.parent];
            if let Some(before) = &link.before {
                frame.carried(before, joints.lengths);
            }
            if let Some(joint) = &link.joint {
                frame.moved(joint, &joints);
            }
            if let Some(after) = &link.after {
                frame.carried(after, joints.lengths);
            }
            frames[i] = frame;
        }
    }
}
