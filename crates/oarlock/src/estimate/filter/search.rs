//! The iterated update (Bell and Cathey 1993): Gauss-Newton on |x - x0|^2 in P plus |z - h(x)|^2 in R.
//!
//! At x_k, with xi leading there from the prior mean x0, the update of the prior is done again with the Jacobian J at x_k and the
//! innovation z - h(x_k) + J xi. Both xi and J are those of the tangent space at x0: the readings' own, at x_k, is
//! seen from there by the Jacobian of the move (`System::carry`). Gates and reports are those of the first round. Where a round
//! leads uphill, as Gauss-Newton may, the one before it stands; the first of all is the extended filter's update.

use super::tangent::Tangent;
use super::{squared, Filter, Lost, Sighting};
use crate::estimate::dense::{accumulate, solve, Square};
use crate::estimate::System;

/// A round that moves the state by less than this, in standard deviations behind the update, is the last.
const SETTLED_SIGMA: f64 = 0.01;

/// Room for a search.
#[derive(Debug, Clone)]
pub struct Search {
    /// How often the readings are linearised, at most.
    pub rounds: usize,
    mean: Vec<f64>,
    /// Where the mean lies from the prior's, along the columns of the fan, and how far the last round took it.
    place: Vec<f64>,
    step: Vec<f64>,
    before: Vec<f64>,
}

impl Search {
    /// For `n` states and fans of `width` columns.
    pub fn new(rounds: usize, n: usize, width: usize) -> Self {
        Search { rounds, mean: vec![0.0; n], place: vec![0.0; width], step: vec![0.0; width], before: vec![0.0; width] }
    }

    /// Moves on to where the update in `gram` and `b` leads; how far that is in standard deviations behind it.
    fn follow(&mut self, gram: &Square, b: &[f64]) -> f64 {
        self.before.copy_from_slice(&self.place);
        self.step.copy_from_slice(b);
        solve(gram, 0, &mut self.step);
        for (place, step) in self.place.iter_mut().zip(&mut self.step) {
            let to = *step;
            *step -= *place;
            *place = to;
        }
        let along = |i: usize| -> f64 { gram.row(i)[i..].iter().zip(&self.step[i..]).map(|(v, s)| v * s).sum() };
        (0..self.step.len()).map(|i| along(i).powi(2)).sum::<f64>().sqrt()
    }
}

impl<S: System> Filter<S> {
    /// Linearises again where the last round leads, until that moves no more. The first round's update stands ready.
    pub(super) fn iterate(
        &mut self,
        system: &S,
        moment: &S::Moment,
        prior: &[f64],
        sighting: Sighting,
    ) -> Result<(), Lost> {
        let Some((mut tangent, mut search)) = self.linear.take() else { return Ok(()) };
        let done = self.rounds(&mut tangent, &mut search, (system, moment), prior, sighting);
        self.linear = Some((tangent, search));
        done
    }

    fn rounds(
        &mut self,
        tangent: &mut Tangent,
        search: &mut Search,
        (system, moment): (&S, &S::Moment),
        prior: &[f64],
        sighting: Sighting,
    ) -> Result<(), Lost> {
        search.place.fill(0.0);
        let mut cost = self.cost(&search.place);
        for _ in 1..search.rounds {
            if search.follow(&self.gram, &self.b) < SETTLED_SIGMA {
                break;
            }
            self.linearise_at(tangent, search, (system, moment), prior, sighting.z);
            let there = self.cost(&search.place);
            // Written so that what is not a number is uphill too.
            let downhill = there < cost;
            if !downhill {
                search.place.copy_from_slice(&search.before);
                self.linearise_at(tangent, search, (system, moment), prior, sighting.z);
            }
            self.solve()?;
            if !downhill {
                break;
            }
            cost = there;
        }
        Ok(())
    }

    /// Readings and slopes at the search's place.
    fn linearise_at(
        &mut self,
        tangent: &mut Tangent,
        search: &mut Search,
        (system, moment): (&S, &S::Moment),
        prior: &[f64],
        z: &[f64],
    ) {
        self.move_along(system, &search.place);
        search.mean.copy_from_slice(prior);
        system.shift(&mut search.mean, &self.shift);
        let at = (search.mean.as_slice(), self.carried.as_slice());
        tangent.spread(&mut self.fan, system, (moment, &mut self.scratch), at, z);
        self.whiten_again(z, &search.place);
    }

    /// What is minimised, at the place where the readings are linearised.
    fn cost(&self, place: &[f64]) -> f64 {
        let rows = self.y.iter().zip(self.fan.g.chunks_exact(self.fan.width));
        let left = |(y, g): (&f64, &[f64])| y - g.iter().zip(place).map(|(g, p)| g * p).sum::<f64>();
        squared(place) + rows.map(left).map(|x| x * x).sum::<f64>()
    }

    /// The way to `place` in the prior's tangent space, and how that space turns on it.
    fn move_along(&mut self, system: &S, place: &[f64]) {
        self.shift.fill(0.0);
        // The last column of a fan belongs to the first row of the factor.
        for (i, &along) in place.iter().rev().enumerate().take(self.factor.n()) {
            accumulate(&mut self.shift[i..], std::iter::once((along, &self.factor.row(i)[i..])));
        }
        self.carried.clear();
        system.carry(&self.shift, &mut self.carried);
    }

    /// Like the first time, for the same rows, with the innovation against the prior.
    fn whiten_again(&mut self, z: &[f64], place: &[f64]) {
        let (width, n) = (self.fan.width, self.factor.n());
        for (r, g) in self.fan.g.chunks_exact_mut(width).enumerate() {
            if !self.used[r] {
                g.fill(0.0);
                continue;
            }
            let weight = self.weight[r];
            g.iter_mut().for_each(|x| *x *= weight);
            let moved: f64 = g[width - n..].iter().zip(&place[width - n..]).map(|(g, p)| g * p).sum();
            self.y[r] = weight * (z[r] - self.fan.center[r]) + moved;
        }
    }
}
