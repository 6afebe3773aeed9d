//! A model as a system that a filter can estimate: state in, readings out, for eight sigma points at a time.

use crate::config::Config;
use crate::error::Result;
use crate::estimate::filter::Groups;
use crate::estimate::transition::{Block, Transition};
use crate::estimate::{Partition, System};
use crate::kinematics::{FrameMotion, JointMotion, Tree};
use crate::lane::{Lane, Real, LANES};
use crate::model::{Model, World};
use crate::motion::{joint_block, Now};
use crate::rotation::Vec3;
use crate::sensor::imu::MountValue;
use crate::sensor::{Quantity, Suite, Surroundings};
use crate::state::{Layout, SlowSlot};
use std::sync::Arc;

/// Gravity and field in root axes.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Opposite to gravity, m/s2: what a resting accelerometer feels.
    pub lift: [f64; 3],
    /// Horizontal part of the magnetic field at azimuth 0 and at a right angle to it, and its vertical part, uT.
    north: [f64; 3],
    side: [f64; 3],
    vertical: [f64; 3],
}

impl Field {
    /// Of a root that stands as the model's world says.
    pub fn new(world: &World) -> Self {
        let (up, forward) = (Vec3(world.up), Vec3(world.forward));
        let horizontal = world.magnetic_norm_ut * world.magnetic_dip_rad.cos();
        let vertical = -world.magnetic_norm_ut * world.magnetic_dip_rad.sin();
        Field {
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
}

/// Inputs and rows of one sample.
#[derive(Debug, Clone)]
pub struct Moment {
    /// Per joint; only those of input joints count, rad or m.
    pub inputs: Vec<f64>,
    /// Sources that have a row in this sample.
    pub active: Vec<bool>,
    /// Frames that these sources need.
    pub needed: Vec<bool>,
}

/// Room for one batch of sigma points.
#[derive(Debug, Clone)]
pub struct BodyScratch {
    q: Vec<Lane>,
    qd: Vec<Lane>,
    qdd: Vec<Lane>,
    frames: Vec<FrameMotion<Lane>>,
}

/// A model, its numbers and its state layout.
#[derive(Debug, Clone)]
pub struct Body {
    /// Of the body.
    pub model: Arc<Model>,
    /// At the calibrated parameters.
    pub tree: Tree,
    /// At the calibrated parameters and mounts.
    pub suite: Suite,
    /// Of the state.
    pub layout: Layout,
    /// Surroundings.
    pub field: Field,
    config: Config,
    driven: Vec<usize>,
    /// Joints that are inputs, and the noise of their readings.
    input_joints: Vec<usize>,
    input_std: Vec<f64>,
    /// Source, first row and first state of every bias.
    biases: Vec<(usize, usize, usize)>,
}

impl Body {
    /// Puts a model together with parameter values and mounts (per sensor; `None` is the model's own).
    pub fn new(model: Arc<Model>, parameters: &[f64], mounts: &[Option<MountValue>], config: &Config) -> Result<Self> {
        let layout = Layout::new(&model, config)?;
        let suite = Suite::new(&model, parameters, mounts);
        let mut biases = Vec::new();
        for (i, sensor) in model.sensors.iter().enumerate() {
            let Some((s, source)) = suite.sources.iter().enumerate().find(|(_, s)| s.name == sensor.name) else {
                continue;
            };
            let slots = [(Quantity::Gyro, layout.gyro_bias[i]), (Quantity::Accel, layout.accel_bias[i])];
            for (quantity, slot) in slots {
                let part = source.parts.iter().find(|p| p.quantity == quantity);
                if let (Some(part), Some(slot)) = (part, slot) {
                    biases.push((s, part.rows.start, slot.first));
                }
            }
        }
        let joints = layout.joints.iter().flatten().filter_map(|s| s.rates.map(|(_, accel)| accel));
        let driven = joints.chain(layout.base.iter().flatten().map(|b| b.first)).collect();
        let input_joints: Vec<usize> = (0..model.joints.len()).filter(|&j| model.joints[j].input).collect();
        let input_std = input_joints.iter().map(|&j| model.joints[j].input_std).collect();
        let tree = Tree::new(&model, parameters);
        let field = Field::new(&model.world);
        Ok(Body { model, tree, suite, layout, field, config: config.clone(), driven, input_joints, input_std, biases })
    }

    /// An empty moment: nothing measured.
    pub fn moment(&self) -> Moment {
        Moment {
            inputs: vec![0.0; self.model.joints.len()],
            active: vec![false; self.suite.sources.len()],
            needed: vec![false; self.tree.len()],
        }
    }

    /// Rows that are accepted, rejected and reported together.
    pub fn groups(&self) -> Groups {
        let sources = &self.suite.sources;
        Groups {
            parts: sources.iter().flat_map(|s| s.parts.iter().map(|p| p.rows.clone())).collect(),
            sources: sources.iter().map(|s| s.rows.clone()).collect(),
            inertial: sources.iter().filter(|s| s.is_inertial()).flat_map(|s| s.rows.clone()).collect(),
        }
    }

    /// Quantity of every part, in the order of `groups().parts`.
    pub fn quantities(&self) -> Vec<Quantity> {
        self.suite.sources.iter().flat_map(|s| s.parts.iter().map(|p| p.quantity)).collect()
    }

    #[inline(always)]
    fn unpack(&self, moment: &Moment, state: &[Lane], off: &[Lane], s: &mut BodyScratch) {
        for (j, slots) in self.layout.joints.iter().enumerate() {
            let zero = Lane([0.0; LANES]);
            (s.q[j], s.qd[j], s.qdd[j]) = match slots {
                None => (Lane::splat(moment.inputs[j]), zero, zero),
                Some(slots) => match slots.rates {
                    None => (state[slots.q], zero, zero),
                    Some((rate, accel)) => (state[slots.q], state[rate], state[accel]),
                },
            };
        }
        for (&j, &off) in self.input_joints.iter().zip(off) {
            s.q[j] += off;
        }
    }

    fn root(&self, state: &[Lane]) -> FrameMotion<Lane> {
        let mut proper = Vec3::splat(self.field.lift);
        for (base, slot) in self.model.base_accelerations.iter().zip(&self.layout.base) {
            if let Some(SlowSlot { first, .. }) = slot {
                proper += Vec3::splat(base.axis) * state[*first];
            }
        }
        FrameMotion::resting(proper)
    }
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
        let zero = Lane([0.0; LANES]);
        let joints = vec![zero; self.model.joints.len()];
        let frame = FrameMotion::resting(Vec3::zero());
        let frames = vec![frame; self.tree.len()];
        BodyScratch { q: joints.clone(), qd: joints.clone(), qdd: joints, frames }
    }

    fn input_std(&self) -> &[f64] {
        &self.input_std
    }

    fn driven(&self) -> &[usize] {
        &self.driven
    }

    fn transition(&self, dt: f64, variance: &[f64], drive: &[f64], out: &mut Transition) {
        out.blocks.clear();
        let mut drive = drive.iter().copied();
        let mut next_drive = || drive.next().unwrap_or(1.0);
        for (joint, slots) in self.model.joints.iter().zip(&self.layout.joints) {
            if let Some(slots) = slots {
                let drive = if slots.rates.is_some() { next_drive() } else { 1.0 };
                let now = Now { dt, variance: variance[slots.q], drive };
                out.blocks.push(joint_block(joint, *slots, now, self.config.process_noise));
            }
        }
        if let Some(azimuth) = self.layout.azimuth {
            let walk = self.model.world.azimuth_walk;
            out.blocks.push(Block::walk(azimuth, walk * walk * dt));
        }
        for slot in self.layout.base.iter().flatten() {
            out.blocks.push(Block::walk(slot.first, slot.walk * slot.walk * dt * next_drive()));
        }
        for slot in self.layout.biases() {
            let variance = slot.walk * slot.walk * dt;
            out.blocks.extend((0..slot.len).map(|i| Block::walk(slot.first + i, variance)));
        }
    }

    fn readings(&self, moment: &Moment, s: &mut BodyScratch, state: &[Lane], off: &[Lane], out: &mut [Lane]) {
        self.unpack(moment, state, off, s);
        let joints = JointMotion { q: &s.q, qd: &s.qd, qdd: &s.qdd };
        self.tree.motions(self.root(state), joints, &moment.needed, &mut s.frames);
        let azimuth = match self.layout.azimuth {
            Some(i) => state[i],
            None => Lane::splat(self.model.world.magnetic_azimuth_rad),
        };
        let around = Surroundings { magnetic_field: self.field.magnetic(azimuth) };
        self.suite.predict(&s.frames, &s.q, &around, &moment.active, out);
        for &(source, row, bias) in &self.biases {
            if moment.active[source] {
                (0..3).for_each(|i| out[row + i] += state[bias + i]);
            }
        }
    }
}
