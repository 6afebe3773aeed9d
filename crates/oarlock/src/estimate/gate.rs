//! Which readings are believed: innovation tests, part by part.

use super::dense::Square;

/// Normalised innovation squared y' S^-1 y of those rows of S and y, from `first` on, that are `used`; S is read in its upper triangle.
///
/// `None` if the matrix is not positive definite (a reading is not a number), or if there are too many rows.
pub fn nis(s: &Square, first: usize, y: &[f64], used: &[bool]) -> Option<f64> {
    let (mut picked, mut count) = ([0; MAX_ROWS], 0);
    let (mut lower, mut inverse, mut w) = ([[0.0; MAX_ROWS]; MAX_ROWS], [0.0; MAX_ROWS], [0.0; MAX_ROWS]);
    let mut sum = 0.0;
    for i in (0..y.len()).filter(|&i| used[i]) {
        *picked.get_mut(count)? = i;
        let (above, below) = lower.split_at_mut(count);
        let (row, mut left, mut pivot) = (&mut below[0], y[i], s.at(first + i, first + i));
        for (j, other) in above.iter().enumerate() {
            let inner: f64 = (0..j).map(|k| row[k] * other[k]).sum();
            row[j] = (s.at(first + picked[j], first + i) - inner) * inverse[j];
            left -= row[j] * w[j];
            pivot -= row[j] * row[j];
        }
        // Written so that NaN fails too.
        if !(pivot > 0.0 && pivot.is_finite()) {
            return None;
        }
        inverse[count] = 1.0 / pivot.sqrt();
        w[count] = left * inverse[count];
        sum += w[count] * w[count];
        count += 1;
    }
    Some(sum)
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
