//! Samples of a moving body, streams of samples, and data that goes missing.

use super::chance::Chance;
use super::so3;
use super::stroke::{Posture, Stroke};
use super::{body, model, SCULLER};
use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};
use oarlock::estimate::System;
use oarlock::kinematics::FrameMotion;
use oarlock::recording::{Sample, Stream};
use oarlock::rotation::Vec3;
use oarlock::sensor::Quantity;
use oarlock::track::loops::readings_from;
use oarlock::track::run::{track, Run};
use oarlock::track::Calibration;

/// How a recording is made.
pub struct Scene<'a> {
    pub body: &'a Body,
    pub motion: &'a dyn Fn(f64) -> Posture,
    /// Along the first base acceleration, m/s2.
    pub surge: &'a dyn Fn(f64) -> f64,
    /// Field against the model's start value, rad.
    pub azimuth_rad: f64,
    /// Multiplies every standard deviation.
    pub noise: f64,
}

impl Scene<'_> {
    pub fn samples(&self, times: &[f64], chance: &mut Chance) -> Vec<Sample> {
        times.iter().map(|&t| self.sample(t, chance)).collect()
    }

    pub fn sample(&self, time_s: f64, chance: &mut Chance) -> Sample {
        let (model, p) = (&self.body.model, (self.motion)(time_s));
        let mut force = Vec3(self.body.field.lift);
        if let Some(base) = model.base_accelerations.first() {
            force += Vec3(base.axis) * (self.surge)(time_s);
        }
        let field = self.body.field.magnetic(self.azimuth_rad);
        let root = FrameMotion::resting(force);
        let mut z = readings_from(self.body, root, field, &p.q, &p.qd, &p.qdd);
        for (z, std) in z.iter_mut().zip(self.body.suite.std()) {
            *z += self.noise * std * chance.normal();
        }
        let loops = self.body.suite.sources.len() - model.closures.len();
        for source in &self.body.suite.sources[loops..] {
            z[source.rows.clone()].fill(f64::NAN);
        }
        let mut inputs = vec![f64::NAN; p.q.len()];
        for joint in &model.joints {
            let measured = joint.input && !joint.name.ends_with("theta");
            let noise = self.noise * joint.input_std * chance.normal();
            if measured {
                inputs[joint.first] = p.q[joint.first] + noise;
            }
        }
        Sample { time_s, z, inputs, offset_s: vec![0.0; self.body.suite.sources.len()] }
    }

    /// The state that the samples were made of; biases are zero.
    pub fn state(&self, time_s: f64) -> Vec<f64> {
        let (layout, p) = (&self.body.layout, (self.motion)(time_s));
        let mut x = vec![0.0; layout.dim()];
        for (j, slots) in layout.coordinates.iter().enumerate() {
            let Some(slots) = slots else { continue };
            x[slots.q] = p.q[j];
            if let Some((rate, accel)) = slots.rates {
                (x[rate], x[accel]) = (p.qd[j], p.qdd[j]);
            }
        }
        for (first, slots) in &layout.turns {
            let shortest = so3::log(&so3::exp(so3::three(&p.q, *first)));
            x[slots.q..slots.q + 3].copy_from_slice(shortest.as_slice());
        }
        if let Some(i) = layout.azimuth {
            x[i] = self.azimuth_rad;
        }
        if let Some(push) = layout.pushes.first().filter(|p| p.number == 0) {
            x[push.state] = (self.surge)(time_s);
        }
        x
    }
}

/// Samples of a sculler's strokes on a boat that surges.
pub fn rowed(body: &Body, times: &[f64], chance: &mut Chance) -> Vec<Sample> {
    let stroke = Stroke::new(body, 2.2);
    let surge = |t: f64| 2.0 * (2.9 * t).sin();
    Scene { body, motion: &|t| stroke.at(t), surge: &surge, azimuth_rad: 0.5, noise: 1.0 }.samples(times, chance)
}

pub fn times(start_s: f64, step_s: f64, count: usize) -> Vec<f64> {
    (0..count).map(|k| start_s + step_s * k as f64).collect()
}

/// Single readings go missing now and then, and whole sensors for up to a fifth of a second.
pub fn punch_holes(body: &Body, samples: &mut [Sample], chance: &mut Chance) {
    for sample in samples.iter_mut() {
        for x in sample.z.iter_mut().chain(&mut sample.inputs) {
            if chance.uniform() < 0.02 {
                *x = f64::NAN;
            }
        }
    }
    for source in &body.suite.sources {
        let mut k = (chance.uniform() * 150.0) as usize;
        while k + 20 < samples.len() {
            for sample in &mut samples[k..k + 20] {
                sample.z[source.rows.clone()].fill(f64::NAN);
            }
            k += 40 + (chance.uniform() * 200.0) as usize;
        }
    }
}

/// Samples as streams: one for each sensor and each input joint, without the rows that hold nothing.
pub fn streams(body: &Body, samples: &[Sample]) -> Vec<Stream> {
    let model = &body.model;
    let mut streams = Vec::new();
    let loops = body.suite.sources.len() - model.closures.len();
    for source in &body.suite.sources[..loops] {
        let there = |s: &&Sample| s.z[source.rows.clone()].iter().any(|z| !z.is_nan());
        let kept: Vec<&Sample> = samples.iter().filter(there).collect();
        let channels =
            source.parts.iter().map(|part| channel(&kept, part.quantity, |s| s.z[part.rows.clone()].to_vec()));
        let time_s: Vec<f64> = kept.iter().map(|s| s.time_s).collect();
        streams.push(Stream { name: source.name.clone(), time_s: time_s.into(), channels: channels.collect() });
    }
    for joint in model.joints.iter().filter(|j| j.input) {
        let kept: Vec<&Sample> = samples.iter().filter(|s| !s.inputs[joint.first].is_nan()).collect();
        let time_s: Vec<f64> = kept.iter().map(|s| s.time_s).collect();
        let channels = vec![channel(&kept, Quantity::Joint, |s| vec![s.inputs[joint.first]])];
        streams.push(Stream { name: joint.name.clone(), time_s: time_s.into(), channels });
    }
    streams.retain(|s| !s.time_s.is_empty());
    streams
}

fn channel(
    samples: &[&Sample],
    quantity: Quantity,
    values: impl Fn(&Sample) -> Vec<f64>,
) -> oarlock::recording::Channel {
    let values: Vec<f64> = samples.iter().flat_map(|s| values(s)).collect();
    oarlock::recording::Channel { quantity, values: values.into() }
}

/// Orientations as the oracle takes them: what was measured becomes the reference, the rows are zero.
pub fn refer(z: &mut [f64], body: &Body, mut tell: impl FnMut(&str, [f64; 3])) {
    for source in &body.suite.sources {
        if source.parts[0].quantity == Quantity::Orientation {
            let rows = &mut z[source.rows.clone()];
            if rows.iter().any(|x| x.is_nan()) {
                rows.fill(f64::NAN);
            } else {
                tell(&source.name, [rows[0], rows[1], rows[2]]);
                rows.fill(0.0);
            }
        }
    }
}

/// Readings with the loops closed where both angles of the oar are there.
pub fn with_loops(z: &[f64], body: &Body, inputs: &[f64]) -> Vec<f64> {
    let mut z = z.to_vec();
    let joint = |name: String| body.model.joints.iter().position(|j| j.name == name).unwrap();
    for source in body.suite.sources.iter().filter(|s| s.name.ends_with("_grip")) {
        let side = source.name[..1].to_string();
        if ["phi", "alpha"].iter().all(|a| !inputs[joint(format!("{side}_oar_{a}"))].is_nan()) {
            z[source.rows.clone()].fill(0.0);
        }
    }
    z
}

/// Five seconds of a stroke with gaps, tracked by a filter as it comes: root mean square of the poses' errors, rad or m, live and
/// smoothed.
pub fn on_a_stroke(filter: FilterKind) -> [f64; 2] {
    let config = Config { filter, ..Config::default() };
    let body = body(&model(SCULLER), &config);
    let stroke = Stroke::new(&body, 2.2);
    let surge = |t: f64| 2.0 * (2.9 * t).sin();
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &surge, azimuth_rad: 0.5, noise: 1.0 };
    let mut chance = Chance::new(11);
    let mut samples = scene.samples(&times(0.0, 0.01, 500), &mut chance);
    punch_holes(&body, &mut samples[30..], &mut chance);
    let streams = streams(&body, &samples);
    let run = track(body.model.clone(), streams, &Calibration::default(), &config, None, &mut |_| true).unwrap();
    let smooth = run.smooth(&mut |_| true).unwrap();
    let errors = [&run, &smooth].map(|run| error(&scene, run));
    println!("{filter:?}: rms {:.5}, smoothed {:.5}", errors[0], errors[1]);
    errors
}

/// Root mean square of the poses' errors, rad or m.
fn error(scene: &Scene, run: &Run) -> f64 {
    let body = scene.body;
    let (n, pose, rows) = (body.layout.dim(), body.layout.partition.pose, run.series.time_s.len());
    let mut away = vec![0.0; n];
    let mut sum = 0.0;
    for (mean, &time_s) in run.series.mean.chunks_exact(n).zip(&run.series.time_s) {
        body.difference(mean, &scene.state(time_s), &mut away);
        sum += away[..pose].iter().map(|x| x * x).sum::<f64>();
    }
    (sum / (rows * pose) as f64).sqrt()
}
