//! A point of a link as a function of parameters, some of which may be estimated.

use super::expr::Expr;
use super::transform::{evaluate_three, Transform};
use crate::kernels::lane::Real;
use crate::rotation::{Mat3, Vec3};

/// `fixed` plus a slope times the value of each estimated parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    fixed: [f64; 3],
    /// Number of the estimated parameter, m per unit of it.
    slopes: Vec<(usize, [f64; 3])>,
}

/// Step of the derivative, in units of the parameter. The derivative is exact for linear expressions, as lengths are.
const STEP: f64 = 1e-3;

impl Point {
    /// A point that depends on no parameter.
    pub fn fixed(fixed: [f64; 3]) -> Self {
        Point { fixed, slopes: Vec::new() }
    }

    /// From expressions at `parameters`; those with index `estimated` may change.
    pub fn of(point: &[Expr; 3], parameters: &[f64], estimated: &[usize]) -> Self {
        Self::made(|p| evaluate_three(point, p), parameters, estimated)
    }

    /// Origin of a transform's child frame.
    pub fn reached_by(transform: &Transform, parameters: &[f64], estimated: &[usize]) -> Self {
        Self::made(|p| transform.evaluate(p).1, parameters, estimated)
    }

    fn made(at: impl Fn(&[f64]) -> [f64; 3], parameters: &[f64], estimated: &[usize]) -> Self {
        let mut point = Point::fixed(at(parameters));
        for (number, &i) in estimated.iter().enumerate() {
            let moved = |by: f64| {
                let mut p = parameters.to_vec();
                p[i] += by;
                at(&p)
            };
            let (up, down) = (moved(STEP), moved(-STEP));
            let slope = [0, 1, 2].map(|k| (up[k] - down[k]) / (2.0 * STEP));
            if slope.iter().any(|s| s.abs() > 1e-9) {
                (0..3).for_each(|k| point.fixed[k] -= slope[k] * parameters[i]);
                point.slopes.push((number, slope));
            }
        }
        point
    }

    /// A point given in axes with this origin and rotation.
    pub fn and_then(&self, rotation: &Mat3<f64>, point: &Point) -> Point {
        let sum = |a: [f64; 3], b: [f64; 3]| (Vec3(a) + rotation.apply(Vec3(b))).0;
        let mut slopes = self.slopes.clone();
        for (number, slope) in &point.slopes {
            match slopes.iter_mut().find(|(n, _)| n == number) {
                Some((_, known)) => *known = sum(*known, *slope),
                None => slopes.push((*number, sum([0.0; 3], *slope))),
            }
        }
        Point { fixed: sum(self.fixed, point.fixed), slopes }
    }

    /// In its own axes, at these values of the estimated parameters.
    #[inline(always)]
    pub fn at<T: Real>(&self, lengths: &[T]) -> Vec3<T> {
        let mut point = Vec3::splat(self.fixed);
        for (number, slope) in &self.slopes {
            point = point.plus_equal(Vec3(*slope), lengths[*number]);
        }
        point
    }

    /// The constant point, if it depends on no parameter.
    #[inline(always)]
    pub fn constant(&self) -> Option<Vec3<f64>> {
        self.slopes.is_empty().then_some(Vec3(self.fixed))
    }

    /// Number of each estimated parameter that it depends on, and the derivative (m per unit).
    pub fn slopes(&self) -> &[(usize, [f64; 3])] {
        &self.slopes
    }

    /// Rotated by `rotation`, at these values of the estimated parameters.
    #[inline(always)]
    pub fn turned<T: Real>(&self, rotation: &Mat3<T>, lengths: &[T]) -> Vec3<T> {
        let mut arm = Vec3::zero();
        for (i, x) in self.fixed.iter().enumerate().filter(|(_, x)| **x != 0.0) {
            arm = arm.plus_f64(rotation.column(i), *x);
        }
        for (number, slope) in &self.slopes {
            arm = arm.plus(rotation.apply_f64(*slope), lengths[*number]);
        }
        arm
    }

    /// Whether it is always the origin.
    #[inline(always)]
    pub fn is_origin(&self) -> bool {
        self.slopes.is_empty() && self.fixed == [0.0; 3]
    }

    /// Numbers of the estimated parameters that it depends on.
    pub fn moved_by(&self) -> impl Iterator<Item = usize> + '_ {
        self.slopes.iter().map(|(number, _)| *number)
    }
}
