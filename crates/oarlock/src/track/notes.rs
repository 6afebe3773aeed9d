//! Notes: sentences about what a run could not use or observe. `track` stores them and the report prints them.

mod ranges;
mod vibration;

use super::faults::Fault;
use super::loops::dependence;
use super::magnetic::Field;
use super::run::{Run, Spell, StreamCount};
use crate::config::{Config, Magnetometer};
use crate::model::{Fixing, JointKind, Model, Sensor};
use crate::recording::input_joint;
use crate::state::{LENGTHS, MOUNTS};
use crate::strapdown::check::Check;

/// Share of rejected readings above which a note reports a sensor.
const REJECTED_SHARE: f64 = 0.05;
/// So many samples in a row with outliers are no single jumps: the gate may reject an abrupt movement.
const OUTLIERS_IN_A_ROW: u64 = 3;
/// Standard deviation of a mount in the model file, rad, up to which it is known.
const KNOWN_MOUNT_RAD: f64 = 0.05;

/// All notes on a run.
pub fn notes(run: &Run) -> Vec<String> {
    let mut notes = contradicted(run);
    notes.extend(run.recording().notes());
    notes.extend(nominal_mounts(run));
    notes.extend(absent_streams(run));
    notes.extend(silent_loops(run));
    let (counts, field) = (run.counts(), expected_field(run));
    notes.extend(no_magnetometers(run, &counts));
    notes.extend(fixing(run));
    notes.extend(not_for_links(run));
    notes.extend(not_fused(run));
    notes.extend(rejections(&counts, &field));
    notes.extend(disturbances(&counts, &field));
    notes.extend(faults(&counts));
    notes.extend(vibration::notes(run));
    notes.extend(unobserved(run));
    notes.extend(ranges::contortions(run));
    notes.extend(ranges::overturned(run));
    notes.extend(losses(run));
    if run.refused > 0 {
        notes.push(format!(
            "{} samples were refused because their time stamps did not increase; check the clock of the recording",
            run.refused
        ));
    }
    notes
}

/// Shortest time of a contradiction that is reported, s.
const CONTRADICTED_S: f64 = 0.5;

/// Reports units that their joints contradict beyond all bands.
fn contradicted(run: &Run) -> Vec<String> {
    let Some(links) = run.last().and_then(|last| last.links.as_ref()) else { return Vec::new() };
    let worst =
        links.units_contradicted(run.tracker()).into_iter().filter(|(_, check)| check.contradicted_s > CONTRADICTED_S);
    let text = |(name, check): (String, Check)| {
        format!(
            "{name}: its joints contradict the unit's own readings for {:.1} s, by up to {:.0} deg; its joints were not used then, and its \
             angles are not reliable. Check which segment it is on (`oarlock calibrate units`) and its mount (`oarlock calibrate`)",
            check.contradicted_s,
            check.worst_rad.to_degrees()
        )
    };
    worst.map(text).collect()
}

/// Names of the sensors that are used with their nominal mount, which the model file does not say is known.
pub fn at_nominal_mounts(run: &Run) -> Vec<String> {
    let model = &run.tracker().body().model;
    let streams: Vec<&str> = run.recording().names().collect();
    let is_doubtful = |s: &&Sensor| s.kind.mount().is_some_and(|mount| mount.std_rad > KNOWN_MOUNT_RAD);
    let nominal = model.sensors.iter().filter(is_doubtful).map(|s| s.name.clone());
    nominal.filter(|n| !run.calibration().mounts.contains_key(n) && streams.contains(&n.as_str())).collect()
}

fn nominal_mounts(run: &Run) -> Option<String> {
    let names = at_nominal_mounts(run);
    let list = names.join(", ");
    (!names.is_empty()).then(|| {
        format!(
            "mounts: nominal for {list}; a sensor mounted 5 deg off causes errors of several degrees; run `oarlock calibrate`; if a \
             drawing gives the mounts, write `std_rad = 0.02` into each mount of the model file"
        )
    })
}

fn absent_streams(run: &Run) -> Option<String> {
    let model = &run.tracker().body().model;
    let there: Vec<&str> = run.recording().names().collect();
    let sources = model.sensors.iter().map(|s| s.name.as_str());
    let absent: Vec<&str> = sources.filter(|s| !is_there(model, &there, s)).collect();
    (!absent.is_empty()).then(|| format!("no stream for: {}; check the recording's stream names", absent.join(", ")))
}

fn is_there(model: &Model, streams: &[&str], sensor: &str) -> bool {
    let joint = input_joint(model, sensor);
    streams.contains(&sensor) || joint.is_some_and(|j| streams.iter().any(|s| input_joint(model, s) == Some(j)))
}

fn silent_loops(run: &Run) -> Vec<String> {
    let model = &run.tracker().body().model;
    let sources = run.tracker().body().suite.sources.len();
    let first = sources - model.closures.len();
    let rows = run.series.time_s.len();
    let spoke = |s: usize| (0..rows).filter(|r| run.series.reports[r * sources + s].used > 0).count();
    let describe = |(i, c): (usize, &crate::model::Closure)| {
        let missing = rows - spoke(first + i);
        match missing {
            0 => None,
            m if m == rows => Some(format!("closure {}: never used ({})", c.name, why_silent(run, first + i))),
            m => Some(format!("closure {}: used in {} of {rows} rows", c.name, rows - m)),
        }
    };
    model.closures.iter().enumerate().filter_map(describe).collect()
}

/// Why a closure, as a source, was never used.
fn why_silent(run: &Run, source: usize) -> String {
    if !run.config().closures {
        return "switched off".into();
    }
    let subject = &run.tracker().subject;
    let joints = subject.body.model.joints.iter().zip(&subject.depends[source]);
    let needed: Vec<&str> = joints.filter(|(j, depends)| j.input && **depends).map(|(j, _)| j.name.as_str()).collect();
    let streams: Vec<&str> = run.recording().names().collect();
    let absent: Vec<&str> = needed.iter().copied().filter(|j| !is_there(&subject.body.model, &streams, j)).collect();
    match (needed.is_empty(), absent.is_empty()) {
        (true, _) => "sensors measure too few of its joints; check the streams of both of its sides".into(),
        (_, false) => format!("no stream for {}; check the recording's stream names", absent.join(", ")),
        _ => format!(
            "no sample has readings of {} together; leave out the setting inputs, so that these joints are estimated between \
             their readings",
            needed.join(", ")
        ),
    }
}

/// The field that magnetometers are expected to read.
fn expected_field(run: &Run) -> String {
    let field = run.tracker().body().field;
    format!("{} uT, {:.0} deg below the horizon", field.norm_ut, field.dip_rad.to_degrees())
}

fn rejections(counts: &[StreamCount], field: &str) -> Vec<String> {
    let describe = |count: &StreamCount| {
        let share = count.rejected as f64 / count.received.max(1) as f64;
        let magnetometer = if count.magnetometer == Some(true) {
            format!(" and, for its magnetometer, the field's norm and dip in the model ({field})")
        } else {
            String::new()
        };
        let (first_s, in_a_row) = count.outliers;
        let (row, abrupt) = if in_a_row < OUTLIERS_IN_A_ROW {
            (String::new(), "")
        } else {
            let text = "; if it moved abruptly then, raise `density` of its joints in the model file, or track with `--set gate=false`";
            (format!(", {in_a_row} samples in a row from {first_s:.2} s"), text)
        };
        (share > REJECTED_SHARE || !row.is_empty()).then(|| {
            format!(
                "{}: {} of {} readings ({:.1} %) were rejected{row}; check its mount and its units{magnetometer}{abrupt}",
                count.name,
                count.rejected,
                count.received,
                100.0 * share
            )
        })
    };
    counts.iter().filter_map(describe).collect()
}

/// A share that is printed as 0.0 % is no news.
fn percent(share: f64) -> Option<f64> {
    Some(100.0 * share).filter(|percent| *percent >= 0.05)
}

/// A disturbance that lasts longer, s, and that has this share of all disturbed readings, has one cause.
const SPELL_S: f64 = 1.0;
const ONCE_SHARE: f64 = 0.8;

/// Reports the share of disturbed readings of each magnetometer, by the test that failed.
fn disturbances(counts: &[StreamCount], field: &str) -> Vec<String> {
    let describe = |count: &StreamCount| {
        let all: u64 = count.fields.iter().skip(1).sum();
        let share = |of: Field| count.fields[of as usize] as f64 / all.max(1) as f64;
        let tests = [Field::Norm, Field::Dip, Field::Innovation];
        let disturbed = percent(tests.into_iter().map(share).sum())?;
        let named = tests.into_iter().filter_map(|of| Some(format!("{} {:.1} %", of.name(), percent(share(of))?)));
        let named: Vec<String> = named.collect();
        let named = if named.is_empty() { String::new() } else { format!(" ({})", named.join(", ")) };
        let bad: u64 = tests.into_iter().map(|of| count.fields[of as usize]).sum();
        let is_once = |([from_s, to_s], inside): &Spell| {
            to_s - from_s > SPELL_S && *inside as f64 > ONCE_SHARE * bad as f64 && bad as f64 <= ONCE_SHARE * all as f64
        };
        let advice = match count.spell.filter(is_once) {
            Some(([from_s, to_s], _)) => {
                format!("nearly all from {from_s:.1} to {to_s:.1} s: a magnet or iron near {}", count.name)
            }
            None => format!("expected: {field}; if that is wrong, correct the field's norm and dip in the model"),
        };
        Some(format!(
            "{}: magnetic field disturbed in {disturbed:.1} % of the readings{named}; these count little or not at all; {advice}",
            count.name
        ))
    };
    counts.iter().filter_map(describe).collect()
}

/// Reports the share of samples in which sensors were clipped (at the end of their range) or stuck.
fn faults(counts: &[StreamCount]) -> Vec<String> {
    let describe = |count: &StreamCount| {
        let all: u64 = count.faults.iter().sum();
        let share = |of: Fault| percent(count.faults[of as usize] as f64 / all.max(1) as f64);
        let clipped = share(Fault::Clipped).map(|percent| {
            format!(
                "{}: at the end of the sensor's range in {percent:.1} % of the samples; the clipped axes were not used there; use a \
                 sensor with a wider range or a softer mount",
                count.name
            )
        });
        let stuck = share(Fault::Stuck).map(|percent| {
            format!(
                "{}: readings stuck (identical to the bit) in {percent:.1} % of the samples and not used there; check its firmware, \
                 battery and radio link",
                count.name
            )
        });
        [clipped, stuck]
    };
    counts.iter().flat_map(describe).flatten().collect()
}

/// Names the units whose magnetometer, which the model has, never gave a reading.
fn no_magnetometers(run: &Run, counts: &[StreamCount]) -> Option<String> {
    let without: Vec<&str> = counts.iter().filter(|c| c.magnetometer == Some(false)).map(|c| c.name.as_str()).collect();
    if without.is_empty() || run.config().magnetometer == Magnetometer::Off {
        return None;
    }
    Some(if counts.iter().any(|c| c.magnetometer == Some(true)) {
        format!("no magnetometer readings from: {}", without.join(", "))
    } else {
        "no unit has a magnetometer: headings are relative".into()
    })
}

/// What the readings say of how units sit, if it is not what the model states.
fn fixing(run: &Run) -> Option<String> {
    let says = match run.last()?.links.as_ref()?.fixing {
        Fixing::Skin | Fixing::ThinSkin => return None,
        Fixing::Mount => "nothing moves between units and bones; mounts and lengths are estimated",
        Fixing::Exact => "nothing moves between units and bones, and mounts and lengths are as the model says",
    };
    Some(format!("by the first 20 s of movement {says}"))
}

/// What strapdown links do not use.
fn not_for_links(run: &Run) -> Vec<String> {
    if run.last().is_none_or(|last| last.links.is_none()) {
        return Vec::new();
    }
    let estimate = run.config().estimate.iter().filter(|name| [LENGTHS, MOUNTS].contains(&name.as_str()));
    let (own, usual) = (run.config(), Config::default());
    let settings = [
        ("process_noise", own.process_noise != usual.process_noise),
        ("filter", own.filter != usual.filter),
        ("gate", own.gate != usual.gate),
    ];
    let settings = settings.into_iter().filter(|(_, is_set)| *is_set).map(|(name, _)| name.to_string());
    let unused = estimate.map(|name| format!("estimate = {name}")).chain(settings);
    let text = |what| format!("not used by strapdown links: {what}; structure = \"tree\" uses it");
    unused.map(text).collect()
}

/// Joints whose angle is the reading of their encoder, if nobody chose the structure.
fn not_fused(run: &Run) -> Option<String> {
    let model = &run.tracker().body().model;
    let links = run.last()?.links.as_ref().filter(|_| run.config().structure.or(model.structure).is_none())?;
    let names = links.joints_as_encoded(run.tracker());
    (!names.is_empty()).then(|| {
        format!(
            "{}: the value is the reading of the encoder, because no inertial unit is on the link; structure = \"tree\" in the model \
             file, or `--set structure=tree`, estimates it from all sensors",
            names.join(", ")
        )
    })
}

fn losses(run: &Run) -> Option<String> {
    let first = run.losses_s.first()?;
    let times = run.losses_s.len();
    let when = if times == 1 { format!("at {first:.3} s") } else { format!("{times} times, first at {first:.3} s") };
    Some(format!(
        "the track was lost {when}: most sensors contradicted the state estimate, and the filter was reset; check mounts and \
         lengths, and whether consecutive hinges pass a singular pose (two axes parallel); a ball joint has no such pose"
    ))
}

fn unobserved(run: &Run) -> Vec<String> {
    let body = run.tracker().body();
    let depends = dependence(body);
    let sources = body.suite.sources.len();
    let ever_used = |s: usize| run.series.reports.iter().skip(s).step_by(sources).any(|i| i.used > 0);
    let used: Vec<bool> = (0..sources).map(ever_used).collect();
    let coordinates = body.model.coordinate_count();
    let rows = run.series.time_s.len();
    let mut notes = Vec::new();
    for (j, joint) in body.model.joints.iter().enumerate().filter(|(_, j)| j.kind != JointKind::Fixed) {
        let seen =
            (0..rows).filter(|r| joint.coordinates().all(|c| run.series.observed[r * coordinates + c] == 1)).count();
        if 2 * seen >= rows && rows > 0 {
            continue;
        }
        let felt = (0..sources).any(|s| used[s] && depends[s][j]);
        let why = match (joint.input, felt) {
            (true, _) if seen > 0 => "its encoder has readings at fewer than half of the rows",
            (true, _) => "no stream",
            (false, false) => "no working sensor measures it",
            (false, true) => "its sensors do not determine it",
        };
        notes.push(format!("{}: not observed ({why})", joint.name));
    }
    notes
}
