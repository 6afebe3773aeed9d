//! Learning of noise from innovations, for the filter: process noise, measurement noise and the usual size of innovations.
//!
//! In a consistent filter the squared correction of a coordinate is on average the variance that the update removed (covariance matching;
//! Mehra 1972). Larger corrections mean that the process noise was too small. The pace is set by the share of the variance that is new since
//! the last update and observed by the readings.

/// Settings of the learning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learning {
    /// Time constant, s; infinite learns nothing.
    pub memory_s: f64,
}

/// Largest ratio of a squared innovation to its expectation that counts: one jolt must not teach much. A Gaussian exceeds it (3.7 standard
/// deviations) twice in ten thousand.
const LARGEST_RATIO: f64 = 14.0;
/// Mean squared innovations this many times as large as expected are not chance.
const OUT_OF_PROPORTION: f64 = 3.0;
/// Range of the factor on the variance.
const RANGE: (f64, f64) = (0.1, 1e4);

/// Correction of one driven coordinate by one update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// Change of the mean.
    pub shift: f64,
    /// Variance before.
    pub before: f64,
    /// Variance after.
    pub after: f64,
    /// Variance added by process noise since the last update.
    pub fresh: f64,
}

impl Learning {
    /// New factor on the process noise, after an update `dt` seconds after the last.
    pub fn drive(&self, drive: f64, dt: f64, c: Correction) -> f64 {
        let taken = c.before - c.after;
        if !(taken > 0.0 && c.fresh > 0.0) {
            return drive;
        }
        let ratio = (c.shift * c.shift / taken).min(LARGEST_RATIO);
        let share = taken.min(c.fresh) / c.before;
        (drive * (self.rate(dt) * share * (ratio - 1.0)).exp()).clamp(RANGE.0, RANGE.1)
    }

    /// New usual NIS of a part, per row, after one more innovation with this ratio of NIS to rows.
    pub fn usual_nis(&self, usual_nis: f64, dt: f64, ratio: f64) -> f64 {
        let ratio = ratio.min(LARGEST_RATIO * usual_nis.max(1.0));
        usual_nis + self.rate(dt) * (ratio - usual_nis)
    }

    /// New factor on the measurement noise, after one more innovation. It rises only where innovations are usually far too large, and is never
    /// below 1.
    pub fn inflation(&self, inflation: f64, usual: f64, dt: f64, ratio: f64) -> f64 {
        if inflation == 1.0 && usual < OUT_OF_PROPORTION {
            return inflation;
        }
        (inflation * (self.rate(dt) * (ratio.min(LARGEST_RATIO) - 1.0)).exp()).clamp(1.0, RANGE.1)
    }

    fn rate(&self, dt: f64) -> f64 {
        (dt / self.memory_s).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drive_settles_where_corrections_are_as_large_as_expected() {
        let learning = Learning { memory_s: 1.0 };
        let (truth, mut drive) = (4.0, 1.0);
        for _ in 0..5_000 {
            let c = Correction { shift: f64::sqrt(truth), before: drive, after: 0.0, fresh: drive };
            drive = learning.drive(drive, 0.01, c);
        }
        assert!((drive / truth - 1.0).abs() < 1e-6, "{drive}");
    }

    #[test]
    fn what_nothing_measures_teaches_nothing() {
        let c = Correction { shift: 0.0, before: 1.0, after: 1.0, fresh: 0.5 };
        assert_eq!(Learning { memory_s: 1.0 }.drive(3.0, 0.1, c), 3.0);
    }

    #[test]
    fn without_end_to_its_memory_it_learns_nothing() {
        let c = Correction { shift: 3.0, before: 1.0, after: 0.5, fresh: 0.5 };
        assert_eq!(Learning { memory_s: f64::INFINITY }.drive(3.0, 0.1, c), 3.0);
    }
}
