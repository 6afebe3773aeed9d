//! The filter of strapdown links: prediction by each unit's own readings, and readings of joints, bounds, rest and contact.

use super::covariance::{block, predict, Correction, Rows, Step, UNIT};
use super::increment::{square, sum, Increment, Jump, Reading, Readings, ZERO};
use super::sensors::{Heard, Measures, Sensor};
use super::skeleton::{Closure, End, Pose, Skeleton, Unit};
use super::skin::small_turn;
use super::start::{fresh_block, put_block};
use crate::estimate::filter::Verdict;
use crate::kernels::arch::Arch;
use crate::kernels::dense::Square;
use crate::model::Links;
use crate::rotation::turn::Turn;
use crate::rotation::{Mat3, Vec3};

/// Interval between readings of joints, s. They lose nothing at it; an encoder of a link without a unit does, because nothing else tells how the
/// link moves in between.
const UPDATE_S: f64 = 0.02;
const UPDATE_ENCODER_S: f64 = 0.008;
/// And where loops of the model hold the links.
const UPDATE_LOOP_S: f64 = 0.03;
/// A unit without readings for longer is silent, s: it goes with its neighbour, and its joints are read only where loops of the model hold it too.
/// What its orientation is worth when it speaks again, rad. If all are silent, and for so many of their intervals, the body starts anew.
const SILENT_S: f64 = 0.3;
const SILENT_INTERVALS: f64 = 3.0;
pub const SILENT_RAD: f64 = 1.0;
/// Above this standard deviation of a unit's turn, rad, an update is read again from where it led, at most so often, until it turns no unit by
/// more than this, rad.
const NONLINEAR_RAD: f64 = 0.3;
const MOST_AGAIN: usize = 5;
const NEAR_RAD: f64 = 0.02;
/// Longest prediction without a reading of joints, s.
const LONGEST_S: f64 = 0.1;
/// Nor one of minutes without any reading, s: that is one prediction, because there would be millions.
const BLIND_S: f64 = 60.0;
/// Joint state of a link without a unit: random walk, rad per sqrt(s), and correlation time of the spring to its rest, s. Where loops hold the
/// links they tell its turns from each other, and for how long a posture stays away from rest counts: mounts and lengths would take that up.
pub const LOOSE_WALK: f64 = 2.0;
pub const SPRING_TIME_S: f64 = 0.1;
pub const SPRING_LOOP_TIME_S: f64 = 2.0;
/// Updates from one reading of limits to the next.
const LIMITS_EVERY: u32 = 10;

/// Mean of a unit's states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnitState {
    /// Room from unit.
    pub rotation: Mat3<f64>,
    /// m/s, and m.
    pub velocity: Vec3<f64>,
    pub position: Vec3<f64>,
    /// Biases of gyroscope, rad/s, and accelerometer, m/s2.
    pub gyro_bias: Vec3<f64>,
    pub accel_bias: Vec3<f64>,
}

/// Means of all states.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Means {
    pub units: Vec<UnitState>,
    /// Of links without a unit: rotation, neighbour from link.
    pub loose: Vec<Mat3<f64>>,
    /// Errors of the joints' points, m, in the axes of each unit; then turns of their axes, rad, in those of each
    /// link; then of mounts and skins, rad, in those of each unit.
    pub constants: Vec<Vec3<f64>>,
    /// Of the magnetic field, rad from `forward`; the last state, if units have magnetometers.
    pub azimuth: f64,
    /// Accelerations of the room, m/s2.
    pub pushes: Vec<f64>,
    /// Turn of the room, rad: rotation vector.
    pub room: Vec3<f64>,
    /// Of the skeleton's lengths, in standard deviations from their values.
    pub lengths: Vec<f64>,
    /// Of slides that no encoder reads: position, m, and speed, m/s.
    pub slides: Vec<[f64; 2]>,
    /// By coordinate of the model: what only encoders measure, rad or m, and its rate. No state.
    pub inputs: Vec<[f64; 2]>,
}

/// Everything that the filter knows at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Time of means and covariance, s.
    pub time_s: f64,
    pub means: Means,
    pub covariance: Square,
    /// Of every unit.
    pub readings: Vec<Readings>,
    /// Of every other sensor.
    pub heard: Vec<Heard>,
    /// Since `time_s`, up to `row_s`.
    pub increments: Vec<Increment>,
    pub row_s: f64,
    /// Number of updates.
    pub updates: u32,
}

/// What one update did; the smoother needs it.
#[derive(Debug, Clone)]
pub struct Node {
    /// Before the prediction.
    pub before: Means,
    pub before_s: f64,
    pub covariance: Square,
    pub steps: Vec<Step>,
    /// What each unit read meanwhile.
    pub increments: Vec<Increment>,
    /// After it.
    pub predicted: Means,
    pub predicted_covariance: Square,
}

/// The filter of one body.
#[derive(Debug, Clone)]
pub struct StrapdownFilter {
    pub skeleton: Skeleton,
    pub links: Links,
    /// First state of each point of a joint: of the end `from` and the end `to` of every closure; `None`: a point of the room.
    pub points: Vec<[Option<usize>; 2]>,
    /// First state of the turn of a joint's axes, against the link that carries it and the link that it carries, by link; `None`: they have none.
    pub axes: Vec<[Option<usize>; 2]>,
    /// First states of the constant turn of a unit's mount, and of its skin, by unit.
    pub turned: Vec<[Option<usize>; 2]>,
    /// Number of states.
    pub size: usize,
    /// Least interval between updates, s.
    update_s: f64,
    /// Whether closures are read.
    pub closures: bool,
    /// The only closure that is read, while headings are sought.
    pub only: Option<usize>,
    pub contacts: bool,
    /// Whether norm and dip decide if a magnetic field is used.
    pub tests_fields: bool,
    pub gravity: Vec3<f64>,
    pub correction: Correction,
    pub rows: Rows,
    arch: Arch,
    /// Of the last update: normalised innovation squared of each closure.
    pub closure_nis: Vec<f64>,
    /// Of a unit alone: whether the body that it belongs to moves.
    pub belongs_to_moving: bool,
    /// Of the last update, by unit.
    pub rests: Vec<bool>,
    pub stands: Vec<bool>,
    /// Of the last prediction, by unit: whether it is silent.
    pub silent: Vec<bool>,
    /// Of the last update, by unit: what became of its field.
    pub fields: Vec<Verdict>,
    /// By unit: whether its joints are let go, because it contradicts itself alone.
    pub let_go: Vec<bool>,
    /// Of the last update, by coordinate: for how long the only encoders that measure it have been silent, s.
    pub silences: Vec<f64>,
    /// Of the last update, by unit: by what it was turned, rad in the room's axes; then by link without a unit, in the axes of its anchor.
    pub moved_by: Vec<Vec3<f64>>,
}

impl StrapdownFilter {
    pub fn new(skeleton: Skeleton, links: Links, (closures, contacts): (bool, bool)) -> Self {
        let units = skeleton.units.len();
        let links = Self::with_room(&links, closures);
        let mut size = UNIT * units + 3 * skeleton.loose.len();
        let mut place = |is_there: bool| {
            size += if is_there { 3 } else { 0 };
            is_there.then(|| size - 3)
        };
        let ends = skeleton.closures.iter().map(|c| (c.loop_std_m.is_none(), [&c.from, &c.to]));
        let points = ends.map(|(is_joint, ends)| ends.map(|end| place(is_joint && end.unit().is_some()))).collect();
        let turns = |l: usize| closures && links.axis_std_rad.is_some() && skeleton.is_hinged(l);
        let axes = (0..skeleton.links.len()).map(|l| [turns(l); 2].map(&mut place)).collect();
        let stds = |unit: &Unit| [links.mount_std_rad, links.skin_std_rad.filter(|_| !unit.rigid)];
        let turning = skeleton.units.iter().take(if closures { units } else { 0 });
        let turned = turning.map(|unit| stds(unit).map(|std| place(std.is_some()))).collect();
        size += if links.room_std_rad.is_some() { 3 } else { 0 };
        size += 2 * skeleton.slides.len()
            + skeleton.lengths.len()
            + skeleton.pushes.len()
            + usize::from(skeleton.has_fields());
        let is_alone = |sensor: &Sensor| matches!(sensor.measures, Measures::Angle(l, _) if matches!(skeleton.links[l].pose, Pose::State(..)));
        let update_s = match skeleton.is_held() {
            _ if skeleton.sensors.iter().any(is_alone) => UPDATE_ENCODER_S,
            true => UPDATE_LOOP_S,
            false => UPDATE_S,
        };
        StrapdownFilter {
            update_s,
            gravity: skeleton.up * -skeleton.gravity_m_s2,
            correction: Correction::new(size),
            rows: Rows::default(),
            arch: Arch::best(),
            closure_nis: vec![f64::NAN; skeleton.closures.len()],
            belongs_to_moving: false,
            rests: vec![false; units],
            stands: vec![false; units],
            silent: vec![false; units],
            fields: vec![Verdict::Missing; units],
            let_go: vec![false; units],
            silences: vec![0.0; skeleton.rest.len()],
            turned,
            moved_by: vec![Vec3([0.0; 3]); units + skeleton.loose.len()],
            skeleton,
            links,
            points,
            axes,
            size,
            closures,
            only: None,
            tests_fields: true,
            contacts,
        }
    }

    /// Without closures nothing is in the room.
    fn with_room(links: &Links, closures: bool) -> Links {
        Links { room_std_rad: links.room_std_rad.filter(|_| closures), ..*links }
    }

    /// Statements for this filter.
    pub fn stated(&self, links: &Links) -> Links {
        Self::with_room(links, self.closures)
    }

    /// Links whose hinges lock a direction, but for those that encoders alone place.
    pub fn locked(&self) -> impl Iterator<Item = &super::skeleton::Link> {
        self.skeleton.links.iter().filter(|link| link.turns.locked() > 0 && link.pose != Pose::Driven)
    }

    /// First state of a link without a unit.
    pub fn loose_state(&self, number: usize) -> usize {
        UNIT * self.skeleton.units.len() + 3 * number
    }

    /// First states of all constants, in order.
    pub fn constants(&self) -> impl Iterator<Item = usize> + '_ {
        self.points.iter().chain(&self.axes).chain(&self.turned).flatten().flatten().copied()
    }

    /// Whether the body may go anywhere: it touches the ground, or something measures where it is.
    pub fn travels(&self) -> bool {
        let is_place = |sensor: &Sensor| matches!(sensor.measures, Measures::Point(..));
        let touches = self.contacts && self.skeleton.units.iter().any(|u| u.contact.is_some());
        touches || self.skeleton.sensors.iter().any(is_place)
    }

    /// Orientation of a link, room from link.
    pub fn orientation(&self, means: &Means, link: usize) -> Mat3<f64> {
        match self.skeleton.links[link].pose {
            Pose::Unit(u) => self.bone_of(means, u).times_transposed(&self.skeleton.units[u].mount),
            Pose::Driven => {
                let link = &self.skeleton.links[link];
                let turn = link.turns.rotation(link.turns.coordinates().map(|c| c.map_or(0.0, |c| means.inputs[c][0])));
                self.orientation_of(means, link.parent).times(&turn)
            }
            Pose::State(number, anchor) => self.orientation_of(means, anchor).times(&means.loose[number]),
            Pose::Between(child, share) => {
                let [first, turn] = self.between(means, link, child);
                first.times(&Mat3::about(Vec3(Turn::of(&turn).log()) * share))
            }
        }
    }

    /// The same; or of the room.
    pub fn orientation_of(&self, means: &Means, link: Option<usize>) -> Mat3<f64> {
        match (link, self.room_state()) {
            (Some(l), _) => self.orientation(means, l),
            (None, Some(_)) => Mat3::about(means.room),
            (None, None) => Mat3::identity(),
        }
    }

    /// A link that lies between its parent and a child: as the parent carries it at rest, and the turn from there to how the child does.
    fn between(&self, means: &Means, link: usize, child: usize) -> [Mat3<f64>; 2] {
        let parent = self.orientation_of(means, self.skeleton.links[link].parent);
        let first = parent.times(&self.skeleton.links[link].rest);
        let second = self.orientation(means, child).times_transposed(&self.skeleton.links[child].rest);
        [first, first.transposed().times(&second)]
    }

    /// A closure as the lengths that are estimated put it.
    pub(super) fn stretched(&self, means: &Means, c: usize) -> Closure {
        let own = &self.skeleton.closures[c];
        let mut closure = Closure { through: own.through.clone(), lengths: Vec::new(), ..*own };
        for by in &own.lengths {
            let by_how_much = means.lengths[by.number];
            for (end, change) in [&mut closure.from, &mut closure.to].into_iter().zip(by.ends) {
                *end.point_mut() += change * by_how_much;
            }
            for (leg, change) in closure.through.iter_mut().zip(&by.legs) {
                leg.vector += *change * by_how_much;
            }
        }
        closure
    }

    /// The same as `push_turn`; or of the room.
    pub(super) fn push_link(&self, rows: &mut Rows, means: &Means, link: Option<usize>, m: &Mat3<f64>) {
        match (link, self.room_state()) {
            (Some(l), _) => self.push_turn(rows, means, l, m),
            (None, Some(first)) => rows.push(first, &m.times(&small_turn(means.room))),
            (None, None) => {}
        }
    }

    /// Derivatives of a link's turn error, in the room's axes: of its unit, and of the joint states on the way, times `m`.
    pub fn push_turn(&self, rows: &mut Rows, means: &Means, link: usize, m: &Mat3<f64>) {
        match self.skeleton.links[link].pose {
            Pose::Unit(u) => {
                rows.push(UNIT * u, m);
                self.push_skin(rows, means, u, m);
            }
            Pose::Driven => self.push_link(rows, means, self.skeleton.links[link].parent, m),
            Pose::State(number, anchor) => {
                rows.push(self.loose_state(number), &m.times(&self.orientation_of(means, anchor)));
                self.push_link(rows, means, anchor, m);
            }
            Pose::Between(child, share) => {
                self.push_link(rows, means, self.skeleton.links[link].parent, &sum(&ZERO, m, 1.0 - share));
                self.push_turn(rows, means, child, &sum(&ZERO, m, share));
            }
        }
    }

    /// Adds a reading of a unit; see `Readings::take`.
    pub fn take(&self, state: &mut State, unit: usize, reading: Reading) -> (bool, Option<Jump>) {
        state.readings[unit].take(reading)
    }

    /// Time up to which every unit that still speaks has readings, s.
    pub fn complete_s(&self, state: &State, patience_s: f64) -> f64 {
        let newest = state.readings.iter().map(Readings::last_s).fold(f64::NEG_INFINITY, f64::max);
        let all = state.readings.iter().map(Readings::last_s).chain(state.heard.iter().map(Heard::last_s));
        let speaking = all.filter(|last| *last >= newest - patience_s);
        speaking.fold(newest, f64::min)
    }

    /// Longest time between two samples after which the body goes on, s; after a longer one it starts anew.
    pub fn longest_s(&self, state: &State) -> f64 {
        let usual = state.readings.iter().map(|r| r.parts().2).filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        // Loops lead to no number where nothing is read for longer: the posture is sought in each reading.
        if usual.is_finite() && !self.skeleton.is_held() {
            SILENT_S.max(SILENT_INTERVALS * usual).min(BLIND_S)
        } else {
            SILENT_S
        }
    }

    /// Time since anything was read, s. Where loops and encoders hold a body that means them, or half of its units: few of these alone tell nothing
    /// of the others.
    pub fn silence_s(&self, state: &State, time_s: f64) -> f64 {
        let mut units: Vec<f64> = state.readings.iter().map(|r| r.before_s(time_s)).collect();
        units.sort_unstable_by(|a, b| b.total_cmp(a));
        let enough = if self.skeleton.is_held() { units.len() / 2 } else { 0 };
        let is_field = |sensor: &Sensor| matches!(sensor.measures, Measures::Field(_));
        let others = self.skeleton.sensors.iter().zip(&state.heard).filter(|(sensor, _)| !is_field(sensor));
        let others = others.map(|(_, heard)| heard.before_s(time_s));
        time_s - others.chain(units.get(enough).copied()).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Moves to a later time; `node` receives each update.
    pub fn advance(&mut self, state: &mut State, to_s: f64, node: &mut dyn FnMut(Node), wants_nodes: bool) {
        while state.row_s < to_s {
            let reading_s = state.readings.iter().map(|r| r.next_s(state.row_s)).fold(f64::INFINITY, f64::min);
            let is_blind = reading_s.min(to_s) > state.row_s + BLIND_S;
            let next_s = to_s.min(if is_blind { reading_s } else { state.time_s + LONGEST_S }).max(state.row_s);
            self.extend(state, next_s);
            let since_s = state.row_s - state.time_s;
            if since_s >= self.update_s * (1.0 - 1e-6) {
                let before =
                    wants_nodes.then(|| (state.means.clone(), state.covariance.clone(), state.increments.clone()));
                let before_s = state.time_s;
                let steps = self.predict(state);
                if let Some((before, covariance, increments)) = before {
                    let (predicted, predicted_covariance) = (state.means.clone(), state.covariance.clone());
                    node(Node { before, before_s, covariance, steps, increments, predicted, predicted_covariance });
                }
                self.update(state, since_s);
            }
            if next_s >= to_s {
                break;
            }
        }
        state.readings.iter_mut().for_each(|r| r.forget(state.time_s));
        state.heard.iter_mut().for_each(|h| h.forget(state.time_s));
    }

    fn extend(&self, state: &mut State, to_s: f64) {
        let ends = (state.row_s, to_s);
        (0..state.increments.len()).for_each(|u| self.extend_unit(state, u, ends));
        state.row_s = to_s;
    }

    /// Extends the increment of a unit from one time to another, s.
    pub(super) fn extend_unit(&self, state: &mut State, u: usize, ends_s: (f64, f64)) {
        let mean = &state.means.units[u];
        let lift = mean.rotation.apply_transposed(self.gravity * -1.0);
        let biases = [mean.gyro_bias, mean.accel_bias];
        let links = self.links_of(u, state.readings[u].rate_hz());
        state.readings[u].integrate(&mut state.increments[u], ends_s, biases, lift, &links);
    }

    /// The statements for one unit at the rate of its readings: its sensor's own noise may be larger than that of usual units.
    pub fn links_of(&self, u: usize, rate_hz: f64) -> Links {
        let [gyro, accel] = self.skeleton.units[u].noise_std.map(|std| std / rate_hz.sqrt());
        Links {
            gyro_density: self.links.gyro_density.max(gyro),
            accel_density: self.links.accel_density.max(accel),
            ..self.links
        }
    }

    /// A unit's state after an increment from `mean` under gravity, m/s2.
    pub fn moved(&self, mean: &UnitState, i: &Increment, gravity: Vec3<f64>) -> UnitState {
        let t = i.duration_s;
        UnitState {
            rotation: mean.rotation.times(&i.rotation),
            velocity: mean.velocity + gravity * t + mean.rotation.apply(i.velocity),
            position: mean.position + mean.velocity * t + gravity * (0.5 * t * t) + mean.rotation.apply(i.position),
            ..*mean
        }
    }

    /// Means at `row_s`.
    pub fn present(&self, state: &State) -> Means {
        let gravity = self.gravity_in(&state.means);
        let units = state.means.units.iter().zip(&state.increments).map(|(mean, i)| self.moved(mean, i, gravity));
        let inputs = self.inputs(&state.heard, state.row_s, &state.means.inputs);
        Means { units: units.collect(), inputs, ..state.means.clone() }
    }

    fn predict(&mut self, state: &mut State) -> Vec<Step> {
        let mut steps = Vec::with_capacity(state.means.units.len());
        let mut noises = Vec::with_capacity(steps.capacity());
        self.silent = state.readings.iter().map(|r| state.row_s - r.last_s() > SILENT_S).collect();
        let before = state.means.units.clone();
        let (is_held, step_s) = (self.skeleton.is_held(), state.row_s - state.time_s);
        let gravity = self.gravity_in(&state.means);
        for (mean, increment) in state.means.units.iter_mut().zip(&mut state.increments) {
            let before = mean.rotation;
            *mean = self.moved(mean, increment, gravity);
            let (step, noise) = Step::of(increment, &before, (mean.velocity, mean.position), gravity);
            mean.rotation = orthonormal(&mean.rotation);
            steps.push(step);
            noises.push(noise);
            *increment = Increment::none();
        }
        for u in (0..before.len()).filter(|u| self.silent[*u]) {
            self.ride(&mut state.means.units, &before, u);
            let known = if is_held { block(&state.covariance, UNIT * u) } else { ZERO };
            // Wider turns than that no loop reads.
            let is_wide = (0..3).any(|i| known.0[i][i] > SILENT_RAD * SILENT_RAD);
            let walk = match (is_held, is_wide) {
                (true, true) => 0.0,
                (true, false) => LOOSE_WALK * LOOSE_WALK * step_s,
                (false, _) => SILENT_RAD * SILENT_RAD,
            };
            let turn = sum(&known, &Mat3::identity(), walk);
            let stds = [self.links.start_speed_std_m_s, self.links.start_place_std_m];
            noises[u] = fresh_block(&turn, &state.means.units[u], stds);
            steps[u].forgets = true;
        }
        let decays = self.decays(step_s);
        predict(self.arch, &mut state.covariance, (&steps, &self.pushed(), &decays, &self.slide_shares(step_s)));
        self.wander(state, step_s);
        self.slide_on(state, step_s);
        for (i, (noise, unit)) in noises.iter().zip(&self.skeleton.units).enumerate() {
            put_block(&mut state.covariance, UNIT * i, noise);
            for r in 0..6 {
                let at = UNIT * i + 9 + r;
                *state.covariance.at_mut(at, at) += unit.bias[r / 3][1].powi(2) * step_s;
            }
        }
        for number in 0..self.skeleton.loose.len() {
            let first = self.loose_state(number);
            (first..first + 3).for_each(|i| *state.covariance.at_mut(i, i) += LOOSE_WALK * LOOSE_WALK * step_s);
        }
        if let Some(i) = self.azimuth_state() {
            *state.covariance.at_mut(i, i) += self.skeleton.azimuth_walk.powi(2) * step_s;
        }
        state.time_s = state.row_s;
        steps
    }

    /// A silent unit goes with the neighbour that a joint connects it to, if that speaks; else it stays.
    fn ride(&self, units: &mut [UnitState], before: &[UnitState], u: usize) {
        let ends = self.skeleton.closures.iter().filter_map(|c| match (c.from, c.to) {
            (End::Unit(a, _), End::Unit(b, _)) => Some((a, b)),
            _ => None,
        });
        let neighbour = ends.filter_map(|(a, b)| (a == u).then_some(b).or((b == u).then_some(a)));
        let own = &before[u];
        units[u] = match { neighbour }.find(|n| !self.silent[*n]) {
            None => UnitState { velocity: Vec3([0.0; 3]), ..*own },
            Some(n) => {
                let turn = units[n].rotation.times_transposed(&before[n].rotation);
                UnitState {
                    rotation: orthonormal(&turn.times(&own.rotation)),
                    velocity: units[n].velocity,
                    position: units[n].position + turn.apply(own.position - before[n].position),
                    ..*own
                }
            }
        };
    }

    fn update(&mut self, state: &mut State, step_s: f64) {
        state.means.inputs = self.inputs(&state.heard, state.time_s, &state.means.inputs);
        self.silences = self.silences(&state.heard, state.time_s);
        self.correction.shift.fill(0.0);
        let is_open = self.is_open(&state.covariance);
        let turns = self.only.is_none() && self.skeleton.is_held() && !self.skeleton.loose.is_empty();
        let before = (is_open || turns).then(|| state.means.clone());
        self.read_all(state, step_s);
        self.take_shift(state);
        if let Some(means) = before {
            let usual: Vec<_> = state.heard.iter().map(|heard| heard.usual).collect();
            self.read_again(state, &means, is_open, step_s);
            state.heard.iter_mut().zip(usual).for_each(|(heard, usual)| heard.usual = usual);
        }
        self.correction.finish(&mut state.covariance);
        state.updates = state.updates.wrapping_add(1);
    }

    /// Whether the orientation of a unit is so uncertain that a reading is not linear in it.
    fn is_open(&self, covariance: &Square) -> bool {
        let turns = (0..self.skeleton.units.len()).flat_map(|u| (UNIT * u..UNIT * u + 3).map(|i| covariance.at(i, i)));
        { turns }.any(|variance| variance > NONLINEAR_RAD * NONLINEAR_RAD)
    }

    /// Reads an update again from where it led, until it leads nowhere else (Bell and Cathey 1993). Of a link without a unit nothing says how it
    /// turned since the last update, so that its readings are not linear in that. Where it leads away, it is read once.
    fn read_again(&mut self, state: &mut State, means: &Means, is_open: bool, step_s: f64) {
        let likelihood = self.correction.log_likelihood;
        let first = if is_open { 0 } else { self.skeleton.units.len() };
        let largest = |moved: &[Vec3<f64>]| moved[first..].iter().map(|turn| square(*turn)).fold(0.0, f64::max);
        let alone = largest(&self.moved_by);
        let mut step = alone;
        for _ in 0..MOST_AGAIN {
            if step < NEAR_RAD * NEAR_RAD {
                break;
            }
            self.read_from(state, means, step_s);
            step = largest(&self.moved_by);
        }
        if step.is_nan() || step > alone {
            state.means.clone_from(means);
            self.read_from(state, means, step_s);
        }
        self.correction.log_likelihood = likelihood;
        let turn = |to: &Mat3<f64>, from: &Mat3<f64>| Vec3(Turn::of(&to.times_transposed(from)).log());
        let units = state.means.units.iter().zip(&means.units).map(|(to, from)| turn(&to.rotation, &from.rotation));
        let loose = state.means.loose.iter().zip(&means.loose).map(|(to, from)| turn(to, from));
        self.moved_by = units.chain(loose).collect();
    }

    /// Reads everything linearised about the means of the state, where they were `before`.
    fn read_from(&mut self, state: &mut State, before: &Means, step_s: f64) {
        let mut shift = std::mem::take(&mut self.correction.shift);
        self.difference(before, &state.means, &mut shift);
        self.correction.shift = shift;
        self.correction.clear();
        self.read_all(state, step_s);
        self.take_shift(state);
    }

    /// Moves the means by what the readings say.
    fn take_shift(&mut self, state: &mut State) {
        let shift = std::mem::take(&mut self.correction.shift);
        let loose = (0..self.skeleton.loose.len()).map(|number| self.loose_state(number));
        let first: Vec<usize> = (0..self.skeleton.units.len()).map(|u| UNIT * u).chain(loose).collect();
        for (moved, i) in self.moved_by.iter_mut().zip(first) {
            moved.0.copy_from_slice(&shift[i..i + 3]);
        }
        self.shift(&mut state.means, &shift);
        self.correction.shift = shift;
    }

    fn read_all(&mut self, state: &mut State, step_s: f64) {
        self.closure_nis.fill(f64::NAN);
        if self.closures {
            let read = self.only.map_or(0..self.skeleton.closures.len(), |c| c..c + 1);
            read.for_each(|c| self.read_closure(state, c, step_s));
            let all = || (0..self.skeleton.links.len()).collect();
            let read = self.only.map_or_else(all, |c| self.skeleton.joints_through(c));
            read.into_iter().for_each(|l| self.read_hinges(state, l, step_s));
            if self.only.is_none() {
                (0..self.skeleton.loop_axes.len()).for_each(|number| self.read_axes(state, number, step_s));
            }
        }
        // Fields are used or not by where the estimate is, so they cannot judge it.
        let likelihood = self.correction.log_likelihood;
        if self.only.is_none() {
            self.read_sensors(state, step_s);
            self.correction.log_likelihood = likelihood;
        }
        (0..self.skeleton.links.len()).for_each(|l| self.read_spring(state, l, step_s));
        // Limits act over seconds, and angles of joints cost time.
        if self.closures && self.only.is_none() && state.updates.is_multiple_of(LIMITS_EVERY) {
            let step_s = step_s * f64::from(LIMITS_EVERY);
            (0..self.skeleton.links.len()).for_each(|l| self.read_limits(state, l, step_s));
        }
        // Loops of the model say more of where units are.
        if !self.skeleton.is_held() {
            (0..self.skeleton.units.len()).for_each(|u| self.read_bounds(state, u, step_s));
        }
        self.read_rests(state, step_s);
        (0..self.skeleton.units.len()).for_each(|u| self.read_contact(state, u, step_s));
    }

    /// Moves the means by an error: R <- Exp(f) R, v <- Exp(f) v + ..., p <- Exp(f) p + ...
    pub fn shift(&self, means: &mut Means, shift: &[f64]) {
        let three = |i: usize| Vec3([shift[i], shift[i + 1], shift[i + 2]]);
        for (i, mean) in means.units.iter_mut().enumerate() {
            let first = UNIT * i;
            let turn = Mat3::about(three(first));
            mean.rotation = turn.times(&mean.rotation);
            mean.velocity = turn.apply(mean.velocity) + three(first + 3);
            mean.position = turn.apply(mean.position) + three(first + 6);
            mean.gyro_bias += three(first + 9);
            mean.accel_bias += three(first + 12);
        }
        for (number, loose) in means.loose.iter_mut().enumerate() {
            *loose = orthonormal(&Mat3::about(three(self.loose_state(number))).times(loose));
        }
        for (constant, first) in means.constants.iter_mut().zip(self.constants()) {
            *constant += three(first);
        }
        if let Some(i) = self.azimuth_state() {
            means.azimuth += shift[i];
        }
        means.pushes.iter_mut().enumerate().for_each(|(k, push)| *push += shift[self.push_state(k)]);
        means.room += self.room_state().map_or(Vec3([0.0; 3]), three);
        means.lengths.iter_mut().enumerate().for_each(|(k, length)| *length += shift[self.length_state(k)]);
        for (number, slide) in means.slides.iter_mut().enumerate() {
            slide.iter_mut().zip(&shift[self.slide_state(number)..]).for_each(|(x, step)| *x += step);
        }
    }

    /// Rotation of a link against its parent, and room from link.
    pub fn relative(&self, means: &Means, l: usize) -> (Mat3<f64>, Mat3<f64>) {
        let child = self.orientation(means, l);
        let parent = self.orientation_of(means, self.skeleton.links[l].parent);
        (parent.transposed().times(&child), child)
    }
}

/// Scalar product.
pub fn dot(a: Vec3<f64>, b: Vec3<f64>) -> f64 {
    a.0[0] * b.0[0] + a.0[1] * b.0[1] + a.0[2] * b.0[2]
}

/// A rotation without the rounding of many products.
fn orthonormal(m: &Mat3<f64>) -> Mat3<f64> {
    Turn::of(m).times(&Turn::NONE).matrix()
}
