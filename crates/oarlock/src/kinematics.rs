//! Poses, velocities and accelerations of all frames of the tree in one recursion. Sensors and exports use it.
//!
//! All vectors are in root axes. A frame follows its parent by a fixed transform, the joint's motion about or along z,
//! and another fixed transform. The recursion is eq. 9 of Ruffaldi, Peppoloni and Filippeschi, with the prismatic and
//! Coriolis terms that the printed equation omits. Gravity enters once, at the root.

pub mod near;
pub mod pieces;
pub mod slopes;

use crate::kernels::lane::Real;
use crate::model::{JointKind, Model, Point, Transform};
use crate::rotation::{Mat3, Vec3};

/// A fixed transform with numbers instead of expressions.
#[derive(Debug, Clone)]
struct Fixed {
    rotation: Mat3<f64>,
    swap: Swap,
    translation: Point,
}

/// Special forms of a fixed rotation that allow a cheaper product.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Swap {
    Nothing,
    /// Each new axis is an old one or its opposite.
    Axes([(usize, f64); 3]),
    Anything,
}

/// Entries this close to 0, 1 or -1 are rounded to it: cos(pi/2) is 6e-17 in doubles.
const MEANT: f64 = 1e-15;

impl Fixed {
    fn new(rotation: Mat3<f64>, translation: Point) -> Self {
        let meant = |x: f64| if (x - x.round()).abs() < MEANT { x.round() } else { x };
        let rotation = Mat3(rotation.0.map(|row| row.map(meant)));
        let axis = |j: usize| {
            let column = rotation.column(j).0;
            let i = column.iter().position(|x| x.abs() == 1.0)?;
            (0..3).all(|k| k == i || column[k] == 0.0).then_some((i, column[i]))
        };
        let swap = match [axis(0), axis(1), axis(2)] {
            _ if rotation == Mat3::identity() => Swap::Nothing,
            [Some(x), Some(y), Some(z)] => Swap::Axes([x, y, z]),
            _ => Swap::Anything,
        };
        Fixed { rotation, swap, translation }
    }

    #[inline(always)]
    fn turn<T: Real>(&self, m: &Mat3<T>) -> Mat3<T> {
        match self.swap {
            Swap::Nothing => *m,
            Swap::Axes(axes) => {
                let mut out = *m;
                for (to, row) in out.0.iter_mut().zip(&m.0) {
                    for (to, (from, sign)) in to.iter_mut().zip(axes) {
                        *to = row[from].scale(sign);
                    }
                }
                out
            }
            Swap::Anything => m.times_f64(&self.rotation),
        }
    }
}

/// Joint of a link: first coordinate, sign and kind, and its number among the joints with free rotation.
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

impl Link {
    #[inline(always)]
    fn posed<T: Real>(&self, frame: &mut FrameMotion<T>, joints: &JointMotion<T>) {
        if let Some(before) = &self.before {
            frame.carried(before, joints.lengths);
        }
        if let Some(joint) = &self.joint {
            frame.moved(joint, joints, None);
        }
        if let Some(after) = &self.after {
            frame.carried(after, joints.lengths);
        }
    }
}

/// The tree at one set of parameter values.
#[derive(Debug, Clone)]
pub struct Tree {
    links: Vec<Link>,
}

/// Motion of a frame, in root axes.
#[derive(Debug, Clone, Copy)]
pub struct FrameMotion<T> {
    /// Root from frame.
    pub rotation: Mat3<T>,
    /// Origin, m.
    pub position: Vec3<T>,
    /// Velocity of the origin relative to the root, m/s.
    pub velocity: Vec3<T>,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vec3<T>,
    /// Angular acceleration, rad/s2.
    pub angular_acceleration: Vec3<T>,
    /// Acceleration of the origin minus gravity, m/s2: the reading of an accelerometer there.
    pub proper_acceleration: Vec3<T>,
}

impl<T: Real> FrameMotion<T> {
    /// A root at rest with this `proper_acceleration` (m/s2).
    #[inline(always)]
    pub fn resting(proper_acceleration: Vec3<T>) -> Self {
        FrameMotion {
            rotation: Mat3::identity(),
            position: Vec3::zero(),
            velocity: Vec3::zero(),
            angular_velocity: Vec3::zero(),
            angular_acceleration: Vec3::zero(),
            proper_acceleration,
        }
    }

    /// Velocity of a point fixed in the frame, at `arm` from its origin in root axes.
    #[inline(always)]
    pub fn velocity_at(&self, arm: Vec3<T>) -> Vec3<T> {
        self.velocity + self.angular_velocity.cross(arm)
    }

    /// Acceleration of a point fixed in the frame, at `arm` from its origin in root axes.
    #[inline(always)]
    pub fn proper_acceleration_at(&self, arm: Vec3<T>) -> Vec3<T> {
        let w = self.angular_velocity;
        self.proper_acceleration + self.angular_acceleration.cross(arm) + w.cross(w.cross(arm))
    }

    #[inline(always)]
    fn carried(&mut self, fixed: &Fixed, lengths: &[T]) {
        if !fixed.translation.is_origin() {
            let arm = fixed.translation.turned(&self.rotation, lengths);
            self.proper_acceleration = self.proper_acceleration_at(arm);
            self.velocity = self.velocity_at(arm);
            self.position += arm;
        }
        self.rotation = fixed.turn(&self.rotation);
    }

    /// `sin_cos`: sine and cosine of a hinge's angle, if they are known.
    #[inline(always)]
    fn moved(&mut self, joint: &Moved, joints: &JointMotion<T>, sin_cos: Option<(f64, f64)>) {
        let Moved { first, sign, kind, turn } = *joint;
        match kind {
            JointKind::Hinge => {
                let (sin, cos) = match sin_cos {
                    Some((sin, cos)) => (T::splat(sin), T::splat(cos)),
                    None => joints.q[first].scale(sign).sin_cos(),
                };
                self.spun_about_z(joints.qd[first].scale(sign), joints.qdd[first].scale(sign));
                self.rotation = self.rotation.turned_about_z(sin, cos);
            }
            JointKind::Slide => {
                let (q, qd) = (joints.q[first].scale(sign), joints.qd[first].scale(sign));
                self.slid(q, qd, joints.qdd[first].scale(sign));
            }
            JointKind::Fixed => {}
            JointKind::Ball => {
                let (r, w) = (three(joints.q, first), three(joints.qd, first));
                self.balled(joints.anchors.get(turn), r, w, three(joints.qdd, first));
            }
            JointKind::Free => {
                self.placed(three(joints.q, first), three(joints.qd, first), three(joints.qdd, first));
                let (r, w) = (three(joints.q, first + 3), three(joints.qd, first + 3));
                self.balled(joints.anchors.get(turn), r, w, three(joints.qdd, first + 3));
            }
        }
    }

    #[inline(always)]
    fn spun_about_z(&mut self, qd: T, qdd: T) {
        let z = self.rotation.column(2);
        let spin = z * qd;
        self.angular_acceleration = (self.angular_acceleration + self.angular_velocity.cross(spin)).plus(z, qdd);
        self.angular_velocity += spin;
    }

    /// Rotates by `anchor` and then `r`; `w` and `wd` are the child's relative angular velocity and its derivative in
    /// the child's axes.
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

    /// Moves to a position in its own axes, with velocity and acceleration there.
    #[inline(always)]
    fn placed(&mut self, p: Vec3<T>, v: Vec3<T>, a: Vec3<T>) {
        let (arm, v, a) = (self.rotation.apply(p), self.rotation.apply(v), self.rotation.apply(a));
        let coriolis = self.angular_velocity.cross(v + v);
        self.proper_acceleration = self.proper_acceleration_at(arm) + coriolis + a;
        self.velocity = self.velocity_at(arm) + v;
        self.position += arm;
    }

    #[inline(always)]
    fn slid(&mut self, q: T, qd: T, qdd: T) {
        let z = self.rotation.column(2);
        let arm = z * q;
        let coriolis = self.angular_velocity.cross(z * qd.scale(2.0));
        self.proper_acceleration = self.proper_acceleration_at(arm) + coriolis + z * qdd;
        self.velocity = self.velocity_at(arm) + z * qd;
        self.position += arm;
    }
}

/// Joint coordinates at one instant: angles (rad), positions (m), rotation vectors (rad), and their rates. The rates of
/// a rotation vector are the child's angular velocity relative to its parent, in the child's axes, and its derivative.
#[derive(Debug, Clone, Copy)]
pub struct JointMotion<'a, T> {
    /// Values, rad or m.
    pub q: &'a [T],
    /// Rates, per s.
    pub qd: &'a [T],
    /// Accelerations, per s2.
    pub qdd: &'a [T],
    /// Values of the estimated parameters.
    pub lengths: &'a [T],
    /// Per joint with free rotation: the rotation about which its rotation vector is defined. Empty: the identity.
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

    /// The same with estimated parameters (indices `estimated`), whose values come with every motion.
    pub fn with_lengths(model: &Model, parameters: &[f64], estimated: &[usize]) -> Self {
        let fixed = |t: &Option<Transform>| {
            t.as_ref().map(|t| Fixed::new(t.evaluate(parameters).0, Point::reached_by(t, parameters, estimated)))
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

    /// Number of frames, including the root.
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
            link.posed(&mut frame, &joints);
            frames[i] = frame;
        }
    }
}
