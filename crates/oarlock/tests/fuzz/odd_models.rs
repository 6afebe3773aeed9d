//! Model files that are right and that nobody would write: one joint or a hundred, no sensor, loops that cannot close.

use super::campaign::campaign;
use super::models::answered;
use super::numbers::{index, one_in, pick};
use super::settings::config;
use super::streams::{samples, step_through};
use super::support::chance::Chance;
use oarlock::config::{Config, FilterKind};
use oarlock::model::Model;
use oarlock::track::{Calibration, Tracker};
use std::fmt::Write;
use std::sync::Arc;

const KINDS: [&str; 5] = ["hinge", "hinge", "slide", "ball", "free"];
const PROCESSES: [&str; 6] = [
    "",
    "process = { kind = \"walk\", density = 0.1, start_std = [0.2] }\n",
    "process = { kind = \"singer\", time_s = 1e-6, density = 1e6, start_std = [0.1, 1, 3] }\n",
    "process = { kind = \"singer\", time_s = 1e6, density = 1e-9, start_std = [1e-9, 1e-9, 1e-9] }\n",
    "process = { density = 1e-12, start_std = [1e-6, 1e-6, 1e-6] }\n",
    "process = { density = 1e9, start_std = [1e3, 1e6, 1e9] }\n",
];

/// What a body is made of.
struct Parts {
    joints: usize,
    kind: Option<&'static str>,
    /// Every frame hangs on the root, on the one before, or anywhere.
    shape: usize,
    sensors: usize,
    closures: usize,
    inputs: bool,
    odd_processes: bool,
}

impl Parts {
    fn any(chance: &mut Chance) -> Self {
        let plain = Parts {
            joints: 1 + index(chance, 6),
            kind: None,
            shape: index(chance, 3),
            sensors: 1 + index(chance, 4),
            closures: 0,
            inputs: one_in(chance, 5),
            odd_processes: one_in(chance, 3),
        };
        match index(chance, 16) {
            0 | 1 => Parts { joints: 1, ..plain },
            2 | 3 => Parts { sensors: 0, ..plain },
            4 | 5 => Parts { joints: 1, sensors: 0, closures: index(chance, 2), ..plain },
            6..=8 => Parts { closures: 1 + index(chance, 3), ..plain },
            9 => Parts { inputs: true, sensors: 0, ..plain },
            10 => Parts { sensors: 12, ..plain },
            11 => Parts { kind: Some("fixed"), ..plain },
            12 => Parts { joints: 30, kind: Some("hinge"), ..plain },
            13 if one_in(chance, 6) => Parts { joints: 100, kind: Some("hinge"), ..plain },
            _ => plain,
        }
    }
}

fn text(chance: &mut Chance) -> String {
    let parts = Parts::any(chance);
    let fixed = if one_in(chance, 2) { "azimuth_fixed = true\n" } else { "" };
    let mut text = format!(
        "format = 1\nname = \"odd\"\n[world]\nup = \"{}\"\nforward = \"z\"\nmagnetic_norm_ut = 47\n\
         magnetic_dip_rad = \"{}*pi/180\"\n{fixed}[parameters]\nlong = {{ default = 0.3, unit = \"m\", std = 0.01 }}\n",
        pick(chance, &["y", "-y", "x"]),
        pick(chance, &["60", "0", "-89.9"]),
    );
    for k in 0..parts.joints {
        joint(chance, &parts, k, &mut text);
    }
    for k in 0..parts.joints {
        frame(chance, &parts, k, &mut text);
    }
    // Joints that move two frames.
    for k in 0..index(chance, 3) {
        let moved = index(chance, parts.joints);
        writeln!(text, "[[frame]]\nname = \"g{k}\"\nparent = \"f{moved}\"\ntransform = {{}}\njoint = \"j{moved}\"")
            .unwrap();
    }
    for k in 0..parts.sensors {
        sensor(chance, &parts, k, &mut text);
    }
    for k in 0..parts.closures {
        closure(chance, &parts, k, &mut text);
    }
    if one_in(chance, 6) {
        let always = one_in(chance, 2);
        let push = "[[base_acceleration]]\nname = \"push\"\naxis = \"z\"\ndensity = 50\nstart_std = 3\n";
        writeln!(text, "{push}always = {always}").unwrap();
    }
    text
}

fn joint(chance: &mut Chance, parts: &Parts, k: usize, text: &mut String) {
    let kind = parts.kind.unwrap_or_else(|| *pick(chance, &KINDS));
    write!(text, "[[joint]]\nname = \"j{k}\"\nkind = \"{kind}\"\n").unwrap();
    let single = matches!(kind, "hinge" | "slide");
    if single && parts.inputs && one_in(chance, 2) {
        text.push_str("input = true\n");
    } else if parts.odd_processes && kind != "fixed" {
        let process = *pick(chance, &PROCESSES);
        if single || !process.contains("walk") {
            text.push_str(process);
        }
    }
    if single && one_in(chance, 4) {
        let limits = *pick(chance, &["[-1e-9, 1e-9]", "[-6, 6]", "[2, 3]"]);
        writeln!(text, "limits = {limits}").unwrap();
    }
}

/// A name of one of the frames so far, or the root's.
fn some_frame(chance: &mut Chance, count: usize) -> String {
    match index(chance, count + 1) {
        0 => "root".into(),
        k => format!("f{}", k - 1),
    }
}

fn frame(chance: &mut Chance, parts: &Parts, k: usize, text: &mut String) {
    let parent = match parts.shape {
        0 => "root".into(),
        1 if k > 0 => format!("f{}", k - 1),
        _ => some_frame(chance, k),
    };
    let place = *pick(
        chance,
        &[
            "transform = { translation = [\"long\", 0, 0] }",
            "transform = {}",
            "transform = { rpy = [1.5707963, 0, 0.3], translation = [0, 0, -0.2] }",
            "transform = { translation = [99, 0, 0] }",
        ],
    );
    write!(text, "[[frame]]\nname = \"f{k}\"\nparent = \"{parent}\"\n{place}\n").unwrap();
    writeln!(text, "joint = \"j{k}\"").unwrap();
}

fn sensor(chance: &mut Chance, parts: &Parts, k: usize, text: &mut String) {
    let frame = some_frame(chance, parts.joints);
    let single = !text.contains("\"ball\"") && !text.contains("\"free\"") && !text.contains("\"fixed\"");
    let rest = match index(chance, 8) {
        0 => format!("kind = \"position\"\nframe = \"{frame}\"\nstd_m = 0.01"),
        1 if single => format!("kind = \"encoder\"\njoint = \"j{}\"\nstd = 0.01", index(chance, parts.joints)),
        2 => format!("kind = \"imu\"\nframe = \"{frame}\"\naccel_std_m_s2 = 1e-6"),
        3 => format!("kind = \"imu\"\nframe = \"{frame}\"\nmag_std_ut = 1e3"),
        4 => format!("kind = \"imu\"\nframe = \"{frame}\"\ngyro_std_rad_s = 1e-9\nrest_std_rad_s = 0.01"),
        _ => format!(
            "kind = \"imu\"\nframe = \"{frame}\"\ngyro_std_rad_s = 0.01\naccel_std_m_s2 = 0.05\nmag_std_ut = 1\n\
             mount.offset = [0.1, \"long\", 0]"
        ),
    };
    write!(text, "[[sensor]]\nname = \"s{k}\"\n{rest}\n").unwrap();
}

/// Often between points that no posture brings together.
fn closure(chance: &mut Chance, parts: &Parts, k: usize, text: &mut String) {
    let (a, mut b) = (some_frame(chance, parts.joints), some_frame(chance, parts.joints));
    if a == b {
        b = if a == "root" { "f0".into() } else { "root".into() };
    }
    let far = *pick(chance, &["0", "0.2", "10", "99"]);
    let std = *pick(chance, &["0.01", "1e-6", "10"]);
    write!(
        text,
        "[[closure]]\nname = \"c{k}\"\nframe_a = \"{a}\"\nframe_b = \"{b}\"\npoint_b = [{far}, 0, 0]\nstd_m = {std}\n"
    )
    .unwrap();
    if one_in(chance, 3) {
        let axis = *pick(chance, &["x", "-x", "z"]);
        write!(text, "axis_a = \"x\"\naxis_b = \"{axis}\"\nstd_axis = 0.01\n").unwrap();
    }
}

#[test]
fn odd_models_are_tracked_or_refused() {
    campaign("odd models", 20, |chance, fed| {
        *fed = text(chance);
        let Some(model) = answered(Model::from_toml(fed, "odd.toml")) else { return };
        let model = Arc::new(model);
        let chosen = match index(chance, 4) {
            0 => config(chance, model.coordinate_count()),
            1 => Config { filter: FilterKind::Factorised, ..Config::default() },
            _ => Config::default(),
        };
        let Some(mut tracker) = answered(Tracker::new(model, &Calibration::default(), &chosen)) else { return };
        let count = if tracker.body().layout.dim() > 60 { 3 } else { 12 };
        let samples = samples(chance, &tracker, count);
        write!(fed, "{chosen:?}\n{samples:?}").unwrap();
        step_through(&mut tracker, &samples);
    });
}
