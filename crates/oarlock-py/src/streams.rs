//! Converts Python recordings and calibrations for the engine.

use crate::array::{by_name, matrix, three, Any};
use crate::corrections::corrections;
use crate::errors::{raise, DataError};
use crate::lent::column;
use oarlock::config::Config;
use oarlock::corrections::Clock;
use oarlock::recording::{Channel, Gathering, Recording, Sample, Stream};
use oarlock::sensor::Quantity;
use oarlock::track::{Calibration, Tracker};
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// Every stream of a Recording.
pub fn streams(recording: &Any<'_>) -> PyResult<Vec<Stream>> {
    recording.getattr("streams")?.try_iter()?.map(|s| stream(&s?)).collect()
}

/// The samples of a Recording, streams merged by true time.
pub fn samples(
    py: Python<'_>,
    tracker: &Tracker,
    clocks: &BTreeMap<String, Clock>,
    config: &Config,
    recording: &Any<'_>,
) -> PyResult<Vec<Sample>> {
    let body = tracker.body();
    let recording = Recording::new(&body.model, &body.suite, streams(recording)?, clocks, Gathering::of(config));
    let recording = recording.map_err(|e| raise(py, e))?;
    let (mut cursor, mut sample, mut all) = (recording.start(), tracker.empty_sample(), Vec::new());
    while recording.next(&mut cursor, &mut sample) {
        all.push(sample.clone());
    }
    Ok(all)
}

/// Fields of a stream whose values have several components, and their number.
const WIDE: [(&str, Quantity, usize); 4] = [
    ("gyro_rad_s", Quantity::Gyro, 3),
    ("accel_m_s2", Quantity::Accel, 3),
    ("mag_ut", Quantity::Mag, 3),
    ("quat_wxyz", Quantity::Orientation, 4),
];

fn stream(object: &Any<'_>) -> PyResult<Stream> {
    let name: String = object.getattr("name")?.extract()?;
    let read = |value: &Any<'_>, field: &str| column(value, &format!("stream '{name}', {field}"));
    let (time_s, _) = read(&object.getattr("time_s")?, "time_s")?;
    let mut channels = Vec::new();
    for (field, quantity, width) in WIDE {
        let Some(value) = object.getattr_opt(field)?.filter(|v| !v.is_none()) else { continue };
        let (values, shape) = read(&value, field)?;
        if shape.last() != Some(&width) {
            let text = format!("stream '{name}', {field}: has shape {shape:?}; expected (..., {width})");
            return Err(DataError::new_err(text));
        }
        channels.push(Channel { quantity, values });
    }
    if let Some(value) = object.getattr_opt("value")? {
        let (values, shape) = read(&value, "value")?;
        let quantity = if shape.len() == 2 { Quantity::Position } else { Quantity::Joint };
        channels.push(Channel { quantity, values });
    }
    Ok(Stream { name, time_s, channels })
}

/// A Calibration, or None.
pub fn calibration(object: Option<&Any<'_>>) -> PyResult<Calibration> {
    let Some(object) = object else { return Ok(Calibration::default()) };
    let threes = |field: &str| by_name(object, field, |name, value| three(value, &format!("{field} '{name}'")));
    let mount = |name: &str, value: &Any<'_>| {
        let (rotation, offset): (Any<'_>, Any<'_>) = value.extract()?;
        let rotation = matrix(&rotation, &format!("mount '{name}', link_from_sensor"))?;
        Ok((rotation, three(&offset, &format!("mount '{name}', offset_m"))?))
    };
    let number = |_: &str, value: &Any<'_>| value.extract();
    Ok(Calibration {
        parameters: by_name(object, "parameters", number)?,
        mounts: by_name(object, "mounts", mount)?,
        corrections: corrections(object)?,
        parameter_stds: by_name(object, "parameter_stds", number)?,
        mount_stds_rad: threes("mount_stds_rad")?,
        mount_offset_stds_m: threes("mount_offset_stds_m")?,
    })
}
