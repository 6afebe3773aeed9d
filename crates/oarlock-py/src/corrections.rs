//! Python access to the corrections of a Calibration, for arrays of time stamps and readings.

use crate::array::{by_name, items, matrix, reals, three, Any, Array, Reals};
use crate::errors::DataError;
use numpy::{PyArray1, PyArrayMethods};
use oarlock::corrections::{Clock, Corrections, EncoderScale};
use oarlock::sensor::Quantity;
use pyo3::prelude::*;

/// Reads the corrections of a Calibration.
pub fn corrections(object: &Any<'_>) -> PyResult<Corrections> {
    let threes = |field: &str| by_name(object, field, |name, value| three(value, &format!("{field} '{name}'")));
    Ok(Corrections {
        clocks: by_name(object, "clocks", |_, value| clock(value))?,
        encoders: by_name(object, "encoders", |_, value| encoder(value))?,
        gyro_biases: threes("gyro_biases_rad_s")?,
        accel_biases: threes("accel_biases_m_s2")?,
        accel_scales: threes("accel_scales")?,
        mag_offsets: threes("mag_offsets_ut")?,
        mag_matrices: by_name(object, "mag_matrices", |_, value| matrix(value, "mag_matrices"))?,
    })
}

fn clock(object: &Any<'_>) -> PyResult<Clock> {
    Ok(Clock { offset_s: object.getattr("offset_s")?.extract()?, drift: object.getattr("drift")?.extract()? })
}

fn encoder(object: &Any<'_>) -> PyResult<EncoderScale> {
    Ok(EncoderScale { zero: object.getattr("zero")?.extract()?, scale: object.getattr("scale")?.extract()? })
}

fn array(py: Python<'_>, Reals { shape, values }: Reals) -> PyResult<Array<'_>> {
    PyArray1::from_vec(py, values).reshape(shape)
}

/// True times, s, of time stamps (T,) by an `oarlock.recording.Clock`.
#[pyfunction]
pub fn true_times_s<'py>(py: Python<'py>, clock_: &Any<'py>, stamps_s: &Any<'py>) -> PyResult<Array<'py>> {
    let (clock, mut stamps) = (clock(clock_)?, reals(stamps_s, "stamps")?);
    stamps.values.iter_mut().for_each(|t| *t = clock.true_s(*t));
    array(py, stamps)
}

/// Values of readings (T,) by an `oarlock.recording.EncoderScale`.
#[pyfunction]
pub fn encoder_values<'py>(py: Python<'py>, encoder_: &Any<'py>, readings: &Any<'py>) -> PyResult<Array<'py>> {
    let (encoder, mut readings) = (encoder(encoder_)?, reals(readings, "readings")?);
    readings.values.iter_mut().for_each(|x| *x = encoder.value(*x));
    array(py, readings)
}

/// True readings (T, 3) of a unit's gyroscope, accelerometer or magnetometer (`field`: "gyro_rad_s", "accel_m_s2",
/// "mag_ut"), with the engine's own corrections; None if the calibration has none for it.
#[pyfunction]
pub fn corrected_readings<'py>(
    py: Python<'py>,
    calibration: &Any<'py>,
    unit: &str,
    field: &str,
    readings: &Any<'py>,
) -> PyResult<Option<Array<'py>>> {
    let quantity = match field {
        "gyro_rad_s" => Quantity::Gyro,
        "accel_m_s2" => Quantity::Accel,
        "mag_ut" => Quantity::Mag,
        _ => return Err(DataError::new_err(format!("'{field}' is no quantity of an inertial unit"))),
    };
    let Some(triad) = corrections(calibration)?.triad(unit, quantity) else { return Ok(None) };
    let (mut readings, _) = items(readings, &format!("{unit}, {field}"), &[3])?;
    readings.values.chunks_exact_mut(3).for_each(|three| triad.correct(three));
    array(py, readings).map(Some)
}
