//! Readings taken as straight lines through one state: the columns of an extended Kalman filter.
//!
//! With P = U'U and the Jacobian J, they are H = J U' and, for every noisy input, J's own column. There are no second-order
//! ones: what curvature adds to the mean reading and to its variance is left out.

use crate::estimate::dense::accumulate;
use crate::estimate::sigma::Fan;
use crate::estimate::tiles::{padded, Panel, VECTOR};
use crate::estimate::transition::{multiply_transposed, Block};
use crate::estimate::System;
use crate::lane::arch::{Arch, Kernel};

/// Room for linearised readings.
#[derive(Debug, Clone)]
pub struct Tangent {
    n: usize,
    inputs: usize,
    /// A row for each reading: states, then noisy inputs.
    jacobian: Vec<f64>,
    /// Row j is column j of the factor of the covariance, reversed.
    factor: Panel,
}

/// Where, and for which readings.
#[derive(Debug, Clone, Copy)]
pub struct At<'a> {
    /// State.
    pub mean: &'a [f64],
    /// How the tangent space at the covariance's own mean turns on the way there.
    pub carried: &'a [Block],
    /// Readings that are there.
    pub rows: &'a [usize],
}

impl Tangent {
    /// For `n` states.
    pub fn new(n: usize, inputs: usize, rows: usize) -> Self {
        Tangent { n, inputs, jacobian: vec![0.0; rows * (n + inputs)], factor: Panel::zeros(n, padded(n)) }
    }

    /// Takes in the factor of the covariance.
    pub fn prepare(&mut self, root: &Panel) {
        let n = self.n;
        for i in 0..n {
            (i..n).for_each(|j| self.factor.row_mut(j)[n - 1 - i] = root.at(i, j));
        }
    }

    /// Fills the fan. Allocates nothing.
    pub fn spread<S: System>(
        &mut self,
        arch: Arch,
        fan: &mut Fan,
        (system, moment): (&S, &S::Moment),
        scratch: &mut S::Scratch,
        at: At,
    ) {
        system.linearise(moment, scratch, at.mean, &mut fan.center, &mut self.jacobian);
        arch.run(Columns { tangent: self, fan, at });
    }
}

struct Columns<'a> {
    tangent: &'a mut Tangent,
    fan: &'a mut Fan,
    at: At<'a>,
}

impl Kernel for Columns<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Columns { tangent, fan, at } = self;
        let (n, width) = (tangent.n, tangent.n + tangent.inputs);
        for &r in at.rows {
            let (slopes, of_inputs) = tangent.jacobian[r * width..(r + 1) * width].split_at_mut(n);
            fan.even.row_mut(r)[..of_inputs.len()].copy_from_slice(of_inputs);
            multiply_transposed(at.carried.iter(), slopes);
            let row = fan.odd.row_mut(r);
            row.fill(0.0);
            let last = slopes.iter().rposition(|&s| s != 0.0).unwrap_or(0);
            // From the beginning of a vector.
            let start = (n - 1 - last) / VECTOR * VECTOR;
            let factor = &tangent.factor;
            accumulate(&mut row[start..], (0..=last).map(|j| (slopes[j], &factor.row(j)[start..])));
        }
    }
}
