//! Vectors and rotations in three dimensions, over one or many lanes, and in doubles.

pub mod turn;

use crate::kernels::lane::Real;
use std::ops::{Add, AddAssign, Mul, Sub};

/// Three numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vec3<T>(pub [T; 3]);

/// A row-major 3 x 3 matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mat3<T>(pub [[T; 3]; 3]);

impl<T: Real> Add for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        let (a, b) = (self.0, o.0);
        Vec3([a[0] + b[0], a[1] + b[1], a[2] + b[2]])
    }
}

impl<T: Real> Sub for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        let (a, b) = (self.0, o.0);
        Vec3([a[0] - b[0], a[1] - b[1], a[2] - b[2]])
    }
}

impl<T: Real> AddAssign for Vec3<T> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<T: Real> Mul<T> for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: T) -> Self {
        let a = self.0;
        Vec3([a[0] * s, a[1] * s, a[2] * s])
    }
}

impl<T: Real> Vec3<T> {
    /// All zero.
    #[inline(always)]
    pub fn zero() -> Self {
        Vec3([T::splat(0.0); 3])
    }

    /// The same vector in every lane.
    #[inline(always)]
    pub fn splat(v: [f64; 3]) -> Self {
        Vec3(v.map(T::splat))
    }

    /// Cross product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        let (a, b) = (self.0, o.0);
        Vec3([a[1].madd(b[2], -(a[2] * b[1])), a[2].madd(b[0], -(a[0] * b[2])), a[0].madd(b[1], -(a[1] * b[0]))])
    }
}

#[inline(always)]
fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0].madd(b[0], a[1].madd(b[1], a[2] * b[2]))
}

#[inline(always)]
fn dot_f64<T: Real>(a: [T; 3], b: [f64; 3]) -> T {
    a[0].madd_f64(b[0], a[1].madd_f64(b[1], a[2].scale(b[2])))
}

impl<T: Real> Vec3<T> {
    /// Sum with a multiple of another vector.
    #[inline(always)]
    pub fn plus(self, o: Self, times: T) -> Self {
        let (a, b) = (self.0, o.0);
        Vec3([b[0].madd(times, a[0]), b[1].madd(times, a[1]), b[2].madd(times, a[2])])
    }

    /// Sum with a multiple of another vector.
    #[inline(always)]
    pub fn plus_f64(self, o: Self, times: f64) -> Self {
        let (a, b) = (self.0, o.0);
        Vec3([b[0].madd_f64(times, a[0]), b[1].madd_f64(times, a[1]), b[2].madd_f64(times, a[2])])
    }

    /// Sum with a multiple of a vector that is equal in every lane.
    #[inline(always)]
    pub fn plus_equal(self, o: Vec3<f64>, times: T) -> Self {
        let (a, b) = (self.0, o.0);
        Vec3([times.madd_f64(b[0], a[0]), times.madd_f64(b[1], a[1]), times.madd_f64(b[2], a[2])])
    }

    /// Cross product with a vector that is equal in every lane.
    #[inline(always)]
    pub fn cross_equal(self, o: Vec3<f64>) -> Self {
        let (a, b) = (self.0, o.0);
        Vec3([
            a[1].madd_f64(b[2], -a[2].scale(b[1])),
            a[2].madd_f64(b[0], -a[0].scale(b[2])),
            a[0].madd_f64(b[1], -a[1].scale(b[0])),
        ])
    }
}

impl<T: Real> Vec3<T> {
    /// `sum` and the cross product.
    #[inline(always)]
    pub fn cross_onto(self, o: Self, sum: Self) -> Self {
        let (a, b, s) = (self.0, o.0, sum.0);
        let sum = |i: usize, j: usize, k: usize| a[j].madd(b[k], (-a[k]).madd(b[j], s[i]));
        Vec3([sum(0, 1, 2), sum(1, 2, 0), sum(2, 0, 1)])
    }

    /// `sum` and the cross product with a vector that is equal in every lane.
    #[inline(always)]
    pub fn cross_equal_onto(self, o: Vec3<f64>, sum: Self) -> Self {
        let (a, b, s) = (self.0, o.0, sum.0);
        let sum = |i: usize, j: usize, k: usize| a[j].madd_f64(b[k], a[k].madd_f64(-b[j], s[i]));
        Vec3([sum(0, 1, 2), sum(1, 2, 0), sum(2, 0, 1)])
    }

    /// One half of the lanes.
    #[inline(always)]
    pub fn half(&self, half: usize) -> Vec3<T::Half> {
        Vec3([self.0[0].half(half), self.0[1].half(half), self.0[2].half(half)])
    }

    /// Sets one half of the lanes.
    #[inline(always)]
    pub fn set_half(&mut self, half: usize, v: Vec3<T::Half>) {
        for (to, x) in self.0.iter_mut().zip(v.0) {
            to.set_half(half, x);
        }
    }
}

impl Vec3<f64> {
    /// The same in every lane.
    #[inline(always)]
    pub fn everywhere<T: Real>(self) -> Vec3<T> {
        Vec3::splat(self.0)
    }
}

impl<T: Real> Mat3<T> {
    /// The identity.
    #[inline(always)]
    pub fn identity() -> Self {
        let (o, i) = (T::splat(0.0), T::splat(1.0));
        Mat3([[i, o, o], [o, i, o], [o, o, i]])
    }

    /// Matrix times vector.
    #[inline(always)]
    pub fn apply(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3([dot(self.0[0], v.0), dot(self.0[1], v.0), dot(self.0[2], v.0)])
    }

    /// Matrix times a vector that is equal in every lane.
    #[inline(always)]
    pub fn apply_f64(&self, v: [f64; 3]) -> Vec3<T> {
        Vec3([dot_f64(self.0[0], v), dot_f64(self.0[1], v), dot_f64(self.0[2], v)])
    }

    /// Transpose times vector.
    #[inline(always)]
    pub fn apply_transposed(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3([dot(self.column(0).0, v.0), dot(self.column(1).0, v.0), dot(self.column(2).0, v.0)])
    }

    /// Matrix product with a matrix that is equal in every lane.
    #[inline(always)]
    pub fn times_f64(&self, o: &Mat3<f64>) -> Self {
        let columns = [o.column(0).0, o.column(1).0, o.column(2).0];
        let mut out = self.0;
        for to in &mut out {
            let r = *to;
            *to = [dot_f64(r, columns[0]), dot_f64(r, columns[1]), dot_f64(r, columns[2])];
        }
        Mat3(out)
    }

    /// Matrix product.
    #[inline(always)]
    pub fn then(&self, o: &Self) -> Self {
        let columns = [o.column(0).0, o.column(1).0, o.column(2).0];
        let mut out = self.0;
        for to in &mut out {
            let r = *to;
            *to = [dot(r, columns[0]), dot(r, columns[1]), dot(r, columns[2])];
        }
        Mat3(out)
    }

    /// Rotation about `r` by its length, rad (Rodrigues).
    #[inline(always)]
    pub fn about(r: Vec3<T>) -> Self {
        let [x, y, z] = r.0;
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (a, b) = (xx + yy + zz).rodrigues();
        let one = T::splat(1.0);
        let (bx, by) = (b * x, b * y);
        let (xy, xz, yz) = (bx * y, bx * z, by * z);
        let (ax, ay, az) = (a * x, a * y, a * z);
        Mat3([
            [one - b * (yy + zz), xy - az, xz + ay],
            [xy + az, one - b * (xx + zz), yz - ax],
            [xz - ay, yz + ax, one - b * (xx + yy)],
        ])
    }

    /// Product with a rotation about z, given its sine and cosine.
    #[inline(always)]
    pub fn turned_about_z(&self, sin: T, cos: T) -> Self {
        let mut out = self.0;
        for to in &mut out {
            let [x, y, z] = *to;
            *to = [x.madd(cos, y * sin), y.madd(cos, -(x * sin)), z];
        }
        Mat3(out)
    }

    /// Column `j`.
    #[inline(always)]
    pub fn column(&self, j: usize) -> Vec3<T> {
        Vec3([self.0[0][j], self.0[1][j], self.0[2][j]])
    }
}

impl Mat3<f64> {
    /// The same in every lane.
    #[inline(always)]
    pub fn everywhere<T: Real>(&self) -> Mat3<T> {
        Mat3([Vec3::splat(self.0[0]).0, Vec3::splat(self.0[1]).0, Vec3::splat(self.0[2]).0])
    }

    /// Transpose times a vector in lanes.
    #[inline(always)]
    pub fn transposed_apply<T: Real>(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3([dot_f64(v.0, self.column(0).0), dot_f64(v.0, self.column(1).0), dot_f64(v.0, self.column(2).0)])
    }

    /// Product with a vector in lanes.
    #[inline(always)]
    pub fn apply_lanes<T: Real>(&self, v: Vec3<T>) -> Vec3<T> {
        Vec3([dot_f64(v.0, self.0[0]), dot_f64(v.0, self.0[1]), dot_f64(v.0, self.0[2])])
    }

    /// Matrix product.
    pub fn times(&self, o: &Self) -> Self {
        self.times_f64(o)
    }

    /// Product with the transpose of another matrix.
    #[inline(always)]
    pub fn times_transposed(&self, o: &Self) -> Self {
        let mut out = self.0;
        for to in &mut out {
            let row = *to;
            *to = [dot(row, o.0[0]), dot(row, o.0[1]), dot(row, o.0[2])];
        }
        Mat3(out)
    }

    /// Transpose.
    pub fn transposed(&self) -> Self {
        let m = &self.0;
        Mat3([0, 1, 2].map(|i| [m[0][i], m[1][i], m[2][i]]))
    }

    /// Rotation about x by `angle` rad.
    pub fn about_x(angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        Mat3([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    }

    /// Rotation about y by `angle` rad.
    pub fn about_y(angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        Mat3([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    }

    /// Rotation about z by `angle` rad.
    pub fn about_z(angle: f64) -> Self {
        let (s, c) = angle.sin_cos();
        Mat3([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    }

    /// Largest entry of |R R' - 1|, and the determinant: a rotation has 0 and 1.
    pub fn rotation_defect(&self) -> (f64, f64) {
        let p = self.times(&self.transposed());
        let mut worst: f64 = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                let one = if i == j { 1.0 } else { 0.0 };
                worst = worst.max((p.0[i][j] - one).abs());
            }
        }
        let c = self.column(0).cross(self.column(1)).0;
        let z = self.column(2).0;
        (worst, c[0] * z[0] + c[1] * z[1] + c[2] * z[2])
    }
}
