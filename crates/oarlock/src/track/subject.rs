//! What is tracked: a body, and how its readings belong together. No step changes it.

use super::loops::dependence;
use crate::body::Body;
use crate::estimate::filter::RowGroups;
use crate::model::{Axis, JointKind, SensorKind};
use crate::sensor::Quantity;

/// A body, and tables of its readings that the stages of a step share.
#[derive(Debug, Clone)]
pub(super) struct Subject {
    /// The model with its numbers.
    pub body: Body,
    pub groups: RowGroups,
    /// Per part.
    pub quantities: Vec<Quantity>,
    /// Per source and joint: whether the source feels the joint.
    pub depends: Vec<Vec<bool>>,
    /// Standard deviation of each row's noise.
    pub std: Vec<f64>,
    /// Of each row: its part.
    pub part_of_row: Vec<usize>,
    /// Of each part: its source.
    pub source_of_part: Vec<usize>,
    /// Rows of inertial units, and of these the accelerometers'.
    pub inertial_rows: Vec<bool>,
    pub rough_rows: Vec<bool>,
}

impl Subject {
    pub fn new(body: Body) -> Self {
        let (groups, rows) = (body.groups(), body.suite.len());
        let is_of = |of: &[usize]| (0..rows).map(|r| of.contains(&r)).collect();
        let sources = body.suite.sources.iter().enumerate();
        Subject {
            quantities: body.quantities(),
            depends: dependence(&body),
            std: body.suite.std(),
            part_of_row: groups.parts.iter().enumerate().flat_map(|(p, rows)| rows.clone().map(move |_| p)).collect(),
            source_of_part: sources.flat_map(|(s, source)| source.parts.iter().map(move |_| s)).collect(),
            inertial_rows: is_of(&groups.inertial),
            rough_rows: is_of(&groups.rough),
            groups,
            body,
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.std.len()
    }

    /// Variance of a row's noise, `inflated` as it is learnt: of inertial units, and of rough readings beyond that.
    pub fn noise_variance(&self, row: usize, (inertial, rough): (f64, f64)) -> f64 {
        let factor =
            if self.inertial_rows[row] { inertial } else { 1.0 } * if self.rough_rows[row] { rough } else { 1.0 };
        self.std[row] * self.std[row] * factor
    }

    /// Parts of one quantity.
    pub fn parts_of(&self, quantity: Quantity) -> impl Iterator<Item = usize> + '_ {
        (0..self.quantities.len()).filter(move |&p| self.quantities[p] == quantity)
    }

    /// Rows of magnetometers.
    pub fn magnetic_rows(&self) -> impl Iterator<Item = usize> + '_ {
        self.parts_of(Quantity::Mag).flat_map(|p| self.groups.parts[p].clone())
    }

    /// Whether an encoder tells whole turns of a joint.
    pub fn is_encoded(&self, joint: &str) -> bool {
        let model = &self.body.model;
        let reads = |s: &crate::model::Sensor| matches!(s.kind, SensorKind::Encoder { joint: j, .. } if model.joints[j].name == joint);
        model.sensors.iter().any(reads)
    }

    /// Hinges that no encoder reads, and their states.
    pub fn free_hinges(&self) -> impl Iterator<Item = (&Axis, usize)> + '_ {
        let joints = self.body.model.joints.iter();
        let hinges = joints.filter(|j| j.kind == JointKind::Hinge && !self.is_encoded(&j.name));
        hinges.filter_map(|j| Some((&self.body.axes[j.first], self.body.layout.coordinates[j.first]?.q)))
    }

    /// Whether a rotation vector turns the whole body.
    pub fn floats(&self, coordinate: usize) -> bool {
        self.body.floating.iter().any(|(c, _)| *c == coordinate)
    }
}
