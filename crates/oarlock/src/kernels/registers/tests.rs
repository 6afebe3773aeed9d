//! Tests of the operations on tiles, with each instruction set.

use super::*;
use crate::kernels::arch::{with_simd, Arch, Kernel};

/// Runs a check with each instruction set that this machine has.
trait Check {
    fn check<F: F64x4>(&self, simd: Simd<F>);

    fn everywhere(&self)
    where
        Self: Sized,
    {
        [Arch::PORTABLE, Arch::best()].into_iter().for_each(|arch| arch.run(Checking(self)));
    }
}

struct Checking<'a, C>(&'a C);

impl<C: Check> Kernel for Checking<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| self.0.check(simd));
    }
}

fn number(i: usize) -> f64 {
    (0.7 + 1.3 * i as f64).sin()
}

struct Products;

impl Check for Products {
    fn check<F: F64x4>(&self, simd: Simd<F>) {
        let rows: Vec<Vec<f64>> = (0..6).map(|r| (0..12).map(|k| number(r * 12 + k)).collect()).collect();
        let three = |first: usize| std::array::from_fn(|k| rows[first + k].as_slice());
        let products = simd.products(three(0), three(3));
        for i in 0..3 {
            for j in 0..3 {
                let plain: f64 = rows[i].iter().zip(&rows[3 + j]).map(|(a, b)| a * b).sum();
                // A dozen products of numbers below one.
                assert!((products[i][j] - plain).abs() < 1e-14, "{i} {j}");
            }
        }
    }
}

#[test]
fn products_are_sums_over_rows() {
    Products.everywhere();
}

struct Moving;

impl Check for Moving {
    fn check<F: F64x4>(&self, simd: Simd<F>) {
        let rows: Vec<Vec<f64>> = (0..4).map(|r| (0..9).map(|k| number(r * 9 + k)).collect()).collect();
        let mut out = vec![0.0; 40];
        simd.turn(std::array::from_fn(|r| rows[r].as_slice()), [1.0, 2.0, 3.0, 4.0], 5, &mut out, 2, 10);
        for i in 0..4 {
            for j in 0..4 {
                assert_eq!(out[2 + 10 * i + j], rows[j][5 + i] * (j + 1) as f64);
            }
        }
        let mut scaled = [7.0; 9];
        simd.scale(&rows[0], 2.0, &mut scaled);
        assert_eq!((scaled[7], scaled[8]), (2.0 * rows[0][7], 7.0));
        simd.copy(&rows[1], &mut scaled);
        assert_eq!((scaled[0], scaled[7], scaled[8]), (rows[1][0], rows[1][7], 7.0));
    }
}

#[test]
fn rows_turn_scale_and_move_in_whole_registers() {
    Moving.everywhere();
}

struct Zeros;

impl Check for Zeros {
    fn check<F: F64x4>(&self, simd: Simd<F>) {
        for (last, zeros) in [(0.0, 3), (-0.0, 3), (f64::MIN_POSITIVE / 4.0, 2), (f64::NAN, 2)] {
            let row = [0.0, -0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, last, 0.0, 0.0];
            assert_eq!(simd.leading_zeros(&row), zeros, "{last}");
            let part = Part { data: &row, from: 0, stride: 4 };
            assert_eq!(simd.empty_rows(part, 3), zeros, "{last}");
        }
    }
}

#[test]
fn zeros_have_either_sign_and_the_least_number_is_none() {
    Zeros.everywhere();
}

struct Beyond;

impl Check for Beyond {
    fn check<F: F64x4>(&self, simd: Simd<F>) {
        let data = [0.0; 10];
        let _: Tile<F, 2, 1> = simd.load(Part { data: &data, from: 3, stride: 4 });
    }
}

#[test]
#[should_panic(expected = "p.data.len()")]
fn tiles_that_do_not_fit_are_refused() {
    Beyond.everywhere();
}

const COUNT: usize = 7;
const LEFT: usize = 5;
const RIGHT: usize = 13;

/// Sums of four rows of three registers, of which the last row ends with the last number of what is read.
struct Sums {
    rows: usize,
}

impl Sums {
    fn sums<F: F64x4, const TAKE: bool>(&self, simd: Simd<F>) -> Vec<f64> {
        let left: Vec<f64> = (0..(COUNT - 1) * LEFT + 4).map(number).collect();
        let right: Vec<f64> = (0..(self.rows - 1) * RIGHT + 12).map(|i| number(3 * i)).collect();
        let part = |data, stride| Part { data, from: 0, stride };
        let tile: Tile<F, 4, 3> = simd.load(Part { data: &[0.5; 48], from: 0, stride: 12 });
        let tile = simd.multiply::<TAKE, 4, 3>(tile, part(&left, LEFT), part(&right, RIGHT), COUNT);
        let mut out = vec![0.0; 48];
        simd.store(tile, &mut out, 0, 12);
        out
    }
}

impl Check for Sums {
    fn check<F: F64x4>(&self, simd: Simd<F>) {
        let (added, taken) = (self.sums::<F, false>(simd), self.sums::<F, true>(simd));
        for (r, c) in (0..4).flat_map(|r| (0..12).map(move |c| (r, c))) {
            let plain: f64 = (0..COUNT).map(|k| number(k * LEFT + r) * number(3 * (k * RIGHT + c))).sum();
            // Seven products of numbers below one.
            assert!((added[r * 12 + c] - 0.5 - plain).abs() < 1e-14, "{r} {c}");
            assert!((taken[r * 12 + c] - 0.5 + plain).abs() < 1e-14, "{r} {c}");
        }
    }
}

#[test]
fn the_tile_that_fills_all_registers_has_sums_of_products() {
    Sums { rows: COUNT }.everywhere();
}

#[test]
#[should_panic(expected = "right.data.len()")]
fn products_beyond_the_end_are_refused() {
    Sums { rows: COUNT - 1 }.everywhere();
}
