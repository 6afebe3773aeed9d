//! Motions near a mean, in the axes of each piece: points share with the mean the posture of what they do not move.
//!
//! In its own axes a piece's arms, its joint's axis and its sensors stand still, so a step down the tree only turns vectors:
//! w = C' w + z q', w' = C' w' + (C' w) x z q' + z q'', a = C' (a + w' x r + w x (w x r)), by joint rotations C. Places of points are
//! found on the way up, from their piece to one that stands as the mean's does.

mod step;

use super::pieces::Pieces;
use super::slopes::Slopes;
use super::{FrameMotion, JointMotion, Tree};
use crate::kernels::lane::Real;
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
        w.cross_onto(w.cross_equal(arm), self.spun.cross_equal_onto(arm, self.felt))
    }

    /// What is felt `arm` away.
    #[inline(always)]
    pub fn felt_off(&self, arm: Vec3<T>) -> Vec3<T> {
        let w = self.spin;
        w.cross_onto(w.cross(arm), self.spun.cross_onto(arm, self.felt))
    }
}

/// A joint's rotation. Of a hinge, the cosine and sine of the turn about its axis; of a ball, row by row.
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
pub struct PerturbedMotion {
    /// First state that may differ.
    pub from: usize,
    /// Inputs do.
    pub inputs: bool,
    /// Rates, accelerations or the root's motion do.
    pub motion: bool,
    /// The magnetic field does.
    pub field: bool,
}

impl PerturbedMotion {
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
    pub perturbed: PerturbedMotion,
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
            if let Some(home) = &piece.ways.home {
                mean.stances[k].rotation = mean.stances[k].rotation.times_transposed(home);
            }
            let Some(joint) = &piece.joint else { continue };
            match joint.kind {
                JointKind::Hinge => {
                    let (sin, cos) = slopes.sin_cos[piece.frame];
                    (mean.turns[k][0], mean.turns[k][1]) = (cos, piece.ways.flip * sin);
                }
                JointKind::Ball | JointKind::Free => {
                    step::put_rows(anchors.get(joint.turn).copied().unwrap_or(Mat3::identity()), &mut mean.turns[k]);
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
        let Pass { reaches, perturbed, mean, .. } = pass;
        near.own[0] = root;
        self.compare(pass, &mut near.differs);
        for (k, piece) in self.pieces.iter().enumerate().skip(1) {
            let Differs { pose, motion, field } = near.differs[k];
            if !(pose || motion || field) {
                continue;
            }
            let reach = &reaches[k];
            if reach.own > perturbed.from || (perturbed.inputs && reach.own_input) {
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

    /// Finds what of each piece differs. No numbers, so it is no part of what is compiled for them.
    #[inline(never)]
    fn compare(&self, pass: Pass, differs: &mut [Differs]) {
        let perturbed = pass.perturbed;
        differs[0] = Differs { pose: false, motion: perturbed.motion, field: perturbed.field };
        for ((to, wanted), reach) in differs.iter_mut().zip(pass.wanted).zip(pass.reaches).skip(1) {
            let pose = wanted.place && perturbed.touches(reach);
            *to = Differs {
                pose,
                motion: wanted.motion && (pose || perturbed.motion),
                field: wanted.field && (pose || perturbed.field),
            };
        }
    }

    /// A point of a piece in root axes; with `ROD`, a direction. It lies in `trail` on its way, where each piece has its place: the
    /// compiler would break what goes round a loop into single numbers.
    #[inline(always)]
    pub fn raised<T: Real, const ROD: bool>(
        &self,
        mut at: usize,
        x: Vec3<T>,
        mean: &Mean,
        joints: &JointMotion<T>,
        near: &Near<T>,
        trail: &mut [Vec3<T>],
    ) -> Vec3<T> {
        trail[at] = x;
        while near.differs[at].pose {
            let piece = &self.pieces[at];
            trail[piece.parent] = piece.raised::<T, ROD>(&near.turns[at], trail[at], joints);
            at = piece.parent;
        }
        let stance = &mean.stances[at];
        let turned = stance.rotation.apply_lanes(trail[at]);
        if ROD {
            turned
        } else {
            turned + stance.position.everywhere()
        }
    }
}
