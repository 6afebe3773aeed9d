//! SO(3): unit quaternions, rotation vectors and their derivatives.
//!
//! The derivatives are the right and left Jacobians of Sola, Deray and Atchuthan (2018, eqs. 143 to 146).

use super::Mat3;
use std::f64::consts::PI;

/// A unit quaternion, scalar first: rotation from child to parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn(pub [f64; 4]);

/// Below this angle (rad) series are used; their next term is below rounding.
const SMALL: f64 = 1e-2;

impl Turn {
    /// The identity.
    pub const NONE: Turn = Turn([1.0, 0.0, 0.0, 0.0]);

    /// Rotation about `r` by its length, rad.
    pub fn exp(r: [f64; 3]) -> Self {
        let angle = norm(r);
        let half = 0.5 * angle;
        let s =
            if angle < SMALL { 0.5 - angle * angle / 48.0 * (1.0 - angle * angle / 80.0) } else { half.sin() / angle };
        Turn([half.cos(), s * r[0], s * r[1], s * r[2]])
    }

    /// From a rotation matrix: the largest of four forms avoids the square root of a small difference (Shepperd 1978).
    pub fn of(m: &Mat3<f64>) -> Self {
        let [[a, b, c], [d, e, f], [g, h, i]] = m.0;
        let all = [1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i];
        let largest = (1..4).fold(0, |best, k| if all[k] > all[best] { k } else { best });
        let four = match largest {
            0 => [all[0], h - f, c - g, d - b],
            1 => [h - f, all[1], d + b, c + g],
            2 => [c - g, d + b, all[2], h + f],
            _ => [d - b, c + g, h + f, all[3]],
        };
        let scale = 0.5 / all[largest].sqrt();
        Turn(four.map(|x| scale * x))
    }

    /// Rotation vector, at most half a turn long.
    pub fn log(&self) -> [f64; 3] {
        let [w, x, y, z] = if self.0[0] < 0.0 { self.0.map(|c| -c) } else { self.0 };
        let sin = norm([x, y, z]);
        let half = sin.atan2(w);
        let scale = if sin < 1e-12 { 2.0 } else { 2.0 * half / sin };
        [scale * x, scale * y, scale * z]
    }

    /// Product: `o` first, then this rotation.
    pub fn times(&self, o: &Self) -> Self {
        let ([a, b, c, d], [w, x, y, z]) = (self.0, o.0);
        let product = [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ];
        let length = product.iter().map(|p| p * p).sum::<f64>().sqrt();
        Turn(product.map(|p| p / length))
    }

    /// The inverse.
    pub fn inverse(&self) -> Self {
        let [w, x, y, z] = self.0;
        Turn([w, -x, -y, -z])
    }

    /// The rotation matrix, parent from child.
    pub fn matrix(&self) -> Mat3<f64> {
        let [w, x, y, z] = self.0;
        Mat3([
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ])
    }
}

/// Length of a vector.
pub fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Rotation vector of `r` (rad) followed by the rotation `delta` in the rotated axes.
pub fn plus(r: [f64; 3], delta: [f64; 3]) -> [f64; 3] {
    Turn::exp(r).times(&Turn::exp(delta)).log()
}

/// The rotation, in the axes of `from`, from there to `to`.
pub fn minus(to: [f64; 3], from: [f64; 3]) -> [f64; 3] {
    Turn::exp(from).inverse().times(&Turn::exp(to)).log()
}

/// 1 + a [r] + b [r]^2.
fn series(r: [f64; 3], a: f64, b: f64) -> Mat3<f64> {
    let [x, y, z] = r;
    let square = |i: usize, j: usize| r[i] * r[j];
    let n = x * x + y * y + z * z;
    let mut m = Mat3([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]);
    for (i, row) in m.0.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            let one = f64::from(i == j);
            *entry = one + a * *entry + b * (square(i, j) - n * one);
        }
    }
    m
}

/// Exp(r + d) = Exp(r) Exp(J d) for small d.
pub fn right_jacobian(r: [f64; 3]) -> Mat3<f64> {
    let angle = norm(r);
    let t2 = angle * angle;
    if angle < SMALL {
        return series(r, -0.5 + t2 / 24.0 * (1.0 - t2 / 30.0), 1.0 / 6.0 - t2 / 120.0 * (1.0 - t2 / 42.0));
    }
    let half = (0.5 * angle).sin();
    series(r, -2.0 * half * half / t2, (angle - angle.sin()) / (t2 * angle))
}

/// Inverse of [`right_jacobian`]; `r` at most half a turn long.
pub fn right_jacobian_inverse(r: [f64; 3]) -> Mat3<f64> {
    let angle = norm(r);
    let t2 = angle * angle;
    let b = if angle < SMALL {
        1.0 / 12.0 + t2 / 720.0 * (1.0 + t2 / 42.0)
    } else {
        let (sin, cos) = angle.min(PI).sin_cos();
        (1.0 - 0.5 * angle * sin / (1.0 - cos)) / t2
    };
    series(r, 0.5, b)
}

/// Inverse of the left Jacobian: that of the right one at -r.
pub fn left_jacobian_inverse(r: [f64; 3]) -> Mat3<f64> {
    right_jacobian_inverse(r.map(|x| -x))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angles that include the difficult cases: zero, tiny ones, the limit of the series, and half a turn.
    const ANGLES: [f64; 10] = [0.0, 1e-9, 1e-6, 1e-3, 0.99e-2, 1.01e-2, 0.7, 2.0, PI - 1e-9, PI];
    const AXES: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [0.48, -0.6, 0.64]];
    /// A few roundings.
    const ROUNDING: f64 = 1e-12;

    fn sweep() -> impl Iterator<Item = [f64; 3]> {
        AXES.into_iter().flat_map(|a| ANGLES.map(|angle| a.map(|x| x * angle)))
    }

    fn far(a: &Mat3<f64>, b: &Mat3<f64>) -> f64 {
        a.0.iter().flatten().zip(b.0.iter().flatten()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
    }

    /// Each of the four forms is the largest one somewhere.
    #[test]
    fn a_matrix_is_read_back_as_its_rotation() {
        for r in AXES.iter().flat_map(|axis| ANGLES.map(|angle| axis.map(|x| angle * x))) {
            let (given, found) = (Turn::exp(r).0, Turn::of(&Turn::exp(r).matrix()).0);
            let sign = if given.iter().zip(&found).map(|(a, b)| a * b).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
            assert!(given.iter().zip(&found).all(|(a, b)| (a - sign * b).abs() < 1e-14), "{r:?}: {found:?}");
        }
    }

    #[test]
    fn logarithm_undoes_the_exponential() {
        for r in sweep() {
            let back = Turn::exp(r).log();
            // At half a turn both signs are the same rotation.
            assert!(far(&Turn::exp(back).matrix(), &Turn::exp(r).matrix()) < ROUNDING, "{r:?} {back:?}");
            if norm(r) < 3.0 {
                assert!(back.iter().zip(r).all(|(x, y)| (x - y).abs() < ROUNDING), "{r:?} {back:?}");
            }
        }
    }

    #[test]
    fn exponential_is_rodrigues() {
        for r in sweep() {
            let angle = norm(r);
            let (a, b) = if angle == 0.0 {
                (1.0, 0.5)
            } else {
                (angle.sin() / angle, 2.0 * (0.5 * angle).sin().powi(2) / angle.powi(2))
            };
            let direct = series(r, a, b);
            assert!(far(&direct, &Turn::exp(r).matrix()) < ROUNDING, "{r:?}");
        }
    }

    #[test]
    fn group_laws_hold() {
        for (r, s) in sweep().zip(sweep().skip(7)) {
            let (a, b) = (Turn::exp(r), Turn::exp(s));
            assert!(far(&a.times(&b).matrix(), &a.matrix().times(&b.matrix())) < ROUNDING);
            assert!(far(&a.times(&a.inverse()).matrix(), &Mat3::identity()) < ROUNDING);
            let there = Turn::exp(plus(r, minus(s, r)));
            assert!(far(&there.matrix(), &b.matrix()) < 1e-11);
        }
    }

    #[test]
    fn right_jacobian_is_the_derivative_of_the_exponential() {
        let h = 1e-6;
        for r in sweep().filter(|r| norm(*r) < 3.0) {
            let j = right_jacobian(r);
            for k in 0..3 {
                let mut d = [0.0; 3];
                d[k] = h;
                let sum = |s: f64| [0, 1, 2].map(|i| r[i] + s * d[i]);
                let (up, down) = (minus(sum(1.0), r), minus(sum(-1.0), r));
                for i in 0..3 {
                    let slope = (up[i] - down[i]) / (2.0 * h);
                    assert!((slope - j.0[i][k]).abs() < 1e-8, "{r:?} {i}{k}: {slope} {}", j.0[i][k]);
                }
            }
        }
    }

    #[test]
    fn jacobians_undo_each_other() {
        for r in sweep() {
            assert!(far(&right_jacobian(r).times(&right_jacobian_inverse(r)), &Mat3::identity()) < 1e-11, "{r:?}");
            let (left, turned) = (left_jacobian_inverse(r), Turn::exp(r).matrix());
            assert!(far(&right_jacobian_inverse(r).times(&turned.transposed()), &left) < 1e-11, "{r:?}");
        }
    }
}
