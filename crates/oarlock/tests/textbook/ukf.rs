//! The scaled unscented filter as in Wan and van der Merwe (2000), dense and plain: all 2n + 1 points of the whole
//! covariance, textbook weights, P - K Pzz K'. Rotations are moved by their tangent vectors, R Exp(e); whenever the mean moves by d,
//! the covariance is carried along by Jr(d) (Hertzberg et al. 2013).

use super::body::Naive;
use super::so3;
use nalgebra::{DMatrix, DVector};
use oarlock::model::{ProcessKind, SensorKind};

#[derive(Debug, Clone, Copy)]
pub struct Weights {
    pub lambda: f64,
    pub mean_0: f64,
    pub covariance_0: f64,
    pub others: f64,
}

impl Weights {
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

pub struct Ukf<'a> {
    pub body: Naive<'a>,
    pub mean: DVector<f64>,
    pub covariance: DMatrix<f64>,
    pub weights: Weights,
}

impl Ukf<'_> {
    pub fn predict(&mut self, dt: f64) {
        let n = self.mean.len();
        let (mut f, mut q) = (DMatrix::identity(n, n), DMatrix::zeros(n, n));
        let model = self.body.model;
        for (name, axis) in self.body.coordinates.iter().zip(model.axes()) {
            let Some(i) = self.body.place(name) else {
                continue;
            };
            let density2 = axis.process.density.powi(2);
            let at = || [i, self.place(name, "velocity"), self.place(name, "acceleration")];
            match axis.process.kind {
                ProcessKind::Walk => q[(i, i)] = density2 * dt,
                ProcessKind::Jerk => drive(at(), dt, density2 * dt, &mut f, &mut q),
                ProcessKind::Singer => decay(at(), axis.process.time_s, dt, density2, &mut f, &mut q),
            }
        }
        self.walk("azimuth", model.world.azimuth_walk, dt, &mut q);
        for base in &model.base_accelerations {
            self.walk(&base.name, base.density, dt, &mut q);
            if let (Some(i), true) = (self.body.place(&base.name), base.time_s.is_finite()) {
                let keep = (-dt / base.time_s).exp();
                f[(i, i)] = keep;
                q[(i, i)] = base.density.powi(2) * base.time_s / 2.0 * (1.0 - keep * keep);
            }
        }
        for sensor in &model.sensors {
            let SensorKind::Imu { noise, .. } = &sensor.kind else {
                continue;
            };
            for axis in ["x", "y", "z"] {
                self.walk(&format!("{}.gyro_bias_{axis}", sensor.name), noise.gyro_bias_walk, dt, &mut q);
                self.walk(&format!("{}.accel_bias_{axis}", sensor.name), noise.accel_bias_walk, dt, &mut q);
            }
        }
        let mut moved = &f * &self.mean;
        for &first in &self.body.turns {
            self.turn(first, &mut moved, &mut f, &mut q);
        }
        self.mean = moved;
        self.covariance = &f * &self.covariance * f.transpose() + q;
    }

    fn place(&self, coordinate: &str, what: &str) -> usize {
        self.body.place(&format!("{coordinate}.{what}")).expect("a rate")
    }

    /// A rotation R is followed by Exp(phi), phi being what its rates add meanwhile: an error R Exp(e) is seen as Exp(-phi) e behind it, and
    /// one of phi as Jr(phi) times as much.
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

    /// The state that lies `delta` from the mean.
    pub fn at(&self, delta: &DVector<f64>) -> DVector<f64> {
        let mut x = &self.mean + delta;
        for &first in &self.body.turns {
            let [r, d] = [&self.mean, delta].map(|v| so3::three(v.as_slice(), first));
            x.rows_mut(first, 3).copy_from(&so3::plus(r, d));
        }
        x
    }

    /// Moves the mean; the covariance is seen from there.
    pub fn shift(&mut self, delta: &DVector<f64>) {
        let n = self.mean.len();
        let mut seen = DMatrix::identity(n, n);
        for &first in &self.body.turns {
            let jacobian = so3::right_jacobian(so3::three(delta.as_slice(), first));
            seen.view_mut((first, first), (3, 3)).copy_from(&jacobian);
        }
        self.mean = self.at(delta);
        self.covariance = &seen * &self.covariance * seen.transpose();
    }

    fn walk(&self, name: &str, density: f64, dt: f64, q: &mut DMatrix<f64>) {
        if let Some(i) = self.body.place(name) {
            q[(i, i)] = density * density * dt;
        }
    }

    /// Takes in the readings that are numbers; their standard deviations are `std`.
    pub fn update(&mut self, z: &[f64], std: &[f64], inputs: &[f64]) {
        let rows: Vec<usize> = (0..z.len()).filter(|&r| !z[r].is_nan()).collect();
        if rows.is_empty() {
            return;
        }
        let points = self.points();
        let measured = |delta: &DVector<f64>| self.body.measure(&self.at(delta), inputs).select_rows(&rows);
        let read: Vec<DVector<f64>> = points.iter().map(measured).collect();
        let w = self.weights;
        let mut expected = DVector::zeros(rows.len());
        for (i, y) in read.iter().enumerate() {
            expected += y * w.of(w.mean_0, i);
        }
        let noise: Vec<f64> = rows.iter().map(|&r| std[r] * std[r]).collect();
        let mut inner = DMatrix::from_diagonal(&DVector::from_vec(noise));
        for change in self.input_changes(inputs) {
            let change = change.select_rows(&rows);
            inner.ger(1.0, &change, &change, 1.0);
        }
        let mut cross = DMatrix::zeros(self.mean.len(), rows.len());
        for (i, (x, y)) in points.iter().zip(&read).enumerate() {
            let (dx, dy, weight) = (x, y - &expected, w.of(w.covariance_0, i));
            inner.ger(weight, &dy, &dy, 1.0);
            cross.ger(weight, dx, &dy, 1.0);
        }
        let measured = DVector::from_vec(rows.iter().map(|&r| z[r]).collect());
        let factor = inner.clone().cholesky().expect("positive");
        let gain = factor.solve(&cross.transpose()).transpose();
        self.covariance -= &gain * inner * gain.transpose();
        self.covariance = (&self.covariance + self.covariance.transpose()) * 0.5;
        self.shift(&(&gain * (measured - expected)));
    }

    /// What the readings change by when one input is off by its standard deviation.
    fn input_changes(&self, inputs: &[f64]) -> Vec<DVector<f64>> {
        let joints = self.body.model.joints.iter();
        let noisy = joints.filter(|joint| joint.input && !inputs[joint.first].is_nan());
        let here = self.body.measure(&self.mean, inputs);
        let change = |joint: &oarlock::model::Joint| {
            let mut off = inputs.to_vec();
            off[joint.first] += joint.input_std;
            self.body.measure(&self.mean, &off) - &here
        };
        noisy.map(change).collect()
    }

    fn points(&self) -> Vec<DVector<f64>> {
        let n = self.mean.len();
        let scale = (n as f64 + self.weights.lambda).sqrt();
        let factor = self.covariance.clone().cholesky().expect("positive").unpack() * scale;
        let mut points = vec![DVector::zeros(n)];
        for i in 0..n {
            points.push(factor.column(i).into_owned());
            points.push(-factor.column(i));
        }
        points
    }
}

/// Constant acceleration; `power` is what white jerk adds to the variance of the acceleration.
fn drive(at: [usize; 3], t: f64, power: f64, f: &mut DMatrix<f64>, q: &mut DMatrix<f64>) {
    (f[(at[0], at[1])], f[(at[0], at[2])], f[(at[1], at[2])]) = (t, t * t / 2.0, t);
    let block = [
        [t.powi(4) / 20.0, t.powi(3) / 8.0, t * t / 6.0],
        [t.powi(3) / 8.0, t * t / 3.0, t / 2.0],
        [t * t / 6.0, t / 2.0, 1.0],
    ];
    for (r, row) in block.iter().enumerate() {
        for (c, x) in row.iter().enumerate() {
            q[(at[r], at[c])] = x * power;
        }
    }
}

/// Acceleration that decays in `tau`, by Van Loan (1978): both matrices in one exponential, with the step as unit of time.
fn decay(at: [usize; 3], tau: f64, t: f64, density2: f64, f: &mut DMatrix<f64>, q: &mut DMatrix<f64>) {
    let motion = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -t / tau]);
    let mut both = DMatrix::zeros(6, 6);
    both.view_mut((0, 0), (3, 3)).copy_from(&-&motion);
    both.view_mut((3, 3), (3, 3)).copy_from(&motion.transpose());
    both[(2, 5)] = 1.0;
    let both = both.exp();
    let way = both.view((3, 3), (3, 3)).transpose();
    let noise = &way * both.view((0, 3), (3, 3));
    // Units of the values: 1, 1 / t, 1 / t^2 of the first; unit white jerk gathers t^5.
    let unit = [1.0, 1.0 / t, 1.0 / (t * t)];
    for r in 0..3 {
        for c in 0..3 {
            f[(at[r], at[c])] = way[(r, c)] * unit[r] / unit[c];
            q[(at[r], at[c])] = noise[(r, c)] * unit[r] * unit[c] * t.powi(5) * density2;
        }
    }
}
