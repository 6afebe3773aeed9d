//! The scaled unscented transform in its odd/even form, which has no negative weight.
//!
//! With P = U'U, g = alpha sqrt(n + kappa) and h+- = h(x +- g u_i): H_i = (h+ - h-) / 2g, E_i = (h+ + h- - 2 h0) / 2g and
//! d = sum E_i / g. Then the innovation is z - h0 - d and Pzz = H H' + E E' + (beta - alpha^2) d d' + R, Pxz = U' H': the
//! textbook transform (Wan and van der Merwe 2000) rearranged, equal to it while beta >= alpha^2.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::{Depth, FastSystem, Partition, Points, Vary};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::lane::{Lane, LANES};
use crate::kernels::sparse_jacobian::{turn, Straight};
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
pub struct Fan {
    /// At the mean.
    pub center: Vec<f64>,
    /// d: what curvature adds to the mean reading.
    pub bend: Vec<f64>,
    /// One row a reading: H with its columns reversed.
    pub odd: Panel,
    /// One row a reading: D, E of the rates and of the poses, sqrt(beta - alpha^2) d: fewest readings have a part in the first. D has
    /// a column for each noisy input, which is what the readings change by when that input is off by its standard deviation:
    /// D D' adds to R.
    pub even: Panel,
    /// Columns of `even`.
    pub evens: usize,
    part: Partition,
    depth: Vec<Depth>,
    /// Of systems that tell how they answer to rates and linear block.
    straight: Option<Straight>,
    /// Row k is column k of the factor, reversed.
    turned: Panel,
    asked: Vec<bool>,
    off: Vec<Lane>,
    delta: Vec<Lane>,
    out: Vec<Lane>,
}

impl Fan {
    /// Room for the readings of `system`.
    pub fn new<S: FastSystem>(system: &S) -> Self {
        let (part, inputs, rows) = (system.partition(), system.input_std().len(), system.row_count());
        let (n, evens) = (part.dim(), part.curved() + 1 + inputs);
        Fan {
            center: vec![0.0; rows],
            bend: vec![0.0; rows],
            odd: Panel::zeros(rows, padded(n)),
            even: Panel::zeros(rows, padded(evens)),
            evens,
            part,
            depth: (0..rows).map(|r| system.depth(r)).collect(),
            straight: system.straight(),
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
        Fan { even: Panel::zeros(rows, padded(inputs)), evens: inputs, ..Fan::new(system) }
    }

    /// Spreads the points along the rows of `factor` and takes the readings of `rows`. Allocates nothing.
    pub fn spread<S: FastSystem>(&mut self, arch: Arch, look: Look<S>, scratch: &mut S::Scratch, factor: &Panel) {
        let (n, pose, curved, inputs) = (self.part.dim(), self.part.pose, self.part.curved(), self.off.len());
        self.delta.fill(Lane([0.0; LANES]));
        self.off.fill(Lane([0.0; LANES]));
        self.asked.fill(false);
        look.rows.iter().for_each(|&r| self.asked[r] = true);
        self.read(arch, look, scratch, factor, Batch::Mean);
        let told = self.straight.is_some();
        if told {
            arch.run(Straightening { fan: &mut *self, look, scratch: &mut *scratch, factor });
            for first in (pose..curved).step_by(LANES) {
                let count = LANES.min(curved - first);
                arch.run(Bending { fan: &mut *self, look, scratch: &mut *scratch, first, count });
            }
        }
        for block in [0..pose, pose..curved].into_iter().take(if told { 1 } else { 2 }) {
            // From the last, which may be a few: whatever it writes too much is written again by those before it.
            for first in block.clone().step_by(PAIRS).rev() {
                let (count, alone) = (PAIRS.min(block.end - first), first == block.start);
                self.read(arch, look, scratch, factor, Batch::Pairs { first, count, alone });
            }
        }
        for first in (curved..n).step_by(LANES).filter(|_| !told) {
            self.read(arch, look, scratch, factor, Batch::Singles(first, LANES.min(n - first)));
        }
        for first in (0..inputs).step_by(LANES) {
            self.read(arch, look, scratch, factor, Batch::Inputs(first, LANES.min(inputs - first)));
        }
        arch.run(Averaging { fan: self, rows: look.rows, spread: look.spread });
    }

    fn read<S: FastSystem>(
        &mut self,
        arch: Arch,
        look: Look<S>,
        scratch: &mut S::Scratch,
        factor: &Panel,
        points: Batch,
    ) {
        let reach = look.spread.reach(self.part.dim());
        arch.run(Reading { fan: self, look, scratch, factor, reach, points });
    }

    #[inline(always)]
    fn gather_mean(&mut self, rows: &[usize]) {
        for &r in rows {
            self.center[r] = self.out[r].0[0];
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
        let (odd_at, curved) = (self.part.dim() - first - count, self.part.curved());
        // E of the rates stands before E of the poses.
        let even_at = self.off.len() + curved - first - count;
        let read = self.out.iter().zip(&self.center).zip(&self.depth);
        let kept = self.odd.rows_mut().zip(self.even.rows_mut());
        for ((((out, h0), depth), (odd_row, even_row)), asked) in read.zip(kept).zip(&self.asked) {
            if !asked || (rates && *depth == Depth::Pose) {
                continue;
            }
            let (mut odd, mut even) = ([0.0; PAIRS], [0.0; PAIRS]);
            for j in 0..PAIRS {
                let (plus, minus) = (out.0[j] - h0, out.0[PAIRS + j] - h0);
                odd[j] = (plus - minus) * half;
                even[j] = (plus + minus) * half;
            }
            let count = if WHOLE { PAIRS } else { count };
            put(&mut odd_row[odd_at..], &odd, count);
            if !rates || *depth != Depth::Affine {
                put(&mut even_row[even_at..], &even, count);
            }
        }
    }

    #[inline(always)]
    fn gather_singles(&mut self, rows: &[usize], first: usize, count: usize, one: f64) {
        let at = self.part.dim() - first - count;
        for &r in rows {
            if self.depth[r] == Depth::Pose {
                continue;
            }
            let mut odd = self.out[r].0;
            for x in &mut odd {
                *x = (*x - self.center[r]) * one;
            }
            put(&mut self.odd.row_mut(r)[at..], &odd, count);
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
        let read = self.out.iter().zip(&self.center).zip(&self.asked);
        for (((out, h0), asked), row) in read.zip(self.even.rows_mut()) {
            if *asked {
                let column: [f64; LANES] = std::array::from_fn(|j| out.0[j] - h0);
                put(&mut row[first..], &column, count);
            }
        }
    }

    /// H of all that readings are straight in.
    #[inline(always)]
    fn straighten<const FUSED: bool, S: FastSystem>(
        &mut self,
        look: Look<S>,
        scratch: &mut S::Scratch,
        factor: &Panel,
    ) {
        let Some(straight) = &mut self.straight else { return };
        look.system.straighten::<FUSED>(look.moment, scratch, straight);
        turn(factor, self.part.dim(), &mut self.turned);
        let count = self.part.dim() - self.part.pose;
        straight.times::<FUSED>(&self.turned, count, &self.asked, &mut self.odd);
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
        for &r in rows.iter().filter(|&&r| self.depth[r] == Depth::Full) {
            let even = self.out[r].0.map(|x| x * reach);
            put(&mut self.even.row_mut(r)[at..], &even, count);
        }
    }

    #[inline(always)]
    fn bend_mean(&mut self, rows: &[usize], reach: f64, spread: Spread) {
        let outer = (spread.beta - spread.alpha * spread.alpha).max(0.0).sqrt();
        let (inputs, curved) = (self.off.len(), self.part.curved());
        for &r in rows {
            let row = &mut self.even.row_mut(r)[inputs..];
            let (vectors, rest) = row[..curved].as_chunks::<VECTOR>();
            let mut sums = [0.0; VECTOR];
            for v in vectors {
                for k in 0..VECTOR {
                    sums[k] += v[k];
                }
            }
            let sum = (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest.iter().sum::<f64>();
            self.bend[r] = sum / reach;
            row[curved] = outer * self.bend[r];
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
    fan: &'a mut Fan,
    look: Look<'a, S>,
    scratch: &'a mut S::Scratch,
    factor: &'a Panel,
    reach: f64,
    points: Batch,
}

impl<S: FastSystem> Kernel for Reading<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let (fan, look, reach) = (self.fan, self.look, self.reach);
        let from = match self.points {
            Batch::Mean => {
                let at = Points { mean: look.mean, delta: &fan.delta, off: &fan.off };
                look.system.settle::<FUSED>(look.moment, self.scratch, at, &mut fan.out);
                return fan.gather_mean(look.rows);
            }
            Batch::Pairs { first, count, .. } => {
                fan.place_pairs(self.factor, first, count, reach);
                first
            }
            Batch::Singles(first, count) => {
                fan.place_singles(self.factor, first, count, reach);
                first
            }
            Batch::Inputs(first, count) => {
                fan.place_inputs(look.system.input_std(), first, count);
                fan.part.dim()
            }
        };
        let at = Points { mean: look.mean, delta: &fan.delta, off: &fan.off };
        let vary = Vary { from, inputs: matches!(self.points, Batch::Inputs(..)) };
        look.system.readings_near::<FUSED>(look.moment, self.scratch, at, vary, &mut fan.out);
        match self.points {
            Batch::Pairs { first, count, alone: true } if count < PAIRS => {
                fan.gather_pairs::<false>(first, count, 0.5 / reach);
            }
            Batch::Pairs { first, count, .. } => fan.gather_pairs::<true>(first, count, 0.5 / reach),
            Batch::Singles(first, count) => fan.gather_singles(look.rows, first, count, 1.0 / reach),
            Batch::Inputs(first, count) => fan.gather_inputs(first, count),
            Batch::Mean => {}
        }
    }
}

struct Straightening<'a, S: FastSystem> {
    fan: &'a mut Fan,
    look: Look<'a, S>,
    scratch: &'a mut S::Scratch,
    factor: &'a Panel,
}

impl<S: FastSystem> Kernel for Straightening<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.fan.straighten::<FUSED, S>(self.look, self.scratch, self.factor);
    }
}

struct Bending<'a, S: FastSystem> {
    fan: &'a mut Fan,
    look: Look<'a, S>,
    scratch: &'a mut S::Scratch,
    first: usize,
    count: usize,
}

impl<S: FastSystem> Kernel for Bending<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Bending { fan, look, scratch, first, count } = self;
        fan.place_bends(first, count);
        look.system.curve::<FUSED>(look.moment, scratch, &fan.delta, &mut fan.out);
        fan.gather_bends(look.rows, first, count, look.spread.reach(fan.part.dim()));
    }
}

struct Averaging<'a> {
    fan: &'a mut Fan,
    rows: &'a [usize],
    spread: Spread,
}

impl Kernel for Averaging<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.fan.bend_mean(self.rows, self.spread.reach(self.fan.part.dim()), self.spread);
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
pub struct Look<'a, S: FastSystem> {
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

impl<S: FastSystem> Clone for Look<'_, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: FastSystem> Copy for Look<'_, S> {}
