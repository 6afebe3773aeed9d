//! SO(3) in the plainest form: power series of matrices, independent of the engine.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Cross product matrix of r.
pub fn cross(r: Vector3<f64>) -> Matrix3<f64> {
    r.cross_matrix()
}

/// Exponential of [r]: the power series of a fraction of it, then repeated squaring.
pub fn exp(r: Vector3<f64>) -> Matrix3<f64> {
    let halvings = 6;
    let small = cross(r) / f64::from(1 << halvings);
    let mut whole = series(small, |k| k as f64);
    for _ in 0..halvings {
        whole *= whole;
    }
    whole
}

/// 1 + m / d(1) + m^2 / (d(1) d(2)) + ...
fn series(m: Matrix3<f64>, divisor: impl Fn(usize) -> f64) -> Matrix3<f64> {
    let (mut term, mut sum) = (Matrix3::identity(), Matrix3::identity());
    for k in 1..40 {
        term = term * m / divisor(k);
        sum += term;
    }
    sum
}

/// Rotation vector of at most half a turn.
pub fn log(m: &Matrix3<f64>) -> Vector3<f64> {
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*m)).scaled_axis()
}

/// Integral of Exp(-s r) over s from 0 to 1: Exp(r + d) = Exp(r) Exp(J d) for small d.
pub fn right_jacobian(r: Vector3<f64>) -> Matrix3<f64> {
    series(-cross(r), |k| k as f64 + 1.0)
}

/// Rotation r followed by the rotation d in the rotated axes.
pub fn plus(r: Vector3<f64>, d: Vector3<f64>) -> Vector3<f64> {
    log(&(exp(r) * exp(d)))
}

/// The rotation from `from` to `to`, in the axes of `from`.
pub fn minus(to: Vector3<f64>, from: Vector3<f64>) -> Vector3<f64> {
    log(&(exp(from).transpose() * exp(to)))
}

/// Three numbers of a row.
pub fn three(v: &[f64], first: usize) -> Vector3<f64> {
    Vector3::new(v[first], v[first + 1], v[first + 2])
}
