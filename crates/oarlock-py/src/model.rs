//! Python class `Model`: built from text; gives names, kinematics and predicted readings.

use crate::array::items;
use crate::errors::{raise, DataError};
use numpy::{IxDyn, PyArray1, PyArrayDyn, PyArrayMethods};
use oarlock::body::Body;
use oarlock::describe::describe;
use oarlock::kinematics::{FrameMotion, JointMotion};
use oarlock::rotation::{Mat3, Vec3};
use oarlock::track::loops::readings_from;
use oarlock::track::parameter_values;
use oarlock::{Config, Model};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Frames, joints, sensors, closures and parameters of a body. Immutable.
#[pyclass(frozen, name = "Model", module = "oarlock")]
pub struct PyModel {
    pub model: Arc<Model>,
    body: Body,
    text: String,
    path: String,
    given: BTreeMap<String, f64>,
}

#[pymethods]
impl PyModel {
    /// Builds a model from a model file's text; `path` is for messages, `parameters` replace defaults.
    #[staticmethod]
    fn from_toml(py: Python<'_>, text: String, path: String, parameters: BTreeMap<String, f64>) -> PyResult<Self> {
        let mut model = Model::from_toml(&text, &path).map_err(|e| raise(py, e))?;
        let values = parameter_values(&model, &parameters).map_err(|e| raise(py, e))?;
        model.parameters.iter_mut().zip(&values).for_each(|(p, v)| p.default = *v);
        let model = Arc::new(model);
        let mounts = vec![None; model.sensors.len()];
        let config = Config::default();
        let body = Body::new(model.clone(), &values, &mounts, &config).map_err(|e| raise(py, e))?;
        Ok(PyModel { model, body, text, path, given: parameters })
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

    /// Everything in the model, as plain dictionaries and lists; numbers in SI and rad.
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let json = describe(&self.body, &self.path).to_string();
        py.import("json")?.call_method1("loads", (json,))
    }

    /// Poses of all frames: q (..., n_coordinates), rad or m -> (..., n_frames, 4, 4), world_from_frame.
    fn forward_kinematics<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let width = self.model.coordinate_count();
        let (q, rows) = items(q, "q", &[width])?;
        let tree = &self.body.tree;
        let out = py.detach(|| {
            let still = vec![0.0; width];
            let root = FrameMotion::resting(Vec3([0.0; 3]));
            let (mut frames, all) = (vec![root; tree.len()], vec![true; tree.len()]);
            let mut out = Vec::with_capacity(rows * tree.len() * 16);
            for row in 0..rows {
                let q = &q.values[row * width..(row + 1) * width];
                tree.motions(
                    root,
                    JointMotion { q, qd: &still, qdd: &still, lengths: &[], anchors: &[] },
                    &all,
                    &mut frames,
                );
                for f in &frames {
                    for (r, p) in f.rotation.0.iter().zip(f.position.0) {
                        out.extend([r[0], r[1], r[2], p]);
                    }
                    out.extend([0.0, 0.0, 0.0, 1.0]);
                }
            }
            out
        });
        let mut shape = q.shape[..q.shape.len() - 1].to_vec();
        shape.extend([self.body.tree.len(), 4, 4]);
        PyArray1::from_vec(py, out).reshape(IxDyn(&shape))
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
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        qdd: &Bound<'py, PyAny>,
        base: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let width = self.model.coordinate_count();
        let [q, qd, qdd] = [(q, "q"), (qd, "qd"), (qdd, "qdd")].map(|(a, n)| items(a, n, &[width]));
        let ((q, rows), (qd, _), (qdd, _)) = (q?, qd?, qdd?);
        if qd.shape != q.shape || qdd.shape != q.shape {
            return Err(DataError::new_err(format!(
                "q, qd, qdd have shapes {:?}, {:?}, {:?}; expected three equal ones",
                q.shape, qd.shape, qdd.shape
            )));
        }
        let bases = base.map(|b| Bases::read(b, rows)).transpose()?;
        let mut out = Vec::with_capacity(rows * self.body.suite.len());
        for row in 0..rows {
            let at = |a: &'_ [f64]| a[row * width..(row + 1) * width].to_vec();
            let (root, field) = self.root(bases.as_ref(), row);
            let (q, qd, qdd) = (at(&q.values), at(&qd.values), at(&qdd.values));
            out.extend(readings_from(&self.body, root, field, &q, &qd, &qdd));
        }
        let mut shape = q.shape[..q.shape.len() - 1].to_vec();
        shape.push(self.body.suite.len());
        PyArray1::from_vec(py, out).reshape(IxDyn(&shape))
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

/// Motion of the root: one for all rows, or one per row.
struct Bases {
    rotation: Vec<f64>,
    vectors: [Vec<f64>; 3],
    count: usize,
}

impl Bases {
    fn read(base: &Bound<'_, PyAny>, rows: usize) -> PyResult<Self> {
        let (rotation, count) = items(&base.getattr("rotation")?, "base.rotation", &[3, 3])?;
        let fields = ["angular_velocity_rad_s", "angular_acceleration_rad_s2", "acceleration_m_s2"];
        let mut vectors = [Vec::new(), Vec::new(), Vec::new()];
        for (field, out) in fields.into_iter().zip(&mut vectors) {
            let (v, n) = items(&base.getattr(field)?, &format!("base.{field}"), &[3])?;
            if n != count || (n != 1 && n != rows) {
                return Err(DataError::new_err(format!("base.{field} has {n} rows; expected 1 or {rows}")));
            }
            *out = v.values;
        }
        Ok(Bases { rotation: rotation.values, vectors, count })
    }
}

impl PyModel {
    fn root(&self, bases: Option<&Bases>, row: usize) -> (FrameMotion<f64>, Vec3<f64>) {
        let (lift, field) =
            (Vec3(self.body.field.lift), self.body.field.magnetic(self.model.world.magnetic_azimuth_rad));
        let Some(b) = bases else {
            return (FrameMotion::resting(lift), field);
        };
        let row = if b.count == 1 { 0 } else { row };
        let r = &b.rotation[9 * row..9 * row + 9];
        let world_from_root = Mat3([0, 3, 6].map(|i| [r[i], r[i + 1], r[i + 2]]));
        let [w, wd, a] = [0, 1, 2].map(|k: usize| {
            let v = &b.vectors[k][3 * row..3 * row + 3];
            Vec3([v[0], v[1], v[2]])
        });
        let mut root = FrameMotion::resting(a + world_from_root.apply_transposed(lift));
        root.angular_velocity = w;
        root.angular_acceleration = wd;
        (root, world_from_root.apply_transposed(field))
    }
}
