//! The shipped models against forward kinematics from an independent implementation.

use super::support::extended::shipped;
use super::support::{numbers, vectors, SCULLER};
use oarlock::model::{JointKind, Model};
use oarlock::rotation::Mat3;
use serde_json::Value;

/// What the vectors promise: both sides are double precision, six links deep.
const AGREES: f64 = 1e-12;

fn model(name: &str) -> Model {
    Model::from_toml(&shipped(name), &format!("{name}.toml")).unwrap_or_else(|e| panic!("{e}"))
}

/// The parameter vector with the lengths and pins of a vector file.
fn parameters(model: &Model, params: &Value) -> Vec<f64> {
    let of = |name: &str| match name {
        "r_pin_x" | "r_pin_y" | "r_pin_z" => numbers(&params["r_0_18"])[axis(name)],
        "l_pin_x" | "l_pin_y" | "l_pin_z" => numbers(&params["r_0_22"])[axis(name)],
        // Level in the vectors.
        "rail_slope_rad" => 0.0,
        "l_b" => params["l_b"].as_f64().expect("l_b"),
        _ => {
            let (stem, side) = name.split_at(name.len() - 1);
            params[format!("{stem}{}", side.to_uppercase())].as_f64().expect(name)
        }
    };
    model.parameters.iter().map(|p| of(&p.name)).collect()
}

fn axis(pin: &str) -> usize {
    ["x", "y", "z"].iter().position(|a| pin.ends_with(a)).expect("a pin's coordinate")
}

/// Poses of all frames in root axes, written as plainly as can be.
fn forward(model: &Model, parameters: &[f64], q: &[f64]) -> Vec<(Mat3<f64>, [f64; 3])> {
    let mut poses = vec![(Mat3::identity(), [0.0; 3])];
    for frame in &model.frames[1..] {
        let mut pose = poses[frame.parent];
        if let Some(before) = &frame.before {
            pose = chained(pose, before.evaluate(parameters));
        }
        if let Some((joint, sign)) = frame.joint {
            pose = chained(pose, moved(model.joints[joint].kind, sign * q[joint]));
        }
        if let Some(after) = &frame.after {
            pose = chained(pose, after.evaluate(parameters));
        }
        poses.push(pose);
    }
    poses
}

fn moved(kind: JointKind, q: f64) -> (Mat3<f64>, [f64; 3]) {
    match kind {
        JointKind::Fixed => (Mat3::identity(), [0.0; 3]),
        JointKind::Hinge => (Mat3::about_z(q), [0.0; 3]),
        JointKind::Slide => (Mat3::identity(), [0.0, 0.0, q]),
        JointKind::Ball | JointKind::Free => panic!("none in these models"),
    }
}

fn chained(a: (Mat3<f64>, [f64; 3]), b: (Mat3<f64>, [f64; 3])) -> (Mat3<f64>, [f64; 3]) {
    let shift = a.0.apply_f64(b.1).0;
    (a.0.times(&b.0), [0, 1, 2].map(|i| a.1[i] + shift[i]))
}

/// Largest difference from a 4 x 4 matrix of a vector file.
fn difference(pose: &(Mat3<f64>, [f64; 3]), wanted: &Value) -> f64 {
    let mut worst: f64 = 0.0;
    for i in 0..3 {
        let row = numbers(&wanted[i]);
        let found = pose.0 .0[i].iter().chain([&pose.1[i]]);
        for (found, wanted) in found.zip(&row) {
            worst = worst.max((found - wanted).abs());
        }
    }
    worst
}

fn assert_agrees(name: &str, file: &str) {
    let (model, vectors) = (model(name), vectors(file));
    let parameters = parameters(&model, &vectors["params"]);
    let postures = vectors["q"].as_array().expect("postures");
    assert!(!postures.is_empty() && model.frames.len() == 26 && model.joints.len() == 22);
    for (k, q) in postures.iter().enumerate() {
        let poses = forward(&model, &parameters, &numbers(q));
        for (i, pose) in poses.iter().enumerate().skip(1) {
            let off = difference(pose, &vectors["T_frames_1_to_25"][k][i - 1]);
            assert!(off < AGREES, "posture {k}, frame {i} `{}`: off by {off:e}", model.frames[i].name);
        }
    }
}

#[test]
fn sculler_agrees() {
    assert_agrees("sculler", "fk.json");
}

#[test]
fn table_two_as_printed_agrees() {
    assert_agrees("sculler_table2", "fk_table2_as_printed.json");
}

#[test]
fn the_two_tables_differ() {
    let vectors = vectors("fk.json");
    let printed = model("sculler_table2");
    let parameters = parameters(&printed, &vectors["params"]);
    let poses = forward(&printed, &parameters, &numbers(&vectors["q"][1]));
    assert!(difference(&poses[9], &vectors["T_frames_1_to_25"][1][8]) > 0.1);
}

#[test]
fn mounts_are_those_of_the_imu_vectors() {
    use oarlock::model::{Imu, SensorKind};
    let (model, vectors) = (model("sculler"), vectors("filter_blocks.json"));
    let wanted = vectors["sensors"].as_array().expect("sensors");
    let parameters = parameters(&model, &vectors["params"]);
    for (sensor, wanted) in model.sensors.iter().zip(wanted) {
        let SensorKind::Imu(Imu { frame, mount, .. }) = &sensor.kind else { panic!("{}: no imu", sensor.name) };
        assert_eq!(*frame as u64, wanted["frame"].as_u64().expect("frame"), "{}", sensor.name);
        for i in 0..3 {
            let row = numbers(&wanted["R_link_from_sensor"][i]);
            let offset = numbers(&wanted["offset_in_link"])[i];
            for (found, wanted) in mount.rotation.0[i].iter().zip(&row) {
                assert!((found - wanted).abs() < AGREES, "{}", sensor.name);
            }
            assert!((mount.offset[i].eval(&parameters) - offset).abs() < AGREES, "{}", sensor.name);
        }
    }
}

#[test]
fn arm7_is_the_scullers_right_arm() {
    let (arm, sculler) = (model("arm7"), model("sculler"));
    let q: Vec<f64> = (0..22).map(|i| 0.3 * ((i * i) as f64).sin()).collect();
    let mut with_arm = vec![0.0; 22];
    with_arm[2..9].copy_from_slice(&q[2..9]);
    let short = forward(&arm, &arm.default_parameters(), &q[2..9]);
    let long = forward(&sculler, &sculler.default_parameters(), &with_arm);
    // Shoulder, elbow, wrist and hand in either model; the arm's origin is the shoulder.
    for (i, j) in [(1, 2), (4, 5), (6, 7), (8, 9)] {
        for k in 0..3 {
            let (found, wanted) = (short[i].1[k], long[j].1[k] - long[2].1[k]);
            assert!((found - wanted).abs() < AGREES, "{}: {found} {wanted}", arm.frames[i].name);
        }
    }
}

#[test]
fn sculler_keeps_its_public_names() {
    let model = model("sculler");
    let frames = [
        (0, "root"),
        (1, "seat"),
        (2, "r_shoulder"),
        (5, "r_elbow"),
        (7, "r_wrist"),
        (9, "r_hand"),
        (10, "l_shoulder"),
        (13, "l_elbow"),
        (15, "l_wrist"),
        (17, "l_hand"),
        (18, "r_oarlock"),
        (21, "r_handle"),
        (22, "l_oarlock"),
        (25, "l_handle"),
    ];
    for (i, name) in frames {
        assert_eq!(model.frames[i].name, name);
    }
    let joints: Vec<&str> = model.joints.iter().map(|j| j.name.as_str()).collect();
    assert_eq!(joints[..3], ["seat", "trunk", "r_shoulder_abduction"]);
    assert_eq!(joints[16..], ["r_oar_phi", "r_oar_alpha", "r_oar_theta", "l_oar_phi", "l_oar_alpha", "l_oar_theta"]);
    assert!(model.joints[16..].iter().all(|j| j.input && j.input_std == 0.001));
    assert_eq!(model.closures.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["r_grip", "l_grip"]);
    assert_eq!(model.base_accelerations[0].name, "surge");
}

#[test]
fn oars_may_be_states() {
    let text = SCULLER.replace("input = true\n", "");
    let model = Model::from_toml(&text, "oars.toml").unwrap_or_else(|e| panic!("{e}"));
    assert!(model.joints.iter().all(|j| !j.input));
}
