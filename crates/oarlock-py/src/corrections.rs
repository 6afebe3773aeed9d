//! Python access to the corrections of a Calibration, for arrays of time stamps and readings.

use crate::array::{items, reals, Reals};
use crate::errors::DataError;
use crate::streams::{matrix, threes, CHANNELS};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods};
use oarlock::corrections::{Clock, Corrections, EncoderScale};
use oarlock::rotation::Mat3;
use pyo3::prelude::*;
use std::collections::BTreeMap;

type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// Reads the corrections of a Calibration.
pub fn corrections(object: &Bound<'_, PyAny>) -> PyResult<Corrections> {
    Ok(Corrections {
        clocks: by_name(object, "clocks", clock)?,
        encoders: by_name(object, "encoders", encoder)?,
        gyro_biases: threes(object, "gyro_biases_rad_s")?,
        accel_biases: threes(object, "accel_biases_m_s2")?,
        accel_scales: threes(object, "accel_scales")?,
        mag_offsets: threes(object, "mag_offsets_ut")?,
        mag_matrices: by_name(object, "mag_matrices", soft_iron)?,
    })
}

fn by_name<T>(
    object: &Bound<'_, PyAny>,
    field: &str,
    read: fn(&Bound<'_, PyAny>) -> PyResult<T>,
) -> PyResult<BTreeMap<String, T>> {
    let one = |item: PyResult<Bound<'_, PyAny>>| {
        let (name, value): (String, Bound<'_, PyAny>) = item?.extract()?;
        Ok((name, read(&value)?))
    };
    object.getattr(field)?.call_method0("items")?.try_iter()?.map(one).collect()
}

fn clock(object: &Bound<'_, PyAny>) -> PyResult<Clock> {
    Ok(Clock { offset_s: object.getattr("offset_s")?.extract()?, drift: object.getattr("drift")?.extract()? })
}

fn encoder(object: &Bound<'_, PyAny>) -> PyResult<EncoderScale> {
    Ok(EncoderScale { zero: object.getattr("zero")?.extract()?, scale: object.getattr("scale")?.extract()? })
}

fn soft_iron(object: &Bound<'_, PyAny>) -> PyResult<Mat3<f64>> {
    let (nine, _) = items(object, "mag_matrices", &[3, 3])?;
    matrix(&nine.values).ok_or_else(|| DataError::new_err("mag_matrices: expected one matrix (3, 3)"))
}

fn array<'py>(py: Python<'py>, Reals { shape, values }: Reals) -> PyResult<Array<'py>> {
    PyArray1::from_vec(py, values).reshape(shape)
}

/// True times, s, of time stamps (T,) by an `oarlock.Clock`.
#[pyfunction]
pub fn true_times_s<'py>(
    py: Python<'py>,
    clock_: &Bound<'py, PyAny>,
    stamps_s: &Bound<'py, PyAny>,
) -> PyResult<Array<'py>> {
    let (clock, mut stamps) = (clock(clock_)?, reals(stamps_s, "stamps")?);
    stamps.values.iter_mut().for_each(|t| *t = clock.true_s(*t));
    array(py, stamps)
}

/// Values of readings (T,) by an `oarlock.EncoderScale`.
#[pyfunction]
pub fn encoder_values<'py>(
    py: Python<'py>,
    encoder_: &Bound<'py, PyAny>,
    readings: &Bound<'py, PyAny>,
) -> PyResult<Array<'py>> {
    let (encoder, mut readings) = (encoder(encoder_)?, reals(readings, "readings")?);
    readings.values.iter_mut().for_each(|x| *x = encoder.value(*x));
    array(py, readings)
}

/// True readings (T, 3) of a unit's gyroscope, accelerometer or magnetometer (`field`: "gyro_rad_s", "accel_m_s2",
/// "mag_ut"), with the engine's own corrections; None if the calibration has none for it.
#[pyfunction]
pub fn corrected_readings<'py>(
    py: Python<'py>,
    calibration: &Bound<'py, PyAny>,
    unit: &str,
    field: &str,
    readings: &Bound<'py, PyAny>,
) -> PyResult<Option<Array<'py>>> {
    let Some((_, quantity)) = CHANNELS.iter().find(|(name, _)| *name == field) else {
        return Err(DataError::new_err(format!("'{field}' is no quantity of an inertial unit")));
    };
    let Some(triad) = corrections(calibration)?.triad(unit, *quantity) else { return Ok(None) };
    let (mut readings, _) = items(readings, &format!("{unit}, {field}"), &[3])?;
    readings.values.chunks_exact_mut(3).for_each(|three| triad.correct(three));
    array(py, readings).map(Some)
}
