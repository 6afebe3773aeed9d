//! Readings that are straight in some states: their derivatives there are columns enough.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::tiles::{padded, Panel, VECTOR};
use crate::lane::arch::madd;
use std::ops::Range;

/// How three rows answer to a state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// The state.
    pub state: usize,
    /// Of each row; the last number is none.
    pub rows: [f64; VECTOR],
}

/// Three neighbouring rows that answer to the same states.
#[derive(Debug, Clone, PartialEq)]
pub struct Trio {
    /// The first.
    pub row: usize,
    /// Which slopes are theirs.
    pub slopes: Range<usize>,
    /// The first of three states that add to them one by one.
    pub added: Option<usize>,
}

/// Derivatives of readings where they are not zero.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Straight {
    /// Of the state.
    pub n: usize,
    /// Rows that have any.
    pub trios: Vec<Trio>,
    /// From the last state to the first in every trio.
    pub slopes: Vec<Slope>,
}

/// Columns that are worked off together.
const BLOCK: usize = 2 * VECTOR;

impl Straight {
    /// Adds three rows; the slopes' own numbers come later.
    pub fn push(&mut self, row: usize, states: &[usize], added: Option<usize>) {
        let first = self.slopes.len();
        self.slopes.extend(states.iter().map(|&state| Slope { state, rows: [0.0; VECTOR] }));
        self.trios.push(Trio { row, slopes: first..self.slopes.len(), added });
    }

    /// H = J U' of the first `count` columns: row k of `turned` is column k of U, reversed. What lies behind them in the last vector
    /// is overwritten.
    #[inline(always)]
    pub fn times<const FUSED: bool>(&self, turned: &Panel, count: usize, asked: &[bool], odd: &mut Panel) {
        let width = padded(count);
        let n = self.n;
        for trio in &self.trios {
            if !asked[trio.row..trio.row + 3].contains(&true) {
                continue;
            }
            let slopes = &self.slopes[trio.slopes.clone()];
            for at in (0..width).step_by(BLOCK) {
                let both = at + BLOCK <= width;
                if both {
                    trio.columns::<FUSED, 2>(slopes, (turned, n), at, odd);
                } else {
                    trio.columns::<FUSED, 1>(slopes, (turned, n), at, odd);
                }
            }
        }
    }
}

impl Trio {
    #[inline(always)]
    fn columns<const FUSED: bool, const V: usize>(
        &self,
        slopes: &[Slope],
        (turned, n): (&Panel, usize),
        at: usize,
        odd: &mut Panel,
    ) {
        let mut sums = [[[0.0; VECTOR]; V]; 3];
        if let Some(first) = self.added {
            for i in 0..3 {
                sums[i] = vectors(turned.row(first + i), at);
            }
        }
        // Column c holds numbers in the rows from n - 1 - c on.
        let first = n.saturating_sub(at + V * VECTOR);
        for slope in slopes.iter().take_while(|s| s.state >= first) {
            let x: [[f64; VECTOR]; V] = vectors(turned.row(slope.state), at);
            for i in 0..3 {
                for v in 0..V {
                    for k in 0..VECTOR {
                        sums[i][v][k] = madd::<FUSED>(slope.rows[i], x[v][k], sums[i][v][k]);
                    }
                }
            }
        }
        for i in 0..3 {
            let row = &mut odd.row_mut(self.row + i)[at..at + V * VECTOR];
            row.copy_from_slice(sums[i].as_flattened());
        }
    }
}

#[inline(always)]
fn vectors<const V: usize>(row: &[f64], at: usize) -> [[f64; VECTOR]; V] {
    let (vectors, _) = row[at..at + V * VECTOR].as_chunks();
    std::array::from_fn(|v| vectors[v])
}

/// Writes column k of the upper triangular `factor`, reversed, into row k of `turned`.
#[inline(always)]
pub fn turn(factor: &Panel, n: usize, turned: &mut Panel) {
    for k in 0..n {
        for (i, x) in turned.row_mut(k)[n - 1 - k..n].iter_mut().rev().enumerate() {
            *x = factor.at(i, k);
        }
    }
}
