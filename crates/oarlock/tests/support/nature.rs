//! A body that lives the life that its model describes, and tells what its sensors read.

use super::chance::Chance;
use super::so3;
use nalgebra::{DMatrix, DVector};
use oarlock::body::Body;
use oarlock::estimate::belief::Belief;
use oarlock::estimate::transition::Transition;
use oarlock::estimate::{Points, System};
use oarlock::kernels::lane::{Lane, LANES};
use oarlock::recording::Sample;

pub struct Nature<'a> {
    pub body: &'a Body,
    pub state: Vec<f64>,
    pub chance: Chance,
}

impl<'a> Nature<'a> {
    /// Somewhere about `mean`, as far as `std` says.
    pub fn about(body: &'a Body, mean: &[f64], std: &[f64], mut chance: Chance) -> Self {
        let away: Vec<f64> = std.iter().map(|s| s * chance.normal()).collect();
        let mut state: Vec<f64> = mean.iter().zip(&away).map(|(m, a)| m + a).collect();
        for (_, slots) in &body.layout.turns {
            let turned = so3::plus(so3::three(mean, slots.q), so3::three(&away, slots.q));
            state[slots.q..slots.q + 3].copy_from_slice(turned.as_slice());
        }
        Nature { body, state, chance }
    }

    pub fn live(&mut self, dt: f64) {
        let (n, old) = (self.state.len(), self.state.clone());
        let mut transition = Transition::default();
        let ones = vec![1.0; self.body.driven().len()];
        self.body.transition(dt, &self.state, &vec![0.0; n], &ones, &mut transition);
        // Rotations move in the chart at themselves, noise and all.
        let turns = &self.body.layout.turns;
        turns.iter().for_each(|(_, slots)| self.state[slots.q..slots.q + 3].fill(0.0));
        transition.turnings.clear();
        transition.apply_to_mean(&mut self.state);
        for b in &transition.blocks {
            let noise = DMatrix::from_fn(b.len, b.len, |r, c| b.noise[r][c]);
            let root = noise.cholesky().expect("positive").unpack();
            let kick = root * DVector::from_vec(self.chance.normals(b.len));
            (0..b.len).for_each(|r| self.state[b.index[r]] += kick[r]);
        }
        for (_, slots) in turns {
            let moved = so3::plus(so3::three(&old, slots.q), so3::three(&self.state, slots.q));
            self.state[slots.q..slots.q + 3].copy_from_slice(moved.as_slice());
        }
    }

    pub fn read(&mut self, time_s: f64) -> Sample {
        let body = self.body;
        let mut moment = body.moment();
        moment.active.fill(true);
        moment.needed.fill(true);
        let zero = vec![Lane([0.0; LANES]); self.state.len()];
        let mut out = vec![Lane([0.0; LANES]); body.suite.len()];
        let at = Points { mean: &self.state, delta: &zero, off: &[] };
        body.readings(&moment, &mut body.scratch(), at, &mut out);
        let noisy = out.iter().zip(body.suite.std());
        let z = noisy.map(|(h, std)| h.0[0] + std * self.chance.normal()).collect();
        Sample { time_s, z, inputs: vec![f64::NAN; body.model.coordinate_count()] }
    }
}

/// From `mean` to `truth`, in the tangent space at the mean.
pub fn error(body: &Body, mean: &[f64], truth: &[f64]) -> DVector<f64> {
    let mut error = DVector::from_fn(truth.len(), |i, _| truth[i] - mean[i]);
    for (_, slots) in &body.layout.turns {
        let turn = so3::minus(so3::three(truth, slots.q), so3::three(mean, slots.q));
        error.rows_mut(slots.q, 3).copy_from(&turn);
    }
    error
}

/// Normalised squared error.
pub fn nees(body: &Body, belief: &Belief, truth: &[f64]) -> f64 {
    let n = truth.len();
    let p = DMatrix::from_row_slice(n, n, belief.covariance.as_slice());
    let error = error(body, &belief.mean, truth);
    error.dot(&p.cholesky().expect("positive").solve(&error))
}
