//! Prediction of mean and covariance over a time step (P1, P2 of docs/filter.md), in blocks of up to three coordinates; for filter and smoother.

mod covariance;

use crate::kernels::arch::Arch;
use crate::kernels::dense::Square;
use covariance::turn;
pub use covariance::{apply_to_rows, congruence};

/// Up to three coordinates that move together: x <- F x + offset, with added covariance Q.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// Which coordinates; only the first `len` count.
    pub index: [usize; 3],
    /// 1 to 3.
    pub len: usize,
    /// F.
    pub factor: [[f64; 3]; 3],
    /// Offset.
    pub offset: [f64; 3],
    /// Q.
    pub noise: [[f64; 3]; 3],
}

impl Block {
    /// One coordinate that is constant but for process noise of this variance.
    pub fn walk(index: usize, variance: f64) -> Self {
        let mut block =
            Block { index: [index; 3], len: 1, factor: [[0.0; 3]; 3], offset: [0.0; 3], noise: [[0.0; 3]; 3] };
        block.factor[0][0] = 1.0;
        block.noise[0][0] = variance;
        block
    }

    /// Three coordinates multiplied by a matrix, without noise.
    pub fn linear(index: [usize; 3], factor: [[f64; 3]; 3]) -> Self {
        Block { index, len: 3, factor, offset: [0.0; 3], noise: [[0.0; 3]; 3] }
    }

    fn stays(&self) -> bool {
        self.len == 1 && self.factor[0][0] == 1.0
    }
}

/// Prediction of a rotation (P2): its coordinates go into a chart, move there by their blocks, and come out again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turning {
    /// Coordinates of the mean in the chart, before it moves.
    pub chart: [f64; 3],
    /// Rotation vector of the mean after the step.
    pub value: [f64; 3],
    /// Derivative of the way into the chart.
    pub before: Block,
    /// Derivative of the way out.
    pub after: Block,
}

/// Motion of the whole state; every coordinate is in exactly one block.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Transition {
    /// The blocks.
    pub blocks: Vec<Block>,
    /// The rotation vectors among the coordinates.
    pub turnings: Vec<Turning>,
}

/// x <- F' x.
fn multiply_transposed<'a>(blocks: impl Iterator<Item = &'a Block>, x: &mut [f64]) {
    for b in blocks.filter(|b| !b.stays()) {
        let old = b.index.map(|i| x[i]);
        for c in 0..b.len {
            x[b.index[c]] = (0..b.len).map(|r| b.factor[r][c] * old[r]).sum();
        }
    }
}

impl Transition {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.turnings.clear();
    }

    /// Moves the mean that this motion was made for.
    pub fn apply_to_mean(&self, mean: &mut [f64]) {
        for t in &self.turnings {
            t.before.index.iter().zip(t.chart).for_each(|(&i, c)| mean[i] = c);
        }
        for b in &self.blocks {
            let old = b.index.map(|i| mean[i]);
            for r in 0..b.len {
                let moved: f64 = (0..b.len).map(|c| b.factor[r][c] * old[c]).sum();
                mean[b.index[r]] = moved + b.offset[r];
            }
        }
        for t in &self.turnings {
            t.after.index.iter().zip(t.value).for_each(|(&i, v)| mean[i] = v);
        }
    }

    fn before(&self) -> impl Iterator<Item = &Block> {
        self.turnings.iter().map(|t| &t.before)
    }

    fn after(&self) -> impl Iterator<Item = &Block> {
        self.turnings.iter().map(|t| &t.after)
    }

    /// P <- F P F' + Q, exactly symmetric. Allocates nothing.
    pub fn apply_to_covariance(&self, arch: Arch, p: &mut Square) {
        self.turnings.iter().for_each(|t| turn(arch, std::slice::from_ref(&t.before), p));
        turn(arch, &self.blocks, p);
        for b in &self.blocks {
            for r in 0..b.len {
                for c in 0..b.len {
                    *p.at_mut(b.index[r], b.index[c]) += b.noise[r][c];
                }
            }
        }
        self.turnings.iter().for_each(|t| turn(arch, std::slice::from_ref(&t.after), p));
        p.mirror_upper();
    }

    /// A <- F A of a matrix whose rows of this width are laid end to end. Allocates nothing.
    pub fn apply_to_rows(&self, arch: Arch, a: &mut [f64], width: usize) {
        self.turnings.iter().for_each(|t| apply_to_rows(arch, std::slice::from_ref(&t.before), a, width));
        apply_to_rows(arch, &self.blocks, a, width);
        self.turnings.iter().for_each(|t| apply_to_rows(arch, std::slice::from_ref(&t.after), a, width));
    }

    /// x <- F' x.
    pub fn apply_transposed(&self, x: &mut [f64]) {
        multiply_transposed(self.after(), x);
        multiply_transposed(self.blocks.iter(), x);
        multiply_transposed(self.before(), x);
    }

    /// v' Q v.
    pub fn noise_along(&self, v: &[f64]) -> f64 {
        let mut v = v.to_vec();
        multiply_transposed(self.after(), &mut v);
        let block = |b: &Block| -> f64 {
            let pair = |r: usize, c: usize| v[b.index[r]] * b.noise[r][c] * v[b.index[c]];
            (0..b.len).map(|r| (0..b.len).map(|c| pair(r, c)).sum::<f64>()).sum()
        };
        self.blocks.iter().map(block).sum()
    }
}
