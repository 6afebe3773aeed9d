//! Rauch-Tung-Striebel smoother (Rauch, Tung and Striebel 1965), one step back at a time.

use super::belief::Belief;
use super::dense::{accumulate, factor_of_covariance, Square};
use super::filter::Lost;
use super::transition::{carry, Block, Transition};
use super::System;
use crate::lane::arch::Arch;

/// Workspace of a smoother.
#[derive(Debug, Clone)]
pub struct Smoother {
    factor: Square,
    gain: Square,
    product: Square,
    step: Vec<f64>,
    shift: Vec<f64>,
    carried: Vec<Block>,
}

impl Smoother {
    /// Room for `n` states.
    pub fn new(n: usize) -> Self {
        Smoother {
            factor: Square::zeros(n),
            gain: Square::zeros(n),
            product: Square::zeros(n),
            step: vec![0.0; n],
            shift: vec![0.0; n],
            carried: Vec::new(),
        }
    }

    /// Turns `filtered` (at k) into the smoothed belief at k, given how it moved to `predicted` (at k + 1) and the
    /// smoothed belief `next` at k + 1.
    pub fn back<S: System>(
        &mut self,
        system: &S,
        filtered: &mut Belief,
        transition: &Transition,
        predicted: &Belief,
        next: &Belief,
    ) -> Result<(), Lost> {
        self.solve_gain(filtered, transition, predicted)?;
        system.difference(&next.mean, &predicted.mean, &mut self.step);
        let n = self.factor.n();
        self.shift.fill(0.0);
        accumulate(&mut self.shift, (0..n).map(|j| (self.step[j], self.gain.row(j))));
        self.move_covariance(system, filtered, predicted, next);
        system.shift(&mut filtered.mean, &self.shift);
        self.carried.clear();
        system.carry(&self.shift, &mut self.carried);
        self.carried.iter().for_each(|block| carry(Arch::best(), block, &mut filtered.covariance));
        Ok(())
    }

    /// Rows of `gain` are those of K', K = P F' Pp^-1.
    fn solve_gain(&mut self, filtered: &Belief, transition: &Transition, predicted: &Belief) -> Result<(), Lost> {
        let n = self.factor.n();
        factor_of_covariance(&predicted.covariance, &mut self.factor).map_err(|e| Lost {
            what: format!("smoothing met a covariance without sign (state {}, pivot {:.2e})", e.row, e.pivot),
        })?;
        self.product.copy_from(&filtered.covariance);
        transition.multiply_right_transposed(&mut self.product);
        for i in 0..n {
            for j in 0..n {
                *self.gain.at_mut(i, j) = self.product.at(j, i);
            }
        }
        for i in 0..n {
            let u = &self.factor;
            let (above, row) = self.gain.above_and_row(i);
            accumulate(row, (0..i).map(|k| (-u.at(k, i), &above[k * n..(k + 1) * n])));
            row.iter_mut().for_each(|x| *x /= u.at(i, i));
        }
        for i in (0..n).rev() {
            let u = &self.factor;
            let (row, below) = self.gain.row_and_below(i);
            accumulate(row, (i + 1..n).map(|k| (-u.at(i, k), &below[(k - i - 1) * n..(k - i) * n])));
            row.iter_mut().for_each(|x| *x /= u.at(i, i));
        }
        Ok(())
    }

    /// P + K (Pn - Pp) K', with Pn seen from the predicted mean.
    fn move_covariance<S: System>(&mut self, system: &S, filtered: &mut Belief, predicted: &Belief, next: &Belief) {
        let n = self.factor.n();
        self.factor.copy_from(&next.covariance);
        self.carried.clear();
        self.step.iter_mut().for_each(|x| *x = -*x);
        system.carry(&self.step, &mut self.carried);
        self.carried.iter().for_each(|block| carry(Arch::best(), block, &mut self.factor));
        for i in 0..n {
            let (pn, pp) = (self.factor.row(i), predicted.covariance.row(i));
            let row = self.product.row_mut(i);
            row.fill(0.0);
            accumulate(row, (0..n).map(|j| (pn[j] - pp[j], self.gain.row(j))));
        }
        for i in 0..n {
            let row = &mut filtered.covariance.row_mut(i)[i..];
            accumulate(row, (0..n).map(|k| (self.gain.at(k, i), &self.product.row(k)[i..])));
        }
        filtered.covariance.mirror_upper();
    }
}
