//! Whether the magnetic field that a unit sees has turned about the vertical.
//!
//! A filter that is usually wrong by some degrees (mounts askew, iron on the limb) makes large innovations its habit, and one that is
//! led slowly follows; either way no single reading is odd. So the direction of north that each unit sees by the belief is held
//! against its own mean over some seconds: it is far off when it has moved, for a while, much farther than it usually does.

use super::magnetic::PATIENCE_S;
use super::Tracker;
use crate::config::Magnetometer;
use crate::estimate::belief::{Belief, MEMORY};
use crate::estimate::filter::Verdict;
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

/// Places in a source's memory: north as usual and now, mean square of their difference, when it last spoke, for how long it has,
/// since when it is turned.
const USUAL: usize = 29;
const NOW: usize = 30;
const SCATTER: usize = 31;
const SPOKE: usize = 32;
const AGE: usize = 33;
const SINCE: usize = 34;

impl Tracker {
    /// Bars magnetometers whose north has turned.
    pub(super) fn bar_turned(&mut self, belief: &Belief) {
        for p in 0..self.turned.len() {
            self.turned[p] = false;
            if self.quantities[p] != Quantity::Mag || self.config.magnetometer != Magnetometer::Gated {
                continue;
            }
            let first = self.groups.parts[p].start;
            let since_s = self.source_of(first).map_or(f64::NAN, |s| belief.memory[s][SINCE]);
            if belief.time_s - since_s <= PATIENCE_S && !self.excluded[p] {
                (self.turned[p], self.excluded[p]) = (true, true);
            }
        }
    }

    /// Follows the north of every unit, behind an update.
    pub(super) fn watch_north(&self, belief: &mut Belief) {
        if !self.config.gate {
            return;
        }
        for p in (0..self.turned.len()).filter(|&p| self.direction_tests[p].is_some()) {
            let first = self.groups.parts[p].start;
            let Some(s) = self.source_of(first) else { continue };
            match self.info.parts[p] {
                // The gate has it, and will believe it after its own patience.
                Verdict::Outlier if belief.time_s - belief.rejected_since_s[p] > USUAL_S => {
                    forget_north(&mut belief.memory[s]);
                    continue;
                }
                Verdict::Accepted => {}
                _ if self.turned[p] => {}
                _ => continue,
            }
            let Some(up) = self.body.up_seen_by(s, &self.posture) else { continue };
            let three = |v: &[f64]| Vec3([v[first], v[first + 1], v[first + 2]]);
            let measured = three(&self.z);
            let expected = measured - three(&self.info.innovation);
            let azimuth = self.body.layout.azimuth.map_or(0.0, |i| belief.mean[i]);
            if let Some(off) = turned_by(expected, measured, up) {
                follow(&mut belief.memory[s], azimuth + off, belief.time_s);
            }
        }
    }

    fn source_of(&self, row: usize) -> Option<usize> {
        self.groups.sources.iter().position(|s| s.contains(&row))
    }
}

/// Nothing is usual any more.
pub(super) fn forget_north(memory: &mut [f64; MEMORY]) {
    memory[USUAL..=SINCE].fill(f64::NAN);
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

/// Takes in where a unit sees north, rad.
fn follow(memory: &mut [f64; MEMORY], north: f64, time_s: f64) {
    if memory[SPOKE].is_nan() {
        (memory[USUAL], memory[NOW], memory[SCATTER]) = (north, north, 0.0);
        (memory[SPOKE], memory[AGE]) = (time_s, 0.0);
        return;
    }
    let dt = (time_s - memory[SPOKE]).clamp(0.0, 1.0);
    memory[SPOKE] = time_s;
    memory[AGE] += dt;
    // At first the mean of all there was.
    let share = |constant_s: f64| 1.0 - (-dt / constant_s.min(memory[AGE]).max(dt)).exp();
    let (now, usual, scatter) = (share(NOW_S), share(USUAL_S), share(SCATTER_S));
    memory[NOW] = wrapped(memory[NOW] + now * wrapped(north - memory[NOW]));
    let away = wrapped(memory[NOW] - memory[USUAL]);
    let bound = TURNED_RAD.max(SCATTERS * memory[SCATTER].sqrt());
    if memory[SINCE].is_nan() {
        if away.abs() > bound && memory[AGE] > AFTER_S {
            memory[SINCE] = time_s;
            return;
        }
        memory[USUAL] = wrapped(memory[USUAL] + usual * away);
        memory[SCATTER] += scatter * (away * away - memory[SCATTER]);
    } else if away.abs() < BACK * bound {
        memory[SINCE] = f64::NAN;
    } else if time_s - memory[SINCE] > PATIENCE_S {
        // So long is no passing by: this is the field here.
        (memory[USUAL], memory[SINCE]) = (memory[NOW], f64::NAN);
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
        let mut memory = [f64::NAN; MEMORY];
        let (mut first, mut total) = (f64::NAN, 0.0);
        for k in 0..3000 {
            let t = 0.02 * f64::from(k);
            follow(&mut memory, north(t), t);
            if !memory[SINCE].is_nan() {
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
