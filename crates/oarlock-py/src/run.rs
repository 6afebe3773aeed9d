//! Python functions that track and smooth whole recordings.

use crate::array::Any;
use crate::belief::{matrix, PyBelief};
use crate::config::PyConfig;
use crate::errors::raise;
use crate::model::PyModel;
use crate::streams::{self, streams};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use oarlock::track::many::{track_many as engine_track_many, Job};
use oarlock::track::notes::{at_nominal_mounts, notes};
use oarlock::track::run::{track as engine_track, Report, Run};
use oarlock::Error;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use std::sync::{Arc, Mutex, PoisonError};

/// A tracked recording, owned by the engine.
#[pyclass(frozen, name = "Run", module = "oarlock._core")]
pub struct PyRun(Mutex<Kept>);

struct Kept {
    run: Arc<Run>,
    /// Whether its estimates were moved to the smoothed run. They are then filtered again when needed.
    hollow: bool,
    /// Whether the estimates have been read.
    asked: bool,
}

/// A numpy array (rows, width) that shares row-major numbers without a copy.
fn table<T: numpy::Element>(py: Python<'_>, rows: usize, values: Vec<T>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let width = values.len() / rows.max(1);
    PyArray1::from_vec(py, values).reshape([rows, width])
}

/// Runs `work` without the interpreter's lock; calls `progress(share)` at intervals, and Ctrl-C stops the work.
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

/// Runs `work` for each row without the interpreter's lock; Ctrl-C stops it.
pub fn each_row(py: Python<'_>, rows: usize, mut work: impl FnMut(usize) + Send) -> PyResult<()> {
    const ASK_EVERY: usize = 512;
    detached(py, None, |told| {
        for row in 0..rows {
            if row % ASK_EVERY == ASK_EVERY - 1 && !told(row as f64 / rows as f64) {
                return Err(Error::Stopped);
            }
            work(row);
        }
        Ok(())
    })
}

/// Tracks a recording; see `oarlock.track`.
#[pyfunction]
#[pyo3(signature = (model, recording, calibration, config, start, progress))]
pub fn track(
    py: Python<'_>,
    model: &Bound<'_, PyModel>,
    recording: &Any<'_>,
    calibration: Option<&Any<'_>>,
    config: &Bound<'_, PyConfig>,
    start: Option<&Bound<'_, PyBelief>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<PyRun> {
    let (streams, calibration) = (streams(recording)?, streams::calibration(calibration)?);
    let (model, config) = (model.get().model.clone(), config.get().0.clone());
    let start = start.map(|b| b.get().known.clone());
    let run = detached(py, progress, move |p| engine_track(model, streams, &calibration, &config, start, p))?;
    Ok(PyRun::new(run))
}

/// A recording with its calibration and configuration.
pub type Wearing<'py> = (Any<'py>, Option<Any<'py>>, Bound<'py, PyConfig>);

/// Several recordings, converted for the engine.
pub fn engine_jobs<'py>(model: &Bound<'py, PyModel>, jobs: &[Wearing<'py>], smooth: bool) -> PyResult<Vec<Job>> {
    let job = |(recording, calibration, config): &Wearing<'py>| {
        let (streams, calibration) = (streams(recording)?, streams::calibration(calibration.as_ref())?);
        let (model, config) = (model.get().model.clone(), config.get().0.clone());
        Ok(Job { model, streams, calibration, config, smooth })
    };
    jobs.iter().map(job).collect()
}

/// Tracks several recordings in parallel, each given as (recording, calibration, config); see `oarlock.track_many`.
/// Returns for each the exception that it ended with, or (run, notes, wall_s, smoothing_wall_s).
#[pyfunction]
pub fn track_many<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    jobs: Vec<Wearing<'py>>,
    smooth: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    let jobs = engine_jobs(model, &jobs, smooth)?;
    let results = detached(py, progress, move |p| engine_track_many(jobs, threads, p))?;
    each(py, results, |done| (PyRun::new(done.run), done.notes, done.wall_s, done.smoothing_wall_s).into_pyobject(py))
}

/// What Python gets of each result, or the exception.
pub fn each<'py, T>(
    py: Python<'py>,
    results: Vec<oarlock::Result<T>>,
    made: impl Fn(T) -> PyResult<Bound<'py, PyTuple>>,
) -> PyResult<Bound<'py, PyList>> {
    let out = PyList::empty(py);
    for result in results {
        match result {
            Ok(result) => out.append(made(result)?)?,
            Err(e) => out.append(raise(py, e).into_value(py))?,
        }
    }
    Ok(out)
}

impl PyRun {
    fn new(run: Run) -> Self {
        PyRun(Mutex::new(Kept { run: Arc::new(run), hollow: false, asked: false }))
    }

    fn with_kept<T>(&self, f: impl FnOnce(&mut Kept) -> T) -> T {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The run; its estimates and checkpoints may have been moved.
    fn run(&self) -> Arc<Run> {
        self.with_kept(|kept| kept.run.clone())
    }

    /// The run with its estimates.
    fn whole(&self, py: Python<'_>) -> PyResult<Arc<Run>> {
        let (run, hollow) = self.with_kept(|kept| {
            kept.asked = true;
            (kept.run.clone(), kept.hollow)
        });
        if !hollow {
            return Ok(run);
        }
        let run = Arc::new(detached(py, None, move |p| run.again(p))?);
        self.with_kept(|kept| (kept.run, kept.hollow) = (run.clone(), false));
        Ok(run)
    }

    /// The run alone, if its estimates need more than `room` bytes and have not been read.
    fn given(&self, room: usize) -> Option<Run> {
        let run = self.with_kept(|kept| {
            let gives = kept.run.series.bytes() > room
                && !kept.asked
                && !kept.run.smoothed
                && Arc::strong_count(&kept.run) == 1;
            gives.then(|| {
                kept.hollow = true;
                let hollow = Arc::new(kept.run.hollow());
                std::mem::replace(&mut kept.run, hollow)
            })
        });
        run.and_then(Arc::into_inner)
    }
}

#[pymethods]
impl PyRun {
    /// The smoothed run; see `oarlock.smooth`. Reuses the memory of estimates that need more than `room` bytes and have
    /// not been read.
    fn smooth(&self, py: Python<'_>, room: usize, progress: Option<Py<PyAny>>) -> PyResult<PyRun> {
        if let Some(run) = self.given(room) {
            return detached(py, progress, |p| run.into_smooth(p)).map(PyRun::new);
        }
        let run = self.run();
        let run = if self.with_kept(|kept| kept.hollow) { self.whole(py)? } else { run };
        detached(py, progress, |p| run.smooth(p)).map(PyRun::new)
    }

    /// Time of each row, s (T,).
    fn time_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.run().series.time_s)
    }

    /// States (T, columns) or their standard deviations; NaN where a column is None.
    fn states<'py>(
        &self,
        py: Python<'py>,
        columns: Vec<Option<usize>>,
        std: bool,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let run = self.whole(py)?;
        let (series, n) = (&run.series, run.tracker().body().layout.dim());
        let rows = if std { &series.std } else { &series.mean }.chunks_exact(n);
        let value = |row: &[f64], c: &Option<usize>| c.and_then(|i| row.get(i).copied()).unwrap_or(f64::NAN);
        let mut values = Vec::with_capacity(columns.len() * series.time_s.len());
        rows.for_each(|row| values.extend(columns.iter().map(|c| value(row, c))));
        table(py, series.time_s.len(), values)
    }

    /// The configuration with what was found from the time stamps.
    #[getter]
    fn config(&self) -> PyConfig {
        PyConfig(self.run().config().clone())
    }

    /// Coordinates of input joints, and their readings (T, inputs).
    fn inputs<'py>(&self, py: Python<'py>) -> PyResult<(Vec<usize>, Bound<'py, PyArray2<f64>>)> {
        let run = self.run();
        let readings = table(py, run.series.time_s.len(), run.series.inputs.to_vec())?;
        Ok((run.input_coordinates().to_vec(), readings))
    }

    /// Of strapdown links: frames whose links turn off the axes of their hinges, and the turns over time, rotation vectors in the frame's
    /// axes, rad (T, 3 per frame).
    fn off_axis<'py>(&self, py: Python<'py>) -> PyResult<(Vec<String>, Bound<'py, PyArray2<f64>>)> {
        let run = self.whole(py)?;
        let frames = &run.tracker().body().model.frames;
        let names = run.locked_frames().into_iter().map(|f| frames[f].name.clone()).collect();
        Ok((names, table(py, run.series.time_s.len(), run.series.off_axis.clone())?))
    }

    /// Per coordinate: 1 where it is observed (T, coordinates).
    fn observed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u8>>> {
        let run = self.whole(py)?;
        table(py, run.series.time_s.len(), run.series.observed.clone())
    }

    /// Arrays by name, per source: nis, used, rejected, missing, field, fault (T, S); inertial_nis and inertial_used (T,).
    fn infos<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let run = self.run();
        let (s, rows) = (&run.series, run.series.time_s.len());
        let out = PyDict::new(py);
        out.set_item("nis", table(py, rows, s.nis.to_vec())?)?;
        for (name, count) in [
            ("used", (|i| i.used) as fn(&Report) -> u8),
            ("rejected", |i| i.rejected),
            ("missing", |i| i.missing),
            ("field", |i| i.field as u8),
            ("fault", |i| i.fault as u8),
        ] {
            out.set_item(name, table(py, rows, s.reports.iter().map(count).collect())?)?;
        }
        let inertial: (Vec<f64>, Vec<u32>) = s.inertial.iter().copied().unzip();
        out.set_item("inertial_nis", PyArray1::from_vec(py, inertial.0))?;
        out.set_item("inertial_used", PyArray1::from_vec(py, inertial.1))?;
        Ok(out)
    }

    /// Counts of each stream's readings over all samples, in the recording's order.
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let out = PyList::empty(py);
        for count in self.run().counts() {
            let one = PyDict::new(py);
            one.set_item("name", count.name)?;
            one.set_item("channels", count.channels)?;
            one.set_item("received", count.received)?;
            one.set_item("used", count.used)?;
            one.set_item("rejected", count.rejected)?;
            one.set_item("fields", count.fields)?;
            one.set_item("faults", count.faults)?;
            out.append(one)?;
        }
        Ok(out)
    }

    /// Full state estimates, each as (time_s, mean, covariance).
    fn beliefs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        for b in self.whole(py)?.beliefs() {
            let covariance = matrix(py, &b.covariance)?;
            list.append((b.time_s, PyArray1::from_slice(py, &b.mean), covariance))?;
        }
        Ok(list)
    }

    /// State estimate after the last sample.
    #[getter]
    fn last_belief(&self) -> Option<PyBelief> {
        let names = self.state_names();
        self.run().last().map(|one| PyBelief { known: one.clone(), names })
    }

    #[getter]
    fn state_names(&self) -> Vec<String> {
        self.run().tracker().body().layout.names.clone()
    }

    #[getter]
    fn source_names(&self) -> Vec<String> {
        self.run().tracker().body().suite.sources.iter().map(|s| s.name.clone()).collect()
    }

    #[getter]
    fn notes(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let run = if self.with_kept(|kept| kept.hollow) { self.whole(py)? } else { self.run() };
        Ok(notes(&run))
    }

    #[getter]
    fn nominal_mounts(&self) -> Vec<String> {
        at_nominal_mounts(&self.run())
    }

    /// How the model was tracked: "strapdown" or "tree".
    #[getter]
    fn structure(&self) -> &'static str {
        self.run().structure().name()
    }

    #[getter]
    fn steps(&self) -> usize {
        self.run().steps
    }

    #[getter]
    fn smoothed(&self) -> bool {
        self.run().smoothed
    }
}
