//! Which joints a source depends on, and when a closure enters the filter.

use super::hypothesis::SourceMemory;
use super::readings::Readings;
use super::subject::Subject;
use crate::body::Body;
use crate::kinematics::{FrameMotion, JointMotion};
use crate::model::SensorKind;
use crate::rotation::{Mat3, Vec3};
use crate::sensor::{Scene, Worn};

/// Per source and joint: whether the source's readings change with the joint.
pub fn dependence(body: &Body) -> Vec<Vec<bool>> {
    let (joints, coordinates) = (body.model.joints.len(), body.model.coordinate_count());
    let at = |bumped: Option<usize>| {
        let value = |j: usize, scale: f64, phase: f64| scale * (phase + 1.7 * j as f64).sin();
        let mut q: Vec<f64> = (0..coordinates).map(|c| value(c, 0.7, 0.3)).collect();
        let qd: Vec<f64> = (0..coordinates).map(|c| value(c, 1.3, 1.1)).collect();
        let qdd: Vec<f64> = (0..coordinates).map(|c| value(c, 2.1, 2.3)).collect();
        if let Some(j) = bumped {
            body.model.joints[j].coordinates().for_each(|c| q[c] += 0.1);
        }
        readings(body, &q, &qd, &qdd)
    };
    let calm = at(None);
    let mut depends = vec![vec![false; joints]; body.suite.sources.len()];
    for j in 0..joints {
        let moved = at(Some(j));
        for (source, row) in body.suite.sources.iter().zip(&mut depends) {
            row[j] = source.rows.clone().any(|r| (moved[r] - calm[r]).abs() > 1e-9);
        }
    }
    depends
}

/// All readings for a root at rest.
pub fn readings(body: &Body, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
    let root = FrameMotion::resting(Vec3(body.field.lift));
    let azimuth = body.model.world.magnetic_azimuth_rad;
    readings_from(body, root, body.field.magnetic(azimuth), q, qd, qdd)
}

/// All readings for a root with motion `root` in a field (uT, root axes).
pub fn readings_from(
    body: &Body,
    root: FrameMotion<f64>,
    field: Vec3<f64>,
    q: &[f64],
    qd: &[f64],
    qdd: &[f64],
) -> Vec<f64> {
    let mut frames = vec![root; body.tree.len()];
    body.tree.motions(
        root,
        JointMotion { q, qd, qdd, lengths: &body.lengths(), anchors: &[] },
        &vec![true; body.tree.len()],
        &mut frames,
    );
    let mut out = vec![0.0; body.suite.len()];
    let all = vec![true; body.suite.sources.len()];
    let (headings, references) =
        (vec![0.0; body.layout.headings.len()], vec![Mat3::identity(); body.suite.sources.len()]);
    let worn = Worn { lengths: &body.lengths(), mounts: &[], headings: &headings };
    let scene = Scene { frames: &frames, q, magnetic_field: field, worn, references: &references };
    body.suite.predict(&scene, &all, &mut out);
    out
}

/// A source without readings for longer than this has a dropout, s.
pub(super) const SILENCE_S: f64 = 0.2;

/// Interval at which a closure is used while no encoder reads its second side, s. Both sides are states then, with their
/// uncertainty; more often would count the same error of the grip again.
const INTERVAL_S: f64 = 0.02;

/// The closures, whose readings are zero by definition.
#[derive(Debug, Clone)]
pub(super) struct Loops {
    all: Vec<Loop>,
    on: bool,
}

impl Loops {
    pub fn new(subject: &Subject, on: bool) -> Self {
        Loops { all: loops(&subject.body, &subject.depends), on }
    }

    /// Writes the closures' readings of zero. None in a sample without readings, which is a row of the output alone.
    pub fn fill(&self, subject: &Subject, readings: &mut Readings, is_empty: bool) {
        for l in &self.all {
            let rows = subject.body.suite.sources[l.source].rows.clone();
            readings.z[rows].fill(if self.on && !is_empty { 0.0 } else { f64::NAN });
        }
    }

    /// Removes closures that were used shortly before and whose second side no encoder reads in this sample.
    pub fn wait(&self, subject: &Subject, sources: &[SourceMemory], time_s: f64, readings: &mut Readings) {
        for l in self.all.iter().filter(|l| !l.encoders.is_empty()) {
            let is_read = l.encoders.iter().any(|&r| !readings.z[r].is_nan());
            if !is_read && time_s - sources[l.source].seen_s < INTERVAL_S {
                readings.moment.active[l.source] = false;
                readings.silence(&subject.body.suite.sources[l.source].rows);
            }
        }
    }

    /// Removes closures that would have to determine more joints than they have equations: many postures then close the
    /// loop, and a linearisation at one of them would underestimate the covariance.
    pub fn hush(&self, subject: &Subject, sources: &[SourceMemory], time_s: f64, readings: &mut Readings) {
        let joints = &subject.body.model.joints;
        let heard = |source: usize| time_s - sources[source].seen_s <= SILENCE_S;
        for l in &self.all {
            let rows = &subject.body.suite.sources[l.source].rows;
            // Two directions in space differ by two angles but are compared by three numbers.
            let equations = if rows.len() > 3 { rows.len() - 1 } else { rows.len() };
            let felt = (0..joints.len()).filter(|&j| subject.depends[l.source][j]);
            let alone = felt.filter(|&j| self.is_alone_with(subject, j, heard));
            let alone: usize = alone.map(|j| joints[j].kind.width()).sum();
            if alone > equations {
                readings.moment.active[l.source] = false;
                readings.silence(rows);
            }
        }
    }

    /// Whether a source is a closure.
    pub fn contain(&self, source: usize) -> bool {
        self.all.iter().any(|l| l.source == source)
    }

    /// Whether only closures, of all sources with readings, depend on a joint that is a state.
    fn is_alone_with(&self, subject: &Subject, joint: usize, heard: impl Fn(usize) -> bool) -> bool {
        let feels = |s: &usize| subject.depends[*s][joint] && heard(*s);
        let felt = (0..subject.depends.len()).filter(feels).any(|s| !self.contain(s));
        subject.body.layout.coordinates[subject.body.model.joints[joint].first].is_some() && !felt
    }
}

/// A closure, and what reads its second side.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// Index of its source.
    pub source: usize,
    /// Rows of the encoders on its second side.
    pub encoders: Vec<usize>,
}

/// The model's closures.
pub fn loops(body: &Body, depends: &[Vec<bool>]) -> Vec<Loop> {
    let model = &body.model;
    let first = body.suite.sources.len() - model.closures.len();
    let describe = |(i, closure): (usize, &crate::model::Closure)| {
        let source = first + i;
        let needs_input = (0..model.joints.len()).any(|j| model.joints[j].input && depends[source][j]);
        let far_side = joints_above(body, closure.sides[1].0);
        let encoders = if needs_input { Vec::new() } else { encoder_rows(body, &far_side) };
        Loop { source, encoders }
    };
    model.closures.iter().enumerate().map(describe).collect()
}

fn joints_above(body: &Body, mut frame: usize) -> Vec<usize> {
    let mut joints = Vec::new();
    while frame != 0 {
        joints.extend(body.model.frames[frame].joint.map(|(j, _)| j));
        frame = body.model.frames[frame].parent;
    }
    joints
}

fn encoder_rows(body: &Body, joints: &[usize]) -> Vec<usize> {
    let reads =
        |s: &&crate::model::Sensor| matches!(&s.kind, SensorKind::Encoder(encoder) if joints.contains(&encoder.joint));
    let row = |s: &crate::model::Sensor| {
        let source = body.suite.sources.iter().find(|x| x.name == s.name)?;
        Some(source.rows.start)
    };
    body.model.sensors.iter().filter(reads).filter_map(row).collect()
}
