//! Motions near a mean: points that share part of its posture share that part's rotations and arms.

use super::{FrameMotion, JointMotion, Link, Tree};
use crate::lane::Real;
use crate::model::JointKind;
use crate::rotation::{Mat3, Vec3};

/// How a link stands at the mean; vectors in root axes.
#[derive(Debug, Clone, Copy)]
pub struct Stance {
    /// Of the link's frame.
    pub frame: FrameMotion<f64>,
    /// From the parent's origin to the joint, along the joint, and on to the link's origin, m.
    arms: [Vec3<f64>; 3],
    /// Before the joint and behind it.
    axes: Mat3<f64>,
    turned: Mat3<f64>,
    sin_cos: (f64, f64),
}

impl Stance {
    /// Of a root, before anything is known.
    pub fn resting() -> Self {
        Stance {
            frame: FrameMotion::resting(Vec3::zero()),
            arms: [Vec3::zero(); 3],
            axes: Mat3::identity(),
            turned: Mat3::identity(),
            sin_cos: (0.0, 1.0),
        }
    }
}

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

/// What of a frame is not the mean's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Differs {
    /// Rotation and position.
    pub pose: bool,
    /// Velocities and accelerations.
    pub motion: bool,
}

/// What differs from the mean: states from `from` on, inputs, and whether any state does.
#[derive(Debug, Clone, Copy)]
pub struct Apart {
    /// First state that may differ.
    pub from: usize,
    /// Inputs do.
    pub inputs: bool,
    /// Rates, accelerations or the root's motion do.
    pub motion: bool,
}

/// Which frames are asked for.
#[derive(Debug, Clone, Copy)]
pub struct Wanted<'a> {
    /// At all.
    pub needed: &'a [bool],
    /// With velocities and accelerations.
    pub moving: &'a [bool],
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

    /// The mean's motion, and what others may share of it. Allocates nothing.
    #[inline(always)]
    pub fn settle(&self, root: FrameMotion<f64>, joints: JointMotion<f64>, needed: &[bool], stances: &mut [Stance]) {
        stances[0].frame = root;
        for (i, link) in self.links.iter().enumerate().skip(1) {
            if needed[i] {
                stances[i] = link.settled(stances[link.parent].frame, &joints);
            }
        }
    }

    /// Fills `frames` with what differs from the mean. Allocates nothing.
    #[inline(always)]
    #[allow(clippy::too_many_arguments)] // they are all different things
    pub fn motions_near<T: Real>(
        &self,
        root: FrameMotion<T>,
        joints: JointMotion<T>,
        wanted: Wanted,
        (apart, reaches): (Apart, &[Reach]),
        stances: &[Stance],
        frames: &mut [FrameMotion<T>],
        differs: &mut [Differs],
    ) {
        frames[0] = root;
        differs[0] = Differs { pose: false, motion: apart.motion };
        for (i, link) in self.links.iter().enumerate().skip(1) {
            if !wanted.needed[i] {
                continue;
            }
            let (moving, reach) = (wanted.moving[i], reaches[i]);
            let pose = reach.last > apart.from || (apart.inputs && reach.input);
            let motion = moving && (pose || apart.motion);
            differs[i] = Differs { pose, motion };
            if !pose && !motion {
                continue;
            }
            let (known, stance) = (differs[link.parent], &stances[link.parent].frame);
            let (above, below) = frames.split_at_mut(i);
            let (parent, frame) = (&above[link.parent], &mut below[0]);
            if moving && !known.motion {
                frame.angular_velocity = stance.angular_velocity.everywhere();
                frame.angular_acceleration = stance.angular_acceleration.everywhere();
                frame.proper_acceleration = stance.proper_acceleration.everywhere();
            } else if moving {
                frame.angular_velocity = parent.angular_velocity;
                frame.angular_acceleration = parent.angular_acceleration;
                frame.proper_acceleration = parent.proper_acceleration;
            }
            if !pose {
                link.kept(frame, &joints, &stances[i]);
                continue;
            }
            if known.pose {
                (frame.rotation, frame.position) = (parent.rotation, parent.position);
            } else {
                frame.rotation = stance.rotation.everywhere();
                frame.position = stance.position.everywhere();
            }
            let shared = reach.own <= apart.from && !(apart.inputs && reach.own_input);
            link.posed(frame, &joints, motion, shared.then_some(stances[i].sin_cos));
        }
    }
}

impl Link {
    #[inline(always)]
    fn settled(&self, mut frame: FrameMotion<f64>, joints: &JointMotion<f64>) -> Stance {
        let mut stance = Stance::resting();
        let here = frame.position;
        if let Some(before) = &self.before {
            frame.carried(before, joints.lengths, true);
        }
        (stance.arms[0], stance.axes) = (frame.position - here, frame.rotation);
        let here = frame.position;
        if let Some(joint) = &self.joint {
            if joint.kind == JointKind::Hinge {
                stance.sin_cos = (joints.q[joint.first] * joint.sign).sin_cos();
            }
            frame.moved(joint, joints, true, Some(stance.sin_cos));
        }
        (stance.arms[1], stance.turned) = (frame.position - here, frame.rotation);
        let here = frame.position;
        if let Some(after) = &self.after {
            frame.carried(after, joints.lengths, true);
        }
        stance.arms[2] = frame.position - here;
        Stance { frame, ..stance }
    }

    /// In another posture than the mean.
    #[inline(always)]
    pub(super) fn posed<T: Real>(
        &self,
        frame: &mut FrameMotion<T>,
        joints: &JointMotion<T>,
        motion: bool,
        sin_cos: Option<(f64, f64)>,
    ) {
        if let Some(before) = &self.before {
            frame.carried(before, joints.lengths, motion);
        }
        if let Some(joint) = &self.joint {
            frame.moved(joint, joints, motion, sin_cos);
        }
        if let Some(after) = &self.after {
            frame.carried(after, joints.lengths, motion);
        }
    }

    /// In the mean's posture, moving otherwise.
    #[inline(always)]
    fn kept<T: Real>(&self, frame: &mut FrameMotion<T>, joints: &JointMotion<T>, stance: &Stance) {
        if self.before.as_ref().is_some_and(|f| !f.translation.is_origin()) {
            frame.led(stance.arms[0]);
        }
        if let Some(joint) = &self.joint {
            frame.driven(joint, joints, stance);
        }
        if self.after.as_ref().is_some_and(|f| !f.translation.is_origin()) {
            frame.led(stance.arms[2]);
        }
    }
}

impl<T: Real> FrameMotion<T> {
    /// On to a point `arm` away, the same for all.
    #[inline(always)]
    fn led(&mut self, arm: Vec3<f64>) {
        self.proper_acceleration = self.proper_acceleration_led(arm);
    }

    /// Acceleration at a point that is fixed in the frame, `arm` away in root axes, the same for all.
    #[inline(always)]
    pub fn proper_acceleration_led(&self, arm: Vec3<f64>) -> Vec3<T> {
        let w = self.angular_velocity;
        self.proper_acceleration + self.angular_acceleration.cross_equal(arm) + w.cross(w.cross_equal(arm))
    }

    #[inline(always)]
    fn driven(&mut self, joint: &super::Moved, joints: &JointMotion<T>, stance: &Stance) {
        let (first, sign) = (joint.first, joint.sign);
        match joint.kind {
            JointKind::Hinge => {
                let (z, w) = (stance.axes.column(2), self.angular_velocity);
                let (qd, qdd) = (joints.qd[first].scale(sign), joints.qdd[first].scale(sign));
                self.angular_acceleration = (self.angular_acceleration + w.cross_equal(z) * qd).plus_equal(z, qdd);
                self.angular_velocity = w.plus_equal(z, qd);
            }
            JointKind::Slide => {
                let (z, w) = (stance.axes.column(2), self.angular_velocity);
                let (qd, qdd) = (joints.qd[first].scale(2.0 * sign), joints.qdd[first].scale(sign));
                let coriolis = w.cross_equal(z) * qd;
                self.proper_acceleration = (self.proper_acceleration_led(stance.arms[1]) + coriolis).plus_equal(z, qdd);
            }
            JointKind::Fixed => {}
            JointKind::Ball => self.spun(joints, first, &stance.turned),
            JointKind::Free => {
                let v = stance.axes.apply_lanes(super::three(joints.qd, first));
                let a = stance.axes.apply_lanes(super::three(joints.qdd, first));
                let coriolis = self.angular_velocity.cross(v + v);
                self.proper_acceleration = self.proper_acceleration_led(stance.arms[1]) + coriolis + a;
                self.spun(joints, first + 3, &stance.turned);
            }
        }
    }

    #[inline(always)]
    fn spun(&mut self, joints: &JointMotion<T>, first: usize, turned: &Mat3<f64>) {
        let spin = turned.apply_lanes(super::three(joints.qd, first));
        let spun = turned.apply_lanes(super::three(joints.qdd, first));
        self.angular_acceleration += spun + self.angular_velocity.cross(spin);
        self.angular_velocity += spin;
    }
}
