//! Sine and cosine of several angles at once.
//!
//! The angle is brought within an eighth of a turn of a multiple of a quarter turn, which is subtracted in three parts whose
//! products are exact (Cody and Waite 1980); there Taylor's series end below rounding.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::arch::madd;
use std::f64::consts::FRAC_2_PI;

/// A quarter turn, in parts of 33, 33 and 53 bits.
const QUARTER: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];
/// Angles beyond this, rad, would ask for more parts. They go one by one.
const LARGEST: f64 = 1e5;
/// Adding this leaves an integer in the last bits.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// -1/3!, 1/5! ...
const SINE: [f64; 8] = series(-1.0 / 6.0, 4.0);
/// 1/4!, -1/6! ...
const COSINE: [f64; 7] = series(1.0 / 24.0, 5.0);

/// Each term is the one before over -k (k + 1), then k grows by two.
const fn series<const COUNT: usize>(first: f64, mut k: f64) -> [f64; COUNT] {
    let (mut out, mut i) = ([first; COUNT], 1);
    while i < COUNT {
        out[i] = -out[i - 1] / (k * (k + 1.0));
        k += 2.0;
        i += 1;
    }
    out
}

/// Sines and cosines.
#[inline(always)]
pub fn sin_cos<const FUSED: bool, const LANES: usize>(x: [f64; LANES]) -> ([f64; LANES], [f64; LANES]) {
    let (mut sin, mut cos) = (x, x);
    let mut near = true;
    for i in 0..LANES {
        near &= x[i].abs() <= LARGEST;
    }
    if !near {
        // Written so that what is not a number comes here too.
        for i in 0..LANES {
            (sin[i], cos[i]) = x[i].sin_cos();
        }
        return (sin, cos);
    }
    for i in 0..LANES {
        let counted = madd::<FUSED>(x[i], FRAC_2_PI, ROUNDER);
        let (bits, quarters) = (counted.to_bits(), counted - ROUNDER);
        let mut r = x[i];
        for part in QUARTER {
            r = madd::<FUSED>(-quarters, part, r);
        }
        let (s, c) = near_zero::<FUSED>(r);
        let odd = bits & 1 == 1;
        let (first, second) = (if odd { c } else { s }, if odd { s } else { c });
        sin[i] = f64::from_bits(first.to_bits() ^ ((bits & 2) << 62));
        cos[i] = f64::from_bits(second.to_bits() ^ ((bits.wrapping_add(1) & 2) << 62));
    }
    (sin, cos)
}

/// Within an eighth of a turn.
#[inline(always)]
fn near_zero<const FUSED: bool>(r: f64) -> (f64, f64) {
    let z = r * r;
    let (mut s, mut c) = (SINE[7], COSINE[6]);
    for k in (0..7).rev() {
        s = madd::<FUSED>(s, z, SINE[k]);
    }
    for k in (0..6).rev() {
        c = madd::<FUSED>(c, z, COSINE[k]);
    }
    let half = 0.5 * z;
    let rough = 1.0 - half;
    // What the subtraction lost comes back with the small terms.
    let lost = (1.0 - rough) - half;
    (madd::<FUSED>(r * z, s, r), rough + madd::<FUSED>(z * z, c, lost))
}

#[cfg(test)]
mod tests {
    use super::super::arch::{Arch, Kernel};
    use super::super::lane::LANES;
    use super::*;

    struct Of([f64; LANES]);

    impl Kernel for Of {
        type Output = ([f64; LANES], [f64; LANES]);

        #[inline(always)]
        fn run<const FUSED: bool>(self) -> Self::Output {
            sin_cos::<FUSED, LANES>(self.0)
        }
    }

    /// One unit in the last place of numbers up to one, and a little for angles of which that is less than half.
    const LAST_PLACE: f64 = 1.2 * f64::EPSILON;

    fn worst(angles: impl Iterator<Item = f64>) -> f64 {
        let mut worst: f64 = 0.0;
        for x in angles {
            for arch in [Arch::PORTABLE, Arch::best()] {
                let (sin, cos) = arch.run(Of([x; LANES]));
                let (s, c) = x.sin_cos();
                worst = worst.max((sin[3] - s).abs()).max((cos[3] - c).abs());
                assert!(sin.iter().all(|y| y.to_bits() == sin[0].to_bits()));
            }
        }
        worst
    }

    #[test]
    fn agrees_with_the_standard_library_near_and_far() {
        let small = (0..2_000).map(|k| (k as f64 - 1_000.0) * 1e-3 * 1.7);
        let turns = (0..20_000).map(|k| (k as f64 - 10_000.0) * 0.731);
        let wide = (0..20_000).map(|k| 1e5 * (k as f64 * 0.618_033_988_75).fract() - 5e4);
        let quarters = (-2_000..2_000).map(|k| f64::from(k) * std::f64::consts::FRAC_PI_2);
        let tiny = (0..300).map(|k| 10_f64.powi(-k));
        let far = (0..300).map(|k| 1.3 * 10_f64.powi(k));
        let worst = worst(small.chain(turns).chain(wide).chain(quarters).chain(tiny).chain(far));
        println!("sine and cosine: {worst:.1e} off");
        assert!(worst < LAST_PLACE, "{worst:e}");
    }

    #[test]
    fn small_sines_keep_all_their_digits() {
        for k in 1..300 {
            let x = 10_f64.powi(-k);
            assert!((Arch::best().run(Of([x; LANES])).0[0] / x.sin() - 1.0).abs() < LAST_PLACE);
        }
    }

    #[test]
    fn what_is_no_angle_has_no_sine() {
        for x in [f64::NAN, f64::INFINITY] {
            let mut all = [0.5; LANES];
            all[6] = x;
            let (sin, cos) = Arch::best().run(Of(all));
            assert!(sin[6].is_nan() && cos[6].is_nan() && sin[0] == 0.5_f64.sin());
        }
    }
}
