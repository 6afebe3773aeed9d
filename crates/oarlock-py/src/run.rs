//! Tracking and smoothing a whole recording.

use crate::belief::{matrix, PyBelief};
use crate::config::PyConfig;
use crate::errors::raise;
use crate::model::PyModel;
use crate::streams::{calibration, streams};
use numpy::{PyArray1, PyArrayMethods};
use oarlock::estimate::filter::SourceInfo;
use oarlock::track::many::{track_many as engine_track_many, Job};
use oarlock::track::notes::{at_nominal_mounts, notes};
use oarlock::track::run::{track as engine_track, Run};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// A tracked recording, as the engine keeps it.
#[pyclass(frozen, name = "Run", module = "oarlock._core")]
pub struct PyRun(Run);

/// Runs `work` without the interpreter's lock; `progress(share)` is called now and then, and Ctrl-C stops the work.
pub fn detached<T: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&mut dyn FnMut(f64) -> bool) -> oarlock::Result<T> + Send,
) -> PyResult<T> {
    let mut raised = None;
    let done = py.detach(|| {
        work(&mut |share| {
            Python::attach(|py| {
                let told = py.check_signals().and_then(|()| match &progress {
                    Some(f) => f.call1(py, (share,)).map(|_| ()),
                    None => Ok(()),
                });
                told.map_err(|e| raised = Some(e)).is_ok()
            })
        })
    });
    match raised {
        Some(e) => Err(e),
        None => done.map_err(|e| raise(py, e)),
    }
}

/// Tracks a recording; see `oarlock.track`.
#[pyfunction]
#[pyo3(signature = (model, recording, calibration_, config, start, progress))]
pub fn track(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    recording: &Bound<'_, PyAny>,
    calibration_: Option<&Bound<'_, PyAny>>,
    config: &Bound<'_, PyConfig>,
    start: Option<&Bound<'_, PyBelief>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyRun> {
    let (streams, calibration) = (streams(recording)?, calibration(calibration_)?);
    let (model, config) = (model.get().model.clone(), config.get().0.clone());
    let start = start.map(|b| b.get().belief.clone());
    let run = detached(py, progress, move |p| engine_track(model, streams, &calibration, &config, start, p))?;
    Ok(PyRun(run))
}

/// A recording with its calibration and configuration.
type Wearing<'py> = (Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, Bound<'py, PyConfig>);

/// Tracks several recordings side by side, each given as (recording, calibration, config); see `oarlock.track_many`.
/// Of each the exception that it ended in, or (run, notes, wall_s, smoothing_wall_s).
#[pyfunction]
pub fn track_many<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    jobs: Vec<Wearing<'py>>,
    smooth: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    let job = |(recording, calibration_, config): &Wearing<'py>| {
        let (streams, calibration) = (streams(recording)?, calibration(calibration_.as_ref())?);
        let (model, config) = (model.get().model.clone(), config.get().0.clone());
        PyResult::Ok(Job { model, streams, calibration, config, smooth })
    };
    let jobs = jobs.iter().map(job).collect::<PyResult<Vec<Job>>>()?;
    let results = detached(py, progress, move |p| engine_track_many(jobs, threads, p))?;
    let out = PyList::empty(py);
    for result in results {
        match result {
            Ok(done) => out.append((PyRun(done.run), done.notes, done.wall_s, done.smoothing_wall_s))?,
            Err(e) => out.append(raise(py, e).into_value(py))?,
        }
    }
    Ok(out)
}

#[pymethods]
impl PyRun {
    /// The smoothed run; see `oarlock.smooth`.
    fn smooth(&self, py: Python<'_>, progress: Option<Py<PyAny>>) -> PyResult<PyRun> {
        detached(py, progress, |p| self.0.smooth(p)).map(PyRun)
    }

    /// Arrays by name: time_s (T,), mean and std (T, n), inputs and observed (T, coordinates), and per source
    /// nis, used, rejected, missing, field (T, S).
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let s = &self.0.series;
        let body = &self.0.tracker().body;
        let rows = s.time_s.len();
        let wide = |v: &[f64]| PyArray1::from_slice(py, v).reshape([rows, v.len() / rows.max(1)]);
        let pick = |f: fn(&SourceInfo) -> f64| wide(&s.sources.iter().map(f).collect::<Vec<_>>());
        let out = PyDict::new(py);
        out.set_item("time_s", PyArray1::from_slice(py, &s.time_s))?;
        out.set_item("mean", wide(&s.mean)?)?;
        out.set_item("std", wide(&s.std)?)?;
        out.set_item("inputs", wide(&s.inputs)?)?;
        let width = body.axes.len();
        out.set_item("observed", PyArray1::from_slice(py, &s.observed).reshape([rows, width])?)?;
        out.set_item("nis", pick(|i| i.nis)?)?;
        out.set_item("used", pick(|i| f64::from(i.used))?)?;
        out.set_item("rejected", pick(|i| f64::from(i.rejected))?)?;
        out.set_item("missing", pick(|i| f64::from(i.missing))?)?;
        out.set_item("field", wide(&s.fields.iter().map(|&f| f as u8 as f64).collect::<Vec<_>>())?)?;
        let inertial: (Vec<f64>, Vec<f64>) = s.inertial.iter().map(|&(nis, n)| (nis, n as f64)).unzip();
        out.set_item("inertial_nis", PyArray1::from_vec(py, inertial.0))?;
        out.set_item("inertial_used", PyArray1::from_vec(py, inertial.1))?;
        Ok(out)
    }

    /// Full beliefs, as (time_s, mean, covariance) each.
    fn beliefs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        for b in self.0.beliefs() {
            let covariance = matrix(py, &b.covariance)?;
            list.append((b.time_s, PyArray1::from_slice(py, &b.mean), covariance))?;
        }
        Ok(list)
    }

    /// Belief behind the last sample.
    #[getter]
    fn last_belief(&self) -> Option<PyBelief> {
        let names = self.state_names();
        self.0.last_belief().map(|b| PyBelief { belief: b.clone(), names })
    }

    #[getter]
    fn state_names(&self) -> Vec<String> {
        self.0.tracker().body.layout.names.clone()
    }

    #[getter]
    fn source_names(&self) -> Vec<String> {
        self.0.tracker().body.suite.sources.iter().map(|s| s.name.clone()).collect()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        notes(&self.0)
    }

    #[getter]
    fn nominal_mounts(&self) -> Vec<String> {
        at_nominal_mounts(&self.0)
    }

    #[getter]
    fn steps(&self) -> usize {
        self.0.steps
    }

    #[getter]
    fn smoothed(&self) -> bool {
        self.0.smoothed
    }
}
