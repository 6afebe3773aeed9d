//! Checks strapdown links against each unit alone: does a unit turn otherwise than its own gyroscope, or lean otherwise than its own
//! accelerometer says, beyond what both are worth? `track` lets the joints of such a unit go and says so.

use super::covariance::{block, UNIT};
use super::filter::{dot, Means, State, StrapdownFilter};
use super::increment::{square, Reading};
use super::skeleton::{Link, Pose, Skeleton};
use crate::kernels::dense::Square;
use crate::rotation::Vec3;

/// Differences are averaged over this time, s.
const WINDOW_S: f64 = 1.0;
/// Differences below this are none, rad.
const LEAST_RAD: f64 = 0.0873;
/// Multiple of the standard deviations of both that is still agreement.
const BAND: f64 = 1.96;

/// How a unit agrees with itself alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Mean square of the angle between the verticals of body and unit alone, and what both are worth, rad2.
    pub tilt: [f64; 2],
    /// Turn by which readings have moved the unit, with a memory of the window, rad in the room's axes; and what its orientation was worth, rad2.
    pub turned: Vec3<f64>,
    pub worth: f64,
    /// Whether it is contradicted now, and how long it has been, s.
    pub is_contradicted: bool,
    pub contradicted_s: f64,
    /// Largest difference of such a time, rad.
    pub worst_rad: f64,
}

impl Check {
    pub const NEW: Check = Check {
        tilt: [0.0; 2],
        turned: Vec3([0.0; 3]),
        worth: 0.0,
        is_contradicted: false,
        contradicted_s: 0.0,
        worst_rad: 0.0,
    };

    /// Of a unit whose orientation is worth so much, rad2.
    pub fn from(worth: f64) -> Check {
        Check { worth, ..Check::NEW }
    }

    /// The unit starts anew.
    pub fn restart(&mut self, worth: f64) {
        let Check { contradicted_s, worst_rad, .. } = *self;
        *self = Check { contradicted_s, worst_rad, ..Check::from(worth) };
    }

    /// After an update: its duration, the turn by which it moved the unit, what the orientation is worth (rad2), and the difference of tilt to the
    /// unit alone with what that is worth.
    fn take(&mut self, step_s: f64, moved: Vec3<f64>, worth: f64, tilt: [f64; 2]) {
        let share = (step_s / WINDOW_S).min(1.0);
        self.turned = self.turned * (1.0 - share) + moved;
        self.worth = worth.max(self.worth + share * (worth - self.worth));
        for (mean, now) in self.tilt.iter_mut().zip(tilt) {
            *mean += share * (now - *mean);
        }
        let least = LEAST_RAD * LEAST_RAD;
        let (turned, leant) = (square(self.turned), self.tilt[0]);
        let apart = [turned - least - BAND * BAND * self.worth, leant - least - BAND * BAND * self.tilt[1]];
        self.is_contradicted = apart.iter().any(|x| *x > 0.0);
        if self.is_contradicted {
            self.contradicted_s += step_s;
            self.worst_rad = self.worst_rad.max(turned.max(leant).sqrt());
        }
    }
}

impl Skeleton {
    /// One unit alone, free in the room.
    fn alone(&self, u: usize) -> Skeleton {
        let unit = self.units[u].clone();
        let link = Link { parent: None, pose: Pose::Unit(0), ..self.links[unit.link].clone() };
        Skeleton { links: vec![link], units: vec![super::skeleton::Unit { link: 0, ..unit }], ..self.without_joints() }
    }
}

/// Filters of all units, each alone.
#[derive(Debug, Clone)]
pub struct Alone {
    filters: Vec<StrapdownFilter>,
}

impl Alone {
    pub fn new(filter: &StrapdownFilter) -> Self {
        let units = 0..filter.skeleton.units.len();
        let one = |u: usize| StrapdownFilter::new(filter.skeleton.alone(u), filter.links, (false, filter.contacts));
        Alone { filters: units.map(one).collect() }
    }

    /// The start of each, from that of the body.
    pub fn start(&self, state: &State) -> Vec<State> {
        (0..self.filters.len()).map(|u| state.of_unit(u)).collect()
    }

    /// Adds a reading of a unit.
    pub fn take(&self, states: &mut [State], u: usize, reading: Reading) {
        if let Some(state) = states.get_mut(u) {
            self.filters[u].take(state, 0, reading);
        }
    }

    /// Moves all to a later time; `moves`: whether their body does.
    pub fn advance(&mut self, states: &mut [State], to_s: f64, moves: bool) {
        for (filter, state) in self.filters.iter_mut().zip(states) {
            filter.belongs_to_moving = moves;
            filter.advance(state, to_s, &mut |_| {}, false);
        }
    }
}

impl State {
    /// What the orientation of a unit is worth, about all axes together, rad2.
    pub fn turn_variance(&self, u: usize) -> f64 {
        (0..3).map(|k| self.covariance.at(UNIT * u + k, UNIT * u + k)).sum()
    }

    /// What it says of one unit alone.
    pub fn of_unit(&self, u: usize) -> State {
        let first = UNIT * u;
        let mut covariance = Square::zeros(UNIT);
        for r in 0..UNIT {
            for c in 0..UNIT {
                *covariance.at_mut(r, c) = self.covariance.at(first + r, first + c);
            }
        }
        State {
            means: Means { units: vec![self.means.units[u]], ..Means::default() },
            readings: vec![self.readings[u].clone()],
            heard: Vec::new(),
            increments: vec![self.increments[u]],
            covariance,
            ..*self
        }
    }
}

impl StrapdownFilter {
    /// Compares all units with themselves alone after an update that took `step_s`.
    pub fn check(&mut self, state: &State, alone: &[State], checks: &mut [Check], step_s: f64) {
        let up = self.skeleton.up;
        for (u, (check, alone)) in checks.iter_mut().zip(alone).enumerate() {
            let (own, other) = (&state.means.units[u], &alone.means.units[0]);
            let [here, there] = [own, other].map(|mean| mean.rotation.apply_transposed(up));
            let angle = dot(here, there).clamp(-1.0, 1.0).acos();
            let variance = |p: &Square, first: usize| -> f64 {
                let turn = block(p, first);
                let all: f64 = (0..3).map(|k| turn.0[k][k]).sum();
                all - dot(up, turn.apply(up))
            };
            let tilt = variance(&state.covariance, UNIT * u) + variance(&alone.covariance, 0);
            let worth = state.turn_variance(u);
            let silent = self.silent[u];
            let moved = if silent { Vec3([0.0; 3]) } else { self.moved_by[u] };
            check.take(step_s, moved, worth, if silent { [0.0, tilt] } else { [angle * angle, tilt] });
            self.let_go[u] = check.is_contradicted;
        }
    }
}
