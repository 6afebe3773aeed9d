//! Predicted readings and their columns from sigma points, for the update: h0, H, E and d of equations U1 and U2.
//!
//! Equation numbers are those of docs/filter.md. It is the scaled unscented transform (Wan and van der Merwe 2000) rearranged into odd and
//! even parts; no weight is negative while beta >= alpha^2.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::{Dependence, FastSystem, Partition, PerturbedStates, Points};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::lane::{Lane, LANES};
use crate::kernels::sparse_jacobian::{turn, SparseJacobian};
use crate::kernels::tiles::{padded, Panel, VECTOR};

/// Scaling of the sigma points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Scale of the points, in (0, 1].
    pub alpha: f64,
    /// Weight of the second-order part; 2 is right for a Gaussian.
    pub beta: f64,
    /// Usually 0.
    pub kappa: f64,
}

impl Spread {
    /// g of U1: distance of the points from the mean, in standard deviations.
    pub fn reach(&self, n: usize) -> f64 {
        self.alpha * (n as f64 + self.kappa).sqrt()
    }
}

/// Pairs in one lane: plus points in its lower half, minus points in its upper half.
const PAIRS: usize = LANES / 2;

/// Predicted readings with their first- and second-order columns, not yet divided by noise: all that an update needs of a system.
#[derive(Debug, Clone)]
pub struct PredictedReadings {
    /// h0 = h(x).
    pub h0: Vec<f64>,
    /// d: second-order shift of the mean reading.
    pub d: Vec<f64>,
    /// H, a row for each reading, its columns in reverse order.
    pub h: Panel,
    /// [D | E of rates | E of poses | sqrt(beta - alpha^2) d], a row for each reading. D has a column for each noisy input: the change of
    /// the readings when that input is off by its standard deviation. The block in which fewest readings have entries comes first.
    pub e: Panel,
    /// Columns of `e` in use.
    pub e_columns: usize,
    part: Partition,
    dependence: Vec<Dependence>,
    /// Jacobian by rates and linear block, of systems that compute it.
    linear: Option<SparseJacobian>,
    /// Row k is row k of L, reversed.
    l_reversed: Panel,
    asked: Vec<bool>,
    off: Vec<Lane>,
    delta: Vec<Lane>,
    out: Vec<Lane>,
}

impl PredictedReadings {
    /// Workspace for the readings of `system`.
    pub fn new<S: FastSystem>(system: &S) -> Self {
        let (part, inputs, rows) = (system.partition(), system.input_std().len(), system.row_count());
        let (n, e_columns) = (part.dim(), part.curved() + 1 + inputs);
        PredictedReadings {
            h0: vec![0.0; rows],
            d: vec![0.0; rows],
            h: Panel::zeros(rows, padded(n)),
            e: Panel::zeros(rows, padded(e_columns)),
            e_columns,
            part,
            dependence: (0..rows).map(|r| system.dependence(r)).collect(),
            linear: system.linear_pattern(),
            l_reversed: Panel::zeros(n, padded(n) + LANES),
            asked: vec![false; rows],
            off: vec![Lane([0.0; LANES]); inputs],
            delta: vec![Lane([0.0; LANES]); n],
            out: vec![Lane([0.0; LANES]); rows],
        }
    }

    /// The same for linearised readings (U9): H, and D in place of E.
    pub fn linear<S: FastSystem>(system: &S) -> Self {
        let (inputs, rows) = (system.input_std().len().max(1), system.row_count());
        PredictedReadings { e: Panel::zeros(rows, padded(inputs)), e_columns: inputs, ..PredictedReadings::new(system) }
    }

    /// U1 and U2 for the rows of `context`. Allocates nothing.
    pub fn from_sigma_points<S: FastSystem>(
        &mut self,
        arch: Arch,
        context: ReadingContext<S>,
        scratch: &mut S::Scratch,
        l_transposed: &Panel,
    ) {
        let (n, pose, curved, inputs) = (self.part.dim(), self.part.pose, self.part.curved(), self.off.len());
        self.delta.fill(Lane([0.0; LANES]));
        self.off.fill(Lane([0.0; LANES]));
        self.asked.fill(false);
        context.rows.iter().for_each(|&r| self.asked[r] = true);
        self.read(arch, context, scratch, l_transposed, Batch::Mean);
        let has_jacobian = self.linear.is_some();
        if has_jacobian {
            arch.run(LinearColumns { predicted: &mut *self, context, scratch: &mut *scratch, l_transposed });
            for first in (pose..curved).step_by(LANES) {
                let count = LANES.min(curved - first);
                arch.run(SecondOrderColumns { predicted: &mut *self, context, scratch: &mut *scratch, first, count });
            }
        }
        for block in [0..pose, pose..curved].into_iter().take(if has_jacobian { 1 } else { 2 }) {
            // Backwards: the last batch may be incomplete, and what it writes too much is overwritten by the ones before it.
            for first in block.clone().step_by(PAIRS).rev() {
                let (count, alone) = (PAIRS.min(block.end - first), first == block.start);
                self.read(arch, context, scratch, l_transposed, Batch::Pairs { first, count, alone });
            }
        }
        for first in (curved..n).step_by(LANES).filter(|_| !has_jacobian) {
            self.read(arch, context, scratch, l_transposed, Batch::Singles(first, LANES.min(n - first)));
        }
        for first in (0..inputs).step_by(LANES) {
            self.read(arch, context, scratch, l_transposed, Batch::Inputs(first, LANES.min(inputs - first)));
        }
        arch.run(MeanShift { predicted: self, rows: context.rows, spread: context.spread });
    }

    fn read<S: FastSystem>(
        &mut self,
        arch: Arch,
        context: ReadingContext<S>,
        scratch: &mut S::Scratch,
        l_transposed: &Panel,
        points: Batch,
    ) {
        let g = context.spread.reach(self.part.dim());
        arch.run(Reading { predicted: self, context, scratch, l_transposed, g, points });
    }

    #[inline(always)]
    fn gather_mean(&mut self, rows: &[usize]) {
        for &r in rows {
            self.h0[r] = self.out[r].0[0];
        }
    }

    /// x +- g L_i: lanes j and j + 4 lie along column `first + count - 1 - j`, since columns stand in reverse order.
    #[inline(always)]
    fn place_pairs(&mut self, l_transposed: &Panel, first: usize, count: usize, g: f64) {
        self.delta[..first].fill(Lane([0.0; LANES]));
        if self.linear.is_some() {
            return self.place_pairs_reversed(first, count, g);
        }
        let rows: [&[f64]; PAIRS] = std::array::from_fn(|j| l_transposed.row(first + (count - 1).saturating_sub(j)));
        let steps: [f64; PAIRS] = std::array::from_fn(|j| if j < count { g } else { 0.0 });
        for (i, delta) in self.delta.iter_mut().enumerate().skip(first) {
            for j in 0..PAIRS {
                let step = steps[j] * rows[j][i];
                delta.0[j] = step;
                delta.0[PAIRS + j] = -step;
            }
        }
    }

    /// The same from `l_reversed`, whose rows are contiguous.
    #[inline(always)]
    fn place_pairs_reversed(&mut self, first: usize, count: usize, g: f64) {
        let at = self.part.dim() - first - count;
        let steps: [f64; PAIRS] = std::array::from_fn(|j| if j < count { g } else { 0.0 });
        for (delta, row) in self.delta.iter_mut().zip(self.l_reversed.rows()).skip(first) {
            let along = &row[at..at + PAIRS];
            for j in 0..PAIRS {
                delta.0[j] = steps[j] * along[j];
                delta.0[PAIRS + j] = -steps[j] * along[j];
            }
        }
    }

    #[inline(always)]
    fn place_singles(&mut self, l_transposed: &Panel, first: usize, count: usize, g: f64) {
        self.delta[..first].fill(Lane([0.0; LANES]));
        let rows: [&[f64]; LANES] = std::array::from_fn(|j| l_transposed.row(first + (count - 1).saturating_sub(j)));
        let steps: [f64; LANES] = std::array::from_fn(|j| if j < count { g } else { 0.0 });
        for (i, delta) in self.delta.iter_mut().enumerate().skip(first) {
            for j in 0..LANES {
                delta.0[j] = steps[j] * rows[j][i];
            }
        }
    }

    #[inline(always)]
    fn gather_pairs<const WHOLE: bool>(&mut self, first: usize, count: usize, half: f64) {
        let rates = first >= self.part.pose;
        let (h_at, curved) = (self.part.dim() - first - count, self.part.curved());
        // E of the rates stands before E of the poses.
        let e_at = self.off.len() + curved - first - count;
        let read = self.out.iter().zip(&self.h0).zip(&self.dependence);
        let kept = self.h.rows_mut().zip(self.e.rows_mut());
        for ((((out, h0), dependence), (h_row, e_row)), asked) in read.zip(kept).zip(&self.asked) {
            if !asked || (rates && *dependence == Dependence::Pose) {
                continue;
            }
            let (mut h, mut e) = ([0.0; PAIRS], [0.0; PAIRS]); // U2
            for j in 0..PAIRS {
                let (plus, minus) = (out.0[j] - h0, out.0[PAIRS + j] - h0);
                h[j] = (plus - minus) * half;
                e[j] = (plus + minus) * half;
            }
            let count = if WHOLE { PAIRS } else { count };
            put(&mut h_row[h_at..], &h, count);
            if !rates || *dependence != Dependence::Affine {
                put(&mut e_row[e_at..], &e, count);
            }
        }
    }

    #[inline(always)]
    fn gather_singles(&mut self, rows: &[usize], first: usize, count: usize, one: f64) {
        let at = self.part.dim() - first - count;
        for &r in rows {
            if self.dependence[r] == Dependence::Pose {
                continue;
            }
            let mut h = self.out[r].0;
            for x in &mut h {
                *x = (*x - self.h0[r]) * one;
            }
            put(&mut self.h.row_mut(r)[at..], &h, count);
        }
    }

    #[inline(always)]
    fn place_inputs(&mut self, std: &[f64], first: usize, count: usize) {
        self.delta.fill(Lane([0.0; LANES]));
        self.off.fill(Lane([0.0; LANES]));
        for j in 0..count {
            self.off[first + j].0[j] = std[first + j];
        }
    }

    #[inline(always)]
    fn gather_inputs(&mut self, first: usize, count: usize) {
        let read = self.out.iter().zip(&self.h0).zip(&self.asked);
        for (((out, h0), asked), row) in read.zip(self.e.rows_mut()) {
            if *asked {
                let column: [f64; LANES] = std::array::from_fn(|j| out.0[j] - h0);
                put(&mut row[first..], &column, count);
            }
        }
    }

    /// H of rates and linear block: the exact Jacobian times L, without sigma points.
    #[inline(always)]
    fn linear_jacobian<const FUSED: bool, S: FastSystem>(
        &mut self,
        context: ReadingContext<S>,
        scratch: &mut S::Scratch,
        l_transposed: &Panel,
    ) {
        let Some(linear) = &mut self.linear else { return };
        context.system.linear_jacobian::<FUSED>(context.moment, scratch, linear);
        turn(l_transposed, self.part.dim(), &mut self.l_reversed);
        let count = self.part.dim() - self.part.pose;
        linear.times::<FUSED>(&self.l_reversed, count, &self.asked, &mut self.h);
    }

    /// Rates of column `first + count - 1 - j` of L in lane j.
    #[inline(always)]
    fn place_rates(&mut self, first: usize, count: usize) {
        let at = self.part.dim() - first - count;
        for k in self.part.pose..self.part.curved() {
            self.delta[k].0.copy_from_slice(&self.l_reversed.row(k)[at..at + LANES]);
        }
    }

    /// E of the rates, in which readings are quadratic.
    #[inline(always)]
    fn gather_second_order(&mut self, rows: &[usize], first: usize, count: usize, g: f64) {
        let at = self.off.len() + self.part.curved() - first - count;
        for &r in rows.iter().filter(|&&r| self.dependence[r] == Dependence::Full) {
            let e = self.out[r].0.map(|x| x * g);
            put(&mut self.e.row_mut(r)[at..], &e, count);
        }
    }

    /// d of U2, and its column of `e`.
    #[inline(always)]
    fn fill_d(&mut self, rows: &[usize], g: f64, spread: Spread) {
        let weight = (spread.beta - spread.alpha * spread.alpha).max(0.0).sqrt();
        let (inputs, curved) = (self.off.len(), self.part.curved());
        for &r in rows {
            let row = &mut self.e.row_mut(r)[inputs..];
            let (vectors, rest) = row[..curved].as_chunks::<VECTOR>();
            let mut sums = [0.0; VECTOR];
            for v in vectors {
                for k in 0..VECTOR {
                    sums[k] += v[k];
                }
            }
            let sum = (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest.iter().sum::<f64>();
            self.d[r] = sum / g;
            row[curved] = weight * self.d[r];
        }
    }
}

/// Points of one pass through the system, by their columns of L.
#[derive(Debug, Clone, Copy)]
enum Batch {
    Mean,
    /// `alone`: no later batch overwrites the columns behind these.
    Pairs {
        first: usize,
        count: usize,
        alone: bool,
    },
    Singles(usize, usize),
    Inputs(usize, usize),
}

struct Reading<'a, S: FastSystem> {
    predicted: &'a mut PredictedReadings,
    context: ReadingContext<'a, S>,
    scratch: &'a mut S::Scratch,
    l_transposed: &'a Panel,
    g: f64,
    points: Batch,
}

impl<S: FastSystem> Kernel for Reading<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let (predicted, context, g) = (self.predicted, self.context, self.g);
        let from = match self.points {
            Batch::Mean => {
                let at = Points { mean: context.mean, delta: &predicted.delta, off: &predicted.off };
                context.system.readings_at_mean::<FUSED>(context.moment, self.scratch, at, &mut predicted.out);
                return predicted.gather_mean(context.rows);
            }
            Batch::Pairs { first, count, .. } => {
                predicted.place_pairs(self.l_transposed, first, count, g);
                first
            }
            Batch::Singles(first, count) => {
                predicted.place_singles(self.l_transposed, first, count, g);
                first
            }
            Batch::Inputs(first, count) => {
                predicted.place_inputs(context.system.input_std(), first, count);
                predicted.part.dim()
            }
        };
        let at = Points { mean: context.mean, delta: &predicted.delta, off: &predicted.off };
        let perturbed = PerturbedStates { from, inputs: matches!(self.points, Batch::Inputs(..)) };
        context.system.readings_near_mean::<FUSED>(context.moment, self.scratch, at, perturbed, &mut predicted.out);
        match self.points {
            Batch::Pairs { first, count, alone: true } if count < PAIRS => {
                predicted.gather_pairs::<false>(first, count, 0.5 / g);
            }
            Batch::Pairs { first, count, .. } => predicted.gather_pairs::<true>(first, count, 0.5 / g),
            Batch::Singles(first, count) => predicted.gather_singles(context.rows, first, count, 1.0 / g),
            Batch::Inputs(first, count) => predicted.gather_inputs(first, count),
            Batch::Mean => {}
        }
    }
}

struct LinearColumns<'a, S: FastSystem> {
    predicted: &'a mut PredictedReadings,
    context: ReadingContext<'a, S>,
    scratch: &'a mut S::Scratch,
    l_transposed: &'a Panel,
}

impl<S: FastSystem> Kernel for LinearColumns<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.predicted.linear_jacobian::<FUSED, S>(self.context, self.scratch, self.l_transposed);
    }
}

struct SecondOrderColumns<'a, S: FastSystem> {
    predicted: &'a mut PredictedReadings,
    context: ReadingContext<'a, S>,
    scratch: &'a mut S::Scratch,
    first: usize,
    count: usize,
}

impl<S: FastSystem> Kernel for SecondOrderColumns<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let SecondOrderColumns { predicted, context, scratch, first, count } = self;
        predicted.place_rates(first, count);
        context.system.second_order::<FUSED>(context.moment, scratch, &predicted.delta, &mut predicted.out);
        predicted.gather_second_order(context.rows, first, count, context.spread.reach(predicted.part.dim()));
    }
}

struct MeanShift<'a> {
    predicted: &'a mut PredictedReadings,
    rows: &'a [usize],
    spread: Spread,
}

impl Kernel for MeanShift<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.predicted.fill_d(self.rows, self.spread.reach(self.predicted.part.dim()), self.spread);
    }
}

/// Copies the first `count` values, in pieces whose lengths the compiler knows.
#[inline(always)]
fn put<const N: usize>(out: &mut [f64], values: &[f64; N], count: usize) {
    if count == N {
        *out.first_chunk_mut().expect("there is room") = *values;
        return;
    }
    let mut at = 0;
    for length in [4, 2, 1] {
        if count & length > 0 {
            out[at..at + length].copy_from_slice(&values[at..at + length]);
            at += length;
        }
    }
}

/// What readings are predicted of, and with which sigma points.
#[derive(Debug)]
pub struct ReadingContext<'a, S: FastSystem> {
    /// The system.
    pub system: &'a S,
    /// Its inputs, and which rows are present.
    pub moment: &'a S::Moment,
    /// The mean x.
    pub mean: &'a [f64],
    /// Rows to predict.
    pub rows: &'a [usize],
    /// Scaling of the sigma points.
    pub spread: Spread,
}

impl<S: FastSystem> Clone for ReadingContext<'_, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: FastSystem> Copy for ReadingContext<'_, S> {}
