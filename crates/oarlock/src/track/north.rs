//! Whether the magnetic field that a unit sees has turned about the vertical.
//!
//! A filter that is usually wrong by some degrees (mounts askew, iron on the limb) makes large innovations its habit, and one that is
//! led slowly follows; either way no single reading is odd. So the direction of north that each unit sees by the belief is held
//! against its own mean over some seconds: it is far off when it has moved, for a while, much farther than it usually does.

use super::hypothesis::{Hypothesis, SourceMemory};
use super::magnetic::{Magnetic, PATIENCE_S};
use super::readings::Readings;
use super::subject::Subject;
use crate::config::{Config, Magnetometer};
use crate::estimate::filter::{Info, Verdict};
use crate::rotation::Vec3;
use crate::sensor::Quantity;
use std::f64::consts::{PI, TAU};

/// Time constant of what counts as now, s.
const NOW_S: f64 = 0.5;
/// Time constant of what counts as usual, s.
const USUAL_S: f64 = 5.0;
/// Time constant of how far now is usually away from it, s.
const SCATTER_S: f64 = 20.0;
/// Nothing is usual before this, s.
const AFTER_S: f64 = 5.0;
/// North has turned when now is farther from the usual than this, rad (15 deg) ...
const TURNED_RAD: f64 = 0.26;
/// ... and so many times its usual distance.
const SCATTERS: f64 = 4.0;
/// It is back when it is within this share of what made it turned.
const BACK: f64 = 0.5;

/// What is remembered of the north that a unit sees; NaN where there is nothing yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NorthState {
    /// Usual direction, and the one now, rad.
    pub usual_rad: f64,
    pub now_rad: f64,
    /// Mean square of their difference.
    pub scatter_rad2: f64,
    /// When it was last followed, s.
    pub spoke_s: f64,
    /// For how long it has been, s.
    pub age_s: f64,
    /// Since when north is turned, s; NaN while it is not.
    pub since_s: f64,
}

/// Finds the magnetometers whose north has turned.
#[derive(Debug, Clone)]
pub(super) struct North {
    /// Whether turned fields are excluded, and whether north is followed.
    bars: bool,
    follows: bool,
    /// Per part: its field seems to have turned.
    turned: Vec<bool>,
}

impl North {
    pub fn new(subject: &Subject, config: &Config) -> Self {
        let bars = config.magnetometer == Magnetometer::Gated;
        North { bars, follows: config.gate, turned: vec![false; subject.groups.parts.len()] }
    }

    /// Bars magnetometers whose north has turned.
    pub fn bar_turned(&mut self, subject: &Subject, sources: &[SourceMemory], time_s: f64, excluded: &mut [bool]) {
        self.turned.fill(false);
        for p in subject.parts_of(Quantity::Mag).filter(|_| self.bars) {
            let since_s = sources[subject.source_of_part[p]].north.since_s;
            if time_s - since_s <= PATIENCE_S && !excluded[p] {
                (self.turned[p], excluded[p]) = (true, true);
            }
        }
    }

    /// Follows the north of every unit, behind an update.
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
                // The gate has it, and will believe it after its own patience.
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

    /// Names in the report the fields that were excluded because they have turned.
    pub fn report(&self, info: &mut Info) {
        for (verdict, _) in info.parts.iter_mut().zip(&self.turned).filter(|(_, &turned)| turned) {
            if *verdict == Verdict::Excluded {
                *verdict = Verdict::Turned;
            }
        }
    }
}

/// By how much one field is turned against another about the vertical, rad; `None` where either has no horizontal part.
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

    /// Takes in where a unit sees north, rad.
    fn follow(&mut self, north_rad: f64, time_s: f64) {
        if self.spoke_s.is_nan() {
            (self.usual_rad, self.now_rad, self.scatter_rad2) = (north_rad, north_rad, 0.0);
            (self.spoke_s, self.age_s) = (time_s, 0.0);
            return;
        }
        let dt = (time_s - self.spoke_s).clamp(0.0, 1.0);
        self.spoke_s = time_s;
        self.age_s += dt;
        // At first the mean of all there was.
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
            // So long is no passing by: this is the field here.
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

    /// When north counts as turned, of a minute at 50 Hz.
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
