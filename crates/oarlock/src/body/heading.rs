//! How the errors of a ball joint that turns the whole body follow the azimuth's when an update moves its mean (P5).
//!
//! On a base that stands still, movement shows inclinations and no heading: if body and field are turned together about the vertical,
//! all readings stay as they are. In the body's axes the vertical changes with the mean, and an update assumes the one before it.
//! Unless the covariance then follows the new one, each update seems to show a little of the heading (Huang, Mourikis and Roumeliotis 2010).

use super::{three, Body};
use crate::estimate::shear::Shear;
use crate::model::JointKind;
use crate::rotation::turn::{right_jacobian, Turn};
use crate::rotation::Vec3;

impl Body {
    /// Adds the shears of balls that turn the whole body, after the mean has moved by `delta` to `mean`.
    pub(super) fn push_heading_shears(&self, mean: &[f64], delta: &[f64], out: &mut Vec<Shear>) {
        let Some(azimuth) = self.layout.azimuth else { return };
        let is_ball = |c: usize| self.model.joints.iter().any(|j| j.kind == JointKind::Ball && j.first == c);
        for (c, outer) in self.floating.iter().filter(|(c, _)| is_ball(*c)) {
            let Some(slots) = self.layout.coordinates[*c] else { continue };
            let moved = three(delta, slots.q);
            let turn = outer.then(&Turn::exp(three(mean, slots.q)).matrix());
            let up = turn.apply_transposed(Vec3(self.model.world.up));
            // P3 makes this of the vertical before the update.
            let led = right_jacobian(moved).apply(Turn::exp(moved).matrix().apply(up));
            let factor = (up - led).0.map(|missing| [missing, 0.0, 0.0]);
            out.push(Shear { to: slots.q, from: azimuth, width: 1, factor });
        }
    }
}
