//! Linear least squares with a prior, kept block by block so that its uncertainty can be taken from the data.

use crate::{Error, Result};
use nalgebra::{DMatrix, DVector};

/// Normal equations of some stretch of time: information matrix, information vector.
#[derive(Debug, Clone)]
struct Block {
    matrix: DMatrix<f64>,
    vector: DVector<f64>,
}

/// Collects weighted rows into `blocks` consecutive parts of the recording.
#[derive(Debug, Clone)]
pub(crate) struct LeastSquares {
    blocks: Vec<Block>,
    prior_std: DVector<f64>,
}

/// The estimate and the standard deviation of each unknown.
#[derive(Debug, Clone)]
pub(crate) struct Estimate {
    pub value: DVector<f64>,
    pub std: DVector<f64>,
}

impl LeastSquares {
    /// For unknowns that are zero with `prior_std` before any row is seen.
    pub fn new(prior_std: DVector<f64>, blocks: usize) -> Self {
        let n = prior_std.len();
        let empty = Block { matrix: DMatrix::zeros(n, n), vector: DVector::zeros(n) };
        Self { blocks: vec![empty; blocks.max(2)], prior_std }
    }

    /// Adds rows `a x = y + noise` with noise of standard deviation `std`, in part `block`.
    pub fn add(&mut self, block: usize, a: &DMatrix<f64>, y: &DVector<f64>, std: f64) {
        let weight = 1.0 / (std * std);
        let last = self.blocks.len() - 1;
        let block = &mut self.blocks[block.min(last)];
        block.matrix.gemm_tr(weight, a, a, 1.0);
        block.vector.gemv_tr(weight, a, y, 1.0);
    }

    /// Solves. The standard deviation is the larger one of the formal figure (white noise, prior) and of the
    /// delete-one-block jackknife, which also sees errors that are correlated in time.
    pub fn solve(&self) -> Result<Estimate> {
        let (value, formal) = self.solve_without(None)?;
        let mut spread = DVector::zeros(value.len());
        for left_out in 0..self.blocks.len() {
            let d = self.solve_without(Some(left_out))?.0 - &value;
            spread += d.component_mul(&d);
        }
        let count = self.blocks.len() as f64;
        let jackknife = spread.map(|s| (s * (count - 1.0) / count).sqrt());
        Ok(Estimate { std: formal.zip_map(&jackknife, f64::max), value })
    }

    fn solve_without(&self, left_out: Option<usize>) -> Result<(DVector<f64>, DVector<f64>)> {
        let mut matrix = DMatrix::from_diagonal(&self.prior_std.map(|s| 1.0 / (s * s)));
        let mut vector = DVector::zeros(self.prior_std.len());
        for (index, block) in self.blocks.iter().enumerate() {
            if Some(index) != left_out {
                matrix += &block.matrix;
                vector += &block.vector;
            }
        }
        let factor = matrix.cholesky().ok_or_else(|| {
            Error::Data("the calibration's equations have no solution: look for values that are not finite".into())
        })?;
        let formal = factor.inverse().diagonal().map(f64::sqrt);
        Ok((factor.solve(&vector), formal))
    }
}
