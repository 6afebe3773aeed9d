//! All states of all samples at once: prior, motion and readings as one least-squares problem, solved by orthogonal
//! triangles, which keep twice the digits of the normal equations.

use super::system::{dense, matrix, start, Linear, STATES};
use super::{Kalman, Sample};
use nalgebra::{DMatrix, DVector};

pub struct Whole {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Whole {
    /// The estimate of sample `k`.
    pub fn at(&self, k: usize) -> Kalman {
        let first = k * STATES;
        Kalman {
            mean: self.mean.rows(first, STATES).into_owned(),
            covariance: self.covariance.view((first, first), (STATES, STATES)).into_owned(),
        }
    }
}

/// Rows of |design x - wanted|^2, each of unit noise.
#[derive(Default)]
struct Equations {
    rows: Vec<(usize, DMatrix<f64>, DVector<f64>)>,
}

impl Equations {
    /// Adds `design x[first..] = wanted` with noise of this covariance.
    fn add(&mut self, first: usize, design: DMatrix<f64>, wanted: DVector<f64>, noise: DMatrix<f64>) {
        let root = noise.cholesky().expect("positive").unpack();
        let whiten = "a triangle with a positive diagonal";
        let design = root.solve_lower_triangular(&design).expect(whiten);
        let wanted = root.solve_lower_triangular(&wanted).expect(whiten);
        self.rows.push((first, design, wanted));
    }

    fn solve(self, n: usize) -> Whole {
        let count = self.rows.iter().map(|r| r.2.len()).sum();
        let (mut all, mut right) = (DMatrix::zeros(count, n), DVector::zeros(count));
        let mut at = 0;
        for (first, design, wanted) in self.rows {
            all.view_mut((at, first), design.shape()).copy_from(&design);
            right.rows_mut(at, wanted.len()).copy_from(&wanted);
            at += wanted.len();
        }
        let qr = all.qr();
        let (right, triangle) = (qr.q().transpose() * right, qr.r());
        let mean = triangle.solve_upper_triangular(&right).expect("every state is known");
        let one = DMatrix::identity(n, n);
        let inverse = triangle.solve_upper_triangular(&one).expect("every state is known");
        Whole { mean, covariance: &inverse * inverse.transpose() }
    }
}

pub fn solve(system: &Linear, samples: &[Sample]) -> Whole {
    let mut equations = Equations::default();
    let (prior, one) = (start(), DMatrix::identity(STATES, STATES));
    equations.add(0, one.clone(), DVector::from_vec(prior.mean), matrix(&prior.covariance));
    for (k, pair) in samples.windows(2).enumerate() {
        let (f, offset, q) = dense(system, pair[1].time_s - pair[0].time_s);
        let mut design = DMatrix::zeros(STATES, 2 * STATES);
        design.columns_mut(0, STATES).copy_from(&-f);
        design.columns_mut(STATES, STATES).copy_from(&one);
        equations.add(k * STATES, design, offset, q);
    }
    for (k, sample) in samples.iter().enumerate() {
        let (h, wanted, r) = system.seen(&sample.z, &DVector::zeros(STATES));
        if !wanted.is_empty() {
            equations.add(k * STATES, h, wanted, r);
        }
    }
    equations.solve(STATES * samples.len())
}
