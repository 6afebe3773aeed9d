//! A Jacobian without its zeros, times the factor of a covariance: H = J L for states in which readings are linear, and for the extended
//! filter. Built by `sensor::slopes`.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::tiles::{padded, Panel, VECTOR};
use crate::kernels::arch::with_simd;
use crate::kernels::registers::{F64x4, Part, Simd, Tile};
use std::ops::Range;

/// Derivative of up to three rows by one state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slope {
    /// The state.
    pub state: usize,
    /// Per row; the last number is padding.
    pub rows: [f64; VECTOR],
}

/// Up to three neighbouring rows that depend on the same states.
#[derive(Debug, Clone, PartialEq)]
pub struct RowTriple {
    /// First row.
    pub row: usize,
    /// Number of rows.
    pub count: usize,
    /// Their slopes.
    pub slopes: Range<usize>,
    /// First of three states that add to the rows one by one, such as a bias.
    pub added: Option<usize>,
}

/// The nonzero derivatives of the readings.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SparseJacobian {
    /// Dimension of the state.
    pub n: usize,
    /// Rows with derivatives.
    pub triples: Vec<RowTriple>,
    /// In each triple from the last state to the first.
    pub slopes: Vec<Slope>,
}

/// Columns of one tile.
const BLOCK: usize = 2 * VECTOR;

impl SparseJacobian {
    /// Adds rows that depend on `states`, the last state first; their derivatives are filled in later.
    pub fn push(&mut self, row: usize, count: usize, states: &[usize], added: Option<usize>) {
        let first = self.slopes.len();
        self.slopes.extend(states.iter().map(|&state| Slope { state, rows: [0.0; VECTOR] }));
        self.triples.push(RowTriple { row, count, slopes: first..self.slopes.len(), added });
    }

    /// Slopes of a triple.
    #[inline(always)]
    pub fn rows_of(&mut self, triple: usize) -> &mut [Slope] {
        &mut self.slopes[self.triples[triple].slopes.clone()]
    }

    /// Adds a triple to a dense Jacobian.
    pub fn scatter(&self, triple: usize, width: usize, jacobian: &mut [f64]) {
        let triple = &self.triples[triple];
        for i in 0..triple.count {
            let row = &mut jacobian[(triple.row + i) * width..(triple.row + i + 1) * width];
            self.slopes[triple.slopes.clone()].iter().for_each(|s| row[s.state] += s.rows[i]);
            if let Some(first) = triple.added {
                row[first + i] += 1.0;
            }
        }
    }

    /// Columns of noisy inputs, which stand behind those of the states.
    pub fn inputs(&self, asked: &[bool], count: usize, even: &mut Panel) {
        for triple in &self.triples {
            for i in (0..triple.count).filter(|i| asked[triple.row + i]) {
                let row = &mut even.row_mut(triple.row + i)[..count];
                row.fill(0.0);
                let slopes = self.slopes[triple.slopes.clone()].iter();
                slopes.take_while(|s| s.state >= self.n).for_each(|s| row[s.state - self.n] += s.rows[i]);
            }
        }
    }

    /// H = J L for its first `count` columns in reverse order; row k of `turned` is row k of L, reversed. Fewer columns than a vector
    /// overwrite the rest of it.
    #[inline(always)]
    pub fn times<const FUSED: bool>(&self, turned: &Panel, count: usize, asked: &[bool], odd: &mut Panel) {
        let width = if count < VECTOR { padded(count) } else { count };
        with_simd!(FUSED, |simd| self.multiply(simd, turned.part(0, 0), width, asked, odd));
    }

    #[inline(always)]
    fn multiply<F: F64x4>(&self, simd: Simd<F>, a: Part, width: usize, asked: &[bool], out: &mut Panel) {
        for triple in self.triples.iter().filter(|triple| asked[triple.rows()].contains(&true)) {
            let slopes = &self.slopes[triple.slopes.clone()];
            let mut at = 0;
            while at < width {
                if at + BLOCK <= width {
                    triple.columns::<F, 2>(simd, slopes, (a, self.n), at, out);
                    at += BLOCK;
                } else {
                    // An incomplete vector at the end overlaps the one before.
                    triple.columns::<F, 1>(simd, slopes, (a, self.n), at.min(width - VECTOR), out);
                    at += VECTOR;
                }
            }
        }
    }
}

impl RowTriple {
    /// Which rows.
    pub fn rows(&self) -> Range<usize> {
        self.row..self.row + self.count
    }

    #[inline(always)]
    fn columns<F: F64x4, const V: usize>(
        &self,
        simd: Simd<F>,
        slopes: &[Slope],
        (a, n): (Part, usize),
        at: usize,
        out: &mut Panel,
    ) {
        let part = |state: usize| Part { from: a.from + state * a.stride + at, ..a };
        let mut sums: Tile<F, 3, V> = match self.added {
            Some(first) => simd.load(part(first)),
            None => simd.zero(),
        };
        // L is triangular: column c is zero in the rows before n - 1 - c.
        let first = n.saturating_sub(at + V * VECTOR);
        for slope in slopes.iter().skip_while(|s| s.state >= n) {
            if slope.state < first {
                break;
            }
            let rows = Part { data: &slope.rows, from: 0, stride: 0 };
            sums = simd.multiply::<false, 3, V>(sums, rows, part(slope.state), 1);
        }
        match (self.count, sums) {
            (1, [a, ..]) => out.put::<F, 1, V>(simd, [a], self.row, at),
            (2, [a, b, _]) => out.put::<F, 2, V>(simd, [a, b], self.row, at),
            (_, all) => out.put::<F, 3, V>(simd, all, self.row, at),
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::arch::{Arch, Kernel};

    /// Of sums of ten numbers of about one.
    const ROUNDING: f64 = 1e-14;
    const STATES: usize = 11;

    fn number(i: usize, j: usize) -> f64 {
        (1.7 * i as f64 + 0.9 * j as f64 * j as f64).sin()
    }

    struct Times<'a>(&'a SparseJacobian, &'a Panel, usize, &'a mut Panel);

    impl Kernel for Times<'_> {
        type Output = ();

        #[inline(always)]
        fn run<const FUSED: bool>(self) {
            self.0.times::<FUSED>(self.1, self.2, &[true; 4], self.3);
        }
    }

    /// Three rows that answer to some states, an addition and an input, and one row that answers to one state twice.
    fn some() -> SparseJacobian {
        let mut straight = SparseJacobian { n: STATES, ..SparseJacobian::default() };
        straight.push(0, 3, &[STATES, 9, 6, 2, 0], Some(4));
        straight.push(3, 1, &[5, 5], None);
        for (k, slope) in straight.slopes.iter_mut().enumerate() {
            slope.rows = [number(k, 1), number(k, 2), number(k, 3), 0.0];
        }
        straight
    }

    #[test]
    fn columns_are_the_products_of_plain_matrices() {
        let straight = some();
        let (mut factor, mut turned) = (Panel::zeros(STATES, padded(STATES)), Panel::zeros(STATES, padded(STATES)));
        (0..STATES).for_each(|i| (i..STATES).for_each(|j| factor.row_mut(i)[j] = number(i, j)));
        turn(&factor, STATES, &mut turned);
        let width = STATES + 1;
        let mut jacobian = vec![0.0; 4 * width];
        (0..2).for_each(|triple| straight.scatter(triple, width, &mut jacobian));
        for arch in [Arch::PORTABLE, Arch::best()] {
            let mut odd = Panel::zeros(4, padded(STATES));
            arch.run(Times(&straight, &turned, STATES, &mut odd));
            for r in 0..4 {
                for i in 0..STATES {
                    let plain: f64 = (i..STATES).map(|k| jacobian[r * width + k] * factor.at(i, k)).sum();
                    assert!((odd.at(r, STATES - 1 - i) - plain).abs() < ROUNDING, "{r} {i}");
                }
            }
        }
    }

    #[test]
    fn inputs_stand_behind_the_states() {
        let (straight, mut even) = (some(), Panel::zeros(4, VECTOR));
        straight.inputs(&[true; 4], 1, &mut even);
        assert_eq!([0, 1, 2, 3].map(|r| even.at(r, 0)), [number(0, 1), number(0, 2), number(0, 3), 0.0]);
    }
}
