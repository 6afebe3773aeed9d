//! P <- (I + B) P (I + B)' where B leads from some coordinates to three others (P4, P5). The filter, its limbs and the smoother use it.

use crate::kernels::dense::Square;

/// Three coordinates to which a matrix times others is added.
#[derive(Debug, Clone, Copy)]
pub struct Shear {
    /// First of the coordinates that are changed.
    pub to: usize,
    /// First of those that are added.
    pub from: usize,
    /// How many are added, at most three.
    pub width: usize,
    /// B; columns from `width` on are not used.
    pub factor: [[f64; 3]; 3],
}

impl Shear {
    /// The same among these states; `None` if one of its coordinates is not among them.
    pub fn among(&self, states: &[usize]) -> Option<Self> {
        let place = |first: usize, width: usize| {
            let (at, last) = (states.binary_search(&first).ok()?, width - 1);
            (states.get(at + last) == Some(&(first + last))).then_some(at)
        };
        Some(Shear { to: place(self.to, 3)?, from: place(self.from, self.width)?, ..*self })
    }

    /// Applies it to a covariance.
    pub fn apply(&self, p: &mut Square) {
        for j in 0..p.n() {
            let old = self.added(|i| p.at(i, j));
            (0..3).for_each(|r| *p.at_mut(self.to + r, j) += self.row(r, old));
        }
        for i in 0..p.n() {
            self.apply_to_row(p.row_mut(i));
        }
        p.mirror_upper();
    }

    /// Applies it to a row whose columns are the coordinates.
    pub fn apply_to_row(&self, row: &mut [f64]) {
        let old = self.added(|i| row[i]);
        (0..3).for_each(|r| row[self.to + r] += self.row(r, old));
    }

    /// Applies this share of it to each column of a matrix whose rows are the coordinates.
    pub fn apply_to_columns(&self, rows: &mut [f64], share: impl ExactSizeIterator<Item = f64>) {
        let width = share.len();
        for (column, share) in share.enumerate() {
            let old = self.added(|i| rows[i * width + column]);
            (0..3).for_each(|r| rows[(self.to + r) * width + column] += share * self.row(r, old));
        }
    }

    /// Multiplies rows of this width by (I + B)'^-1 = I - B'.
    pub fn undo_transposed(&self, rows: &mut [f64], width: usize) {
        for column in 0..width {
            for c in 0..self.width {
                let back: f64 = (0..3).map(|r| self.factor[r][c] * rows[(self.to + r) * width + column]).sum();
                rows[(self.from + c) * width + column] -= back;
            }
        }
    }

    fn added(&self, at: impl Fn(usize) -> f64) -> [f64; 3] {
        std::array::from_fn(|c| if c < self.width { at(self.from + c) } else { 0.0 })
    }

    fn row(&self, r: usize, old: [f64; 3]) -> f64 {
        self.factor[r].iter().zip(old).map(|(f, x)| f * x).sum()
    }
}
