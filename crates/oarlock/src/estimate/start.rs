//! Start fit for the tracker: the state that best explains the first samples, by Levenberg-Marquardt.
//!
//! Marquardt 1963, with the scaling by the diagonal. The noise of later samples is enlarged by the process noise since the start.

use super::transition::Transition;
use super::System;
use crate::kernels::arch::Arch;
use crate::kernels::dense::Square;
use crate::kernels::normal_equations::{inverse, NormalEquations};

/// A sample of the start window.
#[derive(Debug)]
pub struct StartSample<'a, M> {
    /// Since the instant whose state is sought, s.
    pub after_s: f64,
    /// Inputs of the sample.
    pub moment: &'a M,
    /// Readings; NaN is missing.
    pub z: &'a [f64],
}

/// Prior mean and information of the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// State.
    pub mean: Vec<f64>,
    /// Inverse of its covariance.
    pub information: Square,
}

impl Prior {
    /// Uncorrelated states with these standard deviations.
    pub fn uncorrelated(mean: Vec<f64>, std: &[f64]) -> Self {
        let mut information = Square::zeros(std.len());
        for (i, s) in std.iter().enumerate() {
            *information.at_mut(i, i) = 1.0 / (s * s);
        }
        Prior { mean, information }
    }

    /// From mean and covariance; `None` if the covariance is not positive definite.
    pub fn of(mean: &[f64], covariance: &Square) -> Option<Self> {
        Some(Prior { mean: mean.to_vec(), information: inverse(Arch::best(), covariance)? })
    }
}

/// Result of the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// State at the sought instant.
    pub mean: Vec<f64>,
    /// Covariance of that state, linearised there.
    pub covariance: Square,
    /// Sum of squared normalised residuals, the prior's included.
    pub cost: f64,
}

const MAX_ITERATIONS: usize = 40;
/// Relative decrease of the cost at which the fit has converged.
const CONVERGED: f64 = 1e-6;

/// The fit: a system, its samples, the prior and a workspace.
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
    /// Factor on the standard deviation of the noise.
    noise_factor: f64,
}

impl<'a, S: System> StartFit<'a, S> {
    /// `noise_std` is the standard deviation of each row.
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

    /// As `fit`, first with noise that is larger by each of `noise_factors` in turn; each fit begins where the last one ended.
    ///
    /// Graduated non-convexity (Blake and Zisserman 1987). Precise readings make narrow, curved valleys in the cost, in which a fit from far
    /// away stops; with larger noise the prior counts and can lead to the right valley.
    pub fn fit_with_decreasing_noise(&mut self, first: &[f64], noise_factors: &[f64]) -> Option<Fit> {
        let mut from = first.to_vec();
        for &noise_factor in noise_factors {
            self.noise_factor = noise_factor;
            from = self.fit(&from)?.mean;
        }
        self.noise_factor = 1.0;
        self.fit(&from)
    }

    /// Minimum of the cost, starting from `first`; `None` if the readings there are not finite.
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
                let converged = here.cost - there.cost <= CONVERGED * here.cost;
                (mean, trial) = (trial, mean);
                (here, there) = (there, here);
                damping = (damping * 0.2_f64).max(1e-12);
                if converged {
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
        self.system.transition(*after_s, mean, &self.certain, &mut self.transition);
        self.transition.apply_to_mean(&mut self.at);
        self.system.linearise(moment, &mut self.scratch, &self.at, &mut self.center, &mut self.jacobian);
        let (n, width) = (mean.len(), mean.len() + self.system.input_std().len());
        for (r, slopes) in self.jacobian.chunks_exact_mut(width).enumerate() {
            // The prediction of a missing row is undefined.
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
