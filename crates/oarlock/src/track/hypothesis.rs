//! `Hypothesis`: a state estimate, the memory of the stages of a step, and its likelihood. `Tracker` and `bank` use it.

mod flat;

use super::faults::FaultState;
use super::magnetic::{FieldState, IronState, LagState};
use super::rest::RestState;
use super::stance::StanceState;
use super::strapdown::LinkState;
use crate::estimate::belief::Belief;
use crate::estimate::System;
pub use flat::MEMORY;

/// Everything that a tracker knows at one instant. The next step depends on nothing else.
#[derive(Debug, PartialEq)]
pub struct Hypothesis {
    /// State estimate of the filter.
    pub belief: Belief,
    /// Memory of each source.
    pub sources: Vec<SourceMemory>,
    /// Derivatives of the mean by the parameters of a score, a row for each state; empty unless a recording is scored.
    pub slopes: Vec<f64>,
    /// Number among the hypotheses of the last split.
    pub line: u64,
    /// Logarithm of its likelihood relative to the others.
    pub score: f64,
    /// Other hypotheses that are still followed. They have no rivals of their own.
    pub rivals: Vec<Hypothesis>,
    /// Of strapdown links: everything else that their filter knows.
    pub(crate) links: Option<Box<LinkState>>,
}

/// Memory of one source between samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceMemory {
    /// Time of its last reading, s; NaN if there was none.
    pub seen_s: f64,
    pub(super) rest: RestState,
    pub(super) faults: FaultState,
    pub(super) stance: StanceState,
    pub(super) field: FieldState,
    pub(super) iron: IronState,
    pub(super) lag: LagState,
}

impl SourceMemory {
    /// A memory that contains only the time of the last reading.
    pub fn new(seen_s: f64) -> Self {
        SourceMemory {
            seen_s,
            rest: RestState::NONE,
            faults: FaultState::NONE,
            stance: StanceState::NONE,
            field: FieldState::NONE,
            iron: IronState::NONE,
            lag: LagState::NONE,
        }
    }
}

impl Clone for Hypothesis {
    fn clone(&self) -> Self {
        Hypothesis {
            belief: self.belief.clone(),
            sources: self.sources.clone(),
            slopes: self.slopes.clone(),
            rivals: self.rivals.clone(),
            links: self.links.clone(),
            ..*self
        }
    }

    fn clone_from(&mut self, from: &Self) {
        let Hypothesis { belief, sources, slopes, line, score, rivals, links } = self;
        belief.clone_from(&from.belief);
        sources.clone_from(&from.sources);
        slopes.clone_from(&from.slopes);
        rivals.clone_from(&from.rivals);
        links.clone_from(&from.links);
        (*line, *score) = (from.line, from.score);
    }
}

impl Hypothesis {
    /// A new hypothesis without rivals; all `sources` count as read just now.
    pub fn new(belief: Belief, sources: usize) -> Self {
        let sources = vec![SourceMemory::new(belief.time_s); sources];
        Hypothesis { belief, sources, slopes: Vec::new(), line: 0, score: 0.0, rivals: Vec::new(), links: None }
    }

    /// What the filter of strapdown links knows, as numbers; empty for a tree.
    pub fn flat_links(&self) -> Vec<f64> {
        self.links.as_ref().map_or_else(Vec::new, |links| links.to_flat())
    }

    /// With the result of `flat_links`; `None` if it is none.
    pub fn with_links(self, flat: &[f64]) -> Option<Self> {
        let links = if flat.is_empty() { None } else { Some(Box::new(LinkState::from_flat(flat)?)) };
        Some(Hypothesis { links, ..self })
    }

    /// Hypothesis number `line` alone; `self` if no rival has that number.
    pub fn alone(&self, line: u64) -> Hypothesis {
        let chosen = std::iter::once(self).chain(&self.rivals).find(|one| one.line == line).unwrap_or(self);
        let Hypothesis { belief, sources, slopes, links, .. } = chosen;
        Hypothesis {
            belief: belief.clone(),
            sources: sources.clone(),
            slopes: slopes.clone(),
            rivals: Vec::new(),
            links: links.clone(),
            ..*chosen
        }
    }

    /// Writes variances into `variance`. With rivals: second moments of all hypotheses about this mean.
    pub fn variances<S: System>(&self, system: &S, variance: &mut [f64]) {
        self.belief.covariance.diagonal(variance);
        if !self.rivals.is_empty() {
            self.mix(system, variance);
        }
        variance.iter_mut().for_each(|x| *x = x.max(0.0));
    }

    /// Writes standard deviations into `std`. With rivals: those of all hypotheses about this mean.
    pub fn spread<S: System>(&self, system: &S, std: &mut [f64]) {
        self.variances(system, std);
        std.iter_mut().for_each(|x| *x = x.sqrt());
    }

    /// Standard deviations of this hypothesis alone.
    pub fn own_spread(&self) -> Vec<f64> {
        let mut std = vec![0.0; self.belief.mean.len()];
        self.belief.variances(&mut std);
        std.iter_mut().for_each(|x| *x = x.sqrt());
        std
    }

    fn mix<S: System>(&self, system: &S, variance: &mut [f64]) {
        let weight = |one: &Hypothesis| (one.score - self.score).min(0.0).exp();
        let total = 1.0 + self.rivals.iter().map(weight).sum::<f64>();
        let mut away = vec![0.0; variance.len()];
        variance.iter_mut().for_each(|v| *v /= total);
        for rival in &self.rivals {
            system.difference(&rival.belief.mean, &self.belief.mean, &mut away);
            let share = weight(rival) / total;
            for (i, (v, d)) in variance.iter_mut().zip(&away).enumerate() {
                *v += share * (rival.belief.covariance.at(i, i) + d * d);
            }
        }
    }
}
