//! Readings of strapdown links: joints, hinges, bounds, rest and contact. `filter` reads them at every update.

use super::covariance::{Rows, UNIT};
use super::filter::{dot, Means, State, StrapdownFilter, SPRING_LOOP_TIME_S, SPRING_TIME_S};
use super::increment::{skew, square, sum, Reading, Readings, ZERO};
use super::joint::Turns;
use super::skeleton::{Axes, Closure, End, Leg};
use crate::rotation::turn::{right_jacobian_inverse, Turn};
use crate::rotation::{Mat3, Vec3};

/// Rest: readings constant within these, rad/s and m/s2, for this time, s.
const REST_GYRO: f64 = 0.05;
const REST_ACCEL: f64 = 0.25;
pub const REST_S: f64 = 0.4;
/// A resting unit that turns by more than this against its bias is turned, rad/s.
const BIAS_BELOW_RAD_S: f64 = 0.06;
/// Contact with the ground: rate below this, rad/s, and force within this of gravity, m/s2, for this time, s (after Skog et al. 2010).
const CONTACT_RATE: f64 = 1.0;
const CONTACT_FORCE: f64 = 1.5;
const CONTACT_S: f64 = 0.07;
/// Correlation time of the speed of a foot that stands, s.
const CONTACT_TIME_S: f64 = 0.05;
/// How far a joint turns off the axes of its hinges where one side has no unit, rad.
const LOOSE_HINGE_RAD: f64 = 0.1;

/// What readings of joints and bounds are worth at this interval: white noise of the same effect as a correlated error.
pub(super) fn white(std: f64, time_s: f64, step_s: f64) -> f64 {
    std * std * (2.0 * time_s / step_s).max(1.0)
}

impl StrapdownFilter {
    /// Mean of a constant by its first state; zero if it is no state.
    pub(super) fn constant(&self, means: &Means, first: Option<usize>) -> Vec3<f64> {
        let begin = self.loose_state(self.skeleton.loose.len());
        first.map_or(Vec3([0.0; 3]), |first| means.constants[(first - begin) / 3])
    }

    /// The two points of a joint coincide, in the axes of the unit `from`.
    pub(super) fn read_closure(&mut self, state: &mut State, c: usize, step_s: f64) {
        let closure = self.stretched(&state.means, c);
        if !self.can_read(&closure) {
            return;
        }
        let means = &state.means;
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        let own = |k: usize| self.constant(means, self.points[c][k]);
        // Everything is read in the axes of the first unit; of the room if that is fixed.
        let axes = match closure.from {
            End::Unit(u, _) => means.units[u].rotation,
            End::Room(_) => self.orientation_of(means, None),
        };
        let back = axes.transposed();
        let mut gap = Vec3([0.0; 3]);
        for (k, (end, sign)) in [(closure.from, -1.0), (closure.to, 1.0)].into_iter().enumerate() {
            match end {
                End::Room(point) => {
                    let arm = self.orientation_of(means, None).apply(point);
                    gap += arm * sign;
                    self.push_link(&mut rows, means, None, &sum(&ZERO, &back.times(&skew(arm)), -sign));
                }
                End::Unit(u, point) => {
                    let mean = &means.units[u];
                    let bone = self.bone_of(means, u);
                    let arm = bone.apply(point + own(k));
                    gap += (mean.position + arm) * sign;
                    self.push_skin(&mut rows, means, u, &sum(&ZERO, &back.times(&skew(arm)), -sign));
                    rows.push(UNIT * u, &sum(&ZERO, &back.times(&skew(mean.position + arm)), -sign));
                    rows.push(UNIT * u + 6, &sum(&ZERO, &back, sign));
                    if let Some(first) = self.points[c][k] {
                        rows.push(first, &sum(&ZERO, &back.times(&bone), sign));
                    }
                }
            }
        }
        let away = sum(&ZERO, &back, -1.0);
        for leg in &closure.through {
            gap += self.push_leg(&mut rows, means, leg, &away) * -1.0;
        }
        self.push_lengths(&mut rows, means, (c, &closure), &back);
        // The gap's own axes turn with the first unit, so that a turn of everything about the vertical changes no reading.
        match closure.from {
            End::Unit(u, _) => rows.push(UNIT * u, &back.times(&skew(gap))),
            End::Room(_) => self.push_link(&mut rows, means, None, &back.times(&skew(gap))),
        }
        let std_m = match closure.loop_std_m {
            Some(std_m) => std_m.max(self.links.loop_std_m) * self.links.loop_share,
            None => self.links.joint_std_m,
        };
        let variance = white(std_m, self.links.joint_time_s, step_s);
        let innovation = back.apply(gap).0.map(|x| -x);
        self.closure_nis[c] = self.correction.read(&state.covariance, &rows, 3, innovation, [variance; 3]);
        self.rows = rows;
    }

    /// Derivatives of the gap of a closure by the lengths that are states.
    fn push_lengths(&self, rows: &mut Rows, means: &Means, (c, closure): (usize, &Closure), back: &Mat3<f64>) {
        let lengths = &self.skeleton.closures[c].lengths;
        if lengths.is_empty() {
            return;
        }
        let [from, to] = [closure.from, closure.to].map(|end| match end {
            End::Unit(u, _) => self.bone_of(means, u),
            End::Room(_) => self.orientation_of(means, None),
        });
        let legs: Vec<Mat3<f64>> = closure.through.iter().map(|leg| self.orientation_of(means, leg.link)).collect();
        for by in lengths {
            let mut change = to.apply(by.ends[1]) - from.apply(by.ends[0]);
            for ((leg, axes), vector) in closure.through.iter().zip(&legs).zip(&by.legs) {
                change += axes.apply(*vector) * -self.leg_length(means, leg);
            }
            rows.push_one(self.length_state(by.number), back.apply(change).0);
        }
    }

    /// Axes of two links that a loop keeps together.
    pub(super) fn read_axes(&mut self, state: &mut State, number: usize, step_s: f64) {
        let Axes { ends, std } = self.skeleton.loop_axes[number];
        let mut links = ends.iter().filter_map(|(link, _)| *link);
        if links.any(|l| self.is_let_go(l) || self.is_stale_leg(&Leg::of(l, Vec3([0.0; 3])))) {
            return;
        }
        let means = &state.means;
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        // Everything is read in the axes of the first link, as the gap of a joint.
        let back = self.orientation_of(means, ends[0].0).transposed();
        let mut gap = Vec3([0.0; 3]);
        for ((link, axis), sign) in ends.into_iter().zip([1.0, -1.0]) {
            let own = self.orientation_of(means, link).apply(axis);
            gap += own * sign;
            self.push_link(&mut rows, means, link, &sum(&ZERO, &back.times(&skew(own)), -sign));
        }
        self.push_link(&mut rows, means, ends[0].0, &back.times(&skew(gap)));
        let std = std.max(self.links.loop_axis_std_rad) * self.links.loop_share;
        let variance = white(std, self.links.joint_time_s, step_s);
        let innovation = back.apply(gap).0.map(|x| -x);
        self.correction.read(&state.covariance, &rows, 3, innovation, [variance; 3]);
        self.rows = rows;
    }

    /// A joint does not turn off the axes of its hinges.
    pub(super) fn read_hinges(&mut self, state: &mut State, l: usize, step_s: f64) {
        let link = &self.skeleton.links[l];
        let locked = link.turns.locked();
        let is_loose = !self.skeleton.is_hinged(l);
        let std = match (self.links.hinge_std_rad, is_loose) {
            (Some(std), _) => std,
            (None, true) => LOOSE_HINGE_RAD,
            (None, false) => return,
        };
        if locked == 0 || self.is_let_go(l) || link.parent.is_some_and(|p| self.is_let_go(p)) {
            return;
        }
        let (relative, child) = self.relative(&state.means, l);
        let [before, after] = self.axes[l].map(|first| Mat3::about(self.constant(&state.means, first)));
        let relative = before.transposed().times(&relative).times(&after);
        let angles = link.turns.angles(&relative, [0.0; 3]);
        let mut m = ZERO;
        let mut innovation = [0.0; 3];
        for ((row, innovation), normal) in m.0.iter_mut().zip(&mut innovation).zip(angles.normals).take(locked) {
            *row = normal.0;
            *innovation = -dot(normal, angles.off_axis);
        }
        let mut rows = self.turn_rows(&state.means, l, &m.times(&child.times(&after).transposed()));
        let by_axes = [sum(&ZERO, &m.times(&relative.transposed()), -1.0), m];
        for (first, by_axes) in self.axes[l].iter().zip(&by_axes) {
            first.iter().for_each(|first| rows.push(*first, by_axes));
        }
        let variance = white(std, self.links.joint_time_s, step_s);
        self.correction.read(&state.covariance, &rows, locked, innovation, [variance; 3]);
        self.rows = rows;
    }

    /// A joint without a unit on one side stays near its rest, as far as its limits say.
    pub(super) fn read_spring(&mut self, state: &mut State, l: usize, step_s: f64) {
        let link = &self.skeleton.links[l];
        let is_loose = self.skeleton.is_loose(l) || link.parent.is_some_and(|p| self.skeleton.is_loose(p));
        if !is_loose || matches!(link.turns, Turns::Free(..)) {
            return;
        }
        let (relative, child) = self.relative(&state.means, l);
        let beyond = link.rest.transposed().times(&relative);
        let turn = Turn::of(&beyond).log();
        let m = child.transposed();
        let time_s = if self.skeleton.is_held() { SPRING_LOOP_TIME_S } else { SPRING_TIME_S };
        let variance = link.range_rad.map(|range| white(range, time_s, step_s));
        let towards = right_jacobian_inverse(turn).times(&m);
        let rows = self.turn_rows(&state.means, l, &towards);
        self.correction.read(&state.covariance, &rows, 3, turn.map(|x| -x), variance);
        self.rows = rows;
    }

    /// Derivatives of rows of a joint's turn; `m`: by the turn of the child against the parent, in the room's axes.
    pub(super) fn turn_rows(&mut self, means: &Means, l: usize, m: &Mat3<f64>) -> Rows {
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        self.push_turn(&mut rows, means, l, m);
        self.push_link(&mut rows, means, self.skeleton.links[l].parent, &sum(&ZERO, m, -1.0));
        rows
    }

    /// A vector of a unit's states, in the room's axes, is zero.
    fn read_zero(&mut self, state: &mut State, first: usize, value: Vec3<f64>, variance: f64) {
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        rows.push(first, &Mat3::identity());
        self.correction.read(&state.covariance, &rows, 3, value.0.map(|x| -x), [variance; 3]);
        self.rows = rows;
    }

    /// Speed and distance are bounded. Read in the unit's own axes, where a turn of everything changes nothing; noise is the same in all
    /// directions, so the rows may as well have the room's axes.
    pub(super) fn read_bounds(&mut self, state: &mut State, u: usize, step_s: f64) {
        let (links, count) = (self.links, self.skeleton.units.len() as f64);
        let mean = state.means.units[u];
        let speed = count * white(links.speed_std_m_s, links.speed_time_s, step_s);
        self.read_zero(state, UNIT * u + 3, mean.velocity, speed);
        if !self.travels() {
            let place = count * white(links.place_std_m, links.place_time_s, step_s);
            self.read_zero(state, UNIT * u + 6, mean.position, place);
        }
    }

    /// Whether units that loops connect move: a hull may keep its rate for a while under a person, and does not rest then.
    pub fn moves(&self, state: &State) -> bool {
        let rests = |r: &Readings| resting_rate(r, state.time_s, self.links.rest_below_rad_s).is_some();
        self.belongs_to_moving || self.skeleton.is_held() && !state.readings.iter().all(rests)
    }

    /// Units at rest.
    pub(super) fn read_rests(&mut self, state: &mut State, step_s: f64) {
        let moves = self.moves(state);
        for u in 0..self.skeleton.units.len() {
            let rate = match moves {
                true => None,
                false => resting_rate(&state.readings[u], state.time_s, self.links.rest_below_rad_s),
            };
            self.rests[u] = rate.is_some();
            rate.iter().for_each(|rate| self.read_rest(state, u, *rate, step_s));
        }
    }

    /// A resting unit reads its gyroscope's bias, and, where the model says so, no speed.
    fn read_rest(&mut self, state: &mut State, u: usize, rate: Vec3<f64>, step_s: f64) {
        let (links, mean) = (self.links, state.means.units[u]);
        // A body that turns slowly as a whole turns all units by what looks like their biases.
        if square(rate - mean.gyro_bias) < BIAS_BELOW_RAD_S * BIAS_BELOW_RAD_S {
            let gyro = state.readings[u].at(state.time_s).gyro;
            let variance = white(links.rest_rate_std_rad_s, links.rest_time_s, step_s);
            self.read_zero(state, UNIT * u + 9, mean.gyro_bias - gyro, variance);
        }
        if let Some(std) = links.rest_speed_std_m_s {
            self.read_zero(state, UNIT * u + 3, mean.velocity, white(std, links.rest_time_s, step_s));
        }
    }

    /// The point of a foot that stands on the ground does not move.
    pub(super) fn read_contact(&mut self, state: &mut State, u: usize, step_s: f64) {
        let Some((point, std)) = self.skeleton.units[u].contact.filter(|_| self.contacts) else { return };
        let readings = &state.readings[u];
        self.stands[u] = readings.window(state.time_s, CONTACT_S).is_some_and(|mut window| {
            window.all(|r| {
                let force = square(r.accel).sqrt() - self.skeleton.gravity_m_s2;
                square(r.gyro) < CONTACT_RATE * CONTACT_RATE && force.abs() < CONTACT_FORCE
            })
        });
        if !self.stands[u] {
            return;
        }
        let mean = state.means.units[u];
        let rate = readings.at(state.time_s).gyro - mean.gyro_bias;
        let velocity = mean.velocity + mean.rotation.apply(rate.cross(point));
        self.read_zero(state, UNIT * u + 3, velocity, white(std, CONTACT_TIME_S, step_s));
    }
}

/// Mean rate of a unit whose readings have not changed for a while, rad/s; `None`: it moves, or it turns faster than `below_rad_s`.
pub fn resting_rate(readings: &Readings, time_s: f64, below_rad_s: f64) -> Option<Vec3<f64>> {
    let window = readings.window(time_s, REST_S)?;
    let count = window.clone().count() as f64;
    let moments = |of: fn(&Reading) -> Vec3<f64>| {
        let mean = window.clone().fold(Vec3([0.0; 3]), |sum, r| sum + of(r)) * (1.0 / count);
        let scatter: f64 = window.clone().map(|r| square(of(r) - mean)).sum::<f64>() / count;
        (mean, scatter.sqrt())
    };
    let (rate, turning) = moments(|r| r.gyro);
    let is_slow = square(rate) < below_rad_s * below_rad_s;
    (count >= 3.0 && is_slow && turning < REST_GYRO && moments(|r| r.accel).1 < REST_ACCEL).then_some(rate)
}
