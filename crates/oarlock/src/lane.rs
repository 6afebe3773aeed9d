//! One number or eight side by side: the kinematics run on either.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// What the kinematics need of a number.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self> + AddAssign
{
    /// The same value in every lane.
    fn splat(x: f64) -> Self;
    /// Times a plain number.
    fn scale(self, s: f64) -> Self;
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
    fn sin_cos(self) -> (Self, Self) {
        f64::sin_cos(self)
    }
    #[inline(always)]
    fn rodrigues(self) -> (Self, Self) {
        if self < 1e-4 {
            let t2 = self;
            return (
                1.0 - t2 / 6.0 * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0)),
                0.5 - t2 / 24.0 * (1.0 - t2 / 30.0 * (1.0 - t2 / 56.0)),
            );
        }
        let angle = self.sqrt();
        let (sin, cos) = (0.5 * angle).sin_cos();
        (2.0 * sin * cos / angle, 2.0 * sin * sin / self)
    }
}

/// How many sigma points run side by side.
pub const LANES: usize = 8;

/// Eight doubles that move together.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Lane(pub [f64; LANES]);

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lane {
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

impl Neg for Lane {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.scale(-1.0)
    }
}

impl AddAssign for Lane {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl Real for Lane {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Lane([x; LANES])
    }
    #[inline(always)]
    fn scale(self, s: f64) -> Self {
        Lane(self.0.map(|x| x * s))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (mut s, mut c) = (self, self);
        for i in 0..LANES {
            (s.0[i], c.0[i]) = self.0[i].sin_cos();
        }
        (s, c)
    }
    #[inline(always)]
    fn rodrigues(self) -> (Self, Self) {
        let (mut a, mut b) = (self, self);
        for i in 0..LANES {
            (a.0[i], b.0[i]) = self.0[i].rodrigues();
        }
        (a, b)
    }
}
