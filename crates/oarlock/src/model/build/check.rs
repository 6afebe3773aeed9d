//! Checks of a model that involve several of its parts.

use super::super::locate::Mistakes;
use super::super::slot::Named;
use super::super::spec::Spec;
use super::super::{JointKind, Model, SensorKind};

/// Directions with a larger cosine count as the same.
const SAME_DIRECTION: f64 = 0.9999;

/// Reports duplicate names and names that would give two states the same name.
pub(super) fn names(spec: &Spec, mistakes: &Mistakes) {
    let of = |kind: &'static str, names: Vec<&Named>| names.into_iter().map(|n| (kind, n.clone())).collect::<Vec<_>>();
    let joints = of("joint", spec.joints.iter().map(|j| &j.name).collect());
    let frames = of("frame", spec.frames.iter().map(|f| &f.name).collect());
    let mut readings = of("sensor", spec.sensors.iter().map(|s| &s.0).collect());
    readings.extend(of("closure", spec.closures.iter().map(|c| &c.0).collect()));
    let mut states = joints;
    states.extend(of("base_acceleration", spec.base_accelerations.iter().map(|(name, _)| name).collect()));
    for names in [&states, &frames, &readings] {
        refuse_twice(names, mistakes);
    }
    for (kind, name) in states.iter().filter(|(_, name)| name.text == "azimuth") {
        let text = format!("{kind} `azimuth`: the name of the magnetic field's direction; expected another");
        mistakes.add(name.at, text);
    }
}

fn refuse_twice(names: &[(&str, Named)], mistakes: &Mistakes) {
    for (i, (kind, name)) in names.iter().enumerate().filter(|(_, (_, name))| !name.text.is_empty()) {
        if let Some((other, first)) = names[..i].iter().find(|(_, other)| other.text == name.text) {
            let line = mistakes.line(first.at);
            let text =
                format!("{kind} `{}`: the name is taken by the {other} of line {line}; give it another", name.text);
            mistakes.add(name.at, text);
        }
    }
}

/// Reports parts that do not fit each other.
pub(super) fn whole(spec: &Spec, model: &Model, mistakes: &Mistakes) {
    if spec.frames.is_empty() {
        mistakes.add(0, "the file has no [[frame]]; a body needs at least one, with parent = \"root\"");
    }
    unused_joints(spec, mistakes);
    signs_and_axes(spec, model, mistakes);
    joint_readings(spec, model, mistakes);
    same_base_accelerations(spec, mistakes);
}

fn unused_joints(spec: &Spec, mistakes: &Mistakes) {
    for joint in spec.joints.iter().filter(|j| !j.name.text.is_empty()) {
        let used = spec.frames.iter().filter_map(|f| f.joint.as_ref()).any(|j| j.text == joint.name.text);
        if !used {
            let name = &joint.name.text;
            let text = format!("joint `{name}` moves no frame; write joint = \"{name}\" in a [[frame]] or remove it");
            mistakes.add(joint.name.at, text);
        }
    }
}

/// A ball has neither a sign nor an axis.
fn signs_and_axes(spec: &Spec, model: &Model, mistakes: &Mistakes) {
    for frame in &spec.frames {
        let Some(named) = &frame.joint else { continue };
        let Some(joint) = model.joints.iter().find(|j| j.name == named.text && j.kind.turns_freely()) else {
            continue;
        };
        if frame.sign != 1.0 || frame.has_axis {
            let text = format!(
                "frame `{}`: joint `{}` turns in all directions: remove `sign` and `axis`",
                frame.name.text, joint.name
            );
            mistakes.add(named.at, text);
        }
    }
}

/// A joint without a sensor has no reading noise.
fn joint_readings(spec: &Spec, model: &Model, mistakes: &Mistakes) {
    let mut read = vec![false; model.joints.len()];
    for sensor in &model.sensors {
        if let SensorKind::Encoder(encoder) = &sensor.kind {
            read[encoder.joint] = true;
        }
    }
    for (spec, read) in spec.joints.iter().zip(read) {
        let Some((_, at)) = spec.std.filter(|_| !spec.joint.input && !read) else {
            continue;
        };
        let text = "`std` is the noise of a reading, but nothing reads this joint; add a [[sensor]] with \
                    kind = \"encoder\", or input = true";
        mistakes.add(at, format!("joint `{}`: {text}", spec.name.text));
    }
}

/// Reports if no joint lies between the two sides.
pub(super) fn moves(model: &Model, [mut a, mut b]: [usize; 2]) -> bool {
    // The later frame is never an ancestor of the other.
    while a != b {
        let later = if a > b { &mut a } else { &mut b };
        let frame = &model.frames[*later];
        if frame.joint.is_some_and(|(j, _)| model.joints[j].kind != JointKind::Fixed) {
            return true;
        }
        *later = frame.parent;
    }
    false
}

fn same_base_accelerations(spec: &Spec, mistakes: &Mistakes) {
    let all = &spec.base_accelerations;
    for (i, (name, one)) in all.iter().enumerate() {
        let along = |other: &[f64; 3]| one.axis.iter().zip(other).map(|(a, b)| a * b).sum::<f64>().abs();
        if let Some((_, other)) = all[..i].iter().find(|(_, other)| along(&other.axis) > SAME_DIRECTION) {
            let text =
                format!("acts along the same line as `{}`; only one of them is observable; remove one", other.name);
            mistakes.add(name.at, format!("base_acceleration `{}`: {text}", name.text));
        }
    }
}
