//! Where to begin: the state that best explains the first samples, by Levenberg-Marquardt.
//!
//! Marquardt 1963, with the scaling by the diagonal. Later samples of the window count less by what the state's own
//! noise may have done in between.

use super::dense::{accumulate, cholesky, solve, solve_transposed, Square};
use super::transition::Transition;
use super::{Points, System};
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
    /// Inverse of its covariance.
    pub information: Square,
}

impl Guess {
    /// States that know nothing of each other.
    pub fn apart(mean: Vec<f64>, std: &[f64]) -> Self {
        let mut information = Square::zeros(std.len());
        for (i, s) in std.iter().enumerate() {
            *information.at_mut(i, i) = 1.0 / (s * s);
        }
        Guess { mean, information }
    }

    /// A belief's mean and covariance; `None` if that is not positive definite.
    pub fn of(mean: &[f64], covariance: &Square) -> Option<Self> {
        Some(Guess { mean: mean.to_vec(), information: inverse(covariance)? })
    }
}

/// What came out.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// State at the sought instant.
    pub mean: Vec<f64>,
    /// After the fit, linearised there.
    pub covariance: Square,
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
    transition: Transition,
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
        Problem { system, evidence, noise_std, guess, transition: Transition::default(), scratch: system.scratch() }
    }

    /// The best state from `first`; `None` if the readings are not numbers there.
    pub fn fit(&mut self, first: &[f64]) -> Option<Fit> {
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
        let covariance = inverse(&here.normal)?;
        here.cost.is_finite().then_some(Fit { mean, covariance, cost: here.cost })
    }

    fn linearise(&mut self, mean: &[f64]) -> Linearised {
        let n = mean.len();
        let mut out = Linearised { normal: Square::zeros(n), gradient: vec![0.0; n], cost: 0.0 };
        let mut away = vec![0.0; n];
        self.system.difference(&self.guess.mean, mean, &mut away);
        out.normal.copy_from(&self.guess.information);
        for (i, &distance) in away.iter().enumerate() {
            out.gradient[i] = self.guess.information.row(i).iter().zip(&away).map(|(p, a)| p * a).sum();
            out.cost += out.gradient[i] * distance;
        }
        for k in 0..self.evidence.len() {
            self.add_sample(k, mean, &mut out);
        }
        out.normal.mirror_upper();
        out
    }

    fn add_sample(&mut self, k: usize, mean: &[f64], out: &mut Linearised) {
        let n = mean.len();
        let (mut at, certain) = (mean.to_vec(), vec![0.0; n]);
        self.system.transition(self.evidence[k].after_s, mean, &certain, &[], &mut self.transition);
        self.transition.apply_to_mean(&mut at);
        let (h, mut jacobian) = self.derivative(k, &at);
        for (r, row) in jacobian.chunks_exact_mut(n).enumerate() {
            let residual = self.evidence[k].z[r] - h[r];
            if residual.is_nan() {
                continue;
            }
            let noise = self.noise_std[r] * self.noise_std[r] + self.transition.noise_along(row);
            self.transition.apply_transposed(row);
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
        let (mut delta, mut out) = (vec![zero; n], vec![zero; m]);
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
            let at = Points { mean: state, delta: &delta, off: &off };
            self.system.readings(self.evidence[k].moment, &mut self.scratch, at, &mut out);
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

/// Inverse of a positive definite matrix.
fn inverse(a: &Square) -> Option<Square> {
    let n = a.n();
    let (mut factor, mut out) = (a.clone(), Square::zeros(n));
    cholesky(&mut factor).ok()?;
    for i in 0..n {
        let column = out.row_mut(i);
        column[i] = 1.0;
        solve_transposed(&factor, 0, column);
        solve(&factor, 0, column);
    }
    out.mirror_upper();
    Some(out)
}
