//! Poses, angular rates and accelerations of all frames in one pass down the tree.
//!
//! Everything is expressed in root axes. A frame is reached from its parent by a fixed transform, the joint's motion
//! about or along z, and another fixed transform; the recursion is eq. 9 of Ruffaldi, Peppoloni and Filippeschi with
//! the prismatic and Coriolis terms that the printed equation leaves out, and gravity entering once, at the root.

use crate::lane::Real;
use crate::model::{JointKind, Model, Transform};
use crate::rotation::{Mat3, Vec3};

/// A fixed transform with numbers in place of expressions.
#[derive(Debug, Clone)]
struct Fixed {
    rotation: Mat3<f64>,
    translation: [f64; 3],
}

#[derive(Debug, Clone)]
struct Link {
    parent: usize,
    before: Option<Fixed>,
    joint: Option<(usize, f64, JointKind)>,
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
    fn carried(&mut self, fixed: &Fixed) {
        let arm = self.rotation.apply_f64(fixed.translation);
        self.proper_acceleration = self.proper_acceleration_at(arm);
        self.position += arm;
        self.rotation = self.rotation.times_f64(&fixed.rotation);
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

    #[inline(always)]
    fn slid(&mut self, q: T, qd: T, qdd: T) {
        let z = self.rotation.column(2);
        let arm = z * q;
        let coriolis = self.angular_velocity.cross(z * qd.scale(2.0));
        self.proper_acceleration = self.proper_acceleration_at(arm) + coriolis + z * qdd;
        self.position += arm;
    }
}

/// Joint values of one instant: angles (rad) or positions (m) and their derivatives.
#[derive(Debug, Clone, Copy)]
pub struct JointMotion<'a, T> {
    /// rad or m.
    pub q: &'a [T],
    /// Per s.
    pub qd: &'a [T],
    /// Per s2.
    pub qdd: &'a [T],
}

impl Tree {
    /// The model's tree at `parameters` (in the order of `model.parameters`).
    pub fn new(model: &Model, parameters: &[f64]) -> Self {
        let fixed = |t: &Option<Transform>| {
            t.as_ref().map(|t| {
                let (rotation, translation) = t.evaluate(parameters);
                Fixed { rotation, translation }
            })
        };
        let links = model.frames.iter().map(|f| Link {
            parent: f.parent,
            before: fixed(&f.before),
            joint: f.joint.map(|(j, sign)| (j, sign, model.joints[j].kind)),
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
                frame.carried(before);
            }
            if let Some((j, sign, kind)) = link.joint {
                let (q, qd, qdd) = (joints.q[j], joints.qd[j], joints.qdd[j]);
                let (q, qd, qdd) = (q.scale(sign), qd.scale(sign), qdd.scale(sign));
                match kind {
                    JointKind::Hinge => frame.turned(q, qd, qdd),
                    JointKind::Slide => frame.slid(q, qd, qdd),
                    JointKind::Fixed => {}
                }
            }
            if let Some(after) = &link.after {
                frame.carried(after);
            }
            frames[i] = frame;
        }
    }
}
