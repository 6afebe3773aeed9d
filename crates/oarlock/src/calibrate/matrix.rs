//! Rotations of the engine as matrices of nalgebra, for all calibrations.

use crate::rotation::Mat3;
use nalgebra::Matrix3;
use serde::{Serialize, Serializer};

/// The same matrix in nalgebra's type.
pub(crate) fn matrix(m: &Mat3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| m.0[i][j])
}

/// The same matrix in the engine's type.
pub(crate) fn mat3(m: &Matrix3<f64>) -> Mat3<f64> {
    Mat3([0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)])))
}

/// A matrix as three rows of three.
pub(crate) fn rows<S: Serializer>(matrix: &Mat3<f64>, to: S) -> Result<S::Ok, S::Error> {
    matrix.0.serialize(to)
}
