//! Python class `Tracker` for live tracking, one sample at a time.

use crate::array::{items, reals, Any};
use crate::belief::{PyBelief, PyInfo};
use crate::config::PyConfig;
use crate::errors::{raise, DataError};
use crate::model::PyModel;
use crate::streams::{self, samples};
use oarlock::config::Config;
use oarlock::corrections::Clock;
use oarlock::estimate::filter::Info;
use oarlock::recording::feed::Place;
use oarlock::recording::{input_joint, Sample};
use oarlock::rotation::turn::Turn;
use oarlock::sensor::Quantity;
use oarlock::track::arrivals::{Arrivals, Counts};
use oarlock::track::hypothesis::Hypothesis;
use oarlock::track::{Status, Tracker};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;

/// All readings at one time.
#[pyclass(frozen, name = "Sample", module = "oarlock")]
#[derive(Clone)]
pub struct PySample(Sample);

#[pymethods]
impl PySample {
    #[getter]
    fn time_s(&self) -> f64 {
        self.0.time_s
    }

    fn __repr__(&self) -> String {
        let there = |v: &[f64]| v.iter().filter(|x| !x.is_nan()).count();
        format!("Sample(time_s={}, {} readings)", self.0.time_s, there(&self.0.z) + there(&self.0.inputs))
    }
}

/// Tracks sample by sample. Readings are as measured: the calibration corrects them. Time stamps are true times.
#[pyclass(name = "Tracker", module = "oarlock")]
pub struct PyTracker {
    tracker: Tracker,
    /// What it was made of, for pickling.
    model: Py<PyModel>,
    calibration: Option<Py<PyAny>>,
    config: Config,
    clocks: BTreeMap<String, Clock>,
    /// Reused for each sample that is given as a dictionary.
    sample: Sample,
    names: Vec<String>,
    sensors: Vec<String>,
    /// Readings that were pushed; and what was estimated from them and not yet returned.
    arrivals: Option<Box<Arrivals>>,
    given: Vec<(Hypothesis, Info)>,
}

#[pymethods]
impl PyTracker {
    #[new]
    #[pyo3(signature = (model, calibration=None, config=None, belief=None))]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, PyModel>,
        calibration: Option<&Any<'_>>,
        config: Option<&Bound<'_, PyConfig>>,
        belief: Option<&Bound<'_, PyBelief>>,
    ) -> PyResult<Self> {
        let config = config.map(|c| c.get().0.clone()).unwrap_or_default();
        let stated = calibration.map(|c| c.clone().unbind());
        let calibration = streams::calibration(calibration)?;
        let mut tracker = Tracker::new(model.get().model.clone(), &calibration, &config).map_err(|e| raise(py, e))?;
        if let Some(belief) = belief {
            tracker.resume(belief.get().known.clone()).map_err(|e| raise(py, e))?;
        }
        let names = tracker.body().layout.names.clone();
        let sensors = tracker.body().suite.sources.iter().map(|s| s.name.clone()).collect();
        let sample = tracker.empty_sample();
        let clocks = calibration.corrections.clocks;
        let (model, calibration, given) = (model.clone().unbind(), stated, Vec::new());
        Ok(PyTracker { tracker, model, calibration, config, clocks, sample, names, sensors, arrivals: None, given })
    }

    /// An independent tracker.
    fn __copy__(&self, py: Python<'_>) -> Self {
        PyTracker {
            tracker: self.tracker.clone(),
            model: self.model.clone_ref(py),
            calibration: self.calibration.as_ref().map(|c| c.clone_ref(py)),
            config: self.config.clone(),
            clocks: self.clocks.clone(),
            sample: self.sample.clone(),
            names: self.names.clone(),
            sensors: self.sensors.clone(),
            arrivals: self.arrivals.clone(),
            given: self.given.clone(),
        }
    }

    fn __deepcopy__(&self, py: Python<'_>, _memo: &Any<'_>) -> Self {
        self.__copy__(py)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Any<'py>, Any<'py>)> {
        let (py, this) = (slf.py(), slf.borrow());
        if this.arrivals.is_some() || this.tracker.is_starting() {
            return Err(DataError::new_err(
                "a tracker that waits for readings cannot be pickled: flush it, or step it beyond its first samples; copy.copy works",
            ));
        }
        let state = (this.model.clone_ref(py), this.calibration.as_ref(), PyConfig(this.config.clone()), this.belief());
        Ok((slf.get_type().into_any(), state.into_pyobject(py)?.into_any()))
    }

    /// A sample of readings by sensor: `{"back": {"gyro_rad_s": (3,), ...}, "seat": 0.31}`.
    fn sample(&self, time_s: &Any<'_>, readings: &Bound<'_, PyDict>) -> PyResult<PySample> {
        let mut sample = self.tracker.empty_sample();
        self.fill(&mut sample, one_number(time_s, "sample, time_s")?, readings)?;
        Ok(PySample(sample))
    }

    /// True time, s, of a time stamp of the stream's own clock.
    fn corrected_time_s(&self, stream: &str, time_s: f64) -> PyResult<f64> {
        let body = self.tracker.body();
        let is_known =
            body.suite.sources.iter().any(|s| s.name == stream) || input_joint(&body.model, stream).is_some();
        if !is_known {
            return Err(DataError::new_err(format!("corrected_time_s: no stream '{stream}'; {}", self.hint(stream))));
        }
        Ok(self.clocks.get(stream).copied().unwrap_or_default().true_s(time_s))
    }

    /// The samples of a recording, as in `oarlock.track`.
    fn samples(&self, py: Python<'_>, recording: &Any<'_>) -> PyResult<Vec<PySample>> {
        let all = samples(py, &self.tracker, &self.clocks, &self.config, recording)?;
        Ok(all.into_iter().map(PySample).collect())
    }

    /// Process a `Sample`, or time_s and readings: (belief, info). The belief is None until the start window is full.
    #[pyo3(signature = (sample, readings=None))]
    fn step(
        &mut self,
        py: Python<'_>,
        sample: &Any<'_>,
        readings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<(Option<PyBelief>, PyInfo)> {
        let status = match (sample.cast::<PySample>(), readings) {
            (Ok(sample), None) => self.tracker.step(&sample.get().0),
            (Err(_), Some(readings)) => {
                let mut filled = self.sample.clone();
                self.fill(&mut filled, one_number(sample, "step, time_s")?, readings)?;
                self.sample = filled;
                self.tracker.step(&self.sample)
            }
            _ => return Err(DataError::new_err("step: give a Sample, or time_s (s) and readings by sensor")),
        };
        let status = match status.map_err(|e| raise(py, e))? {
            Status::Starting => "starting",
            Status::Tracking => "tracking",
            Status::OutOfOrder => "out_of_order",
        };
        let time_s = sample.cast::<PySample>().map_or(self.sample.time_s, |s| s.get().0.time_s);
        let sensor_names = self.sensors.clone();
        let tracking = status == "tracking";
        let info = if tracking { self.tracker.info().clone() } else { self.tracker.blank_info() };
        let troubles = self.tracker.fields(&info).zip(self.tracker.source_faults(&info)).collect();
        let info = PyInfo { info, time_s, status, sensor_names, troubles };
        Ok((self.belief(), info))
    }

    /// Process readings of one sensor at a stamp of its own clock, in any order, such as `push("seat", 12.31, 0.42)`: a
    /// list of (belief, info) of samples that are complete or have waited for `Config.wait_s`.
    fn push(
        &mut self,
        py: Python<'_>,
        stream: &str,
        stamp_s: &Bound<'_, PyAny>,
        readings: &Bound<'_, PyAny>,
    ) -> PyResult<Vec<(PyBelief, PyInfo)>> {
        let true_s = self.corrected_time_s(stream, one_number(stamp_s, "push, stamp_s")?)?;
        let one = PyDict::new(py);
        one.set_item(stream, readings)?;
        let mut reading = self.tracker.empty_sample();
        self.fill(&mut reading, true_s, &one)?;
        let place = self.place(stream);
        let PyTracker { tracker, arrivals, given, .. } = self;
        let arrivals = arrivals.get_or_insert_with(|| Box::new(Arrivals::new(tracker)));
        let done = arrivals.take(tracker, place, &reading, &mut |_, one, info| given.push((one.clone(), info.clone())));
        done.map_err(|e| raise(py, e))?;
        Ok(self.take_given())
    }

    /// As `push`, for readings that still wait at the end.
    fn flush(&mut self, py: Python<'_>) -> PyResult<Vec<(PyBelief, PyInfo)>> {
        let PyTracker { tracker, arrivals, given, .. } = self;
        if let Some(arrivals) = arrivals {
            let done = arrivals.finish(tracker, &mut |_, one, info| given.push((one.clone(), info.clone())));
            done.map_err(|e| raise(py, e))?;
        }
        Ok(self.take_given())
    }

    /// Numbers of readings: `received`, `late` (used by going back), `too_late`, `repeated`, `waiting`.
    #[getter]
    fn arrivals(&self) -> BTreeMap<&'static str, usize> {
        let counts = self.arrivals.as_ref().map(|a| a.counts()).unwrap_or_default();
        let waiting = self.arrivals.as_ref().map_or(0, |a| a.waiting());
        let Counts { received, late, too_late, repeated } = counts;
        let all = [received, late, too_late, repeated, waiting];
        ["received", "late", "too_late", "repeated", "waiting"].into_iter().zip(all).collect()
    }

    /// Current state estimate, or None.
    #[getter]
    fn belief(&self) -> Option<PyBelief> {
        self.tracker.hypothesis().map(|one| PyBelief { known: one.clone(), names: self.names.clone() })
    }

    #[getter]
    fn state_names(&self) -> Vec<String> {
        self.names.clone()
    }

    fn __repr__(&self) -> String {
        format!("Tracker(model='{}', {} states)", self.tracker.body().model.name, self.names.len())
    }
}

fn one_number(value: &Any<'_>, name: &str) -> PyResult<f64> {
    let numbers = reals(value, name)?.values;
    match numbers[..] {
        [number] => Ok(number),
        _ => Err(DataError::new_err(format!("{name}: {} numbers; expected one", numbers.len()))),
    }
}

/// Tolerance of a quaternion's norm: digits may be cut off, but beyond it the quaternion is no rotation.
const UNIT_TOLERANCE: f64 = 0.01;

/// Rotation vector of a unit quaternion, scalar first; three NaN if any of its numbers is missing.
fn rotation_vector(value: &Any<'_>, label: &str) -> PyResult<[f64; 3]> {
    let values = items(value, label, &[4])?.0.values;
    let [w, x, y, z] = values[..] else {
        return Err(DataError::new_err(format!("{label}: {} numbers, expected 4", values.len())));
    };
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    if (norm - 1.0).abs() > UNIT_TOLERANCE {
        return Err(DataError::new_err(format!(
            "{label}: the quaternion's norm is {norm:.4}; expected 1, scalar first"
        )));
    }
    Ok(Turn([w, x, y, z]).log())
}

impl PyTracker {
    /// Where the readings of a stream belong, whose name is known.
    fn place(&self, stream: &str) -> Place {
        let body = self.tracker.body();
        match input_joint(&body.model, stream) {
            Some(joint) => Place::Input(body.model.joints[joint].first),
            None => Place::Source(body.suite.sources.iter().position(|s| s.name == stream).unwrap_or(0)),
        }
    }

    fn take_given(&mut self) -> Vec<(PyBelief, PyInfo)> {
        let given = std::mem::take(&mut self.given);
        let one = |(known, info): (Hypothesis, Info)| {
            let troubles = self.tracker.fields(&info).zip(self.tracker.source_faults(&info)).collect();
            let (time_s, sensor_names) = (known.belief.time_s, self.sensors.clone());
            let info = PyInfo { info, time_s, status: "tracking", sensor_names, troubles };
            (PyBelief { known, names: self.names.clone() }, info)
        };
        given.into_iter().map(one).collect()
    }

    fn fill(&self, sample: &mut Sample, time_s: f64, readings: &Bound<'_, PyDict>) -> PyResult<()> {
        sample.clear();
        sample.time_s = time_s;
        for (name, value) in readings.iter() {
            let name: String = name.extract()?;
            match value.cast::<PyDict>() {
                Ok(parts) => {
                    for (field, value) in parts.iter() {
                        self.put(sample, &name, &field.extract::<String>()?, &value)?;
                    }
                }
                Err(_) => self.put(sample, &name, "value", &value)?,
            }
        }
        Ok(())
    }

    /// Suggests the name of a stream.
    fn hint(&self, name: &str) -> String {
        let model = &self.tracker.body().model;
        let inputs = model.joints.iter().filter(|j| j.input).map(|j| j.name.as_str());
        let known: Vec<&str> = model.sensors.iter().map(|s| s.name.as_str()).chain(inputs).collect();
        oarlock::model::suggest::hint(name, &known)
    }

    fn put(&self, sample: &mut Sample, name: &str, field: &str, value: &Any<'_>) -> PyResult<()> {
        let body = self.tracker.body();
        if let Some(joint) = input_joint(&body.model, name) {
            sample.inputs[body.model.joints[joint].first] = one_number(value, &format!("sample, {name}"))?;
            return Ok(());
        }
        let fits = |q: Quantity| match field {
            "gyro_rad_s" => q == Quantity::Gyro,
            "accel_m_s2" => q == Quantity::Accel,
            "mag_ut" => q == Quantity::Mag,
            "quat_wxyz" => q == Quantity::Orientation,
            _ => matches!(q, Quantity::Joint | Quantity::Position | Quantity::Range),
        };
        let source = body.suite.sources.iter().find(|s| s.name == name);
        let part = source.and_then(|s| s.parts.iter().find(|p| fits(p.quantity)));
        let Some(part) = part else {
            let hint = self.hint(name);
            return Err(DataError::new_err(format!("sample: '{name}' has no '{field}' in this model; {hint}")));
        };
        let label = format!("sample, {name}.{field}");
        let values = match part.rows.len() {
            _ if part.quantity == Quantity::Orientation => rotation_vector(value, &label)?.to_vec(),
            1 => reals(value, &label)?.values,
            n => items(value, &label, &[n])?.0.values,
        };
        if values.len() != part.rows.len() {
            return Err(DataError::new_err(format!("{label}: {} numbers, expected {}", values.len(), part.rows.len())));
        }
        sample.z[part.rows.clone()].copy_from_slice(&values);
        Ok(())
    }
}
