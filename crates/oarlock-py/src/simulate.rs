//! Python function that simulates inertial signals from joint values.

use crate::array::{items, Any};
use crate::errors::{raise, DataError};
use crate::model::PyModel;
use crate::run::each_row;
use crate::streams;
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use oarlock::body::Field;
use oarlock::kinematics::Tree;
use oarlock::model::{Imu, SensorKind};
use oarlock::simulate::{signals, Around, Spot, STENCIL};
use oarlock::track::{mount_values, parameter_values};
use pyo3::prelude::*;

/// gyro, accel and mag of every inertial unit, (T, units, 9), from joint values at nine instants around each time
/// stamp, (T, 9, coordinates), `step_s` apart, and the root's acceleration (T, 3).
#[pyfunction]
pub fn imu_signals<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    calibration: Option<&Any<'py>>,
    q: &Any<'py>,
    step_s: f64,
    root_acceleration: &Any<'py>,
    azimuth_rad: f64,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (model, given) = (model.get().model.clone(), streams::calibration(calibration)?);
    let parameters = parameter_values(&model, &given.parameters).map_err(|e| raise(py, e))?;
    let mounts = mount_values(&model, &given.mounts).map_err(|e| raise(py, e))?;
    let width = model.coordinate_count();
    let (q, rows) = items(q, "q", &[STENCIL, width])?;
    let (acceleration, accelerations) = items(root_acceleration, "root_acceleration", &[3])?;
    if rows != accelerations {
        return Err(DataError::new_err(format!("q has {rows} rows, root_acceleration {accelerations}")));
    }
    let spot = |(s, mount): (&oarlock::model::Sensor, &Option<_>)| match &s.kind {
        SensorKind::Imu(Imu { frame, mount: own, .. }) => {
            let own = || (own.rotation, [0, 1, 2].map(|i| own.offset[i].eval(&parameters)));
            let (rotation, offset) = mount.unwrap_or_else(own);
            Some(Spot { frame: *frame, rotation, offset })
        }
        _ => None,
    };
    let spots: Vec<Spot> = model.sensors.iter().zip(&mounts).filter_map(spot).collect();
    let (tree, field) = (Tree::new(&model, &parameters), Field::new(&model.world, &parameters));
    let magnetic_field = field.magnetic(azimuth_rad).0;
    let mut out: Vec<f64> = Vec::with_capacity(rows * spots.len() * 9);
    each_row(py, rows, |t| {
        let at: [&[f64]; STENCIL] =
            std::array::from_fn(|k| &q.values[(t * STENCIL + k) * width..(t * STENCIL + k + 1) * width]);
        let a = &acceleration.values[3 * t..3 * t + 3];
        let around = Around { lift: field.lift, magnetic_field, root_acceleration: [a[0], a[1], a[2]] };
        out.extend(signals(&tree, &at, step_s, &around, &spots).into_iter().flatten());
    })?;
    PyArray1::from_vec(py, out).reshape([rows, spots.len(), 9])
}
