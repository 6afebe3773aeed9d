//! Rauch-Tung-Striebel smoothing (1965) of strapdown links, one update back at a time, on the filter's own errors. `track` uses it.

use super::covariance::{mix_rows, move_rows, push_rows, pushed_rows, UNIT};
use super::filter::{Means, Node, StrapdownFilter};
use super::increment::Increment;
use crate::error::{Error, Result};
use crate::estimate::smoother::Backward;
use crate::kernels::dense::Square;
use crate::rotation::turn::Turn;
use crate::rotation::Vec3;

impl StrapdownFilter {
    /// The error that moves `from` to `to`; see `shift`.
    pub(super) fn difference(&self, to: &Means, from: &Means, out: &mut [f64]) {
        let mut put = |first: usize, v: Vec3<f64>| out[first..first + 3].copy_from_slice(&v.0);
        for (i, (a, b)) in to.units.iter().zip(&from.units).enumerate() {
            let first = UNIT * i;
            let turn = a.rotation.times_transposed(&b.rotation);
            put(first, Vec3(Turn::of(&turn).log()));
            put(first + 3, a.velocity - turn.apply(b.velocity));
            put(first + 6, a.position - turn.apply(b.position));
            put(first + 9, a.gyro_bias - b.gyro_bias);
            put(first + 12, a.accel_bias - b.accel_bias);
        }
        for (number, (a, b)) in to.loose.iter().zip(&from.loose).enumerate() {
            put(self.loose_state(number), Vec3(Turn::of(&a.times_transposed(b)).log()));
        }
        for ((a, b), first) in to.constants.iter().zip(&from.constants).zip(self.constants()) {
            put(first, *a - *b);
        }
        if let Some(i) = self.azimuth_state() {
            out[i] = to.azimuth - from.azimuth;
        }
        for (k, (a, b)) in to.pushes.iter().zip(&from.pushes).enumerate() {
            out[self.push_state(k)] = a - b;
        }
        if let Some(first) = self.room_state() {
            out[first..first + 3].copy_from_slice(&(to.room - from.room).0);
        }
        for (k, (a, b)) in to.lengths.iter().zip(&from.lengths).enumerate() {
            out[self.length_state(k)] = a - b;
        }
        for (number, (a, b)) in to.slides.iter().zip(&from.slides).enumerate() {
            (0..2).for_each(|k| out[self.slide_state(number) + k] = a[k] - b[k]);
        }
    }

    /// Smoothed means and covariance before the node's prediction, given those after it.
    pub fn back(
        &self,
        backward: &mut Backward,
        node: &Node,
        next: &Means,
        next_covariance: &Square,
    ) -> Result<(Means, Square)> {
        let mut step = vec![0.0; self.size];
        self.difference(next, &node.predicted, &mut step);
        let mut covariance = node.covariance.clone();
        let duration_s = node.steps.first().map_or(0.0, |step| step.duration_s);
        let (pushed, decays, slides) = (self.pushed(), self.decays(duration_s), self.slide_shares(duration_s));
        let moved = |panel: &mut crate::kernels::tiles::Panel| {
            for (i, step) in node.steps.iter().enumerate() {
                let rows: [usize; UNIT] = std::array::from_fn(|r| UNIT * i + r);
                move_rows::<false>(step, &mut panel.rows_of(rows));
                for (state, axis) in &pushed {
                    push_rows(step, *axis, &mut panel.rows_of(pushed_rows(i, *state)));
                }
            }
            for (state, share) in &decays {
                let [row] = panel.rows_of([*state]);
                row.iter_mut().for_each(|x| *x *= share);
            }
            for (first, share) in &slides {
                mix_rows(share, panel.rows_of([*first, first + 1]));
            }
        };
        let shift = backward
            .step((next_covariance, &node.predicted_covariance), &mut covariance, &step, moved)
            .map_err(|lost| Error::Diverged {
                time_s: node.before_s,
                text: format!("smoothing stopped at {:.3} s: {}; use the filtered track", node.before_s, lost.what),
            })?;
        let mut means = node.before.clone();
        self.shift(&mut means, shift);
        Ok((means, covariance))
    }

    /// Smoothed means carried on by increments that were integrated with the biases of `filtered`.
    pub fn carried(&self, smoothed: &Means, filtered: &Means, increments: &[Increment]) -> Means {
        let mut means = smoothed.clone();
        let gravity = self.gravity_in(smoothed);
        for ((mean, before), increment) in means.units.iter_mut().zip(&filtered.units).zip(increments) {
            let biases = (mean.gyro_bias - before.gyro_bias, mean.accel_bias - before.accel_bias);
            *mean = self.moved(mean, &increment.corrected(biases.0, biases.1), gravity);
        }
        means
    }

    /// States that never change: their errors are the same at all times.
    pub fn lasting(&self) -> Vec<usize> {
        let skins: Vec<usize> = self.skins().collect();
        let constants = self.constants().filter(|first| !skins.contains(first)).flat_map(|first| first..first + 3);
        let mut all: Vec<usize> =
            constants.chain((0..self.skeleton.lengths.len()).map(|k| self.length_state(k))).collect();
        all.sort_unstable();
        all
    }

    /// What means lack to others at the same time.
    pub fn lack(&self, to: &Means, from: &Means) -> Vec<f64> {
        let mut out = vec![0.0; self.size];
        self.difference(to, from, &mut out);
        out
    }
}
