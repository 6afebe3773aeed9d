//! Residuals of some readings after an update, relative to their expected size (Helmert's variance components; Teunissen
//! and Amiri-Simkooei 2008).
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::felt::Felt;
use super::twin::Role;
use crate::kernels::arch::{madd, Arch, Kernel};
use crate::kernels::dense::Square;
use crate::kernels::registers::VECTOR;
use crate::kernels::sparse_jacobian::SparseJacobian;

/// Sum of the squared residuals of `rows`, each divided by its noise variance, and the number of readings that it stands for.
pub(super) fn leftover(
    arch: Arch,
    felt: &mut Felt,
    (straight, roles, rows): (&SparseJacobian, &[Role], &[bool]),
    (p, shift, innovation): (&Square, &[f64], &[f64]),
    variance: impl Fn(usize) -> Option<f64>,
) -> (f64, f64) {
    let (mut squares, mut count) = (0.0, 0.0);
    for triple in straight.triples.iter().filter(|t| rows[t.row]) {
        let noise = triple.each(&variance);
        if noise == [None; 3] {
            continue;
        }
        let felt = felt.of(straight, roles, triple).states();
        let (told, spread) = arch.run(Residual { felt, p, shift });
        for (i, noise) in noise.into_iter().enumerate() {
            let Some(noise) = noise else { continue };
            let left = innovation[triple.row + i] - told[i];
            squares += left * left / noise;
            count += (1.0 - spread[i] / noise).max(0.0);
        }
    }
    (squares, count)
}

/// Of up to three rows side by side: J dx, and the diagonal of J P J'.
struct Residual<'a> {
    felt: &'a [(usize, [f64; VECTOR])],
    p: &'a Square,
    shift: &'a [f64],
}

impl Kernel for Residual<'_> {
    type Output = ([f64; VECTOR], [f64; VECTOR]);

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> Self::Output {
        let (mut told, mut half) = ([0.0; VECTOR], [0.0; VECTOR]);
        for (a, (s, by)) in self.felt.iter().enumerate() {
            let (row, moved) = (self.p.row(*s), self.shift[*s]);
            // P is symmetric: each pair of states counts twice, a state with itself once.
            let mut sum = by.map(|by| 0.5 * row[*s] * by);
            for (t, other) in &self.felt[..a] {
                let p = row[*t];
                for k in 0..VECTOR {
                    sum[k] = madd::<FUSED>(p, other[k], sum[k]);
                }
            }
            for k in 0..VECTOR {
                told[k] = madd::<FUSED>(moved, by[k], told[k]);
                half[k] = madd::<FUSED>(by[k], sum[k], half[k]);
            }
        }
        (told, half.map(|half| 2.0 * half))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three rows that depend on two of three states twice over and on a bias each, beside what is no state.
    #[test]
    fn residuals_are_those_of_plain_matrices() {
        const STATES: usize = 6;
        let number = |i: usize, j: usize| (1.7 * i as f64 + 0.9 * (j * j) as f64).sin();
        let mut straight = SparseJacobian { n: 7, ..SparseJacobian::default() };
        straight.push(0, 3, &[6, 2, 2, 1], Some(3));
        for (k, slope) in straight.slopes.iter_mut().enumerate() {
            slope.rows = [number(k, 1), number(k, 2), number(k, 3), 0.0];
        }
        let mut roles: Vec<Role> = (0..STATES).map(Role::State).collect();
        roles.push(Role::Considered(0, 1.0));
        let mut p = Square::zeros(STATES);
        for i in 0..STATES {
            (0..STATES).for_each(|j| *p.at_mut(i, j) = (0..STATES).map(|k| number(i, k) * number(j, k)).sum::<f64>());
        }
        let mut jacobian = vec![0.0; 3 * 7];
        straight.scatter(0, 7, &mut jacobian);
        let (shift, innovation): (Vec<f64>, Vec<f64>) = ((0..STATES).map(|i| number(i, 4)).collect(), vec![0.5; 3]);
        let (mut squares, mut count) = (0.0, 0.0);
        let noise = |r: usize| (r != 1).then_some(40.0 + r as f64);
        for r in [0, 2] {
            let j = &jacobian[r * 7..][..STATES];
            let told: f64 = j.iter().zip(&shift).map(|(j, x)| j * x).sum();
            let pair = |i: usize| (0..STATES).map(|k| j[i] * p.at(i, k) * j[k]).sum::<f64>();
            let noise = noise(r).unwrap();
            squares += (innovation[r] - told).powi(2) / noise;
            count += (1.0 - (0..STATES).map(pair).sum::<f64>() / noise).max(0.0);
        }
        for arch in [Arch::PORTABLE, Arch::best()] {
            let mut felt = Felt::new(&straight);
            let rows = (&straight, &roles[..], &[true; 3][..]);
            let update = (&p, &shift[..], &innovation[..]);
            let found = leftover(arch, &mut felt, rows, update, noise);
            // Sums of some forty products of numbers of about one.
            assert!(
                (found.0 - squares).abs() < 1e-13 && (found.1 - count).abs() < 1e-13,
                "{found:?} {squares} {count}"
            );
            assert!(count > 0.0);
            let none = leftover(arch, &mut felt, rows, update, |_| None);
            assert_eq!(none, (0.0, 0.0));
        }
    }
}
