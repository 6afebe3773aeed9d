//! Fixed transforms between frames, as expressions of the parameters.

use super::expr::Expr;
use crate::rotation::Mat3;

/// A fixed transform, parent from child; its entries may be expressions of the parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum Transform {
    /// A rotation and a translation, given separately.
    Fixed {
        /// Parent from child.
        rotation: RotationExpr,
        /// Child's origin in the parent, m.
        translation: [Expr; 3],
    },
    /// A row of classical Denavit-Hartenberg: Rz(theta) Tz(d) Tx(a) Rx(alpha).
    Dh {
        /// Along the new x, m.
        a: Expr,
        /// About the new x, rad.
        alpha: Expr,
        /// Along the parent's z, m.
        d: Expr,
        /// About the parent's z, rad.
        theta: Expr,
    },
}

/// Form of the rotation in a fixed transform.
#[derive(Debug, Clone, PartialEq)]
pub enum RotationExpr {
    /// No rotation.
    Identity,
    /// Nine entries, row-major; checked to be a rotation at the default parameters.
    Matrix([[Expr; 3]; 3]),
    /// Rz(yaw) Ry(pitch) Rx(roll), rad, in the order roll, pitch, yaw.
    Rpy([Expr; 3]),
    /// Plain numbers.
    Numeric(Mat3<f64>),
    /// The first, then the second: a joint's axis rotated onto z.
    Turned(Box<RotationExpr>, Mat3<f64>),
}

impl Transform {
    /// No motion.
    pub fn identity() -> Self {
        Transform::Fixed { rotation: RotationExpr::Identity, translation: [0.0; 3].map(Expr::constant) }
    }

    /// A rotation alone.
    pub fn turn(rotation: Mat3<f64>) -> Self {
        Transform::Fixed { rotation: RotationExpr::Numeric(rotation), translation: [0.0; 3].map(Expr::constant) }
    }

    /// Parent-from-child rotation and the child's origin in the parent (m) at these parameters.
    pub fn evaluate(&self, parameters: &[f64]) -> (Mat3<f64>, [f64; 3]) {
        match self {
            Transform::Fixed { rotation, translation } => {
                (rotation.evaluate(parameters), evaluate_three(translation, parameters))
            }
            Transform::Dh { a, alpha, d, theta } => {
                let [a, alpha, d, theta] = [a, alpha, d, theta].map(|e| e.eval(parameters));
                let (s, c) = theta.sin_cos();
                let rotation = Mat3::about_z(theta).times(&Mat3::about_x(alpha));
                (rotation, [a * c, a * s, d])
            }
        }
    }
}

impl Transform {
    /// Parameters that the rotation reads.
    pub fn turned_by(&self) -> Vec<usize> {
        match self {
            Transform::Fixed { rotation, .. } => rotation.parameters(),
            Transform::Dh { alpha, theta, .. } => alpha.parameters().chain(theta.parameters()).collect(),
        }
    }

    /// Parameters that the translation reads, apart from those that turn it.
    pub fn moved_by(&self) -> Vec<usize> {
        match self {
            Transform::Fixed { translation, .. } => translation.iter().flat_map(Expr::parameters).collect(),
            Transform::Dh { a, d, .. } => a.parameters().chain(d.parameters()).collect(),
        }
    }
}

impl RotationExpr {
    fn parameters(&self) -> Vec<usize> {
        match self {
            RotationExpr::Identity | RotationExpr::Numeric(_) => Vec::new(),
            RotationExpr::Matrix(rows) => rows.iter().flatten().flat_map(Expr::parameters).collect(),
            RotationExpr::Rpy(angles) => angles.iter().flat_map(Expr::parameters).collect(),
            RotationExpr::Turned(first, _) => first.parameters(),
        }
    }

    /// Parent from child at these parameters.
    pub fn evaluate(&self, parameters: &[f64]) -> Mat3<f64> {
        match self {
            RotationExpr::Identity => Mat3::identity(),
            RotationExpr::Matrix(rows) => Mat3([0, 1, 2].map(|i| evaluate_three(&rows[i], parameters))),
            RotationExpr::Rpy(angles) => {
                let [roll, pitch, yaw] = evaluate_three(angles, parameters);
                Mat3::about_z(yaw).times(&Mat3::about_y(pitch)).times(&Mat3::about_x(roll))
            }
            RotationExpr::Numeric(m) => *m,
            RotationExpr::Turned(first, then) => first.evaluate(parameters).times(then),
        }
    }
}

/// Three expressions at once: a point or a row.
pub fn evaluate_three(v: &[Expr; 3], parameters: &[f64]) -> [f64; 3] {
    [0, 1, 2].map(|i| v[i].eval(parameters))
}

/// The smallest rotation from z to the unit vector `axis`.
pub(super) fn z_onto(axis: [f64; 3]) -> Mat3<f64> {
    let [x, y, z] = axis;
    if z < -1.0 + 1e-12 {
        return Mat3([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
    }
    let k = 1.0 / (1.0 + z);
    Mat3([[1.0 - k * x * x, -k * x * y, x], [-k * x * y, 1.0 - k * y * y, y], [-x, -y, z]])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few roundings of numbers near 1.
    const ROUNDING: f64 = 1e-14;

    #[test]
    fn z_is_turned_onto_any_axis() {
        for axis in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.48, -0.6, -0.64]] {
            let turn = z_onto(axis);
            let (defect, det) = turn.rotation_defect();
            assert!(defect < ROUNDING && (det - 1.0).abs() < ROUNDING, "{axis:?}: {defect}, {det}");
            for (found, wanted) in turn.column(2).0.iter().zip(axis) {
                assert!((found - wanted).abs() < ROUNDING, "{axis:?}");
            }
        }
    }

    #[test]
    fn row_equals_its_product_of_four() {
        let (a, alpha, d, theta) = (0.3, -0.7, 0.2, 1.1);
        let row = Transform::Dh {
            a: Expr::constant(a),
            alpha: Expr::constant(alpha),
            d: Expr::constant(d),
            theta: Expr::constant(theta),
        };
        let (rotation, origin) = row.evaluate(&[]);
        let along_x = Mat3::about_z(theta).apply_f64([a, 0.0, 0.0]).0;
        assert_eq!(rotation, Mat3::about_z(theta).times(&Mat3::about_x(alpha)));
        assert_eq!(origin, [along_x[0], along_x[1], d]);
    }
}
