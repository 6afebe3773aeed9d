//! Predicted readings of a body at sigma points, eight at a time.

use super::linear::LinearScratch;
use super::posture::Posture;
use super::{Body, Moment};
use crate::estimate::split::Split;
use crate::estimate::{Dependence, FastSystem, PerturbedStates, Points};
use crate::kernels::lane::{Lane, Real};
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::{Mean, Near, Own, Pass, PerturbedMotion, Wanted};
use crate::kinematics::slopes::Slopes;
use crate::kinematics::JointMotion;
use crate::rotation::{Mat3, Vec3};
use crate::sensor::near::{Around, Stand};
use crate::sensor::slopes::{Causes, Moving};
use crate::sensor::{Quantity, Scene, Worn};
use std::any::Any;

/// Workspace of one batch of sigma points, and the data that they share with the mean.
#[derive(Debug, Clone)]
pub struct BodyScratch {
    plain: Flock<Lane<false>>,
    fused: Flock<Lane<true>>,
    posture: Posture<f64>,
    anchors: Vec<Mat3<f64>>,
    mean: Mean,
    wanted: Vec<Wanted>,
    stands: Vec<Stand>,
    slopes: Slopes,
    causes: Causes,
    pub(super) linear: LinearScratch,
}

/// Eight sigma points side by side.
#[derive(Debug, Clone)]
struct Flock<T> {
    posture: Posture<T>,
    near: Near<T>,
    /// Points on the way from their piece to the root, one per piece.
    trail: Vec<Vec3<T>>,
}

impl<T: Real> Flock<T> {
    fn new(body: &Body) -> Self {
        let count = body.pieces.len();
        Flock { posture: Posture::new(body), near: Near::new(count), trail: vec![Vec3::zero(); count] }
    }
}

impl BodyScratch {
    /// Workspace for a body.
    pub fn new(body: &Body) -> Self {
        let slopes = body.tree.slopes(body.columns(false));
        let (_, causes) = body.causes(&slopes, body.layout.partition.pose);
        BodyScratch {
            plain: Flock::new(body),
            fused: Flock::new(body),
            posture: Posture::new(body),
            anchors: vec![Mat3::identity(); body.layout.turns.len()],
            mean: Mean::new(body.pieces.len()),
            wanted: vec![Wanted::default(); body.pieces.len()],
            stands: vec![Stand::ANY; body.suite.sources.len()],
            slopes,
            causes,
            linear: body.linear_scratch(),
        }
    }
}

/// Selects the workspace for arithmetic with or without fused multiply-add.
#[inline(always)]
fn of_kind<'a, const FUSED: bool>(
    plain: &'a mut Flock<Lane<false>>,
    fused: &'a mut Flock<Lane<true>>,
) -> &'a mut Flock<Lane<FUSED>> {
    let room: &mut dyn Any = if FUSED { fused } else { plain };
    room.downcast_mut().expect("it is of that kind")
}

impl Body {
    #[inline(always)]
    pub(super) fn azimuth<T: Real>(&self, at: impl Fn(usize) -> T) -> T {
        self.layout.azimuth.map_or(T::splat(self.model.world.magnetic_azimuth_rad), at)
    }

    #[inline(always)]
    fn unpack_lanes<const FUSED: bool>(&self, moment: &Moment, at: Points, room: &mut Posture<Lane<FUSED>>) {
        room.unpack(self, moment, |i| at.at(i).cast());
        for (c, slots) in &self.layout.turns {
            for k in 0..3 {
                room.q[c + k] = at.delta[slots.q + k].cast();
            }
        }
        for (&c, off) in self.input_coordinates.iter().zip(at.off) {
            room.q[c] += off.cast();
        }
    }

    #[inline(always)]
    pub(super) fn add_biases<T: Real>(&self, moment: &Moment, at: impl Fn(usize) -> T, out: &mut [T]) {
        for &(source, row, bias) in &self.biases {
            if moment.active[source] {
                for i in 0..3 {
                    out[row + i] += at(bias + i);
                }
            }
        }
    }

    /// Predicts without use of a mean.
    pub fn read_all(&self, moment: &Moment, s: &mut BodyScratch, at: Points, out: &mut [Lane]) {
        self.anchor(at.mean, &mut s.anchors);
        let room = &mut s.plain.posture;
        self.unpack_lanes(moment, at, room);
        let joints =
            JointMotion { q: &room.q, qd: &room.qd, qdd: &room.qdd, lengths: &room.lengths, anchors: &s.anchors };
        self.tree.motions(self.root(|i| at.at(i)), joints, &moment.needed, &mut room.frames);
        let scene = room.scene(self.field.magnetic(self.azimuth(|i| at.at(i))), moment);
        self.suite.predict(&scene, &moment.active, out);
        self.add_biases(moment, |i| at.at(i), out);
    }
}

impl FastSystem for Body {
    fn split(&self) -> Split {
        self.limbs()
    }

    fn narrow(&self, moment: &Moment, asked: &[bool], out: &mut Moment) {
        out.inputs.copy_from_slice(&moment.inputs);
        out.references.copy_from_slice(&moment.references);
        for (s, source) in self.suite.sources.iter().enumerate() {
            out.active[s] = moment.active[s] && source.rows.clone().any(|r| asked[r]);
        }
        self.mark(out);
    }

    fn dependence(&self, row: usize) -> Dependence {
        let parts = self.suite.sources.iter().flat_map(|s| &s.parts);
        match parts.into_iter().find(|p| p.rows.contains(&row)).map(|p| p.quantity) {
            Some(Quantity::Accel) => Dependence::Full,
            Some(Quantity::Gyro | Quantity::Rest | Quantity::Contact) => Dependence::Affine,
            // Adds the slow errors of the sensors.
            Some(Quantity::Orientation)
                if self.biases.iter().any(|(_, first, _)| (*first..first + 3).contains(&row)) =>
            {
                Dependence::Affine
            }
            _ => Dependence::Pose,
        }
    }

    /// Predicts at the mean and stores the motion of all pieces there.
    #[inline(always)]
    fn readings_at_mean<const FUSED: bool>(&self, moment: &Moment, s: &mut BodyScratch, at: Points, out: &mut [Lane]) {
        let mean = at.mean;
        let room = &mut s.posture;
        self.stand_at(moment, mean, room, &mut s.anchors, &mut s.slopes);
        s.mean.field = self.field.magnetic(self.azimuth(|i| mean[i]));
        s.wanted.fill(Wanted::default());
        self.seats.mark(&moment.active, &mut s.wanted);
        self.pieces.mark_ancestors(&mut s.wanted);
        self.pieces.settle(&s.slopes, &s.anchors, &s.wanted, &mut s.mean);
        let worn = Worn { lengths: &room.lengths, mounts: &room.mounts, headings: &room.headings };
        self.seats.settle(worn, &moment.active, &mut s.stands);
        let (magnetic_field, references) = (s.mean.field, &moment.references[..]);
        let scene = Scene { frames: &room.frames, q: &room.q, magnetic_field, worn, references };
        self.suite.predict(&scene, &moment.active, &mut room.out);
        for (out, x) in out.iter_mut().zip(&room.out) {
            *out = Lane::splat(*x);
        }
        // The stored readings exclude biases, which are added to all points in the same way.
        self.add_biases(moment, |i| Lane::splat(mean[i]), out);
    }

    /// Predicts near the stored mean.
    #[inline(always)]
    fn readings_near_mean<const FUSED: bool>(
        &self,
        moment: &Moment,
        s: &mut BodyScratch,
        at: Points,
        perturbed: PerturbedStates,
        out: &mut [Lane],
    ) {
        let Flock { posture, near, trail } = of_kind::<FUSED>(&mut s.plain, &mut s.fused);
        self.unpack_lanes(moment, at, posture);
        let turned = self.layout.azimuth.filter(|&i| i >= perturbed.from);
        let motion = perturbed.from < self.layout.dim();
        let perturbed =
            PerturbedMotion { from: perturbed.from, inputs: perturbed.inputs, motion, field: turned.is_some() };
        let mut root = Own::nothing();
        root.felt = self.root(|i| at.at(i).cast::<FUSED>()).proper_acceleration;
        if let Some(i) = turned {
            root.field = self.field.magnetic(at.at(i).cast::<FUSED>());
        }
        let pass = Pass { wanted: &s.wanted, reaches: &self.piece_reaches, perturbed, mean: &s.mean };
        let joints = posture.joints(&s.anchors);
        self.pieces.pass(pass, joints, root, near);
        let around = Around {
            pieces: &self.pieces,
            mean: &s.mean,
            near,
            joints,
            mounts: &posture.mounts,
            headings: &posture.headings,
            references: &moment.references,
            perturbed,
            stands: &s.stands,
            center: &s.posture.out,
            active: &moment.active,
        };
        self.seats.predict(around, trail, out);
        self.add_biases(moment, |i| at.at(i), out);
    }

    fn linear_pattern(&self) -> Option<SparseJacobian> {
        Some(self.causes(&self.tree.slopes(self.columns(false)), self.layout.partition.pose).0)
    }

    /// Derivatives by rates, and the linear block, at the stored mean.
    #[inline(always)]
    fn linear_jacobian<const FUSED: bool>(&self, moment: &Moment, s: &mut BodyScratch, straight: &mut SparseJacobian) {
        let at = Moving {
            frames: &s.posture.frames,
            slopes: &s.slopes,
            worn: s.posture.worn(),
            magnetic_field: s.mean.field,
            magnetic_slope: Vec3::zero(),
            references: &moment.references,
        };
        self.suite.slopes::<FUSED>(&s.causes, at, &moment.active, straight);
    }

    /// Second-order effect of rate deviations on the accelerometers, at the mean.
    #[inline(always)]
    fn second_order<const FUSED: bool>(&self, moment: &Moment, s: &mut BodyScratch, delta: &[Lane], out: &mut [Lane]) {
        let Flock { posture, near, .. } = of_kind::<FUSED>(&mut s.plain, &mut s.fused);
        posture.take_rates(self, &s.posture, |i| delta[i].cast());
        let from = self.layout.partition.pose;
        let perturbed = PerturbedMotion { from, inputs: false, motion: true, field: false };
        let pass = Pass { wanted: &s.wanted, reaches: &self.piece_reaches, perturbed, mean: &s.mean };
        self.pieces.pass(pass, posture.joints(&s.anchors), Own::nothing(), near);
        self.seats.second_order(near, &s.stands, &moment.active, out);
    }

    fn jacobian_pattern(&self) -> Option<SparseJacobian> {
        Some(self.causes(&self.tree.slopes(self.columns(true)), 0).0)
    }

    #[inline(always)]
    fn linearise_sparse<const FUSED: bool>(
        &self,
        moment: &Moment,
        s: &mut BodyScratch,
        mean: &[f64],
        center: &mut [f64],
        straight: &mut SparseJacobian,
    ) {
        self.readings_and_slopes::<FUSED>(moment, &mut s.linear, mean, center, straight);
    }
}
