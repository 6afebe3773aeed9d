//! `Subject`: the body and constant tables of its rows, shared by all stages of a step.

use super::loops::dependence;
use crate::body::Body;
use crate::estimate::filter::{Info, RowGroups, Verdict};
use crate::model::{Axis, Joint, JointKind};
use crate::sensor::Quantity;

/// A body, and tables of its readings that the stages of a step share.
#[derive(Debug, Clone)]
pub(super) struct Subject {
    /// The model with its calibrated numbers.
    pub body: Body,
    pub groups: RowGroups,
    /// Per part: its quantity.
    pub quantities: Vec<Quantity>,
    /// Per source and joint: whether the source's readings depend on the joint.
    pub depends: Vec<Vec<bool>>,
    /// Standard deviation of each row's noise.
    pub std: Vec<f64>,
    /// Per row: its part.
    pub part_of_row: Vec<usize>,
    /// Per part: its source.
    pub source_of_part: Vec<usize>,
}

impl Subject {
    pub fn new(body: Body) -> Self {
        let groups = body.groups();
        let sources = body.suite.sources.iter().enumerate();
        Subject {
            quantities: body.quantities(),
            depends: dependence(&body),
            std: body.suite.std(),
            part_of_row: groups.parts.iter().enumerate().flat_map(|(p, rows)| rows.clone().map(move |_| p)).collect(),
            source_of_part: sources.flat_map(|(s, source)| source.parts.iter().map(move |_| s)).collect(),
            groups,
            body,
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.std.len()
    }

    /// Parts that measure a quantity.
    pub fn parts_of(&self, quantity: Quantity) -> impl Iterator<Item = usize> + '_ {
        (0..self.quantities.len()).filter(move |&p| self.quantities[p] == quantity)
    }

    /// Removes readings of rest and contact from the missing rows: no sensor owes them.
    pub fn excuse_virtual(&self, info: &mut Info) {
        for p in [Quantity::Rest, Quantity::Contact].into_iter().flat_map(|q| self.parts_of(q)) {
            if info.parts[p] == Verdict::Missing {
                info.sources[self.source_of_part[p]].missing -= self.groups.parts[p].len() as u8;
            }
        }
    }

    /// Rows of magnetometers.
    pub fn magnetic_rows(&self) -> impl Iterator<Item = usize> + '_ {
        self.parts_of(Quantity::Mag).flat_map(|p| self.groups.parts[p].clone())
    }

    /// Whether a reading determines a heading: that of a magnetometer, or of an orientation sensor with the model's
    /// reference.
    pub fn has_compass(&self, z: &[f64]) -> bool {
        let known = |s: &crate::model::Sensor| s.kind.heading().is_none();
        let knows = |name: &str| self.body.model.sensors.iter().any(|s| s.name == name && known(s));
        let parts = self.body.suite.sources.iter().flat_map(|s| s.parts.iter().map(move |p| (s, p)));
        let mut oriented = parts.filter(|(s, p)| p.quantity == Quantity::Orientation && knows(&s.name));
        self.magnetic_rows().any(|r| !z[r].is_nan()) || oriented.any(|(_, p)| !z[p.rows.start].is_nan())
    }

    /// Hinges without an encoder, and their states.
    pub fn free_hinges(&self) -> impl Iterator<Item = (&Axis, usize)> + '_ {
        let model = &self.body.model;
        let hinges = model.joints.iter().filter(|j| j.kind == JointKind::Hinge && model.encoder(j.first).is_none());
        hinges.filter_map(|j| Some((&self.body.axes[j.first], self.body.layout.coordinates[j.first]?.q)))
    }

    /// Balls with a cone, and the first of their states.
    pub fn coned_balls(&self) -> impl Iterator<Item = (&Joint, usize)> + '_ {
        let balls = self.body.model.joints.iter().filter(|j| j.cone.is_some());
        balls.filter_map(|j| Some((j, self.body.layout.coordinates[j.first]?.q)))
    }

    /// Whether a rotation vector rotates the whole body.
    pub fn floats(&self, coordinate: usize) -> bool {
        self.body.floating.iter().any(|(c, _)| *c == coordinate)
    }
}
