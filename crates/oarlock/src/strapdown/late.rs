//! The state estimate of strapdown links when units begin to speak that had no readings at the start, and when all speak again. `track` calls it.

use super::covariance::{Step, UNIT};
use super::filter::{Means, Node, State, StrapdownFilter, UnitState, SILENT_RAD};
use super::increment::{Increment, Readings};
use super::sensors::{Heard, Sensor, UNKNOWN_AZIMUTH_RAD};
use super::skeleton::Pose;
use crate::kernels::dense::Square;
use crate::model::links::UNKNOWN_RAD;
use crate::rotation::{Mat3, Vec3};

/// Readings no earlier belong to the same instant, s.
const SAME_S: f64 = 1e-6;
/// An azimuth of the magnetic field that is known better tells headings after a silence, rad.
const AZIMUTH_RAD: f64 = 0.3;

/// By how much a unit may have turned in a silence, rad.
fn turned_in(silence_s: f64) -> f64 {
    (SILENT_RAD * silence_s.sqrt()).min(UNKNOWN_RAD)
}

/// What a constant belongs to.
#[derive(PartialEq)]
enum Of {
    Point,
    Axes,
    Unit,
}

impl StrapdownFilter {
    /// The estimate of `old`, which had fewer units, for this filter of the same body. A new unit begins where the old estimate puts its link, and
    /// is worth as little as one that speaks again.
    pub fn admit(&self, old: &StrapdownFilter, state: &State) -> State {
        let same_unit = |u: usize| old.skeleton.units.iter().position(|o| o.source == self.skeleton.units[u].source);
        let earlier: Vec<Option<usize>> = (0..self.skeleton.units.len()).map(same_unit).collect();
        let rotations = self.link_rotations(old, &state.means);
        let zero = Vec3([0.0; 3]);
        let fresh = |u: usize| {
            let unit = &self.skeleton.units[u];
            let rotation = rotations[unit.link].times(&unit.mount);
            UnitState { rotation, velocity: zero, position: zero, gyro_bias: zero, accel_bias: zero }
        };
        let unit = |(u, o): (usize, &Option<usize>)| o.map_or_else(|| fresh(u), |o| state.means.units[o]);
        let units = earlier.iter().enumerate().map(unit).collect();
        let Means { azimuth, pushes, room, slides, inputs, .. } = state.means.clone();
        let there = |i: &usize| old.skeleton.lengths.iter().position(|o| o == i);
        let known_lengths: Vec<Option<usize>> = self.skeleton.lengths.iter().map(there).collect();
        let lengths = known_lengths.iter().map(|k| k.map_or(0.0, |k| state.means.lengths[k])).collect();
        let mut means = Means { units, azimuth, pushes, room, lengths, slides, inputs, ..Means::default() };
        means.loose = self.skeleton.loose.iter().map(|l| self.against(*l, &rotations)).collect();
        let mut source = vec![None; self.size];
        for (u, o) in earlier.iter().enumerate() {
            (0..UNIT).for_each(|i| source[UNIT * u + i] = o.map(|o| UNIT * o + i));
        }
        for (number, l) in self.skeleton.loose.iter().enumerate() {
            let first = old.same_loose(&self.skeleton.links[*l], self.anchor_frame(*l));
            (0..3).for_each(|i| source[self.loose_state(number) + i] = first.map(|first| first + i));
        }
        for (first, key) in self.constants().zip(self.constant_keys()) {
            let there = old.constant_keys().position(|own| own == key);
            means.constants.push(there.map_or(zero, |there| state.means.constants[there]));
            let old_first = there.and_then(|there| old.constants().nth(there));
            (0..3).for_each(|i| source[first + i] = old_first.map(|first| first + i));
        }
        match (self.azimuth_state(), old.azimuth_state()) {
            (Some(own), Some(there)) => source[own] = Some(there),
            _ => means.azimuth = self.skeleton.azimuth_rad.unwrap_or(0.0),
        }
        if let (Some(own), Some(there)) = (self.room_state(), old.room_state()) {
            (0..3).for_each(|i| source[own + i] = Some(there + i));
        }
        for (k, there) in known_lengths.iter().enumerate() {
            source[self.length_state(k)] = there.map(|there| old.length_state(there));
        }
        (0..2 * self.skeleton.slides.len())
            .for_each(|k| source[self.slide_state(0) + k] = Some(old.slide_state(0) + k));
        (0..self.skeleton.pushes.len()).for_each(|k| source[self.push_state(k)] = Some(old.push_state(k)));
        let mut known: Vec<bool> = earlier.iter().map(Option::is_some).collect();
        self.place(&mut means, &mut known);
        let covariance = self.admitted_covariance(&state.covariance, &source, &means);
        let readings = |o: &Option<usize>| o.map_or_else(Readings::default, |o| state.readings[o].clone());
        let mut admitted = State {
            readings: earlier.iter().map(readings).collect(),
            increments: earlier.iter().map(|o| o.map_or_else(Increment::none, |o| state.increments[o])).collect(),
            heard: self.skeleton.sensors.iter().map(|sensor| old.heard_of(sensor, &state.heard)).collect(),
            means,
            covariance,
            ..*state
        };
        for (u, _) in earlier.iter().enumerate().filter(|(_, o)| o.is_none()) {
            self.extend_unit(&mut admitted, u, (state.time_s, state.row_s));
        }
        admitted
    }

    /// A start after everything was silent for `silence_s`, at the first reading after it. In a posture (room from
    /// link) that readings fit; without one, units may have turned since `old` by what a limb does that nothing reads. `None`: headings are open, the
    /// readings do not decide them, and they need not (`must`).
    pub fn start_anew(
        &self,
        old: &State,
        (time_s, silence_s): (f64, f64),
        posture: Option<&[Mat3<f64>]>,
        must: bool,
    ) -> Option<State> {
        let (mut readings, mut heard) = (old.readings.clone(), old.heard.clone());
        readings.iter_mut().for_each(|r| r.begin(time_s));
        heard.iter_mut().for_each(|h| h.all.retain(|(t, _)| *t >= time_s - SAME_S));
        if let Some(posture) = posture {
            return Some(self.start(time_s, (posture, true), (readings, heard)).0);
        }
        let mut wide = self.clone();
        let turned = turned_in(silence_s);
        wide.links.start_std_rad = turned.max(self.links.start_std_rad);
        wide.links.start_tilt_std_rad = turned.max(self.links.start_tilt_std_rad);
        let azimuth_std = self.azimuth_state().map(|i| old.covariance.at(i, i).sqrt());
        if azimuth_std.is_some_and(|std| std < AZIMUTH_RAD) {
            wide.skeleton.azimuth_rad = Some(old.means.azimuth);
        }
        let (start, tilts) = wide.start(time_s, (&self.link_rotations(self, &old.means), false), (readings, heard));
        match wide.seeks_headings(&start.means) {
            true => wide.with_headings(&start, &tilts, must),
            false => Some(start),
        }
    }

    /// Of means after which nothing was read.
    pub fn silent_covariance(&self, means: &Means, silence_s: f64) -> Square {
        let turned = vec![turned_in(silence_s); means.units.len()];
        self.start_covariance(means, &turned, (&turned, self.azimuth_std()))
    }

    /// A start that goes on with the constants of `old`. `of_bones`: its orientations are those of links, not of the units on them.
    pub fn with_constants(&self, start: &State, old: &State, of_bones: bool) -> State {
        let mut state = start.clone();
        let means = &mut state.means;
        let skins: Vec<usize> = self.skins().collect();
        let constants = means.constants.iter_mut().zip(&old.means.constants).zip(self.constants());
        let lasts = |first: &usize| !skins.contains(first);
        constants.filter(|(_, first)| lasts(first)).for_each(|((new, old), _)| *new = *old);
        means.lengths.clone_from(&old.means.lengths);
        means.azimuth = old.means.azimuth;
        for u in 0..means.units.len() {
            let turned = self.skin_of(means, u);
            let (new, old) = (&mut means.units[u], &old.means.units[u]);
            if of_bones {
                new.rotation = new.rotation.times_transposed(&turned);
            }
            (new.gyro_bias, new.accel_bias) = (old.gyro_bias, old.accel_bias);
        }
        self.place(means, &mut vec![false; old.means.units.len()]);
        self.restate(&mut state.covariance);
        let mut stays = vec![false; self.size];
        let biases = (0..old.means.units.len()).flat_map(|u| UNIT * u + 9..UNIT * (u + 1));
        let all = biases.chain(self.lasting()).chain(self.azimuth_state());
        all.for_each(|i| stays[i] = true);
        for (r, c) in (0..self.size).flat_map(|r| (0..self.size).map(move |c| (r, c))) {
            match (stays[r], stays[c]) {
                (true, true) => *state.covariance.at_mut(r, c) = old.covariance.at(r, c),
                (false, false) => {}
                _ => *state.covariance.at_mut(r, c) = 0.0,
            }
        }
        let silence_s = start.time_s - old.time_s;
        for (u, unit) in self.skeleton.units.iter().enumerate() {
            for r in 0..6 {
                let (i, [first, walk]) = (UNIT * u + 9 + r, unit.bias[r / 3]);
                let variance = state.covariance.at_mut(i, i);
                *variance = (*variance + walk * walk * silence_s).min(first * first).max(*variance);
            }
        }
        if let Some(i) = self.azimuth_state() {
            let grown = state.covariance.at(i, i) + self.skeleton.azimuth_walk.powi(2) * silence_s;
            *state.covariance.at_mut(i, i) = grown.min(UNKNOWN_AZIMUTH_RAD * UNKNOWN_AZIMUTH_RAD);
        }
        state
    }

    /// What the smoother needs of a new start: only constants go on.
    pub fn cut(&self, old: &State, new: &State) -> Node {
        let step = |mean: &UnitState| {
            let (step, _) = Step::of(&Increment::none(), &mean.rotation, (mean.velocity, mean.position), self.gravity);
            Step { duration_s: new.time_s - old.time_s, forgets: true, ..step }
        };
        Node {
            before: old.means.clone(),
            before_s: old.time_s,
            covariance: old.covariance.clone(),
            steps: old.means.units.iter().map(step).collect(),
            increments: vec![Increment::none(); old.means.units.len()],
            predicted: new.means.clone(),
            predicted_covariance: new.covariance.clone(),
        }
    }

    /// The covariance by the old state of each new one; states without an old one are as at a start.
    fn admitted_covariance(&self, old: &Square, source: &[Option<usize>], means: &Means) -> Square {
        let silent = vec![SILENT_RAD; means.units.len()];
        let mut covariance = self.start_covariance(means, &silent, (&silent, self.azimuth_std()));
        for (r, from) in source.iter().enumerate() {
            for (c, other) in source.iter().enumerate() {
                match (from, other) {
                    (Some(from), Some(other)) => *covariance.at_mut(r, c) = old.at(*from, *other),
                    (None, None) => {}
                    _ => *covariance.at_mut(r, c) = 0.0,
                }
            }
        }
        covariance
    }

    /// Room from link as `old` estimates it; a link that it does not have goes with its parent, at rest.
    fn link_rotations(&self, old: &StrapdownFilter, means: &Means) -> Vec<Mat3<f64>> {
        let mut all: Vec<Mat3<f64>> = Vec::with_capacity(self.skeleton.links.len());
        for link in &self.skeleton.links {
            let there = old.skeleton.links.iter().position(|o| o.frame == link.frame);
            let carried = || link.parent.map_or(link.rest, |p| all[p].times(&link.rest));
            let rotation = there.map_or_else(carried, |l| old.orientation(means, l));
            all.push(rotation);
        }
        all
    }

    /// Frame of the link that a link without a unit hangs on.
    fn anchor_frame(&self, l: usize) -> Option<usize> {
        match self.skeleton.links[l].pose {
            Pose::State(_, anchor) => anchor.map(|l| self.skeleton.links[l].frame),
            _ => None,
        }
    }

    /// First state of the same link without a unit that hangs on the same link.
    fn same_loose(&self, link: &super::skeleton::Link, anchor_frame: Option<usize>) -> Option<usize> {
        let is_it = |l: &usize| self.skeleton.links[*l].frame == link.frame && self.anchor_frame(*l) == anchor_frame;
        self.skeleton.loose.iter().position(is_it).map(|number| self.loose_state(number))
    }

    /// The readings of the same sensor.
    fn heard_of(&self, sensor: &Sensor, heard: &[Heard]) -> Heard {
        let there = self.skeleton.sensors.iter().position(|own| own.at == sensor.at);
        there.map_or_else(Heard::default, |s| heard[s].clone())
    }

    /// What every constant belongs to, in order: a point to its joint's frame and its unit's source, axes to their joint's frame and end, the turns of
    /// mount and skin to their unit's source.
    fn constant_keys(&self) -> impl Iterator<Item = (Of, usize, usize)> + '_ {
        let skeleton = &self.skeleton;
        let points = skeleton.closures.iter().zip(&self.points).flat_map(move |(closure, points)| {
            let frame = skeleton.links[closure.link].frame;
            let ends = [closure.from.unit(), closure.to.unit()].into_iter().zip(points);
            ends.filter_map(move |(unit, first)| first.and(unit).map(|u| (Of::Point, frame, skeleton.units[u].source)))
        });
        let axes = skeleton.links.iter().zip(&self.axes).flat_map(|(link, axes)| {
            axes.iter().enumerate().filter_map(move |(end, first)| first.map(|_| (Of::Axes, link.frame, end)))
        });
        let turned = skeleton.units.iter().zip(&self.turned).flat_map(|(unit, turned)| {
            turned.iter().enumerate().filter_map(move |(k, first)| first.map(|_| (Of::Unit, unit.source, k)))
        });
        points.chain(axes).chain(turned)
    }
}
