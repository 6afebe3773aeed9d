//! The start of strapdown links in a tracker, and units that are admitted later.

use super::super::begin::asked_posture;
use super::super::hypothesis::Hypothesis;
use super::super::{Sink, Status, Tracker};
use super::fixing::Rival;
use super::{check_number, Lack, LinkState, RowMotion, INERTIAL};
use crate::error::Result;
use crate::estimate::belief::Belief;
use crate::estimate::filter::Info;
use crate::estimate::smoother::Backward;
use crate::kernels::dense::Square;
use crate::model::Fixing;
use crate::recording::{Recording, Sample};
use crate::rotation::Mat3;
use crate::strapdown::check::Check;
use crate::strapdown::filter::{Means, Node, State};
use crate::strapdown::increment::Readings;
use crate::strapdown::sensors::Heard;
use crate::strapdown::skeleton::{Pose, Unit};
use std::collections::VecDeque;

/// The first rows, which are smoothed, s: a wrong tilt at the start is found within them.
const START_S: f64 = 1.0;
/// After everything was silent, a body that encoders and closures hold is sought anew in the readings of this time, s.
const AGAIN_S: f64 = 0.4;
/// Longest time for which headings are sought, s, and the factor from one try to the next.
const LONGEST_START_S: f64 = 5.0;
const LATER: f64 = 1.7;

/// States of the layout at a start, if readings tell them.
type Posture = Option<Vec<f64>>;

/// Where a silence follows the first readings, no row has been processed yet: nothing is known.
pub(super) fn status(one: &Hypothesis) -> Status {
    let is_known = one.belief.covariance.at(0, 0) > 0.0;
    if is_known {
        Status::Tracking
    } else {
        Status::Starting
    }
}

impl Tracker {
    pub(super) fn gather_links(&mut self, sample: &Sample, sink: Sink) -> Result<Status> {
        let late = self.waiting.last().is_some_and(|w| sample.time_s <= w.time_s);
        if late || !sample.time_s.is_finite() {
            return Ok(Status::OutOfOrder);
        }
        self.waiting.push(sample.clone());
        let since_s = sample.time_s - self.waiting[0].time_s;
        let due_s = self.strapdown.as_ref().map_or(0.0, |s| s.next_start_s);
        if since_s < self.config.start_window_s.max(START_S).max(due_s) {
            return Ok(Status::Starting);
        }
        self.begin_links(since_s >= LONGEST_START_S, sink)?;
        Ok(self.hypothesis.as_ref().map_or(Status::Starting, status))
    }

    /// Makes the filter for the units that have readings, and takes in the samples that waited. Where headings are open and the readings do
    /// not decide them, the samples go on waiting unless they `must` do.
    pub(super) fn begin_links(&mut self, must: bool, sink: Sink) -> Result<()> {
        let waiting = std::mem::take(&mut self.waiting);
        let present = self.present(&waiting);
        self.build_filter(&present)?;
        let time_s = waiting[0].time_s;
        let mut one = Hypothesis::new(self.blank_belief(time_s), self.subject.body.suite.sources.len());
        let units = self.strapdown_filter().skeleton.units.len();
        let state = State {
            time_s,
            means: Means::default(),
            covariance: Square::zeros(0),
            readings: vec![Readings::default(); units],
            heard: vec![Heard::default(); self.strapdown_filter().skeleton.sensors.len()],
            increments: Vec::new(),
            row_s: time_s,
            updates: 0,
        };
        one.links = Some(Box::new(LinkState {
            state,
            present,
            waiting: VecDeque::new(),
            taken_s: f64::NEG_INFINITY,
            spread_s: f64::NAN,
            alone: Vec::new(),
            checks: vec![Check::NEW; units],
            off_axis: Vec::new(),
            fixing: Fixing::Skin,
            rivals: Vec::new(),
            moved_s: 0.0,
        }));
        let posture = self.start_posture(&waiting)?;
        waiting.iter().for_each(|sample| self.take_readings(&mut one, sample));
        let Some(links) = &mut one.links else { return Ok(()) };
        let taken = (std::mem::take(&mut links.state.readings), std::mem::take(&mut links.state.heard));
        let start = self.start_state(time_s, taken, (&posture, must));
        let rivals = start.as_ref().map_or_else(Vec::new, |state| self.rivals(state));
        match start {
            Some(state) => {
                links.rivals = rivals;
                links.alone = self.strapdown.iter().flat_map(|s| &s.alone).flat_map(|a| a.start(&state)).collect();
                links.checks = (0..links.checks.len()).map(|u| Check::from(state.turn_variance(u))).collect();
                links.state = state;
                if let Some(fixing) = self.strapdown.as_ref().and_then(|s| s.fixing) {
                    links.settle(fixing);
                }
            }
            None => {
                self.waiting = waiting;
                self.strapdown.iter_mut().for_each(|s| s.next_start_s = s.next_start_s.max(START_S) * LATER);
                return Ok(());
            }
        }
        self.process_start(&mut one, sink)?;
        self.hypothesis = Some(one);
        Ok(())
    }

    /// The start if units sit otherwise than the model states.
    fn rivals(&mut self, state: &State) -> Vec<Rival> {
        let stated = self.subject.body.model.links;
        let Some(filter) = self.strapdown.as_mut().and_then(|s| s.filter.as_mut()) else { return Vec::new() };
        if !filter.closures || stated.skin_std_rad.is_none() {
            return Vec::new();
        }
        let rival = |fixing: &Fixing| {
            filter.links = filter.stated(&stated.with(*fixing, false));
            let mut state = state.clone();
            filter.restate(&mut state.covariance);
            Rival { fixing: *fixing, state, log_likelihood: 0.0 }
        };
        let rivals = Fixing::ALL[1..].iter().map(rival).collect();
        filter.links = filter.stated(&stated);
        rivals
    }

    /// Processes the samples of the start, which have all been taken in: their estimates are smoothed, because a wrong tilt at the start is
    /// corrected within the first second, and no unit turns like that.
    fn process_start(&mut self, one: &mut Hypothesis, sink: Sink) -> Result<()> {
        if let Some(links) = &one.links {
            let (filter, body) = (self.strapdown_filter(), &self.subject.body);
            filter.leave_mirror(body, &links.state.means, &mut one.belief.mean);
        }
        let mut rows: Vec<(Sample, Hypothesis, Info, RowMotion)> = Vec::new();
        let mut updates: Vec<(Node, usize)> = Vec::new();
        loop {
            let first = rows.len();
            let mut nodes = Vec::new();
            let Some((sample, motion)) = self.process_one(one, false, &mut |node| nodes.push(node), true) else {
                break;
            };
            updates.extend(nodes.into_iter().map(|node| (node, first)));
            rows.extend(motion.map(|motion| (sample, one.clone(), self.info.clone(), motion)));
        }
        let (Some(strapdown), Some(links)) = (&self.strapdown, &one.links) else { return Ok(()) };
        let filter = self.strapdown_filter();
        let mut backward = Backward::new(filter.size, &filter.lasting());
        let (mut smoothed, mut covariance) = (links.state.means.clone(), links.state.covariance.clone());
        let mut end = updates.last().map_or(0, |(_, first)| *first);
        for (k, (node, _)) in updates.iter().enumerate().rev() {
            let Ok((before, spread)) = filter.back(&mut backward, node, &smoothed, &covariance) else { break };
            let lack = Lack::of(filter, node, &before, &smoothed);
            let first = k.checked_sub(1).map_or(0, |earlier| updates[earlier].1);
            for (_, known, _, motion) in &mut rows[first..end] {
                let belief = &mut known.belief;
                let ends = (&before, &node.before);
                let coordinates = strapdown.smoothed(&self.subject.body, ends, motion, Some(&lack), &belief.mean);
                belief.covariance = coordinates.covariance(&spread);
                if let Some(links) = &mut known.links {
                    links.off_axis.clone_from(&coordinates.off_axis);
                }
                belief.mean = coordinates.mean;
            }
            (smoothed, covariance, end) = (before, spread, first);
        }
        for (sample, known, info, _) in &rows {
            check_number(known)?;
            sink(sample, known, info);
        }
        check_number(one)
    }

    /// Starts anew at the first reading after everything was silent, with the constants of before; false: later readings must say more. Encoders and
    /// loops hold a body in the posture that its readings fit.
    pub(super) fn start_again(
        &mut self,
        one: &mut Hypothesis,
        (time_s, silence_s): (f64, f64),
        is_end: bool,
        node: &mut dyn FnMut(Node),
    ) -> bool {
        let Some(links) = &one.links else { return true };
        let is_held = self.strapdown_filter().skeleton.is_held();
        let since_s = links.waiting.back().map_or(0.0, |w| w.sample.time_s) - time_s;
        let next_s = self.strapdown.as_ref().map_or(0.0, |s| s.next_start_s);
        let due_s = if is_held { AGAIN_S } else { START_S.max(next_s) };
        if !is_end && since_s < due_s {
            return false;
        }
        let posture = if is_held { self.posture_again(links, time_s) } else { None };
        let Some(links) = &mut one.links else { return true };
        let stated = self.subject.body.model.links;
        let Some(strapdown) = &mut self.strapdown else { return true };
        let Some(filter) = &mut strapdown.filter else { return true };
        let must = is_end || since_s >= LONGEST_START_S;
        let Some(start) = filter.start_anew(&links.state, (time_s, silence_s), posture.as_deref(), must) else {
            strapdown.next_start_s = due_s * LATER;
            return false;
        };
        strapdown.next_start_s = 0.0;
        let is_decided = links.rivals.is_empty();
        for rival in &mut links.rivals {
            filter.links = filter.stated(&stated.with(rival.fixing, false));
            rival.state = filter.with_constants(&start, &rival.state, posture.is_some());
        }
        filter.links = filter.stated(&stated.with(links.fixing, is_decided));
        let state = filter.with_constants(&start, &links.state, posture.is_some());
        node(filter.cut(&links.state, &state));
        links.alone = strapdown.alone.iter().flat_map(|alone| alone.start(&state)).collect();
        if posture.is_none() {
            links.checks.iter_mut().enumerate().for_each(|(u, check)| check.restart(state.turn_variance(u)));
        }
        links.state = state;
        links.spread_s = f64::NAN;
        true
    }

    /// Orientation of every link, room from link, in the posture that the first readings from a time on fit.
    fn posture_again(&mut self, links: &LinkState, time_s: f64) -> Option<Vec<Mat3<f64>>> {
        let end_s = time_s + self.config.start_window_s;
        let samples = links.waiting.iter().map(|w| &w.sample);
        let window: Vec<Sample> = samples.take_while(|sample| sample.time_s <= end_s).cloned().collect();
        let posture = self.fit_start(&window).ok()?;
        Some(self.orientations(&posture.belief.mean))
    }

    /// Makes the filter larger by units that speak, by source, and did not at the start.
    pub(super) fn admit(&mut self, one: &mut Hypothesis, speaks: Vec<bool>) -> Result<()> {
        let Some(links) = &mut one.links else { return Ok(()) };
        if !links.present.iter().zip(&speaks).any(|(was, is)| *is && !was) {
            return Ok(());
        }
        let old = self.strapdown_filter().clone();
        links.present.iter_mut().zip(speaks).for_each(|(was, is)| *was |= is);
        self.build_filter(&links.present)?;
        let filter = self.strapdown_filter();
        links.state = filter.admit(&old, &links.state);
        links.rivals.iter_mut().for_each(|rival| rival.state = filter.admit(&old, &rival.state));
        let earlier = |unit: &Unit| old.skeleton.units.iter().position(|o| o.source == unit.source);
        let units = || filter.skeleton.units.iter().map(earlier).enumerate();
        let alone = |(u, o): (usize, Option<usize>)| match o {
            Some(o) => links.alone[o].clone(),
            None => links.state.of_unit(u),
        };
        links.alone = units().map(alone).collect();
        links.checks = units().map(|(_, o)| o.map_or(Check::NEW, |o| links.checks[o])).collect();
        Ok(())
    }

    /// By source: whether it has whole readings of gyroscope and accelerometer in some samples, or is known to have some later; then by
    /// coordinate: whether an encoder reads it in some.
    pub(super) fn present(&self, samples: &[Sample]) -> Vec<bool> {
        let later = |s: usize| self.strapdown.as_ref().is_some_and(|links| links.speaks.get(s) == Some(&true));
        let is_read = |(s, source): (usize, &crate::sensor::Source)| {
            let inertial = || source.parts.iter().filter(|p| INERTIAL.contains(&p.quantity));
            let whole = |sample: &Sample| inertial().all(|p| sample.z[p.rows.clone()].iter().all(|z| !z.is_nan()));
            inertial().count() == 2 && (later(s) || samples.iter().any(whole))
        };
        let body = &self.subject.body;
        let rows = self.strapdown.iter().flat_map(|links| &links.encoder_rows);
        let is_encoded = |(c, row): (usize, &Option<usize>)| {
            samples.iter().any(|s| !s.inputs[c].is_nan() || row.is_some_and(|row| !s.z[row].is_nan()))
        };
        body.suite.sources.iter().enumerate().map(is_read).chain(rows.enumerate().map(is_encoded)).collect()
    }

    /// Reads from a recording which units speak at any time.
    pub(in super::super) fn listen(&mut self, recording: &Recording) {
        let sources = 0..self.subject.body.suite.sources.len();
        if let Some(strapdown) = &mut self.strapdown {
            strapdown.speaks = sources.map(|s| recording.has(s, &INERTIAL)).collect();
        }
    }

    fn blank_belief(&self, time_s: f64) -> Belief {
        let parts = self.subject.groups.parts.len();
        let body = &self.subject.body;
        Belief::new(time_s, self.unmoved(), Square::zeros(body.layout.dim()), parts)
    }

    /// The start of the filter; `None` if headings are open, the readings do not decide them, and they need not.
    fn start_state(
        &self,
        time_s: f64,
        readings: (Vec<Readings>, Vec<Heard>),
        (posture, must): (&Posture, bool),
    ) -> Option<State> {
        let filter = self.strapdown_filter();
        let is_stated = posture.is_some() || self.config.initial_q.is_some();
        let mean = posture.clone().unwrap_or_else(|| self.unmoved());
        let (start, tilts) = filter.start(time_s, (&self.orientations(&mean), is_stated), readings);
        if filter.seeks_headings(&start.means) {
            return filter.with_headings(&start, &tilts, must);
        }
        Some(start)
    }

    /// Admits the units that a recording has and an earlier run, from which it continues, had not.
    pub(in super::super) fn admit_known(&mut self, one: &mut Hypothesis) -> Result<()> {
        self.admit(one, self.present(&[]))
    }

    /// The states of the layout before any estimate: rest, or the configured posture.
    fn unmoved(&self) -> Vec<f64> {
        let body = &self.subject.body;
        let mut mean = vec![0.0; body.layout.dim()];
        for (c, axis, slots) in body.moving() {
            let asked = self.config.initial_q.as_ref().and_then(|q| q.get(c).copied());
            mean[slots.q] = asked.unwrap_or(axis.rest);
        }
        for ((_, state), length) in body.layout.lengths.iter().zip(body.lengths()) {
            mean[*state] = length;
        }
        mean
    }

    /// The posture that the first readings fit where links that encoders tell hold the body; `None`: the rest posture.
    fn start_posture(&mut self, samples: &[Sample]) -> Result<Posture> {
        // A posture that does not fit the body is refused, also where it is only a guess.
        asked_posture(self.config.initial_q.as_deref(), &self.subject.body)?;
        let links = &self.strapdown_filter().skeleton.links;
        if !links.iter().any(|link| link.pose == Pose::Driven) {
            return Ok(None);
        }
        let end_s = samples[0].time_s + self.config.start_window_s;
        let first = samples.partition_point(|sample| sample.time_s <= end_s);
        Ok(Some(self.fit_start(&samples[..first])?.belief.mean))
    }

    /// Orientation of every link in a posture, room from link.
    fn orientations(&self, mean: &[f64]) -> Vec<Mat3<f64>> {
        let body = &self.subject.body;
        let mut all: Vec<Mat3<f64>> = Vec::new();
        for link in &self.strapdown_filter().skeleton.links {
            let value = |c: Option<usize>| c.and_then(|c| body.layout.coordinates[c]).map_or(0.0, |s| mean[s.q]);
            let own = link.turns.rotation(link.turns.coordinates().map(value));
            all.push(link.parent.map_or(own, |p| all[p].times(&own)));
        }
        all
    }
}
