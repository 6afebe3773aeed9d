//! Which instructions the hot part of a step may use, found out once.
//!
//! A kernel is written once. It is compiled for the machine that every build must run on, and again with AVX2 and fused
//! multiply-adds; whatever it calls is inlined into either. The two differ in the last bits; one process uses one of them.
#![allow(unsafe_code)] // calling what was compiled for a processor needs a look at the processor, which is here

use std::sync::OnceLock;

/// Instructions to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arch(Kind);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Fused,
}

/// Something to compute, whose multiply-adds are fused if `FUSED`.
pub trait Kernel {
    /// What comes out.
    type Output;
    /// Computes it; must be `#[inline(always)]`, like all that it calls.
    fn run<const FUSED: bool>(self) -> Self::Output;
}

impl Arch {
    /// What every build can use.
    pub const PORTABLE: Arch = Arch(Kind::Portable);

    /// The best that this machine has.
    pub fn best() -> Arch {
        static BEST: OnceLock<Arch> = OnceLock::new();
        *BEST.get_or_init(Self::find)
    }

    #[cfg(target_arch = "x86_64")]
    fn find() -> Arch {
        let fused = std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma");
        Arch(if fused { Kind::Fused } else { Kind::Portable })
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn find() -> Arch {
        Arch::PORTABLE
    }

    /// Runs a kernel on these instructions.
    pub fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Kind::Portable => kernel.run::<false>(),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `Fused` is made by `find` alone, which has asked the processor.
            Kind::Fused => unsafe { fused(kernel) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn fused<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<true>()
}

/// `a b + c`, rounded once if `FUSED`.
#[inline(always)]
pub fn madd<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED {
        a.mul_add(b, c)
    } else {
        a * b + c
    }
}

/// Runs `$body` with the hand that fits `$fused`.
macro_rules! with_simd {
    ($fused:expr, |$simd:ident| $body:expr) => {{
        #[cfg(target_arch = "x86_64")]
        if $fused {
            let $simd = $crate::kernels::registers::Simd::<$crate::kernels::registers::Fused>::ready();
            $body
        } else {
            let $simd = $crate::kernels::registers::Simd::<$crate::kernels::registers::Plain>::ready();
            $body
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            let _ = $fused;
            let $simd = $crate::kernels::registers::Simd::<$crate::kernels::registers::Plain>::ready();
            $body
        }
    }};
}
pub(crate) use with_simd;
