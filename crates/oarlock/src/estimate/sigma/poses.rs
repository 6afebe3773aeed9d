//! H with columns of poses only, which the covariance form needs, and the other columns when they are wanted after all.

use super::PredictedReadings;
use crate::estimate::{FastSystem, Partition};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::registers::Part;
use crate::kernels::sparse_jacobian::{self, SparseJacobian};
use crate::kernels::tiles::{padded, Panel, VECTOR};

impl PredictedReadings {
    /// The same with columns of poses only in H, for a system with `linear_pattern`.
    pub fn of_poses<S: FastSystem>(system: &S) -> Self {
        let (n, rows) = (system.partition().dim(), system.row_count());
        PredictedReadings {
            poses_only: true,
            h: Panel::zeros(rows, padded(n) + VECTOR),
            ..PredictedReadings::new(system)
        }
    }

    /// Exact Jacobian by rates and linear block; `of_poses` has one.
    pub fn jacobian(&self) -> &SparseJacobian {
        self.linear.as_ref().expect("made with a pattern")
    }

    /// Behind `from_sigma_points`, H in all columns, with all of L.
    pub fn complete(&mut self, arch: Arch, l_transposed: &Panel) {
        arch.run(Completion { predicted: self, l_transposed });
    }

    #[inline(always)]
    pub(super) fn multiply_jacobian<const FUSED: bool>(&mut self, l_transposed: &Panel) {
        let Some(linear) = &mut self.linear else { return };
        sparse_jacobian::turn(l_transposed, self.part.dim(), &mut self.l_reversed);
        let count = self.part.dim() - self.part.pose;
        linear.times::<FUSED>(&self.l_reversed, count, &self.asked, &mut self.h);
    }

    /// Columns of L that begin at a pose state, in reverse order.
    pub fn reversed_poses(&self) -> Part<'_> {
        self.l_reversed.part(0, self.part.dim() - self.part.pose)
    }

    /// From now on H has all columns.
    pub fn keep_all_columns(&mut self) {
        self.poses_only = false;
    }
}

struct Completion<'a> {
    predicted: &'a mut PredictedReadings,
    l_transposed: &'a Panel,
}

impl Kernel for Completion<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.predicted.multiply_jacobian::<FUSED>(self.l_transposed);
    }
}

/// Transposes columns of poses, in reverse order, and of those of rates the rows of rates.
#[inline(always)]
pub(super) fn turn(factor: &Panel, part: Partition, turned: &mut Panel) {
    let n = part.dim();
    for k in 0..n {
        let row = &mut turned.row_mut(k)[..n];
        row.iter_mut().rev().enumerate().take(part.pose.min(k + 1)).for_each(|(i, x)| *x = factor.at(i, k));
        if (part.pose..part.curved()).contains(&k) {
            (part.pose..=k).for_each(|i| row[n - 1 - i] = factor.at(i, k));
        }
    }
}
