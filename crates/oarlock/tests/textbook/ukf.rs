//! The scaled unscented filter as in Wan and van der Merwe (2000), dense and plain: all 2n + 1 points of the whole
//! covariance, textbook weights, P - K Pzz K'.

use super::body::Naive;
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
        for joint in &model.joints {
            let Some(i) = self.body.place(&joint.name) else {
                continue;
            };
            let power = joint.process.density.powi(2) * dt;
            match joint.process.kind {
                ProcessKind::Walk => q[(i, i)] = power,
                ProcessKind::Jerk => self.drive(&joint.name, i, dt, power, &mut f, &mut q),
            }
        }
        self.walk("azimuth", model.world.azimuth_walk, dt, &mut q);
        for base in &model.base_accelerations {
            self.walk(&base.name, base.density, dt, &mut q);
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
        self.mean = &f * &self.mean;
        self.covariance = &f * &self.covariance * f.transpose() + q;
    }

    fn walk(&self, name: &str, density: f64, dt: f64, q: &mut DMatrix<f64>) {
        if let Some(i) = self.body.place(name) {
            q[(i, i)] = density * density * dt;
        }
    }

    /// Constant acceleration; `power` is what white jerk adds to the variance of the acceleration.
    fn drive(&self, name: &str, i: usize, t: f64, power: f64, f: &mut DMatrix<f64>, q: &mut DMatrix<f64>) {
        let place = |what: &str| self.body.place(&format!("{name}.{what}")).expect("a rate");
        let at = [i, place("velocity"), place("acceleration")];
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

    /// Takes in the readings that are numbers; their standard deviations are `std`.
    pub fn update(&mut self, z: &[f64], std: &[f64], inputs: &[f64]) {
        let rows: Vec<usize> = (0..z.len()).filter(|&r| !z[r].is_nan()).collect();
        if rows.is_empty() {
            return;
        }
        let points = self.points();
        let read: Vec<DVector<f64>> = points.iter().map(|x| self.body.measure(x, inputs).select_rows(&rows)).collect();
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
            let (dx, dy, weight) = (x - &self.mean, y - &expected, w.of(w.covariance_0, i));
            inner.ger(weight, &dy, &dy, 1.0);
            cross.ger(weight, &dx, &dy, 1.0);
        }
        let measured = DVector::from_vec(rows.iter().map(|&r| z[r]).collect());
        let factor = inner.clone().cholesky().expect("positive");
        let gain = factor.solve(&cross.transpose()).transpose();
        self.mean += &gain * (measured - expected);
        self.covariance -= &gain * inner * gain.transpose();
        self.covariance = (&self.covariance + self.covariance.transpose()) * 0.5;
    }

    /// What the readings change by when one input is off by its standard deviation.
    fn input_changes(&self, inputs: &[f64]) -> Vec<DVector<f64>> {
        let joints = self.body.model.joints.iter().enumerate();
        let noisy = joints.filter(|(j, joint)| joint.input && !inputs[*j].is_nan());
        let here = self.body.measure(&self.mean, inputs);
        let change = |(j, joint): (usize, &oarlock::model::Joint)| {
            let mut off = inputs.to_vec();
            off[j] += joint.input_std;
            self.body.measure(&self.mean, &off) - &here
        };
        noisy.map(change).collect()
    }

    fn points(&self) -> Vec<DVector<f64>> {
        let n = self.mean.len();
        let scale = (n as f64 + self.weights.lambda).sqrt();
        let factor = self.covariance.clone().cholesky().expect("positive").unpack() * scale;
        let mut points = vec![self.mean.clone()];
        for i in 0..n {
            points.push(&self.mean + factor.column(i));
            points.push(&self.mean - factor.column(i));
        }
        points
    }
}
