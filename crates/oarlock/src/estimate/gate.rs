//! Which readings are believed: innovation tests, part by part.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::dense::Square;
use crate::lane::arch::{madd, Arch, Kernel};
use crate::lane::four::VECTOR;

/// Rows that are tested together.
#[derive(Debug, Clone, Copy)]
pub struct Test<'a> {
    /// S, read in its upper triangle.
    pub covariance: &'a Square,
    /// Its row that belongs to the first of `y`.
    pub first: usize,
    /// Innovations.
    pub y: &'a [f64],
    /// Which of them count.
    pub used: &'a [bool],
}

/// Normalised innovation squared y' S^-1 y of four tests side by side; NaN where the matrix is not positive definite: a reading
/// is not a number.
pub fn nis(arch: Arch, tests: &[Test; VECTOR]) -> [f64; VECTOR] {
    arch.run(SideBySide(tests))
}

struct SideBySide<'a>(&'a [Test<'a>; VECTOR]);

impl Kernel for SideBySide<'_> {
    type Output = [f64; VECTOR];

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> Self::Output {
        let most = self.0.iter().map(|t| t.y.len()).max();
        match most {
            Some(0..=3) => self.nis::<FUSED, 3>(),
            Some(4..=6) => self.nis::<FUSED, 6>(),
            Some(7..=9) => self.nis::<FUSED, 9>(),
            _ => self.nis::<FUSED, MAX_ROWS>(),
        }
    }
}

impl SideBySide<'_> {
    #[inline(always)]
    fn gather<const N: usize>(&self) -> ([[[f64; VECTOR]; N]; N], [[f64; VECTOR]; N]) {
        if self.0.iter().all(|t| t.y.len() == N && t.used.iter().all(|&used| used)) {
            return self.gather_all();
        }
        let (mut s, mut y) = ([[[0.0; VECTOR]; N]; N], [[0.0; VECTOR]; N]);
        for (k, test) in self.0.iter().enumerate() {
            for i in 0..N {
                s[i][i][k] = 1.0;
            }
            for i in (0..test.y.len()).filter(|&i| test.used[i]) {
                y[i][k] = test.y[i];
                let row = &test.covariance.row(test.first + i)[test.first..];
                for j in (i..test.y.len()).filter(|&j| test.used[j]) {
                    s[i][j][k] = row[j];
                }
            }
        }
        (s, y)
    }

    /// As mostly: everything counts.
    #[inline(always)]
    fn gather_all<const N: usize>(&self) -> ([[[f64; VECTOR]; N]; N], [[f64; VECTOR]; N]) {
        let (mut s, mut y) = ([[[0.0; VECTOR]; N]; N], [[0.0; VECTOR]; N]);
        for i in 0..N {
            let rows: [&[f64; N]; VECTOR] = self.0.each_ref().map(|t| {
                t.covariance.row(t.first + i)[t.first..].first_chunk().expect("as many columns as innovations")
            });
            for j in i..N {
                s[i][j] = rows.map(|row| row[j]);
            }
            y[i] = self.0.each_ref().map(|t| t.y[i]);
        }
        (s, y)
    }

    /// Without roots: S = L D L'. What does not count has variance 1 and innovation 0.
    #[inline(always)]
    fn nis<const FUSED: bool, const N: usize>(self) -> [f64; VECTOR] {
        let (mut s, mut y) = self.gather::<N>();
        let (mut sum, mut least) = ([0.0; VECTOR], [f64::INFINITY; VECTOR]);
        for i in 0..N {
            let pivot = s[i][i];
            let reciprocal = pivot.map(|p| 1.0 / p);
            for k in 0..VECTOR {
                sum[k] += y[i][k] * y[i][k] * reciprocal[k];
                least[k] = pivot[k].min(least[k]);
            }
            for row in i + 1..N {
                let mut factor = [0.0; VECTOR];
                for k in 0..VECTOR {
                    factor[k] = -s[i][row][k] * reciprocal[k];
                    y[row][k] = madd::<FUSED>(factor[k], y[i][k], y[row][k]);
                }
                for j in row..N {
                    for k in 0..VECTOR {
                        s[row][j][k] = madd::<FUSED>(factor[k], s[i][j][k], s[row][j][k]);
                    }
                }
            }
        }
        // Of a pivot that is not a number, the sum is none.
        std::array::from_fn(|k| if least[k] > 0.0 { sum[k] } else { f64::NAN })
    }
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
