//! `Arrivals`: readings of single sensors as they arrive, late and unordered, brought into order for a tracker.
//!
//! A sample is made when the newest reading is `wait_s` younger than its end. A reading that comes later still is used if the
//! state estimate of a time before it is kept: the tracker goes back and takes all samples since again, so that it is where it
//! would be had the reading come in time. The samples are taken again when the next reading comes that is not late, so that many
//! late ones in a row cost as much as one. Estimates that were given stay as they were given.

use super::hypothesis::Hypothesis;
use super::{Sink, Tracker};
use crate::error::{Error, Result};
use crate::recording::feed::{Feed, Place};
use crate::recording::{Cursor, Gathering, Sample};
use std::collections::VecDeque;

/// Time for which state estimates are kept, and the interval between them, s.
const KEPT_S: f64 = 0.5;
const KEEP_EVERY_S: f64 = 0.05;

/// How readings arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// All readings.
    pub received: usize,
    /// Readings that came after their sample, and were used by going back.
    pub late: usize,
    /// Readings that came after their sample and could not be used.
    pub too_late: usize,
    /// Readings with the time stamp of another one of the same sensor.
    pub repeated: usize,
}

/// A state estimate to which the tracker can go back.
#[derive(Debug, Clone)]
struct Kept {
    known: Hypothesis,
    cursor: Cursor,
}

/// Readings on their way to a tracker.
#[derive(Debug, Clone)]
pub struct Arrivals {
    feed: Feed,
    /// Behind the samples of the newest kept state estimate, while `ahead` is set.
    cursor: Cursor,
    /// Behind the samples that were read once; set from the first of some late readings until their samples are taken again.
    ahead: Option<Cursor>,
    wait_s: f64,
    /// Oldest first.
    kept: VecDeque<Kept>,
    sample: Sample,
    /// Time of the last sample, and of the last estimate that was given, s.
    last_s: f64,
    given_s: f64,
    counts: Counts,
}

impl Arrivals {
    /// No readings yet, for a tracker.
    pub fn new(tracker: &Tracker) -> Self {
        let (body, config) = (&tracker.subject.body, &tracker.config);
        let rows = body.suite.sources.iter().map(|s| s.rows.clone()).collect();
        let feed = Feed::new(Gathering::of(config), rows, body.model.coordinate_count());
        let (cursor, sample) = (feed.start(), tracker.empty_sample());
        let (kept, counts, last_s) = (VecDeque::new(), Counts::default(), f64::NEG_INFINITY);
        Arrivals { feed, cursor, ahead: None, wait_s: config.wait_s, kept, sample, last_s, given_s: last_s, counts }
    }

    /// How readings arrived so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Number of readings that wait for others.
    pub fn waiting(&self) -> usize {
        self.feed.waiting(self.reached())
    }

    /// Takes the readings that `reading` has at `place`, and gives `sink` what the tracker estimates from the samples that are
    /// complete now.
    pub fn take(&mut self, tracker: &mut Tracker, place: Place, reading: &Sample, sink: Sink) -> Result<()> {
        tracker.check(reading)?;
        let true_s = reading.time_s;
        if !true_s.is_finite() {
            return Err(Error::Data(format!("reading at {true_s} s: expected a finite time stamp, s")));
        }
        self.counts.received += 1;
        let is_late = self.feed.is_past(self.reached(), true_s);
        let is_past = is_late && self.feed.is_past(&self.cursor, true_s);
        let back = if is_past { self.kept.iter().rposition(|kept| kept.is_before(&self.feed, true_s)) } else { None };
        if is_past && back.is_none() {
            self.counts.too_late += 1;
            return Ok(());
        }
        if !self.feed.add(place, true_s, reading) {
            self.counts.repeated += 1;
            return Ok(());
        }
        if let Some(back) = back {
            self.go_back(back);
        }
        if is_late {
            self.counts.late += 1;
            return Ok(());
        }
        self.catch_up(tracker, sink)?;
        self.go_on(tracker, self.wait_s, sink)
    }

    /// Takes all that still waits, at the end of a recording.
    pub fn finish(&mut self, tracker: &mut Tracker, sink: Sink) -> Result<()> {
        self.catch_up(tracker, sink)?;
        self.go_on(tracker, f64::NEG_INFINITY, sink)?;
        tracker.finish(sink)
    }

    /// The position behind all samples that were read.
    fn reached(&self) -> &Cursor {
        self.ahead.as_ref().unwrap_or(&self.cursor)
    }

    /// Makes a kept state estimate the newest one.
    fn go_back(&mut self, back: usize) {
        self.kept.truncate(back + 1);
        let read = std::mem::replace(&mut self.cursor, self.kept[back].cursor.clone());
        self.ahead.get_or_insert(read);
    }

    /// Takes the samples since the newest kept state estimate again, if late readings belong to them; `sink` receives estimates that waited.
    fn catch_up(&mut self, tracker: &mut Tracker, sink: Sink) -> Result<()> {
        let (Some(_), Some(kept)) = (self.ahead.take(), self.kept.back()) else { return Ok(()) };
        tracker.resume(kept.known.clone())?;
        loop {
            let mut cursor = self.cursor.clone();
            if !self.feed.next(f64::NEG_INFINITY, &mut cursor, &mut self.sample) || self.sample.time_s > self.last_s {
                return Ok(());
            }
            self.cursor = cursor;
            self.step(tracker, sink)?;
        }
    }

    fn go_on(&mut self, tracker: &mut Tracker, wait_s: f64, sink: Sink) -> Result<()> {
        while self.feed.next(wait_s, &mut self.cursor, &mut self.sample) {
            self.step(tracker, sink)?;
            self.last_s = self.sample.time_s;
        }
        Ok(())
    }

    /// Takes the sample; `sink` receives the estimates that were not given before.
    fn step(&mut self, tracker: &mut Tracker, sink: Sink) -> Result<()> {
        let given_s = &mut self.given_s;
        tracker.step_with(&self.sample, &mut |sample, known, info| {
            if known.belief.time_s > *given_s {
                *given_s = known.belief.time_s;
                sink(sample, known, info);
            }
        })?;
        self.keep(tracker);
        Ok(())
    }

    /// Keeps the state estimate now and then, and forgets what is too old.
    fn keep(&mut self, tracker: &Tracker) {
        // What is learnt from the time before a sample without readings is no part of its state estimate.
        let Some(known) = tracker.hypothesis().filter(|_| !tracker.info().nis.is_nan()) else { return };
        let time_s = known.belief.time_s;
        if self.kept.back().is_some_and(|kept| time_s - kept.known.belief.time_s < KEEP_EVERY_S) {
            return;
        }
        let mut now = match self.kept.front() {
            Some(oldest) if time_s - oldest.known.belief.time_s > KEPT_S => self.kept.pop_front(),
            _ => None,
        };
        match &mut now {
            Some(now) => {
                now.known.clone_from(known);
                now.cursor.clone_from(&self.cursor);
            }
            None => now = Some(Kept { known: known.clone(), cursor: self.cursor.clone() }),
        }
        self.kept.extend(now);
        if let Some(oldest) = self.kept.front() {
            self.feed.forget(&oldest.cursor);
        }
    }
}

impl Kept {
    /// Whether a reading belongs to samples after this state estimate.
    fn is_before(&self, feed: &Feed, true_s: f64) -> bool {
        !feed.is_past(&self.cursor, true_s)
    }
}
