//! `Feed`: readings as they arrive, one sensor at a time and not always in order, as samples that are complete.

use super::gathering::{Cursor, Gathering, Heads};
use super::Sample;
use std::collections::VecDeque;
use std::ops::Range;

/// One reading of a stream.
#[derive(Debug, Clone, PartialEq)]
struct Reading {
    true_s: f64,
    values: Vec<f64>,
}

/// Readings of one stream in the order of their true times. Rows are counted from the first ever received.
#[derive(Debug, Clone, Default)]
struct Queue {
    readings: VecDeque<Reading>,
    /// Rows before the first one that is kept.
    dropped: usize,
}

/// Where a reading belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The rows of a source.
    Source(usize),
    /// The coordinate of an input joint.
    Input(usize),
}

/// Readings that wait to become samples.
#[derive(Debug, Clone)]
pub struct Feed {
    gathering: Gathering,
    rows: Vec<Range<usize>>,
    queues: Vec<Queue>,
    /// Newest true time received, s.
    newest_s: f64,
}

impl Feed {
    /// An empty feed for sources with these rows and for `coordinates` coordinates.
    pub fn new(gathering: Gathering, rows: Vec<Range<usize>>, coordinates: usize) -> Self {
        let queues = vec![Queue::default(); rows.len() + coordinates];
        Feed { gathering, rows, queues, newest_s: f64::NEG_INFINITY }
    }

    /// The position before the first reading.
    pub fn start(&self) -> Cursor {
        Cursor::new(self.queues.len())
    }

    /// Adds the readings that `sample` has at `place`; false if that stream has a reading of the same time.
    pub fn add(&mut self, place: Place, true_s: f64, sample: &Sample) -> bool {
        let (stream, values) = match place {
            Place::Source(source) => (source, sample.z[self.rows[source].clone()].to_vec()),
            Place::Input(coordinate) => (self.rows.len() + coordinate, vec![sample.inputs[coordinate]]),
        };
        let queue = &mut self.queues[stream];
        let at = queue.readings.partition_point(|r| r.true_s < true_s);
        if queue.readings.get(at).is_some_and(|r| r.true_s == true_s) {
            return false;
        }
        queue.readings.insert(at, Reading { true_s, values });
        self.newest_s = self.newest_s.max(true_s);
        true
    }

    /// Whether a reading belongs to the samples that were read already.
    pub fn is_past(&self, cursor: &Cursor, true_s: f64) -> bool {
        self.gathering.is_past(cursor, true_s)
    }

    /// Reads the next sample if nothing that comes within `wait_s` can still belong to it.
    pub fn next(&self, wait_s: f64, cursor: &mut Cursor, sample: &mut Sample) -> bool {
        let is_due = |complete_s: f64| self.newest_s >= complete_s + wait_s;
        self.gathering.complete_s(self, cursor).is_some_and(is_due) && self.gathering.next(self, cursor, sample)
    }

    /// Forgets all readings before a position.
    pub fn forget(&mut self, before: &Cursor) {
        for (queue, &row) in self.queues.iter_mut().zip(&before.rows) {
            let count = row.saturating_sub(queue.dropped);
            queue.readings.drain(..count);
            queue.dropped += count;
        }
    }

    /// Number of readings behind a position.
    pub fn waiting(&self, cursor: &Cursor) -> usize {
        let behind = |(queue, row): (&Queue, &usize)| (queue.dropped + queue.readings.len()).saturating_sub(*row);
        self.queues.iter().zip(&cursor.rows).map(behind).sum()
    }
}

impl Heads for Feed {
    fn count(&self) -> usize {
        self.queues.len()
    }

    fn true_s(&self, stream: usize, row: usize) -> Option<f64> {
        let queue = &self.queues[stream];
        queue.readings.get(row.checked_sub(queue.dropped)?).map(|r| r.true_s)
    }

    fn source(&self, stream: usize) -> Option<usize> {
        (stream < self.rows.len()).then_some(stream)
    }

    fn put(&self, stream: usize, row: usize, sample: &mut Sample) {
        let queue = &self.queues[stream];
        let values = &queue.readings[row - queue.dropped].values;
        match self.source(stream) {
            Some(source) => sample.z[self.rows[source].clone()].copy_from_slice(values),
            None => sample.inputs[stream - self.rows.len()] = values[0],
        }
    }
}
