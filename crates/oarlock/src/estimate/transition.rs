//! Exact linear motion of the state over a time step, in blocks of up to three coordinates.

use super::dense::{accumulate, Square};

/// Up to three coordinates that move together: x <- F x + offset, with added covariance Q.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// Which coordinates; only the first `len` count.
    pub index: [usize; 3],
    /// 1 or 3.
    pub len: usize,
    /// F.
    pub factor: [[f64; 3]; 3],
    /// Offset.
    pub offset: [f64; 3],
    /// Q.
    pub noise: [[f64; 3]; 3],
}

impl Block {
    /// One coordinate that stays where it is and gathers `variance`.
    pub fn walk(index: usize, variance: f64) -> Self {
        let mut block =
            Block { index: [index; 3], len: 1, factor: [[0.0; 3]; 3], offset: [0.0; 3], noise: [[0.0; 3]; 3] };
        block.factor[0][0] = 1.0;
        block.noise[0][0] = variance;
        block
    }

    fn stays(&self) -> bool {
        self.len == 1 && self.factor[0][0] == 1.0
    }
}

/// Motion of the whole state; every coordinate is in exactly one block.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Transition {
    /// The blocks.
    pub blocks: Vec<Block>,
}

impl Transition {
    /// Moves a mean.
    pub fn apply_to_mean(&self, mean: &mut [f64]) {
        for b in &self.blocks {
            let old = b.index.map(|i| mean[i]);
            for r in 0..b.len {
                let moved: f64 = (0..b.len).map(|c| b.factor[r][c] * old[c]).sum();
                mean[b.index[r]] = moved + b.offset[r];
            }
        }
    }

    /// P <- F P F' + Q, exactly symmetric.
    pub fn apply_to_covariance(&self, p: &mut Square, row: &mut [Vec<f64>; 3]) {
        self.multiply_left(p, row);
        self.multiply_right_transposed(p);
        for b in &self.blocks {
            for r in 0..b.len {
                for c in 0..b.len {
                    *p.at_mut(b.index[r], b.index[c]) += b.noise[r][c];
                }
            }
        }
        p.mirror_upper();
    }

    /// A <- F A.
    fn multiply_left(&self, a: &mut Square, old: &mut [Vec<f64>; 3]) {
        for b in self.blocks.iter().filter(|b| !b.stays()) {
            for (old, &i) in old.iter_mut().zip(&b.index[..b.len]) {
                old.copy_from_slice(a.row(i));
            }
            for r in 0..b.len {
                let row = a.row_mut(b.index[r]);
                row.fill(0.0);
                accumulate(row, (0..b.len).map(|c| (b.factor[r][c], old[c].as_slice())));
            }
        }
    }

    /// A <- A F'.
    pub fn multiply_right_transposed(&self, a: &mut Square) {
        for i in 0..a.n() {
            self.apply_without_offset(a.row_mut(i));
        }
    }

    /// x <- F' x.
    pub fn apply_transposed(&self, x: &mut [f64]) {
        for b in self.blocks.iter().filter(|b| !b.stays()) {
            let old = b.index.map(|i| x[i]);
            for c in 0..b.len {
                x[b.index[c]] = (0..b.len).map(|r| b.factor[r][c] * old[r]).sum();
            }
        }
    }

    /// v' Q v.
    pub fn noise_along(&self, v: &[f64]) -> f64 {
        let block = |b: &Block| -> f64 {
            let pair = |r: usize, c: usize| v[b.index[r]] * b.noise[r][c] * v[b.index[c]];
            (0..b.len).map(|r| (0..b.len).map(|c| pair(r, c)).sum::<f64>()).sum()
        };
        self.blocks.iter().map(block).sum()
    }

    fn apply_without_offset(&self, x: &mut [f64]) {
        for b in self.blocks.iter().filter(|b| !b.stays()) {
            let old = b.index.map(|i| x[i]);
            for r in 0..b.len {
                x[b.index[r]] = (0..b.len).map(|c| b.factor[r][c] * old[c]).sum();
            }
        }
    }
}
