//! How the errors of a free joint's translation follow when an update moves its mean (P4).
//!
//! An inertial unit measures acceleration in the body's axes. An acceleration in the axes of the parent is therefore wrong by
//! dtheta x a if the orientation is wrong by dtheta, and velocity and position, which follow from it, likewise. An update assumes this
//! relation with the a before it. Unless the covariance then follows the new a, the filter believes that it knows the acceleration apart
//! from the heading, and a unit that is shaken turns its heading. Such a gain of information that no reading contains is known from
//! visual navigation (Huang, Mourikis and Roumeliotis 2010); with an invariant error it does not arise (Barrau and Bonnabel 2017).

use super::{three, Body};
use crate::estimate::shear::Shear;
use crate::model::JointKind;
use crate::rotation::turn::Turn;
use crate::rotation::{Mat3, Vec3};

impl Body {
    /// Adds the shears of all free joints, after the mean has moved by `delta` to `mean`.
    pub(super) fn push_shears(&self, mean: &[f64], delta: &[f64], out: &mut Vec<Shear>) {
        for joint in self.model.joints.iter().filter(|j| j.kind == JointKind::Free) {
            let slots = |c: usize| self.layout.coordinates[joint.first + c];
            let (Some(place), Some(turn)) = (slots(0), slots(3)) else { continue };
            let parent_from_child = Turn::exp(three(mean, turn.q)).matrix();
            let rates = place.rates.into_iter().flat_map(|(rate, accel)| [rate, accel]);
            out.extend(std::iter::once(place.q).chain(rates).map(|to| Shear {
                to,
                from: turn.q,
                width: 3,
                factor: crossed(&parent_from_child, Vec3(three(delta, to))),
            }));
        }
    }
}

/// Matrix of the map theta -> (R theta) x v.
fn crossed(r: &Mat3<f64>, v: Vec3<f64>) -> [[f64; 3]; 3] {
    let axis = |k: usize| Vec3(std::array::from_fn(|i| f64::from(u8::from(i == k))));
    let columns: [[f64; 3]; 3] = std::array::from_fn(|k| r.apply(axis(k)).cross(v).0);
    std::array::from_fn(|row| std::array::from_fn(|k| columns[k][row]))
}
