//! Magnetic field around a hinge chain and the constant offset of each magnetometer.
//!
//! A magnetised part that moves with the sensor adds a constant in sensor axes (hard iron). The swing rotates the field
//! against it, so that both are one linear least-squares problem. The component of an offset along the hinge axis is
//! observable only as a difference between the sensors. The prior of the offsets divides it among them, and its
//! standard deviation is large.

use super::chain_motion::ChainMotion;
use super::chain_sensor::ChainSensor;
use super::hinge_chain::FoundMount;
use super::least_squares::{Estimate, SensorRows};
use super::matrix::matrix;
use super::GoOn;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::Serialize;

/// Settings of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MagneticOptions {
    /// Prior standard deviation of an offset, uT, about zero.
    pub offset_std_ut: f64,
    /// Prior standard deviation of the field's components, uT, about zero.
    pub field_std_ut: f64,
}

impl Default for MagneticOptions {
    /// Offsets that remain after a sensor's own calibration near steel; fields of the Earth's size.
    fn default() -> Self {
        Self { offset_std_ut: 15.0, field_std_ut: 60.0 }
    }
}

/// The common field and the sensors' offsets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundField {
    /// Field in world (root) axes, uT.
    pub field_in_world_ut: [f64; 3],
    /// Its standard deviations, uT.
    pub field_std_ut: [f64; 3],
    /// One per sensor, in the order given.
    pub offsets: Vec<FoundOffset>,
}

/// A magnetometer's constant offset, to be subtracted from its readings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundOffset {
    /// The sensor.
    pub name: String,
    /// In sensor axes, uT.
    pub offset_ut: [f64; 3],
    /// Standard deviation along each sensor axis, uT.
    pub offset_std_ut: [f64; 3],
    /// Root mean square residual of the readings, uT per axis.
    pub residual_ut: f64,
    /// The same without offsets. Apply the offsets if they halve it.
    pub residual_without_ut: f64,
}

/// Estimates the field and the offsets. `mag_ut[i]` contains the readings of `sensors[i]` in sensor axes, at its time
/// stamps; `mounts` are the result of [`mounts`](super::hinge_chain::mounts).
///
/// # Errors
/// [`Error::Data`] if columns differ in length or number, a magnetometer reads zero throughout, or the sensors have no
/// common stretch of time.
pub fn magnetic_field(
    sensors: &[ChainSensor],
    mag_ut: &[&[[f64; 3]]],
    mounts: &[FoundMount],
    options: &MagneticOptions,
    go_on: GoOn,
) -> Result<FoundField> {
    check_columns(sensors, mag_ut)?;
    // The magnetometer is not differentiated, so a window of one grid step is enough.
    let motion = ChainMotion::new(sensors, mounts, 0.0)?;
    let mut readings = Vec::with_capacity(sensors.len());
    for ((sensor, column), mount) in sensors.iter().zip(mag_ut).zip(mounts) {
        readings.push(motion.smoothed(sensor, column, mount)?);
    }
    let rows = (0..motion.time_s.len()).filter(|&k| motion.swings[k]).collect();
    let fit = Fit { motion, readings, rows };
    let with = fit.solve(options.offset_std_ut, options, go_on)?;
    // Zero has no information matrix.
    let without = fit.solve(1e-6, options, go_on)?;
    let offsets = (0..sensors.len()).map(|i| fit.offset(i, &with, &without, sensors, mounts)).collect();
    let three = |v: &DVector<f64>| [v[0], v[1], v[2]];
    Ok(FoundField { field_in_world_ut: three(&with.value), field_std_ut: three(&with.std), offsets })
}

struct Fit {
    motion: ChainMotion,
    readings: Vec<Vec<Vector3<f64>>>,
    rows: Vec<usize>,
}

impl Fit {
    fn solve(&self, offset_std_ut: f64, options: &MagneticOptions, go_on: GoOn) -> Result<Estimate> {
        let mut prior = DVector::from_element(3 + 3 * self.readings.len(), offset_std_ut);
        prior.rows_mut(0, 3).fill(options.field_std_ut);
        // Differences of the field between places limit the fit, more than the sensor's noise; they are alike for all.
        let noise = |residuals: Vec<f64>| {
            let squares: f64 = residuals.iter().map(|r| r.powi(2)).sum();
            vec![(squares / residuals.len() as f64).sqrt().max(1e-3); residuals.len()]
        };
        self.reweighted(&prior, 1.0, noise, go_on)
    }

    fn offset(
        &self,
        i: usize,
        with: &Estimate,
        without: &Estimate,
        sensors: &[ChainSensor],
        mounts: &[FoundMount],
    ) -> FoundOffset {
        let sensor_from_link = matrix(&mounts[i].link_from_sensor).transpose();
        let in_link = Vector3::from_iterator(with.value.rows(3 + 3 * i, 3).iter().copied());
        let variance =
            Matrix3::from_diagonal(&Vector3::from_iterator(with.std.rows(3 + 3 * i, 3).iter().map(|s| s * s)));
        let std = (sensor_from_link * variance * sensor_from_link.transpose()).diagonal().map(f64::sqrt);
        FoundOffset {
            name: sensors[i].name.to_owned(),
            offset_ut: (sensor_from_link * in_link).into(),
            offset_std_ut: std.into(),
            residual_ut: self.residual(i, &with.value),
            residual_without_ut: self.residual(i, &without.value),
        }
    }
}

impl SensorRows for Fit {
    fn sensors(&self) -> usize {
        self.readings.len()
    }

    fn times(&self) -> &[usize] {
        &self.rows
    }

    fn row(&self, i: usize, k: usize) -> (DMatrix<f64>, DVector<f64>) {
        let mut a = DMatrix::zeros(3, 3 + 3 * self.readings.len());
        a.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.motion.links[i].world_from_link[k].transpose());
        a.fixed_view_mut::<3, 3>(0, 3 + 3 * i).fill_with_identity();
        (a, DVector::from_column_slice(self.readings[i][k].as_slice()))
    }
}

fn check_columns(sensors: &[ChainSensor], mag_ut: &[&[[f64; 3]]]) -> Result<()> {
    if sensors.len() != mag_ut.len() {
        return Err(Error::Data(format!(
            "{} sensors and {} magnetometers; they must be equal",
            sensors.len(),
            mag_ut.len()
        )));
    }
    for (sensor, column) in sensors.iter().zip(mag_ut) {
        if column.len() != sensor.time_s.len() {
            return Err(Error::Data(format!(
                "sensor `{}`: {} time stamps and {} rows of the magnetometer; they must be equal",
                sensor.name,
                sensor.time_s.len(),
                column.len()
            )));
        }
        if column.iter().flatten().all(|&x| x == 0.0) {
            return Err(Error::Data(format!(
                "sensor `{}`: the magnetometer reads zero throughout; leave its column out",
                sensor.name
            )));
        }
    }
    Ok(())
}
