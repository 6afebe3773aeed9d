//! The start of strapdown links: orientations from a posture and the mean force, positions that close all joints. `track` calls it.

use super::covariance::UNIT;
use super::filter::{dot, Means, State, StrapdownFilter, UnitState, LOOSE_WALK, SPRING_TIME_S};
use super::increment::{skew, square, Increment, Readings};
use super::readings::{resting_rate, REST_S};
use super::sensors::{Heard, Measures, UNKNOWN_AZIMUTH_RAD};
use super::skeleton::{Closure, End, Pose, Unit};
use crate::kernels::dense::Square;
use crate::model::Links;
use crate::rotation::turn::Turn;
use crate::rotation::{Mat3, Vec3};
use std::f64::consts::{PI, TAU};

/// The start is levelled by the mean force over this time, and has the mean heading of the field, s.
pub(super) const LEVEL_S: f64 = 0.4;
/// A unit rests at the start if it does up to this time after it, s: units have their first readings at times of their own.
const START_REST_S: f64 = REST_S + 0.05;
/// Tilt from the mean force of a unit at rest, rad.
const LEVEL_RAD: f64 = 0.02;

/// From this standard deviation of headings on, rad, a body may begin in any posture and movement: a unit that turns at this distance, m, reads
/// a force that is not vertical.
const ANY_POSTURE_RAD: f64 = 0.5;
const SWING_M: f64 = 0.5;
/// Squared sine of the least angle between two directions that tell an orientation.
const LEAST_ACROSS: f64 = 0.03;

/// Above this standard deviation of a joint's heading at the start, rad, it is sought in a bank of this many.
const OPEN_RAD: f64 = 0.6;
const HEADINGS: usize = 12;
/// Log-likelihood by which a heading must lead.
const DECIDED: f64 = 6.0;

/// A mount that is off by no more is exact, rad.
const EXACT_RAD: f64 = 1e-3;
/// Least standard deviation of a heading that was found, rad.
const LEAST_HEADING_RAD: f64 = 0.1;

/// Whether the units of a closure may have any heading against each other; `stds`: of each unit's heading, rad.
fn is_open(closure: &Closure, stds: &[f64]) -> bool {
    let units = closure.from.unit().zip(closure.to.unit());
    closure.loop_std_m.is_none() && units.is_some_and(|(a, b)| stds[a].hypot(stds[b]) > OPEN_RAD)
}

/// The rotation that turns the first of two directions onto the first of others, and the second as near as it can (Shuster and Oh 1981,
/// TRIAD); `None` if two are nearly parallel.
fn rotation_between(to: [Vec3<f64>; 2], from: [Vec3<f64>; 2]) -> Option<Mat3<f64>> {
    let axes = |[first, second]: [Vec3<f64>; 2]| {
        let unit = |v: Vec3<f64>| v * (1.0 / square(v).sqrt());
        let across = unit(first).cross(unit(second));
        let (x, y) = (unit(first), unit(across));
        let z = x.cross(y);
        (square(across) > LEAST_ACROSS).then(|| Mat3(std::array::from_fn(|r| [x.0[r], y.0[r], z.0[r]])))
    };
    Some(axes(to)?.times_transposed(&axes(from)?))
}

/// What a closure made of a heading.
struct Tried {
    /// With what the posture says of the heading.
    log_likelihood: f64,
    heading: f64,
    std: f64,
}

impl Tried {
    /// Angle from another heading, rad.
    fn apart(&self, other: &Tried) -> f64 {
        (self.heading - other.heading + PI).rem_euclid(TAU) - PI
    }
}

/// Standard deviation of a heading about the best of those that were tried, rad: where readings do not decide, it is that of all.
fn spread(tried: &[Tried]) -> f64 {
    let best = &tried[0];
    let weight = |t: &Tried| (t.log_likelihood - best.log_likelihood).exp();
    let all: f64 = tried.iter().map(weight).sum();
    (tried.iter().map(|t| weight(t) * (t.apart(best).powi(2) + t.std * t.std)).sum::<f64>() / all).sqrt()
}

impl StrapdownFilter {
    /// The state at the start. `orientation`: room from link, of every link, and whether somebody stated it; readings of the first moments.
    pub fn start(
        &self,
        time_s: f64,
        (orientation, is_stated): (&[Mat3<f64>], bool),
        (readings, heard): (Vec<Readings>, Vec<Heard>),
    ) -> (State, Vec<f64>) {
        let zero = Vec3([0.0; 3]);
        let mut turned: Vec<Mat3<f64>> = orientation.to_vec();
        let (mut units, mut tilts) = (Vec::new(), Vec::new());
        let is_open = !is_stated && self.links.start_std_rad > OPEN_RAD;
        let seen = if is_open { self.seen_by_fields(&turned, (&readings, &heard), time_s) } else { Vec::new() };
        for (u, (unit, readings)) in self.skeleton.units.iter().zip(&readings).enumerate() {
            let rotation = turned[unit.link].times(&unit.mount);
            let seen = seen.get(u).copied().flatten();
            let (rotation, tilt) = seen.unwrap_or_else(|| self.levelled(rotation, is_stated, readings, time_s));
            tilts.push(tilt);
            turned[unit.link] = rotation.times_transposed(&unit.mount);
            units.push(UnitState { rotation, velocity: zero, position: zero, gyro_bias: zero, accel_bias: zero });
        }
        let loose: Vec<Mat3<f64>> = self.skeleton.loose.iter().map(|l| self.against(*l, &turned)).collect();
        let constants = vec![zero; self.constants().count()];
        let pushes = vec![0.0; self.skeleton.pushes.len()];
        let inputs = self.first_inputs(&heard, time_s);
        let lengths = vec![0.0; self.skeleton.lengths.len()];
        let slides = self.skeleton.slides.iter().map(|slide| [slide.rest_m, 0.0]).collect();
        let mut means = Means { units, loose, constants, azimuth: 0.0, pushes, room: zero, lengths, slides, inputs };
        self.place(&mut means, &mut vec![false; tilts.len()]);
        let rotations: Vec<Mat3<f64>> = means.units.iter().map(|unit| unit.rotation).collect();
        let north = self.find_north(&mut means, &rotations, (&readings, &heard), time_s);
        self.find_place(&mut means, &heard);
        let headings: Vec<f64> = self.heading_stds(&means).iter().map(|std| std.min(OPEN_RAD)).collect();
        let covariance = self.start_covariance(&means, &tilts, (&headings, north));
        let increments = vec![Increment::none(); self.skeleton.units.len()];
        (State { time_s, means, covariance, readings, heard, increments, row_s: time_s, updates: 0 }, tilts)
    }

    /// Standard deviation of each unit's heading before any reading, rad: of the posture, and of a calibrated mount about its vertical.
    pub(super) fn heading_stds(&self, means: &Means) -> Vec<f64> {
        let std = |(unit, mean): (&Unit, &UnitState)| {
            let up = unit.mount.apply(mean.rotation.apply_transposed(self.skeleton.up));
            let mount = unit.mount_std_rad.iter().zip(up.0).map(|(std, u)| (std * u).powi(2)).sum::<f64>();
            self.links.start_std_rad.hypot(mount.sqrt())
        };
        self.skeleton.units.iter().zip(&means.units).map(std).collect()
    }

    /// Covariance at the start; standard deviations of each unit's tilt and heading, and of the field's azimuth, rad.
    pub(super) fn start_covariance(&self, means: &Means, tilts: &[f64], (headings, north): (&[f64], f64)) -> Square {
        let links = &self.links;
        let mut covariance = Square::zeros(self.size);
        for (i, (unit, mean)) in self.skeleton.units.iter().zip(&means.units).enumerate() {
            let stds = [links.start_speed_std_m_s, links.start_place_std_m];
            let block = fresh_block(&self.start_turn(headings[i], tilts[i]), mean, stds);
            put_block(&mut covariance, UNIT * i, &block);
            for r in 0..6 {
                let at = UNIT * i + 9 + r;
                *covariance.at_mut(at, at) = unit.bias[r / 3][0].powi(2);
            }
        }
        for number in 0..self.skeleton.loose.len() {
            let first = self.loose_state(number);
            (first..first + 3).for_each(|i| *covariance.at_mut(i, i) = LOOSE_WALK * LOOSE_WALK * SPRING_TIME_S);
        }
        self.restate(&mut covariance);
        self.slide_variances().for_each(|(i, variance)| *covariance.at_mut(i, i) = variance);
        for (k, push) in self.skeleton.pushes.iter().enumerate() {
            let i = self.push_state(k);
            *covariance.at_mut(i, i) = push.start_std.powi(2);
        }
        if let Some(i) = self.azimuth_state() {
            *covariance.at_mut(i, i) = north * north;
        }
        covariance
    }

    /// Gives the constants of a start the variances of this filter's statements.
    pub fn restate(&self, covariance: &mut Square) {
        let (links, all) = (&self.links, self.constant_variances());
        let lengths = (0..self.skeleton.lengths.len()).map(|k| (self.length_state(k), links.length_share.powi(2)));
        for (i, variance) in all.into_iter().chain(lengths) {
            *covariance.at_mut(i, i) = variance;
        }
    }

    /// Of every constant state, and of skins and the room at their start.
    fn constant_variances(&self) -> Vec<(usize, f64)> {
        let (links, mut all) = (&self.links, Vec::new());
        let mut put = |first: Option<usize>, variance: Vec3<f64>| {
            all.extend(first.into_iter().flat_map(|first| first..first + 3).zip(variance.0));
        };
        for (points, closure) in self.points.iter().zip(&self.skeleton.closures) {
            let own = Vec3([links.point_std_m.powi(2); 3]);
            points.iter().zip(closure.spread_m2).for_each(|(first, spread)| put(*first, spread + own));
        }
        for (l, axes) in self.axes.iter().enumerate() {
            put(axes[0], self.axes_variance(self.skeleton.links[l].parent));
            put(axes[1], self.axes_variance(Some(l)));
        }
        put(self.room_state(), Vec3([links.room_std_rad.unwrap_or(0.0).powi(2); 3]));
        for (u, [mount, skin]) in self.turned.iter().enumerate() {
            put(*mount, self.mount_variance(u));
            put(*skin, Vec3([links.skin_std_rad.unwrap_or(0.0).powi(2); 3]));
        }
        all
    }

    /// Variances of a unit's mount in its own axes, rad2: those of its calibration, if that states more or less than the model; none where it is
    /// exact.
    fn mount_variance(&self, u: usize) -> Vec3<f64> {
        let (nominal, unit) = (self.links.mount_std_rad.unwrap_or(0.0), &self.skeleton.units[u]);
        if nominal <= EXACT_RAD || unit.mount_std_rad == [0.0; 3] {
            return Vec3([nominal * nominal; 3]);
        }
        let of = |k: usize| (0..3).map(|i| (unit.mount.0[i][k] * unit.mount_std_rad[i]).powi(2)).sum::<f64>();
        Vec3([0, 1, 2].map(|k| of(k).max(EXACT_RAD * EXACT_RAD)))
    }

    /// Variances of a joint's axes in a link, rad2: those of its unit's mount if a calibration knows it.
    fn axes_variance(&self, link: Option<usize>) -> Vec3<f64> {
        let nominal = self.links.axis_std_rad.unwrap_or(0.0);
        let known = match link.map(|l| self.skeleton.links[l].pose) {
            Some(Pose::Unit(u)) => self.skeleton.units[u].mount_std_rad,
            _ => [0.0; 3],
        };
        Vec3(known.map(|std| if std > 0.0 { std } else { nominal }.powi(2)))
    }

    /// Covariance of a unit's orientation at the start, in the room's axes; `tilt`: standard deviation of its tilt, rad.
    fn start_turn(&self, heading: f64, tilt: f64) -> Mat3<f64> {
        let [heading, tilt] = [heading, tilt].map(|std| std * std);
        let up = self.skeleton.up.0;
        Mat3(std::array::from_fn(|r| {
            std::array::from_fn(|c| (heading - tilt) * up[r] * up[c] + if r == c { tilt } else { 0.0 })
        }))
    }

    /// Orientation of each unit that moves, room from unit, by the field and the mean force of its first moments, and the standard deviation
    /// of its tilt, rad; `None`: it rests, or has no magnetometer. If the azimuth is unknown, all of them together are turned as near to the
    /// posture as they can be.
    fn seen_by_fields(
        &self,
        orientation: &[Mat3<f64>],
        (readings, heard): (&[Readings], &[Heard]),
        time_s: f64,
    ) -> Vec<Option<(Mat3<f64>, f64)>> {
        let (up, until_s, below) = (self.skeleton.up, time_s + START_REST_S, self.links.rest_below_rad_s);
        let world = [self.skeleton.field.magnetic(self.skeleton.azimuth_rad.unwrap_or(0.0)), up];
        let mut seen = vec![None; readings.len()];
        for (sensor, heard) in self.skeleton.sensors.iter().zip(heard) {
            let Measures::Field(u) = sensor.measures else { continue };
            // A force that gravity alone makes shows the tilt better.
            let moves = resting_rate(&readings[u], until_s, below).is_none();
            let Some((force, std)) = self.mean_force(&readings[u], time_s).filter(|_| moves) else { continue };
            let first = self.first_field((&readings[u], heard), time_s);
            seen[u] = rotation_between(world, [first, force]).map(|rotation| (rotation, std));
        }
        if self.skeleton.azimuth_rad.is_some() {
            return seen;
        }
        let (mut sin, mut cos) = (0.0, 0.0);
        for (unit, seen) in self.skeleton.units.iter().zip(&seen) {
            let Some((seen, _)) = seen else { continue };
            let Mat3(away) = seen.times_transposed(&orientation[unit.link].times(&unit.mount));
            let axis = Vec3([away[2][1] - away[1][2], away[0][2] - away[2][0], away[1][0] - away[0][1]]);
            sin += dot(axis, up);
            cos += away[0][0] + away[1][1] + away[2][2] - dot(up, Mat3(away).apply(up));
        }
        let back = Mat3::about(up * -sin.atan2(cos));
        seen.into_iter().map(|seen| seen.map(|(seen, std)| (back.times(&seen), std))).collect()
    }

    /// The orientation, turned the short way towards the one in which the mean force is vertical, by what both are worth; and the standard
    /// deviation of its tilt, rad.
    fn levelled(&self, rotation: Mat3<f64>, is_stated: bool, readings: &Readings, time_s: f64) -> (Mat3<f64>, f64) {
        let Links { start_tilt_std_rad, start_std_rad, .. } = self.links;
        let prior = if is_stated { start_std_rad.min(start_tilt_std_rad) } else { start_tilt_std_rad };
        // The force of a unit that moves says less than a posture that somebody stated.
        if is_stated && resting_rate(readings, time_s + START_REST_S, self.links.rest_below_rad_s).is_none() {
            return (rotation, prior);
        }
        let Some((force, read)) = self.mean_force(readings, time_s) else { return (rotation, prior) };
        let force = rotation.apply(force);
        let axis = force.cross(self.skeleton.up);
        let (sin, cos) = (square(axis).sqrt(), dot(force, self.skeleton.up));
        let share = prior * prior / (prior * prior + read * read);
        let std = prior * read / prior.hypot(read);
        if sin < 1e-9 {
            return (rotation, std);
        }
        (Mat3::about(axis * (share * sin.atan2(cos) / sin)).times(&rotation), std)
    }

    /// Mean squared rate at the start, rad2/s2.
    fn mean_rate2(&self, readings: &Readings, time_s: f64) -> f64 {
        let window = readings.until((time_s + LEVEL_S).min(readings.last_s()));
        let (sum, count) = window.fold((0.0, 0.0), |(sum, n), r| (sum + square(r.gyro), n + 1.0));
        if count > 0.0 {
            sum / count
        } else {
            0.0
        }
    }

    /// Mean force at the start, in the axes of the start, m/s2, and the standard deviation of its direction against the vertical, rad.
    fn mean_force(&self, readings: &Readings, time_s: f64) -> Option<(Vec3<f64>, f64)> {
        let end_s = (time_s + LEVEL_S).min(readings.last_s());
        let window = readings.until(end_s);
        let (sum, count) = window.clone().fold((Vec3([0.0; 3]), 0.0), |(sum, n), r| (sum + r.accel, n + 1.0));
        let mean = sum * (1.0 / count);
        let scatter = (window.map(|r| square(r.accel - mean)).sum::<f64>() / count).sqrt();
        let is_any = self.links.start_std_rad >= ANY_POSTURE_RAD;
        let turning = if is_any { SWING_M * self.mean_rate2(readings, time_s) } else { 0.0 };
        let std = LEVEL_RAD.hypot(scatter.hypot(turning) / self.skeleton.gravity_m_s2.max(1.0));
        let (mut increment, zero) = (Increment::none(), Vec3([0.0; 3]));
        readings.integrate(&mut increment, (time_s, end_s), [zero; 2], zero, &self.links);
        let duration_s = increment.duration_s;
        (duration_s > 0.5 * LEVEL_S && count > 2.0).then(|| (increment.velocity * (1.0 / duration_s), std))
    }

    /// Whether model or calibration leave the headings of links against each other open.
    pub fn seeks_headings(&self, means: &Means) -> bool {
        let stds = self.heading_stds(means);
        self.closures && self.skeleton.closures.iter().any(|c| is_open(c, &stds))
    }

    /// The start with the headings that the first readings of every joint fit best, each joint alone in a bank of headings; `None` if they
    /// do not decide yet.
    pub fn with_headings(&self, start: &State, tilts: &[f64], must: bool) -> Option<State> {
        let last_s = start.readings.iter().map(Readings::last_s);
        let last_s = last_s.filter(|last| last.is_finite()).fold(f64::INFINITY, f64::min);
        let end_s = last_s.min(self.silent_from(start));
        let mut state = start.clone();
        let known = self.heading_stds(&start.means);
        let (mut sought, mut widest) = (vec![false; known.len()], LEAST_HEADING_RAD);
        for c in 0..self.skeleton.closures.len() {
            let beyond = self.skeleton.beyond(c);
            if beyond.len() == self.skeleton.units.len() || !is_open(&self.skeleton.closures[c], &known) {
                continue;
            }
            let ends = [self.skeleton.closures[c].from, self.skeleton.closures[c].to];
            let variance: f64 = ends.iter().filter_map(End::unit).map(|u| known[u] * known[u]).sum();
            let mut tried: Vec<Tried> = (0..HEADINGS)
                .map(|k| {
                    let heading = (k as f64 * TAU / HEADINGS as f64 + PI).rem_euclid(TAU) - PI;
                    self.tried(start, tilts, (c, &beyond), (heading, -0.5 * heading * heading / variance), end_s)
                })
                .collect();
            tried.sort_by(|a, b| b.log_likelihood.total_cmp(&a.log_likelihood));
            let best = &tried[0];
            // Neighbours of the best heading lead to the same one.
            let rival = tried.iter().find(|t| t.apart(best).abs() > TAU / HEADINGS as f64);
            if !must && rival.is_some_and(|rival| best.log_likelihood - rival.log_likelihood < DECIDED) {
                return None;
            }
            self.turn_all(&mut state.means, &beyond, best.heading);
            widest = widest.max(spread(&tried)).min(OPEN_RAD);
            let Closure { from, to, .. } = &self.skeleton.closures[c];
            beyond.iter().copied().chain(from.unit()).chain(to.unit()).for_each(|u| sought[u] = true);
        }
        let of = |(std, sought): (&f64, &bool)| if *sought { widest } else { std.min(OPEN_RAD) };
        let stds: Vec<f64> = known.iter().zip(&sought).map(of).collect();
        state.covariance = self.start_covariance(&state.means, tilts, (&stds, self.azimuth_std()));
        let rotations = self.rotations_in_hindsight(&state, end_s);
        let heard = (state.readings.as_slice(), state.heard.as_slice());
        let north = self.find_north(&mut state.means, &rotations, heard, state.time_s);
        state.covariance = self.start_covariance(&state.means, tilts, (&stds, north));
        self.doubt_heading(&mut state.covariance);
        Some(state)
    }

    /// Time of the last reading before the first silence of all units, s: after it a trial only guesses.
    fn silent_from(&self, start: &State) -> f64 {
        let (longest_s, mut last_s) = (self.longest_s(start), start.time_s);
        loop {
            let next_s = start.readings.iter().map(|r| r.next_s(last_s)).fold(f64::INFINITY, f64::min);
            if next_s - last_s > longest_s {
                return last_s;
            }
            last_s = next_s;
        }
    }

    /// Orientation of each unit at the start, room from unit, as the readings up to a later time show it.
    fn rotations_in_hindsight(&self, start: &State, end_s: f64) -> Vec<Mat3<f64>> {
        let (mut end, zero) = (start.clone(), Vec3([0.0; 3]));
        self.clone().advance(&mut end, end_s, &mut |_| {}, false);
        let since = |(unit, readings): (&UnitState, &Readings)| {
            let mut turned = Increment::none();
            readings.integrate(&mut turned, (start.time_s, end.time_s), [zero; 2], zero, &self.links);
            unit.rotation.times_transposed(&turned.rotation)
        };
        end.means.units.iter().zip(&start.readings).map(since).collect()
    }

    /// All units may be turned together about the vertical through the first joint in the room.
    fn doubt_heading(&self, covariance: &mut Square) {
        let ends = self.skeleton.closures.iter().map(|closure| [closure.from, closure.to]);
        let in_room = |end: &&End| end.unit().is_none();
        let Some(centre) = ends.filter_map(|ends| ends.iter().find(in_room).map(End::point)).next() else { return };
        let std = if self.skeleton.azimuth_rad.is_some() { LEAST_HEADING_RAD } else { OPEN_RAD };
        let up = self.skeleton.up * std;
        let turn = [up.0, [0.0; 3], centre.cross(up).0].concat();
        let units = 0..self.skeleton.units.len();
        let states: Vec<(usize, f64)> =
            units.flat_map(|u| (UNIT * u..UNIT * u + 9).zip(turn.iter().copied())).collect();
        for (r, a) in &states {
            states.iter().for_each(|(c, b)| *covariance.at_mut(*r, *c) += a * b);
        }
    }

    /// The readings of a closure from a heading of all that is beyond it; `prior`: log-likelihood of that heading by the posture.
    fn tried(
        &self,
        start: &State,
        tilts: &[f64],
        (c, beyond): (usize, &[usize]),
        (heading, prior): (f64, f64),
        end_s: f64,
    ) -> Tried {
        let mut closed = start.clone();
        self.turn_all(&mut closed.means, beyond, heading);
        let half = vec![0.5 * TAU / HEADINGS as f64; tilts.len()];
        closed.covariance = self.start_covariance(&closed.means, tilts, (&half, UNKNOWN_AZIMUTH_RAD));
        let mut open = closed.clone();
        let mut filter = self.clone();
        filter.only = Some(c);
        filter.advance(&mut closed, end_s, &mut |_| {}, false);
        let mut alone = self.clone();
        alone.closures = false;
        alone.advance(&mut open, end_s, &mut |_| {}, false);
        // An error of heading stays as it is, so what the closure has corrected by the end is what the start lacked.
        let turned = |end: &End| {
            end.unit().map_or(0.0, |u| {
                let moved = closed.means.units[u].rotation.times_transposed(&open.means.units[u].rotation);
                dot(Vec3(Turn::of(&moved).log()), self.skeleton.up)
            })
        };
        let closure = &self.skeleton.closures[c];
        let heading = heading + turned(&closure.to) - turned(&closure.from);
        let std = self.heading_variance(&closed.covariance, closure).sqrt();
        Tried { log_likelihood: filter.correction.log_likelihood + prior, heading, std }
    }

    /// Variance of the heading of a closure's second unit against its first.
    fn heading_variance(&self, covariance: &Square, closure: &Closure) -> f64 {
        let ends = [(&closure.to, 1.0), (&closure.from, -1.0)].map(|(end, sign)| (end.unit().map(|u| UNIT * u), sign));
        let up = self.skeleton.up.0;
        let mut variance = 0.0;
        for (a, x) in ends.iter().filter_map(|(f, s)| Some(((*f)?, s))) {
            for (b, y) in ends.iter().filter_map(|(f, s)| Some(((*f)?, s))) {
                for r in 0..3 {
                    variance += (0..3).map(|c| x * y * up[r] * covariance.at(a + r, b + c) * up[c]).sum::<f64>();
                }
            }
        }
        variance.max(0.0)
    }

    /// Turns some units about the vertical, and closes all joints again.
    pub(super) fn turn_all(&self, means: &mut Means, units: &[usize], angle: f64) {
        let turn = Mat3::about(self.skeleton.up * angle);
        units.iter().for_each(|u| means.units[*u].rotation = turn.times(&means.units[*u].rotation));
        self.place(means, &mut vec![false; means.units.len()]);
    }

    /// Rotation of a link against the neighbour that it hangs on, when all links are turned like this.
    pub(super) fn against(&self, link: usize, turned: &[Mat3<f64>]) -> Mat3<f64> {
        match self.skeleton.links[link].pose {
            Pose::State(_, Some(anchor)) => turned[anchor].transposed().times(&turned[link]),
            Pose::State(_, None) => turned[link],
            Pose::Unit(_) | Pose::Between(..) | Pose::Driven => Mat3::identity(),
        }
    }

    /// Positions that close all joints, of units that are not `known`; the first one is at the origin or where a joint with the room puts it.
    pub(super) fn place(&self, means: &mut Means, known: &mut [bool]) {
        loop {
            let mut moved = false;
            for c in 0..self.skeleton.closures.len() {
                let closure = self.stretched(means, c);
                let through = closure.through.iter().fold(Vec3([0.0; 3]), |sum, leg| sum + self.leg(means, leg));
                let ends = [closure.from, closure.to].map(|end| match end {
                    End::Room(point) => (None, self.orientation_of(means, None).apply(point)),
                    End::Unit(u, point) => (Some(u), self.bone_of(means, u).apply(point)),
                });
                match (ends[0].0, ends[1].0) {
                    (None, Some(b)) if !known[b] => {
                        means.units[b].position = ends[0].1 + through - ends[1].1;
                        (known[b], moved) = (true, true);
                    }
                    (Some(a), Some(b)) if known[a] && !known[b] => {
                        means.units[b].position = means.units[a].position + ends[0].1 + through - ends[1].1;
                        (known[b], moved) = (true, true);
                    }
                    (Some(a), Some(b)) if known[b] && !known[a] => {
                        means.units[a].position = means.units[b].position + ends[1].1 - through - ends[0].1;
                        (known[a], moved) = (true, true);
                    }
                    _ => {}
                }
            }
            if !moved {
                match known.iter().position(|k| !k) {
                    Some(first) => known[first] = true,
                    None => return,
                }
            }
        }
    }
}

/// Covariance of a unit's orientation, velocity and position that do not depend on each other; `turn`: that of its orientation.
pub fn fresh_block(turn: &Mat3<f64>, mean: &UnitState, stds: [f64; 2]) -> [[f64; 9]; 9] {
    // Invariant errors of velocity and position contain the turn of both about the room's origin.
    let levers = [Mat3::identity(), skew(mean.velocity), skew(mean.position)];
    let by_turn = levers.map(|lever| lever.times(turn));
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let (a, b) = (r / 3, c / 3);
            let own = if r == c && a > 0 { stds[a - 1].powi(2) } else { 0.0 };
            own + by_turn[a].times_transposed(&levers[b]).0[r % 3][c % 3]
        })
    })
}

/// Adds a block of nine rows and columns.
pub fn put_block(covariance: &mut Square, first: usize, block: &[[f64; 9]; 9]) {
    for (r, row) in block.iter().enumerate() {
        for (c, x) in row.iter().enumerate() {
            *covariance.at_mut(first + r, first + c) += *x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bank(log_likelihood: impl Fn(usize) -> f64) -> Vec<Tried> {
        let headings = (0..HEADINGS).map(|k| (k, k as f64 * TAU / HEADINGS as f64));
        headings.map(|(k, heading)| Tried { log_likelihood: log_likelihood(k), heading, std: 0.1 }).collect()
    }

    #[test]
    fn a_heading_that_readings_do_not_decide_is_as_uncertain_as_all_of_them() {
        // Of a uniform angle: pi / sqrt(3).
        assert!((spread(&bank(|_| 5.0)) - PI / 3f64.sqrt()).abs() < 0.05);
        assert!((spread(&bank(|k| -50.0 * k as f64)) - 0.1).abs() < 1e-9);
    }
}
