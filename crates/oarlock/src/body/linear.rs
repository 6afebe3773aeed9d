//! Readings of a body at one state and their exact derivative.

use super::{three, Body, Moment};
use crate::kinematics::slopes::{Columns, Slopes};
use crate::kinematics::{FrameMotion, JointMotion};
use crate::rotation::turn::Turn;
use crate::rotation::{Mat3, Vec3};
use crate::sensor::slopes::{Moving, Places};
use crate::sensor::{Surroundings, Worn};

/// Room to work in.
#[derive(Debug, Clone)]
pub struct LinearScratch {
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
    anchors: Vec<Mat3<f64>>,
    lengths: Vec<f64>,
    mounts: Vec<Vec3<f64>>,
    frames: Vec<FrameMotion<f64>>,
    slopes: Slopes,
    places: Places,
}

impl Body {
    /// A column of the Jacobian for every state, then one for each noisy input.
    pub(super) fn linear_scratch(&self) -> LinearScratch {
        let (layout, zero) = (&self.layout, vec![0.0; self.model.coordinate_count()]);
        let mut coordinates = vec![[None; 3]; zero.len()];
        for (columns, slots) in coordinates.iter_mut().zip(&layout.coordinates) {
            let Some(slots) = slots else { continue };
            *columns = [Some(slots.q), slots.rates.map(|r| r.0), slots.rates.map(|r| r.1)].map(|s| Some((s?, 1.0)));
        }
        for (k, (&c, &std)) in self.input_coordinates.iter().zip(&self.input_std).enumerate() {
            coordinates[c][0] = Some((layout.dim() + k, std));
        }
        let lengths: Vec<usize> = layout.lengths.iter().map(|l| l.1).collect();
        let bases = self.model.base_accelerations.iter().zip(&layout.base);
        let places = Places {
            width: layout.dim() + self.input_std.len(),
            coordinates: layout.coordinates.iter().map(|slots| Some((*slots)?.q)).collect(),
            lengths: lengths.clone(),
            mounts: layout.mounts.iter().map(|m| m.1).collect(),
            azimuth: layout.azimuth,
            bases: bases.filter_map(|(base, slot)| Some(((*slot)?.first, base.axis))).collect(),
        };
        LinearScratch {
            q: zero.clone(),
            qd: zero.clone(),
            qdd: zero,
            anchors: vec![Mat3::identity(); layout.turns.len()],
            lengths: vec![0.0; lengths.len()],
            mounts: vec![Vec3::zero(); layout.mounts.len()],
            frames: vec![FrameMotion::resting(Vec3::zero()); self.tree.len()],
            slopes: self.tree.slopes(Columns { coordinates, lengths }),
            places,
        }
    }

    fn unpack_mean(&self, moment: &Moment, mean: &[f64], s: &mut LinearScratch) {
        for (c, slots) in self.layout.coordinates.iter().enumerate() {
            let rates = slots.and_then(|s| s.rates);
            s.q[c] = slots.map_or(moment.inputs[c], |s| mean[s.q]);
            (s.qd[c], s.qdd[c]) = rates.map_or((0.0, 0.0), |(rate, accel)| (mean[rate], mean[accel]));
        }
        for ((c, slots), anchor) in self.layout.turns.iter().zip(&mut s.anchors) {
            s.q[*c..c + 3].fill(0.0);
            *anchor = Turn::exp(three(mean, slots.q)).matrix();
        }
        self.layout.lengths.iter().zip(&mut s.lengths).for_each(|((_, state), length)| *length = mean[*state]);
        self.layout.mounts.iter().zip(&mut s.mounts).for_each(|((_, first), m)| *m = Vec3(three(mean, *first)));
    }

    pub(super) fn readings_and_slopes(
        &self,
        moment: &Moment,
        s: &mut LinearScratch,
        mean: &[f64],
        center: &mut [f64],
        jacobian: &mut [f64],
    ) {
        self.unpack_mean(moment, mean, s);
        let joints = JointMotion { q: &s.q, qd: &s.qd, qdd: &s.qdd, lengths: &s.lengths, anchors: &s.anchors };
        let root = self.root(|i| mean[i]);
        self.tree.motions_with_slopes(root, joints, &moment.needed, &mut s.frames, &mut s.slopes);
        let azimuth = self.layout.azimuth.map_or(self.model.world.magnetic_azimuth_rad, |i| mean[i]);
        let (magnetic_field, magnetic_slope) = (self.field.magnetic(azimuth), self.field.magnetic_slope(azimuth));
        let worn = Worn { lengths: &s.lengths, mounts: &s.mounts };
        self.suite.predict(&s.frames, &s.q, &Surroundings { magnetic_field }, worn, &moment.active, center);
        let (frames, slopes, places) = (&s.frames, &s.slopes, &s.places);
        let at = Moving { frames, slopes, places, worn, magnetic_field, magnetic_slope };
        self.suite.slopes(at, &moment.active, jacobian);
        for &(_, row, bias) in self.biases.iter().filter(|(source, ..)| moment.active[*source]) {
            for i in 0..3 {
                center[row + i] += mean[bias + i];
                jacobian[(row + i) * places.width + bias + i] = 1.0;
            }
        }
    }
}
