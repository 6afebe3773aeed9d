//! `Body`: a model as the filter's system. State in, readings out, for eight sigma points at a time.

mod carried;
mod heading;
mod linear;
pub mod posture;
pub mod read;
mod split;

use crate::config::Config;
use crate::error::Result;
use crate::estimate::filter::RowGroups;
use crate::estimate::shear::Shear;
use crate::estimate::transition::{Block, Transition};
use crate::estimate::{Partition, Points, System};
use crate::kernels::lane::{Lane, Real};
use crate::kinematics::near::Reach;
use crate::kinematics::pieces::Pieces;
use crate::kinematics::{FrameMotion, JointMotion, Tree};
use crate::model::{Axis, Model, Sensor, SensorKind, Transform, World};
use crate::motion::{base_block, error_block, is_held, is_turn_observed, joint_block, push_turn, Now};
use crate::rotation::turn::{minus, plus, right_jacobian};
use crate::rotation::{Mat3, Vec3};
use crate::sensor::near::Seats;
use crate::sensor::{MountValue, Quantity, Suite, Wearing};
use crate::state::{ErrorSlot, Layout, Slots};
use posture::Posture;
use read::BodyScratch;
use std::sync::Arc;

/// Gravity and field in root axes.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Specific force of a resting accelerometer, m/s2: opposite to gravity.
    pub lift: [f64; 3],
    /// Norm of the magnetic field, uT.
    pub norm_ut: f64,
    /// Dip of the magnetic field below the horizon, rad.
    pub dip_rad: f64,
    /// Horizontal part of the magnetic field at azimuth 0, the same at a right angle to it, and the vertical part, uT.
    north: [f64; 3],
    side: [f64; 3],
    vertical: [f64; 3],
}

impl Field {
    /// Field of the model's world at these parameters.
    pub fn new(world: &World, parameters: &[f64]) -> Self {
        let (up, forward) = (Vec3(world.up), Vec3(world.forward));
        let (norm_ut, dip_rad) = (world.magnetic_norm_ut.eval(parameters), world.magnetic_dip_rad.eval(parameters));
        let horizontal = norm_ut * dip_rad.cos();
        let vertical = -norm_ut * dip_rad.sin();
        Field {
            norm_ut,
            dip_rad,
            lift: (up * world.gravity_m_s2).0,
            north: (forward * horizontal).0,
            side: (up.cross(forward) * horizontal).0,
            vertical: (up * vertical).0,
        }
    }

    /// The magnetic field at an azimuth (rad), uT.
    #[inline(always)]
    pub fn magnetic<T: Real>(&self, azimuth: T) -> Vec3<T> {
        let (sin, cos) = azimuth.sin_cos();
        Vec3::splat(self.vertical) + Vec3::splat(self.north) * cos + Vec3::splat(self.side) * sin
    }

    /// Its derivative, uT/rad.
    pub(crate) fn magnetic_slope(&self, azimuth: f64) -> Vec3<f64> {
        let (sin, cos) = azimuth.sin_cos();
        Vec3(self.side) * cos - Vec3(self.north) * sin
    }
}

/// Inputs and rows of one sample.
#[derive(Debug, Clone)]
pub struct Moment {
    /// Per coordinate: value of an input joint, rad or m; others are ignored.
    pub inputs: Vec<f64>,
    /// Sources that have a row in this sample.
    pub active: Vec<bool>,
    /// Frames that these sources need.
    pub needed: Vec<bool>,
    /// Of these frames, the ones whose velocities and accelerations they need.
    pub moving: Vec<bool>,
    /// Per source: the reference of readings that are differences from one.
    pub references: Vec<Mat3<f64>>,
}

/// A model with its calibrated numbers and state layout.
#[derive(Debug, Clone)]
pub struct Body {
    /// The model file's content.
    pub model: Arc<Model>,
    /// The tree at the calibrated parameters.
    pub tree: Tree,
    /// The sensors at the calibrated parameters and mounts.
    pub suite: Suite,
    /// Layout of the state.
    pub layout: Layout,
    /// Gravity and magnetic field.
    pub field: Field,
    /// Values of the model's parameters.
    pub parameters: Vec<f64>,
    config: Config,
    /// Per state: whether it belongs to a rotation vector.
    turned: Vec<bool>,
    /// Rotation vectors of joints that rotate the whole body, and the rotation from joint to root. No other joint lies
    /// between them and the root.
    pub floating: Vec<(usize, Mat3<f64>)>,
    /// Process of every coordinate.
    pub axes: Vec<Axis>,
    /// Coordinates that are inputs, and the standard deviation of their readings.
    input_coordinates: Vec<usize>,
    input_std: Vec<f64>,
    /// Source, first row and first state of every bias.
    biases: Vec<(usize, usize, usize)>,
    /// The rigid pieces of the tree, the sensors on them, and the states that the pose of each piece depends on.
    pieces: Pieces,
    seats: Seats,
    piece_reaches: Vec<Reach>,
}

impl Body {
    /// Combines a model with parameter values and mounts (per sensor; `None` is the nominal one).
    pub fn new(model: Arc<Model>, parameters: &[f64], mounts: &[Option<MountValue>], config: &Config) -> Result<Self> {
        let layout = Layout::new(&model, config)?;
        let (estimated, worn): (Vec<usize>, Vec<usize>) =
            (layout.lengths.iter().map(|l| l.0).collect(), layout.mounts.iter().map(|m| m.0).collect());
        let wearing = Wearing { parameters, estimated: &estimated, mounts: &worn, headings: &layout.heading_of };
        let suite = Suite::worn(&model, &wearing, mounts);
        let rows_of = |slot: &ErrorSlot| {
            let name = &model.sensors[slot.sensor].name;
            let (s, source) = suite.sources.iter().enumerate().find(|(_, s)| s.name == *name)?;
            let part = source.parts.iter().find(|p| p.quantity == slot.error.quantity)?;
            Some((s, part.rows.start, slot.first))
        };
        let biases = layout.errors.iter().filter_map(rows_of).collect();
        let inputs = || model.joints.iter().filter(|j| j.input);
        let (input_coordinates, input_std) = inputs().map(|j| (j.first, j.input_std)).unzip();
        let tree = Tree::with_lengths(&model, parameters, &estimated);
        let field = Field::new(&model.world, parameters);
        let length = |number: usize| layout.lengths[number].1;
        let state = |c: usize| layout.coordinates[c].map(|s| s.q);
        let is_input = |c: usize| model.joints.iter().any(|j| j.input && j.coordinates().contains(&c));
        let frame_reaches = tree.reaches(state, length, is_input);
        let pieces = Pieces::new(&tree);
        let piece_reaches = (0..pieces.len()).map(|k| frame_reaches[pieces.frame(k)]).collect();
        let seats = suite.seats(&pieces, &frame_reaches, length, |n| layout.mounts[n].1, |n| layout.headings[n].0);
        let mut turned = vec![false; layout.dim()];
        layout.turns.iter().for_each(|(_, slots)| turned[slots.q..slots.q + 3].fill(true));
        Ok(Body {
            turned,
            floating: floating(&model, parameters),
            axes: axes(&model, config.contacts),
            model,
            tree,
            suite,
            layout,
            field,
            parameters: parameters.to_vec(),
            config: config.clone(),
            input_coordinates,
            input_std,
            biases,
            pieces,
            seats,
            piece_reaches,
        })
    }

    /// Coordinates that are states, with their processes and places in the state.
    pub fn moving(&self) -> impl Iterator<Item = (usize, &Axis, Slots)> {
        let both = self.axes.iter().zip(&self.layout.coordinates).enumerate();
        both.filter_map(|(c, (axis, slots))| Some((c, axis, (*slots)?)))
    }

    /// Nominal values of the estimated lengths, m.
    pub fn lengths(&self) -> Vec<f64> {
        self.layout.lengths.iter().map(|(i, _)| self.parameters[*i]).collect()
    }

    /// An empty moment without readings.
    pub fn moment(&self) -> Moment {
        Moment {
            inputs: vec![0.0; self.model.coordinate_count()],
            active: vec![false; self.suite.sources.len()],
            needed: vec![false; self.tree.len()],
            moving: vec![false; self.tree.len()],
            references: vec![Mat3::identity(); self.suite.sources.len()],
        }
    }

    /// Marks the frames that the moment's active sources need.
    pub fn mark(&self, moment: &mut Moment) {
        moment.needed.fill(false);
        moment.moving.fill(false);
        for (i, _) in moment.active.iter().enumerate().filter(|(_, &on)| on) {
            self.suite.mark_frames(i, &mut moment.needed);
            self.suite.mark_moving(i, &mut moment.moving);
        }
        self.tree.mark_ancestors(&mut moment.needed);
        self.tree.mark_ancestors(&mut moment.moving);
    }

    /// Rows that are accepted, rejected and reported together.
    pub fn groups(&self) -> RowGroups {
        let sources = &self.suite.sources;
        let parts = || sources.iter().flat_map(|s| &s.parts);
        let rows = |of: fn(Quantity) -> bool| parts().filter(|p| of(p.quantity)).flat_map(|p| p.rows.clone()).collect();
        RowGroups {
            parts: sources.iter().flat_map(|s| s.parts.iter().map(|p| p.rows.clone())).collect(),
            sources: sources.iter().map(|s| s.rows.clone()).collect(),
            inertial: rows(Quantity::is_inertial),
        }
    }

    /// Quantity of every part, in the order of `groups().parts`.
    pub fn quantities(&self) -> Vec<Quantity> {
        self.suite.sources.iter().flat_map(|s| s.parts.iter().map(|p| p.quantity)).collect()
    }

    /// Motion of every frame at a state.
    pub fn motions_at(&self, mean: &[f64], moment: &Moment) -> Vec<FrameMotion<f64>> {
        let mut posture = Posture::new(self);
        self.pose(mean, &Moment { needed: vec![true; self.tree.len()], ..moment.clone() }, &mut posture);
        posture.frames
    }

    /// Motion at a state of the frames that the moment needs. Allocates nothing.
    pub fn pose(&self, mean: &[f64], moment: &Moment, room: &mut Posture<f64>) {
        room.unpack(self, moment, |i| mean[i]);
        let joints = JointMotion { q: &room.q, qd: &room.qd, qdd: &room.qdd, lengths: &room.lengths, anchors: &[] };
        self.tree.motions(self.root(|i| mean[i]), joints, &moment.needed, &mut room.frames);
    }

    /// Motion of the root: gravity and the base accelerations, whose values `state` gives.
    #[inline(always)]
    fn root<T: Real>(&self, state: impl Fn(usize) -> T) -> FrameMotion<T> {
        let mut proper = Vec3::splat(self.field.lift);
        for push in &self.layout.pushes {
            proper += Vec3::splat(self.model.base_accelerations[push.number].axis) * state(push.state);
        }
        FrameMotion::resting(proper)
    }

    fn push_turns(&self, dt: f64, mean: &[f64], variance: &[f64], out: &mut Transition) {
        for (c, slots) in &self.layout.turns {
            let axes = &self.axes[*c..c + 3];
            let held = !is_turn_observed(axes, &variance[slots.q..slots.q + 3]);
            push_turn(axes, *slots, mean, Now { dt, held }, self.config.process_noise, out);
        }
    }
}

/// Process of every coordinate. With contacts, the body travels.
fn axes(model: &Model, contacts: bool) -> Vec<Axis> {
    let touches = |s: &Sensor| matches!(&s.kind, SensorKind::Imu(imu) if imu.contact.is_some());
    let travels = contacts && model.sensors.iter().any(touches);
    model.axes().into_iter().map(|axis| Axis { travels: travels && axis.place, ..axis }).collect()
}

/// See [`Body::floating`].
fn floating(model: &Model, parameters: &[f64]) -> Vec<(usize, Mat3<f64>)> {
    let mut still: Vec<Option<Mat3<f64>>> = vec![None; model.frames.len()];
    still[0] = Some(Mat3::identity());
    let mut found = Vec::new();
    let turned = |by: &Option<Transform>| by.as_ref().map_or(Mat3::identity(), |t| t.evaluate(parameters).0);
    for (i, frame) in model.frames.iter().enumerate().skip(1) {
        let Some(parent) = still[frame.parent] else { continue };
        let here = parent.times(&turned(&frame.before));
        match frame.joint {
            None => still[i] = Some(here.times(&turned(&frame.after))),
            Some((j, _)) => found.extend(model.joints[j].turn().map(|c| (c, here))),
        }
    }
    found
}

/// Three numbers of a state.
pub fn three(v: &[f64], first: usize) -> [f64; 3] {
    [v[first], v[first + 1], v[first + 2]]
}

impl System for Body {
    type Moment = Moment;
    type Scratch = BodyScratch;

    fn partition(&self) -> Partition {
        self.layout.partition
    }

    fn row_count(&self) -> usize {
        self.suite.len()
    }

    fn scratch(&self) -> BodyScratch {
        BodyScratch::new(self)
    }

    fn input_std(&self) -> &[f64] {
        &self.input_std
    }

    fn shift(&self, mean: &mut [f64], delta: &[f64]) {
        for (i, m) in mean.iter_mut().enumerate() {
            if !self.turned[i] {
                *m += delta[i];
            }
        }
        for (_, slots) in &self.layout.turns {
            let moved = plus(three(mean, slots.q), three(delta, slots.q));
            mean[slots.q..slots.q + 3].copy_from_slice(&moved);
        }
    }

    fn difference(&self, to: &[f64], from: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(to.iter().zip(from)).for_each(|(o, (t, f))| *o = t - f);
        for (_, slots) in &self.layout.turns {
            out[slots.q..slots.q + 3].copy_from_slice(&minus(three(to, slots.q), three(from, slots.q)));
        }
    }

    fn reset_jacobian(&self, delta: &[f64], out: &mut Vec<Block>) {
        for (_, slots) in &self.layout.turns {
            let q = slots.q;
            out.push(Block::linear([q, q + 1, q + 2], right_jacobian(three(delta, q)).0));
        }
    }

    fn shears(&self, mean: &[f64], delta: &[f64], out: &mut Vec<Shear>) {
        self.push_heading_shears(mean, delta, out);
        self.push_shears(mean, delta, out);
    }

    fn transition(&self, dt: f64, mean: &[f64], variance: &[f64], out: &mut Transition) {
        out.clear();
        for (axis, slots) in self.axes.iter().zip(&self.layout.coordinates) {
            let Some(slots) = slots.filter(|s| !self.turned[s.q]) else { continue };
            let held = is_held(axis, slots, variance);
            let now = Now { dt, held };
            out.blocks.push(joint_block(axis, slots, now, self.config.process_noise));
        }
        self.push_turns(dt, mean, variance, out);
        if let Some(azimuth) = self.layout.azimuth {
            let walk = self.model.world.azimuth_walk;
            out.blocks.push(Block::walk(azimuth, walk * walk * dt));
        }
        let constant = self.layout.lengths.iter().map(|l| l.1..l.1 + 1);
        for state in constant.chain(self.layout.mounts.iter().map(|m| m.1..m.1 + 3)).flatten() {
            out.blocks.push(Block::walk(state, 0.0));
        }
        for (state, walk) in &self.layout.headings {
            out.blocks.push(Block::walk(*state, walk * walk * dt));
        }
        for slot in &self.layout.pushes {
            out.blocks.push(base_block(&self.model.base_accelerations[slot.number], *slot, dt));
        }
        for slot in &self.layout.errors {
            out.blocks.extend((0..3).map(|i| error_block(&slot.error, slot.first + i, dt)));
        }
    }

    fn readings(&self, moment: &Moment, scratch: &mut BodyScratch, at: Points, out: &mut [Lane]) {
        self.read_all(moment, scratch, at, out);
    }

    fn linearise(&self, moment: &Moment, s: &mut BodyScratch, mean: &[f64], center: &mut [f64], jacobian: &mut [f64]) {
        self.jacobian(moment, &mut s.linear, mean, center, jacobian);
    }
}
