//! Belief and Info.

use crate::array::items;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use oarlock::estimate::belief::{Belief, MEMORY};
use oarlock::estimate::filter::Info;
use oarlock::kernels::dense::Square;
use oarlock::track::faults::Fault;
use oarlock::track::magnetic::Field;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// What the filter believes at one instant: time, mean (n,), covariance (n, n) in `state_names` order, SI and rad.
#[pyclass(frozen, name = "Belief", module = "oarlock")]
#[derive(Clone)]
pub struct PyBelief {
    pub belief: Belief,
    pub names: Vec<String>,
}

/// A square matrix as (n, n).
pub fn matrix<'py>(py: Python<'py>, m: &Square) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, m.as_slice()).reshape([m.n(), m.n()])
}

#[pymethods]
impl PyBelief {
    // One argument for each field, as Python's pickling wants it.
    #[allow(clippy::too_many_arguments)]
    #[new]
    fn new(
        time_s: f64,
        mean: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        drive: &Bound<'_, PyAny>,
        habit: &Bound<'_, PyAny>,
        seen_s: &Bound<'_, PyAny>,
        rejected_since_s: &Bound<'_, PyAny>,
        state_names: Vec<String>,
        inflation: (f64, f64, f64, f64),
        memory: Vec<[f64; MEMORY]>,
        hypothesis: (u64, f64),
        rivals: Vec<PyRef<'_, PyBelief>>,
        doubt: Vec<f64>,
    ) -> PyResult<Self> {
        let n = state_names.len();
        let (mean, _) = items(mean, "mean", &[n])?;
        let (covariance, _) = items(covariance, "covariance", &[n, n])?;
        let seen_s = crate::array::reals(seen_s, "seen_s")?.values;
        let rejected_since_s = crate::array::reals(rejected_since_s, "rejected_since_s")?.values;
        let drive = crate::array::reals(drive, "drive")?.values;
        let habit = crate::array::reals(habit, "habit")?.values;
        let covariance = Square::from_rows(n, covariance.values)
            .ok_or_else(|| crate::errors::DataError::new_err("covariance: expected one (n, n) matrix"))?;
        let rivals = rivals.iter().map(|r| r.belief.clone()).collect();
        let ((line, score), mean) = (hypothesis, mean.values);
        let belief = Belief {
            time_s,
            mean,
            covariance,
            drive,
            usual_nis: habit,
            inflation: inflation.0,
            surprise: inflation.1,
            roughness: inflation.2,
            leftover: inflation.3,
            seen_s,
            rejected_since_s,
            memory,
            doubt,
            line,
            score,
            rivals,
        };
        Ok(PyBelief { belief, names: state_names })
    }

    #[getter]
    fn time_s(&self) -> f64 {
        self.belief.time_s
    }

    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.belief.mean)
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.belief.covariance)
    }

    /// Per driven state: factor on the variance of its driving noise, as learnt.
    #[getter]
    fn drive<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.belief.drive)
    }

    /// Per part of the measurement: usual size of its innovations, as a factor on what is expected (variance).
    #[getter]
    fn habit<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.belief.usual_nis)
    }

    /// Per sensor and closure: when it last said anything, s.
    #[getter]
    fn seen_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.belief.seen_s)
    }

    /// Per part of the measurement: since when it has been rejected without a break, s; NaN if it is not.
    #[getter]
    fn rejected_since_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.belief.rejected_since_s)
    }

    #[getter]
    fn state_names(&self) -> Vec<String> {
        self.names.clone()
    }

    /// How much larger the noise of inertial units is than the model says, and the usual size of their innovations together
    /// as a factor on what is expected (variances), as learnt.
    #[getter]
    fn inflation(&self) -> (f64, f64, f64, f64) {
        let Belief { inflation, surprise, roughness, leftover, .. } = self.belief;
        (inflation, surprise, roughness, leftover)
    }

    /// Per sensor and closure: smoothed readings by which rest is told.
    #[getter]
    fn memory(&self) -> Vec<[f64; MEMORY]> {
        self.belief.memory.clone()
    }

    /// How far what is only considered (mounts, lengths, places of units) may have led astray: a scale, learnt from the innovations, the
    /// number of parameters and of those that a calibration tells, their shifts of every state, and what the scale is learnt from. Empty
    /// where nothing is considered.
    #[getter]
    fn doubt<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.belief.doubt)
    }

    /// Standard deviations (n,), what is only considered included.
    #[getter]
    fn std<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.belief.own_spread())
    }

    /// Which hypothesis this is, and the logarithm of its likelihood against the others'.
    #[getter]
    fn hypothesis(&self) -> (u64, f64) {
        (self.belief.line, self.belief.score)
    }

    /// Other hypotheses that are still alive, each a Belief.
    #[getter]
    fn rivals(&self) -> Vec<PyBelief> {
        let alone = |b: &Belief| PyBelief { belief: b.clone(), names: self.names.clone() };
        self.belief.rivals.iter().map(alone).collect()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, b) = (slf.py(), slf.get());
        let (drive, habit, seen, since) = (b.drive(py), b.habit(py), b.seen_s(py), b.rejected_since_s(py));
        let (hypothesis, rivals) = (b.hypothesis(), b.rivals());
        let (mean, covariance, names) = (b.mean(py), b.covariance(py)?, b.names.clone());
        let parts = (
            b.belief.time_s,
            mean,
            covariance,
            drive,
            habit,
            seen,
            since,
            names,
            b.inflation(),
            b.memory(),
            hypothesis,
            rivals,
        );
        // A tuple of more than twelve in one piece cannot be made.
        let (parts, doubt) = (parts.into_pyobject(py)?, (b.belief.doubt.clone(),).into_pyobject(py)?);
        Ok((py.get_type::<Self>().into_any(), parts.as_sequence().concat(doubt.as_sequence())?.to_tuple()?))
    }

    fn __repr__(&self) -> String {
        format!("Belief(time_s={}, {} states)", self.belief.time_s, self.names.len())
    }
}

/// Report of one update.
#[pyclass(frozen, name = "Info", module = "oarlock")]
pub struct PyInfo {
    pub info: Info,
    pub time_s: f64,
    pub status: &'static str,
    pub sensor_names: Vec<String>,
    pub troubles: Vec<(Field, Fault)>,
}

#[pymethods]
impl PyInfo {
    /// Of the sample, s.
    #[getter]
    fn time_s(&self) -> f64 {
        self.time_s
    }

    /// "starting", "tracking" or "out_of_order".
    #[getter]
    fn status(&self) -> &'static str {
        self.status
    }

    /// Reading minus predicted reading, (n_measurements,), NaN where missing.
    #[getter]
    fn innovation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.info.innovation)
    }

    /// Whether the belief was given up before this update, because most of its sensors contradicted it.
    #[getter]
    fn lost(&self) -> bool {
        self.info.lost
    }

    /// Normalised innovation squared of all used rows.
    #[getter]
    fn nis(&self) -> f64 {
        self.info.nis
    }

    /// Normalised innovation squared of all used inertial readings together, and their number.
    #[getter]
    fn inertial(&self) -> (f64, usize) {
        self.info.inertial
    }

    /// By sensor and closure: nis, used, rejected, missing (rows), and what the magnetometer's reading was (`field`): missing,
    /// undisturbed, or the test it failed: norm, dip, innovation; and what was wrong with its readings (`fault`): none, clipped
    /// (at the end of the range), stuck (the same to the bit).
    #[getter]
    fn sensors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for ((name, s), (field, fault)) in self.sensor_names.iter().zip(&self.info.sources).zip(&self.troubles) {
            let one = PyDict::new(py);
            one.set_item("nis", s.nis)?;
            one.set_item("used", s.used)?;
            one.set_item("rejected", s.rejected)?;
            one.set_item("missing", s.missing)?;
            one.set_item("field", field.name())?;
            one.set_item("fault", fault.name())?;
            all.set_item(name, one)?;
        }
        Ok(all)
    }

    fn __repr__(&self) -> String {
        format!("Info(time_s={}, status='{}', nis={:.1})", self.time_s, self.status, self.info.nis)
    }
}
