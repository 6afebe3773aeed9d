//! What moves every unit beside its own readings: its constant mount and its skin, and accelerations of the room. `filter` uses it.

use super::covariance::Rows;
use super::filter::{Means, State, StrapdownFilter};
use super::increment::{skew, sum};
use crate::rotation::{Mat3, Vec3};

/// What a change of a small rotation vector turns: the left Jacobian, to the first order.
pub(super) fn small_turn(turn: Vec3<f64>) -> Mat3<f64> {
    sum(&Mat3::identity(), &skew(turn), 0.5)
}

impl StrapdownFilter {
    /// First states of the skins of units.
    pub(super) fn skins(&self) -> impl Iterator<Item = usize> + '_ {
        self.turned.iter().filter_map(|[_, skin]| *skin)
    }

    /// State of an acceleration of the room.
    pub fn push_state(&self, number: usize) -> usize {
        self.size - usize::from(self.skeleton.has_fields()) - self.skeleton.pushes.len() + number
    }

    /// State of a length.
    pub fn length_state(&self, number: usize) -> usize {
        self.push_state(0) - 3 * usize::from(self.links.room_std_rad.is_some()) - self.skeleton.lengths.len() + number
    }

    /// First state of the turn of the room, if it turns.
    pub fn room_state(&self) -> Option<usize> {
        self.links.room_std_rad.map(|_| self.push_state(0) - 3)
    }

    /// Gravity as it acts in the room, which may be accelerated, m/s2.
    pub(super) fn gravity_in(&self, means: &Means) -> Vec3<f64> {
        let pushes = self.skeleton.pushes.iter().zip(&means.pushes);
        pushes.fold(self.gravity, |sum, (push, value)| sum + Vec3(push.axis) * -value)
    }

    /// How the accelerations of the room move every unit: their states and axes.
    pub(super) fn pushed(&self) -> Vec<(usize, Vec3<f64>)> {
        self.skeleton.pushes.iter().enumerate().map(|(k, push)| (self.push_state(k), Vec3(push.axis))).collect()
    }

    /// What skins and accelerations of the room keep over a time: state, and share.
    pub(super) fn decays(&self, step_s: f64) -> Vec<(usize, f64)> {
        let skin = (-step_s / self.links.skin_time_s).exp();
        let skins = self.skins().flat_map(|first| (first..first + 3).map(move |i| (i, skin)));
        let pushes = self.skeleton.pushes.iter().enumerate();
        let pushes = pushes.map(|(k, push)| (self.push_state(k), (-step_s / push.time_s).exp()));
        let room = (-step_s / self.links.room_time_s).exp();
        let rooms = self.room_state().into_iter().flat_map(|first| (first..first + 3).map(move |i| (i, room)));
        skins.chain(pushes).chain(rooms).collect()
    }

    /// Whether a unit's bone may be turned against where its mount says.
    fn is_turned(&self, u: usize) -> bool {
        self.turned.get(u).is_some_and(|turns| *turns != [None; 2])
    }

    /// Turn of a unit's bone against where its mount says, in the unit's axes.
    pub(super) fn skin_of(&self, means: &Means, u: usize) -> Mat3<f64> {
        if !self.is_turned(u) {
            return Mat3::identity();
        }
        let [mount, skin] = self.turned[u].map(|first| self.constant(means, first));
        Mat3::about(mount).times(&Mat3::about(skin))
    }

    /// The axes of a unit where its bone is as its mount says, room from them.
    pub(super) fn bone_of(&self, means: &Means, u: usize) -> Mat3<f64> {
        let rotation = means.units[u].rotation;
        if self.is_turned(u) {
            rotation.times(&self.skin_of(means, u))
        } else {
            rotation
        }
    }

    /// Derivatives of the turn of a unit's bone by its mount and skin, in the room's axes, times `m`.
    pub(super) fn push_skin(&self, rows: &mut Rows, means: &Means, u: usize, m: &Mat3<f64>) {
        if !self.is_turned(u) {
            return;
        }
        let [mount, skin] = self.turned[u];
        let rotation = &means.units[u].rotation;
        let own = self.constant(means, mount);
        if let Some(first) = mount {
            rows.push(first, &m.times(rotation).times(&small_turn(own)));
        }
        if let Some(first) = skin {
            let turn = self.constant(means, skin);
            rows.push(first, &m.times(rotation).times(&Mat3::about(own)).times(&small_turn(turn)));
        }
    }

    /// Skins and accelerations of the room forget, and get their noise.
    pub(super) fn wander(&self, state: &mut State, step_s: f64) {
        let skin = (-step_s / self.links.skin_time_s).exp();
        let std = self.links.skin_std_rad.unwrap_or(0.0);
        let begin = self.loose_state(self.skeleton.loose.len());
        for first in self.skins() {
            let mean = &mut state.means.constants[(first - begin) / 3];
            *mean = *mean * skin;
            (first..first + 3).for_each(|i| *state.covariance.at_mut(i, i) += std * std * (1.0 - skin * skin));
        }
        if let (Some(first), Some(std)) = (self.room_state(), self.links.room_std_rad) {
            let share = (-step_s / self.links.room_time_s).exp();
            state.means.room = state.means.room * share;
            (first..first + 3).for_each(|i| *state.covariance.at_mut(i, i) += std * std * (1.0 - share * share));
        }
        for (k, push) in self.skeleton.pushes.iter().enumerate() {
            let i = self.push_state(k);
            let share = (-step_s / push.time_s).exp();
            state.means.pushes[k] *= share;
            *state.covariance.at_mut(i, i) += 0.5 * push.density.powi(2) * push.time_s * (1.0 - share * share);
        }
    }
}
