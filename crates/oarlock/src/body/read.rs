//! What a body's sensors read at sigma points, eight at a time.

use super::linear::LinearScratch;
use super::{three, Body, Moment};
use crate::estimate::{Points, Vary};
use crate::kinematics::near::{Apart, Differs, Stance, Wanted};
use crate::kinematics::{FrameMotion, JointMotion};
use crate::lane::{Lane, Real};
use crate::rotation::turn::Turn;
use crate::rotation::{Mat3, Vec3};
use crate::sensor::near::{Around, Stand};
use crate::sensor::{Surroundings, Worn};
use crate::state::Slots;
use std::any::Any;

/// Numbers of one state, or of eight side by side.
#[derive(Debug, Clone)]
struct Room<T> {
    q: Vec<T>,
    qd: Vec<T>,
    qdd: Vec<T>,
    lengths: Vec<T>,
    mounts: Vec<Vec3<T>>,
    frames: Vec<FrameMotion<T>>,
    out: Vec<T>,
}

impl<T: Real> Room<T> {
    fn new(body: &Body) -> Self {
        let (zero, frame) = (T::splat(0.0), FrameMotion::resting(Vec3::zero()));
        let joints = vec![zero; body.model.coordinate_count()];
        Room {
            q: joints.clone(),
            qd: joints.clone(),
            qdd: joints,
            lengths: vec![zero; body.layout.lengths.len()],
            mounts: vec![Vec3::zero(); body.layout.mounts.len()],
            frames: vec![frame; body.tree.len()],
            out: vec![zero; body.suite.len()],
        }
    }

    /// Takes joints and wearing from the states that `at` gives.
    #[inline(always)]
    fn unpack(&mut self, body: &Body, moment: &Moment, at: impl Fn(usize) -> T) {
        let zero = T::splat(0.0);
        for (c, slots) in body.layout.coordinates.iter().enumerate() {
            (self.q[c], self.qd[c], self.qdd[c]) = match slots {
                None => (T::splat(moment.inputs[c]), zero, zero),
                Some(Slots { q, rates: None }) => (at(*q), zero, zero),
                Some(Slots { q, rates: Some((rate, accel)) }) => (at(*q), at(*rate), at(*accel)),
            };
        }
        for ((_, state), length) in body.layout.lengths.iter().zip(&mut self.lengths) {
            *length = at(*state);
        }
        for ((_, first), mount) in body.layout.mounts.iter().zip(&mut self.mounts) {
            *mount = Vec3([at(*first), at(first + 1), at(first + 2)]);
        }
    }

    fn joints<'a>(&'a self, anchors: &'a [Mat3<f64>]) -> JointMotion<'a, T> {
        JointMotion { q: &self.q, qd: &self.qd, qdd: &self.qdd, lengths: &self.lengths, anchors }
    }

    fn worn(&self) -> Worn<'_, T> {
        Worn { lengths: &self.lengths, mounts: &self.mounts }
    }
}

/// Room for one batch of sigma points, and what they share with the mean.
#[derive(Debug, Clone)]
pub struct BodyScratch {
    plain: Room<Lane<false>>,
    fused: Room<Lane<true>>,
    mean: Room<f64>,
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
            plain: Room::new(body),
            fused: Room::new(body),
            mean: Room::new(body),
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
    plain: &'a mut Room<Lane<false>>,
    fused: &'a mut Room<Lane<true>>,
) -> &'a mut Room<Lane<FUSED>> {
    let room: &mut dyn Any = if FUSED { fused } else { plain };
    room.downcast_mut().expect("it is of that kind")
}

impl Body {
    #[inline(always)]
    fn azimuth<T: Real>(&self, at: impl Fn(usize) -> T) -> T {
        self.layout.azimuth.map_or(T::splat(self.model.world.magnetic_azimuth_rad), at)
    }

    /// Points of a rotation lie around its mean, in the tangent space there.
    fn anchor(&self, mean: &[f64], anchors: &mut [Mat3<f64>]) {
        for ((_, slots), anchor) in self.layout.turns.iter().zip(anchors) {
            *anchor = Turn::exp(three(mean, slots.q)).matrix();
        }
    }

    #[inline(always)]
    fn unpack_lanes<const FUSED: bool>(&self, moment: &Moment, at: Points, room: &mut Room<Lane<FUSED>>) {
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
        self.anchor(mean, &mut s.anchors);
        s.mean.unpack(self, moment, |i| mean[i]);
        for (c, _) in &self.layout.turns {
            s.mean.q[*c..c + 3].fill(0.0);
        }
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
