//! A model as plain data: names and numbers that other languages can read.

use crate::body::Body;
use crate::model::{Expr, Frame, Joint, JointKind, Process, ProcessKind, Sensor, SensorKind, Transform};
use serde_json::{json, Value};

/// Everything in the model; numbers in SI and rad at the model's parameter values.
pub fn describe(body: &Body, path: &str) -> Value {
    let m = &body.model;
    let values: Vec<f64> = m.parameters.iter().map(|p| p.default).collect();
    let frame_name = |i: usize| m.frames[i].name.clone();
    let point = |p: &[Expr; 3]| numbers(p, &values);
    let closure = |c: &crate::model::Closure| {
        json!({"name": c.name, "frame_a": frame_name(c.sides[0].0), "frame_b": frame_name(c.sides[1].0),
            "point_a": point(&c.sides[0].1), "point_b": point(&c.sides[1].1),
            "axis_a": c.axes.map(|a| a[0]), "axis_b": c.axes.map(|a| a[1]),
            "std_m": c.std_m, "std_axis": c.std_axis})
    };
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
        "sensors": m.sensors.iter().map(|s| sensor(s, body, &values)).collect::<Vec<_>>(),
        "closures": m.closures.iter().map(closure).collect::<Vec<_>>(),
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
        "limits": j.limits, "rest": rest, "input": j.input, "std": j.input.then_some(j.input_std),
        "process": moves.then(|| process(&j.process)), "angles": j.kind.turns_freely().then_some(&j.angles)});
    if let Some(t) = &j.translation {
        out["translation"] = process(&t.process);
        out["translation"]["limits"] = json!(t.limits);
    }
    out
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

fn sensor(s: &Sensor, body: &Body, values: &[f64]) -> Value {
    let m = &body.model;
    match &s.kind {
        SensorKind::Imu { frame, mount, noise } => json!({
            "name": s.name, "kind": "imu", "frame": m.frames[*frame].name, "joint": null, "std": null, "std_m": null,
            "gyro_std_rad_s": noise.gyro_std, "accel_std_m_s2": noise.accel_std, "mag_std_ut": noise.mag_std,
            "rest_std_rad_s": noise.rest_std,
            "gyro_range_rad_s": noise.gyro_range, "accel_range_m_s2": noise.accel_range,
            "mount": {"rotation": mount.rotation.0, "offset": numbers(&mount.offset, values)}}),
        SensorKind::Encoder { joint, std } => json!({
            "name": s.name, "kind": "encoder", "frame": null, "joint": m.joints[*joint].name, "std": std, "std_m": null}),
        SensorKind::Position { frame, point, std } => json!({
            "name": s.name, "kind": "position", "frame": m.frames[*frame].name, "joint": null, "std": null, "std_m": std,
            "point": numbers(point, values)}),
    }
}

fn numbers(v: &[Expr; 3], values: &[f64]) -> [f64; 3] {
    [0, 1, 2].map(|i: usize| v[i].eval(values))
}
