//! Where to begin: the state that best explains the first samples, by Levenberg-Marquardt.
//!
//! Marquardt 1963, with the scaling by the diagonal. Later samples of the window count less by what the state's own
//! noise may have done in between.

use super::dense::{accumulate, cholesky, solve, solve_transposed, Square};
use super::transition::Transition;
use super::System;
use crate::lane::{Lane, LANES};

/// One sample of the start window.
#[derive(Debug)]
pub struct Evidence<'a, M> {
    /// Since the instant whose state is sought, s.
    pub after_s: f64,
    /// Its inputs.
    pub moment: &'a M,
    /// Readings; NaN is missing.
    pub z: &'a [f64],
}

/// A guess and how far to trust it.
#[derive(Debug, Clone, PartialEq)]
pub struct Guess {
    /// State.
    pub mean: Vec<f64>,
    /// Of each state.
    pub std: Vec<f64>,
}

/// What came out.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// State at the sought instant.
    pub mean: Vec<f64>,
    /// Standard deviation of each state after the fit.
    pub std: Vec<f64>,
    /// Sum of squared residuals in standard deviations, the guess's included.
    pub cost: f64,
}

const MAX_ITERATIONS: usize = 40;
/// Relative fall of the cost below which the fit has settled.
const SETTLED: f64 = 1e-6;
/// Step of the numerical derivative, in units of the state: half the digits of a double for states of order one.
const STEP: f64 = 1e-6;

/// A system, its evidence and room to work in.
pub struct Problem<'a, S: System> {
    system: &'a S,
    evidence: &'a [Evidence<'a, S::Moment>],
    noise_std: &'a [f64],
    guess: &'a Guess,
    transitions: Vec<Transition>,
    scratch: S::Scratch,
}

struct Linearised {
    normal: Square,
    gradient: Vec<f64>,
    cost: f64,
}

impl<'a, S: System> Problem<'a, S> {
    /// `noise_std` is that of each row, `guess` a prior.
    pub fn new(system: &'a S, evidence: &'a [Evidence<'a, S::Moment>], noise_std: &'a [f64], guess: &'a Guess) -> Self {
        let variance: Vec<f64> = vec![0.0; guess.std.len()];
        let transitions = evidence.iter().map(|e| {
            let mut t = Transition::default();
            system.transition(e.after_s, &variance, &[], &mut t);
            t
        });
        let transitions = transitions.collect();
        Problem { system, evidence, noise_std, guess, transitions, scratch: system.scratch() }
    }

    /// The best state from `first`; `None` if the readings are not numbers there.
    pub fn fit(&mut self, first: &[f64]) -> Option<Fit> {
        let n = first.len();
        let mut mean = first.to_vec();
        let mut here = self.linearise(&mean);
        let mut damping = 1e-3;
        for _ in 0..MAX_ITERATIONS {
            let Some(step) = damped_step(&here, damping) else {
                break;
            };
            let mut trial = mean.clone();
            self.system.shift(&mut trial, &step);
            let there = self.linearise(&trial);
            if there.cost < here.cost {
                let settled = here.cost - there.cost <= SETTLED * here.cost;
                (mean, here) = (trial, there);
                damping = (damping * 0.2_f64).max(1e-12);
                if settled {
                    break;
                }
            } else {
                damping *= 5.0;
                if !damping.is_finite() || damping > 1e12 {
                    break;
                }
            }
        }
        let mut factor = here.normal;
        cholesky(&mut factor).ok()?;
        let std = (0..n).map(|i| {
            let mut e = vec![0.0; n];
            e[i] = 1.0;
            solve_transposed(&factor, 0, &mut e);
            e.iter().map(|x| x * x).sum::<f64>().sqrt()
        });
        let std = std.collect();
        here.cost.is_finite().then_some(Fit { mean, std, cost: here.cost })
    }

    fn linearise(&mut self, mean: &[f64]) -> Linearised {
        let n = mean.len();
        let mut out = Linearised { normal: Square::zeros(n), gradient: vec![0.0; n], cost: 0.0 };
        let mut away = vec![0.0; n];
        self.system.difference(&self.guess.mean, mean, &mut away);
        for (i, (&away, &std)) in away.iter().zip(&self.guess.std).enumerate() {
            let weight = 1.0 / (std * std);
            *out.normal.at_mut(i, i) = weight;
            out.gradient[i] = weight * away;
            out.cost += weight * away * away;
        }
        for k in 0..self.evidence.len() {
            self.add_sample(k, mean, &mut out);
        }
        out.normal.mirror_upper();
        out
    }

    fn add_sample(&mut self, k: usize, mean: &[f64], out: &mut Linearised) {
        let n = mean.len();
        let mut at = mean.to_vec();
        self.transitions[k].apply_to_mean(&mut at);
        let (h, mut jacobian) = self.derivative(k, &at);
        for (r, row) in jacobian.chunks_exact_mut(n).enumerate() {
            let residual = self.evidence[k].z[r] - h[r];
            if residual.is_nan() {
                continue;
            }
            let noise = self.noise_std[r] * self.noise_std[r] + self.transitions[k].noise_along(row);
            self.transitions[k].apply_transposed(row);
            let weight = 1.0 / noise;
            out.cost += weight * residual * residual;
            accumulate(&mut out.gradient, std::iter::once((weight * residual, &*row)));
            for i in 0..n {
                let coefficient = weight * row[i];
                accumulate(&mut out.normal.row_mut(i)[i..], std::iter::once((coefficient, &row[i..])));
            }
        }
    }

    /// Readings at `state` and their derivative, row by row.
    fn derivative(&mut self, k: usize, state: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (n, m) = (state.len(), self.noise_std.len());
        let zero = Lane([0.0; LANES]);
        let (mut delta, mut lanes, mut out) = (vec![zero; n], vec![zero; n], vec![zero; m]);
        let off = vec![zero; self.system.input_std().len()];
        let mut h = vec![0.0; m];
        let mut jacobian = vec![0.0; m * n];
        for first in (0..n).step_by(LANES / 2) {
            delta.fill(zero);
            let count = (LANES / 2).min(n - first);
            for i in 0..count {
                delta[first + i].0[2 * i] = STEP;
                delta[first + i].0[2 * i + 1] = -STEP;
            }
            self.system.retract(state, &delta, &mut lanes);
            self.system.readings(self.evidence[k].moment, &mut self.scratch, &lanes, &off, &mut out);
            for (r, o) in out.iter().enumerate() {
                for i in 0..count {
                    jacobian[r * n + first + i] = (o.0[2 * i] - o.0[2 * i + 1]) / (2.0 * STEP);
                }
                h[r] = 0.5 * (o.0[0] + o.0[1]);
            }
        }
        (h, jacobian)
    }
}

fn damped_step(at: &Linearised, damping: f64) -> Option<Vec<f64>> {
    let mut a = at.normal.clone();
    for i in 0..a.n() {
        *a.at_mut(i, i) *= 1.0 + damping;
    }
    cholesky(&mut a).ok()?;
    let mut step = at.gradient.clone();
    solve_transposed(&a, 0, &mut step);
    solve(&a, 0, &mut step);
    Some(step)
}
