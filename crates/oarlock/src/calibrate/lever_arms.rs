//! Sensor positions and hinge distances of a hinge chain, from the accelerometers during the swing.
//!
//! A sensor at `r` from its hinge reads `A r - R' g` plus the acceleration of the hinge. `A` is the matrix of angular
//! velocity and acceleration. The hinge's acceleration is linear in the lengths of the previous links. All offsets and
//! lengths of a chain with a resting base are therefore one linear least-squares problem. A constant reading per sensor
//! is estimated with them; it absorbs the accelerometer's bias and the slow drift of the integrated angle.

use super::chain_motion::ChainMotion;
use super::chain_sensor::ChainSensor;
use super::hinge_chain::FoundMount;
use super::least_squares::SensorRows;
use super::GoOn;
use crate::Result;
use nalgebra::{DMatrix, DVector, Vector3};
use serde::Serialize;

/// Settings of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeverOptions {
    /// Gravity, m/s2.
    pub gravity_m_s2: f64,
    /// Prior standard deviation of every coordinate, m, about zero.
    pub prior_std_m: f64,
    /// Standard deviation of the constant reading, m/s2: bias, and the effect of angle drift on gravity.
    pub constant_std_m_s2: f64,
    /// Half the window of the parabola that gives angular accelerations and smooths the accelerometer in the same way,
    /// s.
    pub smooth_s: f64,
}

impl Default for LeverOptions {
    /// Links of arm's length; a drift of up to 6 deg, which is 1 m/s2.
    fn default() -> Self {
        Self { gravity_m_s2: 9.80665, prior_std_m: 0.3, constant_std_m_s2: 1.0, smooth_s: 0.03 }
    }
}

/// Results for one sensor and its link. A coordinate with a standard deviation near the prior's was not observed. The
/// one along the link's own hinge never is, since a hinge may be placed anywhere along its axis; in a chain of parallel
/// hinges it stays zero.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundLever {
    /// The sensor.
    pub name: String,
    /// From the link's hinge to the sensor, in link axes, m.
    pub offset_m: [f64; 3],
    /// Its standard deviations, m.
    pub offset_std_m: [f64; 3],
    /// From the link's hinge to the next sensor's hinge, in link axes, m, and its standard deviations; `None` at the tip.
    pub to_next_hinge_m: Option<([f64; 3], [f64; 3])>,
    /// Root mean square residual of the smoothed specific force, m/s2 per axis.
    pub residual_m_s2: f64,
    /// The constant reading, in link axes, m/s2.
    pub constant_m_s2: [f64; 3],
}

/// Estimates offsets and hinge distances of a chain whose first hinge is fixed in the world. Each sensor's link is
/// attached to the link of the previous sensor. `up_in_world` as for [`mounts`](super::hinge_chain::mounts), whose
/// result is `mounts`.
///
/// # Errors
/// [`Error::Data`](crate::Error::Data) if sensors and mounts differ in number or the sensors have no common stretch of
/// time.
pub fn lever_arms(
    sensors: &[ChainSensor],
    mounts: &[FoundMount],
    up_in_world: [f64; 3],
    options: &LeverOptions,
    go_on: GoOn,
) -> Result<Vec<FoundLever>> {
    let motion = ChainMotion::new(sensors, mounts, options.smooth_s)?;
    let gravity = Vector3::from(up_in_world).normalize() * options.gravity_m_s2;
    let mut forces = Vec::with_capacity(sensors.len());
    for (sensor, mount) in sensors.iter().zip(mounts) {
        forces.push(motion.smoothed(sensor, sensor.accel_m_s2, mount)?);
    }
    let rows: Vec<usize> = (0..motion.time_s.len()).filter(|&k| motion.swings[k] && motion.is_inner(k)).collect();
    let fit = Fit { motion, forces, gravity, rows };
    let noise = |residuals: Vec<f64>| residuals.iter().map(|r| r.max(1e-6)).collect();
    let estimate = fit.reweighted(&fit.prior_std(options), 0.1, noise, go_on)?;
    Ok((0..sensors.len())
        .map(|i| {
            let at = |v: &DVector<f64>, first: usize| [v[first], v[first + 1], v[first + 2]];
            let pair = |first: usize| (at(&estimate.value, first), at(&estimate.std, first));
            let (offset_m, offset_std_m) = pair(fit.offset(i));
            FoundLever {
                name: sensors[i].name.to_owned(),
                offset_m,
                offset_std_m,
                to_next_hinge_m: (i + 1 < sensors.len()).then(|| pair(fit.to_next(i))),
                residual_m_s2: fit.residual(i, &estimate.value),
                constant_m_s2: at(&estimate.value, fit.constant(i)),
            }
        })
        .collect())
}

struct Fit {
    motion: ChainMotion,
    forces: Vec<Vec<Vector3<f64>>>,
    gravity: Vector3<f64>,
    rows: Vec<usize>,
}

impl Fit {
    // Unknowns of sensor i: offset, constant reading, and, except for the last, the vector to the next hinge.
    fn offset(&self, i: usize) -> usize {
        9 * i
    }

    fn constant(&self, i: usize) -> usize {
        9 * i + 3
    }

    fn to_next(&self, i: usize) -> usize {
        9 * i + 6
    }

    fn unknowns(&self) -> usize {
        9 * self.forces.len() - 3
    }

    fn prior_std(&self, options: &LeverOptions) -> DVector<f64> {
        let mut prior = DVector::from_element(self.unknowns(), options.prior_std_m);
        for i in 0..self.forces.len() {
            prior.rows_mut(self.constant(i), 3).fill(options.constant_std_m_s2);
        }
        prior
    }
}

impl SensorRows for Fit {
    fn sensors(&self) -> usize {
        self.forces.len()
    }

    fn times(&self) -> &[usize] {
        &self.rows
    }

    fn row(&self, i: usize, k: usize) -> (DMatrix<f64>, DVector<f64>) {
        let own = &self.motion.links[i];
        let mut a = DMatrix::zeros(3, self.unknowns());
        a.fixed_view_mut::<3, 3>(0, self.offset(i)).copy_from(&own.swirl[k]);
        a.fixed_view_mut::<3, 3>(0, self.constant(i)).fill_with_identity();
        for (j, link) in self.motion.links[..i].iter().enumerate() {
            let carried = own.world_from_link[k].tr_mul(&link.world_from_link[k]) * link.swirl[k];
            a.fixed_view_mut::<3, 3>(0, self.to_next(j)).copy_from(&carried);
        }
        let rest = own.world_from_link[k].tr_mul(&self.gravity);
        (a, DVector::from_column_slice((self.forces[i][k] - rest).as_slice()))
    }
}
