//! Cholesky factors, forward substitutions and Gram matrices, in tiles of four rows; for the update, the smoother and the start fit.
//!
//! A panel is a row-major matrix whose rows are padded to vectors of four. `factor` turns [A | B] into [U | U'^-1 B] with A = U'U:
//! Cholesky's factor and the forward substitution are one sweep. Tiles that are known to be zero are skipped.
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
    /// Workspace of `factor`: for each vector of columns, the tile that begins with it.
    groups: Vec<Group>,
}

/// Neighbouring vectors of columns that make one tile.
#[derive(Debug, Clone, Copy)]
struct Group {
    count: usize,
    /// Rows before this one are zero.
    start: usize,
}

impl Panel {
    /// All zero; `width` is a multiple of a vector's length.
    pub fn zeros(rows: usize, width: usize) -> Self {
        let stride = padded(width);
        let groups = vec![Group { count: 1, start: 0 }; stride / VECTOR];
        Panel { stride, data: vec![0.0; rows * stride], groups }
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

    /// Different rows.
    pub fn rows_of<const COUNT: usize>(&mut self, index: [usize; COUNT]) -> [&mut [f64]; COUNT] {
        let stride = self.stride;
        self.data.get_disjoint_mut(index.map(|i| i * stride..(i + 1) * stride)).expect("different rows")
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

    /// Sets all numbers to zero.
    pub fn clear(&mut self) {
        self.data.fill(0.0);
    }

    /// Entry (i, j).
    #[inline(always)]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.data[i * self.stride + j]
    }

    /// Copies the upper triangle, with the diagonal raised by a share.
    pub fn copy_raised(&mut self, a: &Square, share: f64) {
        self.copy_upper(a);
        (0..a.n()).for_each(|i| self.row_mut(i)[i] *= 1.0 + share);
    }

    /// Copies the upper triangle into a symmetric matrix.
    pub fn copy_to(&self, out: &mut Square) {
        let n = out.n();
        (0..n).for_each(|i| out.row_mut(i)[i..].copy_from_slice(&self.row(i)[i..n]));
        out.mirror_upper();
    }

    /// After `factor` of [A | b]: solves A x = b, with b in column `column`.
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

    /// Row and column `k` of an upper triangle become those of the unit matrix; the rest of the row becomes zero.
    pub fn make_unit(&mut self, k: usize) {
        (0..k).for_each(|i| self.row_mut(i)[k] = 0.0);
        self.row_mut(k)[k..].fill(0.0);
        self.row_mut(k)[k] = 1.0;
    }

    /// The part from (i, j) on.
    #[inline(always)]
    pub fn part(&self, i: usize, j: usize) -> Part<'_> {
        Part { data: &self.data, from: i * self.stride + j, stride: self.stride }
    }

    /// Writes a tile at (i, j).
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

    /// Writes four rows, each times its scale and from column `at` on, as four columns at (i, j).
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

    /// Copies the upper triangle.
    #[inline(always)]
    pub fn copy_upper(&mut self, a: &Square) {
        for i in 0..a.n() {
            // From the beginning of the vector that holds the diagonal.
            let first = i / VECTOR * VECTOR;
            self.row_mut(i)[first..a.n()].copy_from_slice(&a.row(i)[first..]);
        }
    }
}

/// Runs `$body` over tiles of up to three vectors of columns, which `$group` chooses from the column on.
macro_rules! over_columns {
    ($columns:expr, $group:expr, |$j:ident, $v:ident, $start:ident| $body:block) => {{
        let (mut $j, end) = ($columns.start, $columns.end);
        while $j < end {
            let $crate::kernels::tiles::Group { count, start: $start } = $group($j);
            match count {
                3 => {
                    const $v: usize = 3;
                    $body
                }
                2 => {
                    const $v: usize = 2;
                    $body
                }
                _ => {
                    const $v: usize = 1;
                    $body
                }
            }
            $j += count * VECTOR;
        }
    }};
}

/// Vectors of the next tile, of so many. Four make two tiles of two: one of one would wait for its own sums.
#[inline(always)]
fn widest(vectors: usize) -> usize {
    if vectors == 4 {
        2
    } else {
        vectors.min(3)
    }
}

/// Zeros that a tile may multiply, in rows of a vector, so that it may be wider.
const WASTE: usize = 4;

/// The tile of the next vectors of columns, of which rows in `range` count.
#[inline(always)]
fn together(starts: &[usize], range: Range<usize>) -> Group {
    let start = |v: usize| starts[v].max(range.start).min(range.end);
    let (most, first) = (widest(starts.len()), start(0));
    if most == 1 {
        return Group { count: 1, start: first };
    }
    let second = start(1);
    let two = first.min(second);
    if first.max(second) - two > WASTE {
        return Group { count: 1, start: first };
    }
    if most == 2 {
        return Group { count: 2, start: two };
    }
    let third = start(2);
    let three = two.min(third);
    if first + second + third - 3 * three > WASTE {
        return Group { count: 2, start: two };
    }
    Group { count: 3, start: three }
}

mod products;
mod substitution;
pub use products::{gram, product, Rows};
pub use substitution::{substitute, substitute_back, Lower};

/// Factor U of a diagonal block, U scaled to a unit diagonal, and the reciprocals of its diagonal. A block of fewer than four rows is padded
/// with the unit matrix.
struct Corner {
    u: [[f64; VECTOR]; VECTOR],
    unit: [[f64; VECTOR]; VECTOR],
    inverse: [f64; VECTOR],
}

/// Square roots are computed after the pivots, since each pivot waits for the one before.
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

/// Shares by which the diagonal of a covariance is raised until it can be factored: rounding can make the pivot of a constant negative, and a
/// relative 1e-12 is far below the noise of any sensor.
pub const RAISES: [f64; 2] = [0.0, 1e-12];

/// Size and pattern of a panel for `factor`.
#[derive(Debug, Clone, Copy)]
pub struct Sweep<'a> {
    /// Rows, and columns of the symmetric part, whose upper triangle is read.
    pub n: usize,
    /// Columns of everything.
    pub width: usize,
    /// Per vector of columns: rows before this one are zero.
    pub starts: &'a [usize],
}

/// The least start of some neighbouring vectors.
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
        let mut groups = std::mem::take(&mut self.a.groups);
        let starts = &self.sweep.starts[..self.sweep.width / VECTOR];
        groups
            .iter_mut()
            .enumerate()
            .take(starts.len())
            .for_each(|(v, g)| *g = together(&starts[v..], 0..self.sweep.n));
        let done = factor_all(simd, self.a, self.sweep, &groups);
        self.a.groups = groups;
        done
    }
}

#[inline(always)]
fn factor_all<F: F64x4>(simd: Simd<F>, a: &mut Panel, sweep: Sweep, groups: &[Group]) -> Result<(), NotPositive> {
    let mut corner = open(simd, a, 0, sweep)?;
    for first in (0..sweep.n).step_by(VECTOR) {
        let row = Row { first, corner: &corner, groups };
        let next = match sweep.n - first {
            1 => factor_rows::<F, 1>(simd, a, sweep, row)?,
            2 => factor_rows::<F, 2>(simd, a, sweep, row)?,
            3 => factor_rows::<F, 3>(simd, a, sweep, row)?,
            _ => factor_rows::<F, 4>(simd, a, sweep, row)?,
        };
        match next {
            Some(next) => corner = next,
            None => break,
        }
    }
    Ok(())
}

/// Factor of the diagonal block of the rows from `first` on, once all rows above are done.
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
    // Rows above that are zero in these columns are skipped.
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

/// Rows that begin with the unit matrix and have no rows above do not change.
const UNIT: [[f64; VECTOR]; VECTOR] =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// Rows from `first` on.
#[derive(Clone, Copy)]
struct Row<'a> {
    first: usize,
    corner: &'a Corner,
    groups: &'a [Group],
}

/// The next diagonal block is factored as soon as its columns are done, so that its pivots overlap with the tiles to the right.
#[inline(always)]
fn factor_rows<F: F64x4, const R: usize>(
    simd: Simd<F>,
    a: &mut Panel,
    sweep: Sweep,
    row: Row,
) -> Result<Option<Corner>, NotPositive> {
    let Row { first, corner, groups } = row;
    let own = least(sweep.starts, first, 1).min(first);
    let more = R == VECTOR && first + VECTOR < sweep.n;
    if own == first && corner.u == UNIT {
        return if more { open(simd, a, first + VECTOR, sweep).map(Some) } else { Ok(None) };
    }
    if R < VECTOR {
        // The last vector may contain columns of B.
        let tile: Tile<F, R, 1> = simd.load(a.part(first, first));
        a.put(simd, simd.substitute(tile, &corner.unit, &corner.inverse), first, first);
    }
    for (r, u) in corner.u.iter().enumerate().take(R) {
        a.row_mut(first + r)[first..][..R].copy_from_slice(&u[..R]);
    }
    let mut next = None;
    over_columns!(first + VECTOR..sweep.width, |j: usize| groups[j / VECTOR], |j, V, start| {
        if start < first + R {
            row.substitute::<F, R, V>(simd, a, j, start.max(own).min(first));
        }
        if more && next.is_none() {
            next = Some(open(simd, a, first + VECTOR, sweep)?);
        }
    });
    Ok(next)
}

impl Row<'_> {
    #[inline(always)]
    fn substitute<F: F64x4, const R: usize, const V: usize>(
        &self,
        simd: Simd<F>,
        a: &mut Panel,
        j: usize,
        start: usize,
    ) {
        let first = self.first;
        let tile: Tile<F, R, V> = simd.load(a.part(first, j));
        let tile = simd.multiply::<true, R, V>(tile, a.part(start, first), a.part(start, j), first - start);
        a.put(simd, simd.substitute(tile, &self.corner.unit, &self.corner.inverse), first, j);
    }
}

/// For each vector of columns of some rows: the first row that is not zero.
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
mod tests;
