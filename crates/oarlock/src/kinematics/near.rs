//! Motion of the pieces at sigma points near a mean, in each piece's own axes. Points share the mean's pose where their
//! states agree.
//!
//! In a piece's own axes its arms, its joint's axis and its sensors are constant, so a step down the tree only rotates
//! vectors: w = C' w + z q', w' = C' w' + (C' w) x z q' + z q'', a = C' (a + w' x r + w x (w x r)), with joint
//! rotations C. Positions are computed upwards, from the piece to the first ancestor with the mean's pose.

mod step;

use super::pieces::Pieces;
use super::slopes::Slopes;
use super::{FrameMotion, JointMotion, Tree};
use crate::kernels::lane::Real;
use crate::model::JointKind;
use crate::rotation::{Mat3, Vec3};

/// Motion of a piece and the magnetic field, in its own axes.
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
    /// Zero motion without gravity and field.
    pub fn nothing() -> Self {
        Own { spin: Vec3::zero(), spun: Vec3::zero(), felt: Vec3::zero(), field: Vec3::zero() }
    }

    /// Proper acceleration at `arm`, the same arm in all lanes.
    #[inline(always)]
    pub fn felt_at(&self, arm: Vec3<f64>) -> Vec3<T> {
        if arm.0 == [0.0; 3] {
            return self.felt;
        }
        let w = self.spin;
        w.cross_onto(w.cross_equal(arm), self.spun.cross_equal_onto(arm, self.felt))
    }

    /// Proper acceleration at `arm`.
    #[inline(always)]
    pub fn felt_off(&self, arm: Vec3<T>) -> Vec3<T> {
        let w = self.spin;
        w.cross_onto(w.cross(arm), self.spun.cross_onto(arm, self.felt))
    }
}

/// A joint's rotation. Hinge: cosine and sine of its angle; ball: matrix, row by row.
pub type Turn<T> = [T; 9];

/// States that a frame's pose depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reach {
    /// One more than the last such state in the frame's whole chain.
    pub last: usize,
    /// The same for its own joint alone.
    pub own: usize,
    /// Whether the pose depends on an input.
    pub input: bool,
    /// Whether its own joint is an input.
    pub own_input: bool,
}

/// Which values of a piece differ from the mean's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Differs {
    /// Rotation and position.
    pub pose: bool,
    /// Velocities and accelerations.
    pub motion: bool,
    /// The magnetic field in its axes.
    pub field: bool,
}

/// Which values of the body differ from the mean's: states from `from` on, inputs, and the root's motion and field.
#[derive(Debug, Clone, Copy)]
pub struct PerturbedMotion {
    /// First state that may differ.
    pub from: usize,
    /// Whether inputs differ.
    pub inputs: bool,
    /// Whether rates, accelerations or the root's motion differ.
    pub motion: bool,
    /// Whether the magnetic field differs.
    pub field: bool,
}

impl PerturbedMotion {
    /// Whether this changes a pose with this reach.
    #[inline(always)]
    pub fn touches(&self, reach: &Reach) -> bool {
        reach.last > self.from || (self.inputs && reach.input)
    }
}

/// Which values of a piece are needed.
#[derive(Debug, Clone, Copy, Default)]
pub struct Wanted {
    /// Any value.
    pub place: bool,
    /// Velocities and accelerations.
    pub motion: bool,
    /// The magnetic field.
    pub field: bool,
}

/// Poses of all pieces at the mean.
#[derive(Debug, Clone)]
pub struct Mean {
    /// Per piece: pose in root axes.
    pub stances: Vec<FrameMotion<f64>>,
    /// Per piece: rotation of its joint.
    pub turns: Vec<Turn<f64>>,
    /// The magnetic field in root axes, uT.
    pub field: Vec3<f64>,
}

impl Mean {
    /// Workspace for this number of pieces.
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

/// Motion of the pieces where it differs from the mean's.
#[derive(Debug, Clone)]
pub struct Near<T> {
    /// Motion and field, where they differ.
    pub own: Vec<Own<T>>,
    turns: Vec<Turn<T>>,
    /// Per piece: which values differ from the mean.
    pub differs: Vec<Differs>,
}

impl<T: Real> Near<T> {
    /// Workspace for this number of pieces.
    pub fn new(count: usize) -> Self {
        let turns = vec![[T::splat(0.0); 9]; count];
        Near { own: vec![Own::nothing(); count], turns, differs: vec![Differs::default(); count] }
    }
}

/// Arguments of a pass over the tree.
#[derive(Debug, Clone, Copy)]
pub struct Pass<'a> {
    /// Needed values of every piece.
    pub wanted: &'a [Wanted],
    /// States that each piece's pose depends on.
    pub reaches: &'a [Reach],
    /// Differences from the mean.
    pub perturbed: PerturbedMotion,
    /// Poses at the mean.
    pub mean: &'a Mean,
}

impl Tree {
    /// Reach of every frame: `state` and `length` give the state of a coordinate and of an estimated parameter.
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
    /// Copies the poses of the needed pieces. Allocates nothing.
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

    /// Rotates a vector of the root into the axes of every piece. Allocates nothing.
    pub fn lower(&self, joints: JointMotion<f64>, v: Vec3<f64>, out: &mut [Vec3<f64>]) {
        let mut turn = [0.0; 9];
        out[0] = v;
        for (k, piece) in self.pieces.iter().enumerate().skip(1) {
            piece.turn(&joints, &mut turn);
            out[k] = piece.lowered(&turn, out[piece.parent]);
        }
    }

    /// Marks the ancestors of the needed pieces.
    pub fn mark_ancestors(&self, wanted: &mut [Wanted]) {
        for k in (1..self.len()).rev() {
            let (own, above) = (wanted[k], &mut wanted[self.parent(k)]);
            above.place |= own.place;
            above.motion |= own.motion;
            above.field |= own.field;
        }
    }

    /// Fills `near` where it differs from the mean. Allocates nothing.
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

    /// Finds which values of each piece differ. Contains no arithmetic, so it is not compiled per instruction set.
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

    /// Velocity of a point of a piece, in root axes. The piece's motion must be wanted.
    #[inline(always)]
    pub fn velocity<T: Real>(
        &self,
        mut at: usize,
        point: Vec3<T>,
        mean: &Mean,
        joints: &JointMotion<T>,
        near: &Near<T>,
    ) -> Vec3<T> {
        let (mut place, mut velocity) = (point, Vec3::zero());
        while at != 0 {
            let piece = &self.pieces[at];
            let mut turn = near.turns[at];
            if near.differs[at] == Differs::default() {
                piece.keep(&mean.turns[at], &mut turn);
            }
            (place, velocity) = piece.raised_moving(&turn, place, velocity, joints);
            at = piece.parent;
        }
        velocity
    }

    /// Transforms a point of a piece to root axes; with `ROD`, a direction. The intermediate results are stored in
    /// `trail`, one per piece: the compiler would split loop variables into scalars.
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
