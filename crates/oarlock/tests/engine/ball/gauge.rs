//! Without a compass the heading of the whole body is zero by definition at first, and less certain ever after.

use super::hypotheses::Pair;
use super::support::{so3, worse};
use nalgebra::{Matrix3, Vector3};
use oarlock::body::Body;
use oarlock::estimate::belief::Belief;
use std::f64::consts::{PI, TAU};

/// Standard deviation of the trunk's heading and the largest of its inclination, rad.
fn heading_and_inclination(body: &Body, belief: &Belief) -> (f64, f64) {
    let turn = so3::exp(so3::three(&belief.mean, 0));
    let up = turn.transpose() * Vector3::from(body.model.world.up);
    let p = Matrix3::from_fn(|i, j| belief.covariance.at(i, j));
    let level = Matrix3::identity() - up * up.transpose();
    let inclination = (level * p * level).symmetric_eigenvalues().max().sqrt();
    (up.dot(&(p * up)).sqrt(), inclination)
}

/// A heading that is zero by definition, rad.
const NOTHING: f64 = 5e-3;
/// Gyroscopes of 0.01 rad/s at 100 Hz let a heading walk by 1e-3 rad per sqrt(s), their bias by far more until it is known:
/// 0.02 rad/s over a few seconds.
const LOST_AFTER_10_S: std::ops::Range<f64> = 0.003..0.3;
/// Pushes of some m/s2 that fade in 0.3 s hide the vertical at any moment, and average out over seconds.
const SHARP: f64 = 0.2;

#[test]
fn heading_starts_at_nothing_and_grows_while_inclination_stays_sharp() {
    let pair = Pair::new(0.5, 3);
    let mut tracker = pair.tracker();
    let (mut headings, mut sharp, mut misses, mut tilt) = (Vec::new(), 0.0, 0.0, 0.0);
    let mut turned = 0.0;
    for sample in &pair.samples(20.0) {
        let mut see = |s: &oarlock::recording::Sample, b: &Belief, _: &oarlock::estimate::filter::Info| {
            let (heading, inclination) = heading_and_inclination(&pair.body, b);
            headings.push((s.time_s, heading));
            let found = so3::exp(so3::three(&b.mean, 0));
            let truth = pair.trunk(s.time_s);
            let [a, b] = [found, truth].map(|r| r.transpose() * Vector3::z());
            if s.time_s > 5.0 {
                sharp = worse(sharp, inclination);
                misses = worse(misses, a.cross(&b).norm() / inclination);
                tilt = worse(tilt, a.cross(&b).norm());
            }
            // Turn about the vertical that leads from the truth to what was found.
            let lead = found * truth.transpose();
            let angle = (lead[(1, 0)] - lead[(0, 1)]).atan2(lead[(0, 0)] + lead[(1, 1)]);
            turned = if headings.len() == 1 { angle } else { turned };
            if s.time_s > 15.0 {
                let drift = (angle - turned + PI).rem_euclid(TAU) - PI;
                assert!(drift.abs() < 5.0 * (heading + inclination), "{drift} {heading}");
            }
        };
        tracker.step_with(sample, &mut see).unwrap();
    }
    let at = |t: f64| headings.iter().find(|h| h.0 >= t).unwrap().1;
    println!(
        "heading std {:.4}, {:.4} after 1 s, {:.4} after 10 s, {:.4} rad after 19 s; inclination {sharp:.4} rad, off by {tilt:.4} rad or {misses:.1} sigma",
        at(0.0),
        at(1.0),
        at(10.0),
        at(19.0)
    );
    assert!(at(0.0) < NOTHING, "{}", at(0.0));
    assert!(at(0.0) < at(1.0) && at(1.0) < at(5.0) && at(5.0) < 1.1 * at(19.0));
    assert!(LOST_AFTER_10_S.contains(&at(10.0)), "{}", at(10.0));
    assert!(sharp < SHARP, "{sharp}");
    assert!(misses < 5.0, "{misses}");
}
