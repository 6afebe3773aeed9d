//! Tiles of four-number registers, for the kernels in `tiles` and `sparse_jacobian`.
//!
//! A [`Simd`] token can only be made on a machine that has its instructions. Its methods check bounds once for a whole tile.
#![allow(unsafe_code)] // registers are filled from memory whose bounds were checked once
#![allow(clippy::needless_range_loop)] // several arrays go in step
#![allow(clippy::missing_safety_doc)] // said once of the whole trait

#[cfg(target_arch = "x86_64")]
use super::arch::Arch;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::*;

#[cfg(target_arch = "x86_64")]
mod twelve;

/// Numbers in a register.
pub const VECTOR: usize = 4;

/// A register of four doubles.
///
/// # Safety
/// Only a [`Simd`] may use one: it is made after asking the processor.
pub unsafe trait F64x4: Copy {
    /// Whether this machine has the instructions.
    fn is_here() -> bool;
    /// All the same.
    unsafe fn splat(x: f64) -> Self;
    /// Reads four numbers from `at` on.
    unsafe fn load(at: *const f64) -> Self;
    /// Writes four numbers from `at` on.
    unsafe fn store(self, at: *mut f64);
    /// `self + a b`.
    unsafe fn plus(self, a: Self, b: Self) -> Self;
    /// `self - a b`.
    unsafe fn minus(self, a: Self, b: Self) -> Self;
    /// `self a`.
    unsafe fn times(self, a: Self) -> Self;
    /// The sum of each of four.
    unsafe fn sums(of: [Self; 4]) -> Self;
    /// Whether all are zero, of either sign.
    unsafe fn is_zero(self) -> bool;
    /// Rows become columns.
    unsafe fn turned(of: [Self; 4]) -> [Self; 4];
    /// `tile +- left' right` over `count` rows, at least one, of R and V VECTOR numbers.
    #[inline(always)]
    unsafe fn multiply<const TAKE: bool, const R: usize, const V: usize>(
        tile: &mut Tile<Self, R, V>,
        left: Strided,
        right: Strided,
        count: usize,
    ) {
        multiply_rows::<Self, TAKE, R, V>(tile, left, right, count);
    }
}

/// Rows in memory: the first number, and numbers from row to row.
#[derive(Debug, Clone, Copy)]
pub struct Strided {
    at: *const f64,
    stride: usize,
}

/// [`F64x4::multiply`], as the compiler arranges it.
#[inline(always)]
unsafe fn multiply_rows<F: F64x4, const TAKE: bool, const R: usize, const V: usize>(
    tile: &mut Tile<F, R, V>,
    left: Strided,
    right: Strided,
    count: usize,
) {
    let (mut a, mut b) = (left.at, right.at);
    for k in 0..count {
        if k > 0 {
            (a, b) = (a.add(left.stride), b.add(right.stride));
        }
        let mut row = [F::splat(0.0); V];
        for v in 0..V {
            row[v] = F::load(b.add(v * VECTOR));
        }
        for r in 0..R {
            let factor = F::splat(*a.add(r));
            for v in 0..V {
                let sum = tile[r][v];
                tile[r][v] = if TAKE { sum.minus(factor, row[v]) } else { sum.plus(factor, row[v]) };
            }
        }
    }
}

/// For every machine.
#[derive(Debug, Clone, Copy)]
pub struct Plain([f64; VECTOR]);

// SAFETY: plain numbers are everywhere.
unsafe impl F64x4 for Plain {
    #[inline(always)]
    fn is_here() -> bool {
        true
    }
    #[inline(always)]
    unsafe fn splat(x: f64) -> Self {
        Plain([x; VECTOR])
    }
    #[inline(always)]
    unsafe fn load(at: *const f64) -> Self {
        Plain(at.cast::<[f64; VECTOR]>().read())
    }
    #[inline(always)]
    unsafe fn store(self, at: *mut f64) {
        at.cast::<[f64; VECTOR]>().write(self.0);
    }
    #[inline(always)]
    unsafe fn plus(self, a: Self, b: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] + a.0[k] * b.0[k]))
    }
    #[inline(always)]
    unsafe fn minus(self, a: Self, b: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] - a.0[k] * b.0[k]))
    }
    #[inline(always)]
    unsafe fn times(self, a: Self) -> Self {
        Plain(std::array::from_fn(|k| self.0[k] * a.0[k]))
    }
    #[inline(always)]
    unsafe fn sums(of: [Self; 4]) -> Self {
        Plain(of.map(|v| (v.0[0] + v.0[1]) + (v.0[2] + v.0[3])))
    }
    #[inline(always)]
    unsafe fn is_zero(self) -> bool {
        self.0.iter().fold(0, |all, x| all | x.to_bits()) << 1 == 0
    }
    #[inline(always)]
    unsafe fn turned(of: [Self; 4]) -> [Self; 4] {
        std::array::from_fn(|i| Plain(std::array::from_fn(|j| of[j].0[i])))
    }
}

/// For AVX2 with fused multiply-adds.
#[cfg(target_arch = "x86_64")]
#[derive(Debug, Clone, Copy)]
#[repr(transparent)]
pub struct Fused(__m256d);

#[cfg(target_arch = "x86_64")]
// SAFETY: a `Simd` is only made where `is_here`.
unsafe impl F64x4 for Fused {
    #[inline(always)]
    fn is_here() -> bool {
        Arch::best() != Arch::PORTABLE
    }
    #[inline(always)]
    unsafe fn splat(x: f64) -> Self {
        Fused(_mm256_set1_pd(x))
    }
    #[inline(always)]
    unsafe fn load(at: *const f64) -> Self {
        Fused(_mm256_loadu_pd(at))
    }
    #[inline(always)]
    unsafe fn store(self, at: *mut f64) {
        _mm256_storeu_pd(at, self.0);
    }
    #[inline(always)]
    unsafe fn plus(self, a: Self, b: Self) -> Self {
        Fused(_mm256_fmadd_pd(a.0, b.0, self.0))
    }
    #[inline(always)]
    unsafe fn minus(self, a: Self, b: Self) -> Self {
        Fused(_mm256_fnmadd_pd(a.0, b.0, self.0))
    }
    #[inline(always)]
    unsafe fn times(self, a: Self) -> Self {
        Fused(_mm256_mul_pd(self.0, a.0))
    }
    #[inline(always)]
    unsafe fn sums([a, b, c, d]: [Self; 4]) -> Self {
        let (ab, cd) = (_mm256_hadd_pd(a.0, b.0), _mm256_hadd_pd(c.0, d.0));
        let (low, high) = (_mm256_blend_pd::<0b1100>(ab, cd), _mm256_permute2f128_pd::<0x21>(ab, cd));
        Fused(_mm256_add_pd(low, high))
    }
    #[inline(always)]
    unsafe fn is_zero(self) -> bool {
        let bits = _mm256_castpd_si256(self.0);
        _mm256_testz_si256(bits, _mm256_set1_epi64x(i64::MAX)) == 1
    }
    #[inline(always)]
    unsafe fn turned([a, b, c, d]: [Self; 4]) -> [Self; 4] {
        let (ab0, ab1) = (_mm256_unpacklo_pd(a.0, b.0), _mm256_unpackhi_pd(a.0, b.0));
        let (cd0, cd1) = (_mm256_unpacklo_pd(c.0, d.0), _mm256_unpackhi_pd(c.0, d.0));
        let low = |x, y| Fused(_mm256_permute2f128_pd::<0x20>(x, y));
        let high = |x, y| Fused(_mm256_permute2f128_pd::<0x31>(x, y));
        [low(ab0, cd0), low(ab1, cd1), high(ab0, cd0), high(ab1, cd1)]
    }
    #[inline(always)]
    unsafe fn multiply<const TAKE: bool, const R: usize, const V: usize>(
        tile: &mut Tile<Self, R, V>,
        left: Strided,
        right: Strided,
        count: usize,
    ) {
        if R == 4 && V == 3 {
            // A tile of this size, and `Fused` is its register and nothing else.
            twelve::multiply::<TAKE>(&mut *std::ptr::from_mut(tile).cast(), left, right, count);
        } else {
            multiply_rows::<Self, TAKE, R, V>(tile, left, right, count);
        }
    }
}

/// Rows of some registers.
pub type Tile<F, const R: usize, const V: usize> = [[F; V]; R];

/// Part of a row-major matrix: `from` on, rows `stride` apart.
#[derive(Debug, Clone, Copy)]
pub struct Part<'a> {
    /// Where it lies.
    pub data: &'a [f64],
    /// Its first number.
    pub from: usize,
    /// From row to row.
    pub stride: usize,
}

/// Token of an instruction set, with the operations on tiles.
#[derive(Debug, Clone, Copy)]
pub struct Simd<F>(std::marker::PhantomData<F>);

/// The end of `rows` rows, `stride` apart, of `width` numbers.
#[inline(always)]
fn end(from: usize, rows: usize, stride: usize, width: usize) -> usize {
    from + rows.saturating_sub(1) * stride + width
}

impl<F: F64x4> Simd<F> {
    /// Asks the processor; panics if it lacks the instructions.
    #[inline(always)]
    pub fn ready() -> Self {
        assert!(F::is_here(), "this machine lacks these instructions");
        Simd(std::marker::PhantomData)
    }

    /// All zero.
    #[inline(always)]
    pub fn zero<const R: usize, const V: usize>(self) -> Tile<F, R, V> {
        // SAFETY: the `Simd` was made where its instructions run.
        unsafe { [[F::splat(0.0); V]; R] }
    }

    /// From memory.
    #[inline(always)]
    pub fn load<const R: usize, const V: usize>(self, p: Part) -> Tile<F, R, V> {
        assert!(end(p.from, R, p.stride, V * VECTOR) <= p.data.len());
        let mut tile = self.zero();
        for r in 0..R {
            for v in 0..V {
                // SAFETY: all rows end within the data.
                tile[r][v] = unsafe { F::load(p.data.as_ptr().add(p.from + r * p.stride + v * VECTOR)) };
            }
        }
        tile
    }

    /// To memory.
    #[inline(always)]
    pub fn store<const R: usize, const V: usize>(
        self,
        tile: Tile<F, R, V>,
        data: &mut [f64],
        from: usize,
        stride: usize,
    ) {
        assert!(end(from, R, stride, V * VECTOR) <= data.len());
        for r in 0..R {
            for v in 0..V {
                // SAFETY: all rows end within the data.
                unsafe { tile[r][v].store(data.as_mut_ptr().add(from + r * stride + v * VECTOR)) };
            }
        }
    }

    /// `tile +- left' right` over `count` rows, of which the left ones have R columns.
    #[inline(always)]
    pub fn multiply<const TAKE: bool, const R: usize, const V: usize>(
        self,
        mut tile: Tile<F, R, V>,
        left: Part,
        right: Part,
        count: usize,
    ) -> Tile<F, R, V> {
        if count == 0 {
            return tile;
        }
        assert!(end(left.from, count, left.stride, R) <= left.data.len());
        assert!(end(right.from, count, right.stride, V * VECTOR) <= right.data.len());
        // SAFETY: all rows of both end within their data.
        unsafe {
            let at = |part: Part| Strided { at: part.data.as_ptr().add(part.from), stride: part.stride };
            F::multiply::<TAKE, R, V>(&mut tile, at(left), at(right), count);
        }
        tile
    }

    /// Row by row takes `unit[above][r]` times the rows above away, then scales.
    #[inline(always)]
    pub fn substitute<const R: usize, const V: usize>(
        self,
        mut tile: Tile<F, R, V>,
        unit: &[[f64; VECTOR]; VECTOR],
        scale: &[f64; VECTOR],
    ) -> Tile<F, R, V> {
        // SAFETY: the `Simd` was made where its instructions run.
        unsafe {
            for r in 1..R {
                for above in 0..r {
                    let factor = F::splat(unit[above][r]);
                    for v in 0..V {
                        tile[r][v] = tile[r][v].minus(factor, tile[above][v]);
                    }
                }
            }
            for r in 0..R {
                let factor = F::splat(scale[r]);
                for v in 0..V {
                    tile[r][v] = tile[r][v].times(factor);
                }
            }
        }
        tile
    }

    /// Products of three rows with three others of their length, which is a multiple of a register's.
    #[inline(always)]
    pub fn products(self, left: [&[f64]; 3], right: [&[f64]; 3]) -> [[f64; VECTOR]; 3] {
        let width = left[0].len();
        assert!(width.is_multiple_of(VECTOR) && left.iter().chain(&right).all(|row| row.len() == width));
        let mut out = [[0.0; VECTOR]; 3];
        // SAFETY: all rows are as long.
        unsafe {
            let mut sums: Tile<F, 3, 4> = self.zero();
            for k in (0..width).step_by(VECTOR) {
                let right = right.map(|row| F::load(row.as_ptr().add(k)));
                for i in 0..3 {
                    let own = F::load(left[i].as_ptr().add(k));
                    for j in 0..3 {
                        sums[i][j] = sums[i][j].plus(own, right[j]);
                    }
                }
            }
            for i in 0..3 {
                F::sums(sums[i]).store(out[i].as_mut_ptr());
            }
        }
        out
    }

    /// Four rows of `from`, each times its scale, become columns of the four rows that begin at `to`.
    #[inline(always)]
    pub fn turn(self, from: [&[f64]; 4], scale: [f64; 4], at: usize, out: &mut [f64], to: usize, stride: usize) {
        assert!(from.iter().all(|row| at + VECTOR <= row.len()) && end(to, VECTOR, stride, VECTOR) <= out.len());
        // SAFETY: all rows end within their data.
        unsafe {
            let row = |k: usize| F::load(from[k].as_ptr().add(at)).times(F::splat(scale[k]));
            let rows = F::turned([row(0), row(1), row(2), row(3)]);
            for k in 0..VECTOR {
                rows[k].store(out.as_mut_ptr().add(to + k * stride));
            }
        }
    }

    /// How many of the first registers of a row hold nothing.
    #[inline(always)]
    pub fn leading_zeros(self, row: &[f64]) -> usize {
        let whole = row.as_chunks::<VECTOR>().0;
        // SAFETY: each is as long as a register.
        whole.iter().take_while(|four| unsafe { F::load(four.as_ptr()).is_zero() }).count()
    }

    /// How many of the first rows of a part, of so many, hold nothing in the register at its beginning.
    #[inline(always)]
    pub fn empty_rows(self, part: Part, rows: usize) -> usize {
        assert!(rows == 0 || end(part.from, rows, part.stride, VECTOR) <= part.data.len());
        let at = |r: usize| part.data[part.from + r * part.stride..].as_ptr();
        // SAFETY: all rows end within the data.
        (0..rows).take_while(|&r| unsafe { F::load(at(r)).is_zero() }).count()
    }

    /// `to = from`, over whole registers.
    #[inline(always)]
    pub fn copy(self, from: &[f64], to: &mut [f64]) {
        let width = from.len().min(to.len()) / VECTOR * VECTOR;
        // SAFETY: both are at least as long.
        unsafe {
            for k in (0..width).step_by(VECTOR) {
                F::load(from.as_ptr().add(k)).store(to.as_mut_ptr().add(k));
            }
        }
    }

    /// `to += scale from`, over whole registers.
    #[inline(always)]
    pub fn add_scaled(self, from: &[f64], scale: f64, to: &mut [f64]) {
        let width = from.len().min(to.len()) / VECTOR * VECTOR;
        // SAFETY: both are at least as long.
        unsafe {
            let (factor, from, to) = (F::splat(scale), from.as_ptr(), to.as_mut_ptr());
            let add = |k: usize| F::load(to.add(k)).plus(factor, F::load(from.add(k))).store(to.add(k));
            let mut k = 0;
            while k + 4 * VECTOR <= width {
                [0, 1, 2, 3].into_iter().for_each(|v| add(k + v * VECTOR));
                k += 4 * VECTOR;
            }
            while k < width {
                add(k);
                k += VECTOR;
            }
        }
    }

    /// `to = a - b`, over whole registers.
    #[inline(always)]
    pub fn difference(self, a: &[f64], b: &[f64], to: &mut [f64]) {
        let width = a.len().min(b.len()).min(to.len()) / VECTOR * VECTOR;
        // SAFETY: all are at least as long.
        unsafe {
            let one = F::splat(1.0);
            for k in (0..width).step_by(VECTOR) {
                let (a, b) = (F::load(a.as_ptr().add(k)), F::load(b.as_ptr().add(k)));
                a.minus(one, b).store(to.as_mut_ptr().add(k));
            }
        }
    }

    /// `to = scale from`, over whole registers.
    #[inline(always)]
    pub fn scale(self, from: &[f64], scale: f64, to: &mut [f64]) {
        let width = from.len().min(to.len()) / VECTOR * VECTOR;
        // SAFETY: both are at least as long.
        unsafe {
            let factor = F::splat(scale);
            for k in (0..width).step_by(VECTOR) {
                F::load(from.as_ptr().add(k)).times(factor).store(to.as_mut_ptr().add(k));
            }
        }
    }
}

#[cfg(test)]
mod tests;
