//! Square row-major matrices and plain loops over their rows, for covariances. Factors are upper triangular, A = U'U.

/// A square matrix.
#[derive(Debug, PartialEq)]
pub struct Square {
    n: usize,
    data: Vec<f64>,
}

impl Clone for Square {
    fn clone(&self) -> Self {
        Square { n: self.n, data: self.data.clone() }
    }

    /// Without allocating if the size is the same.
    fn clone_from(&mut self, from: &Self) {
        self.n = from.n;
        self.data.clone_from(&from.data);
    }
}

impl Square {
    /// All zero.
    pub fn zeros(n: usize) -> Self {
        Square { n, data: vec![0.0; n * n] }
    }

    /// From rows laid end to end.
    pub fn from_rows(n: usize, data: Vec<f64>) -> Option<Self> {
        (data.len() == n * n).then_some(Square { n, data })
    }

    /// Number of rows.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Rows laid end to end.
    pub fn as_slice(&self) -> &[f64] {
        &self.data
    }

    /// Row `i`.
    #[inline(always)]
    pub fn row(&self, i: usize) -> &[f64] {
        &self.data[i * self.n..(i + 1) * self.n]
    }

    /// Row `i`.
    #[inline(always)]
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.data[i * self.n..(i + 1) * self.n]
    }

    /// Different rows.
    #[inline(always)]
    pub(crate) fn rows_mut<const COUNT: usize>(&mut self, index: [usize; COUNT]) -> [&mut [f64]; COUNT] {
        let n = self.n;
        self.data.get_disjoint_mut(index.map(|i| i * n..(i + 1) * n)).expect("different rows")
    }

    /// Rows before `i`, and row `i`.
    #[inline(always)]
    pub(super) fn above_and_row(&mut self, i: usize) -> (&[f64], &mut [f64]) {
        let (above, rest) = self.data.split_at_mut(i * self.n);
        (above, &mut rest[..self.n])
    }

    /// Entry (i, j).
    #[inline(always)]
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.data[i * self.n + j]
    }

    /// Entry (i, j).
    #[inline(always)]
    pub fn at_mut(&mut self, i: usize, j: usize) -> &mut f64 {
        &mut self.data[i * self.n + j]
    }

    /// Copies the upper triangle onto the lower.
    pub fn mirror_upper(&mut self) {
        for i in 1..self.n {
            let (above, row) = self.data.split_at_mut(i * self.n);
            row.iter_mut().zip(above[i..].iter().step_by(self.n)).for_each(|(low, high)| *low = *high);
        }
    }

    /// Diagonal into `out`.
    pub fn diagonal(&self, out: &mut [f64]) {
        out.iter_mut().enumerate().for_each(|(i, o)| *o = self.at(i, i));
    }
}

/// `row += sum of coefficient * source`, four sources at a time.
#[inline(always)]
pub fn accumulate<'a>(row: &mut [f64], terms: impl Iterator<Item = (f64, &'a [f64])>) {
    let mut terms = terms.filter(|t| t.0 != 0.0);
    let n = row.len();
    while let Some((a, x)) = terms.next() {
        let (b, y) = terms.next().unwrap_or((0.0, x));
        let (c, z) = terms.next().unwrap_or((0.0, x));
        let (d, w) = terms.next().unwrap_or((0.0, x));
        let (x, y, z, w) = (&x[..n], &y[..n], &z[..n], &w[..n]);
        for j in 0..n {
            row[j] += (a * x[j] + b * y[j]) + (c * z[j] + d * w[j]);
        }
    }
}

/// A pivot was not positive: the matrix is not positive definite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NotPositive {
    /// Which row.
    pub row: usize,
    /// Its pivot.
    pub pivot: f64,
}

/// Overwrites the upper triangle of `a` by U with A = U'U. Reads the upper triangle only. Rows of U with a pivot of zero or, by rounding, less
/// are zero. The only error is a pivot that is not finite.
pub fn semidefinite_factor(a: &mut Square) -> Result<(), NotPositive> {
    for i in 0..a.n {
        let n = a.n;
        let (above, row) = a.above_and_row(i);
        accumulate(&mut row[i..], (0..i).map(|k| (-above[k * n + i], &above[k * n + i..(k + 1) * n])));
        let pivot = row[i];
        if !pivot.is_finite() {
            return Err(NotPositive { row: i, pivot });
        }
        let scale = if pivot > 0.0 { 1.0 / pivot.sqrt() } else { 0.0 };
        row[i..].iter_mut().for_each(|x| *x *= scale);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factor_times_itself_is_the_matrix() {
        let mut a = Square::zeros(7);
        for i in 0..7 {
            for j in 0..7 {
                *a.at_mut(i, j) = 1.0 / (1.0 + i as f64 + j as f64) + f64::from(u8::from(i == j));
            }
        }
        assert_factor(&a);
    }

    #[test]
    fn a_direction_without_spread_is_nought_in_the_factor() {
        // Of rank two: the third coordinate is the sum of the others, and rounding took a little from it.
        let a = Square::from_rows(3, vec![2.0, 1.0, 3.0, 1.0, 2.0, 3.0, 3.0, 3.0, 6.0 - 2e-15]).unwrap();
        assert_factor(&a);
        assert_factor(&Square::zeros(2));
    }

    fn assert_factor(a: &Square) {
        let mut u = a.clone();
        semidefinite_factor(&mut u).unwrap();
        for i in 0..a.n() {
            for j in i..a.n() {
                let product: f64 = (0..=i).map(|k| u.at(k, i) * u.at(k, j)).sum();
                assert!((product - a.at(i, j)).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn what_is_no_number_is_refused_by_row() {
        let mut a = Square::zeros(3);
        *a.at_mut(1, 1) = f64::NAN;
        assert_eq!(semidefinite_factor(&mut a).unwrap_err().row, 1);
    }
}
