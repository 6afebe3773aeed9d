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
    /// Builds a model from a model file's text; `path` is for messages and for what it extends, `parameters` replace
    /// defaults.
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

    /// Parameters from which places follow in proportion and no rotation does: the columns of lengths in Jacobians.
    #[getter]
    fn length_names(&self) -> Vec<String> {
        lengths_of(&self.model).into_iter().map(|i| self.model.parameters[i].name.clone()).collect()
    }

    /// How the model is tracked: "strapdown" or "tree".
    #[getter]
    fn structure(&self) -> &'static str {
        match oarlock::track::structure_of(&self.model) {
            oarlock::model::Structure::Strapdown => "strapdown",
            oarlock::model::Structure::Tree => "tree",
        }
    }

    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.model.joints.iter().map(|j| j.name.clone()).collect()
    }

    /// Names of the coordinates, the columns of q: a joint's own name, `shoulder.rx` for a rotation vector, `pelvis.x`
    /// for a position.
    #[getter]
    fn coordinate_names(&self) -> Vec<String> {
        self.model.coordinate_names()
    }

    #[getter]
    fn frame_names(&self) -> Vec<String> {
        self.model.frames.iter().map(|f| f.name.clone()).collect()
    }

    /// Index of every frame's parent; that of the root is its own.
    #[getter]
    fn frame_parents(&self) -> Vec<usize> {
        self.model.frames.iter().map(|f| f.parent).collect()
    }

    /// Position of every frame's joint in the frame's axes, m; zero without one.
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

    /// Names of the states with the default configuration.
    #[getter]
    fn state_names(&self) -> Vec<String> {
        self.body.layout.names.clone()
    }

    /// Everything in the model as a `ModelDescription`, with the values of a calibration if one is given; numbers in SI
    /// and rad.
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

    /// Poses of all frames: q (..., n_coordinates), rad or m -> (..., n_frames, 4, 4), root from frame.
    ///
    /// `lengths` (..., n_lengths), m, in the order of `length_names`: of all rows or of each; None are the model's.
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

    /// Predicted readings, (..., n_measurements) in the order of `measurement_names`, for q, qd, qdd
    /// (..., n_coordinates).
    ///
    /// `base` is the motion of the root: an object with `rotation` (..., 3, 3), world from root, and
    /// `angular_velocity_rad_s`, `angular_acceleration_rad_s2`, `acceleration_m_s2` (..., 3) in root axes. None is a
    /// root at rest. `acceleration` is the coordinate acceleration of the root's origin, without gravity.
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

    /// How frames move with every coordinate and every length: q (..., n_coordinates), rad or m -> `FrameJacobian` of
    /// the named frames, of all for None. `lengths` as for `forward_kinematics`.
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

    /// How predicted readings change with every coordinate, rate, acceleration and length: arguments as those of
    /// `predict_measurements` -> `MeasurementJacobian`.
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

    /// The model with other values of its parameters, by name, m or rad.
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

    /// The model with tables added or changed: kinds ("joint", "frame", "sensor", "closure", "base_acceleration") to lists of
    /// dictionaries with the keys of model files, found by their `name`; other keys are those of a file that `extends` this one.
    fn with_tables<'py>(slf: &Bound<'py, Self>, changes: &Any<'py>) -> PyResult<Any<'py>> {
        edit(slf, "with_tables", changes)
    }

    /// The model with this joint, a new one or with these keys changed.
    #[pyo3(signature = (name, **keys))]
    fn with_joint<'py>(slf: &Bound<'py, Self>, name: &str, keys: Option<&Bound<'py, PyDict>>) -> PyResult<Any<'py>> {
        with_one(slf, "joint", name, keys)
    }

    /// The model with this frame, a new one or with these keys changed.
    #[pyo3(signature = (name, **keys))]
    fn with_frame<'py>(slf: &Bound<'py, Self>, name: &str, keys: Option<&Bound<'py, PyDict>>) -> PyResult<Any<'py>> {
        with_one(slf, "frame", name, keys)
    }

    /// The model with this sensor, a new one or with these keys changed.
    #[pyo3(signature = (name, **keys))]
    fn with_sensor<'py>(slf: &Bound<'py, Self>, name: &str, keys: Option<&Bound<'py, PyDict>>) -> PyResult<Any<'py>> {
        with_one(slf, "sensor", name, keys)
    }

    /// The model with this closure, a new one or with these keys changed.
    #[pyo3(signature = (name, **keys))]
    fn with_closure<'py>(slf: &Bound<'py, Self>, name: &str, keys: Option<&Bound<'py, PyDict>>) -> PyResult<Any<'py>> {
        with_one(slf, "closure", name, keys)
    }

    /// The model with these sensors only. If the body moves freely and nothing closes a loop, the part that they measure is cut
    /// out: joints that lie before or beyond all of them go. Otherwise the other sensors go and every joint stays.
    fn with_units<'py>(slf: &Bound<'py, Self>, names: &Any<'py>) -> PyResult<Any<'py>> {
        slf.py().import("oarlock.model.part")?.call_method1("with_units", (slf, names))
    }

    /// The model without these joints, frames, sensors, closures and base accelerations, by name. With a joint go the frames
    /// that it moves, with a frame all that hangs on it: frames, sensors and closures.
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
