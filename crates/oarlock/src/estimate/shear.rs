//! P <- (I + B) P (I + B)' where B leads from three coordinates to three others (P4). The filter, its limbs and the smoother use it.

use crate::kernels::dense::Square;

/// Three coordinates to which a matrix times three others is added.
#[derive(Debug, Clone, Copy)]
pub struct Shear {
    /// First of the coordinates that are changed.
    pub to: usize,
    /// First of those that are added.
    pub from: usize,
    /// B.
    pub factor: [[f64; 3]; 3],
}

impl Shear {
    /// The same among these states; `None` if one of its coordinates is not among them.
    pub fn among(&self, states: &[usize]) -> Option<Self> {
        let place = |first: usize| {
            let at = states.binary_search(&first).ok()?;
            (states.get(at + 2) == Some(&(first + 2))).then_some(at)
        };
        Some(Shear { to: place(self.to)?, from: place(self.from)?, ..*self })
    }

    /// Applies it to a covariance.
    pub fn apply(&self, p: &mut Square) {
        for j in 0..p.n() {
            let old = std::array::from_fn(|c| p.at(self.from + c, j));
            (0..3).for_each(|r| *p.at_mut(self.to + r, j) += self.row(r, old));
        }
        for i in 0..p.n() {
            self.apply_to_row(p.row_mut(i));
        }
        p.mirror_upper();
    }

    /// Applies it to a row whose columns are the coordinates.
    pub fn apply_to_row(&self, row: &mut [f64]) {
        let old = std::array::from_fn(|c| row[self.from + c]);
        (0..3).for_each(|r| row[self.to + r] += self.row(r, old));
    }

    /// Applies this share of it to each column of a matrix whose rows are the coordinates.
    pub fn apply_to_columns(&self, rows: &mut [f64], share: impl ExactSizeIterator<Item = f64>) {
        let width = share.len();
        for (column, share) in share.enumerate() {
            let old = std::array::from_fn(|c| rows[(self.from + c) * width + column]);
            (0..3).for_each(|r| rows[(self.to + r) * width + column] += share * self.row(r, old));
        }
    }

    /// Multiplies rows of this width by (I + B)'^-1 = I - B'.
    pub fn undo_transposed(&self, rows: &mut [f64], width: usize) {
        for column in 0..width {
            for c in 0..3 {
                let back: f64 = (0..3).map(|r| self.factor[r][c] * rows[(self.to + r) * width + column]).sum();
                rows[(self.from + c) * width + column] -= back;
            }
        }
    }

    fn row(&self, r: usize, old: [f64; 3]) -> f64 {
        self.factor[r].iter().zip(old).map(|(f, x)| f * x).sum()
    }
}
