//! What a body's sensors read at sigma points, eight at a time.

use super::linear::LinearScratch;
use super::posture::Posture;
use super::{Body, Moment};
use crate::estimate::{Points, Vary};
use crate::kinematics::near::{Apart, Differs, Stance, Wanted};
use crate::kinematics::JointMotion;
use crate::lane::{Lane, Real};
use crate::rotation::{Mat3, Vec3};
use crate::sensor::near::{Around, Stand};
use crate::sensor::{Surroundings, Worn};
use std::any::Any;

/// Room for one batch of sigma points, and what they share with the mean.
#[derive(Debug, Clone)]
pub struct BodyScratch {
    plain: Posture<Lane<false>>,
    fused: Posture<Lane<true>>,
    mean: Posture<f64>,
    anchors: Vec<Mat3<f64>>,
    stances: Vec<Stance>,
    differs: Vec<Differs>,
    stands: Vec<Stand>,
    mean_field: Vec3<f64>,
    pub(super) linear: LinearScratch,
}

impl BodyScratch {
    /// For a body's points.
    pub fn new(body: &Body) -> Self {
        BodyScratch {
            plain: Posture::new(body),
            fused: Posture::new(body),
            mean: Posture::new(body),
            anchors: vec![Mat3::identity(); body.layout.turns.len()],
            stances: vec![Stance::resting(); body.tree.len()],
            differs: vec![Differs::default(); body.tree.len()],
            stands: vec![Stand::ANY; body.suite.sources.len()],
            mean_field: Vec3::zero(),
            linear: body.linear_scratch(),
        }
    }
}

/// The room whose numbers are reckoned with in this way.
#[inline(always)]
fn of_kind<'a, const FUSED: bool>(
    plain: &'a mut Posture<Lane<false>>,
    fused: &'a mut Posture<Lane<true>>,
) -> &'a mut Posture<Lane<FUSED>> {
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
    fn add_biases<T: Real>(&self, moment: &Moment, at: impl Fn(usize) -> T, out: &mut [T]) {
        for &(source, row, bias) in &self.biases {
            if moment.active[source] {
                for i in 0..3 {
                    out[row + i] += at(bias + i);
                }
            }
        }
    }

    /// Without regard to any mean.
    pub(super) fn read_all(&self, moment: &Moment, s: &mut BodyScratch, at: Points, out: &mut [Lane]) {
        self.anchor(at.mean, &mut s.anchors);
        let room = &mut s.plain;
        self.unpack_lanes(moment, at, room);
        let joints =
            JointMotion { q: &room.q, qd: &room.qd, qdd: &room.qdd, lengths: &room.lengths, anchors: &s.anchors };
        self.tree.motions(self.root(|i| at.at(i)), joints, &moment.needed, &mut room.frames);
        let around = Surroundings { magnetic_field: self.field.magnetic(self.azimuth(|i| at.at(i))) };
        self.suite.predict(&room.frames, &room.q, &around, room.worn(), &moment.active, out);
        self.add_biases(moment, |i| at.at(i), out);
    }

    /// At the mean; remembers how everything stands there.
    #[inline(always)]
    pub(super) fn settle_at(&self, moment: &Moment, s: &mut BodyScratch, mean: &[f64], out: &mut [Lane]) {
        s.mean.take_mean(self, moment, mean, &mut s.anchors);
        self.tree.settle(self.root(|i| mean[i]), s.mean.joints(&s.anchors), &moment.needed, &mut s.stances);
        for (frame, stance) in s.mean.frames.iter_mut().zip(&s.stances) {
            *frame = stance.frame;
        }
        s.mean_field = self.field.magnetic(self.azimuth(|i| mean[i]));
        self.suite.settle(&s.stances, s.mean.worn(), &moment.active, &mut s.stands);
        let (around, room) = (Surroundings { magnetic_field: s.mean_field }, &mut s.mean);
        let worn = Worn { lengths: &room.lengths, mounts: &room.mounts };
        self.suite.predict(&room.frames, &room.q, &around, worn, &moment.active, &mut room.out);
        for (out, x) in out.iter_mut().zip(&room.out) {
            *out = Lane::splat(*x);
        }
        // What is remembered comes without biases, which are added to all points alike.
        self.add_biases(moment, |i| Lane::splat(mean[i]), out);
    }

    /// Near the mean that was settled at.
    #[inline(always)]
    pub(super) fn read_near<const FUSED: bool>(
        &self,
        moment: &Moment,
        s: &mut BodyScratch,
        at: Points,
        vary: Vary,
        out: &mut [Lane],
    ) {
        let room = of_kind::<FUSED>(&mut s.plain, &mut s.fused);
        self.unpack_lanes(moment, at, room);
        let apart = Apart { from: vary.from, inputs: vary.inputs, motion: vary.from < self.layout.dim() };
        let joints =
            JointMotion { q: &room.q, qd: &room.qd, qdd: &room.qdd, lengths: &room.lengths, anchors: &s.anchors };
        let wanted = Wanted { needed: &moment.needed, moving: &moment.moving };
        let root = self.root(|i| at.at(i).cast::<FUSED>());
        let reaches = (apart, self.frame_reaches.as_slice());
        self.tree.motions_near(root, joints, wanted, reaches, &s.stances, &mut room.frames, &mut s.differs);
        let turned = self.layout.azimuth.filter(|&i| i >= vary.from);
        let field = turned.map(|i| self.field.magnetic(at.at(i).cast::<FUSED>()));
        let around = Around {
            frames: &room.frames,
            stances: &s.stances,
            differs: &s.differs,
            q: &room.q,
            field,
            mean_field: s.mean_field,
            apart,
        };
        let worn = Worn { lengths: &room.lengths, mounts: &room.mounts };
        let (reaches, active) = (&self.source_reaches, &moment.active);
        self.suite.predict_near(around, worn, reaches, &s.stands, active, &s.mean.out, &mut room.out);
        self.add_biases(moment, |i| at.at(i).cast::<FUSED>(), &mut room.out);
        for (out, x) in out.iter_mut().zip(&room.out) {
            *out = x.cast();
        }
    }
}
