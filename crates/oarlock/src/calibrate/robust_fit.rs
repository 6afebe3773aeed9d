//! Robust nonlinear least squares: Gauss-Newton steps with Cauchy's loss, from several starts. `joint_centers` and
//! `hinge_axes` use it.

use super::least_squares::{Estimate, LeastSquares, BLOCKS};
use super::{ask, GoOn};
use crate::Result;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// The problem to fit.
pub(crate) trait Problem {
    /// The unknowns; may be a manifold.
    type State: Clone;
    /// One residual per row, in units of the reading.
    fn errors(&self, at: &Self::State) -> DVector<f64>;
    /// Their derivatives: a row per residual, a column per unknown.
    fn slopes(&self, at: &Self::State) -> DMatrix<f64>;
    fn plus(&self, at: &Self::State, step: &DVector<f64>) -> Self::State;
    /// Difference between the unknowns and their prior, and the prior's standard deviation.
    fn departure(&self, at: &Self::State) -> (DVector<f64>, DVector<f64>);
    /// Information that noise in the derivatives appears to give: the covariance of each row's derivatives times its
    /// weight, summed over the rows. `None`: that noise is negligible.
    fn slope_noise(&self, _: &Self::State, _rows: Range<usize>, _weights: &DVector<f64>) -> Option<DMatrix<f64>> {
        None
    }
}

/// Scatter of the residuals.
pub(crate) struct Scatter {
    /// Lower limit of the standard deviation, below any sensor's noise; only fits to simulated data without noise reach
    /// it.
    pub least: f64,
    /// Number of consecutive rows whose errors are correlated and count as one.
    pub rows_per_error: f64,
}

impl Scatter {
    /// Rows with a scatter of their own, one to two seconds: the median of their absolute values is known to a quarter.
    const ROWS: usize = 20;

    /// Standard deviation of each row: that of all rows, or the larger one of those around it. Where a body rests, residuals
    /// are small; movement is not to count as exactly as rest.
    fn spreads(&self, errors: &DVector<f64>) -> DVector<f64> {
        let whole = robust_spread(errors).max(self.least);
        let count = (errors.len() / Self::ROWS).max(1);
        let mut spreads = DVector::from_element(errors.len(), whole);
        for part in 0..count {
            let (start, end) = (part * errors.len() / count, (part + 1) * errors.len() / count);
            let own = robust_spread(&errors.rows(start, end - start).into_owned());
            spreads.rows_mut(start, end - start).fill(own.max(whole));
        }
        spreads
    }
}

pub(crate) struct Fit<S> {
    pub state: S,
    /// Estimate of the difference from the prior.
    pub estimate: Estimate,
    /// Robust standard deviation of the residuals.
    pub spread: f64,
}

const MOST_STEPS: usize = 60;
/// Steps after the scatter is fixed; the fit is nearly linear by then.
const LAST_STEPS: usize = 6;

/// Returns the best fit over all starts.
pub(crate) fn fit<P: Problem>(
    problem: &P,
    starts: &[P::State],
    scatter: &Scatter,
    go_on: GoOn,
) -> Result<Fit<P::State>> {
    let mut found = Vec::with_capacity(starts.len());
    for start in starts {
        let spreads = scatter.spreads(&problem.errors(start));
        found.push(Descent { problem, scatter, spreads, loss: Loss::Square }.from(start, go_on)?);
    }
    let smallest = |states: &[P::State]| {
        let errors = states.iter().map(|s| problem.errors(s));
        let best = errors.min_by(|a, b| robust_spread(a).total_cmp(&robust_spread(b)));
        best.map_or_else(|| DVector::zeros(0), |errors| scatter.spreads(&errors))
    };
    for _ in 0..3 {
        let descent = Descent { problem, scatter, spreads: smallest(&found), loss: Loss::Cauchy };
        for state in &mut found {
            *state = descent.from(state, go_on)?;
        }
        found.sort_by(|a, b| descent.cost(a).total_cmp(&descent.cost(b)));
        found.truncate(1);
    }
    let mut state = found.remove(0);
    let spreads = smallest(std::slice::from_ref(&state));
    let descent = Descent { problem, scatter, spreads, loss: Loss::Cauchy };
    for _ in 0..LAST_STEPS {
        ask(go_on)?;
        state = problem.plus(&state, &(descent.without_noise(&state).value()? - problem.departure(&state).0));
    }
    let estimate = descent.without_noise(&state).solve()?;
    let spread = descent.spreads.min();
    Ok(Fit { state, estimate, spread })
}

/// The best fit over all starts, with residuals correlated for as long as parts of the recording show it: at least as long as
/// `scatter` says. `own` is the number of unknowns by which parts are compared, the first ones.
pub(crate) fn fit_as_scattered<P: Problem>(
    problem: &P,
    starts: &[P::State],
    scatter: &Scatter,
    own: usize,
    go_on: GoOn,
) -> Result<Fit<P::State>> {
    let found = fit(problem, starts, scatter, go_on)?;
    let excess = excess(&found.estimate, &problem.departure(&found.state).1, own);
    if excess <= 1.0 {
        return Ok(found);
    }
    let longer = Scatter { least: scatter.least, rows_per_error: scatter.rows_per_error * excess };
    fit(problem, std::slice::from_ref(&found.state), &longer, go_on)
}

/// By how much estimates from parts of the recording scatter more than the residuals explain, as a ratio of variances. A
/// direction counts by the share of it that the recording determines.
fn excess(estimate: &Estimate, prior_std: &DVector<f64>, own: usize) -> f64 {
    let scale = DMatrix::from_diagonal(&prior_std.map(|s| 1.0 / s));
    let formal = &scale * &estimate.formal * &scale;
    let explained = &formal - &formal * &formal;
    let (mut seen, mut share) = (0.0, 0.0);
    for k in 0..own {
        seen += (estimate.jackknife[k] / prior_std[k]).powi(2) / formal[(k, k)];
        share += explained[(k, k)] / formal[(k, k)];
    }
    seen / share.max(f64::MIN_POSITIVE)
}

/// Standard deviation of normal residuals with the same median of absolute values.
pub(crate) fn robust_spread(errors: &DVector<f64>) -> f64 {
    1.4826 * median(errors.iter().map(|e| e.abs()).collect())
}

/// The median; NaN without values.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let (half, n) = (values.len() / 2, values.len());
    match n {
        0 => f64::NAN,
        _ if n % 2 == 0 => 0.5 * (values[half - 1] + values[half]),
        _ => values[half],
    }
}

#[derive(Clone, Copy)]
enum Loss {
    Square,
    Cauchy,
}

impl Loss {
    /// Width of Cauchy's loss with 95 % efficiency for normal residuals.
    const WIDTH: f64 = 2.385;

    fn of(self, z: f64) -> f64 {
        match self {
            Loss::Square => 0.5 * z * z,
            Loss::Cauchy => 0.5 * Self::WIDTH.powi(2) * (z / Self::WIDTH).powi(2).ln_1p(),
        }
    }

    fn weight(self, z: f64) -> f64 {
        match self {
            Loss::Square => 1.0,
            Loss::Cauchy => 1.0 / (1.0 + (z / Self::WIDTH).powi(2)),
        }
    }
}

struct Descent<'a, P: Problem> {
    problem: &'a P,
    scatter: &'a Scatter,
    /// Standard deviation of each row.
    spreads: DVector<f64>,
    loss: Loss,
}

impl<P: Problem> Descent<'_, P> {
    fn from(&self, start: &P::State, go_on: GoOn) -> Result<P::State> {
        let (mut state, mut cost) = (start.clone(), self.cost(start));
        for _ in 0..MOST_STEPS {
            ask(go_on)?;
            let wanted = self.equations(&state).value()? - self.problem.departure(&state).0;
            let tried = (0..12).map(|halvings| self.problem.plus(&state, &(&wanted * 0.5_f64.powi(halvings))));
            let better = tried.map(|s| (self.cost(&s), s)).find(|(c, _)| *c < cost);
            let Some((lower, moved)) = better else { break };
            let settled = cost - lower < 1e-10 * cost;
            (state, cost) = (moved, lower);
            if settled {
                break;
            }
        }
        Ok(state)
    }

    fn cost(&self, state: &P::State) -> f64 {
        let errors = self.problem.errors(state);
        let rows: f64 = errors.iter().zip(&self.spreads).map(|(e, spread)| self.loss.of(e / spread)).sum();
        let (departure, std) = self.problem.departure(state);
        rows / self.scatter.rows_per_error + 0.5 * departure.component_div(&std).norm_squared()
    }

    /// Normal equations of the difference from the prior, linearised at a state.
    fn equations(&self, state: &P::State) -> LeastSquares {
        let (departure, prior_std) = self.problem.departure(state);
        let errors = self.problem.errors(state);
        let mut slopes = self.problem.slopes(state);
        let mut wanted = &slopes * departure - &errors;
        for (row, weight) in self.weights(&errors).iter().enumerate() {
            slopes.row_mut(row).scale_mut(weight.sqrt());
            wanted[row] *= weight.sqrt();
        }
        let mut equations = LeastSquares::new(prior_std);
        for block in 0..BLOCKS {
            let rows = part(errors.len(), block);
            let slopes = slopes.rows(rows.start, rows.len()).into_owned();
            equations.add(block, &slopes, &wanted.rows(rows.start, rows.len()).into_owned(), 1.0);
        }
        equations
    }

    /// The same without directions that only noise in the derivatives determines.
    fn without_noise(&self, state: &P::State) -> LeastSquares {
        let mut equations = self.equations(state);
        let weights = self.weights(&self.problem.errors(state));
        for block in 0..BLOCKS {
            if let Some(information) = self.problem.slope_noise(state, part(weights.len(), block), &weights) {
                equations.add_noise(block, &information);
            }
        }
        equations
    }

    /// Inverse variances of the rows.
    fn weights(&self, errors: &DVector<f64>) -> DVector<f64> {
        errors.zip_map(&self.spreads, |e, spread| {
            self.loss.weight(e / spread) / (spread.powi(2) * self.scatter.rows_per_error)
        })
    }
}

/// The rows of one of the consecutive blocks.
fn part(rows: usize, block: usize) -> Range<usize> {
    block * rows / BLOCKS..(block + 1) * rows / BLOCKS
}
