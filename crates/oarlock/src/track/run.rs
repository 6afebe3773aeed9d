//! `Run`: tracks a whole recording by a loop over `Tracker::step` and stores the estimates.

mod back;
mod back_links;
mod counts;
mod packed;
mod series;

use super::hypothesis::Hypothesis;
use super::{Calibration, Status, Tracker};
use crate::body::Body;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::estimate::belief::Belief;
use crate::estimate::filter::Info;
use crate::model::{Model, Structure};
use crate::motion::{is_observed, is_turn_observed};
use crate::recording::{Cursor, Gathering, Recording, Sample, Stream};
use counts::Tally;
pub use counts::{Spell, StreamCount};
use packed::Packed;
use series::Widths;
pub use series::{Report, Series};
use std::collections::VecDeque;
use std::sync::Arc;

/// Receives the finished share (0 to 1); false stops the work.
pub type Progress<'a> = &'a mut dyn FnMut(f64) -> bool;

/// A checkpoint: state estimate and position in the recording.
#[derive(Debug, Clone)]
struct Checkpoint {
    known: Packed,
    cursor: Cursor,
    /// Number of output rows before this sample's.
    row: usize,
    is_row: bool,
}

/// A period with several hypotheses.
#[derive(Debug, Clone, Copy)]
struct Parting {
    /// Time of the split.
    from_s: f64,
    /// Time at which one hypothesis was left; infinite until then.
    to_s: f64,
    /// The last leading hypothesis.
    winner: u64,
}

/// A tracked recording.
#[derive(Debug, Clone)]
pub struct Run {
    tracker: Tracker,
    recording: Arc<Recording>,
    calibration: Calibration,
    config: Config,
    /// Estimates of every kept sample.
    pub series: Series,
    /// Whether the estimates are smoothed.
    pub smoothed: bool,
    /// Number of processed samples.
    pub steps: usize,
    /// Number of samples refused because of their time stamps.
    pub refused: usize,
    checkpoints: Vec<Checkpoint>,
    partings: Vec<Parting>,
    tally: Tally,
    /// Times of the resets, s.
    pub losses_s: Vec<f64>,
    /// Coordinates of joints that are inputs.
    inputs: Vec<usize>,
    last: Option<Hypothesis>,
}

const PROGRESS_EVERY: usize = 64;

/// Tracks `streams`, from `start` if given, otherwise from a fit of the first samples.
pub fn track(
    model: Arc<Model>,
    streams: Vec<Stream>,
    calibration: &Calibration,
    config: &Config,
    start: Option<Hypothesis>,
    progress: Progress,
) -> Result<Run> {
    let clocks = &calibration.corrections.clocks;
    let first = Tracker::new(model.clone(), calibration, config)?;
    let config = &first.settle(&streams, clocks, config)?;
    let mut tracker = Tracker::new(model.clone(), calibration, config)?;
    let body = tracker.body();
    let inputs = body.model.joints.iter().filter(|j| j.input).map(|j| j.first).collect();
    let recording = Recording::new(&body.model, &body.suite, streams, clocks, Gathering::of(config))?;
    tracker.listen(&recording);
    match start {
        Some(start) => tracker.resume(start)?,
        None => tracker.read_fixing(&recording)?,
    }
    let mut run = Run {
        recording: Arc::new(recording),
        calibration: calibration.clone(),
        config: config.clone(),
        series: Series::default(),
        smoothed: false,
        steps: 0,
        refused: 0,
        checkpoints: Vec::new(),
        partings: Vec::new(),
        tally: Tally::default(),
        losses_s: Vec::new(),
        inputs,
        last: None,
        tracker,
    };
    run.filter(progress)?;
    Ok(run)
}

impl Run {
    fn filter(&mut self, progress: Progress) -> Result<()> {
        let recording = self.recording.clone();
        let Some((begin, end)) = recording.span_s() else {
            return Err(Error::Data("the recording contains no rows: nothing to track; check the streams".into()));
        };
        let mut tracker = self.tracker.clone();
        let kept_s = tracker.belief().map_or(f64::NEG_INFINITY, |b| b.time_s);
        self.reserve((begin, end));
        let mut keeper = Keeper { run: self, cursors: VecDeque::new(), kept_s };
        let (mut cursor, mut sample) = (recording.start(), tracker.empty_sample());
        let mut count = 0;
        while recording.next(&mut cursor, &mut sample) {
            keeper.cursors.push_back(cursor.clone());
            keeper.run.tally.receive(&sample);
            let status = tracker.step_with(&sample, &mut |sample, known, info| keeper.keep(sample, known, info))?;
            if status == Status::OutOfOrder {
                keeper.cursors.pop_back();
                keeper.run.refused += 1;
            }
            count += 1;
            if count % PROGRESS_EVERY == 0 && !progress((sample.time_s - begin) / (end - begin)) {
                return Err(Error::Stopped);
            }
        }
        tracker.finish(&mut |sample, known, info| keeper.keep(sample, known, info))?;
        self.last = tracker.hypothesis().cloned();
        Ok(())
    }

    /// Memory for the rows that are expected from one time to another, s.
    fn reserve(&mut self, (begin_s, end_s): (f64, f64)) {
        let of_rate = self.config.row_rate_hz().map(|hz| (((end_s - begin_s) * hz) as usize).saturating_add(1));
        let read = self.recording.longest();
        let rows = of_rate.map_or(read, |rows| rows.min(read));
        let body = self.tracker.body();
        let (states, sources) = (body.layout.dim(), body.suite.sources.len());
        let widths = Widths { states, coordinates: body.axes.len(), inputs: self.inputs.len(), sources };
        self.series.reserve(rows, widths);
    }

    /// A run of the same recording with these estimates and only the last state estimate.
    fn with(&self, series: Series) -> Run {
        let Run { tracker, recording, calibration, config, partings, tally, losses_s, inputs, last, .. } = self;
        Run {
            tracker: tracker.clone(),
            recording: recording.clone(),
            calibration: calibration.clone(),
            config: config.clone(),
            series,
            checkpoints: Vec::new(),
            partings: partings.clone(),
            tally: tally.clone(),
            losses_s: losses_s.clone(),
            inputs: inputs.clone(),
            last: last.clone(),
            ..*self
        }
    }

    /// The run without its estimates, which `again` recomputes. The estimates of an hour fill half a gigabyte.
    pub fn hollow(&self) -> Run {
        self.with(self.series.read())
    }

    /// Filters the same recording again, with identical bits.
    pub fn again(&self, progress: Progress) -> Result<Run> {
        let mut run = self.unfiltered();
        run.filter(progress)?;
        Ok(run)
    }

    /// A run of the same recording before its first sample.
    fn unfiltered(&self) -> Run {
        let mut run = self.with(Series::default());
        (run.partings, run.losses_s, run.last) = (Vec::new(), Vec::new(), None);
        (run.steps, run.refused, run.tally) = (0, 0, Tally::default());
        run.smoothed = false;
        run
    }

    /// The tracker in its state before the first sample.
    pub fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    /// How the model is tracked.
    pub fn structure(&self) -> Structure {
        if self.tracker.strapdown.is_some() {
            Structure::Strapdown
        } else {
            Structure::Tree
        }
    }

    /// The recording.
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Readings of every stream, received, used and rejected, in the recording's order.
    pub fn counts(&self) -> Vec<StreamCount> {
        self.tally.counts(&self.tracker.subject, &self.recording)
    }

    /// State estimate after the last sample, from which a later run can continue.
    pub fn last(&self) -> Option<&Hypothesis> {
        self.last.as_ref()
    }

    /// Full state estimates, one every `belief_interval_s`.
    pub fn beliefs(&self) -> impl Iterator<Item = Belief> + '_ {
        self.checkpoints.iter().map(|c| c.known.whole().belief)
    }

    /// Writes a row's mean, standard deviations and observability. The band of a joint is not wider than its range.
    fn write_row(&mut self, row: usize, mean: &[f64], variances: impl FnOnce(&Body, &mut [f64])) {
        let (n, body) = (mean.len(), self.tracker.body());
        self.series.mean[row * n..(row + 1) * n].copy_from_slice(mean);
        let std = &mut self.series.std[row * n..(row + 1) * n];
        variances(body, std);
        let observed = &mut self.series.observed[row * body.axes.len()..];
        for (c, axis, slots) in body.moving() {
            observed[c] = u8::from(is_observed(axis, std[slots.q]));
        }
        for (c, slots) in &body.layout.turns {
            let seen = is_turn_observed(&body.axes[*c..c + 3], &std[slots.q..slots.q + 3]);
            observed[*c..c + 3].fill(u8::from(seen));
        }
        std.iter_mut().for_each(|x| *x = x.max(0.0).sqrt());
        for (_, axis, slots) in body.moving().filter(|(_, axis, _)| !axis.travels) {
            std[slots.q] = std[slots.q].min(axis.range_std());
        }
    }

    /// Coordinates of joints that are inputs, in the order of `Series::inputs`.
    pub fn input_coordinates(&self) -> &[usize] {
        &self.inputs
    }

    /// Frames whose links turn off the axes of their hinges (`Series::off_axis`).
    pub fn locked_frames(&self) -> Vec<usize> {
        let mut tracker = self.tracker.clone();
        let known = self.last.as_ref().is_some_and(|last| tracker.resume_links(last).is_ok());
        tracker.strapdown.filter(|_| known).map_or_else(Vec::new, |strapdown| strapdown.locked())
    }

    /// Calibration of the run.
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// Configuration of the run.
    pub fn config(&self) -> &Config {
        &self.config
    }
}

/// Collects the results of a run while it proceeds.
struct Keeper<'a> {
    run: &'a mut Run,
    /// Position in the recording after each sample that still waits.
    cursors: VecDeque<Cursor>,
    kept_s: f64,
}

impl Keeper<'_> {
    fn keep(&mut self, sample: &Sample, known: &Hypothesis, info: &Info) {
        let time_s = known.belief.time_s;
        let own = self.cursors.pop_front().expect("one for each sample");
        // Strapdown links have taken in all samples that were read, also those that wait.
        let cursor = self.cursors.back().filter(|_| known.links.is_some()).cloned().unwrap_or(own);
        let run = &mut *self.run;
        run.steps += 1;
        run.note_partings(known);
        run.losses_s.extend(info.lost.then_some(time_s));
        let Run { tally, tracker, .. } = run;
        tally.judge(&tracker.subject, (time_s, info), tracker.fields(info).zip(tracker.source_faults(info)));
        // Decided by the time stamp alone, so that a run in two parts keeps the same rows.
        let is_row = Gathering::of(&run.config).is_row(self.kept_s, time_s);
        let row = run.series.time_s.len();
        let due = run.checkpoints.last().is_none_or(|c| {
            // A whole number of intervals up to rounding counts as reached. What is learnt from the time before a sample
            // without readings is no part of its state estimate.
            !info.nis.is_nan() && time_s - c.known.time_s() >= run.config.belief_interval_s * (1.0 - 1e-9)
        });
        if due {
            run.checkpoints.push(Checkpoint { known: Packed::of(known), cursor, row, is_row });
        }
        if is_row {
            self.kept_s = time_s;
            run.grow(sample, info);
            run.series.off_axis.extend(known.links.iter().flat_map(|links| links.off_axis.iter().flatten()));
            run.write_row(row, &known.belief.mean, |body, variance| known.variances(body, variance));
        }
    }
}

impl Run {
    fn note_partings(&mut self, known: &Hypothesis) {
        let (time_s, several) = (known.belief.time_s, !known.rivals.is_empty());
        match self.partings.last_mut().filter(|p| p.to_s.is_infinite()) {
            Some(now) => {
                now.winner = known.line;
                now.to_s = if several { f64::INFINITY } else { time_s };
            }
            None if several => {
                self.partings.push(Parting { from_s: time_s, to_s: f64::INFINITY, winner: known.line });
            }
            None => {}
        }
    }

    /// The final hypothesis of a split, alone.
    fn proven(&self, known: &Hypothesis) -> Hypothesis {
        let parting = self.partings.iter().rfind(|p| p.from_s <= known.belief.time_s);
        known.alone(parting.map_or(known.line, |p| p.winner))
    }

    fn grow(&mut self, sample: &Sample, info: &Info) {
        let (n, rest, s) = (self.tracker.body().layout.dim(), &self.tracker.body().axes, &mut self.series);
        s.time_s.push(sample.time_s);
        s.mean.resize(s.mean.len() + n, 0.0);
        s.std.resize(s.std.len() + n, 0.0);
        let is_input = |c: usize| self.inputs.contains(&c);
        let read = sample.inputs.iter().enumerate().map(|(c, x)| u8::from(is_input(c) && !x.is_nan()));
        s.observed.extend(read);
        Arc::make_mut(&mut s.inputs).extend(self.inputs.iter().map(|&c| {
            let read = sample.inputs[c];
            if read.is_nan() {
                rest[c].rest
            } else {
                read
            }
        }));
        s.report(info, self.tracker.fields(info).zip(self.tracker.source_faults(info)));
    }
}
