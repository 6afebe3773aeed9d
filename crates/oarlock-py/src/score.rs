//! Python function that scores recordings by their innovations, for `oarlock calibrate clocks`.

use crate::model::PyModel;
use crate::run::{detached, each, engine_jobs, Wearing};
use numpy::{PyArray1, PyArrayMethods};
use oarlock::track::many::score_many as engine_score_many;
use pyo3::prelude::*;
use pyo3::types::PyList;

/// Scores several recordings in parallel, each given as (recording, calibration, config). Returns for each the
/// exception that it ended with, or (parameters with the standard deviations that are their units, windows). A window
/// is (from_s, to_s, rows, normal, right).
#[pyfunction]
pub fn score_many<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    jobs: Vec<Wearing<'py>>,
    settle_s: f64,
    window_s: f64,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyList>> {
    let jobs = engine_jobs(model, &jobs, false)?;
    let results = detached(py, progress, move |p| engine_score_many(jobs, (settle_s, window_s), threads, p))?;
    each(py, results, |score| {
        let windows = PyList::empty(py);
        for w in score.windows {
            let normal = PyArray1::from_vec(py, w.normal).reshape([score.width, score.width])?;
            windows.append((w.span_s.0, w.span_s.1, w.rows, normal, PyArray1::from_vec(py, w.right)))?;
        }
        (score.parameters, windows).into_pyobject(py)
    })
}
