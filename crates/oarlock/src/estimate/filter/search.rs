//! The iterated update (Bell and Cathey 1993): Gauss-Newton on |x - x0|^2 in P plus |z - h(x)|^2 in R.
//!
//! At x_k, with xi leading there from the prior mean x0, the update of the prior is done again with the Jacobian J at x_k and the
//! innovation z - h(x_k) + J xi. Both xi and J are those of the tangent space at x0: the readings' own, at x_k, is
//! seen from there by the Jacobian of the move (`System::carry`). Gates and reports are those of the first round. Where a round
//! leads uphill, as Gauss-Newton may, the one before it stands; the first of all is the extended filter's update.

use super::tangent::{At, Tangent};
use super::{broken, Filter, Lost};
use crate::estimate::dense::accumulate;
use crate::estimate::solve::{Solver, Weighted};
use crate::estimate::System;

/// A round that moves the state by less than this, in standard deviations behind the update, is the last.
const SETTLED_SIGMA: f64 = 0.01;

/// Room for a search.
#[derive(Debug, Clone)]
pub struct Search {
    /// How often the readings are linearised, at most.
    rounds: usize,
    mean: Vec<f64>,
    /// Where the mean lies from the prior's, along the rows of the factor in reverse, and how far the last round took it.
    place: Vec<f64>,
    step: Vec<f64>,
    before: Vec<f64>,
}

impl Search {
    /// For `n` states.
    pub fn new(rounds: usize, n: usize) -> Self {
        let zero = vec![0.0; n];
        Search { rounds, mean: zero.clone(), place: zero.clone(), step: zero.clone(), before: zero }
    }

    /// Moves on to where the update leads; how far that is in standard deviations behind it.
    fn follow(&mut self, solver: &Solver) -> f64 {
        self.before.copy_from_slice(&self.place);
        solver.place(&mut self.place);
        let both = self.place.iter().zip(&self.before);
        self.step.iter_mut().zip(both).for_each(|(step, (to, from))| *step = to - from);
        solver.length(&self.step)
    }
}

impl<S: System> Filter<S> {
    /// Linearises again where the last round leads, until that moves no more. The first round's update stands ready.
    pub(super) fn iterate(&mut self, system: &S, moment: &S::Moment, prior: &[f64], z: &[f64]) -> Result<(), Lost> {
        let Some((mut tangent, mut search)) = self.linear.take() else { return Ok(()) };
        let done = self.rounds(&mut tangent, &mut search, (system, moment), prior, z);
        self.linear = Some((tangent, search));
        done
    }

    fn rounds(
        &mut self,
        tangent: &mut Tangent,
        search: &mut Search,
        of: (&S, &S::Moment),
        prior: &[f64],
        z: &[f64],
    ) -> Result<(), Lost> {
        if search.rounds < 2 {
            return Ok(());
        }
        search.place.fill(0.0);
        let mut cost = self.solver.cost(&search.place);
        for _ in 1..search.rounds {
            if search.follow(&self.solver) < SETTLED_SIGMA {
                break;
            }
            self.update_at(tangent, search, of, prior, z)?;
            let there = self.solver.cost(&search.place);
            // Written so that what is not a number is uphill too.
            let downhill = there < cost;
            if !downhill {
                search.place.copy_from_slice(&search.before);
                return self.update_at(tangent, search, of, prior, z);
            }
            cost = there;
        }
        Ok(())
    }

    /// The prior's update with readings and slopes at the search's place.
    fn update_at(
        &mut self,
        tangent: &mut Tangent,
        search: &mut Search,
        of: (&S, &S::Moment),
        prior: &[f64],
        z: &[f64],
    ) -> Result<(), Lost> {
        self.move_along(of.0, &search.place);
        search.mean.copy_from_slice(prior);
        of.0.shift(&mut search.mean, &self.shift);
        let at = At { mean: &search.mean, carried: &self.carried, rows: &self.rows };
        tangent.spread(self.arch, &mut self.fan, of, &mut self.scratch, at);
        for &r in &self.rows {
            let moved: f64 = self.fan.odd.row(r).iter().zip(&search.place).map(|(h, p)| h * p).sum();
            self.y[r] = self.weight[r] * (z[r] - self.fan.center[r] + moved);
        }
        let (rows, inertial) = (&self.rows, self.inertial_rows);
        let readings = Weighted { rows, inertial, weight: &self.weight, y: &self.y };
        self.solver.weigh(self.arch, &self.fan, readings);
        // What was not believed at first is not believed now.
        self.rows.iter().filter(|&&r| !self.used[r]).for_each(|&r| self.solver.reject(r));
        self.solver.solve(self.arch, &self.root).map_err(broken)?;
        Ok(())
    }

    /// The way to `place` in the prior's tangent space, and how that space turns on it.
    fn move_along(&mut self, system: &S, place: &[f64]) {
        let n = place.len();
        self.shift.fill(0.0);
        for (i, &along) in place.iter().rev().enumerate() {
            accumulate(&mut self.shift[i..], std::iter::once((along, &self.root.row(i)[i..n])));
        }
        self.carried.clear();
        system.carry(&self.shift, &mut self.carried);
    }
}
