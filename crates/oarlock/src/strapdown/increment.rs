//! Readings of one unit, and what they add up to between two instants: rotation, velocity and position gained, their derivatives by the
//! biases, and their covariance (Lupton and Sukkarieh 2012; Forster et al. 2017), on the unit's own clock.

use crate::model::Links;
use crate::rotation::{Mat3, Vec3};
use std::collections::VecDeque;

/// A reading of gyroscope and accelerometer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// s.
    pub time_s: f64,
    /// rad/s.
    pub gyro: Vec3<f64>,
    /// m/s2.
    pub accel: Vec3<f64>,
    /// Standard deviations beyond the noise of each axis, rad/s and m/s2: of clipped readings.
    pub excess: [Vec3<f64>; 2],
}

/// Rotation, velocity and position gained in the axes of the beginning, without gravity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment {
    /// s.
    pub duration_s: f64,
    pub rotation: Mat3<f64>,
    pub velocity: Vec3<f64>,
    pub position: Vec3<f64>,
    /// Derivatives: rotation by the gyroscope's bias, velocity and position by both.
    pub rotation_gyro: Mat3<f64>,
    pub velocity_gyro: Mat3<f64>,
    pub velocity_accel: Mat3<f64>,
    pub position_gyro: Mat3<f64>,
    pub position_accel: Mat3<f64>,
    /// Of (rotation in the axes of the end, velocity, position).
    pub covariance: [[f64; 9]; 9],
}

/// a + b times a scalar.
pub fn sum(a: &Mat3<f64>, b: &Mat3<f64>, times: f64) -> Mat3<f64> {
    let mut out = *a;
    for (row, other) in out.0.iter_mut().zip(&b.0) {
        row.iter_mut().zip(other).for_each(|(x, y)| *x += times * y);
    }
    out
}

/// The matrix of the cross product v x.
pub fn skew(v: Vec3<f64>) -> Mat3<f64> {
    let [x, y, z] = v.0;
    Mat3([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
}

pub const ZERO: Mat3<f64> = Mat3([[0.0; 3]; 3]);

impl Increment {
    /// Of no time.
    pub fn none() -> Self {
        let zero = Vec3([0.0; 3]);
        Increment {
            duration_s: 0.0,
            rotation: Mat3::identity(),
            velocity: zero,
            position: zero,
            rotation_gyro: ZERO,
            velocity_gyro: ZERO,
            velocity_accel: ZERO,
            position_gyro: ZERO,
            position_accel: ZERO,
            covariance: [[0.0; 9]; 9],
        }
    }

    /// Adds `h` seconds of an even rate and force without biases; `noise`: their power, by axis of the gyroscope
    /// rad2/s, and m2/s3.
    fn add(&mut self, h: f64, rate: Vec3<f64>, force: Vec3<f64>, noise: (Vec3<f64>, f64)) {
        let turn = Mat3::about(rate * h);
        let half_turn = Mat3::about(rate * (0.5 * h));
        let middle = self.rotation.times(&half_turn);
        let gained = middle.apply(force);
        let w = middle.times(&skew(force));
        let middle_gyro = sum(&half_turn.transposed().times(&self.rotation_gyro), &Mat3::identity(), -0.5 * h);
        let wj = w.times(&middle_gyro);
        let half = 0.5 * h * h;
        self.position_gyro = sum(&sum(&self.position_gyro, &self.velocity_gyro, h), &wj, -half);
        self.position_accel = sum(&sum(&self.position_accel, &self.velocity_accel, h), &middle, -half);
        self.velocity_gyro = sum(&self.velocity_gyro, &wj, -h);
        self.velocity_accel = sum(&self.velocity_accel, &middle, -h);
        self.spread(h, &turn, &w, noise);
        self.position += self.velocity * h + gained * half;
        self.velocity += gained * h;
        self.rotation_gyro = sum(&turn.transposed().times(&self.rotation_gyro), &Mat3::identity(), -h);
        self.rotation = self.rotation.times(&turn);
        self.duration_s += h;
    }

    /// The same with other biases, to first order in their change.
    pub fn corrected(&self, gyro: Vec3<f64>, accel: Vec3<f64>) -> Self {
        let turn = Mat3::about(self.rotation_gyro.apply(gyro));
        Increment {
            rotation: self.rotation.times(&turn),
            velocity: self.velocity + self.velocity_gyro.apply(gyro) + self.velocity_accel.apply(accel),
            position: self.position + self.position_gyro.apply(gyro) + self.position_accel.apply(accel),
            ..*self
        }
    }

    /// Covariance by the step's transition and noise.
    fn spread(&mut self, h: f64, turn: &Mat3<f64>, w: &Mat3<f64>, (gyro, accel): (Vec3<f64>, f64)) {
        let (s, half) = (&mut self.covariance, 0.5 * h * h);
        let moved = |old: [f64; 9]| {
            let mut new = old;
            for i in 0..3 {
                new[i] = (0..3).map(|k| turn.0[k][i] * old[k]).sum();
                let by_turn: f64 = (0..3).map(|k| w.0[i][k] * old[k]).sum();
                new[3 + i] = old[3 + i] - h * by_turn;
                new[6 + i] = old[6 + i] + h * old[3 + i] - half * by_turn;
            }
            new
        };
        // The covariance is symmetric: rows, then columns, by rows of the transpose.
        let rows: [[f64; 9]; 9] = s.map(moved);
        *s = std::array::from_fn(|c| moved(std::array::from_fn(|r| rows[r][c])));
        for q in 0..3 {
            s[q][q] += gyro.0[q] * h;
            s[3 + q][3 + q] += accel * h;
            s[6 + q][6 + q] += accel * h * h * h / 4.0;
            s[3 + q][6 + q] += accel * half;
            s[6 + q][3 + q] += accel * half;
        }
    }
}

/// How a limb moves where nothing is read: standard deviations of its rate, rad/s, and acceleration, m/s2, and their time, s.
const UNREAD_RATE: f64 = 2.0;
const UNREAD_ACCELERATION: f64 = 5.0;
const UNREAD_TIME_S: f64 = 0.2;
/// Intervals longer than this share of the usual one have lost readings.
const LOST_SHARE: f64 = 1.6;
/// Longer silences are bridged by the noise of a limb that nothing reads, s.
const SILENCE_S: f64 = 0.12;
/// Readings are stored for this long, s.
const MEMORY_S: f64 = 0.6;

/// The readings of a unit around the present.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Readings {
    all: VecDeque<Reading>,
    /// A reading that changed so much that the next one must say whether it is a jump or a movement.
    held: Option<Reading>,
    /// Usual interval, s; 0: unknown.
    interval_s: f64,
}

/// A reading that jumped away and back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jump {
    /// s.
    pub time_s: f64,
    /// Whether its gyroscope, and its accelerometer, did.
    pub of: [bool; 2],
}

/// Rate, force and their changes at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Signal {
    pub gyro: Vec3<f64>,
    pub accel: Vec3<f64>,
    /// rad/s2.
    pub gyro_slope: Vec3<f64>,
    /// Interval that the slope spans, s; 0: it is unknown.
    pub span_s: f64,
    /// Rate of the readings, Hz.
    pub rate_hz: f64,
    /// Time since the last reading, where none follows, s.
    pub silence_s: f64,
}

/// A gyroscope, rad/s, or accelerometer, m/s2, that changes by more than this from one reading to the next may have jumped. It has if the reading
/// after it is back by this share.
const JUMPS: [f64; 2] = [10.0, 400.0];
const BACK_SHARE: f64 = 0.5;
/// Readings further apart may differ by anything, s.
const LONGEST_JUMP_S: f64 = 0.1;

/// Changes of gyroscope, rad/s, and accelerometer, m/s2, between two readings.
fn changes(from: &Reading, to: &Reading) -> [f64; 2] {
    [square(to.gyro - from.gyro), square(to.accel - from.accel)].map(f64::sqrt)
}

impl Readings {
    /// Takes a reading: whether it is no late one, and whether it shows that the one before was a jump, which then counts as lost.
    pub fn take(&mut self, reading: Reading) -> (bool, Option<Jump>) {
        if self.held.map_or(self.last_s(), |held| held.time_s) >= reading.time_s {
            return (false, None);
        }
        let jump = self.held.take().and_then(|held| self.settle(held, &reading));
        let may_jump = |last: &Reading| {
            let changes = changes(last, &reading);
            reading.time_s - last.time_s < LONGEST_JUMP_S
                && (0..2).any(|k| changes[k] > JUMPS[k] && reading.excess[k].0 == [0.0; 3])
        };
        if self.last().is_some_and(may_jump) {
            self.held = Some(reading);
            return (true, jump);
        }
        (self.push(reading), jump)
    }

    /// Adds the reading that was held. Where it jumped, its neighbours stand for it.
    fn settle(&mut self, held: Reading, next: &Reading) -> Option<Jump> {
        let last = *self.last()?;
        let [there, back, across] = [changes(&last, &held), changes(&held, next), changes(&last, next)];
        let of = std::array::from_fn(|k| {
            let least = there[k].min(back[k]);
            held.excess[k].0 == [0.0; 3] && least > JUMPS[k] && across[k] < BACK_SHARE * least
        });
        let share = (held.time_s - last.time_s) / (next.time_s - last.time_s);
        let mut reading = held;
        if of[0] {
            reading.gyro = last.gyro + (next.gyro - last.gyro) * share;
            reading.excess[0] = Vec3([UNREAD_RATE; 3]);
        }
        if of[1] {
            reading.accel = last.accel + (next.accel - last.accel) * share;
            reading.excess[1] = Vec3([UNREAD_ACCELERATION; 3]);
        }
        self.push(reading);
        (of != [false; 2]).then_some(Jump { time_s: held.time_s, of })
    }

    /// All readings, the one that is held, and the usual interval, s.
    pub fn parts(&self) -> (&VecDeque<Reading>, Option<Reading>, f64) {
        (&self.all, self.held, self.interval_s)
    }

    /// From what `parts` returned.
    pub fn of_parts(all: Vec<Reading>, held: Option<Reading>, interval_s: f64) -> Self {
        Readings { all: all.into(), held, interval_s }
    }

    /// Adds a reading; false if it is not later than the last.
    pub fn push(&mut self, reading: Reading) -> bool {
        if let Some(last) = self.all.back() {
            let step_s = reading.time_s - last.time_s;
            if step_s <= 0.0 {
                return false;
            }
            // The usual interval: follows shorter ones at once and longer ones slowly.
            self.interval_s = match self.interval_s {
                0.0 => step_s,
                usual if step_s < usual => usual + 0.1 * (step_s - usual),
                usual => usual + 0.02 * (step_s.min(LOST_SHARE * usual) - usual),
            };
        }
        self.all.push_back(reading);
        true
    }

    /// Forgets all before `time_s`.
    pub fn begin(&mut self, time_s: f64) {
        self.all.retain(|r| r.time_s >= time_s - 1e-6);
    }

    /// Forgets what is not needed from `time_s` on.
    pub fn forget(&mut self, time_s: f64) {
        while self.all.len() > 2 && self.all[1].time_s < time_s - MEMORY_S {
            self.all.pop_front();
        }
    }

    /// Time of the last reading, s.
    pub fn last_s(&self) -> f64 {
        self.all.back().map_or(f64::NEG_INFINITY, |r| r.time_s)
    }

    /// Time of the first reading after a time, s.
    pub fn next_s(&self, time_s: f64) -> f64 {
        let next = self.all.partition_point(|r| r.time_s <= time_s + 1e-9);
        self.all.get(next).map_or(f64::INFINITY, |r| r.time_s)
    }

    /// Time of the last reading at or before a time, s.
    pub fn before_s(&self, time_s: f64) -> f64 {
        let next = self.all.partition_point(|r| r.time_s <= time_s + 1e-9);
        next.checked_sub(1).map_or(f64::NEG_INFINITY, |last| self.all[last].time_s)
    }

    /// The last reading.
    pub fn last(&self) -> Option<&Reading> {
        self.all.back()
    }

    /// Index of the last reading at or before a time; the first one if there is none.
    fn before(&self, time_s: f64) -> usize {
        self.all.partition_point(|r| r.time_s <= time_s + 1e-9).saturating_sub(1)
    }

    /// Extends an increment from `from_s` to `to_s`. `lift`: force on a resting unit, in the increment's axes.
    pub fn integrate(
        &self,
        increment: &mut Increment,
        (from_s, to_s): (f64, f64),
        [gyro_bias, accel_bias]: [Vec3<f64>; 2],
        lift: Vec3<f64>,
        links: &Links,
    ) {
        let mut now_s = from_s;
        let mut k = self.before(from_s);
        if self.all.is_empty() && to_s > from_s {
            increment.add(to_s - from_s, Vec3([0.0; 3]), increment.rotation.apply_transposed(lift), unread());
            return;
        }
        while now_s < to_s - 1e-9 {
            while k + 1 < self.all.len() && self.all[k + 1].time_s <= now_s + 1e-9 {
                k += 1;
            }
            let next = self.all.get(k + 1).filter(|_| self.all[k].time_s <= now_s + 1e-9);
            let following = next.or(self.all.get(k)).filter(|r| r.time_s > now_s + 1e-9);
            let end_s = following.map_or(to_s, |r| r.time_s.min(to_s));
            let (mut h, a) = (end_s - now_s, &self.all[k]);
            let (rate, force, noise) = match next {
                Some(b) => {
                    let share = (0.5 * (now_s + end_s) - a.time_s) / (b.time_s - a.time_s);
                    let (dw, df) = (b.gyro - a.gyro, b.accel - a.accel);
                    let noise = self.between(a, b, [links.gyro_step_share, links.accel_step_share], links);
                    (a.gyro + dw * share, a.accel + df * share, noise)
                }
                None => {
                    // Nothing newer, or nothing yet: the nearest reading is held.
                    h = h.min(SILENCE_S);
                    let since_s = (now_s - a.time_s).abs();
                    let noise = match self.all.get(k + 1).filter(|_| a.time_s > now_s && since_s < SILENCE_S - 1e-9) {
                        // Before the first reading all that changes between the first two is unknown.
                        Some(second) => self.between(a, second, [1.0; 2], links),
                        None => self.held(a, since_s, links),
                    };
                    // In a silence the limb is taken to stop.
                    let stops = (gyro_bias, increment.rotation.apply_transposed(lift) + accel_bias, noise);
                    if since_s >= SILENCE_S - 1e-9 {
                        stops
                    } else {
                        (a.gyro, a.accel, noise)
                    }
                }
            };
            let rate = rate - gyro_bias;
            let scale = links.gyro_scale.powi(2) * square(rate);
            increment.add(h, rate, force - accel_bias, (noise.0 + Vec3([scale; 3]), noise.1));
            now_s += h;
        }
    }

    /// Power of the noise between two readings: white, a share of their difference, and what lost readings hide.
    fn between(&self, a: &Reading, b: &Reading, share: [f64; 2], links: &Links) -> (Vec3<f64>, f64) {
        let step_s = b.time_s - a.time_s;
        let change = [square(b.gyro - a.gyro), square(b.accel - a.accel)];
        let mut noise = [0.0; 2];
        let own = [links.gyro_density, links.accel_density];
        for q in 0..2 {
            noise[q] = own[q].powi(2) + share[q].powi(2) * change[q] / 3.0 * step_s;
        }
        if step_s > SILENCE_S {
            return unread();
        }
        if self.interval_s > 0.0 && step_s > LOST_SHARE * self.interval_s {
            let share = step_s * step_s / (48.0 * UNREAD_TIME_S);
            noise[0] += UNREAD_RATE.powi(2) * share;
            noise[1] += UNREAD_ACCELERATION.powi(2) * share;
        }
        let larger = |q: usize| [0, 1, 2].map(|i| a.excess[q].0[i].max(b.excess[q].0[i]));
        let [gyro, accel] = [0, 1].map(|q| larger(q).map(|x| x * x * step_s));
        (Vec3(gyro.map(|x| x + noise[0])), noise[1] + accel.into_iter().fold(0.0, f64::max))
    }

    /// The same with no reading on the other side.
    fn held(&self, nearest: &Reading, since_s: f64, links: &Links) -> (Vec3<f64>, f64) {
        if since_s >= SILENCE_S - 1e-9 {
            return unread();
        }
        let share = (since_s + 0.5 * self.interval_s) / UNREAD_TIME_S;
        let of = |own: f64, std: f64, excess: f64| {
            own * own + (std * std * share.min(1.0) + excess * excess) * self.interval_s.max(0.01)
        };
        let accel = nearest.excess[1].0.into_iter().fold(0.0, f64::max);
        let gyro = nearest.excess[0].0.map(|excess| of(links.gyro_density, UNREAD_RATE, excess));
        (Vec3(gyro), of(links.accel_density, UNREAD_ACCELERATION, accel))
    }

    /// Signal at a time.
    pub fn at(&self, time_s: f64) -> Signal {
        let k = self.before(time_s);
        let zero = Vec3([0.0; 3]);
        let Some(a) = self.all.get(k) else {
            return Signal { gyro: zero, accel: zero, gyro_slope: zero, span_s: 0.0, rate_hz: 0.0, silence_s: 0.0 };
        };
        match self.all.get(k + 1).filter(|_| a.time_s <= time_s + 1e-9) {
            Some(b) => {
                let span_s = b.time_s - a.time_s;
                let share = (time_s - a.time_s) / span_s;
                let (dw, df) = (b.gyro - a.gyro, b.accel - a.accel);
                // At a reading itself the slope is that of both its neighbours.
                let before = k.checked_sub(1).filter(|_| share < 1e-6).map(|j| &self.all[j]);
                let (gyro_slope, span_s) = match before {
                    Some(c) => ((b.gyro - c.gyro) * (1.0 / (b.time_s - c.time_s)), b.time_s - c.time_s),
                    None => (dw * (1.0 / span_s), span_s),
                };
                Signal {
                    gyro: a.gyro + dw * share,
                    accel: a.accel + df * share,
                    gyro_slope,
                    span_s,
                    rate_hz: self.rate_hz(),
                    silence_s: 0.0,
                }
            }
            None => {
                let before = k.checked_sub(1).map(|j| &self.all[j]);
                let span_s = before.map_or(0.0, |b| a.time_s - b.time_s);
                let gyro_slope = before.map_or(zero, |b| (a.gyro - b.gyro) * (1.0 / span_s));
                let silence_s = (time_s - a.time_s).max(0.0);
                Signal { gyro: a.gyro, accel: a.accel, gyro_slope, span_s, rate_hz: self.rate_hz(), silence_s }
            }
        }
    }

    /// All readings up to a time.
    pub fn until(&self, time_s: f64) -> impl Iterator<Item = &Reading> + Clone {
        self.all.iter().filter(move |r| r.time_s <= time_s)
    }

    /// Readings in the window of `window_s` up to a time; `None` if they do not fill it.
    pub fn window(&self, time_s: f64, window_s: f64) -> Option<impl Iterator<Item = &Reading> + Clone> {
        let last = self.all.get(self.before(time_s)).filter(|r| r.time_s <= time_s + 1e-9)?;
        let begin_s = last.time_s - window_s;
        let is_full = self.all.front().is_some_and(|r| r.time_s <= begin_s + 0.5 * self.interval_s);
        let is_fresh = time_s - last.time_s <= 2.0 * self.interval_s.max(0.01);
        let end_s = last.time_s;
        (is_full && is_fresh).then(|| self.all.iter().filter(move |r| r.time_s > begin_s && r.time_s <= end_s))
    }

    /// Sampling rate, Hz.
    pub fn rate_hz(&self) -> f64 {
        1.0 / if self.interval_s > 0.0 { self.interval_s } else { 0.01 }
    }
}

fn unread() -> (Vec3<f64>, f64) {
    let [gyro, accel] = [UNREAD_RATE, UNREAD_ACCELERATION].map(|std| 2.0 * std * std * UNREAD_TIME_S);
    (Vec3([gyro; 3]), accel)
}

/// Square of a vector's length.
pub fn square(v: Vec3<f64>) -> f64 {
    v.0.iter().map(|x| x * x).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::links::JointsOf;

    fn reading(time_s: f64) -> Reading {
        let gyro = Vec3([3.0 * (7.0 * time_s).sin(), 2.0, -(5.0 * time_s).cos()]);
        Reading { time_s, gyro, accel: Vec3([1.0, 9.0 + (9.0 * time_s).sin(), -2.0]), excess: [Vec3([0.0; 3]); 2] }
    }

    fn readings() -> Readings {
        let mut all = Readings::default();
        (0..40).for_each(|k| assert!(all.push(reading(0.01 * f64::from(k)))));
        all
    }

    fn sum_of(bias: [Vec3<f64>; 2], cuts: &[f64]) -> Increment {
        let mut increment = Increment::none();
        for ends in cuts.windows(2) {
            readings().integrate(&mut increment, (ends[0], ends[1]), bias, Vec3([0.0; 3]), &Links::of(JointsOf::Bone));
        }
        increment
    }

    const NO_BIAS: [Vec3<f64>; 2] = [Vec3([0.0; 3]); 2];

    #[test]
    fn cuts_at_readings_change_nothing() {
        let (whole, parts) = (sum_of(NO_BIAS, &[0.03, 0.2]), sum_of(NO_BIAS, &[0.03, 0.05, 0.11, 0.2]));
        // Rounding of a product of 17 rotations.
        assert!(square(whole.velocity - parts.velocity) < 1e-24 && square(whole.position - parts.position) < 1e-24);
    }

    #[test]
    fn noise_before_the_first_reading_is_not_negative() {
        let mut increment = Increment::none();
        let lift = Vec3([0.0; 3]);
        readings().integrate(&mut increment, (-0.3, 0.05), NO_BIAS, lift, &Links::of(JointsOf::Bone));
        assert!((0..9).all(|i| increment.covariance[i][i] > 0.0), "{:?}", increment.covariance);
    }

    #[test]
    fn derivatives_are_those_of_differences() {
        let step = 1e-6;
        let middle = sum_of(NO_BIAS, &[0.033, 0.2]);
        for axis in 0..3 {
            for kind in 0..2 {
                let mut bias = NO_BIAS;
                bias[kind].0[axis] = step;
                let moved = sum_of(bias, &[0.033, 0.2]);
                let (by_velocity, by_position) = match kind {
                    0 => (middle.velocity_gyro.column(axis), middle.position_gyro.column(axis)),
                    _ => (middle.velocity_accel.column(axis), middle.position_accel.column(axis)),
                };
                // A turn within one step, up to 0.036 rad, is taken as small; values are up to 1.6.
                let close = |a: Vec3<f64>, b: Vec3<f64>| square(a * (1.0 / step) - b).sqrt() < 2e-3;
                assert!(close(moved.velocity - middle.velocity, by_velocity), "{kind} {axis}");
                assert!(close(moved.position - middle.position, by_position), "{kind} {axis}");
            }
        }
    }

    #[test]
    fn a_reading_that_jumps_away_and_back_is_lost_and_a_fast_movement_is_not() {
        let moved = |change: &dyn Fn(usize) -> f64| {
            let (mut all, mut jumps) = (Readings::default(), Vec::new());
            for k in 0..20 {
                let mut r = reading(0.01 * k as f64);
                r.gyro.0[1] += change(k);
                let (is_taken, jump) = all.take(r);
                assert!(is_taken);
                jumps.extend(jump.map(|jump| ((jump.time_s * 100.0).round(), jump.of)));
            }
            (all.all.iter().map(|r| r.gyro.0[1]).collect::<Vec<_>>(), jumps)
        };
        let (rates, jumps) = moved(&|k| if k == 9 { 20.0 } else { 0.0 });
        assert_eq!(jumps, [(9.0, [true, false])]);
        assert_eq!(rates.len(), 20);
        assert!((rates[9] - 2.0).abs() < 1e-12);
        let (rates, jumps) = moved(&|k| if k >= 9 { 20.0 } else { 0.0 });
        assert!(jumps.is_empty() && rates[9] == 22.0 && rates.len() == 20);
        // Faster and faster, and back.
        let (rates, jumps) = moved(&|k| 11.0 * (if k < 10 { k } else { 19 - k }) as f64);
        assert!(jumps.is_empty() && rates[9] == 2.0 + 99.0);
    }

    #[test]
    fn a_jump_and_a_lost_reading_widen_the_covariance() {
        let spread = |skip: i32, jump: f64| {
            let mut all = Readings::default();
            for k in (0..40).filter(|k| *k != skip) {
                let mut r = reading(0.01 * f64::from(k));
                r.gyro = Vec3([if k >= 20 { jump } else { 0.0 }, 0.0, 0.0]);
                all.push(r);
            }
            let mut increment = Increment::none();
            all.integrate(&mut increment, (0.1, 0.3), NO_BIAS, Vec3([0.0; 3]), &Links::of(JointsOf::Bone));
            increment.covariance[0][0]
        };
        assert!(spread(-1, 10.0) > 2.0 * spread(-1, 0.0));
        assert!(spread(15, 0.0) > 1.05 * spread(-1, 0.0));
    }
}
