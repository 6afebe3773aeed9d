//! Converts Python recordings and calibrations for the engine.

use crate::array::items;
use crate::corrections::corrections;
use crate::errors::{raise, DataError};
use crate::lent::column;
use oarlock::config::Config;
use oarlock::corrections::Clock;
use oarlock::recording::{Channel, Recording, Sample, Stream};
use oarlock::rotation::Mat3;
use oarlock::sensor::Quantity;
use oarlock::track::{Calibration, Tracker};
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// Fields of an inertial unit's stream.
pub const CHANNELS: [(&str, Quantity); 3] =
    [("gyro_rad_s", Quantity::Gyro), ("accel_m_s2", Quantity::Accel), ("mag_ut", Quantity::Mag)];

/// Every stream of a Recording.
pub fn streams(recording: &Bound<'_, PyAny>) -> PyResult<Vec<Stream>> {
    recording.getattr("streams")?.try_iter()?.map(|s| stream(&s?)).collect()
}

/// The samples of a Recording, streams merged by true time.
pub fn samples(
    py: Python<'_>,
    tracker: &Tracker,
    clocks: &BTreeMap<String, Clock>,
    config: &Config,
    recording: &Bound<'_, PyAny>,
) -> PyResult<Vec<Sample>> {
    let body = tracker.body();
    let recording = Recording::new(&body.model, &body.suite, streams(recording)?, clocks, config.gathering());
    let recording = recording.map_err(|e| raise(py, e))?;
    let (mut cursor, mut sample, mut all) = (recording.start(), tracker.empty_sample(), Vec::new());
    while recording.next(&mut cursor, &mut sample) {
        all.push(sample.clone());
    }
    Ok(all)
}

fn stream(object: &Bound<'_, PyAny>) -> PyResult<Stream> {
    let name: String = object.getattr("name")?.extract()?;
    let (time_s, _) = column(&object.getattr("time_s")?, &format!("stream '{name}', time_s"))?;
    let mut channels = Vec::new();
    for (field, quantity) in CHANNELS {
        let Some(value) = object.getattr_opt(field)?.filter(|v| !v.is_none()) else {
            continue;
        };
        let (values, shape) = column(&value, &format!("stream '{name}', {field}"))?;
        if shape.last() != Some(&3) {
            return Err(DataError::new_err(format!(
                "stream '{name}', {field}: has shape {shape:?}; expected (..., 3)"
            )));
        }
        channels.push(Channel { quantity, values });
    }
    if let Some(value) = object.getattr_opt("quat_wxyz")?.filter(|v| !v.is_none()) {
        let (values, shape) = column(&value, &format!("stream '{name}', quat_wxyz"))?;
        if shape.last() != Some(&4) {
            return Err(DataError::new_err(format!(
                "stream '{name}', quat_wxyz: has shape {shape:?}; expected (..., 4)"
            )));
        }
        channels.push(Channel { quantity: Quantity::Orientation, values });
    }
    if let Some(value) = object.getattr_opt("value")? {
        let (values, shape) = column(&value, &format!("stream '{name}', value"))?;
        let quantity = if shape.len() == 2 { Quantity::Position } else { Quantity::Joint };
        channels.push(Channel { quantity, values });
    }
    Ok(Stream { name, time_s, channels })
}

/// A Calibration, or None.
pub fn calibration(object: Option<&Bound<'_, PyAny>>) -> PyResult<Calibration> {
    let mut out = Calibration::default();
    let Some(object) = object else { return Ok(out) };
    for pair in object.getattr("parameters")?.call_method0("items")?.try_iter()? {
        let (name, value): (String, f64) = pair?.extract()?;
        out.parameters.insert(name, value);
    }
    for pair in object.getattr("mounts")?.call_method0("items")?.try_iter()? {
        let (name, (rotation, offset)): (String, (Bound<'_, PyAny>, Bound<'_, PyAny>)) = pair?.extract()?;
        let (r, _) = items(&rotation, &format!("mount '{name}', link_from_sensor"), &[3, 3])?;
        let (o, _) = items(&offset, &format!("mount '{name}', offset_m"), &[3])?;
        let rotation = matrix(&r.values).ok_or_else(|| DataError::new_err(format!("mount '{name}': one matrix")))?;
        out.mounts.insert(name, (rotation, [o.values[0], o.values[1], o.values[2]]));
    }
    out.corrections = corrections(object)?;
    out.parameter_stds =
        object.getattr("parameter_stds")?.call_method0("items")?.try_iter()?.map(pair).collect::<PyResult<_>>()?;
    out.mount_stds_rad = threes(object, "mount_stds_rad")?;
    out.mount_offset_stds_m = threes(object, "mount_offset_stds_m")?;
    Ok(out)
}

fn pair(item: PyResult<Bound<'_, PyAny>>) -> PyResult<(String, f64)> {
    item?.extract()
}

/// Three numbers by name.
pub fn threes(object: &Bound<'_, PyAny>, field: &str) -> PyResult<BTreeMap<String, [f64; 3]>> {
    let mut out = BTreeMap::new();
    for pair in object.getattr(field)?.call_method0("items")?.try_iter()? {
        let (name, three): (String, Bound<'_, PyAny>) = pair?.extract()?;
        let (o, _) = items(&three, &format!("{field} '{name}'"), &[3])?;
        out.insert(name, [o.values[0], o.values[1], o.values[2]]);
    }
    Ok(out)
}

/// Nine numbers, row-major.
pub fn matrix(v: &[f64]) -> Option<Mat3<f64>> {
    (v.len() == 9).then(|| Mat3([0, 3, 6].map(|i| [v[i], v[i + 1], v[i + 2]])))
}
