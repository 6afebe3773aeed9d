//! Times steps of the engine's filters and of the textbook filter on this machine. `oarlock lab bench` uses it.

use crate::config::PyConfig;
use crate::errors::{raise, DataError};
use crate::model::PyModel;
use crate::run::detached;
use crate::streams::samples;
use numpy::PyArray1;
use oarlock::track::{Calibration, Tracker};
use oarlock_oracle::race::{race as engine_race, Times};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::BTreeMap;
use std::time::Instant;

/// Times steps of each configuration and of the textbook's unscented filter in turn for `seconds`, after `warm`
/// samples. Returns `steps_us`, a list with one array per configuration; `textbook_us`, an array; `n`, the number of
/// states; `m`, the number of readings.
#[pyfunction]
pub fn race<'py>(
    py: Python<'py>,
    model: &Bound<'py, PyModel>,
    recording: &Bound<'py, PyAny>,
    configs: Vec<Bound<'py, PyConfig>>,
    warm: usize,
    seconds: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let made = |c: &Bound<'py, PyConfig>| {
        Tracker::new(model.get().model.clone(), &Calibration::default(), &c.get().0).map_err(|e| raise(py, e))
    };
    let mut trackers = configs.iter().map(made).collect::<PyResult<Vec<Tracker>>>()?;
    let (Some(first), Some(config)) = (trackers.first(), configs.first()) else {
        return Err(DataError::new_err("race: no configuration; give one at least"));
    };
    let config = config.get().0.clone();
    let all = samples(py, first, &BTreeMap::new(), &config, recording)?;
    if all.len() <= warm {
        return Err(DataError::new_err(format!(
            "race: {} samples, of which {warm} only warm up: give more",
            all.len()
        )));
    }
    let (n, m) = (first.body().layout.dim(), first.body().suite.len());
    let (before, behind) = all.split_at(warm);
    let times: Times = detached(py, None, |told| {
        for tracker in &mut trackers {
            before.iter().try_for_each(|sample| tracker.step(sample).map(|_| ()))?;
        }
        let begun = Instant::now();
        engine_race(&trackers, &config, behind, &mut || {
            let share = begun.elapsed().as_secs_f64() / seconds;
            share < 1.0 && told(share)
        })
    })?;
    let ours: Vec<_> = times.ours.into_iter().map(|us| PyArray1::from_vec(py, us)).collect();
    let out = PyDict::new(py);
    out.set_item("steps_us", ours)?;
    out.set_item("textbook_us", PyArray1::from_vec(py, times.textbook))?;
    out.set_item("n", n)?;
    out.set_item("m", m)?;
    Ok(out)
}
