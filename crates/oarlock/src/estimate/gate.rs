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
    /// For groups of up to `MAX_ROWS` rows.
    pub fn new() -> Self {
        Room { squares: (0..=MAX_ROWS).map(Square::zeros).collect(), w: vec![0.0; MAX_ROWS] }
    }
}

impl Default for Room {
    fn default() -> Self {
        Self::new()
    }
}

/// Normalised innovation squared y' S^-1 y of those rows of S and y, from `first` on, that are `used`; S is read in its upper triangle.
///
/// `None` if the matrix is not positive definite (a reading is not a number), or if there is no room for it.
pub fn nis(s: &Square, first: usize, y: &[f64], used: &[bool], room: &mut Room) -> Option<f64> {
    let mut picked = [0; MAX_ROWS];
    let mut count = 0;
    for i in (0..y.len()).filter(|&i| used[i]) {
        *picked.get_mut(count)? = i;
        count += 1;
    }
    let picked = &picked[..count];
    let square = &mut room.squares[count];
    let w = &mut room.w[..count];
    for (i, &a) in picked.iter().enumerate() {
        w[i] = y[a];
        for (j, &b) in picked.iter().enumerate().skip(i) {
            *square.at_mut(i, j) = s.at(first + a, first + b);
        }
    }
    cholesky(square).ok()?;
    solve_transposed(square, 0, w);
    Some(w.iter().map(|x| x * x).sum())
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
