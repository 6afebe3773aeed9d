//! What only shows when the parts of a model are seen together.

use super::super::locate::Mistakes;
use super::super::slot::Named;
use super::super::spec::{Spec, What};
use super::super::{Closure, JointKind, Model};

/// Two directions closer than this cosine are the same.
const SAME_DIRECTION: f64 = 0.9999;

/// Names that stand twice or that would name two states.
pub(super) fn names(spec: &Spec, mistakes: &Mistakes) {
    let of = |kind: &'static str, names: Vec<&Named>| names.into_iter().map(|n| (kind, n.clone())).collect::<Vec<_>>();
    let joints = of("joint", spec.joints.iter().map(|j| &j.name).collect());
    let frames = of("frame", spec.frames.iter().map(|f| &f.name).collect());
    let mut readings = of("sensor", spec.sensors.iter().map(|s| &s.name).collect());
    readings.extend(of("closure", spec.closures.iter().map(|c| &c.name).collect()));
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

/// Parts that do not fit each other.
pub(super) fn whole(spec: &Spec, model: &Model, mistakes: &Mistakes) {
    if spec.frames.is_empty() {
        mistakes.add(0, "the file has no [[frame]]; a body needs at least one, with parent = \"root\"");
    }
    unused_joints(spec, mistakes);
    signs_and_axes(spec, model, mistakes);
    joint_readings(spec, model, mistakes);
    magnetic_field(spec, mistakes);
    loops(spec, model, mistakes);
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

fn joint_readings(spec: &Spec, model: &Model, mistakes: &Mistakes) {
    let mut read = vec![false; model.joints.len()];
    for sensor in &spec.sensors {
        let What::Encoder { joint: Some(name), .. } = &sensor.what else {
            continue;
        };
        let Some(index) = model.joints.iter().position(|j| j.name == name.text) else {
            continue;
        };
        read[index] = true;
        if model.joints[index].kind.turns_freely() {
            let text = format!(
                "sensor `{}`: joint `{}` turns in all directions, an encoder reads one; make it a hinge or slide",
                sensor.name.text, name.text
            );
            mistakes.add(name.at, text);
        }
        if model.joints[index].kind == JointKind::Fixed {
            let text = format!(
                "sensor `{}`: joint `{}` is fixed, an encoder has nothing to read",
                sensor.name.text, name.text
            );
            mistakes.add(name.at, format!("{text}; make it a hinge or slide, or remove the sensor"));
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

fn magnetic_field(spec: &Spec, mistakes: &Mistakes) {
    let magnetometer = |what: &What| matches!(what, What::Imu { noise, .. } if noise.mag_std.is_some());
    if let Some(sensor) = spec.sensors.iter().find(|s| magnetometer(&s.what) && !spec.has_field) {
        let text = format!(
            "sensor `{}` has a magnetometer (mag_std_ut), but [world] lacks magnetic_norm_ut (such as 47.0) or \
             magnetic_dip_rad (such as \"60*pi/180\")",
            sensor.name.text
        );
        mistakes.add(sensor.name.at, text);
    }
}

fn loops(spec: &Spec, model: &Model, mistakes: &Mistakes) {
    for closure in &model.closures {
        let Some(named) = spec.closures.iter().find(|c| c.name.text == closure.name) else {
            continue;
        };
        let [(a, _), (b, _)] = closure.sides;
        if a == b {
            let frame = &model.frames[a].name;
            let text = format!("closure `{}`: both sides are on frame `{frame}`; expected two frames", closure.name);
            mistakes.add(named.name.at, text);
        } else if mistakes.is_empty() && !moves(model, closure) {
            let text = format!(
                "closure `{}`: no joint moves `{}` against `{}`; a loop needs one between its sides",
                closure.name, model.frames[a].name, model.frames[b].name
            );
            mistakes.add(named.name.at, text);
        }
    }
}

/// Some joint lies on the way from one side to the other.
fn moves(model: &Model, closure: &Closure) -> bool {
    let [mut a, mut b] = closure.sides.clone().map(|(frame, _)| frame);
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
            let text = format!("acts along the same line as `{}`; only one can be told", other.name);
            mistakes.add(name.at, format!("base_acceleration `{}`: {text}", name.text));
        }
    }
}
