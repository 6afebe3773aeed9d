//! Sensors of strapdown links that are no gyroscope or accelerometer: encoders of hinges, positions of points, magnetometers. `filter`
//! reads them at every update.

use super::covariance::UNIT;
use super::filter::{dot, Means, State, StrapdownFilter};
use super::increment::{skew, square, sum, Increment, Readings, ZERO};
use super::readings::white;
use super::skeleton::{End, Leg, Skeleton};
use super::start::LEVEL_S;
use crate::estimate::filter::Verdict;
use crate::rotation::{Mat3, Vec3};
use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

/// Readings further apart are not joined by a line, s.
const LONGEST_GAP_S: f64 = 0.2;
/// A reading holds for this long after its time, s.
pub const HOLD_S: f64 = 0.01;
/// No angle, rad, place, m, or field, uT, is as large.
const ABSURD: f64 = 1e6;
/// Readings are stored for this long, s.
const MEMORY_S: f64 = 0.6;
/// What iron in buildings does to the heading of the field: standard deviation, rad, and correlation time, s.
const IRON_RAD: f64 = 0.15;
const IRON_TIME_S: f64 = 5.0;
/// Correlation time of what a whole field is off, s.
const FIELD_TIME_S: f64 = 1.0;
/// Updates from one reading of it to the next.
const FIELDS_EVERY: u32 = 5;
/// A field counts if its norm is within this share, and its dip within this angle, rad, of the usual ones (Laidig and Seel 2023, section 3.5).
const NORM_TOLERANCE: f64 = 0.15;
const DIP_TOLERANCE_RAD: f64 = 0.175;
/// Time constant of the usual norm and dip, s, and while a field differs from them.
const USUAL_S: f64 = 20.0;
const NEW_S: f64 = 100.0;
/// Innovations beyond this many standard deviations count less (Huber 1964); beyond these, a field is disturbed.
const HUBER: f64 = 1.5;
const DISTURBED: f64 = 3.0;
/// Standard deviation of an azimuth that the model states as known, rad.
const KNOWN_AZIMUTH_RAD: f64 = 0.02;
/// And of one that nobody knows: of a uniform angle.
pub const UNKNOWN_AZIMUTH_RAD: f64 = 1.8;

/// A sensor, and where its readings are.
#[derive(Debug, Clone)]
pub struct Sensor {
    /// First row in the measurement vector, and part of it; of an input, its coordinate.
    pub at: Place,
    /// Standard deviation of a reading, in its unit.
    pub std: f64,
    pub measures: Measures,
}

/// Where a sensor's readings are in a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    Row(usize),
    Input(usize),
}

/// What a sensor measures.
#[derive(Debug, Clone)]
pub enum Measures {
    /// The angle of a hinge, by link and number, rad.
    Angle(usize, usize),
    /// A coordinate of a link that only encoders measure, rad or m.
    Input(usize),
    /// A point of a link in the room, m: by its unit's end, and through links without a unit.
    Point(End, Vec<Leg>),
    /// The magnetic field in the axes of a unit, uT.
    Field(usize),
}

impl Measures {
    /// Numbers of a reading.
    pub fn width(&self) -> usize {
        if matches!(self, Measures::Angle(..) | Measures::Input(_)) {
            1
        } else {
            3
        }
    }
}

/// Readings of a sensor around the present, and the usual norm and dip of a field, uT and rad.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Heard {
    pub all: VecDeque<(f64, [f64; 3])>,
    /// A reading that jumped away from the last; the next one says whether it was a jump or a movement.
    pub jumped: Option<(f64, [f64; 3])>,
    pub usual: Option<[f64; 2]>,
}

impl Heard {
    /// Adds a reading; not if it is late, or no number that a body has, or its first number alone changes by more than `fastest` a second.
    pub fn push(&mut self, time_s: f64, value: [f64; 3], fastest: f64) {
        if self.last_s() >= time_s || value.iter().any(|x| x.abs() >= ABSURD) {
            return;
        }
        let jumps = |(last_s, last): (f64, [f64; 3])| {
            time_s - last_s < LONGEST_GAP_S && (value[0] - last[0]).abs() > fastest * (time_s - last_s)
        };
        if self.all.back().is_some_and(|last| jumps(*last)) && self.jumped.is_none_or(jumps) {
            self.jumped = Some((time_s, value));
            return;
        }
        self.jumped = None;
        self.all.push_back((time_s, value));
    }

    /// Rate of the first number between the readings around a time; after the last, between the last two.
    pub(super) fn rate(&self, time_s: f64) -> f64 {
        let next = self.all.partition_point(|r| r.0 <= time_s + 1e-9).clamp(1, self.all.len().saturating_sub(1).max(1));
        match (self.all.get(next - 1), self.all.get(next)) {
            (Some((a_s, a)), Some((b_s, b))) if b_s - a_s <= LONGEST_GAP_S => (b[0] - a[0]) / (b_s - a_s),
            _ => 0.0,
        }
    }

    /// Time of the last reading at or before a time, s.
    pub fn before_s(&self, time_s: f64) -> f64 {
        let next = self.all.partition_point(|r| r.0 <= time_s + 1e-9);
        next.checked_sub(1).map_or(f64::NEG_INFINITY, |last| self.all[last].0)
    }

    pub fn last_s(&self) -> f64 {
        self.all.back().map_or(f64::NEG_INFINITY, |r| r.0)
    }

    pub fn forget(&mut self, time_s: f64) {
        while self.all.len() > 2 && self.all[1].0 < time_s - MEMORY_S {
            self.all.pop_front();
        }
    }

    /// The value at a time, and how many updates of `step_s` share one reading.
    pub(super) fn at(&self, time_s: f64, step_s: f64) -> Option<([f64; 3], f64)> {
        let next = self.all.partition_point(|r| r.0 <= time_s + 1e-9);
        let (a_s, a) = self.all.get(next.checked_sub(1)?)?;
        let since_s = time_s - a_s;
        match self.all.get(next) {
            Some((b_s, b)) if b_s - a_s <= LONGEST_GAP_S => {
                let share = since_s / (b_s - a_s);
                let value = std::array::from_fn(|k| a[k] + share * (b[k] - a[k]));
                Some((value, ((b_s - a_s) / step_s).max(1.0)))
            }
            _ => (since_s <= HOLD_S).then_some((*a, 1.0)),
        }
    }

    /// The first number at a time; a little before the first reading, by the rate of the first two.
    pub(super) fn near(&self, time_s: f64) -> Option<f64> {
        let ahead = || self.is_ahead(time_s).then(|| self.all[0].1[0] + self.rate(time_s) * (time_s - self.all[0].0));
        self.at(time_s, 1.0).map(|(value, _)| value[0]).or_else(ahead)
    }

    /// Whether the first reading follows soon.
    fn is_ahead(&self, time_s: f64) -> bool {
        self.all.front().is_some_and(|first| (0.0..=LONGEST_GAP_S).contains(&(first.0 - time_s)))
    }

    /// Time since the last reading, where no other follows soon, s.
    pub(super) fn silence_s(&self, time_s: f64) -> f64 {
        let next = self.all.partition_point(|r| r.0 <= time_s + 1e-9);
        let Some((a_s, _)) = next.checked_sub(1).and_then(|before| self.all.get(before)) else {
            return if self.is_ahead(time_s) { 0.0 } else { f64::INFINITY };
        };
        let is_between = self.all.get(next).is_some_and(|(b_s, _)| b_s - a_s <= LONGEST_GAP_S);
        if is_between {
            0.0
        } else {
            time_s - a_s
        }
    }
}

/// Whether norm, uT, and dip, rad, of a field are those of another one; `share`: noise of the magnetometer as a share of the field.
fn misfit(this: [f64; 2], other: [f64; 2], share: f64) -> Verdict {
    match [this[0] / other[0] - 1.0, this[1] - other[1]].map(f64::abs) {
        [norm, _] if norm > NORM_TOLERANCE.max(DISTURBED * share) => Verdict::Excluded,
        [_, dip] if dip > DIP_TOLERANCE_RAD.max(DISTURBED * share) => Verdict::WrongDirection,
        _ => Verdict::Accepted,
    }
}

impl StrapdownFilter {
    /// Reads all sensors that have a value now.
    pub(super) fn read_sensors(&mut self, state: &mut State, step_s: f64) {
        self.fields.fill(Verdict::Missing);
        for s in 0..self.skeleton.sensors.len() {
            let Some((value, shared)) = state.heard[s].at(state.time_s, step_s) else { continue };
            let Sensor { std, measures, .. } = self.skeleton.sensors[s].clone();
            let variance = std * std * shared;
            match measures {
                Measures::Input(_) => {}
                Measures::Angle(l, k) => self.read_angle(state, (l, k), value[0], variance),
                Measures::Point(end, through) => self.read_point(state, (end, &through), Vec3(value), variance),
                Measures::Field(u) => self.read_field(state, s, u, (Vec3(value), std), step_s),
            }
        }
    }

    fn read_angle(&mut self, state: &mut State, (l, k): (usize, usize), angle: f64, variance: f64) {
        let (relative, child) = self.relative(&state.means, l);
        let angles = self.skeleton.links[l].turns.angles(&relative, [0.0; 3]);
        let row = child.apply(Vec3(angles.by_turn.0[k]));
        let innovation = (angle - angles.q[k] + PI).rem_euclid(TAU) - PI;
        let rows = self.turn_rows(&state.means, l, &Mat3([row.0, [0.0; 3], [0.0; 3]]));
        self.correction.read(&state.covariance, &rows, 1, [innovation, 0.0, 0.0], [variance; 3]);
        self.rows = rows;
    }

    fn read_point(&mut self, state: &mut State, (end, through): (End, &[Leg]), place: Vec3<f64>, variance: f64) {
        let End::Unit(u, point) = end else { return };
        let means = &state.means;
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        let mean = &means.units[u];
        let arm = self.bone_of(means, u).apply(point);
        let mut at = mean.position + arm;
        self.push_skin(&mut rows, means, u, &sum(&ZERO, &skew(arm), -1.0));
        rows.push(UNIT * u, &sum(&ZERO, &skew(at), -1.0));
        rows.push(UNIT * u + 6, &Mat3::identity());
        for leg in through {
            at += self.push_leg(&mut rows, means, leg, &Mat3::identity());
        }
        self.correction.read(&state.covariance, &rows, 3, (place - at).0, [variance; 3]);
        self.rows = rows;
    }

    /// The heading of the field, against the azimuth that all units share. Norm and dip say whether it is the field of the place.
    fn read_field(&mut self, state: &mut State, s: usize, u: usize, (field, std): (Vec3<f64>, f64), step_s: f64) {
        let Some(first) = self.azimuth_state() else { return };
        let up = self.skeleton.up;
        let seen = state.means.units[u].rotation.apply(field);
        let level = seen - up * dot(seen, up);
        let across = square(level).sqrt();
        let now = [square(seen).sqrt(), (-dot(seen, up)).atan2(across)];
        if !(now[0] > 0.0 && across > 0.1 * now[0]) {
            self.fields[u] = Verdict::WrongDirection;
            return;
        }
        let world = [self.skeleton.field.norm_ut, self.skeleton.field.dip_rad];
        let noise = std / world[0];
        // The field of the model is right again at once, whatever the usual one has become.
        let usual = state.heard[s].usual.get_or_insert(now);
        if misfit(now, *usual, noise) != Verdict::Accepted && misfit(now, world, noise) == Verdict::Accepted {
            *usual = now;
        }
        self.fields[u] = if self.tests_fields { misfit(now, *usual, noise) } else { Verdict::Accepted };
        let is_usual = self.fields[u] == Verdict::Accepted;
        let share = (step_s / if is_usual { USUAL_S } else { NEW_S }).min(1.0);
        let most = [NORM_TOLERANCE * usual[0], DIP_TOLERANCE_RAD];
        for ((usual, now), most) in usual.iter_mut().zip(now).zip(most) {
            *usual += share * (now - *usual).clamp(-most, most);
        }
        if !is_usual {
            return;
        }
        let is_of_world = misfit(*usual, world, 0.0) == Verdict::Accepted;
        if let Some(field_std_ut) = self.links.field_std_ut.filter(|_| is_of_world) {
            if !state.updates.is_multiple_of(FIELDS_EVERY) {
                return;
            }
            let step_s = step_s * f64::from(FIELDS_EVERY);
            return self.read_whole_field(state, (u, first), field, (std.hypot(field_std_ut), step_s));
        }
        let innovation = self.north_of(level) - state.means.azimuth;
        let innovation = (innovation + PI).rem_euclid(TAU) - PI;
        // The heading turns with the unit; a wrong tilt lets the vertical part of the field in.
        let by_turn = seen.cross(up.cross(level)) * (1.0 / square(level));
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        rows.push(UNIT * u, &Mat3([by_turn.0.map(|x| -x), [0.0; 3], [0.0; 3]]));
        rows.push_one(first, [1.0, 0.0, 0.0]);
        let own = (std / across).powi(2) + white(IRON_RAD, IRON_TIME_S, step_s);
        let expected =
            IRON_RAD * IRON_RAD + self.correction.variance_along(&state.covariance, &rows, Vec3([1.0, 0.0, 0.0]));
        let variance = own * (innovation * innovation / (HUBER * HUBER * expected)).max(1.0);
        self.correction.read(&state.covariance, &rows, 1, [innovation, 0.0, 0.0], [variance; 3]);
        self.rows = rows;
    }

    /// All of a field that is the world's, uT, where nothing but a unit's own iron turns it.
    /// A magnet turns its heading and leaves norm and dip: the further the heading is off, the less the field counts.
    fn read_whole_field(
        &mut self,
        state: &mut State,
        (u, azimuth): (usize, usize),
        field: Vec3<f64>,
        (std_ut, step_s): (f64, f64),
    ) {
        let world = self.skeleton.field;
        let back = state.means.units[u].rotation.transposed();
        let expected: Vec3<f64> = world.magnetic(state.means.azimuth);
        let mut rows = std::mem::take(&mut self.rows);
        rows.clear();
        rows.push(UNIT * u, &back.times(&skew(expected)));
        let by_azimuth = back.apply(world.magnetic_slope(state.means.azimuth));
        rows.push_one(azimuth, by_azimuth.0);
        let innovation = field - back.apply(expected);
        let across = by_azimuth * (1.0 / square(by_azimuth).sqrt().max(f64::MIN_POSITIVE));
        let known = std_ut * std_ut + self.correction.variance_along(&state.covariance, &rows, across);
        let excess = dot(innovation, across).powi(2) / known;
        if excess > DISTURBED * DISTURBED {
            self.fields[u] = Verdict::Outlier;
        }
        let variance = white(std_ut, FIELD_TIME_S, step_s) * (excess / (HUBER * HUBER)).max(1.0).powi(2);
        self.correction.read(&state.covariance, &rows, 3, innovation.0, [variance; 3]);
        self.rows = rows;
    }

    /// Angle of a horizontal vector about the vertical from `forward`, rad.
    fn north_of(&self, level: Vec3<f64>) -> f64 {
        let Skeleton { up, forward, .. } = &self.skeleton;
        dot(level, up.cross(*forward)).atan2(dot(level, *forward))
    }

    /// State of the field's azimuth, if units have magnetometers.
    pub fn azimuth_state(&self) -> Option<usize> {
        self.skeleton.has_fields().then(|| self.size - 1)
    }

    /// Moves all units so that the first position that was measured is right.
    pub(super) fn find_place(&self, means: &mut Means, heard: &[Heard]) {
        let first = self.skeleton.sensors.iter().zip(heard).find_map(|(sensor, heard)| match &sensor.measures {
            Measures::Point(End::Unit(u, point), through) => Some((*u, *point, through, heard.all.front()?.1)),
            _ => None,
        });
        let Some((u, point, through, place)) = first else { return };
        let mut at = means.units[u].position + self.bone_of(means, u).apply(point);
        for leg in through {
            at += self.leg(means, leg);
        }
        means.units.iter_mut().for_each(|unit| unit.position += Vec3(place) - at);
    }

    /// The azimuth at the start, from the first moments of all magnetometers, and its standard deviation, rad. If the azimuth is known, all
    /// units turn about the vertical instead, so that the field has it. `rotations`: of each unit at the start, room from unit.
    pub(super) fn find_north(
        &self,
        means: &mut Means,
        rotations: &[Mat3<f64>],
        (readings, heard): (&[Readings], &[Heard]),
        time_s: f64,
    ) -> f64 {
        let fields = self.skeleton.sensors.iter().zip(heard).filter_map(|(sensor, heard)| match sensor.measures {
            Measures::Field(u) => Some(rotations[u].apply(self.first_field((&readings[u], heard), time_s))),
            _ => None,
        });
        let all = fields.fold(Vec3([0.0; 3]), |all, field| all + field);
        let level = all - self.skeleton.up * dot(all, self.skeleton.up);
        if square(level) == 0.0 {
            means.azimuth = self.skeleton.azimuth_rad.unwrap_or(0.0);
            return self.azimuth_std();
        }
        let north = self.north_of(level);
        let Some(azimuth) = self.skeleton.azimuth_rad else {
            means.azimuth = north;
            return self.azimuth_std();
        };
        means.azimuth = azimuth;
        let all: Vec<usize> = (0..means.units.len()).collect();
        self.turn_all(means, &all, azimuth - north);
        self.azimuth_std()
    }

    /// The field in the first moments of a unit, summed in its axes at the start, uT.
    pub(super) fn first_field(&self, (readings, heard): (&Readings, &Heard), start_s: f64) -> Vec3<f64> {
        let zero = Vec3([0.0; 3]);
        let (mut turned, mut at_s, mut sum) = (Increment::none(), start_s, zero);
        for (time_s, field) in heard.all.iter().take_while(|(time_s, _)| *time_s <= start_s + LEVEL_S) {
            let to_s = time_s.min(readings.last_s());
            if to_s > at_s {
                readings.integrate(&mut turned, (at_s, to_s), [zero; 2], zero, &self.links);
                at_s = to_s;
            }
            sum += turned.rotation.apply(Vec3(*field));
        }
        sum
    }

    /// Standard deviation of the field's azimuth before any reading, rad.
    pub(super) fn azimuth_std(&self) -> f64 {
        self.skeleton.azimuth_rad.map_or(UNKNOWN_AZIMUTH_RAD, |_| KNOWN_AZIMUTH_RAD)
    }
}
