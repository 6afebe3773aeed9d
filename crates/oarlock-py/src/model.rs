//! Python class `Model`: built from text; gives names, kinematics and predicted readings.

use crate::array::{items, shaped, Any, Array};
use crate::errors::{raise, DataError};
use crate::jacobian::{of_frames, of_readings};
use crate::motion::{poses, Bases, Lengths, Motion, Roots};
use crate::run::each_row;
use crate::streams;
use oarlock::body::Body;
use oarlock::describe::describe;
use oarlock::jacobian::{lengths_of, Jacobians};
use oarlock::rotation::Vec3;
use oarlock::track::loops::readings_from;
use oarlock::track::{calibrated, parameter_values};
use oarlock::{Config, Model};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// Frames, joints, sensors, closures and parameters of a body. Immutable.
#[pyclass(frozen, name = "Model", module = "oarlock")]
pub struct PyModel {
    pub model: Arc<Model>,
    body: Body,
    text: String,
    path: String,
    given: BTreeMap<String, f64>,
    /// Made when they are asked for.
    jacobians: OnceLock<Jacobians>,
}

#[pymethods]
impl PyModel {
    /// A model from a model file's text; `path` is for messages and what it extends, `parameters` replace defaults.
    #[staticmethod]
    fn from_toml(py: Python<'_>, text: String, path: String, parameters: BTreeMap<String, f64>) -> PyResult<Self> {
        let text = whole(py, text, &path)?;
        let mut model = Model::from_toml(&text, &path).map_err(|e| raise(py, e))?;
        let values = parameter_values(&model, &parameters).map_err(|e| raise(py, e))?;
        model.parameters.iter_mut().zip(&values).for_each(|(p, v)| p.default = *v);
        let body = body_of(model).map_err(|e| raise(py, e))?;
        Ok(PyModel { model: body.model.clone(), body, text, path, given: parameters, jacobians: OnceLock::new() })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.model.name
    }

    #[getter]
    fn description(&self) -> &str {
        &self.model.description
    }

    /// The model file's text.
    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    #[getter]
    fn path(&self) -> &str {
        &self.path
    }

    #[getter]
    fn parameters(&self) -> BTreeMap<String, f64> {
        self.model.parameters.iter().map(|p| (p.name.clone(), p.default)).collect()
    }

    /// Parameters that scale positions and turn nothing: the lengths of Jacobians.
    #[getter]
    fn length_names(&self) -> Vec<String> {
        lengths_of(&self.model).into_iter().map(|i| self.model.parameters[i].name.clone()).collect()
    }

    /// "strapdown" or "tree".
    #[getter]
    fn structure(&self) -> &'static str {
        oarlock::track::structure_of(&self.model).name()
    }

    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.model.joints.iter().map(|j| j.name.clone()).collect()
    }

    /// Columns of q: `trunk`, `shoulder.rx` of a rotation vector, `pelvis.x` of a position.
    #[getter]
    fn coordinate_names(&self) -> Vec<String> {
        self.model.coordinate_names()
    }

    #[getter]
    fn frame_names(&self) -> Vec<String> {
        self.model.frames.iter().map(|f| f.name.clone()).collect()
    }

    /// Indices of parents; the root's is its own.
    #[getter]
    fn frame_parents(&self) -> Vec<usize> {
        self.model.frames.iter().map(|f| f.parent).collect()
    }

    /// Positions of joints in the axes of their frames, m; zero without one.
    #[getter]
    fn joint_origins(&self) -> Vec<[f64; 3]> {
        let values = self.model.default_parameters();
        let behind = |f: &oarlock::model::Frame| {
            let (rotation, origin) = f.after.as_ref().filter(|_| f.joint.is_some())?.evaluate(&values);
            Some(rotation.transposed().apply_f64(origin.map(|x| -x)).0)
        };
        self.model.frames.iter().map(|f| behind(f).unwrap_or_default()).collect()
    }

    #[getter]
    fn sensor_names(&self) -> Vec<String> {
        self.model.sensors.iter().map(|s| s.name.clone()).collect()
    }

    #[getter]
    fn closure_names(&self) -> Vec<String> {
        self.model.closures.iter().map(|c| c.name.clone()).collect()
    }

    #[getter]
    fn measurement_names(&self) -> Vec<String> {
        self.body.suite.row_names()
    }

    /// With the default configuration.
    #[getter]
    fn state_names(&self) -> Vec<String> {
        self.body.layout.names.clone()
    }

    /// The whole model as a `ModelDescription`, SI and rad, with the values of a calibration.
    #[pyo3(signature = (calibration=None))]
    fn describe<'py>(&self, py: Python<'py>, calibration: Option<&Any<'py>>) -> PyResult<Any<'py>> {
        let json = if calibration.is_some() {
            let model = calibrated(&self.model, &streams::calibration(calibration)?);
            describe(&model.and_then(body_of).map_err(|e| raise(py, e))?, &self.path)
        } else {
            describe(&self.body, &self.path)
        };
        py.import("oarlock.model.description")?.call_method1("described", (json.to_string(),))
    }

    /// Poses (..., n_frames, 4, 4), root from frame, for q (..., n_coordinates), rad or m.
    ///
    /// `lengths` (..., n_lengths), m, are those of `length_names`; None are the model's.
    #[pyo3(signature = (q, lengths=None))]
    fn forward_kinematics<'py>(
        &self,
        py: Python<'py>,
        q: &Any<'py>,
        lengths: Option<&Any<'py>>,
    ) -> PyResult<Array<'py>> {
        let (q, rows) = items(q, "q", &[self.model.coordinate_count()])?;
        let lengths = lengths.map(|l| Lengths::read(l, self.length_names().len(), rows)).transpose()?;
        let tree = if lengths.is_some() { self.jacobians().tree() } else { &self.body.tree };
        let out = poses(py, tree, &q.values, lengths.as_ref(), rows)?;
        shaped(py, out, &q.shape[..q.shape.len() - 1], &[tree.len(), 4, 4])
    }

    /// Readings (..., n_measurements), as `measurement_names`, for q, qd, qdd (..., n_coordinates).
    ///
    /// `base` is the root's motion, an `oarlock.model.Base`; None is rest.
    #[pyo3(signature = (q, qd, qdd, base=None))]
    fn predict_measurements<'py>(
        &self,
        py: Python<'py>,
        q: &Any<'py>,
        qd: &Any<'py>,
        qdd: &Any<'py>,
        base: Option<&Any<'py>>,
    ) -> PyResult<Array<'py>> {
        let (roots, motion) = (self.roots(), Motion::read(q, qd, qdd, self.model.coordinate_count())?);
        let roots = Roots { bases: base.map(|b| Bases::read(b, motion.rows)).transpose()?, ..roots };
        let mut out = Vec::with_capacity(motion.rows * self.body.suite.len());
        each_row(py, motion.rows, |row| {
            let (root, field) = roots.at(row);
            let [q, qd, qdd] = motion.row(row);
            out.extend(readings_from(&self.body, root, field, q, qd, qdd));
        })?;
        shaped(py, out, &motion.lead, &[self.body.suite.len()])
    }

    /// Derivatives of `forward_kinematics` by coordinates and lengths, of all frames for None: a `FrameJacobian`.
    #[pyo3(signature = (q, frames=None, lengths=None))]
    fn frame_jacobian<'py>(
        &self,
        py: Python<'py>,
        q: &Any<'py>,
        frames: Option<Vec<String>>,
        lengths: Option<&Any<'py>>,
    ) -> PyResult<Any<'py>> {
        let (q, rows) = items(q, "q", &[self.model.coordinate_count()])?;
        let frames = self.frames(frames)?;
        let jacobians = self.jacobians();
        let lengths = lengths.map(|l| Lengths::read(l, jacobians.length_count(), rows)).transpose()?;
        let [by_q, by_length] = of_frames(py, jacobians, &frames, &q.values, lengths.as_ref(), rows)?;
        let lead = [&q.shape[..q.shape.len() - 1], &[frames.len()]].concat();
        let by_q = shaped(py, by_q, &lead, &[6, jacobians.coordinate_count()])?;
        let by_length = shaped(py, by_length, &lead, &[3, jacobians.length_count()])?;
        py.import("oarlock.model.jacobians")?.call_method1("FrameJacobian", (by_q, by_length))
    }

    /// Derivatives of `predict_measurements` by q, qd, qdd and lengths: a `MeasurementJacobian`.
    #[pyo3(signature = (q, qd, qdd, base=None))]
    fn measurement_jacobian<'py>(
        &self,
        py: Python<'py>,
        q: &Any<'py>,
        qd: &Any<'py>,
        qdd: &Any<'py>,
        base: Option<&Any<'py>>,
    ) -> PyResult<Any<'py>> {
        let motion = Motion::read(q, qd, qdd, self.model.coordinate_count())?;
        let bases = base.map(|b| Bases::read(b, motion.rows)).transpose()?;
        let (roots, jacobians) = (Roots { bases, ..self.roots() }, self.jacobians());
        let found = of_readings(py, jacobians, &motion, &roots)?;
        let lead = [&motion.lead[..], &[jacobians.row_count()]].concat();
        let (n, lengths) = (jacobians.coordinate_count(), jacobians.length_count());
        let arrays = found.into_iter().zip([n, n, n, lengths]).map(|(v, width)| shaped(py, v, &lead, &[width]));
        let arrays = PyTuple::new(py, arrays.collect::<PyResult<Vec<_>>>()?)?;
        py.import("oarlock.model.jacobians")?.getattr("MeasurementJacobian")?.call1(arrays)
    }

    /// The model with other parameters, m or rad.
    #[pyo3(signature = (values=None, **named))]
    fn with_parameters<'py>(
        slf: &Bound<'py, Self>,
        values: Option<&Any<'py>>,
        named: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Any<'py>> {
        let all = named.map_or_else(|| Ok(PyDict::new(slf.py())), |n| n.copy())?;
        if let Some(values) = values {
            all.call_method1("update", (values,))?;
        }
        edit(slf, "with_parameters", all.as_any())
    }

    /// The model with tables added or changed, as in a file that `extends` it: `{"joint": [{"name": "trunk", ...}]}`.
    fn with_tables<'py>(slf: &Bound<'py, Self>, changes: &Any<'py>) -> PyResult<Any<'py>> {
        edit(slf, "with_tables", changes)
    }

    /// The model with this joint, new or changed.
    #[pyo3(signature = (name, **keys))]
    fn with_joint<'py>(slf: &Bound<'py, Self>, name: &str, keys: Option<&Bound<'py, PyDict>>) -> PyResult<Any<'py>> {
        with_one(slf, "joint", name, keys)
    }

    /// The model with this frame, new or changed.
    #[pyo3(signature = (name, **keys))]
    fn with_frame<'py>(slf: &Bound<'py, Self>, name: &str, keys: Option<&Bound<'py, PyDict>>) -> PyResult<Any<'py>> {
        with_one(slf, "frame", name, keys)
    }

    /// The model with this sensor, new or changed.
    #[pyo3(signature = (name, **keys))]
    fn with_sensor<'py>(slf: &Bound<'py, Self>, name: &str, keys: Option<&Bound<'py, PyDict>>) -> PyResult<Any<'py>> {
        with_one(slf, "sensor", name, keys)
    }

    /// The model with this closure, new or changed.
    #[pyo3(signature = (name, **keys))]
    fn with_closure<'py>(slf: &Bound<'py, Self>, name: &str, keys: Option<&Bound<'py, PyDict>>) -> PyResult<Any<'py>> {
        with_one(slf, "closure", name, keys)
    }

    /// The model with these sensors only. A body that moves freely, without closures, is cut to the part that they
    /// measure.
    fn with_units<'py>(slf: &Bound<'py, Self>, names: &Any<'py>) -> PyResult<Any<'py>> {
        slf.py().import("oarlock.model.part")?.call_method1("with_units", (slf, names))
    }

    /// The model without these. With a joint go the frames that it moves, with a frame all that hangs on it.
    #[pyo3(signature = (*, joints=None, frames=None, sensors=None, closures=None, base_accelerations=None))]
    fn without<'py>(
        slf: &Bound<'py, Self>,
        joints: Option<&Any<'py>>,
        frames: Option<&Any<'py>>,
        sensors: Option<&Any<'py>>,
        closures: Option<&Any<'py>>,
        base_accelerations: Option<&Any<'py>>,
    ) -> PyResult<Any<'py>> {
        let kinds = ["joint", "frame", "sensor", "closure", "base_acceleration"];
        let names = PyDict::new(slf.py());
        for (kind, given) in kinds.into_iter().zip([joints, frames, sensors, closures, base_accelerations]) {
            if let Some(given) = given {
                names.set_item(kind, PyList::new(slf.py(), given.try_iter()?.collect::<PyResult<Vec<_>>>()?)?)?;
            }
        }
        edit(slf, "without", names.as_any())
    }

    fn __repr__(&self) -> String {
        let m = &self.model;
        format!(
            "Model('{}': {} frames, {} joints, {} sensors, {} closures)",
            m.name,
            m.frames.len(),
            m.joints.len(),
            m.sensors.len(),
            m.closures.len()
        )
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let make = slf.py().import("oarlock")?.getattr("Model")?.getattr("from_toml")?;
        let m = slf.get();
        (make, (m.text.clone(), m.path.clone(), m.given.clone())).into_pyobject(slf.py())
    }
}

/// The model as a system, with its own values.
fn body_of(model: Model) -> oarlock::Result<Body> {
    let (values, mounts) = (model.default_parameters(), vec![None; model.sensors.len()]);
    Body::new(Arc::new(model), &values, &mounts, &Config::default())
}

/// The text with all that it extends put in.
fn whole(py: Python<'_>, text: String, path: &str) -> PyResult<String> {
    if !text.contains("extends") {
        return Ok(text);
    }
    let path = py.import("pathlib")?.call_method1("Path", (path,))?;
    py.import("oarlock.model.extends")?.call_method1("model_file", (path, text))?.getattr("text")?.extract()
}

/// What a function of `oarlock.model.edit` makes of the model.
fn edit<'py>(model: &Bound<'py, PyModel>, function: &str, change: &Any<'py>) -> PyResult<Any<'py>> {
    model.py().import("oarlock.model.edit")?.call_method1(function, (model, change))
}

fn with_one<'py>(
    model: &Bound<'py, PyModel>,
    kind: &str,
    name: &str,
    keys: Option<&Bound<'py, PyDict>>,
) -> PyResult<Any<'py>> {
    let py = model.py();
    let table = keys.map_or_else(|| Ok(PyDict::new(py)), |k| k.copy())?;
    table.set_item("name", name)?;
    let changes = PyDict::new(py);
    changes.set_item(kind, PyList::new(py, [table])?)?;
    edit(model, "with_tables", changes.as_any())
}

impl PyModel {
    fn jacobians(&self) -> &Jacobians {
        self.jacobians.get_or_init(|| Jacobians::new(&self.model, &self.body.parameters))
    }

    fn roots(&self) -> Roots {
        let field = self.body.field;
        let magnetic_field = field.magnetic(self.model.world.magnetic_azimuth_rad);
        Roots { bases: None, lift: Vec3(field.lift), magnetic_field }
    }

    /// Indices of the named frames, of all for none.
    fn frames(&self, names: Option<Vec<String>>) -> PyResult<Vec<usize>> {
        let known = &self.model.frames;
        let Some(names) = names else {
            return Ok((0..known.len()).collect());
        };
        let find = |name: &String| known.iter().position(|f| f.name == *name).ok_or_else(|| self.unknown_frame(name));
        names.iter().map(find).collect()
    }

    fn unknown_frame(&self, name: &str) -> PyErr {
        let known: Vec<_> = self.model.frames.iter().map(|f| f.name.as_str()).collect();
        DataError::new_err(format!(
            "frames: model '{}' has no frame '{name}'; it has: {}",
            self.model.name,
            known.join(", ")
        ))
    }
}
