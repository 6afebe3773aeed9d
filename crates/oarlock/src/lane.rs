//! One number or eight side by side: the kinematics run on either.
#![allow(clippy::needless_range_loop)] // several arrays go in step

pub mod arch;
pub mod four;
mod trig;

use arch::madd;
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// What the kinematics need of a number.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> + AddAssign
{
    /// The same value in every lane.
    fn splat(x: f64) -> Self;
    /// Times a plain number.
    fn scale(self, s: f64) -> Self;
    /// `self a + b`.
    fn madd(self, a: Self, b: Self) -> Self;
    /// `self a + b` with a plain number.
    fn madd_f64(self, a: f64, b: Self) -> Self;
    /// Sine and cosine.
    fn sin_cos(self) -> (Self, Self);
    /// Of a squared angle t^2: sin t / t and (1 - cos t) / t^2.
    fn rodrigues(self) -> (Self, Self);
}

impl Real for f64 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn scale(self, s: f64) -> Self {
        self * s
    }
    #[inline(always)]
    fn madd(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    #[inline(always)]
    fn madd_f64(self, a: f64, b: Self) -> Self {
        self * a + b
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }
    #[inline(always)]
    fn rodrigues(self) -> (Self, Self) {
        if self < SMALL {
            return series(self);
        }
        let angle = self.sqrt();
        let (sin, cos) = (0.5 * angle).sin_cos();
        (2.0 * sin * cos / angle, 2.0 * sin * sin / self)
    }
}

/// Squared angle below which `series` is exact to rounding.
const SMALL: f64 = 1e-4;

/// Of a small squared angle: sin t / t and (1 - cos t) / t^2.
#[inline(always)]
fn series(t2: f64) -> (f64, f64) {
    (1.0 - t2 / 6.0 * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0)), 0.5 - t2 / 24.0 * (1.0 - t2 / 30.0 * (1.0 - t2 / 56.0)))
}

/// How many sigma points run side by side.
pub const LANES: usize = 8;

/// Eight doubles that move together; multiply-adds round once if `FUSED`, which only kernels for such a machine should ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Lane<const FUSED: bool = false>(pub [f64; LANES]);

impl<const FUSED: bool> Lane<FUSED> {
    /// The same numbers, reckoned with in another way.
    #[inline(always)]
    pub fn cast<const OTHER: bool>(self) -> Lane<OTHER> {
        Lane(self.0)
    }
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl<const FUSED: bool> $trait for Lane<FUSED> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                let mut r = self.0;
                for i in 0..LANES {
                    r[i] = self.0[i] $op o.0[i];
                }
                Lane(r)
            }
        }
    };
}

lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);

impl<const FUSED: bool> Neg for Lane<FUSED> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let mut r = self.0;
        for x in &mut r {
            *x = -*x;
        }
        Lane(r)
    }
}

impl<const FUSED: bool> AddAssign for Lane<FUSED> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<const FUSED: bool> Real for Lane<FUSED> {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Lane([x; LANES])
    }
    #[inline(always)]
    fn scale(self, s: f64) -> Self {
        let mut r = self.0;
        for x in &mut r {
            *x *= s;
        }
        Lane(r)
    }
    #[inline(always)]
    fn madd(self, a: Self, b: Self) -> Self {
        let mut r = self.0;
        for i in 0..LANES {
            r[i] = madd::<FUSED>(self.0[i], a.0[i], b.0[i]);
        }
        Lane(r)
    }
    #[inline(always)]
    fn madd_f64(self, a: f64, b: Self) -> Self {
        let mut r = self.0;
        for i in 0..LANES {
            r[i] = madd::<FUSED>(self.0[i], a, b.0[i]);
        }
        Lane(r)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = trig::sin_cos::<FUSED>(self.0);
        (Lane(sin), Lane(cos))
    }
    #[inline(always)]
    fn rodrigues(self) -> (Self, Self) {
        let (mut a, mut b) = (self, self);
        let mut half = self.0;
        for x in &mut half {
            *x = 0.5 * x.sqrt();
        }
        let (sin, cos) = trig::sin_cos::<FUSED>(half);
        for i in 0..LANES {
            let (t2, small) = (self.0[i], series(self.0[i]));
            let (far_a, far_b) = (sin[i] * cos[i] / half[i], 2.0 * sin[i] * sin[i] / t2);
            a.0[i] = if t2 < SMALL { small.0 } else { far_a };
            b.0[i] = if t2 < SMALL { small.1 } else { far_b };
        }
        (a, b)
    }
}
