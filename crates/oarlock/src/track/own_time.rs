//! Readings at their own times: what a reading would have been at the time of its sample.
//!
//! The motion that the state estimate predicts from the sample's time to the reading's own is taken from the reading,
//! z - (h(x(t + offset)) - h(x(t))), to second order in the offset. An acceleration changes in between. How much it changes
//! from one tick to the next is the driving noise; it is taken to change evenly, and the part of the offset adds its
//! variance to that of the reading. White noise over the offset alone would be many times as much: bodies move smoothly. A time
//! stamp that is uncertain adds (h' stamp_std)^2. The error of the estimated motion adds the variance of what it moves the
//! coordinates in the offset. Without it an exact marker some milliseconds off makes the velocity feed back on itself: with
//! R >= off^2 P_v the gain of the velocity times the offset is 1/2 at most, P_qv off / (P_q + R) <= 1/2.

use super::readings::Readings;
use super::subject::Subject;
use crate::body::read::BodyScratch;
use crate::body::{Body, Moment};
use crate::config::Config;
use crate::estimate::belief::Belief;
use crate::estimate::{Points, System};
use crate::kernels::lane::{Lane, Real, LANES};

/// Ticks per second where a program makes samples with offsets without ticks.
const TICK_HZ: f64 = 100.0;
/// Step for the time derivative of readings, s.
const STEP_S: f64 = 1e-4;

/// The stage with its workspace.
#[derive(Debug, Clone)]
pub(super) struct OwnTime {
    /// Per source: standard deviation of its time stamps, s.
    stamp_std_s: Vec<f64>,
    /// Interval of the ticks, s.
    tick_s: f64,
    scratch: BodyScratch,
    delta: Vec<Lane>,
    off: Vec<Lane>,
    out: Vec<Lane>,
    /// Readings at the sample's time, their time derivatives, and their variance by driving noise over `reach_s`.
    here: Vec<f64>,
    rate: Vec<f64>,
    driven: Vec<f64>,
    drives: Vec<Drive>,
}

/// What drives an acceleration.
#[derive(Debug, Clone, Copy)]
struct Drive {
    /// State of the acceleration.
    accel: usize,
    /// States of the value and the rate that it changes.
    moved: Option<(usize, usize)>,
    /// Of the driving noise.
    density: f64,
}

impl OwnTime {
    pub fn new(subject: &Subject, config: &Config) -> Self {
        let body = &subject.body;
        let zero = Lane::splat(0.0);
        let known = |name: &str| config.stamp_std_s.as_ref().and_then(|stds| stds.get(name)).copied();
        OwnTime {
            stamp_std_s: body.suite.sources.iter().map(|s| known(&s.name).unwrap_or(0.0)).collect(),
            tick_s: 1.0 / config.sample_rate_hz.filter(|hz| *hz > 0.0).unwrap_or(TICK_HZ),
            scratch: body.scratch(),
            delta: vec![zero; body.layout.dim()],
            off: vec![zero; body.input_std().len()],
            out: vec![zero; subject.rows()],
            here: vec![0.0; subject.rows()],
            rate: vec![0.0; subject.rows()],
            driven: vec![0.0; subject.rows()],
            drives: drives(body),
        }
    }

    /// Brings the readings to the time of the sample, at which `belief` is the state estimate.
    pub fn bring(&mut self, subject: &Subject, belief: &Belief, readings: &mut Readings) {
        let Readings { z, moment, offset_s, std } = readings;
        std.copy_from_slice(&subject.std);
        let active = |s: &usize| moment.active[*s];
        let sources = &subject.body.suite.sources;
        let reach_s = (0..sources.len()).filter(active).map(|s| offset_s[s].abs()).fold(0.0, f64::max);
        let is_unsure = (0..sources.len()).filter(active).any(|s| self.stamp_std_s[s] > 0.0);
        if reach_s == 0.0 && !is_unsure {
            return;
        }
        self.look_ahead(subject, belief, moment);
        if reach_s > 0.0 {
            self.drive(subject, belief, reach_s, moment);
        }
        for first in (0..sources.len()).step_by(LANES) {
            let times_s = std::array::from_fn(|lane| offset_s.get(first + lane).copied().unwrap_or(0.0));
            if times_s != [0.0; LANES] {
                self.predict(subject, &belief.mean, times_s, moment);
            }
            for s in (first..sources.len().min(first + LANES)).filter(active) {
                for row in sources[s].rows.clone() {
                    let mut variance = std[row].powi(2) + (self.rate[row] * self.stamp_std_s[s]).powi(2);
                    if offset_s[s] != 0.0 {
                        z[row] -= self.out[row].0[s - first] - self.here[row];
                        variance += self.driven[row] * (offset_s[s] / reach_s).powi(2);
                    }
                    std[row] = variance.sqrt();
                }
            }
        }
    }

    /// The readings at the sample's time, and their time derivatives.
    fn look_ahead(&mut self, subject: &Subject, belief: &Belief, moment: &Moment) {
        self.predict(subject, &belief.mean, std::array::from_fn(|lane| STEP_S * f64::from(lane == 1)), moment);
        for (row, out) in self.out.iter().enumerate() {
            self.here[row] = out.0[0];
            self.rate[row] = (out.0[1] - out.0[0]) / STEP_S;
        }
    }

    /// Variance of the readings by the change of accelerations over `reach_s`, and by the error of the estimated motion. Each lane has all of it, with the signs of a Walsh function:
    /// in the mean over eight lanes the products of two drives cancel unless their numbers differ by a multiple of eight.
    fn drive(&mut self, subject: &Subject, belief: &Belief, reach_s: f64, moment: &Moment) {
        self.delta.fill(Lane::splat(0.0));
        let std = |state: usize| belief.covariance.at(state, state).max(0.0).sqrt();
        for (i, drive) in self.drives.iter().enumerate() {
            let size = drive.density / self.tick_s.sqrt() * reach_s;
            let sign = |lane: usize| if (lane & i).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
            let signs: [f64; LANES] = std::array::from_fn(sign);
            self.delta[drive.accel] = Lane(signs.map(|s| s * size));
            if let Some((q, rate)) = drive.moved {
                let unsure = (std(rate) * reach_s).hypot(0.5 * std(drive.accel) * reach_s.powi(2));
                self.delta[q] = Lane(signs.map(|s| s * unsure));
                self.delta[rate] = Lane(signs.map(|s| 0.5 * s * size * reach_s));
            }
        }
        let at = Points { mean: &belief.mean, delta: &self.delta, off: &self.off };
        subject.body.read_all(moment, &mut self.scratch, at, &mut self.out);
        for (row, out) in self.out.iter().enumerate() {
            let squares = out.0.iter().map(|x| (x - self.here[row]).powi(2));
            self.driven[row] = squares.sum::<f64>() / LANES as f64;
        }
        self.delta.fill(Lane::splat(0.0));
    }

    /// Predicts the readings at these times after the mean's, one a lane.
    fn predict(&mut self, subject: &Subject, mean: &[f64], times_s: [f64; LANES], moment: &Moment) {
        let layout = &subject.body.layout;
        for slots in layout.coordinates.iter().flatten() {
            let Some((rate, accel)) = slots.rates else { continue };
            let (v, a) = (mean[rate], mean[accel]);
            self.delta[slots.q] = Lane(times_s.map(|t| t * (v + 0.5 * t * a)));
            self.delta[rate] = Lane(times_s.map(|t| t * a));
        }
        for push in &layout.pushes {
            let rate = push.rate.map_or(0.0, |rate| mean[rate]);
            self.delta[push.state] = Lane(times_s.map(|t| t * rate));
        }
        let at = Points { mean, delta: &self.delta, off: &self.off };
        subject.body.read_all(moment, &mut self.scratch, at, &mut self.out);
    }
}

/// All accelerations that noise drives.
fn drives(body: &Body) -> Vec<Drive> {
    let joints = body.moving().filter_map(|(_, axis, slots)| {
        let (rate, accel) = slots.rates?;
        Some(Drive { accel, moved: Some((slots.q, rate)), density: axis.process.density })
    });
    let pushes = body.layout.pushes.iter().map(|push| {
        // A push with a rise time has no noise of its own within milliseconds.
        let density = if push.rate.is_none() { body.model.base_accelerations[push.number].density } else { 0.0 };
        Drive { accel: push.state, moved: None, density }
    });
    joints.chain(pushes).collect()
}
