//! Motions in closed form: sines of every coordinate, and the body rates that belong to them.

use super::chance::Chance;
use super::so3;
use super::stroke::Posture;
use nalgebra::Vector3;
use oarlock::model::Model;
use std::f64::consts::TAU;

/// Sums of sines.
#[derive(Clone)]
pub struct Wave {
    /// Per coordinate: middle, and amplitude, frequency (Hz) and phase of each sine.
    pub coordinates: Vec<(f64, Vec<[f64; 3]>)>,
    /// First coordinates of rotation vectors.
    turns: Vec<usize>,
}

const FIRST: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
/// Of the difference that gives the rates' derivatives, s.
const STEP_S: f64 = 2e-3;

impl Wave {
    /// At rest in the middle of everything.
    pub fn still(model: &Model) -> Self {
        let coordinates = vec![(0.0, Vec::new()); model.coordinate_count()];
        Wave { coordinates, turns: model.joints.iter().filter_map(|j| j.turn()).collect() }
    }

    /// Two sines about a random middle: `amplitude` rad or m, up to `hz`.
    pub fn random(model: &Model, amplitude: f64, hz: f64, chance: &mut Chance) -> Self {
        let mut wave = Wave::still(model);
        for (middle, sines) in &mut wave.coordinates {
            *middle = 0.5 * amplitude * chance.normal();
            for share in [1.0, 0.6] {
                let frequency = hz * share * chance.between(0.5, 1.0);
                sines.push([amplitude * share * chance.between(0.3, 0.7), frequency, chance.between(0.0, TAU)]);
            }
        }
        wave
    }

    /// Values and their plain derivatives.
    fn sines(&self, c: usize, t: f64) -> [f64; 3] {
        let (middle, sines) = &self.coordinates[c];
        let mut out = [*middle, 0.0, 0.0];
        for [amplitude, hz, phase] in sines {
            let w = TAU * hz;
            let (sin, cos) = (w * t + phase).sin_cos();
            out[0] += amplitude * sin;
            out[1] += amplitude * w * cos;
            out[2] -= amplitude * w * w * sin;
        }
        out
    }

    fn turn(&self, first: usize, t: f64) -> [Vector3<f64>; 2] {
        let all = [0, 1, 2].map(|i| self.sines(first + i, t));
        [0, 1].map(|d| Vector3::from(all.map(|x| x[d])))
    }

    /// Angular velocity in the child's axes.
    fn spin(&self, first: usize, t: f64) -> Vector3<f64> {
        let [r, rate] = self.turn(first, t);
        so3::right_jacobian(r) * rate
    }

    /// The posture at an instant; rotation vectors may be longer than half a turn.
    pub fn at(&self, t: f64) -> Posture {
        let all: Vec<[f64; 3]> = (0..self.coordinates.len()).map(|c| self.sines(c, t)).collect();
        let part = |d: usize| all.iter().map(|x| x[d]).collect::<Vec<f64>>();
        let mut p = Posture { q: part(0), qd: part(1), qdd: part(2) };
        for &first in &self.turns {
            let mut change = Vector3::zeros();
            for (k, weight) in FIRST.iter().enumerate() {
                let away = (k + 1) as f64 * STEP_S;
                change += (self.spin(first, t + away) - self.spin(first, t - away)) * (*weight / STEP_S);
            }
            p.qd[first..first + 3].copy_from_slice(self.spin(first, t).as_slice());
            p.qdd[first..first + 3].copy_from_slice(change.as_slice());
        }
        p
    }
}
