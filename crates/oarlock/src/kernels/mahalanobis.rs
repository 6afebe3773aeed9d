//! Squared Mahalanobis distances y' S^-1 y of four small vectors side by side, for the innovation tests of a filter.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use crate::kernels::arch::{madd, Arch, Kernel};
use crate::kernels::dense::Square;
use crate::kernels::registers::VECTOR;

/// Most rows of one vector.
pub const MAX_ROWS: usize = 16;

/// A vector and the block of a matrix that is its covariance.
#[derive(Debug, Clone, Copy)]
pub struct InnovationBlock<'a> {
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
pub fn nis(arch: Arch, tests: &[InnovationBlock; VECTOR]) -> [f64; VECTOR] {
    arch.run(SideBySide(tests))
}

struct SideBySide<'a>(&'a [InnovationBlock<'a>; VECTOR]);

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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Of a covariance with numbers of about one.
    const ROUNDING: f64 = 1e-12;

    fn covariance(n: usize) -> Square {
        let mut s = Square::zeros(n);
        for i in 0..n {
            (i..n).for_each(|j| *s.at_mut(i, j) = f64::from(i == j) + 0.4 / (1.0 + (i + 2 * j) as f64));
        }
        s
    }

    /// With a library's inverse.
    fn plainly(test: &InnovationBlock) -> f64 {
        let used: Vec<usize> = (0..test.y.len()).filter(|&i| test.used[i]).collect();
        let at = |i: usize, j: usize| {
            let (i, j) = (test.first + used[i.min(j)], test.first + used[i.max(j)]);
            test.covariance.at(i, j)
        };
        let s = DMatrix::from_fn(used.len(), used.len(), at);
        let y = DVector::from_iterator(used.len(), used.iter().map(|&i| test.y[i]));
        y.dot(&(s.try_inverse().expect("positive") * &y))
    }

    #[test]
    fn four_tests_side_by_side_are_four_tests() {
        let (s, y) = (covariance(20), [0.3, -1.2, 0.8, 2.1, -0.4, 1.9, 0.6, -0.9, 1.1, 0.2, -1.7, 0.5]);
        const USED: [bool; 12] = [true, true, false, true, true, true, true, true, false, true, true, true];
        const ALL: [bool; 12] = [true; 12];
        for most in [1usize, 3, 6, 9, 12] {
            let test = |first: usize, len: usize, used: &'static [bool; 12]| InnovationBlock {
                covariance: &s,
                first,
                y: &y[..len],
                used: &used[..len],
            };
            let tests =
                [test(0, most, &ALL), test(2, most, &ALL), test(1, most.div_ceil(2), &USED), test(5, most, &USED)];
            for arch in [Arch::PORTABLE, Arch::best()] {
                for (nis, test) in nis(arch, &tests).iter().zip(&tests) {
                    assert!((nis - plainly(test)).abs() < ROUNDING, "{most}");
                }
            }
            let alike = [0, 3, 5, 7].map(|first| test(first, most, &ALL));
            for (nis, test) in nis(Arch::best(), &alike).iter().zip(&alike) {
                assert!((nis - plainly(test)).abs() < ROUNDING, "{most}");
            }
        }
    }

    #[test]
    fn what_has_no_inverse_is_no_number_and_harms_no_neighbour() {
        let (good, mut bad, mut worse) = (covariance(3), covariance(3), covariance(3));
        *bad.at_mut(1, 1) = -1.0;
        *worse.at_mut(0, 0) = f64::NAN;
        let y = [1.0, 2.0, 3.0];
        let tests =
            [&good, &bad, &worse, &good].map(|s| InnovationBlock { covariance: s, first: 0, y: &y, used: &[true; 3] });
        let [a, b, c, d] = nis(Arch::best(), &tests);
        assert!(b.is_nan() && c.is_nan());
        assert!((a - plainly(&tests[0])).abs() < ROUNDING && a == d);
    }
}
