//! Linearised readings for the extended Kalman filter, in place of sigma points: equation U9 of docs/filter.md.
//!
//! H = J L with the Jacobian J of the readings at the mean, and a column of J for every noisy input. There is no E and no d.

use crate::estimate::sigma::{PredictedReadings, ReadingContext};
use crate::estimate::FastSystem;
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::dense::accumulate;
use crate::kernels::sparse_jacobian::{turn, SparseJacobian};
use crate::kernels::tiles::{padded, Panel, VECTOR};

/// Workspace for linearised readings.
#[derive(Debug, Clone)]
pub struct Linearised {
    n: usize,
    inputs: usize,
    /// J without its zeros, of systems that compute it so.
    sparse: Option<SparseJacobian>,
    /// J of other systems, row by row: states, then noisy inputs.
    jacobian: Vec<f64>,
    asked: Vec<bool>,
    /// Row k is row k of L, reversed.
    l_reversed: Panel,
}

impl Linearised {
    /// For `system`.
    pub fn new<S: FastSystem>(system: &S) -> Self {
        let (n, inputs, rows) = (system.partition().dim(), system.input_std().len(), system.row_count());
        let sparse = system.jacobian_pattern();
        let size = if sparse.is_some() { 0 } else { rows * (n + inputs) };
        let l_reversed = Panel::zeros(n, padded(n));
        Linearised { n, inputs, sparse, jacobian: vec![0.0; size], asked: vec![false; rows], l_reversed }
    }

    /// Fills in h0, H and D. Allocates nothing.
    pub fn fill<S: FastSystem>(
        &mut self,
        arch: Arch,
        predicted: &mut PredictedReadings,
        context: ReadingContext<S>,
        scratch: &mut S::Scratch,
        l_transposed: &Panel,
    ) {
        arch.run(Turning { l_transposed, n: self.n, turned: &mut self.l_reversed });
        if self.sparse.is_none() {
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
            let l_reversed = &self.l_reversed;
            accumulate(&mut row[start..], (0..=last).map(|j| (slopes[j], &l_reversed.row(j)[start..])));
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
        let Some(sparse) = &mut linearised.sparse else { return linearised.dense(predicted, context.rows) };
        context.system.linearise_sparse::<FUSED>(context.moment, scratch, context.mean, &mut predicted.h0, sparse);
        linearised.asked.fill(false);
        context.rows.iter().for_each(|&r| linearised.asked[r] = true);
        sparse.times::<FUSED>(&linearised.l_reversed, linearised.n, &linearised.asked, &mut predicted.h);
        sparse.inputs(&linearised.asked, linearised.inputs, &mut predicted.e);
    }
}
