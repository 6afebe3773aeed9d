//! Normal equations of a fit, gathered from rows of its Jacobian.

use super::dense::Square;
use super::tiles::{factor, gram, padded, Panel, Rows, Sweep, VECTOR};
use crate::kernels::arch::Arch;

/// J'WJ, J'Wr and r'Wr over all rows, those of a prior included, and room for those of one sample.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    arch: Arch,
    n: usize,
    /// [J | r], each row divided by its noise.
    rows: Panel,
    used: usize,
    /// [J'WJ | J'Wr], upper triangle.
    equations: Panel,
    /// The same, damped and solved.
    solved: Panel,
    zeros: Vec<usize>,
    /// r'Wr.
    pub cost: f64,
}

impl NormalEquations {
    /// Room for `n` unknowns and so many rows at a time.
    pub fn new(n: usize, rows: usize) -> Self {
        let width = padded(n) + VECTOR;
        NormalEquations {
            arch: Arch::best(),
            n,
            rows: Panel::zeros(rows, width),
            used: 0,
            equations: Panel::zeros(n, width),
            solved: Panel::zeros(n, width),
            zeros: vec![0; width / VECTOR],
            cost: 0.0,
        }
    }

    /// Begins with a prior of this information that lies `away`.
    pub fn begin(&mut self, information: &Square, away: &[f64]) {
        self.equations.copy_upper(information);
        self.cost = 0.0;
        self.used = 0;
        let right = padded(self.n);
        for (i, distance) in away.iter().enumerate() {
            let pull: f64 = information.row(i).iter().zip(away).map(|(p, a)| p * a).sum();
            self.equations.row_mut(i)[right] = pull;
            self.cost += pull * distance;
        }
    }

    /// A row with the variance of its noise.
    pub fn push(&mut self, slopes: &[f64], residual: f64, noise: f64) {
        let weight = 1.0 / noise.sqrt();
        let row = self.rows.row_mut(self.used);
        for (x, slope) in row.iter_mut().zip(slopes) {
            *x = weight * slope;
        }
        row[padded(self.n)] = weight * residual;
        self.cost += weight * residual * weight * residual;
        self.used += 1;
    }

    /// Adds up the rows since the last time.
    pub fn gather(&mut self) {
        let (n, width) = (self.n, padded(self.n) + VECTOR);
        let rows = Rows { panel: &self.rows, rows: 0..self.used, column: 0, starts: &self.zeros };
        gram(self.arch, &mut self.equations, [n, width], rows, false);
        self.used = 0;
    }

    /// The step to where the squares are least, with the diagonal raised by a share; false if there is none.
    pub fn damped_step(&mut self, damping: f64, step: &mut [f64]) -> bool {
        let (n, right) = (self.n, padded(self.n));
        self.solved.copy_rows(&self.equations, n);
        (0..n).for_each(|i| self.solved.row_mut(i)[i] *= 1.0 + damping);
        let sweep = Sweep { n, width: right + VECTOR, starts: &self.zeros };
        if factor(self.arch, &mut self.solved, sweep).is_err() {
            return false;
        }
        self.solved.solve_back(right, step);
        true
    }

    /// Inverse of J'WJ; `None` if that is not positive definite.
    pub fn covariance(&self) -> Option<Square> {
        let mut information = Square::zeros(self.n);
        self.equations.copy_to(&mut information);
        inverse(self.arch, &information)
    }
}

/// Inverse of a positive definite matrix, of which the upper triangle is read: with A = U'U, the squares of U'^-1.
pub fn inverse(arch: Arch, a: &Square) -> Option<Square> {
    let (n, width) = (a.n(), padded(a.n()));
    let mut sweep = Panel::zeros(n, 2 * width);
    sweep.copy_upper(a);
    (0..n).for_each(|i| sweep.row_mut(i)[width + i] = 1.0);
    // A column of the unit matrix begins at its own row.
    let own = |v: usize| (v * VECTOR).saturating_sub(width);
    let starts: Vec<usize> = (0..2 * width / VECTOR).map(own).collect();
    factor(arch, &mut sweep, Sweep { n, width: 2 * width, starts: &starts }).ok()?;
    let (mut squares, mut out) = (Panel::zeros(n, width), Square::zeros(n));
    let rows = Rows { panel: &sweep, rows: 0..n, column: width, starts: &starts[width / VECTOR..] };
    gram(arch, &mut squares, [n, width], rows, true);
    squares.copy_to(&mut out);
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(n: usize) -> Square {
        let mut a = Square::zeros(n);
        for i in 0..n {
            for j in 0..n {
                *a.at_mut(i, j) = 1.0 / (1.0 + i as f64 + j as f64);
            }
            *a.at_mut(i, i) += 1.0;
        }
        a
    }

    /// A handful of roundings.
    const ROUNDING: f64 = 1e-13;

    #[test]
    fn inverse_undoes_the_matrix() {
        for n in [1, 3, 4, 7, 10] {
            for arch in [Arch::PORTABLE, Arch::best()] {
                let (a, b) = (sample(n), inverse(arch, &sample(n)).unwrap());
                for i in 0..n {
                    for j in 0..n {
                        let product: f64 = (0..n).map(|k| a.at(i, k) * b.at(k, j)).sum();
                        assert!((product - f64::from(i == j)).abs() < ROUNDING, "{n}: {i} {j}");
                    }
                }
            }
        }
        assert!(inverse(Arch::best(), &Square::from_rows(1, vec![-1.0]).unwrap()).is_none());
    }

    #[test]
    fn a_line_through_points_and_a_prior_is_where_the_squares_are_least() {
        let mut normal = NormalEquations::new(2, 2);
        let prior = Square::from_rows(2, vec![0.25, 0.0, 0.0, 1.0]).unwrap();
        let away = [1.0, -1.0];
        normal.begin(&prior, &away);
        // Two at a time, as samples are.
        let points = [(0.0, 1.0, 0.1), (1.0, 2.5, 0.2), (2.0, 3.0, 0.1), (3.0, 5.0, 0.4)];
        for two in points.chunks(2) {
            two.iter().for_each(|&(x, y, noise)| normal.push(&[1.0, x], y, noise));
            normal.gather();
        }
        let mut step = [0.0; 2];
        assert!(normal.damped_step(0.0, &mut step));
        let gradient = |k: usize| {
            let slope = |x: f64| [1.0, x][k];
            let of_points: f64 = points.iter().map(|&(x, y, v)| slope(x) * (y - step[0] - step[1] * x) / v).sum();
            of_points + prior.at(k, k) * (away[k] - step[k])
        };
        assert!(gradient(0).abs() < 1e-11 && gradient(1).abs() < 1e-11, "{} {}", gradient(0), gradient(1));
        let cost: f64 = points.iter().map(|&(_, y, v)| y * y / v).sum::<f64>() + 0.25 + 1.0;
        assert!((normal.cost - cost).abs() < 1e-11);
        let before = step;
        assert!(normal.damped_step(1e9, &mut step));
        assert!(step[0].abs() < 1e-6 * before[0].abs(), "a damped step is short");
    }
}
