//! Readings taken as straight lines through one state: the columns of an extended Kalman filter.
//!
//! With P = U'U and the Jacobian J, they are H = J U' and, for every noisy input, J's own column. There are no second-order
//! ones: what curvature adds to the mean reading and to its variance is left out.

use crate::estimate::dense::{accumulate, Square};
use crate::estimate::sigma::Fan;
use crate::estimate::transition::{multiply_transposed, Block};
use crate::estimate::{Partition, System};

/// Room for linearised readings.
#[derive(Debug, Clone)]
pub struct Tangent {
    /// A row for each reading: states, then noisy inputs.
    jacobian: Vec<f64>,
    inputs: usize,
    /// Row j is column j of the factor of the covariance, reversed.
    factor: Square,
}

impl Tangent {
    /// For `n` states.
    pub fn new(n: usize, inputs: usize, rows: usize) -> Self {
        Tangent { jacobian: vec![0.0; rows * (n + inputs)], inputs, factor: Square::zeros(n) }
    }

    /// Room for the columns: those of a fan over states in which all readings are linear.
    pub fn fan(&self, rows: usize) -> Fan {
        Fan::new(Partition { pose: 0, rate: 0, linear: self.factor.n() }, self.inputs, rows)
    }

    /// Takes in the factor of the covariance.
    pub fn prepare(&mut self, factor: &Square) {
        let n = factor.n();
        for j in 0..n {
            let row = self.factor.row_mut(j);
            (0..=j).for_each(|i| row[n - 1 - i] = factor.at(i, j));
        }
    }

    /// Fills the fan for the readings `z` that are there, linearised at `mean`; `carried` is how the tangent space at the
    /// covariance's own mean turns on the way there. Allocates nothing.
    pub fn spread<S: System>(
        &mut self,
        fan: &mut Fan,
        system: &S,
        (moment, scratch): (&S::Moment, &mut S::Scratch),
        (mean, carried): (&[f64], &[Block]),
        z: &[f64],
    ) {
        let (n, inputs) = (self.factor.n(), self.inputs);
        system.linearise(moment, scratch, mean, &mut fan.center, &mut self.jacobian);
        let rows = self.jacobian.chunks_exact_mut(n + inputs).zip(fan.g.chunks_exact_mut(fan.width)).zip(z);
        for ((slopes, g), _) in rows.filter(|(_, z)| !z.is_nan()) {
            let (slopes, of_inputs) = slopes.split_at_mut(n);
            let (before, g) = g.split_at_mut(1 + inputs);
            before[1..].copy_from_slice(of_inputs);
            multiply_transposed(carried.iter(), slopes);
            g.fill(0.0);
            let last = slopes.iter().rposition(|&s| s != 0.0).unwrap_or(0);
            let start = n - 1 - last;
            let columns = self.factor.as_slice().chunks_exact(n).map(|u| &u[start..]);
            accumulate(&mut g[start..], slopes[..=last].iter().copied().zip(columns));
        }
    }
}
