//! Products in tiles of four rows by three registers, for AVX2 with fused multiply-adds.
//!
//! The tile fills all registers: twelve sums, three of a row and one factor. The compiler wants a second factor and keeps a sum in memory, so
//! that each product waits for a store; hence the loop is written out.

use super::Strided;
use std::arch::x86_64::__m256d;

macro_rules! rows {
    ($add:literal, $sums:ident, $left:ident, $right:ident, $count:ident) => {{
        let [[s00, s01, s02], [s10, s11, s12], [s20, s21, s22], [s30, s31, s32]] = $sums;
        std::arch::asm!(
            "2:",
            "vmovupd {x}, [{b}]",
            "vmovupd {y}, [{b} + 32]",
            "vmovupd {z}, [{b} + 64]",
            "vbroadcastsd {f}, [{a}]",
            concat!($add, " {s00}, {f}, {x}"),
            concat!($add, " {s01}, {f}, {y}"),
            concat!($add, " {s02}, {f}, {z}"),
            "vbroadcastsd {f}, [{a} + 8]",
            concat!($add, " {s10}, {f}, {x}"),
            concat!($add, " {s11}, {f}, {y}"),
            concat!($add, " {s12}, {f}, {z}"),
            "vbroadcastsd {f}, [{a} + 16]",
            concat!($add, " {s20}, {f}, {x}"),
            concat!($add, " {s21}, {f}, {y}"),
            concat!($add, " {s22}, {f}, {z}"),
            "vbroadcastsd {f}, [{a} + 24]",
            concat!($add, " {s30}, {f}, {x}"),
            concat!($add, " {s31}, {f}, {y}"),
            concat!($add, " {s32}, {f}, {z}"),
            "add {a}, {next_a}",
            "add {b}, {next_b}",
            "dec {count}",
            "jnz 2b",
            a = inout(reg) $left.at => _,
            b = inout(reg) $right.at => _,
            count = inout(reg) $count => _,
            next_a = in(reg) $left.stride * size_of::<f64>(),
            next_b = in(reg) $right.stride * size_of::<f64>(),
            x = out(ymm_reg) _, y = out(ymm_reg) _, z = out(ymm_reg) _, f = out(ymm_reg) _,
            s00 = inout(ymm_reg) *s00, s01 = inout(ymm_reg) *s01, s02 = inout(ymm_reg) *s02,
            s10 = inout(ymm_reg) *s10, s11 = inout(ymm_reg) *s11, s12 = inout(ymm_reg) *s12,
            s20 = inout(ymm_reg) *s20, s21 = inout(ymm_reg) *s21, s22 = inout(ymm_reg) *s22,
            s30 = inout(ymm_reg) *s30, s31 = inout(ymm_reg) *s31, s32 = inout(ymm_reg) *s32,
            options(nostack, readonly),
        );
    }};
}

/// `sums +- left' right`: reads four numbers of `left` and twelve of `right` in each of `count` rows.
///
/// # Safety
/// The machine has AVX2 and fused multiply-adds; there is at least one row; all rows lie within memory that may be read.
#[target_feature(enable = "avx2,fma")]
#[inline]
pub(super) unsafe fn multiply<const TAKE: bool>(
    sums: &mut [[__m256d; 3]; 4],
    left: Strided,
    right: Strided,
    count: usize,
) {
    debug_assert!(count > 0);
    // SAFETY: the caller vouches for the rows, which are only read; the stack is not used.
    unsafe {
        if TAKE {
            rows!("vfnmadd231pd", sums, left, right, count);
        } else {
            rows!("vfmadd231pd", sums, left, right, count);
        }
    }
}
