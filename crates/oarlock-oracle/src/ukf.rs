//! The scaled unscented filter of Wan and van der Merwe (2000), dense and plain: all 2n + 1 points of the whole
//! covariance, textbook weights, P - K Pzz K'. Rotations are changed by tangent vectors, R Exp(e). If the mean changes
//! by d, the covariance is transformed by Jr(d) (Hertzberg et al. 2013).

use super::body::{Naive, Room};
use super::course::Course;
use super::so3;
use nalgebra::{DMatrix, DVector, DVectorView};
use oarlock::model::Model;

/// Weights of the scaled unscented transform.
#[derive(Debug, Clone, Copy)]
pub struct Weights {
    /// Scale of the points: sqrt(n + lambda) columns of the covariance's root.
    pub lambda: f64,
    /// Weight of the first point in the mean.
    pub mean_0: f64,
    /// Weight of the first point in covariances.
    pub covariance_0: f64,
    /// Weight of every other point in both.
    pub others: f64,
}

impl Weights {
    /// For `n` states.
    pub fn new(n: usize, alpha: f64, beta: f64, kappa: f64) -> Self {
        let n = n as f64;
        let lambda = alpha * alpha * (n + kappa) - n;
        let mean_0 = lambda / (n + lambda);
        Weights { lambda, mean_0, covariance_0: mean_0 + 1.0 - alpha * alpha + beta, others: 0.5 / (n + lambda) }
    }

    fn of(&self, first: f64, i: usize) -> f64 {
        if i == 0 {
            first
        } else {
            self.others
        }
    }
}

/// A state estimate, its body, and workspace.
pub struct Ukf<'a> {
    /// The measurement model.
    pub body: Naive<'a>,
    /// Mean, in the order of the body's names.
    pub mean: DVector<f64>,
    /// Covariance in the tangent space at the mean.
    pub covariance: DMatrix<f64>,
    weights: Weights,
    course: Course,
    room: Room,
}

impl<'a> Ukf<'a> {
    /// From a state estimate of the engine.
    pub fn new(body: Naive<'a>, mean: DVector<f64>, covariance: DMatrix<f64>, weights: Weights) -> Self {
        let course = Course::new(&body);
        Ukf { body, mean, covariance, weights, course, room: Room::default() }
    }

    /// From a state estimate of `model` with its own parameters and states of these `names`; `spread` is alpha, beta
    /// and kappa.
    pub fn of_model(
        model: &'a Model,
        names: &[String],
        mean: &[f64],
        covariance: &[f64],
        [alpha, beta, kappa]: [f64; 3],
    ) -> Self {
        let n = mean.len();
        Ukf::new(
            Naive::new(model, model.default_parameters(), names),
            DVector::from_column_slice(mean),
            DMatrix::from_row_slice(n, n, covariance),
            Weights::new(n, alpha, beta, kappa),
        )
    }

    /// Predicts by `dt` seconds.
    pub fn predict(&mut self, dt: f64) {
        let (mut f, mut q) = self.course.over(dt, self.mean.len());
        let mut moved = &f * &self.mean;
        for &first in &self.body.turns {
            self.turn(first, &mut moved, &mut f, &mut q);
        }
        self.mean = moved;
        self.covariance = &f * &self.covariance * f.transpose() + q;
    }

    /// A rotation R becomes R Exp(phi) with the rotation phi during the step. An error R Exp(e) becomes Exp(-phi) e,
    /// and an error of phi is multiplied by Jr(phi).
    fn turn(&self, first: usize, moved: &mut DVector<f64>, f: &mut DMatrix<f64>, q: &mut DMatrix<f64>) {
        let n = self.mean.len();
        let way = f.view((first, 0), (3, n)).into_owned();
        let still = so3::three(self.mean.as_slice(), first);
        let phi = so3::three(moved.as_slice(), first) - still;
        let jacobian = so3::right_jacobian(phi);
        moved.rows_mut(first, 3).copy_from(&so3::plus(still, phi));
        f.view_mut((first, 0), (3, n)).copy_from(&(jacobian * way));
        f.view_mut((first, first), (3, 3)).copy_from(&so3::exp(phi).transpose());
        let mut into = DMatrix::identity(n, n);
        into.view_mut((first, first), (3, 3)).copy_from(&jacobian);
        *q = &into * &*q * into.transpose();
    }

    /// Tangent vector from the mean to `x`.
    pub fn away(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut away = x - &self.mean;
        for &first in &self.body.turns {
            let [to, from] = [x, &self.mean].map(|v| so3::three(v.as_slice(), first));
            away.rows_mut(first, 3).copy_from(&so3::minus(to, from));
        }
        away
    }

    /// The state at the tangent vector `delta` from the mean.
    pub fn at(&self, delta: &DVector<f64>) -> DVector<f64> {
        let mut x = DVector::zeros(delta.len());
        self.place_at(delta.column(0), &mut x);
        x
    }

    fn place_at(&self, delta: DVectorView<f64>, x: &mut DVector<f64>) {
        x.copy_from(&self.mean);
        *x += delta;
        for &first in &self.body.turns {
            let [r, d] = [self.mean.as_slice(), delta.as_slice()].map(|v| so3::three(v, first));
            x.rows_mut(first, 3).copy_from(&so3::plus(r, d));
        }
    }

    /// Moves the mean and transforms the covariance.
    pub fn shift(&mut self, delta: &DVector<f64>) {
        let n = self.mean.len();
        let before = self.mean.clone();
        self.mean = self.at(delta);
        if self.body.turns.is_empty() {
            return;
        }
        let mut seen = DMatrix::identity(n, n);
        for &first in &self.body.turns {
            let jacobian = so3::right_jacobian(so3::three(delta.as_slice(), first));
            seen.view_mut((first, first), (3, 3)).copy_from(&jacobian);
        }
        for (firsts, turn) in self.body.free_joints() {
            let parent_from_child = so3::exp(so3::three(self.mean.as_slice(), turn));
            for first in firsts {
                let moved = so3::cross(so3::three(delta.as_slice(), first)) * parent_from_child;
                let along = -moved * seen.view((turn, turn), (3, 3));
                seen.view_mut((first, turn), (3, 3)).copy_from(&along);
            }
        }
        let balls = self.body.first_balls();
        for ((turn, up), azimuth) in balls.into_iter().zip(self.body.azimuth.into_iter().cycle()) {
            let seen_up = |x: &DVector<f64>| so3::exp(so3::three(x.as_slice(), turn)).transpose() * up;
            let led = seen.view((turn, turn), (3, 3)) * seen_up(&before);
            seen.view_mut((turn, azimuth), (3, 1)).copy_from(&(seen_up(&self.mean) - led));
        }
        self.covariance = &seen * &self.covariance * seen.transpose();
    }

    /// Updates with the readings that are not NaN; their standard deviations are `std`.
    pub fn update(&mut self, z: &[f64], std: &[f64], inputs: &[f64]) {
        let rows: Vec<usize> = (0..z.len()).filter(|&r| !z[r].is_nan()).collect();
        if rows.is_empty() {
            return;
        }
        let points = self.points();
        let read = self.readings(&points, inputs, &rows);
        let w = self.weights;
        let mut expected = DVector::zeros(rows.len());
        for (i, y) in read.column_iter().enumerate() {
            expected.axpy(w.of(w.mean_0, i), &y, 1.0);
        }
        let noise = DVector::from_iterator(rows.len(), rows.iter().map(|&r| std[r] * std[r]));
        let mut inner = DMatrix::from_diagonal(&noise);
        self.add_inputs(read.column(0), inputs, &rows, &mut inner);
        let (away, weighted) = self.deviations(read, &expected);
        inner.gemm(1.0, &weighted, &away.transpose(), 1.0);
        let cross = points * weighted.transpose();
        let measured = DVector::from_iterator(rows.len(), rows.iter().map(|&r| z[r]));
        let factor = inner.clone().cholesky().expect("positive");
        let gain = factor.solve(&cross.transpose()).transpose();
        self.covariance -= &gain * inner * gain.transpose();
        self.covariance = (&self.covariance + self.covariance.transpose()) * 0.5;
        self.shift(&(&gain * (measured - expected)));
    }

    /// These rows at every point.
    fn readings(&mut self, points: &DMatrix<f64>, inputs: &[f64], rows: &[usize]) -> DMatrix<f64> {
        let (mut read, mut x) = (DMatrix::zeros(rows.len(), points.ncols()), DVector::zeros(points.nrows()));
        let mut room = std::mem::take(&mut self.room);
        for (delta, mut out) in points.column_iter().zip(read.column_iter_mut()) {
            self.place_at(delta, &mut x);
            let all = self.body.measure_in(&x, inputs, &mut room);
            out.iter_mut().zip(rows).for_each(|(to, &row)| *to = all[row]);
        }
        self.room = room;
        read
    }

    /// Deviations of the readings from their mean, plain and weighted. Products of whole matrices are used because
    /// outer products of single columns are slow when the sums outgrow the cache.
    fn deviations(&self, read: DMatrix<f64>, expected: &DVector<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let mut away = read;
        away.column_iter_mut().for_each(|mut y| y -= expected);
        let mut weighted = away.clone();
        for (i, mut y) in weighted.column_iter_mut().enumerate() {
            y *= self.weights.of(self.weights.covariance_0, i);
        }
        (away, weighted)
    }

    /// Adds to `inner` the change of the readings `here` if one input is off by its standard deviation.
    fn add_inputs(&mut self, here: DVectorView<f64>, inputs: &[f64], rows: &[usize], inner: &mut DMatrix<f64>) {
        let model = self.body.model;
        let noisy = model.joints.iter().filter(|joint| joint.input && !inputs[joint.first].is_nan());
        let (mut off, mut change) = (inputs.to_vec(), DVector::zeros(rows.len()));
        for joint in noisy {
            off[joint.first] += joint.input_std;
            let all = self.body.measure_in(&self.mean, &off, &mut self.room);
            change.iter_mut().zip(rows).zip(here.iter()).for_each(|((to, &row), here)| *to = all[row] - here);
            inner.ger(1.0, &change, &change, 1.0);
            off[joint.first] = inputs[joint.first];
        }
    }

    /// Sigma points relative to the mean, one per column.
    fn points(&self) -> DMatrix<f64> {
        let n = self.mean.len();
        let scale = (n as f64 + self.weights.lambda).sqrt();
        let factor = self.covariance.clone().cholesky().expect("positive").unpack() * scale;
        let mut points = DMatrix::zeros(n, 2 * n + 1);
        for i in 0..n {
            points.set_column(2 * i + 1, &factor.column(i));
            points.set_column(2 * i + 2, &-factor.column(i));
        }
        points
    }
}
