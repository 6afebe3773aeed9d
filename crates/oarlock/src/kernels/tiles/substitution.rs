//! Substitutions with a factor that is known: U'^-1 B, and U^-1 B.

use super::{padded, widest, Group, Panel, VECTOR};
use crate::kernels::arch::{with_simd, Arch, Kernel};
use crate::kernels::registers::{F64x4, Simd, Tile};

/// U'^-1 B for the first `width` columns of B, with the factor U of `n` rows.
pub fn substitute(arch: Arch, u: &Panel, n: usize, b: &mut Panel, width: usize) {
    arch.run(Substituting { u, n, b, width });
}

struct Substituting<'a> {
    u: &'a Panel,
    n: usize,
    b: &'a mut Panel,
    width: usize,
}

impl Kernel for Substituting<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| self.substitute(simd))
    }
}

impl Substituting<'_> {
    #[inline(always)]
    fn substitute<F: F64x4>(mut self, simd: Simd<F>) {
        for first in (0..self.n).step_by(VECTOR) {
            match self.n - first {
                1 => self.rows::<F, 1>(simd, first),
                2 => self.rows::<F, 2>(simd, first),
                3 => self.rows::<F, 3>(simd, first),
                _ => self.rows::<F, 4>(simd, first),
            }
        }
    }

    #[inline(always)]
    fn rows<F: F64x4, const R: usize>(&mut self, simd: Simd<F>, first: usize) {
        let Substituting { u, b, width, .. } = self;
        let (mut unit, mut inverse) = ([[0.0; VECTOR]; VECTOR], [0.0; VECTOR]);
        for i in 0..R {
            let row = &u.row(first + i)[first..];
            inverse[i] = 1.0 / row[i];
            (i + 1..R).for_each(|k| unit[i][k] = row[k] * inverse[i]);
        }
        let width = *width;
        over_columns!(0..width, |j| widest_of(width - j), |j, V, _start| {
            let tile: Tile<F, R, V> = simd.load(b.part(first, j));
            let tile = simd.multiply::<true, R, V>(tile, u.part(0, first), b.part(0, j), first);
            b.put(simd, simd.substitute(tile, &unit, &inverse), first, j);
        });
    }
}

/// The next tile of so many columns without zeros.
#[inline(always)]
fn widest_of(columns: usize) -> Group {
    Group { count: widest(columns / VECTOR), start: 0 }
}

/// U', from the factor U of `factor`, for `substitute_back`.
#[derive(Debug, Clone)]
pub struct Lower {
    n: usize,
    panel: Panel,
}

impl Lower {
    /// Of at most so many rows.
    pub fn zeros(rows: usize) -> Self {
        Lower { n: 0, panel: Panel::zeros(padded(rows), padded(rows)) }
    }

    /// Becomes the transpose of the first `n` rows and columns of `u`.
    pub fn transpose(&mut self, arch: Arch, u: &Panel, n: usize) {
        self.n = n;
        arch.run(Transposing { lower: self, u });
    }
}

struct Transposing<'a> {
    lower: &'a mut Lower,
    u: &'a Panel,
}

impl Kernel for Transposing<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Transposing { lower: Lower { n, panel }, u } = self;
        with_simd!(FUSED, |simd| {
            for first in (0..*n).step_by(VECTOR) {
                // Rows that are missing stand as zeros.
                let rows = std::array::from_fn(|r| u.row((first + r).min(*n - 1)));
                let scale = std::array::from_fn(|r| f64::from(u8::from(first + r < *n)));
                for at in (first..*n).step_by(VECTOR) {
                    panel.put_turned(simd, [at, first], rows, at, scale);
                }
            }
        });
    }
}

/// `out` = U^-1 B for `width` columns of B from `column` on.
pub fn substitute_back(arch: Arch, lower: &Lower, (b, column): (&Panel, usize), out: &mut Panel, width: usize) {
    arch.run(SubstitutingBack { lower, b, column, out, width });
}

struct SubstitutingBack<'a> {
    lower: &'a Lower,
    b: &'a Panel,
    column: usize,
    out: &'a mut Panel,
    width: usize,
}

impl Kernel for SubstitutingBack<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| self.substitute(simd));
    }
}

impl SubstitutingBack<'_> {
    #[inline(always)]
    fn substitute<F: F64x4>(mut self, simd: Simd<F>) {
        let n = self.lower.n;
        for first in (0..n).step_by(VECTOR).rev() {
            match n - first {
                1 => self.rows::<F, 1>(simd, first),
                2 => self.rows::<F, 2>(simd, first),
                3 => self.rows::<F, 3>(simd, first),
                _ => self.rows::<F, 4>(simd, first),
            }
        }
    }

    #[inline(always)]
    fn rows<F: F64x4, const R: usize>(&mut self, simd: Simd<F>, first: usize) {
        let SubstitutingBack { lower: Lower { n, panel: lower }, b, column, out, width } = self;
        let (below, count, width) = (first + R, *n - first - R, *width);
        // In the reverse order of the rows this is a substitution from above.
        let (mut unit, mut inverse) = ([[0.0; VECTOR]; VECTOR], [0.0; VECTOR]);
        for i in 0..R {
            let row = &lower.row(first + R - 1 - i)[first..];
            inverse[i] = 1.0 / row[R - 1 - i];
            (i + 1..R).for_each(|k| unit[i][k] = row[R - 1 - k] * inverse[i]);
        }
        over_columns!(0..width, |j| widest_of(width - j), |j, V, _start| {
            let tile: Tile<F, R, V> = simd.load(b.part(first, *column + j));
            let mut tile = simd.multiply::<true, R, V>(tile, lower.part(below, first), out.part(below, j), count);
            tile.reverse();
            let mut tile = simd.substitute(tile, &unit, &inverse);
            tile.reverse();
            out.put(simd, tile, first, j);
        });
    }
}
