//! Products and triangular factors in tiles of four rows, for whole panels of columns at once.
//!
//! A panel is a row-major matrix whose rows are padded to vectors of four. `factor` turns [A | B] into [U | U'^-1 B] with A = U'U:
//! Cholesky's factor and a forward substitution are one sweep. Tiles that are known to be zero are left out.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::dense::{NotPositive, Square};
use crate::kernels::arch::{with_simd, Arch, Kernel};
use crate::kernels::registers::{F64x4, Part, Simd, Tile};
use std::ops::Range;

pub use crate::kernels::registers::VECTOR;

/// The next multiple of a vector's length.
pub fn padded(n: usize) -> usize {
    n.div_ceil(VECTOR) * VECTOR
}

/// A row-major matrix.
#[derive(Debug, Clone)]
pub struct Panel {
    stride: usize,
    data: Vec<f64>,
}

impl Panel {
    /// All zero; `width` is a multiple of a vector's length.
    pub fn zeros(rows: usize, width: usize) -> Self {
        let stride = padded(width);
        Panel { stride, data: vec![0.0; rows * stride] }
    }

    /// Row `i`.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.data[i * self.stride..(i + 1) * self.stride]
    }

    /// Row `i`.
    #[inline(always)]
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.data[i * self.stride..(i + 1) * self.stride]
    }

    /// All rows in turn.
    #[inline(always)]
    pub fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.data.chunks_exact(self.stride.max(1))
    }

    /// All rows in turn.
    #[inline(always)]
    pub fn rows_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        self.data.chunks_exact_mut(self.stride.max(1))
    }

    /// Entry (i, j).
    #[inline(always)]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.data[i * self.stride + j]
    }

    /// Takes over the upper triangle with its diagonal raised by a share.
    pub fn copy_raised(&mut self, a: &Square, share: f64) {
        self.copy_upper(a);
        (0..a.n()).for_each(|i| self.row_mut(i)[i] *= 1.0 + share);
    }

    /// Gives its upper triangle away, as a symmetric matrix.
    pub fn copy_to(&self, out: &mut Square) {
        let n = out.n();
        (0..n).for_each(|i| out.row_mut(i)[i..].copy_from_slice(&self.row(i)[i..n]));
        out.mirror_upper();
    }

    /// Behind `factor`, with b in a column of what was [A | B]: solves A x = b.
    pub fn solve_back(&self, column: usize, x: &mut [f64]) {
        let n = x.len();
        for i in (0..n).rev() {
            let row = self.row(i);
            let known: f64 = row[i + 1..n].iter().zip(&x[i + 1..]).map(|(u, x)| u * x).sum();
            x[i] = (row[column] - known) / row[i];
        }
    }

    /// Becomes a copy of the first `rows` rows of `other`, which has the same width.
    pub fn copy_rows(&mut self, other: &Panel, rows: usize) {
        let end = rows * self.stride;
        self.data[..end].copy_from_slice(&other.data[..end]);
    }

    /// From (i, j) on.
    #[inline(always)]
    pub(super) fn part(&self, i: usize, j: usize) -> Part<'_> {
        Part { data: &self.data, from: i * self.stride + j, stride: self.stride }
    }

    /// Puts a tile at (i, j).
    #[inline(always)]
    pub(super) fn put<F: F64x4, const R: usize, const V: usize>(
        &mut self,
        simd: Simd<F>,
        tile: Tile<F, R, V>,
        i: usize,
        j: usize,
    ) {
        simd.store(tile, &mut self.data, i * self.stride + j, self.stride);
    }

    /// Puts four rows, each times its scale and from column `at` on, as four columns into the rows from `i` on.
    #[inline(always)]
    pub fn put_turned<F: F64x4>(
        &mut self,
        simd: Simd<F>,
        [i, j]: [usize; 2],
        rows: [&[f64]; 4],
        at: usize,
        scale: [f64; 4],
    ) {
        simd.turn(rows, scale, at, &mut self.data, i * self.stride + j, self.stride);
    }

    /// Takes over the upper triangle.
    #[inline(always)]
    pub fn copy_upper(&mut self, a: &Square) {
        for i in 0..a.n() {
            // From the beginning of the vector that holds the diagonal.
            let first = i / VECTOR * VECTOR;
            self.row_mut(i)[first..a.n()].copy_from_slice(&a.row(i)[first..]);
        }
    }
}

/// Runs `$body` over tiles of two vectors of columns, and what is left. Four rows of two are what a core keeps in flight; of three,
/// the compiler moves the sums from register to register.
macro_rules! over_columns {
    ($columns:expr, |$j:ident, $v:ident| $body:block) => {{
        let (mut $j, end) = ($columns.start, $columns.end);
        while $j + 2 * VECTOR <= end {
            const $v: usize = 2;
            $body
            $j += 2 * VECTOR;
        }
        if $j + VECTOR <= end {
            const $v: usize = 1;
            $body
        }
    }};
}

/// The factor U of one diagonal block, what it is with ones on its diagonal, and the reciprocals of that. Of fewer than four
/// rows, the rest stand for themselves.
struct Corner {
    u: [[f64; VECTOR]; VECTOR],
    unit: [[f64; VECTOR]; VECTOR],
    inverse: [f64; VECTOR],
}

/// Roots stay out of the chain of pivots, which wait for each other.
#[inline(always)]
fn corner(mut u: [[f64; VECTOR]; VECTOR], first: usize) -> Result<Corner, NotPositive> {
    let (mut unit, mut inverse) = ([[0.0; VECTOR]; VECTOR], [0.0; VECTOR]);
    for i in 0..VECTOR {
        let pivot = u[i][i];
        // Written so that NaN fails too.
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err(NotPositive { row: first + i, pivot });
        }
        let reciprocal = 1.0 / pivot;
        for k in i + 1..VECTOR {
            unit[i][k] = u[i][k] * reciprocal;
            for j in k..VECTOR {
                u[k][j] -= unit[i][k] * u[i][j];
            }
        }
    }
    for i in 0..VECTOR {
        inverse[i] = 1.0 / u[i][i].sqrt();
        for j in i..VECTOR {
            u[i][j] *= inverse[i];
        }
    }
    Ok(Corner { u, unit, inverse })
}

/// Shares by which a covariance's diagonal is raised until it can be factored: rounding can leave a constant's pivot a hair below
/// zero, and a relative 1e-12 is far below any sensor's say.
pub const RAISES: [f64; 2] = [0.0, 1e-12];

/// In a panel, what `factor` works on.
#[derive(Debug, Clone, Copy)]
pub struct Sweep<'a> {
    /// Rows, and columns of the symmetric part, whose upper triangle is read.
    pub n: usize,
    /// Columns of everything.
    pub width: usize,
    /// Of each vector of columns: rows before this one hold nothing.
    pub starts: &'a [usize],
}

/// The least of a few.
#[inline(always)]
fn least(starts: &[usize], column: usize, vectors: usize) -> usize {
    starts[column / VECTOR..][..vectors].iter().copied().fold(usize::MAX, usize::min)
}

/// [A | B] becomes [U | U'^-1 B].
pub fn factor(arch: Arch, a: &mut Panel, sweep: Sweep) -> Result<(), NotPositive> {
    arch.run(Factoring { a, sweep })
}

struct Factoring<'a> {
    a: &'a mut Panel,
    sweep: Sweep<'a>,
}

impl Kernel for Factoring<'_> {
    type Output = Result<(), NotPositive>;

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> Self::Output {
        with_simd!(FUSED, |simd| self.factor(simd))
    }
}

impl Factoring<'_> {
    #[inline(always)]
    fn factor<F: F64x4>(self, simd: Simd<F>) -> Result<(), NotPositive> {
        let (a, sweep) = (self.a, self.sweep);
        let mut corner = open(simd, a, 0, sweep)?;
        for first in (0..sweep.n).step_by(VECTOR) {
            let next = match sweep.n - first {
                1 => factor_rows::<F, 1>(simd, a, first, sweep, &corner)?,
                2 => factor_rows::<F, 2>(simd, a, first, sweep, &corner)?,
                3 => factor_rows::<F, 3>(simd, a, first, sweep, &corner)?,
                _ => factor_rows::<F, 4>(simd, a, first, sweep, &corner)?,
            };
            match next {
                Some(next) => corner = next,
                None => break,
            }
        }
        Ok(())
    }
}

/// The corner of the rows from `first` on, of which all rows above are done.
#[inline(always)]
fn open<F: F64x4>(simd: Simd<F>, a: &mut Panel, first: usize, sweep: Sweep) -> Result<Corner, NotPositive> {
    match sweep.n - first {
        1 => open_rows::<F, 1>(simd, a, first, sweep),
        2 => open_rows::<F, 2>(simd, a, first, sweep),
        3 => open_rows::<F, 3>(simd, a, first, sweep),
        _ => open_rows::<F, 4>(simd, a, first, sweep),
    }
}

#[inline(always)]
fn open_rows<F: F64x4, const R: usize>(
    simd: Simd<F>,
    a: &mut Panel,
    first: usize,
    sweep: Sweep,
) -> Result<Corner, NotPositive> {
    // Rows above that hold nothing in these columns take nothing away.
    let own = least(sweep.starts, first, 1).min(first);
    let tile: Tile<F, R, 1> = simd.load(a.part(first, first));
    let tile = simd.multiply::<true, R, 1>(tile, a.part(own, first), a.part(own, first), first - own);
    a.put(simd, tile, first, first);
    let upper = |i: usize, j: usize| match (i < R, j < R) {
        (true, true) if i <= j => a.at(first + i, first + j),
        _ => f64::from(i == j),
    };
    corner(std::array::from_fn(|i| std::array::from_fn(|j| upper(i, j))), first)
}

/// Rows that begin with this, and of which nothing is taken away, stay as they are.
const UNIT: [[f64; VECTOR]; VECTOR] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// The corner of the next rows is opened as soon as it can be: what waits for it there, waits beside the rest of these.
#[inline(always)]
fn factor_rows<F: F64x4, const R: usize>(
    simd: Simd<F>,
    a: &mut Panel,
    first: usize,
    sweep: Sweep,
    corner: &Corner,
) -> Result<Option<Corner>, NotPositive> {
    let own = least(sweep.starts, first, 1).min(first);
    if own == first && corner.u == UNIT {
        let more = R == VECTOR && first + VECTOR < sweep.n;
        return if more { open(simd, a, first + VECTOR, sweep).map(Some) } else { Ok(None) };
    }
    let row = Row { first, own, sweep, corner };
    if R < VECTOR {
        // Columns to the right may share the last vector.
        let tile: Tile<F, R, 1> = simd.load(a.part(first, first));
        a.put(simd, simd.substitute(tile, &corner.unit, &corner.inverse), first, first);
    }
    for (r, u) in corner.u.iter().enumerate().take(R) {
        a.row_mut(first + r)[first..][..R].copy_from_slice(&u[..R]);
    }
    let (near, mut next) = ((first + 3 * VECTOR).min(sweep.width), None);
    over_columns!(first + VECTOR..near, |j, V| { row.substitute::<F, R, V>(simd, a, j) });
    if R == VECTOR && first + VECTOR < sweep.n {
        next = Some(open(simd, a, first + VECTOR, sweep)?);
    }
    over_columns!(near..sweep.width, |j, V| { row.substitute::<F, R, V>(simd, a, j) });
    Ok(next)
}

/// Rows from `first` on, whose own columns hold nothing above row `own`.
struct Row<'a> {
    first: usize,
    own: usize,
    sweep: Sweep<'a>,
    corner: &'a Corner,
}

impl Row<'_> {
    #[inline(always)]
    fn substitute<F: F64x4, const R: usize, const V: usize>(&self, simd: Simd<F>, a: &mut Panel, j: usize) {
        let (first, start) = (self.first, least(self.sweep.starts, j, V));
        if start < first + R {
            let start = start.max(self.own).min(first);
            let tile: Tile<F, R, V> = simd.load(a.part(first, j));
            let tile = simd.multiply::<true, R, V>(tile, a.part(start, first), a.part(start, j), first - start);
            a.put(simd, simd.substitute(tile, &self.corner.unit, &self.corner.inverse), first, j);
        }
    }
}

/// What `gram` multiplies: rows of a panel, from a column on.
#[derive(Debug, Clone)]
pub struct Rows<'a> {
    /// Where they stand.
    pub panel: &'a Panel,
    /// Which.
    pub rows: Range<usize>,
    /// First column.
    pub column: usize,
    /// Of each vector of columns: rows before this one hold nothing.
    pub starts: &'a [usize],
}

impl Rows<'_> {
    #[inline(always)]
    fn start(&self, column: usize, vectors: usize) -> usize {
        least(self.starts, column, vectors).min(self.rows.end).max(self.rows.start)
    }
}

/// `out += G'G`, upper triangle, for the first `n` columns of G as rows and `width` columns; from zero if `fresh`.
pub fn gram(arch: Arch, out: &mut Panel, [n, width]: [usize; 2], g: Rows, fresh: bool) {
    arch.run(Multiplying { out, n, width, g, fresh });
}

struct Multiplying<'a> {
    out: &'a mut Panel,
    n: usize,
    width: usize,
    g: Rows<'a>,
    fresh: bool,
}

impl Kernel for Multiplying<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| self.multiply(simd))
    }
}

impl Multiplying<'_> {
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
        let (g, own) = (&self.g, self.g.start(first, 1));
        over_columns!(first..self.width, |j, V| {
            let start = g.start(j, V).max(own);
            let tile: Tile<F, R, V> = if self.fresh { simd.zero() } else { simd.load(self.out.part(first, j)) };
            let from = |column: usize| g.panel.part(start, g.column + column);
            let tile = simd.multiply::<false, R, V>(tile, from(first), from(j), g.rows.end - start);
            self.out.put(simd, tile, first, j);
        });
    }
}

/// For each vector of columns of some rows: the first row that holds something.
pub fn find_starts(arch: Arch, panel: &Panel, rows: usize, columns: Range<usize>, starts: &mut [usize]) {
    arch.run(Finding { panel, rows, columns, starts });
}

struct Finding<'a> {
    panel: &'a Panel,
    rows: usize,
    columns: Range<usize>,
    starts: &'a mut [usize],
}

impl Kernel for Finding<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| {
            for (start, column) in self.starts.iter_mut().zip(self.columns.step_by(VECTOR)) {
                *start = simd.empty_rows(self.panel.part(0, column), self.rows);
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// [1 + G'G | B], and its factor.
    fn both(arch: Arch, g: &Panel, n: usize, right: usize) -> (Panel, Panel) {
        let (rows, width) = (2 * n, padded(n) + padded(right));
        let mut starts = vec![0; width / VECTOR];
        find_starts(arch, g, rows, 0..padded(n), &mut starts);
        let mut a = Panel::zeros(n, width);
        (0..n).for_each(|i| a.row_mut(i)[i] = 1.0);
        let rows = Rows { panel: g, rows: 0..rows, column: 0, starts: &starts };
        gram(arch, &mut a, [n, padded(n)], rows, false);
        for i in 0..n {
            (0..right).for_each(|j| a.row_mut(i)[padded(n) + j] = ((i * 7 + j * 3) % 11) as f64 - 5.0);
        }
        let mut u = a.clone();
        starts.fill(0);
        factor(arch, &mut u, Sweep { n, width, starts: &starts }).expect("positive");
        (a, u)
    }

    fn sample(rows: usize, n: usize) -> Panel {
        let mut g = Panel::zeros(rows, padded(n));
        for r in 0..rows {
            for c in (0..n).filter(|c| r >= c / 3) {
                g.row_mut(r)[c] = ((r * 31 + c * 17) % 23) as f64 / 23.0 - 0.5;
            }
        }
        g
    }

    /// A handful of roundings of sums of some forty products.
    const ROUNDING: f64 = 1e-12;

    #[test]
    fn factor_and_substitution_undo_each_other_at_every_size() {
        for (n, right) in (1..30).map(|n| (n, 1 + n * 2 / 3)) {
            let (g, base) = (sample(2 * n, n), padded(n));
            for arch in [Arch::PORTABLE, Arch::best()] {
                let (a, u) = both(arch, &g, n, right);
                for i in 0..n {
                    for j in i..n {
                        let direct: f64 = (0..2 * n).map(|r| g.at(r, i) * g.at(r, j)).sum();
                        assert!((a.at(i, j) - direct - f64::from(i == j)).abs() < ROUNDING, "{n}: {i} {j}");
                    }
                    for j in (i..n).chain(base..base + right) {
                        let product: f64 = (0..=i).map(|k| u.at(k, i) * u.at(k, j)).sum();
                        assert!((product - a.at(i, j)).abs() < ROUNDING, "{n}: {i} {j}");
                    }
                }
            }
        }
    }

    #[test]
    fn what_is_not_positive_is_refused_by_row() {
        let mut a = Panel::zeros(6, 8);
        (0..6).for_each(|i| a.row_mut(i)[i] = if i == 5 { f64::NAN } else { 2.0 });
        let sweep = Sweep { n: 6, width: 8, starts: &[0, 0] };
        assert_eq!(factor(Arch::PORTABLE, &mut a, sweep).unwrap_err().row, 5);
    }
}
