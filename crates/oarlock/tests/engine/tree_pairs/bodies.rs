//! Two bodies on one another that move as told, with a unit on each.

use super::signals::{readings, Hinge, Noise, Readings, White};
use nalgebra::{Rotation3, Vector3};
use oarlock::calibrate::signals::Signals;

pub const FIELD_UT: Vector3<f64> = Vector3::new(11.0, -45.0, 18.0);

/// From the first body's joint with the world to its joint with the second body.
const LENGTH: Vector3<f64> = Vector3::new(0.4, 0.03, -0.02);
pub const SENSORS: [Vector3<f64>; 2] = [Vector3::new(0.28, 0.05, 0.01), Vector3::new(0.15, -0.02, 0.04)];
pub const HINGE: Vector3<f64> = Vector3::new(0.0, 0.0, 1.0);

/// Two bodies as a chain of hinges; those of one joint meet in a point. `last` lists the units' places in the chain.
pub struct Bodies {
    chain: Vec<Hinge>,
    last: [usize; 2],
}

pub fn still(_: f64) -> f64 {
    0.0
}

fn waves(t: f64, amplitude: f64, hertz: [f64; 2], phase: f64) -> f64 {
    hertz.iter().map(|f| amplitude * ((std::f64::consts::TAU * f * t + phase).sin() - phase.sin())).sum()
}

/// Angles of the two joints about x, y and z.
const FIRST: [fn(f64) -> f64; 3] =
    [|t| waves(t, 0.4, [0.31, 0.83], 0.2), |t| waves(t, 0.3, [0.47, 0.71], 1.1), |t| waves(t, 0.4, [0.29, 0.97], 2.3)];
const SECOND: [fn(f64) -> f64; 3] =
    [|t| waves(t, 0.3, [0.37, 0.89], 0.7), |t| waves(t, 0.4, [0.53, 1.03], 1.9), |t| waves(t, 0.4, [0.41, 0.67], 2.9)];

impl Bodies {
    /// The second body hangs on a ball joint.
    pub fn ball(seed: u64) -> Self {
        Self::of(&FIRST, &SECOND, seed)
    }

    /// The second body hangs on a hinge along [`HINGE`].
    pub fn hinge(seed: u64) -> Self {
        Self::of(&FIRST, &[still, still, SECOND[2]], seed)
    }

    /// Both turn about [`HINGE`] only.
    pub fn planar(seed: u64) -> Self {
        Self::of(&[still, still, FIRST[2]], &[still, still, SECOND[2]], seed)
    }

    /// Neither moves.
    pub fn resting(seed: u64) -> Self {
        Self::of(&[still; 3], &[still; 3], seed)
    }

    fn of(first: &[fn(f64) -> f64; 3], second: &[fn(f64) -> f64; 3], seed: u64) -> Self {
        let mut white = White::new(seed);
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let mut chain: Vec<Hinge> = first
            .iter()
            .chain(second)
            .enumerate()
            .map(|(k, &angle)| Hinge {
                parent_from_link: Rotation3::identity(),
                axis: axes[k % 3],
                angle,
                to_next: Vector3::zeros(),
                sensor: Vector3::zeros(),
                link_from_sensor: white.rotation(),
                gyro_bias: Vector3::zeros(),
                accel_bias: Vector3::zeros(),
                mag_offset: Vector3::zeros(),
            })
            .collect();
        chain[2].to_next = LENGTH;
        (chain[2].sensor, chain[5].sensor) = (SENSORS[0], SENSORS[1]);
        Self { chain, last: [2, 5] }
    }

    pub fn with_biases(mut self, seed: u64, gyro: f64, accel: f64) -> Self {
        let mut white = White::new(seed);
        for k in self.last {
            (self.chain[k].gyro_bias, self.chain[k].accel_bias) = (white.vector(gyro), white.vector(accel));
        }
        self
    }

    pub fn mount(&self, unit: usize) -> Rotation3<f64> {
        self.chain[self.last[unit]].link_from_sensor
    }

    /// From the joint between the bodies to each unit, in its sensor axes.
    pub fn levers(&self) -> [Vector3<f64>; 2] {
        [self.mount(0).inverse() * (SENSORS[0] - LENGTH), self.mount(1).inverse() * SENSORS[1]]
    }

    pub fn hinge_in_sensor(&self, unit: usize) -> Vector3<f64> {
        self.mount(unit).inverse() * HINGE
    }

    pub fn read(&self, seconds: f64, noise: Noise, seed: u64) -> [Readings; 2] {
        let clock: Vec<f64> = (0..(100.0 * seconds) as usize).map(|k| 0.003 + k as f64 / 100.0).collect();
        self.last.map(|k| readings(&self.chain, k, &clock, FIELD_UT, noise, seed))
    }
}

pub fn signals<'a>(name: &'a str, read: &'a Readings) -> Signals<'a> {
    Signals { name, time_s: &read.time_s, gyro_rad_s: &read.gyro, accel_m_s2: &read.accel }
}
