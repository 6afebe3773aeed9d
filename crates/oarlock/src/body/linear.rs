//! Readings of a body at one state and their exact derivative.

use super::posture::Posture;
use super::{Body, Moment};
use crate::kinematics::slopes::{Columns, Slopes};
use crate::kinematics::JointMotion;
use crate::rotation::Mat3;
use crate::sensor::slopes::{Moving, Places};
use crate::sensor::Surroundings;

/// Room to work in.
#[derive(Debug, Clone)]
pub struct LinearScratch {
    mean: Posture<f64>,
    anchors: Vec<Mat3<f64>>,
    slopes: Slopes,
    places: Places,
}

impl Body {
    /// Where the numbers that move the tree stand in a Jacobian that has a column for every state, then one for each noisy input;
    /// with or without those that change its pose.
    pub(super) fn columns(&self, poses: bool) -> Columns {
        let layout = &self.layout;
        let mut coordinates = vec![[None; 3]; self.model.coordinate_count()];
        for (columns, slots) in coordinates.iter_mut().zip(&layout.coordinates) {
            let Some(slots) = slots else { continue };
            let own = [Some(slots.q).filter(|_| poses), slots.rates.map(|r| r.0), slots.rates.map(|r| r.1)];
            *columns = own.map(|s| Some((s?, 1.0)));
        }
        for (k, (&c, &std)) in self.input_coordinates.iter().zip(&self.input_std).enumerate().filter(|_| poses) {
            coordinates[c][0] = Some((layout.dim() + k, std));
        }
        Columns { coordinates, lengths: layout.lengths.iter().map(|l| l.1).collect() }
    }

    /// Where other numbers stand.
    pub(super) fn places(&self) -> Places {
        let layout = &self.layout;
        let bases = self.model.base_accelerations.iter().zip(&layout.base);
        Places {
            width: layout.dim() + self.input_std.len(),
            coordinates: layout.coordinates.iter().map(|slots| Some((*slots)?.q)).collect(),
            lengths: layout.lengths.iter().map(|l| l.1).collect(),
            mounts: layout.mounts.iter().map(|m| m.1).collect(),
            azimuth: layout.azimuth,
            bases: bases.filter_map(|(base, slot)| Some(((*slot)?.first, base.axis))).collect(),
        }
    }

    /// Room for a Jacobian.
    pub(super) fn linear_scratch(&self) -> LinearScratch {
        LinearScratch {
            mean: Posture::new(self),
            anchors: vec![Mat3::identity(); self.layout.turns.len()],
            slopes: self.tree.slopes(self.columns(true)),
            places: self.places(),
        }
    }

    pub(super) fn readings_and_slopes(
        &self,
        moment: &Moment,
        s: &mut LinearScratch,
        mean: &[f64],
        center: &mut [f64],
        jacobian: &mut [f64],
    ) {
        s.mean.take_mean(self, moment, mean, &mut s.anchors);
        let room = &mut s.mean;
        let joints =
            JointMotion { q: &room.q, qd: &room.qd, qdd: &room.qdd, lengths: &room.lengths, anchors: &s.anchors };
        let root = self.root(|i| mean[i]);
        self.tree.motions_with_slopes(root, joints, &moment.needed, &mut room.frames, &mut s.slopes);
        let azimuth = self.azimuth(|i| mean[i]);
        let (magnetic_field, magnetic_slope) = (self.field.magnetic(azimuth), self.field.magnetic_slope(azimuth));
        let worn = room.worn();
        self.suite.predict(&room.frames, &room.q, &Surroundings { magnetic_field }, worn, &moment.active, center);
        let (frames, slopes, places) = (&room.frames, &s.slopes, &s.places);
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
