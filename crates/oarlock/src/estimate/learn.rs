//! Learning from the innovations how strongly the state is driven and how large innovations usually are.
//!
//! When all is well, the squared correction of a coordinate is on average the variance that the update took away
//! (covariance matching; Mehra 1972). Where corrections are larger, the driving noise was too small, and the other way
//! round. The pace is set by that share of the coordinate's variance which is fresh and which the readings tell.

/// How noise is learnt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Learning {
    /// Time over which it forgets, s; infinite learns nothing.
    pub memory_s: f64,
}

/// A single surprise counts as at most this many times the expected one: a jolt is no habit. A Gaussian exceeds it (3.7
/// standard deviations) twice in ten thousand.
const LARGEST_RATIO: f64 = 14.0;
/// Squared innovations this many times as large as expected, on average, are no chance.
const OUT_OF_PROPORTION: f64 = 3.0;
/// Range of the factor on the variance.
const RANGE: (f64, f64) = (0.1, 1e4);

/// What one update did to one driven coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// What it added.
    pub shift: f64,
    /// Variance before.
    pub before: f64,
    /// Variance after.
    pub after: f64,
    /// Variance that the driving noise had added since the last update.
    pub fresh: f64,
}

impl Learning {
    /// The factor on the driving variance behind an update `dt` seconds after the last.
    pub fn drive(&self, drive: f64, dt: f64, c: Correction) -> f64 {
        let taken = c.before - c.after;
        if !(taken > 0.0 && c.fresh > 0.0) {
            return drive;
        }
        let ratio = (c.shift * c.shift / taken).min(LARGEST_RATIO);
        let share = taken.min(c.fresh) / c.before;
        (drive * (self.rate(dt) * share * (ratio - 1.0)).exp()).clamp(RANGE.0, RANGE.1)
    }

    /// The usual size of a part's innovation, as a factor on what is expected of it, behind one more innovation.
    pub fn usual_nis(&self, usual_nis: f64, dt: f64, ratio: f64) -> f64 {
        let ratio = ratio.min(LARGEST_RATIO * usual_nis.max(1.0));
        usual_nis + self.rate(dt) * (ratio - usual_nis)
    }

    /// How much larger noise is than the model says, behind one more innovation. It sets in only where innovations are
    /// usually out of all proportion, and never says that a sensor is better than the model says.
    pub fn inflation(&self, inflation: f64, usual: f64, dt: f64, ratio: f64) -> f64 {
        if inflation == 1.0 && usual < OUT_OF_PROPORTION {
            return 1.0;
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
