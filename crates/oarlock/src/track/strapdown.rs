//! Tracks strapdown links: from samples to readings of each unit, and from the filter's estimates to state estimates of the model's joints.
//!
//! A sample is processed once all units that still speak have later readings, so that each is integrated on its own clock: with units
//! that tick apart, by one of their intervals later than it came.

pub(super) mod fixing;
mod flat;
mod start;

use self::fixing::Rival;
use super::begin::start_std;
use super::hypothesis::Hypothesis;
use super::{Calibration, Sink, Status, Subject, Tracker};
use crate::body::Body;
use crate::config::{Config, Magnetometer};
use crate::error::Result;
use crate::estimate::filter::{Diverged, SourceInfo, Verdict};
use crate::kernels::dense::Square;
use crate::model::{Fixing, Model, Structure};
use crate::recording::Sample;
use crate::rotation::Vec3;
use crate::sensor::{MountValue, Quantity};
use crate::strapdown::angles::Coordinates;
use crate::strapdown::check::{Alone, Check};
use crate::strapdown::filter::{Means, Node, State, StrapdownFilter};
use crate::strapdown::increment::{Increment, Jump, Reading, Signal};
use crate::strapdown::sensors::{Measures, Place};
use crate::strapdown::skeleton::{Mounts, Skeleton, Unit};
use std::collections::VecDeque;
use std::sync::Arc;

/// Units silent for longer are not waited for, s.
const PATIENCE_S: f64 = 0.15;
/// Standard deviations of clipped readings, rad/s and m/s2: they are only a bound.
const CLIPPED: [f64; 2] = [5.0, 50.0];
/// What a unit of strapdown links measures.
const INERTIAL: [Quantity; 2] = [Quantity::Gyro, Quantity::Accel];
/// Standard deviation of a force that a unit did not send, m/s2.
const UNSENT_FORCE: f64 = 5.0;

/// A sample that waits for later readings.
#[derive(Debug, Clone, PartialEq)]
struct Waiting {
    sample: Sample,
    /// What became of each part of its readings.
    parts: Vec<Verdict>,
}

/// What a tracker of strapdown links knows at one instant, beside the state estimate of the joints.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LinkState {
    pub(super) state: State,
    /// By source: whether it had readings at the start.
    present: Vec<bool>,
    waiting: VecDeque<Waiting>,
    /// Time of the last sample that was taken in, s.
    taken_s: f64,
    /// Update that the covariance of the state estimate belongs to, s.
    spread_s: f64,
    /// Each unit alone, and how the body agrees with it.
    alone: Vec<State>,
    pub(super) checks: Vec<Check>,
    /// Turns off the axes of hinges; see `Coordinates::off_axis`.
    pub(super) off_axis: Vec<[f64; 3]>,
    /// How units sit, what else is possible, and how long the body moved, s.
    pub(super) fixing: Fixing,
    rivals: Vec<Rival>,
    moved_s: f64,
}

impl LinkState {
    /// Names of the units, and how each agrees with itself alone.
    pub(super) fn units_contradicted(&self, tracker: &Tracker) -> Vec<(String, Check)> {
        let mut tracker = tracker.clone();
        let sources = &tracker.subject.body.suite.sources.clone();
        if tracker.build_filter(&self.present).is_err() {
            return Vec::new();
        }
        let units = tracker.strapdown_filter().skeleton.units.iter();
        units.zip(&self.checks).map(|(unit, check)| (sources[unit.source].name.clone(), *check)).collect()
    }

    /// Names of the joints, inputs aside, whose values are readings of their encoders.
    pub(super) fn joints_as_encoded(&self, tracker: &Tracker) -> Vec<String> {
        let mut tracker = tracker.clone();
        if tracker.build_filter(&self.present).is_err() {
            return Vec::new();
        }
        let is_encoded = |first: usize| {
            let mut sensors = tracker.strapdown_filter().skeleton.sensors.iter();
            sensors.any(|sensor| matches!(sensor.measures, Measures::Input(c) if c == first))
        };
        let joints = tracker.subject.body.model.joints.iter().filter(|joint| !joint.input && is_encoded(joint.first));
        joints.map(|joint| joint.name.clone()).collect()
    }

    /// Time of the last sample that was taken in, s.
    pub(super) fn taken_s(&self) -> f64 {
        self.taken_s
    }
}

/// The filter of a tracker of strapdown links.
#[derive(Debug, Clone)]
pub(super) struct Strapdown {
    mounts: Mounts,
    pub filter: Option<StrapdownFilter>,
    alone: Option<Alone>,
    /// By source: whether the whole recording has readings of it, so that it counts from the start on; empty: unknown.
    speaks: Vec<bool>,
    /// By coordinate: row of its encoder in the measurement vector, if it has one there.
    encoder_rows: Vec<Option<usize>>,
    /// How units sit, if it is decided before the start.
    fixing: Option<Fixing>,
    /// Standard deviations of states that strapdown links do not estimate.
    unknown: Vec<f64>,
    /// Time after the first sample at which a start is tried again, s.
    next_start_s: f64,
}

/// Means and signals of a row, for the smoother.
#[derive(Debug, Clone)]
pub(super) struct RowMotion {
    pub time_s: f64,
    pub increments: Vec<Increment>,
    pub signals: Vec<Signal>,
    /// See `Means::inputs`.
    pub inputs: Vec<[f64; 2]>,
    /// For how long nothing had been read, s; 0: less than what the body goes on through.
    pub silence_s: f64,
}

/// What smoothed means, carried on by the increments of an update, lack to the smoothed ones after it; from when, s, and over how long, s.
pub(super) struct Lack {
    error: Vec<f64>,
    from_s: f64,
    duration_s: f64,
}

impl Lack {
    pub fn of(filter: &StrapdownFilter, node: &Node, before: &Means, after: &Means) -> Self {
        let arrived = filter.carried(before, &node.before, &node.increments);
        let duration_s = node.increments[0].duration_s;
        if node.steps.iter().all(|step| step.forgets) {
            return Lack { error: vec![0.0; filter.size], from_s: node.before_s, duration_s: 1.0 };
        }
        Lack { error: filter.lack(after, &arrived), from_s: node.before_s, duration_s }
    }
}

/// How a model is tracked if nothing else is chosen: as strapdown links unless it says "tree" or they cannot track it.
pub fn structure_of(model: &Arc<Model>) -> Structure {
    let is_of_links = || {
        let values = vec![None; model.sensors.len()];
        let body = Body::new(model.clone(), &model.default_parameters(), &values, &Config::default())?;
        skeleton_of_all(&body, &Mounts { values, stds_rad: vec![[0.0; 3]; model.sensors.len()] })
    };
    model.structure.unwrap_or_else(|| if is_of_links().is_ok() { Structure::Strapdown } else { Structure::Tree })
}

/// Where all units and encoders have readings.
fn skeleton_of_all(body: &Body, mounts: &Mounts) -> Result<Skeleton> {
    Skeleton::new(body, &vec![true; body.suite.sources.len() + body.axes.len()], mounts)
}

impl Strapdown {
    /// `None` if the model is tracked as a tree.
    pub fn new(
        body: &Body,
        calibration: &Calibration,
        mounts: &[Option<MountValue>],
        chosen: Option<Structure>,
    ) -> Result<Option<Self>> {
        let structure = chosen.or(body.model.structure);
        if structure == Some(Structure::Tree) {
            return Ok(None);
        }
        let std = |name: &String| calibration.mount_stds_rad.get(name).copied().unwrap_or([0.0; 3]);
        let stds_rad = body.model.sensors.iter().map(|s| std(&s.name)).collect();
        let mounts = Mounts { values: mounts.to_vec(), stds_rad };
        match skeleton_of_all(body, &mounts) {
            // A model that cannot be tracked is refused at once.
            Err(refusal) if structure.is_some() => return Err(refusal),
            Err(_) => return Ok(None),
            Ok(_) => {}
        }
        let unknown = start_std(body, 1.0);
        Ok(Some(Strapdown {
            mounts,
            filter: None,
            alone: None,
            speaks: Vec::new(),
            encoder_rows: (0..body.axes.len()).map(|c| encoder_row(body, c)).collect(),
            fixing: None,
            unknown,
            next_start_s: 0.0,
        }))
    }

    /// Frames of links whose hinges lock a direction.
    pub fn locked(&self) -> Vec<usize> {
        self.filter.as_ref().map_or_else(Vec::new, |filter| filter.locked().map(|link| link.frame).collect())
    }

    /// Coordinates of a row after smoothed means, where the filter had `filtered`.
    pub fn smoothed(
        &self,
        body: &Body,
        (smoothed, filtered): (&Means, &Means),
        motion: &RowMotion,
        lack: Option<&Lack>,
        near: &[f64],
    ) -> Coordinates {
        let filter = self.filter.as_ref().expect("made at the start");
        let mut means = filter.carried(smoothed, filtered, &motion.increments);
        means.inputs.clone_from(&motion.inputs);
        if let Some(Lack { error, from_s, duration_s }) = lack {
            let share = ((motion.time_s - from_s) / duration_s).clamp(0.0, 1.0);
            filter.shift(&mut means, &error.iter().map(|x| x * share).collect::<Vec<_>>());
        }
        self.coordinates(body, &means, &motion.signals, near)
    }

    /// Covariance where nothing had been read for so long; `None` if readings had come.
    pub fn silent_covariance(&self, means: &Means, silence_s: f64) -> Option<Square> {
        let filter = self.filter.as_ref().filter(|_| silence_s > 0.0)?;
        Some(filter.silent_covariance(means, silence_s))
    }

    /// Coordinates at these means.
    pub fn coordinates(&self, body: &Body, means: &Means, signals: &[Signal], near: &[f64]) -> Coordinates {
        let filter = self.filter.as_ref().expect("made at the start");
        Coordinates::of(filter, body, means, signals, (near, &self.unknown))
    }
}

impl Tracker {
    /// Takes in a corrected sample.
    pub(super) fn take_in_links(&mut self, sample: &Sample, sink: Sink) -> Result<Status> {
        let Some(mut one) = self.hypothesis.take() else {
            return self.gather_links(sample, sink);
        };
        let taken_s = one.links.as_ref().map_or(f64::NEG_INFINITY, |l| l.taken_s);
        if sample.time_s <= taken_s || !sample.time_s.is_finite() {
            self.hypothesis = Some(one);
            return Ok(Status::OutOfOrder);
        }
        self.admit(&mut one, self.present(std::slice::from_ref(sample)))?;
        self.take_readings(&mut one, sample);
        let processed = self.process_links(&mut one, false, sink);
        let status = start::status(&one);
        self.hypothesis = Some(one);
        processed?;
        Ok(status)
    }

    /// Processes what waits at the end of the recording.
    pub(super) fn finish_links(&mut self, sink: Sink) -> Result<()> {
        if self.hypothesis.is_none() && !self.waiting.is_empty() {
            self.begin_links(true, sink)?;
        }
        let Some(mut one) = self.hypothesis.take() else { return Ok(()) };
        let done = self.process_links(&mut one, true, sink);
        self.hypothesis = Some(one);
        done
    }

    pub(super) fn build_filter(&mut self, present: &[bool]) -> Result<()> {
        let Some(strapdown) = &mut self.strapdown else { return Ok(()) };
        let body = &self.subject.body;
        let mut skeleton = Skeleton::new(body, present, &strapdown.mounts)?;
        if self.config.magnetometer == Magnetometer::Off {
            skeleton.sensors.retain(|sensor| !matches!(sensor.measures, Measures::Field(_)));
        }
        let readings = (self.config.closures, self.config.contacts);
        let mut filter = StrapdownFilter::new(skeleton, body.model.links, readings);
        filter.tests_fields = self.config.magnetometer == Magnetometer::Gated;
        strapdown.alone = Some(Alone::new(&filter));
        strapdown.filter = Some(filter);
        Ok(())
    }

    /// Makes the filter that a state estimate belongs to.
    pub(super) fn resume_links(&mut self, one: &Hypothesis) -> Result<()> {
        match &one.links {
            Some(links) => self.build_filter(&links.present.clone()),
            None => Ok(()),
        }
    }

    fn strapdown_filter(&self) -> &StrapdownFilter {
        self.strapdown.as_ref().and_then(|s| s.filter.as_ref()).expect("made at the start")
    }

    /// Adds the readings of a sample to their units, without those of stuck sensors.
    pub(super) fn take_readings(&mut self, one: &mut Hypothesis, sample: &Sample) {
        let Tracker { subject, readings, faults, strapdown, .. } = self;
        let filter = strapdown.as_ref().and_then(|s| s.filter.as_ref()).expect("made at the start");
        let Some(links) = &mut one.links else { return };
        readings.take(sample);
        faults.silence_clipped(subject, readings);
        faults.silence_stuck(subject, &mut one.sources, readings, sample.time_s);
        let mut parts = faults.verdicts(subject, sample);
        exclude_impossible(subject, sample, &mut parts);
        for (u, unit) in filter.skeleton.units.iter().enumerate() {
            let verdict = |first: usize| parts[subject.part_of_row[first]];
            let three = |first: usize| Vec3([sample.z[first], sample.z[first + 1], sample.z[first + 2]]);
            let is_used = |v: Verdict| matches!(v, Verdict::Accepted | Verdict::Clipped);
            let (gyro, accel) = (verdict(unit.gyro), verdict(unit.accel));
            if !is_used(gyro) {
                continue;
            }
            let clipped = |first: usize, v: Verdict, std: f64| {
                let is_clipped = |r: usize| v == Verdict::Clipped && readings.z[r].is_nan();
                Vec3([0, 1, 2].map(|q| if is_clipped(first + q) { std } else { 0.0 }))
            };
            let mut excess = [clipped(unit.gyro, gyro, CLIPPED[0]), clipped(unit.accel, accel, CLIPPED[1])];
            let time_s = sample.time_s + sample.offset_s.get(unit.source).copied().unwrap_or(0.0);
            let force = match is_used(accel) {
                true => three(unit.accel),
                false => {
                    excess[1] = Vec3([UNSENT_FORCE; 3]);
                    match links.state.readings[u].last() {
                        Some(last) => last.accel,
                        None => continue,
                    }
                }
            };
            let reading = Reading { time_s, gyro: three(unit.gyro), accel: force, excess };
            strapdown.iter().flat_map(|s| &s.alone).for_each(|alone| alone.take(&mut links.alone, u, reading));
            for rival in &mut links.rivals {
                filter.take(&mut rival.state, u, reading);
            }
            let (is_taken, jump) = filter.take(&mut links.state, u, reading);
            if is_taken {
                one.sources[unit.source].seen_s = time_s;
            }
            if let Some(jump) = jump {
                report_jump(subject, &mut links.waiting, unit, jump);
            }
        }
        hear(filter, links, subject, sample, &parts);
        links.taken_s = sample.time_s;
        links.waiting.push_back(Waiting { sample: sample.clone(), parts });
    }

    /// Processes the samples that are complete; all of them if it is the end.
    fn process_links(&mut self, one: &mut Hypothesis, is_end: bool, sink: Sink) -> Result<()> {
        while let Some((sample, _)) = self.process_one(one, is_end, &mut |_| {}, false) {
            check_number(one)?;
            sink(&sample, one, &self.info);
        }
        Ok(())
    }

    /// Processes the next sample if it is complete: its sample, and what the smoother needs of its row.
    pub(super) fn process_one(
        &mut self,
        one: &mut Hypothesis,
        is_end: bool,
        node: &mut dyn FnMut(Node),
        for_smoother: bool,
    ) -> Option<(Sample, Option<RowMotion>)> {
        let strapdown = self.strapdown.as_mut()?;
        let filter = strapdown.filter.as_mut()?;
        let links = one.links.as_mut()?;
        let front = links.waiting.front()?;
        let time_s = front.sample.time_s;
        if !is_end && filter.complete_s(&links.state, PATIENCE_S) < time_s - 1e-9 {
            return None;
        }
        let longest_s = filter.longest_s(&links.state);
        if filter.silence_s(&links.state, time_s) > longest_s {
            return self.pass_silence(one);
        }
        let silence_s = time_s - links.state.row_s;
        if silence_s > longest_s && !self.start_again(one, (time_s, silence_s), is_end, node) {
            return None;
        }
        let strapdown = self.strapdown.as_mut()?;
        let filter = strapdown.filter.as_mut()?;
        let links = one.links.as_mut()?;
        let Waiting { sample, parts } = links.waiting.pop_front()?;
        let before_s = links.state.time_s;
        filter.let_go.iter_mut().zip(&links.checks).for_each(|(let_go, check)| *let_go = check.is_contradicted);
        let stated = self.subject.body.model.links;
        links.advance(filter, &stated, time_s, (node, for_smoother));
        let is_updated = links.state.time_s == time_s;
        if let Some(alone) = strapdown.alone.as_mut().filter(|_| filter.closures) {
            alone.advance(&mut links.alone, time_s, filter.moves(&links.state));
            if is_updated && time_s > before_s {
                filter.check(&links.state, &links.alone, &mut links.checks, time_s - before_s);
            }
        }
        if !for_smoother {
            links.choose();
            filter.links = filter.stated(&stated.with(links.fixing, links.rivals.is_empty()));
        }
        let means = filter.present(&links.state);
        let signals: Vec<Signal> = links.state.readings.iter().map(|r| r.at(time_s)).collect();
        let body = &self.subject.body;
        let strapdown = self.strapdown.as_ref()?;
        let coordinates = strapdown.coordinates(body, &means, &signals, &one.belief.mean);
        if links.spread_s != links.state.time_s {
            one.belief.covariance = coordinates.covariance(&links.state.covariance);
            links.spread_s = links.state.time_s;
        }
        let increments = || links.state.increments.clone();
        let motion = for_smoother.then(|| RowMotion {
            time_s,
            increments: increments(),
            signals,
            inputs: means.inputs,
            silence_s: 0.0,
        });
        links.off_axis = coordinates.off_axis;
        one.belief.mean = coordinates.mean;
        one.belief.time_s = time_s;
        self.report_links(&parts, is_updated);
        Some((sample, motion))
    }

    /// A row in which nothing has been read for some time: the posture of before, worth what a limb does that nothing reads.
    fn pass_silence(&mut self, one: &mut Hypothesis) -> Option<(Sample, Option<RowMotion>)> {
        let strapdown = self.strapdown.as_ref()?;
        let filter = strapdown.filter.as_ref()?;
        let links = one.links.as_mut()?;
        let Waiting { sample, parts } = links.waiting.pop_front()?;
        let time_s = sample.time_s;
        let means = filter.present(&links.state);
        let silence_s = filter.silence_s(&links.state, time_s);
        let at_last = links.state.readings.iter().map(|r| r.at(links.state.row_s));
        let signals: Vec<Signal> = at_last.map(|signal| Signal { silence_s, ..signal }).collect();
        let coordinates = strapdown.coordinates(&self.subject.body, &means, &signals, &one.belief.mean);
        one.belief.covariance = coordinates.covariance(&filter.silent_covariance(&means, silence_s));
        one.belief.mean = coordinates.mean;
        one.belief.time_s = time_s;
        links.spread_s = f64::NAN;
        let increments = links.state.increments.clone();
        self.report_links(&parts, false);
        Some((sample, Some(RowMotion { time_s, increments, signals, inputs: means.inputs, silence_s })))
    }

    fn report_links(&mut self, parts: &[Verdict], is_updated: bool) {
        let (subject, info) = (&self.subject, &mut self.info);
        let Some(filter) = self.strapdown.as_ref().and_then(|s| s.filter.as_ref()) else { return };
        info.innovation.fill(f64::NAN);
        info.parts.copy_from_slice(parts);
        info.lost = false;
        info.log_likelihood = 0.0;
        let first_loop = info.sources.len() - subject.body.model.closures.len();
        for (p, quantity) in subject.quantities.iter().enumerate() {
            let unit = filter.skeleton.units.iter().position(|u| u.source == subject.source_of_part[p]);
            let virtually = match quantity {
                Quantity::Rest => unit.is_some_and(|u| is_updated && filter.rests[u]),
                Quantity::Contact => unit.is_some_and(|u| is_updated && filter.stands[u]),
                Quantity::Closure => filter.is_loop_read(subject.source_of_part[p] - first_loop),
                Quantity::Mag if self.config.magnetometer == Magnetometer::Off => false,
                Quantity::Mag if info.parts[p] == Verdict::Accepted => {
                    let judged = unit.map_or(Verdict::Missing, |u| filter.fields[u]);
                    info.parts[p] = if judged == Verdict::Missing { Verdict::Accepted } else { judged };
                    continue;
                }
                _ => continue,
            };
            info.parts[p] = if virtually { Verdict::Accepted } else { Verdict::Missing };
        }
        for (s, source) in info.sources.iter_mut().enumerate() {
            *source = SourceInfo { nis: f64::NAN, used: 0, rejected: 0, missing: 0 };
            for p in (0..parts.len()).filter(|p| subject.source_of_part[*p] == s) {
                let rows = subject.groups.parts[p].len() as u8;
                match info.parts[p] {
                    Verdict::Accepted => source.used += rows,
                    Verdict::Missing => source.missing += rows,
                    _ => source.rejected += rows,
                }
            }
        }
        subject.excuse_virtual(info);
        // Of the last update, which may be earlier than the sample.
        let read: Vec<f64> = filter.closure_nis.iter().copied().filter(|x| !x.is_nan()).collect();
        let sum = read.iter().sum();
        info.nis = if is_updated { sum } else { f64::NAN };
        info.inertial = if read.is_empty() { (f64::NAN, 0) } else { (sum, 3 * read.len()) };
    }
}

/// Row of a coordinate's encoder in the measurement vector; `None`: it has none, or it is an input.
fn encoder_row(body: &Body, coordinate: usize) -> Option<usize> {
    let sensor = body.model.encoder(coordinate)?;
    body.suite.sources.iter().find(|source| source.name == sensor.name).map(|source| source.rows.start)
}

/// An estimate that is no number is not given to anybody.
fn check_number(one: &Hypothesis) -> Result<()> {
    let belief = &one.belief;
    let is_number = |i: usize| belief.mean[i].is_finite() && belief.covariance.at(i, i).is_finite();
    match (0..belief.mean.len()).all(is_number) {
        true => Ok(()),
        false => Err(super::diverged(Diverged { what: "the estimate is not a number".into() }, belief.time_s)),
    }
}

/// Marks a reading that jumped in the sample that brought it, which waits for the next reading.
fn report_jump(subject: &Subject, waiting: &mut VecDeque<Waiting>, unit: &Unit, jump: Jump) {
    let time_s = |w: &Waiting| w.sample.time_s + w.sample.offset_s.get(unit.source).copied().unwrap_or(0.0);
    let Some(brought) = waiting.iter_mut().rev().find(|w| time_s(w) == jump.time_s) else { return };
    for (first, _) in [unit.gyro, unit.accel].into_iter().zip(jump.of).filter(|(_, is_jump)| *is_jump) {
        brought.parts[subject.part_of_row[first]] = Verdict::Outlier;
    }
}

/// Adds the readings of all sensors that are no gyroscope or accelerometer.
fn hear(filter: &StrapdownFilter, links: &mut LinkState, subject: &Subject, sample: &Sample, parts: &[Verdict]) {
    for (s, sensor) in filter.skeleton.sensors.iter().enumerate() {
        let mut value = [0.0; 3];
        let (own, offset_s) = match sensor.at {
            Place::Input(coordinate) => (&sample.inputs[coordinate..=coordinate], 0.0),
            Place::Row(first) => {
                let part = subject.part_of_row[first];
                let source = subject.source_of_part[part];
                let is_used = matches!(parts[part], Verdict::Accepted);
                let end = if is_used { first + sensor.measures.width() } else { first };
                (&sample.z[first..end], sample.offset_s.get(source).copied().unwrap_or(0.0))
            }
        };
        if own.is_empty() || own.iter().any(|x| x.is_nan()) {
            continue;
        }
        value[..own.len()].copy_from_slice(own);
        let rivals = links.rivals.iter_mut().map(|rival| &mut rival.state);
        let fastest = if sensor.measures.width() == 1 { FASTEST_PER_S } else { f64::INFINITY };
        for state in std::iter::once(&mut links.state).chain(rivals) {
            state.heard[s].push(sample.time_s + offset_s, value, fastest);
        }
    }
}

/// An encoder that turns or slides faster from one reading to the next may have jumped, rad/s or m/s.
const FASTEST_PER_S: f64 = 30.0;

/// Largest readings of any sensor that bodies wear: rad/s, m/s2, uT.
const MOST: [(Quantity, f64); 3] = [(Quantity::Gyro, 150.0), (Quantity::Accel, 2000.0), (Quantity::Mag, 1e4)];

/// A reading that no sensor has is not used.
fn exclude_impossible(subject: &Subject, sample: &Sample, parts: &mut [Verdict]) {
    for (p, quantity) in subject.quantities.iter().enumerate() {
        let most = MOST.iter().find(|(own, _)| own == quantity).map_or(1e6, |(_, most)| *most);
        if sample.z[subject.groups.parts[p].clone()].iter().any(|z| z.abs() > most) {
            parts[p] = Verdict::Excluded;
        }
    }
}
