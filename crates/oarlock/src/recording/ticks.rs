//! `Ticks`: regular times at which readings of sensors that do not tick together are gathered into samples.

use super::rows::PAUSE_S;

/// Regular times of samples. Between two ticks lies one more slot, for a stream whose reading's slot is taken by the
/// reading before it: jitter, or a clock that is a little faster.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ticks {
    /// Ticks per second.
    pub rate_hz: f64,
    /// Slots from one row of the output to the next; 0: every sample is a row.
    row_slots: i64,
}

impl Ticks {
    /// Ticks at `rate_hz`, with rows of the output at `row_rate_hz`, which divides it.
    pub fn new(rate_hz: f64, row_rate_hz: Option<f64>) -> Self {
        let row_slots = row_rate_hz.map_or(0.0, |rate| 2.0 * (rate_hz / rate).round());
        Ticks { rate_hz, row_slots: row_slots as i64 }
    }

    /// The slot of the tick nearest to a time.
    pub fn slot(&self, time_s: f64) -> i64 {
        (2.0 * (time_s * self.rate_hz).round()) as i64
    }

    /// Time of a slot, s.
    pub fn time_s(&self, slot: i64) -> f64 {
        slot as f64 / (2.0 * self.rate_hz)
    }

    /// Time before which all readings of a slot were taken, unless they have moved on from the slot before, s.
    pub fn end_s(&self, slot: i64) -> f64 {
        (slot.div_euclid(2) as f64 + 0.5) / self.rate_hz
    }

    /// The slot at a sample's time.
    pub fn nearest(&self, time_s: f64) -> i64 {
        (2.0 * time_s * self.rate_hz).round() as i64
    }

    /// Whether a slot is a row of the output.
    pub fn is_row(&self, slot: i64) -> bool {
        self.row_slots == 0 || slot % self.row_slots == 0
    }

    /// The first row of the output after `last` and before `next`, unless a pause lies between them.
    pub fn row_between(&self, last: i64, next: i64) -> Option<i64> {
        if self.row_slots == 0 || next.saturating_sub(last) as f64 > PAUSE_S * 2.0 * self.rate_hz {
            return None;
        }
        let row = (last.div_euclid(self.row_slots) + 1).saturating_mul(self.row_slots);
        (row < next).then_some(row)
    }
}
