//! Readings of a body at one state and their exact derivative (Jacobian).

use super::posture::Posture;
use super::{Body, Moment};
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::slopes::{Columns, Slopes};
use crate::rotation::Mat3;
use crate::sensor::slopes::{Causes, Moving, Places};

/// Workspace of the Jacobian.
#[derive(Debug, Clone)]
pub struct LinearScratch {
    mean: Posture<f64>,
    anchors: Vec<Mat3<f64>>,
    slopes: Slopes,
    straight: SparseJacobian,
    causes: Causes,
}

impl Body {
    /// Columns of the numbers that move the tree: one per state, then one per noisy input. Numbers that change the pose
    /// may be left out.
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

    /// A Jacobian by the numbers from column `from` on.
    pub(super) fn causes(&self, slopes: &Slopes, from: usize) -> (SparseJacobian, Causes) {
        self.suite.causes(self.layout.dim(), slopes, &self.places(from))
    }

    /// Columns of all other numbers.
    fn places(&self, from: usize) -> Places {
        let layout = &self.layout;
        Places {
            from,
            coordinates: layout.coordinates.iter().map(|slots| Some((*slots)?.q)).collect(),
            lengths: layout.lengths.iter().map(|l| l.1).collect(),
            mounts: layout.mounts.iter().map(|m| m.1).collect(),
            headings: layout.headings.iter().map(|h| h.0).collect(),
            azimuth: layout.azimuth,
            bases: layout.pushes.iter().map(|p| (p.state, self.model.base_accelerations[p.number].axis)).collect(),
            biases: self.biases.iter().map(|(_, row, state)| (*row, *state)).collect(),
        }
    }

    /// Workspace for a Jacobian.
    pub(super) fn linear_scratch(&self) -> LinearScratch {
        let slopes = self.tree.slopes(self.columns(true));
        let (straight, causes) = self.causes(&slopes, 0);
        let anchors = vec![Mat3::identity(); self.layout.turns.len()];
        LinearScratch { mean: Posture::new(self), anchors, slopes, straight, causes }
    }

    /// Computes the dense Jacobian.
    pub(super) fn jacobian(
        &self,
        moment: &Moment,
        s: &mut LinearScratch,
        mean: &[f64],
        center: &mut [f64],
        jacobian: &mut [f64],
    ) {
        let mut straight = std::mem::take(&mut s.straight);
        self.readings_and_slopes::<false>(moment, s, mean, center, &mut straight);
        let width = self.layout.dim() + self.input_std.len();
        self.suite.scatter(&s.causes, &moment.active, &straight, width, jacobian);
        s.straight = straight;
    }

    /// Computes the sparse Jacobian.
    #[inline(always)]
    pub(super) fn readings_and_slopes<const FUSED: bool>(
        &self,
        moment: &Moment,
        s: &mut LinearScratch,
        mean: &[f64],
        center: &mut [f64],
        straight: &mut SparseJacobian,
    ) {
        let room = &mut s.mean;
        self.stand_at(moment, mean, room, &mut s.anchors, &mut s.slopes);
        let azimuth = self.azimuth(|i| mean[i]);
        let (magnetic_field, magnetic_slope) = (self.field.magnetic(azimuth), self.field.magnetic_slope(azimuth));
        let worn = room.worn();
        self.suite.predict(&room.scene(magnetic_field, moment), &moment.active, center);
        let at = Moving {
            frames: &room.frames,
            slopes: &s.slopes,
            worn,
            magnetic_field,
            magnetic_slope,
            references: &moment.references,
        };
        self.suite.slopes::<FUSED>(&s.causes, at, &moment.active, straight);
        self.add_biases(moment, |i| mean[i], center);
    }
}
