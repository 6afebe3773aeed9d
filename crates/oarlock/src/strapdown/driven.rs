//! Links that only encoders measure, legs through them, and loops that need them. `filter` and `readings` use it.

use super::filter::StrapdownFilter;
use super::sensors::{Heard, Measures, HOLD_S};
use super::skeleton::{Closure, End, Leg, Pose};

impl StrapdownFilter {
    /// What encoders say at a time of the links that only they measure; those that are silent stay.
    pub(super) fn inputs(&self, heard: &[Heard], time_s: f64, before: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut inputs = before.to_vec();
        for (sensor, heard) in self.skeleton.sensors.iter().zip(heard) {
            if let (Measures::Input(c), Some(value)) = (&sensor.measures, heard.near(time_s)) {
                inputs[*c] = [value, heard.rate(time_s)];
            }
        }
        inputs
    }

    /// The same before any row; an encoder that speaks later has its first value already, and one that never speaks is at rest.
    pub(super) fn first_inputs(&self, heard: &[Heard], time_s: f64) -> Vec<[f64; 2]> {
        let mut first: Vec<[f64; 2]> = self.skeleton.rest.iter().map(|q| [*q, 0.0]).collect();
        for (sensor, heard) in self.skeleton.sensors.iter().zip(heard) {
            if let (Measures::Input(c), Some((_, value))) = (&sensor.measures, heard.all.front()) {
                first[*c][0] = value[0];
            }
        }
        self.inputs(heard, time_s, &first)
    }

    /// For how long the only encoders of a coordinate have been silent, s. An input for which the model has no encoder, and that never spoke, is
    /// at rest.
    pub(super) fn silences(&self, heard: &[Heard], time_s: f64) -> Vec<f64> {
        let mut silences = vec![0.0; self.skeleton.rest.len()];
        for (sensor, heard) in self.skeleton.sensors.iter().zip(heard) {
            if let Measures::Input(c) = sensor.measures {
                let is_at_rest = heard.all.is_empty() && !self.skeleton.encoded[c];
                silences[c] = if is_at_rest { 0.0 } else { heard.silence_s(time_s) };
            }
        }
        silences
    }

    /// Whether encoders that a leg needs are silent.
    pub(super) fn is_stale_leg(&self, leg: &Leg) -> bool {
        let mut link = leg.link;
        let mut all = leg.by.into_iter().collect::<Vec<usize>>();
        while let Some(l) = link.filter(|l| self.skeleton.links[*l].pose == Pose::Driven) {
            all.extend(self.skeleton.links[l].turns.coordinates().into_iter().flatten());
            link = self.skeleton.links[l].parent;
        }
        all.iter().any(|c| self.silences[*c] > HOLD_S)
    }

    /// Whether a loop of the model is read.
    pub fn is_loop_read(&self, number: usize) -> bool {
        let closure = self.skeleton.closures.iter().filter(|c| c.loop_std_m.is_some()).nth(number);
        self.closures && closure.is_some_and(|closure| self.can_read(closure))
    }

    /// Whether a unit is silent, and nothing holds it meanwhile.
    pub(super) fn is_silent(&self, u: usize) -> bool {
        self.silent[u] && !self.skeleton.is_held()
    }

    /// Whether a link's unit is silent, or its joints are let go.
    pub(super) fn is_let_go(&self, link: usize) -> bool {
        matches!(self.skeleton.links[link].pose, Pose::Unit(u) if self.is_silent(u) || self.let_go[u])
    }

    /// Whether everything that a closure needs speaks, and no joint is let go.
    pub(super) fn can_read(&self, closure: &Closure) -> bool {
        let is_silent = |end: End| end.unit().is_some_and(|u| self.is_silent(u) || self.let_go[u]);
        let is_stale = closure.through.iter().any(|leg| self.is_stale_leg(leg));
        !is_silent(closure.from) && !is_silent(closure.to) && !is_stale
    }
}
