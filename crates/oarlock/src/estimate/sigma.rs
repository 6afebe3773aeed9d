//! The scaled unscented transform in its odd/even form, which has no negative weight.
//!
//! With P = U'U, g = alpha sqrt(n + kappa) and h+- = h(x +- g u_i): H_i = (h+ - h-) / 2g, E_i = (h+ + h- - 2 h0) / 2g and
//! d = sum E_i / g. Then the innovation is z - h0 - d and Pzz = H H' + E E' + (beta - alpha^2) d d' + R, Pxz = U' H': the
//! textbook transform (Wan and van der Merwe 2000) rearranged, equal to it while beta >= alpha^2.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::{Dependence, FastSystem, Partition, PerturbedStates, Points};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::lane::{Lane, LANES};
use crate::kernels::sparse_jacobian::{turn, SparseJacobian};
use crate::kernels::tiles::{padded, Panel, VECTOR};

/// Spread of the sigma points.
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
    /// How far out the points lie, in standard deviations.
    pub fn reach(&self, n: usize) -> f64 {
        self.alpha * (n as f64 + self.kappa).sqrt()
    }
}

/// Twins side by side: plus in the lower half of the lanes, minus in the upper.
const PAIRS: usize = LANES / 2;

/// Readings around the mean, not yet divided by noise. Whoever fills `center`, `bend`, `odd` and `even` has said all that an
/// update asks for.
#[derive(Debug, Clone)]
pub struct PredictedReadings {
    /// At the mean.
    pub h0: Vec<f64>,
    /// d: what curvature adds to the mean reading.
    pub d: Vec<f64>,
    /// One row a reading: H with its columns reversed.
    pub h: Panel,
    /// One row a reading: D, E of the rates and of the poses, sqrt(beta - alpha^2) d: fewest readings have a part in the first. D has
    /// a column for each noisy input, which is what the readings change by when that input is off by its standard deviation:
    /// D D' adds to R.
    pub e: Panel,
    /// Columns of `even`.
    pub e_columns: usize,
    part: Partition,
    dependence: Vec<Dependence>,
    /// Of systems that tell how they answer to rates and linear block.
    straight: Option<SparseJacobian>,
    /// Row k is column k of the factor, reversed.
    turned: Panel,
    asked: Vec<bool>,
    off: Vec<Lane>,
    delta: Vec<Lane>,
    out: Vec<Lane>,
}

impl PredictedReadings {
    /// Room for the readings of `system`.
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
            straight: system.linear_pattern(),
            turned: Panel::zeros(n, padded(n) + LANES),
            asked: vec![false; rows],
            off: vec![Lane([0.0; LANES]); inputs],
            delta: vec![Lane([0.0; LANES]); n],
            out: vec![Lane([0.0; LANES]); rows],
        }
    }

    /// The same where all readings are straight: `odd` and the columns of the inputs alone.
    pub fn straight<S: FastSystem>(system: &S) -> Self {
        let (inputs, rows) = (system.input_std().len().max(1), system.row_count());
        PredictedReadings { e: Panel::zeros(rows, padded(inputs)), e_columns: inputs, ..PredictedReadings::new(system) }
    }

    /// Spreads the points along the rows of `factor` and takes the readings of `rows`. Allocates nothing.
    pub fn spread<S: FastSystem>(
        &mut self,
        arch: Arch,
        context: ReadingContext<S>,
        scratch: &mut S::Scratch,
        factor: &Panel,
    ) {
        let (n, pose, curved, inputs) = (self.part.dim(), self.part.pose, self.part.curved(), self.off.len());
        self.delta.fill(Lane([0.0; LANES]));
        self.off.fill(Lane([0.0; LANES]));
        self.asked.fill(false);
        context.rows.iter().for_each(|&r| self.asked[r] = true);
        self.read(arch, context, scratch, factor, Batch::Mean);
        let told = self.straight.is_some();
        if told {
            arch.run(Straightening { predicted: &mut *self, context, scratch: &mut *scratch, factor });
            for first in (pose..curved).step_by(LANES) {
                let count = LANES.min(curved - first);
                arch.run(Bending { predicted: &mut *self, context, scratch: &mut *scratch, first, count });
            }
        }
        for block in [0..pose, pose..curved].into_iter().take(if told { 1 } else { 2 }) {
            // From the last, which may be a few: whatever it writes too much is written again by those before it.
            for first in block.clone().step_by(PAIRS).rev() {
                let (count, alone) = (PAIRS.min(block.end - first), first == block.start);
                self.read(arch, context, scratch, factor, Batch::Pairs { first, count, alone });
            }
        }
        for first in (curved..n).step_by(LANES).filter(|_| !told) {
            self.read(arch, context, scratch, factor, Batch::Singles(first, LANES.min(n - first)));
        }
        for first in (0..inputs).step_by(LANES) {
            self.read(arch, context, scratch, factor, Batch::Inputs(first, LANES.min(inputs - first)));
        }
        arch.run(Averaging { predicted: self, rows: context.rows, spread: context.spread });
    }

    fn read<S: FastSystem>(
        &mut self,
        arch: Arch,
        context: ReadingContext<S>,
        scratch: &mut S::Scratch,
        factor: &Panel,
        points: Batch,
    ) {
        let reach = context.spread.reach(self.part.dim());
        arch.run(Reading { predicted: self, context, scratch, factor, reach, points });
    }

    #[inline(always)]
    fn gather_mean(&mut self, rows: &[usize]) {
        for &r in rows {
            self.h0[r] = self.out[r].0[0];
        }
    }

    /// Lane j and its twin lie along column `first + count - 1 - j`: columns are kept in reverse.
    #[inline(always)]
    fn place_pairs(&mut self, factor: &Panel, first: usize, count: usize, reach: f64) {
        self.delta[..first].fill(Lane([0.0; LANES]));
        if self.straight.is_some() {
            return self.place_turned(first, count, reach);
        }
        let rows: [&[f64]; PAIRS] = std::array::from_fn(|j| factor.row(first + (count - 1).saturating_sub(j)));
        let steps: [f64; PAIRS] = std::array::from_fn(|j| if j < count { reach } else { 0.0 });
        for (i, delta) in self.delta.iter_mut().enumerate().skip(first) {
            for j in 0..PAIRS {
                let step = steps[j] * rows[j][i];
                delta.0[j] = step;
                delta.0[PAIRS + j] = -step;
            }
        }
    }

    /// The same, of a factor that has been turned.
    #[inline(always)]
    fn place_turned(&mut self, first: usize, count: usize, reach: f64) {
        let at = self.part.dim() - first - count;
        let steps: [f64; PAIRS] = std::array::from_fn(|j| if j < count { reach } else { 0.0 });
        for (delta, row) in self.delta.iter_mut().zip(self.turned.rows()).skip(first) {
            let along = &row[at..at + PAIRS];
            for j in 0..PAIRS {
                delta.0[j] = steps[j] * along[j];
                delta.0[PAIRS + j] = -steps[j] * along[j];
            }
        }
    }

    #[inline(always)]
    fn place_singles(&mut self, factor: &Panel, first: usize, count: usize, reach: f64) {
        self.delta[..first].fill(Lane([0.0; LANES]));
        let rows: [&[f64]; LANES] = std::array::from_fn(|j| factor.row(first + (count - 1).saturating_sub(j)));
        let steps: [f64; LANES] = std::array::from_fn(|j| if j < count { reach } else { 0.0 });
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
            let (mut h, mut e) = ([0.0; PAIRS], [0.0; PAIRS]);
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

    /// H of all that readings are straight in.
    #[inline(always)]
    fn linear_jacobian<const FUSED: bool, S: FastSystem>(
        &mut self,
        context: ReadingContext<S>,
        scratch: &mut S::Scratch,
        factor: &Panel,
    ) {
        let Some(straight) = &mut self.straight else { return };
        context.system.linear_jacobian::<FUSED>(context.moment, scratch, straight);
        turn(factor, self.part.dim(), &mut self.turned);
        let count = self.part.dim() - self.part.pose;
        straight.times::<FUSED>(&self.turned, count, &self.asked, &mut self.h);
    }

    /// Lane j lies along column `first + count - 1 - j`, one standard deviation out.
    #[inline(always)]
    fn place_bends(&mut self, first: usize, count: usize) {
        let at = self.part.dim() - first - count;
        for k in self.part.pose..self.part.curved() {
            self.delta[k].0.copy_from_slice(&self.turned.row(k)[at..at + LANES]);
        }
    }

    /// E of rates.
    #[inline(always)]
    fn gather_bends(&mut self, rows: &[usize], first: usize, count: usize, reach: f64) {
        let at = self.off.len() + self.part.curved() - first - count;
        for &r in rows.iter().filter(|&&r| self.dependence[r] == Dependence::Full) {
            let e = self.out[r].0.map(|x| x * reach);
            put(&mut self.e.row_mut(r)[at..], &e, count);
        }
    }

    #[inline(always)]
    fn bend_mean(&mut self, rows: &[usize], reach: f64, spread: Spread) {
        let outer = (spread.beta - spread.alpha * spread.alpha).max(0.0).sqrt();
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
            self.d[r] = sum / reach;
            row[curved] = outer * self.d[r];
        }
    }
}

/// Points that are read together: which columns, from one on, and how many.
#[derive(Debug, Clone, Copy)]
enum Batch {
    Mean,
    /// With `alone`, no others will be read into the columns behind these.
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
    factor: &'a Panel,
    reach: f64,
    points: Batch,
}

impl<S: FastSystem> Kernel for Reading<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let (predicted, context, reach) = (self.predicted, self.context, self.reach);
        let from = match self.points {
            Batch::Mean => {
                let at = Points { mean: context.mean, delta: &predicted.delta, off: &predicted.off };
                context.system.readings_at_mean::<FUSED>(context.moment, self.scratch, at, &mut predicted.out);
                return predicted.gather_mean(context.rows);
            }
            Batch::Pairs { first, count, .. } => {
                predicted.place_pairs(self.factor, first, count, reach);
                first
            }
            Batch::Singles(first, count) => {
                predicted.place_singles(self.factor, first, count, reach);
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
                predicted.gather_pairs::<false>(first, count, 0.5 / reach);
            }
            Batch::Pairs { first, count, .. } => predicted.gather_pairs::<true>(first, count, 0.5 / reach),
            Batch::Singles(first, count) => predicted.gather_singles(context.rows, first, count, 1.0 / reach),
            Batch::Inputs(first, count) => predicted.gather_inputs(first, count),
            Batch::Mean => {}
        }
    }
}

struct Straightening<'a, S: FastSystem> {
    predicted: &'a mut PredictedReadings,
    context: ReadingContext<'a, S>,
    scratch: &'a mut S::Scratch,
    factor: &'a Panel,
}

impl<S: FastSystem> Kernel for Straightening<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.predicted.linear_jacobian::<FUSED, S>(self.context, self.scratch, self.factor);
    }
}

struct Bending<'a, S: FastSystem> {
    predicted: &'a mut PredictedReadings,
    context: ReadingContext<'a, S>,
    scratch: &'a mut S::Scratch,
    first: usize,
    count: usize,
}

impl<S: FastSystem> Kernel for Bending<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Bending { predicted, context, scratch, first, count } = self;
        predicted.place_bends(first, count);
        context.system.second_order::<FUSED>(context.moment, scratch, &predicted.delta, &mut predicted.out);
        predicted.gather_bends(context.rows, first, count, context.spread.reach(predicted.part.dim()));
    }
}

struct Averaging<'a> {
    predicted: &'a mut PredictedReadings,
    rows: &'a [usize],
    spread: Spread,
}

impl Kernel for Averaging<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.predicted.bend_mean(self.rows, self.spread.reach(self.predicted.part.dim()), self.spread);
    }
}

/// The first `count` of a few numbers, by copies whose lengths are known beforehand.
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

/// What is looked at, and how.
#[derive(Debug)]
pub struct ReadingContext<'a, S: FastSystem> {
    /// That reads.
    pub system: &'a S,
    /// Its inputs, and which readings are there.
    pub moment: &'a S::Moment,
    /// In the middle.
    pub mean: &'a [f64],
    /// Readings that are asked for.
    pub rows: &'a [usize],
    /// How far around.
    pub spread: Spread,
}

impl<S: FastSystem> Clone for ReadingContext<'_, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: FastSystem> Copy for ReadingContext<'_, S> {}
