//! Motion models of the states; every name is looked up once.

use super::body::Naive;
use nalgebra::DMatrix;
use oarlock::model::{Imu, Orientation, Process, ProcessKind, SensorKind};

/// An entry of the transition matrix and the process noise.
pub struct Course {
    /// A value with its rates, and their process noise.
    driven: Vec<([usize; 3], Process)>,
    /// A state and the density of its random walk.
    walks: Vec<(usize, f64)>,
    /// A state, its density, and its time constant.
    decays: Vec<(usize, f64, f64)>,
    /// A state and its rate, the density, and the time constants of the state and of its rate.
    rises: Vec<([usize; 2], f64, f64, f64)>,
}

impl Course {
    /// Entries for the states named by the body.
    pub fn new(body: &Naive) -> Self {
        let mut course = Course { driven: Vec::new(), walks: Vec::new(), decays: Vec::new(), rises: Vec::new() };
        course.add_coordinates(body);
        let model = body.model;
        let walk = |course: &mut Course, name: &str, density: f64| {
            course.walks.extend(body.place(name).map(|i| (i, density)));
        };
        walk(&mut course, "azimuth", model.world.azimuth_walk);
        for sensor in &model.sensors {
            if let SensorKind::Orientation(o) = &sensor.kind {
                course.add_orientation(body, &sensor.name, o);
            }
            let SensorKind::Imu(Imu { noise, .. }) = &sensor.kind else {
                continue;
            };
            for axis in ["x", "y", "z"] {
                walk(&mut course, &format!("{}.gyro_bias_{axis}", sensor.name), noise.gyro_bias_walk);
                walk(&mut course, &format!("{}.accel_bias_{axis}", sensor.name), noise.accel_bias_walk);
            }
        }
        for base in &model.base_accelerations {
            match body.place(&base.name) {
                Some(i) if base.rise_s > 0.0 => {
                    let rate = body.place(&format!("{}.rate", base.name)).expect("it has one");
                    course.rises.push(([i, rate], base.density, base.time_s, base.rise_s));
                }
                Some(i) if base.time_s.is_finite() => course.decays.push((i, base.density, base.time_s)),
                Some(i) => course.walks.push((i, base.density)),
                None => {}
            }
        }
        course
    }

    /// Heading and slow error of an orientation sensor.
    fn add_orientation(&mut self, body: &Naive, name: &str, sensor: &Orientation) {
        if let Some(heading) = &sensor.heading {
            let state = body.place(&format!("{}.heading", heading.group)).expect("it has one");
            if self.walks.iter().all(|(known, _)| *known != state) {
                self.walks.push((state, heading.walk));
            }
        }
        for axis in ["x", "y", "z"] {
            let density = sensor.std_rad * (2.0 / sensor.correlation_time_s).sqrt();
            let state = body.place(&format!("{name}.orientation_error_{axis}"));
            self.decays.extend(state.map(|i| (i, density, sensor.correlation_time_s)));
        }
    }

    fn add_coordinates(&mut self, body: &Naive) {
        for (name, axis) in body.coordinates.iter().zip(body.model.axes()) {
            let Some(i) = body.place(name) else {
                continue;
            };
            let rate = |what: &str| body.place(&format!("{name}.{what}"));
            match (rate("velocity"), rate("acceleration")) {
                (Some(velocity), Some(acceleration)) => self.driven.push(([i, velocity, acceleration], axis.process)),
                _ => self.walks.push((i, axis.process.density)),
            }
        }
    }

    /// Transition matrix and process noise of `n` states over `dt` seconds.
    pub fn over(&self, dt: f64, n: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        let (mut f, mut q) = (DMatrix::identity(n, n), DMatrix::zeros(n, n));
        for (at, process) in &self.driven {
            let density2 = process.density.powi(2);
            match process.kind {
                ProcessKind::Singer => decay(*at, process.time_s, dt, density2, &mut f, &mut q),
                _ => drive(*at, dt, density2 * dt, &mut f, &mut q),
            }
        }
        for &(i, density) in &self.walks {
            q[(i, i)] = density * density * dt;
        }
        for &(i, density, time_s) in &self.decays {
            let keep = (-dt / time_s).exp();
            f[(i, i)] = keep;
            q[(i, i)] = density.powi(2) * time_s / 2.0 * (1.0 - keep * keep);
        }
        for &(at, density, time_s, rise_s) in &self.rises {
            rise(at, dt, density, [time_s, rise_s], &mut f, &mut q);
        }
        (f, q)
    }
}

/// Constant acceleration; `power` is the variance that white jerk adds to the acceleration.
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

/// A chain of states, each the rate of the previous one. White noise of this power drives the last. Both matrices come
/// from one exponential (Van Loan 1978), with the step as unit of time. `motion` is in that unit.
fn van_loan<const N: usize>(
    at: [usize; N],
    motion: &DMatrix<f64>,
    t: f64,
    power: f64,
    f: &mut DMatrix<f64>,
    q: &mut DMatrix<f64>,
) {
    let mut both = DMatrix::zeros(2 * N, 2 * N);
    both.view_mut((0, 0), (N, N)).copy_from(&-motion);
    both.view_mut((N, N), (N, N)).copy_from(&motion.transpose());
    both[(N - 1, 2 * N - 1)] = 1.0;
    let both = both.exp();
    let way = both.view((N, N), (N, N)).transpose();
    let noise = &way * both.view((0, N), (N, N));
    // The values are in units of 1, 1 / t, ... of the first; noise on the last contributes t^(2 N - 1) to the first.
    let unit: [f64; N] = std::array::from_fn(|r| t.powi(-(r as i32)));
    let gathered = t.powi(2 * N as i32 - 1) * power;
    for r in 0..N {
        for c in 0..N {
            f[(at[r], at[c])] = way[(r, c)] * unit[r] / unit[c];
            q[(at[r], at[c])] = noise[(r, c)] * unit[r] * unit[c] * gathered;
        }
    }
}

/// Acceleration that decays with `tau`.
fn decay(at: [usize; 3], tau: f64, t: f64, density2: f64, f: &mut DMatrix<f64>, q: &mut DMatrix<f64>) {
    let motion = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -t / tau]);
    van_loan(at, &motion, t, density2, f, q);
}

/// Acceleration that decays, driven by a rate that decays.
fn rise(at: [usize; 2], t: f64, density: f64, times: [f64; 2], f: &mut DMatrix<f64>, q: &mut DMatrix<f64>) {
    let motion = DMatrix::from_row_slice(2, 2, &[-t / times[0], 1.0, 0.0, -t / times[1]]);
    van_loan(at, &motion, t, (density / times[1]).powi(2), f, q);
}
