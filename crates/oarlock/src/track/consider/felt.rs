//! The states that a few rows depend on, and what these rows make of the slopes dx/dp.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::twin::Role;
use crate::kernels::arch::{madd, Arch, Kernel};
use crate::kernels::registers::VECTOR;
use crate::kernels::sparse_jacobian::{RowTriple, SparseJacobian};

/// States with the derivatives of up to three rows.
#[derive(Debug, Clone)]
pub(super) struct Felt(Vec<(usize, [f64; VECTOR])>);

impl Felt {
    /// For rows of this Jacobian.
    pub(super) fn new(straight: &SparseJacobian) -> Self {
        let most = straight.triples.iter().map(|t| t.slopes.len() + t.count).max();
        Felt(Vec::with_capacity(most.unwrap_or(0)))
    }

    /// The states of these rows. A state may occur twice.
    pub(super) fn of(&mut self, straight: &SparseJacobian, roles: &[Role], triple: &RowTriple) -> &Self {
        let slopes = straight.slopes[triple.slopes.clone()].iter().map(|s| (roles[s.state], s.rows));
        let added = (0..triple.count).filter_map(|i| {
            let by = std::array::from_fn(|k| f64::from(u8::from(k == i)));
            triple.added.map(|first| (roles[first + i], by))
        });
        let of_state = |(role, by)| if let Role::State(s) = role { Some((s, by)) } else { None };
        self.0.clear();
        self.0.extend(slopes.chain(added).filter_map(of_state));
        self
    }

    /// In any order.
    #[inline(always)]
    pub(super) fn states(&self) -> &[(usize, [f64; VECTOR])] {
        &self.0
    }

    /// J S for as many rows as `answers` has, of slopes S with a row of this width, a multiple of a vector's, for each state.
    pub(super) fn answer(&self, arch: Arch, slopes: &[f64], width: usize, answers: &mut [f64]) {
        arch.run(Answering { felt: self, slopes, width, answers });
    }
}

struct Answering<'a> {
    felt: &'a Felt,
    slopes: &'a [f64],
    width: usize,
    answers: &'a mut [f64],
}

/// Columns side by side: with three rows, their sums fill half the registers.
const WIDE: usize = 2 * VECTOR;

impl Kernel for Answering<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(mut self) {
        let whole = self.width / WIDE * WIDE;
        for at in (0..whole).step_by(WIDE) {
            self.columns::<FUSED, WIDE>(at);
        }
        for at in (whole..self.width).step_by(VECTOR) {
            self.columns::<FUSED, VECTOR>(at);
        }
    }
}

impl Answering<'_> {
    #[inline(always)]
    fn columns<const FUSED: bool, const WIDTH: usize>(&mut self, at: usize) {
        let mut sums = [[0.0; WIDTH]; 3];
        for (s, by) in self.felt.states() {
            let row: &[f64; WIDTH] = self.slopes[s * self.width + at..].first_chunk().expect("there is room");
            for i in 0..3 {
                for k in 0..WIDTH {
                    sums[i][k] = madd::<FUSED>(by[i], row[k], sums[i][k]);
                }
            }
        }
        for (answer, sums) in self.answers.chunks_exact_mut(self.width).zip(&sums) {
            answer[at..at + WIDTH].copy_from_slice(sums);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_answer_as_plain_matrices_do() {
        const STATES: usize = 4;
        let number = |i: usize, j: usize| (1.7 * i as f64 + 0.9 * (j * j) as f64).sin();
        for (width, count) in [(4, 1), (8, 2), (12, 3)] {
            let mut straight = SparseJacobian { n: STATES + 1, ..SparseJacobian::default() };
            straight.push(0, count, &[STATES, 3, 3, 0], Some(1));
            for (k, slope) in straight.slopes.iter_mut().enumerate() {
                slope.rows = [number(k, 1), number(k, 2), number(k, 3), 0.0];
            }
            let mut roles: Vec<Role> = (0..STATES).map(Role::State).collect();
            roles.push(Role::Considered(0, 1.0));
            let mut jacobian = vec![0.0; count * (STATES + 1)];
            straight.scatter(0, STATES + 1, &mut jacobian);
            let slopes: Vec<f64> = (0..STATES * width).map(|i| number(i, 7)).collect();
            for arch in [Arch::PORTABLE, Arch::best()] {
                let (mut felt, mut answers) = (Felt::new(&straight), vec![7.0; count * width]);
                felt.of(&straight, &roles, &straight.triples[0]).answer(arch, &slopes, width, &mut answers);
                for (i, k) in (0..count).flat_map(|i| (0..width).map(move |k| (i, k))) {
                    let by = |s: usize| jacobian[i * (STATES + 1) + s] * slopes[s * width + k];
                    let plain: f64 = (0..STATES).map(by).sum();
                    // Sums of half a dozen products of numbers below one.
                    assert!((answers[i * width + k] - plain).abs() < 1e-14, "{width} {count}: {i} {k}");
                }
            }
        }
    }
}
