//! The state estimate of strapdown links when units begin to speak that had no readings at the start. `track` calls it.

use super::covariance::UNIT;
use super::filter::{Means, State, StrapdownFilter, UnitState, LOOSE_WALK, SILENT_RAD, SPRING_TIME_S};
use super::increment::{sum, Increment, Readings, ZERO};
use super::sensors::{Heard, Sensor, UNKNOWN_AZIMUTH_RAD};
use super::skeleton::Pose;
use super::start::{fresh_block, put_block};
use crate::kernels::dense::Square;
use crate::rotation::{Mat3, Vec3};

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
        let mut means = Means { units, azimuth: state.means.azimuth, ..Means::default() };
        means.loose = self.skeleton.loose.iter().map(|l| self.against(*l, &rotations)).collect();
        let mut source = vec![None; self.size];
        for (u, o) in earlier.iter().enumerate() {
            (0..UNIT).for_each(|i| source[UNIT * u + i] = o.map(|o| UNIT * o + i));
        }
        for (number, l) in self.skeleton.loose.iter().enumerate() {
            let first = old.same_loose(&self.skeleton.links[*l], self.anchor_frame(*l));
            (0..3).for_each(|i| source[self.loose_state(number) + i] = first.map(|first| first + i));
        }
        for (first, there) in self.point_states().map(|(first, key)| (first, old.point_of(key))) {
            means.points.push(there.map_or(zero, |there| state.means.points[there]));
            let old_first = there.and_then(|there| old.points.iter().flatten().flatten().nth(there));
            (0..3).for_each(|i| source[first + i] = old_first.map(|first| first + i));
        }
        if let (Some(own), Some(there)) = (self.azimuth_state(), old.azimuth_state()) {
            source[own] = Some(there);
        }
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

    /// The covariance by the old state of each new one; states without an old one are as at a start.
    fn admitted_covariance(&self, old: &Square, source: &[Option<usize>], means: &Means) -> Square {
        let mut covariance = Square::zeros(self.size);
        for (r, from) in source.iter().enumerate() {
            let Some(from) = from else { continue };
            for (c, other) in source.iter().enumerate() {
                if let Some(other) = other {
                    *covariance.at_mut(r, c) = old.at(*from, *other);
                }
            }
        }
        let links = &self.links;
        for (u, unit) in self.skeleton.units.iter().enumerate().filter(|(u, _)| source[UNIT * u].is_none()) {
            let turn = sum(&ZERO, &Mat3::identity(), SILENT_RAD * SILENT_RAD);
            let stds = [links.start_speed_std_m_s, links.start_place_std_m];
            put_block(&mut covariance, UNIT * u, &fresh_block(&turn, &means.units[u], stds));
            (0..6).for_each(|r| *covariance.at_mut(UNIT * u + 9 + r, UNIT * u + 9 + r) = unit.bias[r / 3][0].powi(2));
        }
        for number in 0..self.skeleton.loose.len() {
            let first = self.loose_state(number);
            let is_new = |i: &usize| source[*i].is_none();
            (first..first + 3)
                .filter(is_new)
                .for_each(|i| *covariance.at_mut(i, i) = LOOSE_WALK * LOOSE_WALK * SPRING_TIME_S);
        }
        for first in self.points.iter().flatten().flatten().filter(|first| source[**first].is_none()) {
            (*first..first + 3).for_each(|i| *covariance.at_mut(i, i) = links.point_std_m.powi(2));
        }
        if let Some(i) = self.azimuth_state().filter(|i| source[*i].is_none()) {
            *covariance.at_mut(i, i) = UNKNOWN_AZIMUTH_RAD * UNKNOWN_AZIMUTH_RAD;
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
            Pose::State(_, anchor) => Some(self.skeleton.links[anchor].frame),
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

    /// First state of every point of a joint, with what it belongs to: the joint's frame and the unit's source.
    fn point_states(&self) -> impl Iterator<Item = (usize, (usize, usize))> + '_ {
        self.skeleton.closures.iter().zip(&self.points).flat_map(|(closure, points)| {
            let frame = self.skeleton.links[closure.link].frame;
            let source = |u: usize| self.skeleton.units[u].source;
            let ends = [closure.from.unit(), closure.to.unit()].into_iter().zip(points);
            ends.filter_map(move |(unit, first)| Some(((*first)?, (frame, source(unit?)))))
        })
    }

    /// Number of the point that belongs to a joint's frame and a unit's source.
    fn point_of(&self, key: (usize, usize)) -> Option<usize> {
        self.point_states().position(|(_, own)| own == key)
    }
}
