//! Linearised readings for the extended Kalman filter, in place of sigma points: equation U9 of ARCHITECTURE.md.
//!
//! H = J L with the Jacobian J of the readings at the mean, and a column of J for every noisy input. There is no E and no d. J may also be
//! taken at another state: equation S3.

use crate::estimate::sigma::{PredictedReadings, ReadingContext};
use crate::estimate::transition::Block;
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
    away: Away,
    /// Readings at the point of linearisation.
    pub at_point: Vec<f64>,
}

/// The way from the point of linearisation to the mean.
#[derive(Debug, Clone)]
struct Away {
    step: Vec<f64>,
    /// The step from the mean to the point.
    back: Vec<f64>,
    /// Derivative of a deviation from the point by one from the mean, in blocks.
    turned: Vec<Block>,
}

impl Linearised {
    /// For `system`.
    pub fn new<S: FastSystem>(system: &S) -> Self {
        let (n, inputs, rows) = (system.partition().dim(), system.input_std().len(), system.row_count());
        let sparse = system.jacobian_pattern();
        let size = if sparse.is_some() { 0 } else { rows * (n + inputs) };
        let l_reversed = Panel::zeros(n, padded(n));
        let away = Away { step: vec![0.0; n], back: vec![0.0; n], turned: Vec::with_capacity(n) };
        Linearised {
            n,
            inputs,
            sparse,
            jacobian: vec![0.0; size],
            asked: vec![false; rows],
            l_reversed,
            away,
            at_point: vec![0.0; rows],
        }
    }

    /// Fills in h0, H and D, linearised at `point` or else at the mean. Allocates nothing.
    pub fn fill<S: FastSystem>(
        &mut self,
        arch: Arch,
        predicted: &mut PredictedReadings,
        (context, point): (ReadingContext<S>, Option<&[f64]>),
        scratch: &mut S::Scratch,
        l_transposed: &Panel,
    ) {
        // Only systems with a sparse Jacobian are linearised elsewhere.
        let point = point.filter(|_| self.sparse.is_some());
        if let Some(point) = point {
            self.away.lead(context.system, point, context.mean);
        }
        let is_away = point.is_some();
        let context = ReadingContext { mean: point.unwrap_or(context.mean), ..context };
        arch.run(Turning { l_transposed, n: self.n, turned: &mut self.l_reversed });
        if self.sparse.is_none() {
            context.system.linearise(context.moment, scratch, context.mean, &mut predicted.h0, &mut self.jacobian);
        }
        arch.run(Columns { linearised: self, predicted, context, is_away, scratch });
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

impl Away {
    fn lead<S: FastSystem>(&mut self, system: &S, point: &[f64], mean: &[f64]) {
        system.difference(mean, point, &mut self.step);
        self.back.iter_mut().zip(&self.step).for_each(|(back, x)| *back = -x);
        self.turned.clear();
        system.reset_jacobian(&self.back, &mut self.turned);
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
    is_away: bool,
    scratch: &'a mut S::Scratch,
}

impl<S: FastSystem> Kernel for Columns<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Columns { linearised, predicted, context, is_away, scratch } = self;
        let Some(sparse) = &mut linearised.sparse else { return linearised.dense(predicted, context.rows) };
        context.system.linearise_sparse::<FUSED>(context.moment, scratch, context.mean, &mut predicted.h0, sparse);
        if is_away {
            linearised.at_point.copy_from_slice(&predicted.h0);
            sparse.add_product(&linearised.away.step, &mut predicted.h0);
            linearised.away.turned.iter().for_each(|block| sparse.turn_columns(block.index, &block.factor));
        }
        linearised.asked.fill(false);
        context.rows.iter().for_each(|&r| linearised.asked[r] = true);
        sparse.times::<FUSED>(&linearised.l_reversed, linearised.n, &linearised.asked, &mut predicted.h);
        sparse.inputs(&linearised.asked, linearised.inputs, &mut predicted.e);
    }
}
