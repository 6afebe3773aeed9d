//! Flat form of the state of strapdown links, in pickled state estimates.

use super::fixing::Rival;
use super::{LinkState, Waiting};
use crate::estimate::filter::Verdict;
use crate::kernels::dense::Square;
use crate::model::Fixing;
use crate::recording::Sample;
use crate::rotation::{Mat3, Vec3};
use crate::strapdown::check::Check;
use crate::strapdown::filter::{Means, State, UnitState};
use crate::strapdown::increment::{Increment, Reading, Readings};
use crate::strapdown::sensors::Heard;

const VERDICTS: [Verdict; 6] =
    [Verdict::Missing, Verdict::Accepted, Verdict::Clipped, Verdict::Stuck, Verdict::Excluded, Verdict::Outlier];

/// Numbers one after another; lists begin with their length.
struct Writer(Vec<f64>);

impl Writer {
    fn list(&mut self, values: &[f64]) {
        self.0.push(values.len() as f64);
        self.0.extend_from_slice(values);
    }

    fn count(&mut self, count: usize) {
        self.0.push(count as f64);
    }

    fn three(&mut self, v: Vec3<f64>) {
        self.0.extend(v.0);
    }

    fn matrix(&mut self, m: &Mat3<f64>) {
        self.0.extend(m.0.iter().flatten());
    }
}

struct Source<'a>(std::slice::Iter<'a, f64>);

impl Source<'_> {
    fn number(&mut self) -> Option<f64> {
        self.0.next().copied()
    }

    fn count(&mut self) -> Option<usize> {
        let count = self.number().filter(|c| *c >= 0.0 && c.fract() == 0.0)? as usize;
        (count <= self.0.len()).then_some(count)
    }

    fn many<T>(&mut self, mut read: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let count = self.count()?;
        (0..count).map(|_| read(self)).collect()
    }

    fn list(&mut self) -> Option<Vec<f64>> {
        self.many(Self::number)
    }

    fn array<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut out = [0.0; N];
        out.iter_mut().try_for_each(|x| self.number().map(|v| *x = v))?;
        Some(out)
    }

    fn three(&mut self) -> Option<Vec3<f64>> {
        self.array().map(Vec3)
    }

    fn matrix(&mut self) -> Option<Mat3<f64>> {
        let m = self.array::<9>()?;
        Some(Mat3([[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]]))
    }
}

fn number_of(fixing: Fixing) -> usize {
    Fixing::ALL.iter().position(|one| *one == fixing).unwrap_or(0)
}

fn fixing_of(from: &mut Source) -> Option<Fixing> {
    Fixing::ALL.get(from.count()?).copied()
}

fn put_reading(to: &mut Writer, r: &Reading) {
    to.0.push(r.time_s);
    to.three(r.gyro);
    to.three(r.accel);
    r.excess.into_iter().for_each(|excess| to.three(excess));
}

fn put_state(to: &mut Writer, state: &State) {
    to.0.extend([state.time_s, state.row_s, f64::from(state.updates)]);
    to.list(state.covariance.as_slice());
    to.count(state.means.units.len());
    for u in &state.means.units {
        to.matrix(&u.rotation);
        [u.velocity, u.position, u.gyro_bias, u.accel_bias].into_iter().for_each(|v| to.three(v));
    }
    to.count(state.means.loose.len());
    state.means.loose.iter().for_each(|m| to.matrix(m));
    to.count(state.means.constants.len());
    state.means.constants.iter().for_each(|v| to.three(*v));
    to.count(state.readings.len());
    for readings in &state.readings {
        let (all, held, interval_s) = readings.parts();
        to.0.push(interval_s);
        to.count(held.iter().len());
        held.iter().for_each(|r| put_reading(to, r));
        to.count(all.len());
        all.iter().for_each(|r| put_reading(to, r));
    }
    to.0.push(state.means.azimuth);
    to.list(&state.means.pushes);
    to.list(&state.means.lengths);
    to.list(state.means.slides.as_flattened());
    to.three(state.means.room);
    to.list(state.means.inputs.as_flattened());
    to.count(state.heard.len());
    for Heard { all, jumped, usual } in &state.heard {
        to.list(&jumped.iter().flat_map(|(time_s, v)| [*time_s, v[0], v[1], v[2]]).collect::<Vec<_>>());
        to.list(&usual.iter().flatten().copied().collect::<Vec<_>>());
        to.count(all.len());
        all.iter().for_each(|(time_s, value)| to.0.extend([*time_s, value[0], value[1], value[2]]));
    }
    to.count(state.increments.len());
    state.increments.iter().for_each(|i| put_increment(to, i));
}

fn put_increment(to: &mut Writer, i: &Increment) {
    to.0.push(i.duration_s);
    to.three(i.velocity);
    to.three(i.position);
    let all = [&i.rotation, &i.rotation_gyro, &i.velocity_gyro, &i.velocity_accel, &i.position_gyro, &i.position_accel];
    all.into_iter().for_each(|m| to.matrix(m));
    to.0.extend(i.covariance.iter().flatten());
}

fn state_of(from: &mut Source) -> Option<State> {
    let [time_s, row_s, updates] = from.array()?;
    let covariance = from.list()?;
    let covariance = Square::from_rows(covariance.len().isqrt(), covariance)?;
    let units = from.many(|from| {
        Some(UnitState {
            rotation: from.matrix()?,
            velocity: from.three()?,
            position: from.three()?,
            gyro_bias: from.three()?,
            accel_bias: from.three()?,
        })
    })?;
    let (loose, constants) = (from.many(Source::matrix)?, from.many(Source::three)?);
    let mut means = Means { units, loose, constants, ..Means::default() };
    let readings = from.many(|from| {
        let interval_s = from.number()?;
        let reading = |from: &mut Source| {
            let (time_s, gyro, accel) = (from.number()?, from.three()?, from.three()?);
            Some(Reading { time_s, gyro, accel, excess: [from.three()?, from.three()?] })
        };
        let held = from.many(reading)?.pop();
        Some(Readings::of_parts(from.many(reading)?, held, interval_s))
    })?;
    means.azimuth = from.number()?;
    means.pushes = from.list()?;
    means.lengths = from.list()?;
    means.slides = from.list()?.as_chunks::<2>().0.to_vec();
    means.room = from.three()?;
    means.inputs = from.list()?.as_chunks::<2>().0.to_vec();
    let heard = from.many(|from| {
        let jumped = from.list()?.try_into().ok().map(|[time_s, x, y, z]: [f64; 4]| (time_s, [x, y, z]));
        let usual = from.list()?.try_into().ok();
        let reading = |from: &mut Source| Some((from.number()?, from.array()?));
        Some(Heard { jumped, usual, all: from.many(reading)?.into() })
    })?;
    let increments = from.many(increment_of)?;
    Some(State { time_s, means, covariance, readings, heard, increments, row_s, updates: updates as u32 })
}

fn increment_of(from: &mut Source) -> Option<Increment> {
    let duration_s = from.number()?;
    let (velocity, position) = (from.three()?, from.three()?);
    Some(Increment {
        duration_s,
        velocity,
        position,
        rotation: from.matrix()?,
        rotation_gyro: from.matrix()?,
        velocity_gyro: from.matrix()?,
        velocity_accel: from.matrix()?,
        position_gyro: from.matrix()?,
        position_accel: from.matrix()?,
        covariance: {
            let all = from.array::<81>()?;
            std::array::from_fn(|r| std::array::from_fn(|c| all[9 * r + c]))
        },
    })
}

impl LinkState {
    /// All numbers.
    pub fn to_flat(&self) -> Vec<f64> {
        let LinkState { state, present, waiting, taken_s, spread_s, alone, checks, off_axis, .. } = self;
        let mut to = Writer(vec![*taken_s, *spread_s, self.moved_s]);
        to.count(number_of(self.fixing));
        to.count(self.rivals.len());
        for Rival { fixing, state, log_likelihood } in &self.rivals {
            to.count(number_of(*fixing));
            to.0.push(*log_likelihood);
            put_state(&mut to, state);
        }
        to.list(&present.iter().map(|p| f64::from(u8::from(*p))).collect::<Vec<_>>());
        put_state(&mut to, state);
        to.count(alone.len());
        alone.iter().for_each(|state| put_state(&mut to, state));
        to.count(checks.len());
        for check in checks {
            let Check { tilt, turned, worth, is_contradicted, contradicted_s, worst_rad } = check;
            to.0.extend(tilt.iter().chain(&turned.0));
            to.0.extend([*worth, f64::from(u8::from(*is_contradicted)), *contradicted_s, *worst_rad]);
        }
        to.list(&off_axis.concat());
        to.count(waiting.len());
        for w in waiting {
            let Sample { time_s, z, inputs, offset_s } = &w.sample;
            to.0.push(*time_s);
            [z, inputs, offset_s].into_iter().for_each(|v| to.list(v));
            let number = |v: &Verdict| VERDICTS.iter().position(|known| known == v).unwrap_or(0) as f64;
            to.list(&w.parts.iter().map(number).collect::<Vec<_>>());
        }
        to.0
    }

    /// Reads the result of `to_flat`; `None` if it is none.
    pub fn from_flat(flat: &[f64]) -> Option<Self> {
        let mut from = Source(flat.iter());
        let [taken_s, spread_s, moved_s] = from.array()?;
        let fixing = fixing_of(&mut from)?;
        let rivals = from.many(|from| {
            let (fixing, log_likelihood) = (fixing_of(from)?, from.number()?);
            Some(Rival { fixing, log_likelihood, state: state_of(from)? })
        })?;
        let present = from.list()?.iter().map(|p| *p != 0.0).collect();
        let state = state_of(&mut from)?;
        let alone = from.many(state_of)?;
        let checks = from.many(|from| {
            let [tilt, band, x, y, z, worth, now, contradicted_s, worst_rad] = from.array()?;
            let turned = Vec3([x, y, z]);
            Some(Check { tilt: [tilt, band], turned, worth, is_contradicted: now != 0.0, contradicted_s, worst_rad })
        })?;
        let off_axis = from.list()?.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect();
        let waiting = from.many(|from| {
            let sample =
                Sample { time_s: from.number()?, z: from.list()?, inputs: from.list()?, offset_s: from.list()? };
            let parts = from.list()?.iter().map(|v| VERDICTS.get(*v as usize).copied()).collect::<Option<_>>()?;
            Some(Waiting { sample, parts })
        })?;
        let is_whole = from.0.next().is_none();
        let waiting = waiting.into();
        is_whole.then_some(LinkState {
            state,
            present,
            waiting,
            taken_s,
            spread_s,
            alone,
            checks,
            off_axis,
            fixing,
            rivals,
            moved_s,
        })
    }
}
