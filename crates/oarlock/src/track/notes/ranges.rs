//! Notes on joints that are often beyond their range; `notes` lists them with the others.

use crate::body::three;
use crate::model::cone::Beyond;
use crate::model::{Axis, Joint, JointKind, Model};
use crate::state::Slots;
use crate::track::run::Run;

/// A note reports a joint that exceeds its soft limits by more than this share of its range in more than `OFTEN_SHARE` of
/// the samples. The limits are two standard deviations, so that about 5 % of the postures exceed them in any case.
const BEYOND_SHARE: f64 = 0.1;
/// See `BEYOND_SHARE`.
const OFTEN_SHARE: f64 = 0.1;
/// A note also reports a ball that is beyond its range by more than this, rad, in more than `BRIEFLY_SHARE` of the samples.
const FAR: f64 = 0.25 * std::f64::consts::PI;
/// See `FAR`; a single wrong estimate, as after a dropout, is no reason for a note.
const BRIEFLY_SHARE: f64 = 0.01;

/// What limits do to strapdown links; a tree is not affected.
fn effect_of_limits(run: &Run) -> &'static str {
    let has_links = run.last().is_some_and(|last| last.links.is_some());
    if has_links {
        ". Beyond by more than `limit_std_rad`, it turns the headings of its segments back"
    } else {
        ""
    }
}

/// Reports observed joints that often exceed their soft limits. Limits do not affect observed joints of a tree, and strapdown links only far
/// beyond, so the cause lies elsewhere.
pub(super) fn contortions(run: &Run) -> Vec<String> {
    let body = run.tracker().body();
    let (n, coordinates, rows) = (body.layout.dim(), body.model.coordinate_count(), run.series.time_s.len());
    let names = body.model.coordinate_names();
    let describe = |(c, axis, slots): (usize, &Axis, Slots)| {
        let slides = match body.model.joints.iter().find(|j| j.first == c)?.kind {
            JointKind::Slide => true,
            JointKind::Hinge => false,
            _ => return None,
        };
        let [low, high] = axis.limits;
        let observed = (0..rows).filter(|r| run.series.observed[r * coordinates + c] == 1);
        let excess = observed.map(|r| run.series.mean[r * n + slots.q]).map(|q| (q - high).max(low - q));
        let (all, beyond, most) = excess.fold((0u32, 0u32, 0.0f64), |(all, beyond, most), e| {
            (all + 1, beyond + u32::from(e > BEYOND_SHARE * (high - low)), most.max(e))
        });
        let share = f64::from(beyond) / f64::from(all.max(1));
        (share > OFTEN_SHARE).then(|| {
            let (by, unit) = if slides { (1.0, "m") } else { (1f64.to_degrees(), "deg") };
            format!(
                "{}: beyond its soft limits ({} to {} {unit}) in {:.0} % of the samples, by up to {} {unit}; check for \
                 a wrong mount, exchanged sensors or a start in a mirrored posture, or correct the limits in the model file{}",
                names[c],
                tidy(by * low),
                tidy(by * high),
                100.0 * share,
                tidy(by * most),
                effect_of_limits(run)
            )
        })
    };
    body.moving().filter_map(describe).collect()
}

/// Reports observed balls that are often, or far, beyond their range.
pub(super) fn overturned(run: &Run) -> Vec<String> {
    let model = &run.tracker().body().model;
    let balls = model.joints.iter().enumerate().filter(|(_, j)| j.kind == JointKind::Ball);
    balls
        .filter_map(|(j, ball)| Some(overturned_note(model, j, &excesses(run, ball)?)? + effect_of_limits(run)))
        .collect()
}

/// How far a ball is beyond its range where it is observed.
fn excesses(run: &Run, ball: &Joint) -> Option<Vec<Beyond>> {
    let body = run.tracker().body();
    let (n, coordinates, q) =
        (body.layout.dim(), body.model.coordinate_count(), body.layout.coordinates[ball.first]?.q);
    let seen = (0..run.series.time_s.len()).filter(|row| run.series.observed[row * coordinates + ball.first] == 1);
    Some(seen.map(|row| ball.beyond(three(&run.series.mean[row * n..], q))).collect())
}

fn overturned_note(model: &Model, ball: usize, excesses: &[Beyond]) -> Option<String> {
    let share =
        |is: &dyn Fn(&Beyond) -> bool| excesses.iter().filter(|e| is(e)).count() as f64 / excesses.len().max(1) as f64;
    let often = share(&|e| e.share() > BEYOND_SHARE) > OFTEN_SHARE;
    if !often && share(&|e| e.angle > FAR) <= BRIEFLY_SHARE {
        return None;
    }
    let most = excesses.iter().fold(0.0, |most: f64, e| most.max(e.angle));
    let joint = &model.joints[ball];
    Some(format!(
        "{}: beyond its range ({}) in {} % of the samples, by up to {:.0} deg: {} Run `oarlock calibrate motion`, \
         or correct its `limits` in the model file",
        joint.name,
        range(joint),
        tidy(100.0 * share(&|e| e.angle > 0.0)),
        most.to_degrees(),
        question(&sensors_on(model, ball)),
    ))
}

fn range(ball: &Joint) -> String {
    let [_, most] = ball.limits.map(f64::to_degrees);
    let Some(cone) = &ball.cone else { return format!("{most:.0} deg about each axis") };
    let ([a, b], [low, high]) = (cone.swing.map(f64::to_degrees), cone.twist.map(f64::to_degrees));
    let swing = if a == b { format!("{a:.0}") } else { format!("{a:.0} and {b:.0}") };
    format!("swing up to {swing} deg, twist {low:.0} to {high:.0} deg")
}

fn question(sensors: &[&str]) -> String {
    match sensors {
        [] => "are the sensors next to it mounted as in the model?".into(),
        [one] => format!("is {one} mounted as in the model?"),
        several => format!("are {} mounted as in the model?", several.join(", ")),
    }
}

/// Inertial and orientation sensors on the segment that a joint moves.
fn sensors_on(model: &Model, joint: usize) -> Vec<&str> {
    let on = |frame: usize| moving_joint(model, frame) == Some(joint);
    model
        .sensors
        .iter()
        .filter(|s| s.kind.mount().and(s.kind.frame()).is_some_and(on))
        .map(|s| s.name.as_str())
        .collect()
}

/// The joint that moves a frame's segment.
fn moving_joint(model: &Model, frame: usize) -> Option<usize> {
    let own = model.frames[frame].joint.map(|(j, _)| j).filter(|&j| model.joints[j].kind != JointKind::Fixed);
    own.or_else(|| (frame > 0).then(|| moving_joint(model, model.frames[frame].parent))?)
}

/// Rounds to two decimals, or to whole numbers from 10 on.
fn tidy(x: f64) -> f64 {
    if x.abs() < 10.0 {
        (x * 100.0).round() / 100.0
    } else {
        x.round()
    }
}
