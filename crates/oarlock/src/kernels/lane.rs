//! One number or eight side by side: the kinematics run on either.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::arch::madd;
use super::trig;
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// What the kinematics need of a number.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> + AddAssign
{
    /// What fits in one register, if there are more lanes than that.
    type Half: Real;
    /// How many of those make the whole.
    const HALVES: usize;
    /// One of them.
    fn half(&self, half: usize) -> Self::Half;
    /// Puts one of them.
    fn set_half(&mut self, half: usize, x: Self::Half);
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
    type Half = f64;
    const HALVES: usize = 1;
    #[inline(always)]
    fn half(&self, _: usize) -> f64 {
        *self
    }
    #[inline(always)]
    fn set_half(&mut self, _: usize, x: f64) {
        *self = x;
    }
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

/// Numbers of a register.
const HALF: usize = LANES / 2;

/// Half of a lane's numbers, which fit in one register.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub struct Half<const FUSED: bool = false>(pub [f64; HALF]);

macro_rules! lanewise {
    ($type:ident, $count:ident, $($trait:ident, $method:ident, $op:tt);*) => {
        $(impl<const FUSED: bool> $trait for $type<FUSED> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                let mut r = self.0;
                for i in 0..$count {
                    r[i] = self.0[i] $op o.0[i];
                }
                $type(r)
            }
        })*

        impl<const FUSED: bool> Neg for $type<FUSED> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                let mut r = self.0;
                for x in &mut r {
                    *x = -*x;
                }
                $type(r)
            }
        }

        impl<const FUSED: bool> AddAssign for $type<FUSED> {
            #[inline(always)]
            fn add_assign(&mut self, o: Self) {
                *self = *self + o;
            }
        }
    };
}

lanewise!(Lane, LANES, Add, add, +; Sub, sub, -; Mul, mul, *);
lanewise!(Half, HALF, Add, add, +; Sub, sub, -; Mul, mul, *);

/// What all numbers side by side have in common.
macro_rules! lanes_of_reals {
    ($type:ident, $count:ident) => {
        #[inline(always)]
        fn splat(x: f64) -> Self {
            $type([x; $count])
        }
        #[inline(always)]
        fn scale(self, s: f64) -> Self {
            let mut r = self.0;
            for x in &mut r {
                *x *= s;
            }
            $type(r)
        }
        #[inline(always)]
        fn madd(self, a: Self, b: Self) -> Self {
            let mut r = self.0;
            for i in 0..$count {
                r[i] = madd::<FUSED>(self.0[i], a.0[i], b.0[i]);
            }
            $type(r)
        }
        #[inline(always)]
        fn madd_f64(self, a: f64, b: Self) -> Self {
            let mut r = self.0;
            for i in 0..$count {
                r[i] = madd::<FUSED>(self.0[i], a, b.0[i]);
            }
            $type(r)
        }
        #[inline(always)]
        fn sin_cos(self) -> (Self, Self) {
            let (sin, cos) = trig::sin_cos::<FUSED, $count>(self.0);
            ($type(sin), $type(cos))
        }
        #[inline(always)]
        fn rodrigues(self) -> (Self, Self) {
            let (mut a, mut b) = (self, self);
            let mut half = self.0;
            for x in &mut half {
                *x = 0.5 * x.sqrt();
            }
            let (sin, cos) = trig::sin_cos::<FUSED, $count>(half);
            for i in 0..$count {
                let (t2, small) = (self.0[i], series(self.0[i]));
                let (far_a, far_b) = (sin[i] * cos[i] / half[i], 2.0 * sin[i] * sin[i] / t2);
                a.0[i] = if t2 < SMALL { small.0 } else { far_a };
                b.0[i] = if t2 < SMALL { small.1 } else { far_b };
            }
            (a, b)
        }
    };
}

impl<const FUSED: bool> Real for Lane<FUSED> {
    type Half = Half<FUSED>;
    const HALVES: usize = 2;
    #[inline(always)]
    fn half(&self, half: usize) -> Half<FUSED> {
        Half(self.0.as_chunks().0[half])
    }
    #[inline(always)]
    fn set_half(&mut self, half: usize, x: Half<FUSED>) {
        self.0.as_chunks_mut().0[half] = x.0;
    }
    lanes_of_reals!(Lane, LANES);
}

impl<const FUSED: bool> Real for Half<FUSED> {
    type Half = Self;
    const HALVES: usize = 1;
    #[inline(always)]
    fn half(&self, _: usize) -> Self {
        *self
    }
    #[inline(always)]
    fn set_half(&mut self, _: usize, x: Self) {
        *self = x;
    }
    lanes_of_reals!(Half, HALF);
}
