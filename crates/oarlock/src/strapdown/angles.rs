//! Joint coordinates of strapdown links, their rates and covariance, in the layout of the model's states. `track` reports them.

use super::covariance::{Rows, UNIT};
use super::filter::{dot, Means, StrapdownFilter};
use super::increment::{skew, square, sum, Signal, ZERO};
use super::joint::Turns;
use super::sensors::Measures;
use super::skeleton::{End, Link, Pose};
use crate::body::Body;
use crate::kernels::dense::{accumulate, Square};
use crate::rotation::turn::Turn;
use crate::rotation::{Mat3, Vec3};

/// Interval between encoder readings that the uncertainty of their rates assumes, s.
const INPUT_STEP_S: f64 = 0.01;
/// Acceleration of what only encoders measure while they are silent, rad/s2 or m/s2.
const UNREAD_PER_S2: f64 = 30.0;
/// Half of the interval for the derivative of a link's rotation by its coordinates, s.
const RATE_STEP_S: f64 = 0.001;

/// What a limb turns that nothing measures, rad/s and rad/s2.
const LIMB_RAD_S: f64 = 5.0;
const LIMB_RAD_S2: f64 = 60.0;

/// Derivatives of one coordinate's value by the errors.
type Row = Vec<(usize, f64)>;

/// Coordinates at one instant.
#[derive(Debug, Clone)]
pub struct Coordinates {
    /// In the layout of the body's states.
    pub mean: Vec<f64>,
    /// Of every link whose hinges lock a direction, in order: its turn off their axes, a rotation vector in the axes of its frame, rad.
    pub off_axis: Vec<[f64; 3]>,
    /// Per state of the layout: derivatives by the filter's errors.
    rows: Vec<Row>,
    /// Variances that no error explains: noise of rates, mounts.
    own: Square,
}

impl Coordinates {
    /// Coordinates of these means; `signals` of the units at the same time; `near`: earlier coordinates, from which hinges continue, and which
    /// states that strapdown links do not have keep; `unknown`: standard deviations of these.
    pub fn of(
        filter: &StrapdownFilter,
        body: &Body,
        means: &Means,
        signals: &[Signal],
        (near, unknown): (&[f64], &[f64]),
    ) -> Self {
        let n = body.layout.dim();
        let mut all =
            Coordinates { mean: near.to_vec(), off_axis: Vec::new(), rows: vec![Vec::new(); n], own: Square::zeros(n) };
        unknown.iter().enumerate().for_each(|(i, std)| *all.own.at_mut(i, i) = std * std);
        let motions = Motions::of(filter, means, signals);
        for k in 0..filter.skeleton.pushes.len() {
            if let Some(slot) = body.layout.pushes.iter().find(|slot| slot.number == k) {
                all.set(slot.state, means.pushes[k], vec![(filter.push_state(k), 1.0)], 0.0);
            }
        }
        for l in 0..filter.skeleton.links.len() {
            all.place_joint(filter, body, means, &motions, l);
        }
        (0..filter.skeleton.links.len()).for_each(|l| all.split(filter, body, means, l));
        if let (Some(slot), Some(i)) = (body.layout.azimuth, filter.azimuth_state()) {
            all.set(slot, means.azimuth, vec![(i, 1.0)], 0.0);
        }
        for (u, unit) in filter.skeleton.units.iter().enumerate() {
            for slot in body.layout.errors.iter().filter(|slot| slot.sensor == unit.sensor) {
                let mean = &means.units[u];
                let (first, value) = match slot.error.name {
                    "gyro_bias" => (UNIT * u + 9, mean.gyro_bias),
                    "accel_bias" => (UNIT * u + 12, mean.accel_bias),
                    _ => continue,
                };
                for q in 0..3 {
                    all.set(slot.first + q, value.0[q], vec![(first + q, 1.0)], 0.0);
                }
            }
        }
        all
    }

    fn set(&mut self, state: usize, value: f64, row: Row, variance: f64) {
        self.mean[state] = value;
        self.rows[state] = row;
        *self.own.at_mut(state, state) = variance;
    }

    fn place_joint(&mut self, filter: &StrapdownFilter, body: &Body, means: &Means, motions: &Motions, l: usize) {
        let link = &filter.skeleton.links[l];
        let slots = link.turns.coordinates().map(|c| c.and_then(|c| body.layout.coordinates[c]));
        if link.pose == Pose::Driven {
            return self.place_driven(filter, body, means, l);
        }
        let (relative, child) = filter.relative(means, l);
        let guess = slots.map(|s| s.map_or(0.0, |s| self.mean[s.q]));
        let angles = link.turns.angles(&relative, guess);
        if link.turns.locked() > 0 {
            self.off_axis.push(link.frame_axes.apply_transposed(angles.off_axis).0);
        }
        let mut turn = Rows::default();
        filter.push_turn(&mut turn, means, l, &child.transposed());
        filter.push_link(&mut turn, means, link.parent, &sum(&ZERO, &child.transposed(), -1.0));
        let along = |direction: [f64; 3], rows: &Rows| -> Row {
            let of = |h: &[f64; 3]| direction[0] * h[0] + direction[1] * h[1] + direction[2] * h[2];
            rows.states.iter().zip(&rows.slopes).map(|(i, h)| (*i, of(h))).collect()
        };
        let mount = mount_variance(filter, l, &relative);
        let own = motions.links[l];
        let parent = link.parent.map(|p| (motions.links[p], p));
        let carried = |v: Vec3<f64>| relative.apply_transposed(v);
        let spin = parent.map_or(Vec3([0.0; 3]), |(p, _)| carried(p.rate));
        let rate = own.rate - spin;
        let push = parent.map_or(Vec3([0.0; 3]), |(p, _)| carried(p.slope));
        let slope = own.slope - push + rate.cross(spin);
        let mut biases = Rows::default();
        push_bias(&mut biases, filter, means, (l, -1.0), &child);
        if let Some((_, p)) = parent {
            push_bias(&mut biases, filter, means, (p, 1.0), &child);
        }
        // R' w of the parent changes with the relative rotation.
        let turned = skew(spin);
        let rates = [0, 1, 2].map(|k| dot(Vec3(angles.by_turn.0[k]), rate));
        let turning = slope - link.turns.coupling(angles.q, rates);
        for (k, slots) in slots.iter().enumerate().take(angles.count) {
            let Some(slots) = slots else { continue };
            let d = angles.by_turn.0[k];
            self.set(slots.q, angles.q[k], along(d, &turn), 0.0);
            let Some((velocity, acceleration)) = slots.rates else { continue };
            let scale = d.iter().map(|x| x * x).sum::<f64>();
            let noise = own.noise + parent.map_or(0.0, |(p, _)| p.noise);
            let by_turn = turned.apply_transposed(Vec3(d)).0.map(|x| -x);
            let row = along(d, &biases).into_iter().chain(along(by_turn, &turn)).collect();
            self.set(velocity, rates[k], row, scale * noise);
            let uneven = own.slope_noise + parent.map_or(0.0, |(p, _)| p.slope_noise);
            self.set(acceleration, dot(Vec3(d), turning), Vec::new(), scale * uneven);
        }
        for (i, a) in slots.iter().enumerate().take(angles.count) {
            for (j, b) in slots.iter().enumerate().take(angles.count) {
                let (Some(a), Some(b)) = (a, b) else { continue };
                let (x, y) = (Vec3(angles.by_turn.0[i]), Vec3(angles.by_turn.0[j]));
                *self.own.at_mut(a.q, b.q) += x.0.iter().zip(mount.apply(y).0).map(|(x, m)| x * m).sum::<f64>();
            }
        }
        if let Turns::Free(first, entry) = &link.turns {
            self.place_position(filter, body, (means, motions), l, (*first, entry));
        }
    }

    /// Coordinates that only encoders measure.
    fn place_driven(&mut self, filter: &StrapdownFilter, body: &Body, means: &Means, l: usize) {
        let slide = match filter.skeleton.links[l].turns {
            Turns::Slide(c, ..) => Some(c),
            _ => None,
        };
        let turns = filter.skeleton.links[l].turns.coordinates().into_iter().flatten();
        for c in slide.into_iter().chain(turns) {
            let Some(slots) = body.layout.coordinates[c] else { continue };
            if let Some(number) = filter.skeleton.slide(c) {
                let (first, [place, speed]) = (filter.slide_state(number), means.slides[number]);
                self.set(slots.q, place, vec![(first, 1.0)], 0.0);
                slots.rates.iter().for_each(|(rate, _)| self.set(*rate, speed, vec![(first + 1, 1.0)], 0.0));
                continue;
            }
            let mut sensors = filter.skeleton.sensors.iter();
            let sensor = sensors.find(|s| matches!(s.measures, Measures::Input(own) if own == c));
            let Some(std) = sensor.map(|sensor| sensor.std) else { continue };
            let [value, rate] = means.inputs[c];
            let silence_s = filter.silences[c];
            let moved = (0.5 * UNREAD_PER_S2 * silence_s * silence_s).min(body.axes[c].prior_std());
            self.set(slots.q, value, Vec::new(), std * std + moved * moved);
            if let Some((velocity, _)) = slots.rates {
                let noise = 2.0 * (std / INPUT_STEP_S).powi(2) + (UNREAD_PER_S2 * silence_s.min(1.0)).powi(2);
                self.set(velocity, rate, Vec::new(), noise);
            }
        }
    }

    /// How two stiff joints share a turn is known from their ranges only: what one has too much the other lacks.
    fn split(&mut self, filter: &StrapdownFilter, body: &Body, means: &Means, l: usize) {
        let skeleton = &filter.skeleton;
        let Pose::Between(child, share) = skeleton.links[l].pose else { return };
        let variance = share * skeleton.links[child].range_rad[0].powi(2);
        let joint = |l: usize, coordinates: &[f64]| {
            let turns = &skeleton.links[l].turns;
            let slots = turns.coordinates().map(|c| c.and_then(|c| body.layout.coordinates[c]).map(|s| s.q));
            let (relative, _) = filter.relative(means, l);
            let near = slots.map(|s| s.map_or(0.0, |s| coordinates[s]));
            (slots, turns.angles(&relative, near).by_turn, relative)
        };
        let (own, own_by, _) = joint(l, &self.mean);
        let (other, other_by, relative) = joint(child, &self.mean);
        for i in 0..3 {
            for j in 0..3 {
                let (a, b) = (Vec3(own_by.0[i]), Vec3(own_by.0[j]));
                let (x, y) = (Vec3(other_by.0[i]), Vec3(other_by.0[j]));
                let mut add = |r: Option<usize>, c: Option<usize>, value: f64| {
                    if let (Some(r), Some(c)) = (r, c) {
                        *self.own.at_mut(r, c) += variance * value;
                    }
                };
                add(own[i], own[j], dot(a, b));
                add(other[i], other[j], dot(x, y));
                let across = -dot(a, relative.apply(y));
                add(own[i], other[j], across);
                add(other[j], own[i], across);
            }
        }
    }

    /// Position, velocity and acceleration of a free link's origin.
    fn place_position(
        &mut self,
        filter: &StrapdownFilter,
        body: &Body,
        (means, motions): (&Means, &Motions),
        l: usize,
        (first, entry): (usize, &Mat3<f64>),
    ) {
        let link = &filter.skeleton.links[l];
        let back = entry.transposed();
        let mut rows = Rows::default();
        let (end, through) = filter.skeleton.way(l, Vec3([0.0; 3]));
        let End::Unit(u, point) = end else { return };
        let mean = &means.units[u];
        let mut arm = filter.bone_of(means, u).apply(point);
        filter.push_skin(&mut rows, means, u, &sum(&ZERO, &back.times(&skew(arm)), -1.0));
        // p + R r: its error is xp + f x (p + R r).
        rows.push(UNIT * u, &sum(&ZERO, &back.times(&skew(mean.position + arm)), -1.0));
        rows.push(UNIT * u + 6, &back);
        for leg in through {
            arm += filter.push_leg(&mut rows, means, &leg, &back);
        }
        let place = back.apply(mean.position + arm - link.arm);
        let spin = mean.rotation.apply(motions.units[u].rate);
        let spinning = mean.rotation.apply(motions.units[u].slope);
        let velocity = back.apply(mean.velocity + spin.cross(arm));
        let push = motions.units[u].acceleration + spinning.cross(arm) + spin.cross(spin.cross(arm));
        let acceleration = back.apply(push);
        for q in 0..3 {
            let Some(slots) = body.layout.coordinates[first + q] else { continue };
            let row = rows.states.iter().zip(&rows.slopes).map(|(i, h)| (*i, h[q])).collect();
            self.set(slots.q, place.0[q], row, 0.0);
            let Some((rate, change)) = slots.rates else { continue };
            let speed = (0..3).map(|k| (UNIT * u + 3 + k, back.0[q][k]));
            let turning = skew(mean.velocity);
            let by_turn = (0..3).map(|k| (UNIT * u + k, -(0..3).map(|j| back.0[q][j] * turning.0[j][k]).sum::<f64>()));
            let noise = motions.units[u].noise * square(arm);
            self.set(rate, velocity.0[q], speed.chain(by_turn).collect(), noise);
            let unit = &motions.units[u];
            self.set(change, acceleration.0[q], Vec::new(), unit.acceleration_noise + unit.slope_noise * square(arm));
        }
    }

    /// Covariance of all states of the layout.
    pub fn covariance(&self, errors: &Square) -> Square {
        let (n, mut out) = (self.rows.len(), self.own.clone());
        let mut moved = vec![0.0; errors.n()];
        for i in (0..n).filter(|i| !self.rows[*i].is_empty()) {
            moved.fill(0.0);
            accumulate(&mut moved, self.rows[i].iter().map(|(state, h)| (*h, errors.row(*state))));
            for j in i..n {
                let value: f64 = self.rows[j].iter().map(|(state, h)| h * moved[*state]).sum();
                *out.at_mut(i, j) += value;
            }
        }
        for i in 0..n {
            let variance = out.at_mut(i, i);
            // No `max`: what is no number must stay so.
            if *variance < LEAST_STD * LEAST_STD {
                *variance = LEAST_STD * LEAST_STD;
            }
        }
        out.mirror_upper();
        out
    }
}

/// Derivatives of a link's angular velocity in a child's axes by the bias of its unit's gyroscope.
fn push_bias(rows: &mut Rows, filter: &StrapdownFilter, means: &Means, (link, sign): (usize, f64), child: &Mat3<f64>) {
    match (filter.skeleton.links[link].pose, filter.skeleton.links[link].parent) {
        (Pose::Unit(u), _) => {
            rows.push(UNIT * u + 9, &sum(&ZERO, &child.transposed().times(&means.units[u].rotation), sign));
        }
        (Pose::State(_, Some(anchor)), _) => push_bias(rows, filter, means, (anchor, sign), child),
        (Pose::Between(other, share), Some(parent)) => {
            push_bias(rows, filter, means, (parent, sign * (1.0 - share)), child);
            push_bias(rows, filter, means, (other, sign * share), child);
        }
        (Pose::Between(..), None) | (Pose::State(_, None) | Pose::Driven, _) => {}
    }
}

/// Variance of the relative rotation by mounts and soft tissue of both units where these are no states, in the child's axes.
fn mount_variance(filter: &StrapdownFilter, l: usize, relative: &Mat3<f64>) -> Mat3<f64> {
    let of = |link: usize| match filter.skeleton.links[link].pose {
        Pose::Unit(u) => {
            let (unit, links) = (&filter.skeleton.units[u], &filter.links);
            let soft = if links.skin_std_rad.is_none() { unit.soft_std_rad } else { 0.0 };
            let mount = if links.mount_std_rad.is_none() { unit.mount_std_rad } else { [0.0; 3] };
            mount.map(|std| std * std + soft * soft)
        }
        Pose::State(..) | Pose::Between(..) | Pose::Driven => [0.0; 3],
    };
    let mut out = ZERO;
    let own = of(l);
    (0..3).for_each(|k| out.0[k][k] = own[k]);
    if let Some(parent) = filter.skeleton.links[l].parent {
        let theirs = of(parent);
        let scaled = Mat3(std::array::from_fn(|i| std::array::from_fn(|j| relative.0[i][j] * theirs[i])));
        out = sum(&out, &relative.transposed().times(&scaled), 1.0);
    }
    out
}

/// Motion of a unit or link in its own axes.
#[derive(Debug, Clone, Copy)]
struct Motion {
    /// rad/s and rad/s2.
    rate: Vec3<f64>,
    slope: Vec3<f64>,
    /// Coordinate acceleration in the room's axes, m/s2.
    acceleration: Vec3<f64>,
    /// Variances of rate and slope by the gyroscope's noise, and of the acceleration by the accelerometer's.
    noise: f64,
    slope_noise: f64,
    acceleration_noise: f64,
}

/// Angular velocity of a link that only encoders measure against its parent, in its own axes, rad/s.
fn driven_rate(link: &Link, means: &Means) -> Vec3<f64> {
    let at = |after_s: f64| {
        let q = link.turns.coordinates().map(|c| c.map_or(0.0, |c| means.inputs[c][0] + after_s * means.inputs[c][1]));
        link.turns.rotation(q)
    };
    let turn = at(-RATE_STEP_S).transposed().times(&at(RATE_STEP_S));
    Vec3(Turn::of(&turn).log()) * (0.5 / RATE_STEP_S)
}

struct Motions {
    units: Vec<Motion>,
    links: Vec<Motion>,
}

impl Motions {
    fn of(filter: &StrapdownFilter, means: &Means, signals: &[Signal]) -> Self {
        let up = filter.skeleton.up * filter.skeleton.gravity_m_s2;
        let units: Vec<Motion> =
            (0..signals.len()).map(|u| unit_motion(filter, u, &means.units[u], &signals[u], up)).collect();
        let mut links: Vec<Option<Motion>> = vec![None; filter.skeleton.links.len()];
        for (u, (unit, motion)) in filter.skeleton.units.iter().zip(&units).enumerate() {
            let mount = unit.mount.times_transposed(&filter.skin_of(means, u));
            let (rate, slope) = (mount.apply(motion.rate), mount.apply(motion.slope));
            links[unit.link] = Some(Motion { rate, slope, ..*motion });
        }
        for (number, l) in filter.skeleton.loose.iter().enumerate() {
            let Pose::State(_, Some(anchor)) = filter.skeleton.links[*l].pose else { continue };
            // Between readings a link without a unit moves with its neighbour.
            links[*l] = links[anchor].map(|m| Motion {
                rate: means.loose[number].apply_transposed(m.rate),
                slope: means.loose[number].apply_transposed(m.slope),
                ..m
            });
        }
        for (l, link) in filter.skeleton.links.iter().enumerate() {
            let (Pose::Between(child, share), Some(parent)) = (link.pose, link.parent) else { continue };
            let (Some(a), Some(b)) = (links[parent], links[child]) else { continue };
            let own = filter.orientation(means, l).transposed();
            let [from, to] = [parent, child].map(|l| own.times(&filter.orientation(means, l)));
            let mix = |x: Vec3<f64>, y: Vec3<f64>| from.apply(x) * (1.0 - share) + to.apply(y) * share;
            links[l] = Some(Motion { rate: mix(a.rate, b.rate), slope: mix(a.slope, b.slope), ..a });
        }
        let still = Motion {
            rate: Vec3([0.0; 3]),
            slope: Vec3([0.0; 3]),
            acceleration: Vec3([0.0; 3]),
            noise: 0.0,
            slope_noise: 0.0,
            acceleration_noise: 0.0,
        };
        for (l, link) in filter.skeleton.links.iter().enumerate().filter(|(_, link)| link.pose == Pose::Driven) {
            let carried = link.parent.and_then(|p| links[p]).unwrap_or(still);
            let back = filter.relative(means, l).0.transposed();
            let (rate, slope) = (back.apply(carried.rate) + driven_rate(link, means), back.apply(carried.slope));
            links[l] = Some(Motion { rate, slope, ..carried });
        }
        Motions { units, links: links.into_iter().map(|m| m.unwrap_or(still)).collect() }
    }
}

/// No coordinate is better known, rad or m: that of links which move as one is a difference of equal numbers.
const LEAST_STD: f64 = 1e-6;
/// Longest time between readings whose difference is a slope, s.
const LONGEST_SPAN_S: f64 = 3.0;

fn unit_motion(
    filter: &StrapdownFilter,
    u: usize,
    mean: &super::filter::UnitState,
    signal: &Signal,
    up: Vec3<f64>,
) -> Motion {
    let rate_hz = signal.rate_hz;
    let links = &filter.links_of(u, rate_hz.max(1.0));
    let rate = signal.gyro - mean.gyro_bias;
    let white = links.gyro_density.powi(2) * rate_hz;
    // Readings minutes apart tell nothing of what is between them.
    let is_near = signal.span_s > 0.0 && signal.span_s < LONGEST_SPAN_S;
    let per_slope = if is_near { 2.0 / (signal.span_s * signal.span_s) } else { f64::INFINITY };
    let change = links.gyro_step_share.powi(2) * square(signal.gyro_slope);
    let unread = (LIMB_RAD_S2 * signal.silence_s).min(LIMB_RAD_S);
    let unread_slope = if signal.silence_s > 0.0 { LIMB_RAD_S2 } else { 0.0 };
    Motion {
        rate,
        slope: signal.gyro_slope,
        acceleration: mean.rotation.apply(signal.accel - mean.accel_bias) - up,
        noise: white + links.gyro_scale.powi(2) * square(rate) + unread * unread,
        slope_noise: unread_slope.powi(2) + if per_slope.is_finite() { white * per_slope + change } else { 1e4 },
        acceleration_noise: links.accel_density.powi(2) * rate_hz,
    }
}
