//! Products and triangular factors in tiles of four rows, for whole panels of columns at once.
//!
//! A panel is a row-major matrix whose rows are padded to vectors of four. `factor` turns [A | B] into [U | U'^-1 B] with A = U'U:
//! Cholesky's factor and a forward substitution are one sweep. Tiles that are known to be zero are left out.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::dense::{NotPositive, Square};
use crate::lane::arch::{madd, Arch, Kernel};
use std::ops::Range;

/// Numbers in a vector.
pub const VECTOR: usize = 4;

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

type Tile<const R: usize, const V: usize> = [[[f64; VECTOR]; V]; R];

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

    /// Entry (i, j).
    #[inline(always)]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.data[i * self.stride + j]
    }

    /// Becomes a copy of the first `rows` rows of `other`, which has the same width.
    pub fn copy_rows(&mut self, other: &Panel, rows: usize) {
        let end = rows * self.stride;
        self.data[..end].copy_from_slice(&other.data[..end]);
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

/// Some columns of a panel in vectors, from a row on.
#[derive(Clone, Copy)]
struct Columns<'a> {
    data: &'a [[f64; VECTOR]],
    stride: usize,
}

impl<'a> Columns<'a> {
    /// `column` is a multiple of a vector's length.
    #[inline(always)]
    fn of(data: &'a [f64], stride: usize, row: usize, column: usize) -> Self {
        // Of no rows at all, nothing.
        let data = data.get(row * stride + column..).unwrap_or(&[]);
        Columns { data: data.as_chunks().0, stride: stride / VECTOR }
    }
}

/// `tile += (or -=) left' right` over `count` rows.
#[inline(always)]
fn multiply<const FUSED: bool, const TAKE: bool, const R: usize, const V: usize>(
    tile: &mut Tile<R, V>,
    left: Columns,
    right: Columns,
    count: usize,
) {
    let mut sum = *tile;
    let (mut at_left, mut at_right) = (0, 0);
    for _ in 0..count {
        let a = left.data[at_left];
        let b: &[[f64; VECTOR]; V] = right.data[at_right..].first_chunk().expect("columns lie within their row");
        (at_left, at_right) = (at_left + left.stride, at_right + right.stride);
        for r in 0..R {
            let factor = if TAKE { -a[r] } else { a[r] };
            for v in 0..V {
                for k in 0..VECTOR {
                    sum[r][v][k] = madd::<FUSED>(factor, b[v][k], sum[r][v][k]);
                }
            }
        }
    }
    *tile = sum;
}

#[inline(always)]
fn load<const R: usize, const V: usize>(data: &[f64], stride: usize, column: usize) -> Tile<R, V> {
    let mut tile = [[[0.0; VECTOR]; V]; R];
    for r in 0..R {
        let row = &data[r * stride + column..][..V * VECTOR];
        for v in 0..V {
            for k in 0..VECTOR {
                tile[r][v][k] = row[v * VECTOR + k];
            }
        }
    }
    tile
}

#[inline(always)]
fn store<const R: usize, const V: usize>(tile: &Tile<R, V>, data: &mut [f64], stride: usize, column: usize) {
    for r in 0..R {
        let row = &mut data[r * stride + column..][..V * VECTOR];
        for v in 0..V {
            for k in 0..VECTOR {
                row[v * VECTOR + k] = tile[r][v][k];
            }
        }
    }
}

/// Runs `$body` over tiles: `$columns` in steps of two vectors, and what is left. Four rows of two vectors are what a core keeps in
/// flight; of three, the compiler puts some sums out of the registers.
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

/// The factor of one diagonal block, and the reciprocals of its diagonal.
struct Corner<const R: usize> {
    u: [[f64; R]; R],
    inverse: [f64; R],
}

#[inline(always)]
fn corner<const R: usize>(tile: &Tile<R, 1>, first: usize) -> Result<Corner<R>, NotPositive> {
    let mut u = [[0.0; R]; R];
    let mut inverse = [0.0; R];
    for i in 0..R {
        for j in i..R {
            u[i][j] = tile[i][0][j];
        }
    }
    for i in 0..R {
        let pivot = u[i][i];
        // Written so that NaN fails too.
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err(NotPositive { row: first + i, pivot });
        }
        let root = pivot.sqrt();
        inverse[i] = 1.0 / root;
        u[i][i] = root;
        for j in i + 1..R {
            u[i][j] *= inverse[i];
        }
        for k in i + 1..R {
            for j in k..R {
                u[k][j] -= u[i][k] * u[i][j];
            }
        }
    }
    Ok(Corner { u, inverse })
}

/// Solves with the corner: its rows are subtracted and scaled.
#[inline(always)]
fn finish<const FUSED: bool, const R: usize, const V: usize>(tile: &mut Tile<R, V>, corner: &Corner<R>) {
    for r in 0..R {
        for above in 0..r {
            let factor = -corner.u[above][r];
            for v in 0..V {
                for k in 0..VECTOR {
                    tile[r][v][k] = madd::<FUSED>(factor, tile[above][v][k], tile[r][v][k]);
                }
            }
        }
        for v in 0..V {
            for k in 0..VECTOR {
                tile[r][v][k] *= corner.inverse[r];
            }
        }
    }
}

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

impl Sweep<'_> {
    #[inline(always)]
    fn start(&self, column: usize, vectors: usize) -> usize {
        let mut least = usize::MAX;
        for s in &self.starts[column / VECTOR..][..vectors] {
            least = least.min(*s);
        }
        least
    }
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
        let (a, sweep) = (self.a, self.sweep);
        let whole = sweep.n / VECTOR * VECTOR;
        for first in (0..whole).step_by(VECTOR) {
            factor_rows::<FUSED, 4>(a, first, sweep)?;
        }
        match sweep.n - whole {
            3 => factor_rows::<FUSED, 3>(a, whole, sweep),
            2 => factor_rows::<FUSED, 2>(a, whole, sweep),
            1 => factor_rows::<FUSED, 1>(a, whole, sweep),
            _ => Ok(()),
        }
    }
}

#[inline(always)]
fn factor_rows<const FUSED: bool, const R: usize>(
    a: &mut Panel,
    first: usize,
    sweep: Sweep,
) -> Result<(), NotPositive> {
    let stride = a.stride;
    let (above, rows) = a.data.split_at_mut(first * stride);
    // Rows above that hold nothing in these columns take nothing away.
    let own = sweep.start(first, 1).min(first);
    let corner = {
        let mut tile: Tile<R, 1> = load(rows, stride, first);
        take::<FUSED, R, 1>(&mut tile, above, stride, [first, first], own..first);
        let corner = corner(&tile, first)?;
        for (r, row) in corner.u.iter().enumerate() {
            rows[r * stride + first..][..R].copy_from_slice(row);
        }
        corner
    };
    over_columns!(first + VECTOR..sweep.width, |j, V| {
        let start = sweep.start(j, V);
        if start < first + R {
            let mut tile: Tile<R, V> = load(rows, stride, j);
            take::<FUSED, R, V>(&mut tile, above, stride, [first, j], start.max(own).min(first)..first);
            finish::<FUSED, R, V>(&mut tile, &corner);
            store(&tile, rows, stride, j);
        }
    });
    Ok(())
}

/// `tile -= above' above` for the rows in `range` and the columns that begin at `columns`.
#[inline(always)]
fn take<const FUSED: bool, const R: usize, const V: usize>(
    tile: &mut Tile<R, V>,
    above: &[f64],
    stride: usize,
    [left, right]: [usize; 2],
    range: Range<usize>,
) {
    if !range.is_empty() {
        let side = |column: usize| Columns::of(above, stride, range.start, column);
        multiply::<FUSED, true, R, V>(tile, side(left), side(right), range.len());
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
        let mut least = self.rows.end;
        for s in &self.starts[column / VECTOR..][..vectors] {
            least = least.min(*s);
        }
        least.max(self.rows.start)
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
    fn run<const FUSED: bool>(mut self) {
        let whole = self.n / VECTOR * VECTOR;
        for first in (0..whole).step_by(VECTOR) {
            self.rows::<FUSED, 4>(first);
        }
        match self.n - whole {
            3 => self.rows::<FUSED, 3>(whole),
            2 => self.rows::<FUSED, 2>(whole),
            1 => self.rows::<FUSED, 1>(whole),
            _ => {}
        }
    }
}

impl Multiplying<'_> {
    #[inline(always)]
    fn rows<const FUSED: bool, const R: usize>(&mut self, first: usize) {
        let (g, stride, own) = (&self.g, self.out.stride, self.g.start(first, 1));
        let rows = &mut self.out.data[first * stride..];
        over_columns!(first..self.width, |j, V| {
            let start = g.start(j, V).max(own);
            let mut tile: Tile<R, V> = if self.fresh { [[[0.0; VECTOR]; V]; R] } else { load(rows, stride, j) };
            let side = |column: usize| Columns::of(&g.panel.data, g.panel.stride, start, g.column + column);
            multiply::<FUSED, false, R, V>(&mut tile, side(first), side(j), g.rows.end - start);
            store(&tile, rows, stride, j);
        });
    }
}

/// For each vector of columns of some rows: the first row that holds something.
#[inline(always)]
pub fn find_starts(panel: &Panel, rows: usize, columns: Range<usize>, starts: &mut [usize]) {
    for (start, column) in starts.iter_mut().zip(columns.step_by(VECTOR)) {
        let empty = |r: &usize| panel.row(*r)[column..column + VECTOR].iter().all(|x| *x == 0.0);
        *start = (0..rows).take_while(empty).count();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// [1 + G'G | B], and its factor.
    fn both(arch: Arch, g: &Panel, n: usize, right: usize) -> (Panel, Panel) {
        let (rows, width) = (2 * n, padded(n) + padded(right));
        let mut starts = vec![0; width / VECTOR];
        find_starts(g, rows, 0..padded(n), &mut starts);
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
