//! `Rows`: regular times of the output's rows among samples that are instants.

/// Rows are not written through a silence of all sensors that is longer than this, s.
pub const PAUSE_S: f64 = 10.0;
/// A sample within this of a row's time is that row, s.
const EVEN_S: f64 = 1e-6;

/// Rows at whole multiples of their interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rows {
    rate_hz: f64,
    even_s: f64,
}

impl Rows {
    /// Rows at this rate.
    pub fn new(rate_hz: f64) -> Self {
        Rows { rate_hz, even_s: EVEN_S.min(0.25 / rate_hz) }
    }

    /// Number of the row at a time, if there is one.
    pub fn number(&self, time_s: f64) -> Option<f64> {
        let number = (time_s * self.rate_hz).round();
        ((time_s - number / self.rate_hz).abs() < self.even_s).then_some(number)
    }

    /// Number of the last row at or before a time.
    pub fn slot(&self, time_s: f64) -> f64 {
        ((time_s + self.even_s) * self.rate_hz).floor()
    }

    /// Time of the first row after `last_s` and before `next_s`, unless a sample is that row or a pause lies between them.
    pub fn between(&self, last_s: f64, next_s: f64) -> Option<f64> {
        let row_s = (self.slot(last_s) + 1.0) / self.rate_hz;
        let is_between = row_s > last_s && next_s - row_s >= self.even_s;
        (is_between && next_s - last_s <= PAUSE_S).then_some(row_s)
    }

    /// Time before which a reading belongs to the row at `row_s` or to samples before it, s.
    pub fn end_s(&self, row_s: f64) -> f64 {
        row_s + self.even_s
    }
}

#[cfg(test)]
mod tests {
    use super::Rows;

    #[test]
    fn rows_stand_where_no_sample_is() {
        let rows = Rows::new(50.0);
        assert_eq!(rows.between(0.01, 0.03), Some(0.02));
        assert_eq!(rows.between(0.01, 0.02), None, "the sample is the row");
        assert_eq!(rows.between(0.02, 0.03), None);
        assert_eq!(rows.between(0.02 - 1e-9, 0.05), Some(0.04));
        assert_eq!(rows.between(f64::NEG_INFINITY, 0.05), None);
        assert_eq!(rows.between(0.01, 20.0), None, "a pause");
        assert_eq!((rows.number(0.06 + 1e-9), rows.number(0.061)), (Some(3.0), None));
        assert_eq!(rows.number(f64::NEG_INFINITY), None);
    }
}
