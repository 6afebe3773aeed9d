//! Which readings are believed: innovation tests, part by part.

use super::dense::{cholesky, solve_transposed, Square};

/// Room for the innovation covariance of up to so many rows.
#[derive(Debug, Clone)]
pub struct Room {
    /// One matrix for each number of rows.
    squares: Vec<Square>,
    w: Vec<f64>,
}

impl Room {
    /// For groups of up to `MAX_ROWS` rows, and for one of `rows`.
    pub fn new(rows: usize) -> Self {
        let sizes = (0..=MAX_ROWS).chain((rows > MAX_ROWS).then_some(rows));
        Room { squares: sizes.map(Square::zeros).collect(), w: vec![0.0; rows.max(MAX_ROWS)] }
    }
}

/// Normalised innovation squared of some rows: y' (1 + G G')^-1 y, with G and y already divided by the noise.
///
/// `None` if the matrix is not positive definite (a reading is not a number), or if there is no room for it.
pub fn nis<R>(g: &[f64], width: usize, y: &[f64], rows: R, room: &mut Room) -> Option<f64>
where
    R: ExactSizeIterator<Item = usize> + Clone,
{
    let count = rows.len();
    let s = room.squares.iter_mut().find(|s| s.n() == count)?;
    let row = |r: usize| &g[r * width..(r + 1) * width];
    for (i, a) in rows.clone().enumerate() {
        for (j, b) in rows.clone().enumerate().skip(i) {
            *s.at_mut(i, j) = dot(row(a), row(b)) + if i == j { 1.0 } else { 0.0 };
        }
    }
    cholesky(s).ok()?;
    let w = &mut room.w[..count];
    w.iter_mut().zip(rows).for_each(|(w, r)| *w = y[r]);
    solve_transposed(s, 0, w);
    Some(w.iter().map(|x| x * x).sum())
}

/// Partial sums side by side, which plain loops turn into vector code.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    for (x, y) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest = a.len() - a.len() % 8;
    let tail: f64 = a[rest..].iter().zip(&b[rest..]).map(|(x, y)| x * y).sum();
    sums.iter().sum::<f64>() + tail
}

/// Most rows that a source may have.
pub const MAX_ROWS: usize = 16;

/// Upper quantiles of chi-square at 1e-6 for 1 to 16 degrees of freedom.
const THRESHOLDS: [f64; MAX_ROWS] = [
    23.928, 27.631, 30.665, 33.377, 35.888, 38.258, 40.522, 42.701, 44.811, 46.863, 48.866, 50.825, 52.747, 54.635,
    56.493, 58.324,
];

/// Quantile of the normalised innovation squared of `rows` readings: exceeded once in a million when all is well.
pub fn threshold(rows: usize) -> f64 {
    THRESHOLDS[rows.clamp(1, MAX_ROWS) - 1]
}
