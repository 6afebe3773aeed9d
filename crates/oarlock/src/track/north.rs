//! Detects a magnetic field that has turned about the vertical at one unit.
//!
//! A filter with constant errors of some degrees (wrong mounts, iron on the limb) learns a high innovation level, and a
//! slow disturbance shifts its heading. In both cases no single innovation is an outlier. Therefore the direction of
//! north at each unit, computed with the estimated orientation, is compared with its own mean over some seconds. It
//! counts as turned while its deviation is much larger than usual.

use super::hypothesis::{Hypothesis, SourceMemory};
use super::magnetic::{Magnetic, PATIENCE_S};
use super::readings::Readings;
use super::subject::Subject;
use crate::config::{Config, Magnetometer};
use crate::estimate::filter::{Info, Verdict};
use crate::rotation::Vec3;
use crate::sensor::Quantity;
use std::f64::consts::{PI, TAU};

/// Time constant of the current direction, s.
const NOW_S: f64 = 0.5;
/// Time constant of the usual direction, s.
const USUAL_S: f64 = 5.0;
/// Time constant of the usual deviation between the two, s.
const SCATTER_S: f64 = 20.0;
/// Time before the usual direction is valid, s.
const AFTER_S: f64 = 5.0;
/// North counts as turned if the deviation exceeds this, rad (15 deg) ...
const TURNED_RAD: f64 = 0.26;
/// ... and this multiple of the usual deviation.
const SCATTERS: f64 = 4.0;
/// North counts as back below this share of that threshold.
const BACK: f64 = 0.5;

/// Memory of the north of one unit; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NorthState {
    /// Usual and current direction, rad.
    pub usual_rad: f64,
    pub now_rad: f64,
    /// Mean square of their difference.
    pub scatter_rad2: f64,
    /// Time of the last update, s.
    pub spoke_s: f64,
    /// Duration of all updates, s.
    pub age_s: f64,
    /// Start of the turned field, s; NaN if it is not turned.
    pub since_s: f64,
}

/// Detector for all magnetometers.
#[derive(Debug, Clone)]
pub(super) struct North {
    /// Whether turned fields are excluded, and whether north is tracked.
    bars: bool,
    follows: bool,
    /// Per part: its field counts as turned.
    turned: Vec<bool>,
}

impl North {
    pub fn new(subject: &Subject, config: &Config) -> Self {
        let bars = config.magnetometer == Magnetometer::Gated;
        North { bars, follows: config.gate, turned: vec![false; subject.groups.parts.len()] }
    }

    /// Excludes magnetometers whose north has turned.
    pub fn bar_turned(&mut self, subject: &Subject, sources: &[SourceMemory], time_s: f64, excluded: &mut [bool]) {
        self.turned.fill(false);
        for p in subject.parts_of(Quantity::Mag).filter(|_| self.bars) {
            let since_s = sources[subject.source_of_part[p]].north.since_s;
            if time_s - since_s <= PATIENCE_S && !excluded[p] {
                (self.turned[p], excluded[p]) = (true, true);
            }
        }
    }

    /// Updates the north of every unit, after an update.
    pub fn watch(
        &self,
        subject: &Subject,
        magnetic: &Magnetic,
        readings: &Readings,
        info: &Info,
        one: &mut Hypothesis,
    ) {
        let Hypothesis { belief, sources, .. } = one;
        for p in (0..self.turned.len()).filter(|&p| self.follows && magnetic.direction_tests[p].is_some()) {
            let (first, s) = (subject.groups.parts[p].start, subject.source_of_part[p]);
            match info.parts[p] {
                // The gate rejects it and accepts it after its own patience.
                Verdict::Outlier if belief.time_s - belief.rejected_since_s[p] > USUAL_S => {
                    sources[s].north = NorthState::NONE;
                    continue;
                }
                Verdict::Accepted => {}
                _ if self.turned[p] => {}
                _ => continue,
            }
            let Some(up) = magnetic.up_seen_by(subject, s) else { continue };
            let measured = Vec3(readings.three(first));
            let expected = measured - Vec3([0, 1, 2].map(|k| info.innovation[first + k]));
            let azimuth = subject.body.layout.azimuth.map_or(0.0, |i| belief.mean[i]);
            if let Some(off) = turned_by(expected, measured, up) {
                sources[s].north.follow(azimuth + off, belief.time_s);
            }
        }
    }

    /// Names the excluded turned fields in the report.
    pub fn report(&self, info: &mut Info) {
        for (verdict, _) in info.parts.iter_mut().zip(&self.turned).filter(|(_, &turned)| turned) {
            if *verdict == Verdict::Excluded {
                *verdict = Verdict::Turned;
            }
        }
    }
}

/// Rotation of one field against another about the vertical, rad; `None` if either has no horizontal part.
fn turned_by(from: Vec3<f64>, to: Vec3<f64>, up: Vec3<f64>) -> Option<f64> {
    let dot = |a: Vec3<f64>, b: Vec3<f64>| -> f64 { a.0.iter().zip(b.0).map(|(a, b)| a * b).sum() };
    let level = |v: Vec3<f64>| v - up * dot(v, up);
    let (from, to) = (level(from), level(to));
    let (along, across) = (dot(from, to), dot(up, from.cross(to)));
    let angle = across.atan2(along);
    (angle.is_finite() && (along, across) != (0.0, 0.0)).then_some(angle)
}

fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

impl NorthState {
    pub const NONE: NorthState = NorthState {
        usual_rad: f64::NAN,
        now_rad: f64::NAN,
        scatter_rad2: f64::NAN,
        spoke_s: f64::NAN,
        age_s: f64::NAN,
        since_s: f64::NAN,
    };

    /// Adds a direction of north, rad.
    fn follow(&mut self, north_rad: f64, time_s: f64) {
        if self.spoke_s.is_nan() {
            (self.usual_rad, self.now_rad, self.scatter_rad2) = (north_rad, north_rad, 0.0);
            (self.spoke_s, self.age_s) = (time_s, 0.0);
            return;
        }
        let dt = (time_s - self.spoke_s).clamp(0.0, 1.0);
        self.spoke_s = time_s;
        self.age_s += dt;
        // At first the mean of all values.
        let age_s = self.age_s;
        let share = |constant_s: f64| 1.0 - (-dt / constant_s.min(age_s).max(dt)).exp();
        let (now, usual, scatter) = (share(NOW_S), share(USUAL_S), share(SCATTER_S));
        self.now_rad = wrapped(self.now_rad + now * wrapped(north_rad - self.now_rad));
        let away = wrapped(self.now_rad - self.usual_rad);
        let bound = TURNED_RAD.max(SCATTERS * self.scatter_rad2.sqrt());
        if self.since_s.is_nan() {
            if away.abs() > bound && self.age_s > AFTER_S {
                self.since_s = time_s;
                return;
            }
            self.usual_rad = wrapped(self.usual_rad + usual * away);
            self.scatter_rad2 += scatter * (away * away - self.scatter_rad2);
        } else if away.abs() < BACK * bound {
            self.since_s = f64::NAN;
        } else if time_s - self.since_s > PATIENCE_S {
            // A deviation this long is no passing disturbance: it is the local field.
            (self.usual_rad, self.since_s) = (self.now_rad, f64::NAN);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_about_the_vertical_is_measured_with_its_sign() {
        let up = Vec3([0.0, 0.0, 1.0]);
        let field = |azimuth: f64| Vec3([20.0 * azimuth.cos(), 20.0 * azimuth.sin(), -40.0]);
        let off = turned_by(field(0.3), field(0.8), up).unwrap();
        assert!((off - 0.5).abs() < 1e-12);
        assert_eq!(turned_by(up, up, up), None);
    }

    /// Whether north counts as turned, over a minute at 50 Hz.
    fn told(north: impl Fn(f64) -> f64) -> (f64, f64) {
        let mut unit = NorthState::NONE;
        let (mut first, mut total) = (f64::NAN, 0.0);
        for k in 0..3000 {
            let t = 0.02 * f64::from(k);
            unit.follow(north(t), t);
            if !unit.since_s.is_nan() {
                first = if first.is_nan() { t } else { first };
                total += 0.02;
            }
        }
        (first, total)
    }

    #[test]
    fn a_lasting_turn_is_told_within_a_second_and_forgotten_after_patience() {
        let (first, total) = told(|t| if t > 30.0 { 0.52 } else { 0.0 });
        assert!(first > 30.0 && first < 31.0, "{first}");
        assert!((total - PATIENCE_S).abs() < 0.1, "{total}");
        let (_, passing) = told(|t| if t > 30.0 && t < 34.0 { 3.0 + 0.52 } else { 3.0 });
        assert!((passing - 4.0).abs() < 0.5, "{passing}");
    }

    #[test]
    fn what_swings_with_every_stroke_is_usual() {
        assert!(told(|t| 0.3 * (TAU * t / 2.5).sin()).0.is_nan());
        assert!(told(|t| 0.02 * t).0.is_nan());
    }
}
