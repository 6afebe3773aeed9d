//! Where to begin: the state that best explains the first samples, by Levenberg-Marquardt.
//!
//! Marquardt 1963, with the scaling by the diagonal. Later samples of the window count less by what the state's own
//! noise may have done in between.

use super::transition::Transition;
use super::System;
use crate::kernels::arch::Arch;
use crate::kernels::dense::Square;
use crate::kernels::normal_equations::{inverse, NormalEquations};

/// One sample of the start window.
#[derive(Debug)]
pub struct StartSample<'a, M> {
    /// Since the instant whose state is sought, s.
    pub after_s: f64,
    /// Its inputs.
    pub moment: &'a M,
    /// Readings; NaN is missing.
    pub z: &'a [f64],
}

/// A guess and how far to trust it.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// State.
    pub mean: Vec<f64>,
    /// Inverse of its covariance.
    pub information: Square,
}

impl Prior {
    /// States that know nothing of each other.
    pub fn uncorrelated(mean: Vec<f64>, std: &[f64]) -> Self {
        let mut information = Square::zeros(std.len());
        for (i, s) in std.iter().enumerate() {
            *information.at_mut(i, i) = 1.0 / (s * s);
        }
        Prior { mean, information }
    }

    /// A belief's mean and covariance; `None` if that is not positive definite.
    pub fn of(mean: &[f64], covariance: &Square) -> Option<Self> {
        Some(Prior { mean: mean.to_vec(), information: inverse(Arch::best(), covariance)? })
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

/// A system, its evidence and room to work in.
pub struct StartFit<'a, S: System> {
    system: &'a S,
    samples: &'a [StartSample<'a, S::Moment>],
    noise_std: &'a [f64],
    prior: &'a Prior,
    transition: Transition,
    scratch: S::Scratch,
    center: Vec<f64>,
    jacobian: Vec<f64>,
    away: Vec<f64>,
    at: Vec<f64>,
    certain: Vec<f64>,
    /// The noise counts so many times.
    noise_factor: f64,
}

impl<'a, S: System> StartFit<'a, S> {
    /// `noise_std` is that of each row, `guess` a prior.
    pub fn new(
        system: &'a S,
        samples: &'a [StartSample<'a, S::Moment>],
        noise_std: &'a [f64],
        prior: &'a Prior,
    ) -> Self {
        let (n, m) = (prior.mean.len(), noise_std.len());
        StartFit {
            system,
            samples,
            noise_std,
            prior,
            transition: Transition::default(),
            scratch: system.scratch(),
            center: vec![0.0; m],
            jacobian: vec![0.0; m * (n + system.input_std().len())],
            away: vec![0.0; n],
            at: vec![0.0; n],
            certain: vec![0.0; n],
            noise_factor: 1.0,
        }
    }

    /// As `fit`, with noise that is `blurs` times as large before it is what it is; each fit begins where the last one ended.
    ///
    /// Graduated non-convexity (Blake and Zisserman 1987). With their own noise readings cut bent, narrow valleys into the cost, in
    /// which a fit from afar creeps or ends; under blurred ones the guess's prior counts and may lead to the right one.
    pub fn fit_with_decreasing_noise(&mut self, first: &[f64], noise_factors: &[f64]) -> Option<Fit> {
        let mut from = first.to_vec();
        for &noise_factor in noise_factors {
            self.noise_factor = noise_factor;
            from = self.fit(&from)?.mean;
        }
        self.noise_factor = 1.0;
        self.fit(&from)
    }

    /// The best state from `first`; `None` if the readings are not numbers there.
    pub fn fit(&mut self, first: &[f64]) -> Option<Fit> {
        let (n, m) = (first.len(), self.noise_std.len());
        let (mut here, mut there) = (NormalEquations::new(n, m), NormalEquations::new(n, m));
        let (mut mean, mut trial, mut step) = (first.to_vec(), first.to_vec(), vec![0.0; n]);
        self.linearise(&mean, &mut here);
        let mut damping = 1e-3;
        for _ in 0..MAX_ITERATIONS {
            if !here.damped_step(damping, &mut step) {
                break;
            }
            trial.copy_from_slice(&mean);
            self.system.shift(&mut trial, &step);
            self.linearise(&trial, &mut there);
            if there.cost < here.cost {
                let settled = here.cost - there.cost <= SETTLED * here.cost;
                (mean, trial) = (trial, mean);
                (here, there) = (there, here);
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
        let covariance = here.covariance()?;
        here.cost.is_finite().then_some(Fit { mean, covariance, cost: here.cost })
    }

    fn linearise(&mut self, mean: &[f64], out: &mut NormalEquations) {
        self.system.difference(&self.prior.mean, mean, &mut self.away);
        out.begin(&self.prior.information, &self.away);
        for k in 0..self.samples.len() {
            self.add_sample(k, mean, out);
        }
    }

    fn add_sample(&mut self, k: usize, mean: &[f64], out: &mut NormalEquations) {
        let StartSample { after_s, moment, z } = &self.samples[k];
        self.at.copy_from_slice(mean);
        self.system.transition(*after_s, mean, &self.certain, &[], &mut self.transition);
        self.transition.apply_to_mean(&mut self.at);
        self.system.linearise(moment, &mut self.scratch, &self.at, &mut self.center, &mut self.jacobian);
        let (n, width) = (mean.len(), mean.len() + self.system.input_std().len());
        for (r, slopes) in self.jacobian.chunks_exact_mut(width).enumerate() {
            // Rows that are not there were not written.
            let residual = z[r] - self.center[r];
            if residual.is_nan() {
                continue;
            }
            let row = &mut slopes[..n];
            let noise = (self.noise_factor * self.noise_std[r]).powi(2) + self.transition.noise_along(row);
            self.transition.apply_transposed(row);
            out.push(row, residual, noise);
        }
        out.gather();
    }
}
