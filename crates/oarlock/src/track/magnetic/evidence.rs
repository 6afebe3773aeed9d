//! Evidence on why a field deviates: it is bent at this unit, or the estimated posture is wrong. For `magnetic`.
//!
//! Iron changes the norm too, and a unit that passes iron sees the dip change within a second. A posture drifts slowly and changes no
//! norm. A field with the right norm whose dip has come slowly to where it is contradicts the posture, so it is used: otherwise the test
//! against the estimate would keep a wrong estimate wrong.

use super::{alike, PATIENCE_S};

/// Time constant of the current norm and dip (as in VQF: Laidig and Seel 2023), s.
const CURRENT_S: f64 = 0.05;
/// Time constant of the norm that shows iron nearby, s, and how long it is remembered, s.
const STEADY_S: f64 = 0.3;
const NEARBY_S: f64 = 3.0;
/// A norm that deviates by more than this share shows iron nearby.
const NEARBY: f64 = 0.075;
/// Time constant of the usual norm and dip and of the scatter of readings, s.
const USUAL_S: f64 = 5.0;
/// Time before the usual values are valid, s.
const AFTER_S: f64 = 5.0;
/// A single reading may deviate by this multiple of the usual scatter.
const SCATTERS: f64 = 3.0;
/// The dip is back below this share of the tolerance.
const BACK: f64 = 0.5;

/// A low-passed deviation, and the mean square of single readings about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::track) struct Deviation {
    pub now: f64,
    pub scatter: f64,
}

/// Memory of a magnetometer's deviations from the expected field; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::track) struct FieldState {
    /// Time of the last reading and interval before it, s.
    pub came_s: f64,
    pub interval_s: f64,
    /// Duration of all readings, s.
    pub age_s: f64,
    /// Relative deviation of the norm: currently, over some tenths of a second, its largest of late, and its usual one.
    pub norm: Deviation,
    pub steady: f64,
    pub nearby: f64,
    pub usual_norm: f64,
    /// Age at the last reset of the state estimate, or at the first norm, s.
    pub dip_from_s: f64,
    /// Deviation of the dip, rad: currently, and its usual one; since when it is far from that, s.
    pub dip: Deviation,
    pub usual_dip: f64,
    pub since_s: f64,
}

impl Deviation {
    const NONE: Deviation = Deviation { now: f64::NAN, scatter: f64::NAN };

    /// Adds a reading after `dt` seconds; the larger of its deviation, as far as noise is not larger, and the low-passed one, as far as noise
    /// may hide that it has ended.
    fn follow(&mut self, reading: f64, tolerance: f64, (dt, age_s): (f64, f64)) -> f64 {
        if self.now.is_nan() {
            *self = Deviation { now: reading, scatter: 0.0 };
        }
        self.now += share(dt, CURRENT_S) * (reading - self.now);
        let single = reading.abs() * (tolerance / self.single(tolerance));
        let square = (reading - self.now).powi(2).min(tolerance * tolerance);
        self.scatter += share(dt, USUAL_S.min(age_s)) * (square - self.scatter);
        let at_most = reading.abs() + SCATTERS * self.scatter.sqrt();
        self.now.abs().min(at_most).max(single)
    }

    /// Tolerance of a single reading.
    fn single(&self, tolerance: f64) -> f64 {
        tolerance.max(SCATTERS * self.scatter.sqrt())
    }
}

/// Share of a new value in a low-passed one.
fn share(dt: f64, constant_s: f64) -> f64 {
    if dt > 0.0 {
        1.0 - (-dt / constant_s.max(dt)).exp()
    } else {
        0.0
    }
}

impl FieldState {
    pub const NONE: FieldState = FieldState {
        came_s: f64::NAN,
        interval_s: f64::NAN,
        age_s: f64::NAN,
        norm: Deviation::NONE,
        steady: f64::NAN,
        nearby: f64::NAN,
        usual_norm: f64::NAN,
        dip_from_s: f64::NAN,
        dip: Deviation::NONE,
        usual_dip: f64::NAN,
        since_s: f64::NAN,
    };

    /// Adds the relative deviation of a norm, with and without what all units have in common; true if it is beyond the tolerance.
    pub fn follow_norm(&mut self, [norm, raw]: [f64; 2], time_s: f64, tolerance: f64) -> bool {
        if self.came_s.is_nan() {
            let own = FieldState { age_s: 0.0, dip_from_s: 0.0, steady: norm, nearby: 0.0, usual_norm: raw, ..*self };
            *self = FieldState { came_s: time_s, ..own };
        }
        self.interval_s = (time_s - self.came_s).clamp(0.0, 1.0);
        self.came_s = time_s;
        self.age_s += self.interval_s;
        let (dt, age_s) = (self.interval_s, self.age_s);
        self.steady += share(dt, STEADY_S) * (norm - self.steady);
        self.nearby = self.steady.abs().max(self.nearby * (-dt / NEARBY_S).exp());
        self.usual_norm += share(dt, USUAL_S.min(age_s)) * (raw - self.usual_norm);
        self.norm.follow(norm, tolerance, (dt, age_s)) > tolerance
    }

    /// Adds the deviation of a dip, rad. The result is the deviation to be tested: zero where it contradicts the posture.
    pub fn follow_dip(&mut self, dip: f64, tolerance: f64) -> f64 {
        let (time_s, dt, age_s) = (self.came_s, self.interval_s, self.dip_age_s());
        let deviation = self.dip.follow(dip, tolerance, (dt, age_s));
        if self.usual_dip.is_nan() {
            self.usual_dip = dip;
        }
        let away = self.dip.now - self.usual_dip;
        let jumps = away.abs() > tolerance || (dip - self.usual_dip).abs() > self.dip.single(tolerance);
        if self.since_s.is_nan() && jumps && age_s > AFTER_S {
            self.since_s = time_s;
        } else if self.since_s.is_nan() {
            self.usual_dip += share(dt, USUAL_S.min(age_s)) * away;
        } else if away.abs() < BACK * tolerance {
            self.since_s = f64::NAN;
        } else if time_s - self.since_s > PATIENCE_S {
            // No disturbance in passing lasts as long.
            (self.usual_dip, self.since_s) = (self.dip.now, f64::NAN);
        }
        if self.contradicts_posture() {
            0.0
        } else {
            deviation
        }
    }

    fn dip_age_s(&self) -> f64 {
        self.age_s - self.dip_from_s
    }

    /// Whether a deviating dip can only come from the posture: the norm is right, and the dip has not changed quickly.
    fn contradicts_posture(&self) -> bool {
        self.dip_age_s() > AFTER_S && self.since_s.is_nan() && self.nearby < NEARBY
    }

    /// Standard deviation of a reading's error by iron nearby, as a share of the norm. Iron that changes the norm changes the field across it as
    /// much. Its error lasts, and the filter takes errors of readings as independent.
    pub fn bent_share(&self) -> f64 {
        let square = self.nearby * self.nearby - NEARBY * NEARBY;
        if square > 0.0 && self.interval_s > 0.0 {
            (square * alike(self.interval_s)).sqrt()
        } else {
            0.0
        }
    }

    /// The usual deviation of the norm, once it is known.
    pub fn known_norm(&self) -> Option<f64> {
        (self.age_s > AFTER_S).then_some(self.usual_norm)
    }

    /// After a reset of the state estimate. The norm does not depend on it.
    pub fn forget_dip(&mut self) {
        (self.dip, self.usual_dip, self.since_s, self.dip_from_s) = (Deviation::NONE, f64::NAN, f64::NAN, self.age_s);
    }

    pub(in crate::track) fn numbers(&mut self) -> [&mut f64; 13] {
        let FieldState { came_s, interval_s, age_s, norm, steady, nearby, usual_norm, .. } = self;
        let FieldState { dip_from_s, dip, usual_dip, since_s, .. } = self;
        [
            came_s,
            interval_s,
            age_s,
            &mut norm.now,
            &mut norm.scatter,
            steady,
            nearby,
            usual_norm,
            dip_from_s,
            &mut dip.now,
            &mut dip.scatter,
            usual_dip,
            since_s,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.01;
    const TOLERANCE: f64 = 0.175;

    /// When a field with these deviations of norm and dip (rad) is called bent, over a minute.
    fn bent(norm: impl Fn(f64) -> f64, dip: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut state = FieldState::NONE;
        let mut when = Vec::new();
        for k in 0..6000 {
            let t = STEP_S * f64::from(k);
            state.follow_norm([norm(t); 2], t, 0.15);
            if state.follow_dip(dip(t), TOLERANCE) > TOLERANCE {
                when.push(t);
            }
        }
        when
    }

    #[test]
    fn a_dip_that_drifts_with_the_right_norm_contradicts_the_posture() {
        assert!(bent(|_| 0.0, |t| 0.01 * t).is_empty());
    }

    #[test]
    fn a_dip_that_drifts_beside_iron_is_that_of_a_bent_field() {
        let when = bent(|_| 0.1, |t| 0.01 * t);
        assert!(when[0] > 17.0 && when[0] < 18.0, "{}", when[0]);
        assert!(when.last().unwrap() > &59.0);
    }

    #[test]
    fn a_dip_that_jumps_is_bent_until_the_patience_ends() {
        let when = bent(|_| 0.0, |t| if t > 30.0 { 0.4 } else { 0.0 });
        assert!((when[0] - 30.0).abs() < 0.02, "{}", when[0]);
        assert!((when.last().unwrap() - 40.0).abs() < 0.1, "{:?}", when.last());
    }

    #[test]
    fn a_reset_forgets_the_dip_and_keeps_the_norm() {
        let mut state = FieldState::NONE;
        let add = |state: &mut FieldState, k: i32| {
            state.follow_norm([0.06; 2], STEP_S * f64::from(k), 0.15);
            state.follow_dip(0.3, TOLERANCE)
        };
        let contradicts = (0..1000).map(|k| add(&mut state, k)).last() == Some(0.0);
        state.forget_dip();
        let known = state.known_norm().unwrap();
        assert!(contradicts && (known - 0.06).abs() < 1e-9, "{known}");
        assert!(add(&mut state, 1000) > TOLERANCE);
        assert_eq!((1001..2000).map(|k| add(&mut state, k)).last(), Some(0.0));
    }

    #[test]
    fn a_norm_that_deviates_makes_its_readings_uncertain() {
        let share = |norm: f64| {
            let mut state = FieldState::NONE;
            (0..1000).for_each(|k| {
                state.follow_norm([norm; 2], STEP_S * f64::from(k), 0.15);
            });
            state.bent_share()
        };
        assert_eq!(share(0.07), 0.0);
        // Twenty readings have the information of one.
        assert!((share(-0.125) - 0.1 * 20.0f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn a_noisy_norm_is_no_bent_field() {
        // Every reading is beyond the tolerance, and their mean is not.
        let mut state = FieldState::NONE;
        let bent = |k: i32| state.follow_norm([if k % 2 == 0 { 0.2 } else { -0.2 }; 2], STEP_S * f64::from(k), 0.15);
        let late: Vec<bool> = (0..3000).map(bent).skip(1500).collect();
        assert!(!late.contains(&true));
    }
}
