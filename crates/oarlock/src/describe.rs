//! Description of a model as plain data (names and numbers) for other languages. Python's `Model.describe` uses it.

use crate::body::Body;
use crate::model::cone::Cone;
use crate::model::{Frame, Joint, JointKind, Process, ProcessKind, Sensor, Transform};
use crate::sensor::kind::{Described, Kind};
use serde_json::{json, Value};

/// Everything in the model; numbers in SI and rad at the model's parameter values.
pub fn describe(body: &Body, path: &str) -> Value {
    let m = &body.model;
    let values: Vec<f64> = m.parameters.iter().map(|p| p.default).collect();
    let at = Described { model: m, values: &values };
    let w = &m.world;
    json!({
        "name": m.name, "description": m.description, "path": path,
        "world": {"up": w.up, "forward": w.forward, "gravity_m_s2": w.gravity_m_s2,
            "magnetic_norm_ut": w.magnetic_norm_ut.eval(&values), "magnetic_dip_rad": w.magnetic_dip_rad.eval(&values),
            "magnetic_azimuth_rad": w.magnetic_azimuth_rad, "azimuth_fixed": w.azimuth_fixed,
            "azimuth_walk": w.azimuth_walk},
        "parameters": m.parameters.iter().map(|p| json!({"name": p.name, "value": p.default, "unit": p.unit,
            "std": p.std, "label": p.label})).collect::<Vec<_>>(),
        "joints": m.joints.iter().map(joint).collect::<Vec<_>>(),
        "frames": m.frames.iter().enumerate().map(|(i, f)| frame(i, f, body, &values)).collect::<Vec<_>>(),
        "sensors": m.sensors.iter().map(|s| sensor(s, &at)).collect::<Vec<_>>(),
        "closures": m.closures.iter().map(|c| c.describe(&at)).collect::<Vec<_>>(),
        "base_acceleration": m.base_accelerations.iter().map(|b| json!({"name": b.name, "label": b.label,
            "axis": b.axis, "density": b.density, "start_std": b.start_std,
            "time_s": finite(b.time_s), "rise_s": b.rise_s, "always": b.always})).collect::<Vec<_>>(),
        "state_names": body.layout.names, "measurement_names": body.suite.row_names(),
    })
}

fn joint(j: &Joint) -> Value {
    let kind = match j.kind {
        JointKind::Fixed => "fixed",
        JointKind::Hinge => "hinge",
        JointKind::Slide => "slide",
        JointKind::Ball => "ball",
        JointKind::Free => "free",
    };
    let moves = !j.input && j.kind != JointKind::Fixed;
    let rest = if j.kind.width() == 1 { json!(j.rest[0]) } else { json!(j.rest) };
    let mut out = json!({"name": j.name, "kind": kind, "label": j.label, "coordinates": j.coordinate_names(),
        "limits": j.limits, "cone": j.cone.as_ref().map(cone), "rest": rest, "input": j.input, "std": j.input.then_some(j.input_std),
        "process": moves.then(|| process(&j.process)), "angles": j.kind.turns_freely().then_some(&j.angles)});
    if let Some(t) = &j.translation {
        out["translation"] = process(&t.process);
        out["translation"]["limits"] = json!(t.limits);
    }
    out
}

fn cone(c: &Cone) -> Value {
    let axis = ["x", "y", "z"][c.axis];
    json!({"axis": axis, "swing": c.swing, "twist": c.twist})
}

fn process(p: &Process) -> Value {
    match p.kind {
        ProcessKind::Jerk => json!({"kind": "jerk", "density": p.density, "start_std": p.start_std}),
        ProcessKind::Walk => json!({"kind": "walk", "density": p.density, "start_std": [p.start_std[0]]}),
        ProcessKind::Singer => {
            json!({"kind": "singer", "density": p.density, "start_std": p.start_std, "time_s": p.time_s})
        }
    }
}

fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

fn frame(index: usize, f: &Frame, body: &Body, values: &[f64]) -> Value {
    let m = &body.model;
    let parent = (index > 0).then(|| m.frames[f.parent].name.clone());
    let fixed = |t: &Option<Transform>| {
        let (rotation, translation) = t.as_ref()?.evaluate(values);
        Some(json!({"rotation": rotation.0, "translation": translation}))
    };
    json!({"name": f.name, "parent": parent, "joint": f.joint.map(|(j, _)| m.joints[j].name.clone()),
        "sign": f.joint.map_or(1.0, |(_, s)| s), "before": fixed(&f.before), "after": fixed(&f.after)})
}

fn sensor(s: &Sensor, at: &Described) -> Value {
    // Keys of every kind of sensor.
    let mut out =
        json!({"name": s.name, "kind": s.kind.name(), "frame": null, "joint": null, "std": null, "std_m": null});
    if let (Value::Object(out), Value::Object(own)) = (&mut out, s.kind.describe(at)) {
        out.extend(own);
    }
    out
}
