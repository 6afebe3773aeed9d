//! Linear least squares with a prior, the one solver of all calibrations. Blocks in time are kept apart, so that a jackknife
//! gives the uncertainty. `robust_fit` linearises for it; [`SensorRows`] estimates the noise of each sensor with it.

use super::{ask, GoOn};
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Number of consecutive parts of a recording that the jackknife leaves out in turn.
pub(crate) const BLOCKS: usize = 8;
/// Times between two calls of [`GoOn`].
const ASK_EVERY: usize = 256;

/// Normal equations of one block: information matrix and information vector.
#[derive(Debug, Clone)]
struct Block {
    matrix: DMatrix<f64>,
    vector: DVector<f64>,
    /// Part of the matrix that is due to noise in the rows' coefficients.
    noise: DMatrix<f64>,
}

/// Collects weighted rows in consecutive blocks of the recording.
#[derive(Debug, Clone)]
pub(crate) struct LeastSquares {
    blocks: Vec<Block>,
    prior_std: DVector<f64>,
}

/// The estimate, the standard deviation of each unknown, and their covariance.
#[derive(Debug, Clone)]
pub(crate) struct Estimate {
    pub value: DVector<f64>,
    pub std: DVector<f64>,
    pub covariance: DMatrix<f64>,
    /// The covariance that white noise and the prior explain.
    pub formal: DMatrix<f64>,
    /// Standard deviations by the delete-one-block jackknife.
    pub jackknife: DVector<f64>,
}

impl LeastSquares {
    /// For unknowns with a prior of zero mean and standard deviation `prior_std`.
    pub fn new(prior_std: DVector<f64>) -> Self {
        let n = prior_std.len();
        let zero = DMatrix::zeros(n, n);
        let empty = Block { matrix: zero.clone(), vector: DVector::zeros(n), noise: zero };
        Self { blocks: vec![empty; BLOCKS], prior_std }
    }

    /// Adds rows `a x = y + noise` with noise of standard deviation `std`, in part `block`.
    pub fn add(&mut self, block: usize, a: &DMatrix<f64>, y: &DVector<f64>, std: f64) {
        let weight = 1.0 / (std * std);
        let block = &mut self.blocks[block];
        block.matrix.gemm_tr(weight, a, a, 1.0);
        block.vector.gemv_tr(weight, a, y, 1.0);
    }

    /// Adds the information that noise in the coefficients of block `block` appears to give.
    pub fn add_noise(&mut self, block: usize, information: &DMatrix<f64>) {
        self.blocks[block].noise += information;
    }

    /// Solves the equations. The standard deviation is the larger one of the formal value (white noise, prior) and the
    /// delete-one-block jackknife, which includes errors that are correlated in time. The covariance has the
    /// correlations of the formal one.
    pub fn solve(&self) -> Result<Estimate> {
        let (value, formal) = self.solve_without(None)?;
        let mut spread = DVector::zeros(value.len());
        for left_out in 0..self.blocks.len() {
            let d = self.solve_without(Some(left_out))?.0 - &value;
            spread += d.component_mul(&d);
        }
        let count = self.blocks.len() as f64;
        let jackknife = spread.map(|s| (s * (count - 1.0) / count).sqrt());
        let formal_std = formal.diagonal().map(f64::sqrt);
        let std = formal_std.zip_map(&jackknife, f64::max);
        let larger = DMatrix::from_diagonal(&std.component_div(&formal_std));
        Ok(Estimate { value, std, covariance: &larger * &formal * &larger, formal, jackknife })
    }

    /// The estimate alone.
    pub fn value(&self) -> Result<DVector<f64>> {
        Ok(self.solve_without(None)?.0)
    }

    fn solve_without(&self, left_out: Option<usize>) -> Result<(DVector<f64>, DMatrix<f64>)> {
        let n = self.prior_std.len();
        let mut sum = Block { matrix: DMatrix::zeros(n, n), vector: DVector::zeros(n), noise: DMatrix::zeros(n, n) };
        for (index, block) in self.blocks.iter().enumerate() {
            if Some(index) != left_out {
                sum.matrix += &block.matrix;
                sum.vector += &block.vector;
                sum.noise += &block.noise;
            }
        }
        if sum.noise.iter().any(|&x| x != 0.0) {
            self.without_noise(&mut sum);
        }
        let prior = DMatrix::from_diagonal(&self.prior_std.map(|s| 1.0 / (s * s)));
        let factor = (sum.matrix + prior).cholesky().ok_or_else(|| {
            Error::Data("the calibration's equations have no solution: look for values that are not finite".into())
        })?;
        Ok((factor.solve(&sum.vector), factor.inverse()))
    }

    /// Leaves a direction entirely to the prior if noise gives most of its apparent information. The noise is not
    /// subtracted in the others: if it were overestimated, the estimate would diverge.
    fn without_noise(&self, sum: &mut Block) {
        const MOST: f64 = 0.8;
        let scale = DMatrix::from_diagonal(&self.prior_std);
        let seen = &scale * &sum.matrix * &scale;
        if !seen.iter().all(|x| x.is_finite()) {
            // The factorisation reports the error; the eigenvalue iteration would not end.
            return;
        }
        let eigen = SymmetricEigen::new(&seen - &scale * &sum.noise * &scale);
        let mut kept = DMatrix::zeros(seen.nrows(), seen.nrows());
        for (k, &information) in eigen.eigenvalues.iter().enumerate() {
            let direction = eigen.eigenvectors.column(k);
            if information > (1.0 - MOST) * (direction.transpose() * &seen * direction)[0] {
                kept += direction * direction.transpose();
            }
        }
        let back = DMatrix::from_diagonal(&self.prior_std.map(|s| 1.0 / s));
        sum.matrix = &back * &kept * seen * &kept * &back;
        sum.vector = &back * kept * scale * &sum.vector;
    }
}

/// Linear readings of several sensors at common times, three rows each. The noise of the sensors is unknown.
pub(crate) trait SensorRows {
    /// Number of sensors.
    fn sensors(&self) -> usize;
    /// Indices of the times in use.
    fn times(&self) -> &[usize];
    /// Coefficients of the unknowns and reading of sensor `i` at time `k`.
    fn row(&self, i: usize, k: usize) -> (DMatrix<f64>, DVector<f64>);

    /// The estimate, weighted by the noise that the residuals show. `noise` turns the sensors' root mean square residuals
    /// into their standard deviations.
    fn reweighted(
        &self,
        prior_std: &DVector<f64>,
        start_std: f64,
        noise: impl Fn(Vec<f64>) -> Vec<f64>,
        go_on: GoOn,
    ) -> Result<Estimate> {
        let mut std = vec![start_std; self.sensors()];
        for _ in 0..2 {
            let value = self.equations(prior_std, &std, go_on)?.value()?;
            std = noise((0..self.sensors()).map(|i| self.residual(i, &value)).collect());
        }
        self.equations(prior_std, &std, go_on)?.solve()
    }

    fn equations(&self, prior_std: &DVector<f64>, std: &[f64], go_on: GoOn) -> Result<LeastSquares> {
        let mut squares = LeastSquares::new(prior_std.clone());
        for (n, &k) in self.times().iter().enumerate() {
            if n % ASK_EVERY == 0 {
                ask(go_on)?;
            }
            for (i, &std) in std.iter().enumerate() {
                let (coefficients, reading) = self.row(i, k);
                squares.add(n * BLOCKS / self.times().len(), &coefficients, &reading, std);
            }
        }
        Ok(squares)
    }

    /// Root mean square residual of sensor `i` per axis.
    fn residual(&self, i: usize, value: &DVector<f64>) -> f64 {
        let left = |&k: &usize| {
            let (coefficients, reading) = self.row(i, k);
            (reading - coefficients * value).norm_squared()
        };
        let sum: f64 = self.times().iter().map(left).sum();
        (sum / (3.0 * self.times().len().max(1) as f64)).sqrt()
    }
}
