//! Motion of the links of a hinge chain from gyroscopes alone, on one time grid. `lever_arms` and `magnetic` use it.

use super::chain_sensor::ChainSensor;
use super::clock::{common_clock, interpolated};
use super::hinge_chain::FoundMount;
use super::matrix::matrix;
use crate::{Error, Result};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// One link over time, on the chain's grid; in link axes unless named otherwise.
pub(crate) struct LinkMotion {
    pub world_from_link: Vec<Matrix3<f64>>,
    /// Matrix of angular acceleration and centripetal acceleration: the acceleration of a point of the link is `swirl`
    /// times its position.
    pub swirl: Vec<Matrix3<f64>>,
}

/// The chain on an even time grid.
pub(crate) struct ChainMotion {
    pub time_s: Vec<f64>,
    /// Per sensor and time: whether the sensor swings.
    pub swings: Vec<bool>,
    pub links: Vec<LinkMotion>,
    /// Whether all hinges are parallel. Angular velocity off the axis is then play and vibration, and is ignored.
    planar: bool,
    half_window: usize,
    step_s: f64,
}

impl ChainMotion {
    /// Integrates the gyroscopes from the still stretch on, forwards and backwards. `smooth_s` is half the window of
    /// the local parabola that gives angular accelerations.
    pub fn new(sensors: &[ChainSensor], mounts: &[FoundMount], smooth_s: f64) -> Result<Self> {
        if sensors.len() != mounts.len() || sensors.is_empty() {
            return Err(Error::Data(format!(
                "{} sensors and {} mounts: give each sensor of the chain its mount",
                sensors.len(),
                mounts.len()
            )));
        }
        let clocks: Vec<&[f64]> = sensors.iter().map(|s| s.time_s).collect();
        let (time_s, step_s) = common_clock(&clocks)?;
        let still_s = mounts[0].still_s;
        let swings = time_s.iter().map(|&t| sensors.iter().any(|s| s.swings_at(t, still_s))).collect();
        let half_window = (smooth_s / step_s).round().max(1.0) as usize;
        let mut chain = Self {
            time_s,
            swings,
            links: Vec::new(),
            planar: sensors.windows(2).all(|s| s[0].common_direction(&s[1]).is_some()),
            half_window,
            step_s,
        };
        for (sensor, mount) in sensors.iter().zip(mounts) {
            let link = chain.link(sensor, mount)?;
            chain.links.push(link);
        }
        Ok(chain)
    }

    /// A sensor's column in link axes on the grid, with the same smoothing as the motion.
    pub fn smoothed(&self, sensor: &ChainSensor, column: &[[f64; 3]], mount: &FoundMount) -> Result<Vec<Vector3<f64>>> {
        Ok(self.smooth(&self.on_grid(sensor, column, mount, Vector3::zeros())?))
    }

    fn link(&self, sensor: &ChainSensor, mount: &FoundMount) -> Result<LinkMotion> {
        let bias = Vector3::from(mount.gyro_bias_rad_s);
        let mut rates = self.on_grid(sensor, sensor.gyro_rad_s, mount, bias)?;
        let rest = matrix(&sensor.world_from_link);
        if self.planar {
            let axis = rest.tr_mul(&Vector3::from(sensor.hinge_axis_in_world)).normalize();
            rates.iter_mut().for_each(|w| *w = axis * axis.dot(w));
        }
        let squares: Vec<Matrix3<f64>> = rates.iter().map(|w| w.cross_matrix() * w.cross_matrix()).collect();
        let accelerations = self.slope(&rates);
        let swirl = self.smooth(&squares).iter().zip(&accelerations).map(|(c, a)| c + a.cross_matrix()).collect();
        let world_from_link = self.oriented(&rates, rest, mount.still_s);
        Ok(LinkMotion { world_from_link, swirl })
    }

    fn on_grid(
        &self,
        sensor: &ChainSensor,
        column: &[[f64; 3]],
        mount: &FoundMount,
        bias: Vector3<f64>,
    ) -> Result<Vec<Vector3<f64>>> {
        let link_from_sensor = matrix(&mount.link_from_sensor);
        let rows = sensor.time_s.iter().zip(column).filter(|(_, v)| v.iter().all(|x| x.is_finite()));
        let known: Vec<(f64, Vector3<f64>)> = rows.map(|(&t, v)| (t, Vector3::from(*v))).collect();
        if known.len() < 2 {
            return Err(Error::Data(format!("sensor `{}`: fewer than 2 complete rows", sensor.name)));
        }
        Ok(self.time_s.iter().map(|&t| link_from_sensor * (interpolated(&known, t) - bias)).collect())
    }

    fn oriented(&self, rates: &[Vector3<f64>], rest: Matrix3<f64>, still_s: (f64, f64)) -> Vec<Matrix3<f64>> {
        let start = self.time_s.partition_point(|&t| t < 0.5 * (still_s.0 + still_s.1)).min(rates.len() - 1);
        let mut poses = vec![rest; rates.len()];
        let turn = |k: usize, sign: f64| Rotation3::new((rates[k] + rates[k + 1]) * (0.5 * sign * self.step_s));
        for k in start..rates.len() - 1 {
            poses[k + 1] = poses[k] * turn(k, 1.0).matrix();
        }
        for k in (0..start).rev() {
            poses[k] = poses[k + 1] * turn(k, -1.0).matrix();
        }
        poses
    }

    /// Value at the middle of the least-squares parabola over the window (Savitzky and Golay 1964).
    fn smooth<T>(&self, values: &[T]) -> Vec<T>
    where
        T: Copy + std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>,
    {
        let h = self.half_window as f64;
        let scale = 3.0 / ((2.0 * h - 1.0) * (2.0 * h + 1.0) * (2.0 * h + 3.0));
        self.weighted(values, |j| scale * (3.0 * h * h + 3.0 * h - 1.0 - 5.0 * j * j))
    }

    /// Slope of the same parabola.
    fn slope(&self, values: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let h = self.half_window as f64;
        let scale = 3.0 / (h * (h + 1.0) * (2.0 * h + 1.0) * self.step_s);
        self.weighted(values, |j| scale * j)
    }

    fn weighted<T>(&self, values: &[T], weight: impl Fn(f64) -> f64) -> Vec<T>
    where
        T: Copy + std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>,
    {
        let (h, last) = (self.half_window as isize, values.len() as isize - 1);
        let at = |k: isize, j: isize| values[(k + j).clamp(0, last) as usize] * weight(j as f64);
        (0..=last).map(|k| (-h + 1..=h).fold(at(k, -h), |sum, j| sum + at(k, j))).collect()
    }

    /// Whether the window around a grid point lies inside the recording.
    pub fn is_inner(&self, k: usize) -> bool {
        k >= self.half_window && k + self.half_window < self.time_s.len()
    }
}
