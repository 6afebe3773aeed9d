//! Products and triangular factors in tiles of four rows, for whole panels of columns at once.
//!
//! A panel is a row-major matrix whose rows are padded to vectors of four. `factor` turns [A | B] into [U | U'^-1 B] with A = U'U:
//! Cholesky's factor and a forward substitution are one sweep. Tiles that are known to be zero are left out.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::dense::{NotPositive, Square};
use crate::lane::arch::{with_hand, Arch, Kernel};
use crate::lane::four::{Four, Hand, Part, Tile};
use std::ops::Range;

pub use crate::lane::four::VECTOR;

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

    /// Entry (i, j).
    #[inline(always)]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.data[i * self.stride + j]
    }

    /// Puts four rows, each times its scale and from column `at` on, as four columns into the rows from `i` on.
    #[inline(always)]
    pub fn put_turned<F: Four>(
        &mut self,
        hand: Hand<F>,
        [i, j]: [usize; 2],
        rows: [&[f64]; 4],
        at: usize,
        scale: [f64; 4],
    ) {
        hand.turn(rows, scale, at, &mut self.data, i * self.stride + j, self.stride);
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

/// The factor of one diagonal block: U, what it is with ones on its diagonal, and the reciprocals of that.
struct Corner<const R: usize> {
    u: [[f64; R]; R],
    unit: [[f64; R]; R],
    inverse: [f64; R],
}

/// Roots stay out of the chain of pivots, which wait for each other.
#[inline(always)]
fn corner<const R: usize>(mut u: [[f64; R]; R], first: usize) -> Result<Corner<R>, NotPositive> {
    let (mut unit, mut inverse) = ([[0.0; R]; R], [0.0; R]);
    for i in 0..R {
        let pivot = u[i][i];
        // Written so that NaN fails too.
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err(NotPositive { row: first + i, pivot });
        }
        let reciprocal = 1.0 / pivot;
        for k in i + 1..R {
            unit[i][k] = u[i][k] * reciprocal;
            for j in k..R {
                u[k][j] -= unit[i][k] * u[i][j];
            }
        }
    }
    for i in 0..R {
        inverse[i] = 1.0 / u[i][i].sqrt();
        for j in i..R {
            u[i][j] *= inverse[i];
        }
    }
    Ok(Corner { u, unit, inverse })
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
        with_hand!(FUSED, |hand| self.factor(hand))
    }
}

impl Factoring<'_> {
    #[inline(always)]
    fn factor<F: Four>(self, hand: Hand<F>) -> Result<(), NotPositive> {
        let (a, sweep) = (self.a, self.sweep);
        let whole = sweep.n / VECTOR * VECTOR;
        for first in (0..whole).step_by(VECTOR) {
            factor_rows::<F, 4>(hand, a, first, sweep)?;
        }
        match sweep.n - whole {
            3 => factor_rows::<F, 3>(hand, a, whole, sweep),
            2 => factor_rows::<F, 2>(hand, a, whole, sweep),
            1 => factor_rows::<F, 1>(hand, a, whole, sweep),
            _ => Ok(()),
        }
    }
}

#[inline(always)]
fn factor_rows<F: Four, const R: usize>(
    hand: Hand<F>,
    a: &mut Panel,
    first: usize,
    sweep: Sweep,
) -> Result<(), NotPositive> {
    let stride = a.stride;
    let (above, rows) = a.data.split_at_mut(first * stride);
    // Rows above that hold nothing in these columns take nothing away.
    let own = least(sweep.starts, first, 1).min(first);
    let side = |row: usize, column: usize| Part { data: above, from: row * stride + column, stride };
    let corner = {
        let tile: Tile<F, R, 1> = hand.load(Part { data: rows, from: first, stride });
        let tile = hand.multiply::<true, R, 1>(tile, side(own, first), side(own, first), first - own);
        hand.store(tile, rows, first, stride);
        let upper = |i: usize, j: usize| if j < i { 0.0 } else { rows[i * stride + first + j] };
        let corner = corner::<R>(std::array::from_fn(|i| std::array::from_fn(|j| upper(i, j))), first)?;
        for (r, row) in corner.u.iter().enumerate() {
            rows[r * stride + first..][..R].copy_from_slice(row);
        }
        corner
    };
    over_columns!(first + VECTOR..sweep.width, |j, V| {
        let start = least(sweep.starts, j, V);
        if start < first + R {
            let start = start.max(own).min(first);
            let tile: Tile<F, R, V> = hand.load(Part { data: rows, from: j, stride });
            let tile = hand.multiply::<true, R, V>(tile, side(start, first), side(start, j), first - start);
            let tile = hand.substitute(tile, &corner.unit, &corner.inverse);
            hand.store(tile, rows, j, stride);
        }
    });
    Ok(())
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

    #[inline(always)]
    fn from(&self, row: usize, column: usize) -> Part<'_> {
        let stride = self.panel.stride;
        Part { data: &self.panel.data, from: row * stride + self.column + column, stride }
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
        with_hand!(FUSED, |hand| self.multiply(hand))
    }
}

impl Multiplying<'_> {
    #[inline(always)]
    fn multiply<F: Four>(mut self, hand: Hand<F>) {
        let whole = self.n / VECTOR * VECTOR;
        for first in (0..whole).step_by(VECTOR) {
            self.rows::<F, 4>(hand, first);
        }
        match self.n - whole {
            3 => self.rows::<F, 3>(hand, whole),
            2 => self.rows::<F, 2>(hand, whole),
            1 => self.rows::<F, 1>(hand, whole),
            _ => {}
        }
    }

    #[inline(always)]
    fn rows<F: Four, const R: usize>(&mut self, hand: Hand<F>, first: usize) {
        let (g, stride, own) = (&self.g, self.out.stride, self.g.start(first, 1));
        let rows = &mut self.out.data[first * stride..];
        over_columns!(first..self.width, |j, V| {
            let start = g.start(j, V).max(own);
            let tile: Tile<F, R, V> =
                if self.fresh { hand.zero() } else { hand.load(Part { data: rows, from: j, stride }) };
            let tile = hand.multiply::<false, R, V>(tile, g.from(start, first), g.from(start, j), g.rows.end - start);
            hand.store(tile, rows, j, stride);
        });
    }
}

/// For each vector of columns of some rows: the first row that holds something.
#[inline(always)]
pub fn find_starts(panel: &Panel, rows: usize, columns: Range<usize>, starts: &mut [usize]) {
    for (start, column) in starts.iter_mut().zip(columns.step_by(VECTOR)) {
        // Zeros of either sign.
        let empty =
            |r: &usize| panel.row(*r)[column..column + VECTOR].iter().fold(0, |all, x| all | x.to_bits()) << 1 == 0;
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
