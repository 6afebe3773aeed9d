//! Motions of joints and of the root and lengths, read from arrays, and poses.

use crate::array::{items, matrix_of, Any};
use crate::errors::DataError;
use crate::run::each_row;
use oarlock::kinematics::{FrameMotion, JointMotion, Tree};
use oarlock::rotation::Vec3;
use pyo3::prelude::*;

/// Joint coordinates, rates and accelerations of several instants.
pub struct Motion {
    /// Shape of the arrays without their last axis.
    pub lead: Vec<usize>,
    pub rows: usize,
    width: usize,
    values: [Vec<f64>; 3],
}

impl Motion {
    pub fn read(q: &Any<'_>, qd: &Any<'_>, qdd: &Any<'_>, width: usize) -> PyResult<Self> {
        let [q, qd, qdd] = [(q, "q"), (qd, "qd"), (qdd, "qdd")].map(|(a, n)| items(a, n, &[width]));
        let ((q, rows), (qd, _), (qdd, _)) = (q?, qd?, qdd?);
        if qd.shape != q.shape || qdd.shape != q.shape {
            return Err(DataError::new_err(format!(
                "q, qd, qdd have shapes {:?}, {:?}, {:?}; expected three equal ones",
                q.shape, qd.shape, qdd.shape
            )));
        }
        let lead = q.shape[..q.shape.len() - 1].to_vec();
        Ok(Motion { lead, rows, width, values: [q.values, qd.values, qdd.values] })
    }

    /// q, qd and qdd of one instant.
    pub fn row(&self, row: usize) -> [&[f64]; 3] {
        self.values.each_ref().map(|v| &v[row * self.width..(row + 1) * self.width])
    }
}

/// How the root moves, and what surrounds it.
pub struct Roots {
    /// None of a root at rest.
    pub bases: Option<Bases>,
    /// Opposite to gravity, m/s2, in axes of the world.
    pub lift: Vec3<f64>,
    /// uT, in axes of the world.
    pub magnetic_field: Vec3<f64>,
}

impl Roots {
    /// Motion of the root, and the magnetic field in its axes.
    pub fn at(&self, row: usize) -> (FrameMotion<f64>, Vec3<f64>) {
        let Some(b) = &self.bases else {
            return (FrameMotion::resting(self.lift), self.magnetic_field);
        };
        let row = if b.count == 1 { 0 } else { row };
        let r = &b.rotation[9 * row..9 * row + 9];
        let world_from_root = matrix_of(r);
        let [w, wd, a] = [0, 1, 2].map(|k: usize| {
            let v = &b.vectors[k][3 * row..3 * row + 3];
            Vec3([v[0], v[1], v[2]])
        });
        let mut root = FrameMotion::resting(a + world_from_root.apply_transposed(self.lift));
        root.angular_velocity = w;
        root.angular_acceleration = wd;
        (root, world_from_root.apply_transposed(self.magnetic_field))
    }
}

/// Motions of the root, one or as many as there are rows.
pub struct Bases {
    rotation: Vec<f64>,
    vectors: [Vec<f64>; 3],
    count: usize,
}

impl Bases {
    pub fn read(base: &Any<'_>, rows: usize) -> PyResult<Self> {
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

/// Lengths, one set or as many as there are rows.
pub struct Lengths {
    values: Vec<f64>,
    width: usize,
    count: usize,
}

impl Lengths {
    pub fn read(lengths: &Any<'_>, width: usize, rows: usize) -> PyResult<Self> {
        let (lengths, count) = items(lengths, "lengths", &[width])?;
        if count != 1 && count != rows {
            return Err(DataError::new_err(format!("lengths has {count} rows; expected 1 or {rows}")));
        }
        Ok(Lengths { values: lengths.values, width, count })
    }

    /// Of one row.
    pub fn at(&self, row: usize) -> &[f64] {
        let row = if self.count == 1 { 0 } else { row };
        &self.values[row * self.width..(row + 1) * self.width]
    }
}

/// Poses of all frames at every row, 16 numbers each.
pub fn poses(py: Python<'_>, tree: &Tree, q: &[f64], lengths: Option<&Lengths>, rows: usize) -> PyResult<Vec<f64>> {
    let width = q.len() / rows.max(1);
    let still = vec![0.0; width];
    let root = FrameMotion::resting(Vec3([0.0; 3]));
    let (mut frames, all) = (vec![root; tree.len()], vec![true; tree.len()]);
    let mut out = Vec::with_capacity(rows * tree.len() * 16);
    each_row(py, rows, |row| {
        let lengths = lengths.map_or(&[][..], |l| l.at(row));
        let q = &q[row * width..(row + 1) * width];
        tree.motions(root, JointMotion { q, qd: &still, qdd: &still, lengths, anchors: &[] }, &all, &mut frames);
        for f in &frames {
            for (r, p) in f.rotation.0.iter().zip(f.position.0) {
                out.extend([r[0], r[1], r[2], p]);
            }
            out.extend([0.0, 0.0, 0.0, 1.0]);
        }
    })?;
    Ok(out)
}
