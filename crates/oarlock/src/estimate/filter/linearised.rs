//! Readings taken as straight lines through one state: the columns of an extended Kalman filter.
//!
//! With P = U'U and the Jacobian J, they are H = J U' and, for every noisy input, J's own column. There are no second-order
//! ones: what curvature adds to the mean reading and to its variance is left out.

use crate::estimate::sigma::{PredictedReadings, ReadingContext};
use crate::estimate::FastSystem;
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::dense::accumulate;
use crate::kernels::sparse_jacobian::{turn, SparseJacobian};
use crate::kernels::tiles::{padded, Panel, VECTOR};

/// Room for linearised readings.
#[derive(Debug, Clone)]
pub struct Linearised {
    n: usize,
    inputs: usize,
    /// Of systems that give it without zeros.
    straight: Option<SparseJacobian>,
    /// Else a row for each reading: states, then noisy inputs.
    jacobian: Vec<f64>,
    asked: Vec<bool>,
    /// Row j is column j of the factor of the covariance, reversed.
    factor: Panel,
}

impl Linearised {
    /// For a system of `n` states.
    pub fn new<S: FastSystem>(system: &S) -> Self {
        let (n, inputs, rows) = (system.partition().dim(), system.input_std().len(), system.row_count());
        let straight = system.jacobian_pattern();
        let size = if straight.is_some() { 0 } else { rows * (n + inputs) };
        let factor = Panel::zeros(n, padded(n));
        Linearised { n, inputs, straight, jacobian: vec![0.0; size], asked: vec![false; rows], factor }
    }

    /// Fills the fan; `root` is the factor of the covariance. Allocates nothing.
    pub fn spread<S: FastSystem>(
        &mut self,
        arch: Arch,
        predicted: &mut PredictedReadings,
        context: ReadingContext<S>,
        scratch: &mut S::Scratch,
        l_transposed: &Panel,
    ) {
        arch.run(Turning { l_transposed, n: self.n, turned: &mut self.factor });
        if self.straight.is_none() {
            context.system.linearise(context.moment, scratch, context.mean, &mut predicted.h0, &mut self.jacobian);
        }
        arch.run(Columns { linearised: self, predicted, context, scratch });
    }

    #[inline(always)]
    fn dense(&self, predicted: &mut PredictedReadings, rows: &[usize]) {
        let (n, width) = (self.n, self.n + self.inputs);
        for &r in rows {
            let (slopes, of_inputs) = self.jacobian[r * width..(r + 1) * width].split_at(n);
            predicted.e.row_mut(r)[..of_inputs.len()].copy_from_slice(of_inputs);
            let row = predicted.h.row_mut(r);
            row.fill(0.0);
            let last = slopes.iter().rposition(|&s| s != 0.0).unwrap_or(0);
            // From the beginning of a vector.
            let start = (n - 1 - last) / VECTOR * VECTOR;
            let factor = &self.factor;
            accumulate(&mut row[start..], (0..=last).map(|j| (slopes[j], &factor.row(j)[start..])));
        }
    }
}

struct Turning<'a> {
    l_transposed: &'a Panel,
    n: usize,
    turned: &'a mut Panel,
}

impl Kernel for Turning<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        turn(self.l_transposed, self.n, self.turned);
    }
}

struct Columns<'a, S: FastSystem> {
    linearised: &'a mut Linearised,
    predicted: &'a mut PredictedReadings,
    context: ReadingContext<'a, S>,
    scratch: &'a mut S::Scratch,
}

impl<S: FastSystem> Kernel for Columns<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Columns { linearised, predicted, context, scratch } = self;
        let Some(straight) = &mut linearised.straight else { return linearised.dense(predicted, context.rows) };
        context.system.linearise_sparse::<FUSED>(context.moment, scratch, context.mean, &mut predicted.h0, straight);
        linearised.asked.fill(false);
        context.rows.iter().for_each(|&r| linearised.asked[r] = true);
        straight.times::<FUSED>(&linearised.factor, linearised.n, &linearised.asked, &mut predicted.h);
        straight.inputs(&linearised.asked, linearised.inputs, &mut predicted.e);
    }
}
