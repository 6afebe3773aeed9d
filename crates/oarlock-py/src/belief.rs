//! Python classes `Belief` (state estimate) and `Info` (report of an update).

use crate::array::{items, Any};
use crate::errors::DataError;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use oarlock::estimate::belief::Belief;
use oarlock::estimate::filter::Info;
use oarlock::kernels::dense::Square;
use oarlock::track::faults::Fault;
use oarlock::track::hypothesis::{Hypothesis, SourceMemory, MEMORY};
use oarlock::track::magnetic::Field;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// State estimate at one time: mean (n,), covariance (n, n), as `state_names`, SI and rad.
#[pyclass(frozen, name = "Belief", module = "oarlock")]
#[derive(Clone)]
pub struct PyBelief {
    pub known: Hypothesis,
    pub names: Vec<String>,
}

/// A square matrix as (n, n).
pub fn matrix<'py>(py: Python<'py>, m: &Square) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, m.as_slice()).reshape([m.n(), m.n()])
}

#[pymethods]
impl PyBelief {
    // One argument per field, as pickling requires.
    #[allow(clippy::too_many_arguments)]
    #[new]
    fn new(
        time_s: f64,
        mean: &Any<'_>,
        covariance: &Any<'_>,
        seen_s: &Any<'_>,
        rejected_since_s: &Any<'_>,
        state_names: Vec<String>,
        memory: Vec<Vec<f64>>,
        hypothesis: (u64, f64),
        rivals: Vec<PyRef<'_, PyBelief>>,
        links: &Any<'_>,
    ) -> PyResult<Self> {
        let n = state_names.len();
        let (mean, _) = items(mean, "mean", &[n])?;
        let (covariance, _) = items(covariance, "covariance", &[n, n])?;
        let seen_s = crate::array::reals(seen_s, "seen_s")?.values;
        let rejected_since_s = crate::array::reals(rejected_since_s, "rejected_since_s")?.values;
        let covariance = Square::from_rows(n, covariance.values)
            .ok_or_else(|| DataError::new_err("covariance: expected one (n, n) matrix"))?;
        if seen_s.len() != memory.len() {
            let (seen, kept) = (seen_s.len(), memory.len());
            return Err(DataError::new_err(format!("memory: {kept} sources, but {seen} in seen_s; expected as many")));
        }
        let sources =
            seen_s.iter().zip(&memory).map(|(&seen_s, flat)| source_from(seen_s, flat)).collect::<PyResult<_>>()?;
        let belief = Belief { time_s, mean: mean.values, covariance, rejected_since_s };
        let rivals = rivals.iter().map(|r| r.known.clone()).collect();
        let (line, score) = hypothesis;
        let mut known = Hypothesis::new(belief, 0);
        (known.sources, known.rivals) = (sources, rivals);
        (known.line, known.score) = (line, score);
        let known = known.with_links(&crate::array::reals(links, "links")?.values).ok_or_else(|| {
            DataError::new_err("links: numbers that this version of Oarlock does not read; read it with the version that wrote it, or track again")
        })?;
        Ok(PyBelief { known, names: state_names })
    }

    /// One joint: `belief["elbow"].angle_deg`.
    fn __getitem__<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Any<'py>> {
        slf.py().import("oarlock.tracking.joint_state")?.call_method1("joint_state", (slf, name))
    }

    /// Names of the joints.
    fn keys<'py>(slf: &Bound<'py, Self>) -> PyResult<Any<'py>> {
        slf.py().import("oarlock.tracking.joint_state")?.call_method1("joint_names", (slf,))
    }

    fn __contains__(slf: &Bound<'_, Self>, name: &str) -> PyResult<bool> {
        Self::keys(slf)?.contains(name)
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Any<'py>> {
        Ok(Self::keys(slf)?.try_iter()?.into_any())
    }

    #[getter]
    fn time_s(&self) -> f64 {
        self.known.belief.time_s
    }

    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.known.belief.mean)
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.known.belief.covariance)
    }

    /// Last reading of each sensor and closure, s.
    #[getter]
    fn seen_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.known.sources.iter().map(|s| s.seen_s).collect())
    }

    /// Start of each part's rejection, s, or NaN.
    #[getter]
    fn rejected_since_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.known.belief.rejected_since_s)
    }

    #[getter]
    fn state_names(&self) -> Vec<String> {
        self.names.clone()
    }

    /// Memory of each sensor and closure, to detect rest and faults.
    #[getter]
    fn memory(&self) -> Vec<[f64; MEMORY]> {
        self.known.sources.iter().map(|s| s.to_flat()).collect()
    }

    /// State of the filter of strapdown links.
    #[getter]
    fn links<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.known.flat_links())
    }

    /// Standard deviations (n,).
    #[getter]
    fn std<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.known.own_spread())
    }

    /// Number of this hypothesis, and its log-likelihood relative to the others.
    #[getter]
    fn hypothesis(&self) -> (u64, f64) {
        (self.known.line, self.known.score)
    }

    /// Other hypotheses, each a Belief.
    #[getter]
    fn rivals(&self) -> Vec<PyBelief> {
        let alone = |one: &Hypothesis| PyBelief { known: one.clone(), names: self.names.clone() };
        self.known.rivals.iter().map(alone).collect()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Any<'py>, Bound<'py, PyTuple>)> {
        let (py, b) = (slf.py(), slf.get());
        let (seen, since) = (b.seen_s(py), b.rejected_since_s(py));
        let (hypothesis, rivals) = (b.hypothesis(), b.rivals());
        let (mean, covariance, names) = (b.mean(py), b.covariance(py)?, b.names.clone());
        let parts = (b.known.belief.time_s, mean, covariance, seen, since, names, b.memory(), hypothesis, rivals);
        // PyO3 converts tuples of at most twelve elements.
        let (parts, links) = (parts.into_pyobject(py)?, (b.links(py),).into_pyobject(py)?);
        Ok((py.get_type::<Self>().into_any(), parts.as_sequence().concat(links.as_sequence())?.to_tuple()?))
    }

    fn __repr__(&self) -> String {
        format!("Belief(time_s={}, {} states)", self.known.belief.time_s, self.names.len())
    }
}

/// The memory of a source.
fn source_from(seen_s: f64, flat: &[f64]) -> PyResult<SourceMemory> {
    let numbers = flat.try_into().map_err(|_| {
        let count = flat.len();
        DataError::new_err(format!(
            "memory: {count} numbers of a source, but this version of Oarlock has {MEMORY}; read it with the version that wrote it, or track again"
        ))
    })?;
    Ok(SourceMemory::from_flat(seen_s, numbers))
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
    /// Time of the sample, s.
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

    /// Whether most sensors contradicted the estimate, so that the filter was reset.
    #[getter]
    fn lost(&self) -> bool {
        self.info.lost
    }

    /// Normalised innovation squared of all used rows.
    #[getter]
    fn nis(&self) -> f64 {
        self.info.nis
    }

    /// `nis` of inertial readings, and their number.
    #[getter]
    fn inertial(&self) -> (f64, usize) {
        self.info.inertial
    }

    /// By sensor and closure: nis; used, rejected and missing rows; `field`: missing, undisturbed, norm, dip or
    /// innovation; `fault`: none, clipped or stuck.
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
