//! Values of a body's joints, lengths and mounts at a state, and the motion of its frames.

use super::{three, Body, Moment};
use crate::kernels::lane::Real;
use crate::kinematics::slopes::Slopes;
use crate::kinematics::{FrameMotion, JointMotion};
use crate::rotation::turn::Turn;
use crate::rotation::{Mat3, Vec3};
use crate::sensor::{Scene, Worn};
use crate::state::Slots;

/// Joints, lengths, mounts and frames of one state, or of eight side by side.
#[derive(Debug, Clone)]
pub struct Posture<T> {
    pub(super) q: Vec<T>,
    pub(super) qd: Vec<T>,
    pub(super) qdd: Vec<T>,
    pub(super) lengths: Vec<T>,
    /// Rotation vectors of the estimated mount errors.
    pub mounts: Vec<Vec3<T>>,
    /// Headings of the references of orientation sensors, rad.
    pub(super) headings: Vec<T>,
    /// Motion of the frames that a moment needs.
    pub frames: Vec<FrameMotion<T>>,
    /// The vertical in the axes of every piece.
    ups: Vec<Vec3<T>>,
    /// Workspace for readings.
    pub(super) out: Vec<T>,
}

impl<T: Real> Posture<T> {
    /// Workspace for `body`.
    pub fn new(body: &Body) -> Self {
        let (zero, frame) = (T::splat(0.0), FrameMotion::resting(Vec3::zero()));
        let joints = vec![zero; body.model.coordinate_count()];
        Posture {
            q: joints.clone(),
            qd: joints.clone(),
            qdd: joints,
            lengths: vec![zero; body.layout.lengths.len()],
            mounts: vec![Vec3::zero(); body.layout.mounts.len()],
            headings: vec![zero; body.layout.headings.len()],
            frames: vec![frame; body.tree.len()],
            ups: vec![Vec3::zero(); body.pieces.len()],
            out: vec![zero; body.suite.len()],
        }
    }

    /// Sets joints, lengths and mounts from the states that `at` gives.
    #[inline(always)]
    pub(super) fn unpack(&mut self, body: &Body, moment: &Moment, at: impl Fn(usize) -> T) {
        let zero = T::splat(0.0);
        let joints = self.q.iter_mut().zip(&mut self.qd).zip(&mut self.qdd);
        for ((((q, qd), qdd), slots), input) in joints.zip(&body.layout.coordinates).zip(&moment.inputs) {
            (*q, *qd, *qdd) = match slots {
                None => (T::splat(*input), zero, zero),
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
        for ((state, _), heading) in body.layout.headings.iter().zip(&mut self.headings) {
            *heading = at(*state);
        }
    }

    /// Sets the rates that `at` gives and all other motion to zero, in the posture of `mean`.
    #[inline(always)]
    pub(super) fn take_rates(&mut self, body: &Body, mean: &Posture<f64>, at: impl Fn(usize) -> T) {
        for (c, slots) in body.layout.coordinates.iter().enumerate() {
            let rate = slots.and_then(|s| s.rates);
            self.q[c] = T::splat(mean.q[c]);
            self.qd[c] = rate.map_or(T::splat(0.0), |(rate, _)| at(rate));
            self.qdd[c] = T::splat(0.0);
        }
        for (length, x) in self.lengths.iter_mut().zip(&mean.lengths) {
            *length = T::splat(*x);
        }
    }

    pub(super) fn joints<'a>(&'a self, anchors: &'a [Mat3<f64>]) -> JointMotion<'a, T> {
        JointMotion { q: &self.q, qd: &self.qd, qdd: &self.qdd, lengths: &self.lengths, anchors }
    }

    pub(super) fn worn(&self) -> Worn<'_, T> {
        Worn { lengths: &self.lengths, mounts: &self.mounts, headings: &self.headings }
    }

    /// The scene of the last computed frames in this magnetic field (uT, root axes).
    pub(super) fn scene<'a>(&'a self, magnetic_field: Vec3<T>, moment: &'a Moment) -> Scene<'a, T> {
        let references = &moment.references;
        Scene { frames: &self.frames, q: &self.q, magnetic_field, worn: self.worn(), references }
    }
}

impl Posture<f64> {
    /// Sets the mean. Its rotations are the anchors of the tangent space in which points lie.
    #[inline(always)]
    pub(super) fn take_mean(&mut self, body: &Body, moment: &Moment, mean: &[f64], anchors: &mut [Mat3<f64>]) {
        body.anchor(mean, anchors);
        self.unpack(body, moment, |i| mean[i]);
        for (c, _) in &body.layout.turns {
            self.q[*c..c + 3].fill(0.0);
        }
    }
}

impl Body {
    /// Computes the vertical in the axes of every piece. Allocates nothing.
    pub fn lower_up(&self, mean: &[f64], moment: &Moment, room: &mut Posture<f64>) {
        room.unpack(self, moment, |i| mean[i]);
        let mut ups = std::mem::take(&mut room.ups);
        self.pieces.lower(room.joints(&[]), Vec3(self.model.world.up), &mut ups);
        room.ups = ups;
    }

    /// The computed vertical in the axes of source `i`, if that is an inertial unit.
    pub fn up_seen_by(&self, i: usize, room: &Posture<f64>) -> Option<Vec3<f64>> {
        self.seats.seen_by(i, &room.ups, &room.mounts)
    }

    /// Sets the mean and computes the motion of all needed frames with its derivatives.
    pub(super) fn stand_at(
        &self,
        moment: &Moment,
        mean: &[f64],
        room: &mut Posture<f64>,
        anchors: &mut [Mat3<f64>],
        slopes: &mut Slopes,
    ) {
        room.take_mean(self, moment, mean, anchors);
        let joints = JointMotion { q: &room.q, qd: &room.qd, qdd: &room.qdd, lengths: &room.lengths, anchors };
        self.tree.motions_with_slopes(self.root(|i| mean[i]), joints, &moment.needed, &mut room.frames, slopes);
    }

    /// Rotations of the mean.
    pub(super) fn anchor(&self, mean: &[f64], anchors: &mut [Mat3<f64>]) {
        for ((_, slots), anchor) in self.layout.turns.iter().zip(anchors) {
            *anchor = Turn::exp(three(mean, slots.q)).matrix();
        }
    }
}
