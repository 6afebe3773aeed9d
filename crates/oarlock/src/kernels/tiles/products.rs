//! Products of panels: A'B, and the upper triangle of G'G.

use super::{together, Panel, VECTOR};
use crate::kernels::arch::{with_simd, Arch, Kernel};
use crate::kernels::registers::{F64x4, Simd, Tile};
use std::ops::Range;

/// Rows of a panel from a column on, for products.
#[derive(Debug, Clone)]
pub struct Rows<'a> {
    /// The panel.
    pub panel: &'a Panel,
    /// Which rows.
    pub rows: Range<usize>,
    /// First column.
    pub column: usize,
    /// Per vector of columns: rows before this one are zero.
    pub starts: &'a [usize],
}

impl Rows<'_> {
    #[inline(always)]
    fn start(&self, column: usize) -> usize {
        self.starts[column / VECTOR].min(self.rows.end).max(self.rows.start)
    }
}

/// `out += G'G`, upper triangle, for the first `n` columns of G as rows and `width` columns; from zero if `fresh`.
pub fn gram(arch: Arch, out: &mut Panel, [n, width]: [usize; 2], g: Rows, fresh: bool) {
    let (left, right) = (g.clone(), g);
    if fresh {
        arch.run(Multiplying::<true> { out, n, width, left, right, upper: true });
    } else {
        arch.run(Multiplying::<false> { out, n, width, left, right, upper: true });
    }
}

/// `out = A'B` for the first `n` columns of A and the first `width` columns of B, which are the same rows.
pub fn product(arch: Arch, out: &mut Panel, [n, width]: [usize; 2], [left, right]: [Rows; 2]) {
    arch.run(Multiplying::<true> { out, n, width, left, right, upper: false });
}

struct Multiplying<'a, const FRESH: bool> {
    out: &'a mut Panel,
    n: usize,
    width: usize,
    left: Rows<'a>,
    right: Rows<'a>,
    /// Whether the product is symmetric, and only its upper triangle wanted.
    upper: bool,
}

impl<const FRESH: bool> Kernel for Multiplying<'_, FRESH> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| self.multiply(simd))
    }
}

impl<const FRESH: bool> Multiplying<'_, FRESH> {
    #[inline(always)]
    fn multiply<F: F64x4>(mut self, simd: Simd<F>) {
        let whole = self.n / VECTOR * VECTOR;
        for first in (0..whole).step_by(VECTOR) {
            self.rows::<F, 4>(simd, first);
        }
        match self.n - whole {
            3 => self.rows::<F, 3>(simd, whole),
            2 => self.rows::<F, 2>(simd, whole),
            1 => self.rows::<F, 1>(simd, whole),
            _ => {}
        }
    }

    #[inline(always)]
    fn rows<F: F64x4, const R: usize>(&mut self, simd: Simd<F>, first: usize) {
        let (left, right, own) = (&self.left, &self.right, self.left.start(first));
        let width = self.width;
        over_columns!(
            if self.upper { first } else { 0 }..width,
            |j: usize| together(&right.starts[j / VECTOR..width / VECTOR], own..left.rows.end),
            |j, V, start| {
                let tile: Tile<F, R, V> = if FRESH { simd.zero() } else { simd.load(self.out.part(first, j)) };
                let (a, b) = (left.panel.part(start, left.column + first), right.panel.part(start, right.column + j));
                let tile = simd.multiply::<false, R, V>(tile, a, b, left.rows.end - start);
                self.out.put(simd, tile, first, j);
            }
        );
    }
}
