//! How readings with time stamps of their own become samples: for whole recordings and for readings as they arrive.

use super::rows::Rows;
use super::ticks::Ticks;
use super::Sample;
use crate::config::Config;

/// How readings are gathered into samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Gathering {
    /// All readings whose time stamps differ by less than `merge_s`, at the first of these stamps.
    Instants {
        /// s.
        merge_s: f64,
        /// Rows of the output, each a sample without readings where no instant is; `None`: every instant is a row.
        rows: Option<Rows>,
    },
    /// At regular times; each reading keeps its offset from them.
    Ticks(Ticks),
}

/// Position in the readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Cursor {
    /// The next row of every stream.
    pub(super) rows: Vec<usize>,
    /// With instants: time of the last sample, and time before which all readings were taken, s.
    sample_s: f64,
    taken_s: f64,
    /// With ticks: the slot of every stream's last reading, and that of the last sample.
    slots: Vec<i64>,
    slot: Option<i64>,
}

impl Cursor {
    /// Before the first row of `count` streams.
    pub fn new(count: usize) -> Self {
        let (sample_s, taken_s) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        Cursor { rows: vec![0; count], sample_s, taken_s, slots: vec![i64::MIN; count], slot: None }
    }

    /// Number of readings before this position.
    pub fn taken(&self) -> usize {
        self.rows.iter().sum()
    }
}

/// Readings of several streams, each in the order of its time stamps.
pub trait Heads {
    /// Number of streams.
    fn count(&self) -> usize;
    /// True time of a row, s; `None` behind the last.
    fn true_s(&self, stream: usize, row: usize) -> Option<f64>;
    /// The source that a stream belongs to; `None` for an input.
    fn source(&self, stream: usize) -> Option<usize>;
    /// Copies a row into the sample.
    fn put(&self, stream: usize, row: usize, sample: &mut Sample);
}

impl Gathering {
    /// As the configuration says. What is to be found from time stamps must be found before.
    pub fn of(config: &Config) -> Self {
        match config.sample_rate_hz.filter(|hz| *hz > 0.0) {
            Some(rate_hz) => Gathering::Ticks(Ticks::new(rate_hz, config.row_rate_hz())),
            None => Gathering::Instants { merge_s: config.merge_s, rows: config.row_rate_hz().map(Rows::new) },
        }
    }

    /// Reads the next sample; false at the end. Allocates nothing.
    pub fn next(&self, heads: &impl Heads, cursor: &mut Cursor, sample: &mut Sample) -> bool {
        sample.clear();
        match *self {
            Gathering::Instants { merge_s, rows } => next_instant(merge_s, rows, heads, cursor, sample),
            Gathering::Ticks(ticks) => next_tick(ticks, heads, cursor, sample),
        }
    }

    /// Time up to which all readings must be known before the next sample is complete, s; `None` at the end.
    pub fn complete_s(&self, heads: &impl Heads, cursor: &Cursor) -> Option<f64> {
        match *self {
            Gathering::Instants { merge_s, rows } => {
                let first_s = first_s(heads, cursor)?;
                let row_end_s = |rows: Rows| Some(rows.end_s(rows.between(cursor.sample_s, first_s)?));
                Some(rows.and_then(row_end_s).unwrap_or(first_s + merge_s))
            }
            Gathering::Ticks(ticks) => Some(ticks.end_s(next_slot(ticks, heads, cursor)?)),
        }
    }

    /// Whether a reading belongs to the samples that were read already.
    pub fn is_past(&self, cursor: &Cursor, true_s: f64) -> bool {
        match *self {
            Gathering::Instants { .. } => true_s < cursor.taken_s,
            Gathering::Ticks(ticks) => cursor.slot.is_some_and(|slot| ticks.slot(true_s) <= slot),
        }
    }

    /// Whether a sample at `time_s` is a row of the output; `last_s`: time of the last row.
    pub fn is_row(&self, last_s: f64, time_s: f64) -> bool {
        match *self {
            Gathering::Instants { rows: None, .. } => true,
            Gathering::Instants { rows: Some(rows), .. } => {
                let number = rows.number(time_s);
                number.is_some() && number != rows.number(last_s)
            }
            Gathering::Ticks(ticks) => ticks.is_row(ticks.nearest(time_s)),
        }
    }
}

fn first_s(heads: &impl Heads, cursor: &Cursor) -> Option<f64> {
    (0..heads.count()).filter_map(|i| heads.true_s(i, cursor.rows[i])).reduce(f64::min)
}

/// All rows within `merge_s` of the earliest; none if a row of the output comes before it.
fn next_instant(
    merge_s: f64,
    rows: Option<Rows>,
    heads: &impl Heads,
    cursor: &mut Cursor,
    sample: &mut Sample,
) -> bool {
    let Some(time_s) = first_s(heads, cursor) else {
        return false;
    };
    let row = rows.and_then(|rows| Some((rows, rows.between(cursor.sample_s, time_s)?)));
    if let Some((rows, row_s)) = row {
        sample.time_s = row_s;
        (cursor.sample_s, cursor.taken_s) = (row_s, cursor.taken_s.max(rows.end_s(row_s)));
        return true;
    }
    sample.time_s = time_s;
    (cursor.sample_s, cursor.taken_s) = (time_s, time_s + merge_s);
    for i in 0..heads.count() {
        if heads.true_s(i, cursor.rows[i]).is_some_and(|t| t - time_s < merge_s) {
            heads.put(i, cursor.rows[i], sample);
            cursor.rows[i] += 1;
        }
    }
    true
}

/// The slot of a stream's next row: that of the nearest tick, or the next one if its last reading has that.
fn slot_of(ticks: Ticks, heads: &impl Heads, cursor: &Cursor, stream: usize) -> Option<i64> {
    let true_s = heads.true_s(stream, cursor.rows[stream])?;
    Some(ticks.slot(true_s).max(cursor.slots[stream].saturating_add(1)))
}

/// The earliest slot with a reading, or the row of the output that comes before it.
fn next_slot(ticks: Ticks, heads: &impl Heads, cursor: &Cursor) -> Option<i64> {
    let first = (0..heads.count()).filter_map(|i| slot_of(ticks, heads, cursor, i)).min()?;
    Some(cursor.slot.and_then(|last| ticks.row_between(last, first)).unwrap_or(first))
}

/// All rows of the next slot; none if that is only a row of the output.
fn next_tick(ticks: Ticks, heads: &impl Heads, cursor: &mut Cursor, sample: &mut Sample) -> bool {
    let Some(slot) = next_slot(ticks, heads, cursor) else {
        return false;
    };
    sample.time_s = ticks.time_s(slot);
    cursor.slot = Some(slot);
    for i in 0..heads.count() {
        if slot_of(ticks, heads, cursor, i) != Some(slot) {
            continue;
        }
        if let (Some(source), Some(true_s)) = (heads.source(i), heads.true_s(i, cursor.rows[i])) {
            sample.offset_s[source] = true_s - sample.time_s;
        }
        heads.put(i, cursor.rows[i], sample);
        cursor.slots[i] = slot;
        cursor.rows[i] += 1;
    }
    true
}
