//! Collects the normal equations of all consider states and clock delays while a recording is filtered, for `score`.

use super::delays::Delays;
use super::slopes::Multiplying;
use super::tally::Tally;
use crate::body::Body;
use crate::estimate::filter::Filter;
use crate::estimate::information::{Columns, Side};
use crate::kernels::arch::Arch;
use crate::kernels::dense::Square;

/// Normal equations with their workspace.
#[derive(Debug, Clone)]
pub(super) struct Scoring {
    pub(super) delays: Delays,
    pub(super) tally: Tally,
    /// B and the innovations, divided by noise, then by factors of the filter's S (U5).
    weighed: Columns,
    surprise: Columns,
    /// J'WB and P+ J'WB.
    pub(super) pull: Vec<f64>,
    lost: Vec<f64>,
}

impl Scoring {
    pub(super) fn new(delays: Delays, tally: Tally, (n, m, width): (usize, usize, usize)) -> Self {
        Scoring {
            delays,
            tally,
            weighed: Columns::zeros(m, width),
            surprise: Columns::zeros(m, 1),
            pull: vec![0.0; n * width],
            lost: vec![0.0; n * width],
        }
    }

    /// Adds the rows of an update: `answers` are B, `weights` one over the noise's standard deviation or 0. Returns WB, divided
    /// once by the noise.
    pub(super) fn take_rows(
        &mut self,
        filter: &Filter<Body>,
        (answers, weights, innovation): (&[f64], &[f64], &[f64]),
    ) -> &Columns {
        let width = answers.len() / weights.len();
        self.weighed.clear();
        self.surprise.clear();
        let used = weights.iter().enumerate().filter(|(_, w)| **w > 0.0);
        for (r, w) in used.clone() {
            let answer = &answers[r * width..(r + 1) * width];
            self.weighed.row_mut(r).iter_mut().zip(answer).for_each(|(x, a)| *x = w * a);
            self.surprise.row_mut(r)[0] = w * innovation[r];
        }
        filter.substitute(Side::Left, &mut self.weighed);
        filter.substitute(Side::Left, &mut self.surprise);
        used.for_each(|(r, _)| self.tally.row(self.weighed.row(r), self.surprise.row(r)[0]));
        filter.substitute(Side::Right, &mut self.weighed);
        &self.weighed
    }

    /// Subtracts what the update of the states explains; `pull` has been computed.
    pub(super) fn take_states(&mut self, arch: Arch, p: &Square, shift: &[f64]) {
        let width = self.pull.len() / p.n();
        self.lost.fill(0.0);
        arch.run(Multiplying { out: &mut self.lost, p, of: self.pull.chunks_exact(width), width });
        self.tally.update(&self.pull, &self.lost, shift);
    }
}
