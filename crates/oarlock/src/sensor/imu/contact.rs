//! The point of a link that touches the ground: while it stands, its velocity is measured as zero.

use super::ImuNoise;
use crate::kernels::lane::Real;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::slopes::Kind as SlopeKind;
use crate::model::section::Section;
use crate::model::{Expr, Point};
use crate::rotation::Vec3;
use crate::sensor::kind::Described;
use crate::sensor::slopes::{Answers, Cause, Column, Group, Moving};
use crate::sensor::{Fit, Scene};
use serde_json::{json, Value};

/// Base accelerations move the root, and no state is its velocity.
pub(super) const ROOT_MOVES: &str =
    "`contact`: its velocity is unknown, because the root accelerates; use a free joint instead of base accelerations";

/// Contact with the ground in a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Point in the unit's frame, m.
    pub point: [Expr; 3],
    /// Standard deviation of its velocity while it stands, m/s.
    pub std_m_s: f64,
}

impl Contact {
    pub(super) fn read(section: &Section, noise: &ImuNoise) -> Option<Contact> {
        let contact = Section::of(section.get("contact")?, &["point", "std_m_s"])?;
        if noise.gyro_std.is_none() || noise.accel_std.is_none() {
            contact
                .mistake(contact.at, "a contact is detected from gyroscope and accelerometer; add both or remove it");
        }
        Some(Contact { point: contact.point("point"), std_m_s: contact.need_positive("std_m_s", "0.1", "m/s") })
    }

    pub(super) fn describe(&self, at: &Described) -> Value {
        json!({"point": at.point(&self.point), "std_m_s": self.std_m_s})
    }

    pub(super) fn reader(&self, frame: usize, fit: &Fit) -> ContactReader {
        ContactReader { frame, point: fit.point(&self.point), std_m_s: self.std_m_s }
    }
}

/// A contact at one set of parameters. Its rows are the point's velocity in root axes.
#[derive(Debug, Clone)]
pub(super) struct ContactReader {
    frame: usize,
    pub point: Point,
    pub std_m_s: f64,
}

impl ContactReader {
    #[inline(always)]
    pub fn velocity<T: Real>(&self, scene: &Scene<T>) -> Vec3<T> {
        let frame = &scene.frames[self.frame];
        frame.velocity_at(self.point.turned(&frame.rotation, scene.worn.lengths))
    }

    pub fn columns(&self, answers: &Answers) -> Vec<Column> {
        use SlopeKind::{Push, Rate, Shift, Turn};
        let mut columns = answers.chain(self.frame, 0, &[Turn, Rate, Shift, Push]);
        columns.extend(answers.stretches(&self.point, 0));
        columns
    }

    #[inline(always)]
    pub fn write(&self, group: &Group, at: Moving, out: &mut SparseJacobian) {
        let motion = &at.frames[self.frame];
        let arm = self.point.turned(&motion.rotation, at.worn.lengths);
        let (place, velocity) = (motion.position + arm, motion.velocity_at(arm));
        for (slope, (cause, _)) in out.rows_of(group.triple).iter_mut().zip(&group.causes) {
            let [x, y, z] = match *cause {
                Cause::Slope(k) => at.slopes.slope(k).speed(place, velocity),
                Cause::Stretch(by) => motion.angular_velocity.cross(motion.rotation.apply_f64(by)),
                _ => Vec3::zero(),
            }
            .0;
            slope.rows = [x, y, z, 0.0];
        }
    }
}
