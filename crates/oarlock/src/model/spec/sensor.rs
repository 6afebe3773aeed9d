//! `[[sensor]]` and `[[closure]]`.

use super::frame::read_rotation;
use crate::model::expr::Expr;
use crate::model::section::Section;
use crate::model::slot::{Named, Slot};
use crate::model::{ImuNoise, Mount};
use crate::rotation::Mat3;

pub(in crate::model) const KEYS: [&str; 18] = [
    "name",
    "kind",
    "frame",
    "mount",
    "gyro_std_rad_s",
    "accel_std_m_s2",
    "mag_std_ut",
    "rest_std_rad_s",
    "gyro_range_rad_s",
    "accel_range_m_s2",
    "gyro_bias_start_std_rad_s",
    "gyro_bias_walk",
    "accel_bias_start_std_m_s2",
    "accel_bias_walk",
    "joint",
    "std",
    "point",
    "std_m",
];
pub(in crate::model) const CLOSURE_KEYS: [&str; 9] =
    ["name", "frame_a", "point_a", "frame_b", "point_b", "axis_a", "axis_b", "std_m", "std_axis"];

/// A sensor whose frame or joint is still a name.
pub(in crate::model) struct SensorSpec {
    pub(in crate::model) name: Named,
    pub(in crate::model) what: What,
}

/// What it reads; `Nothing` stands for a kind that is not known.
pub(in crate::model) enum What {
    Imu { frame: Option<Named>, mount: Mount, noise: ImuNoise },
    Encoder { joint: Option<Named>, std: f64 },
    Position { frame: Option<Named>, point: [Expr; 3], std: f64 },
    Nothing,
}

/// A closed loop whose frames are still names.
pub(in crate::model) struct ClosureSpec {
    pub(in crate::model) name: Named,
    pub(in crate::model) sides: [(Option<Named>, [Expr; 3]); 2],
    pub(in crate::model) axes: Option<[[f64; 3]; 2]>,
    pub(in crate::model) std_m: f64,
    pub(in crate::model) std_axis: f64,
}

/// A unit that was put on by eye, rad.
const MOUNT_STD_RAD: f64 = 0.1;

/// The keys of each kind, beside `name` and `kind`.
const IMU_KEYS: [&str; 12] = [
    "frame",
    "mount",
    "gyro_std_rad_s",
    "accel_std_m_s2",
    "mag_std_ut",
    "rest_std_rad_s",
    "gyro_range_rad_s",
    "accel_range_m_s2",
    "gyro_bias_start_std_rad_s",
    "gyro_bias_walk",
    "accel_bias_start_std_m_s2",
    "accel_bias_walk",
];
const ENCODER_KEYS: [&str; 2] = ["joint", "std"];
const POSITION_KEYS: [&str; 3] = ["frame", "point", "std_m"];

#[derive(Clone, Copy)]
enum Kind {
    Imu,
    Encoder,
    Position,
}

pub(super) fn read(section: &Section) -> SensorSpec {
    let name = super::named(section, "\"back\"");
    let what = match section.need("kind", "\"imu\"").and_then(|slot| read_kind(&slot)) {
        None => What::Nothing,
        Some(Kind::Imu) => {
            refuse_others(section, "imu", &IMU_KEYS);
            read_imu(section)
        }
        Some(Kind::Encoder) => {
            refuse_others(section, "encoder", &ENCODER_KEYS);
            What::Encoder {
                joint: section.need_reference("joint", "\"seat\""),
                std: need_positive(section, "std", "0.001", "rad or m"),
            }
        }
        Some(Kind::Position) => {
            refuse_others(section, "position", &POSITION_KEYS);
            What::Position {
                frame: section.need_reference("frame", "\"r_wrist\""),
                point: read_point(section, "point"),
                std: need_positive(section, "std_m", "0.002", "m"),
            }
        }
    };
    SensorSpec { name, what }
}

fn read_kind(slot: &Slot) -> Option<Kind> {
    if slot.value.get_ref().as_str() == Some("orientation") {
        slot.mistake("`orientation` is not yet supported; use an imu, or encoders for the angles");
        return None;
    }
    slot.choice(&[("imu", Kind::Imu), ("encoder", Kind::Encoder), ("position", Kind::Position)])
}

/// Keys that exist, but for sensors of another kind.
fn refuse_others(section: &Section, kind: &str, own: &[&str]) {
    for key in KEYS.iter().filter(|key| section.has(key)) {
        if !["name", "kind"].contains(key) && !own.contains(key) {
            let text = format!("`{key}` is no key of an {kind}; it takes {}", own.join(", "));
            section.mistake(section.at_key(key), text.replace("an position", "a position"));
        }
    }
}

fn need_positive(section: &Section, key: &str, example: &str, unit: &str) -> f64 {
    section.need(key, example).and_then(|slot| slot.positive(unit)).unwrap_or(1.0)
}

fn read_point(section: &Section, key: &str) -> [Expr; 3] {
    section.get(key).and_then(|slot| slot.point()).unwrap_or([0.0; 3].map(Expr::constant))
}

fn read_imu(section: &Section) -> What {
    let std = |key, unit| section.get(key).map(|slot: Slot| slot.positive(unit).unwrap_or(1.0));
    let walk = |key, default| section.get(key).and_then(|slot| slot.not_negative("")).unwrap_or(default);
    let noise = ImuNoise {
        gyro_std: std("gyro_std_rad_s", "rad/s"),
        accel_std: std("accel_std_m_s2", "m/s2"),
        mag_std: std("mag_std_ut", "uT"),
        rest_std: std("rest_std_rad_s", "rad/s"),
        gyro_range: std("gyro_range_rad_s", "rad/s"),
        accel_range: std("accel_range_m_s2", "m/s2"),
        gyro_bias_start_std: std("gyro_bias_start_std_rad_s", "rad/s").unwrap_or(0.02),
        gyro_bias_walk: walk("gyro_bias_walk", 1.1e-5),
        accel_bias_start_std: std("accel_bias_start_std_m_s2", "m/s2").unwrap_or(0.05),
        accel_bias_walk: walk("accel_bias_walk", 1.1e-4),
    };
    check_quantities(section, &noise);
    What::Imu { frame: section.need_reference("frame", "\"r_elbow\""), mount: read_mount(section), noise }
}

fn check_quantities(section: &Section, noise: &ImuNoise) {
    if noise.gyro_std.is_none() && noise.accel_std.is_none() && noise.mag_std.is_none() {
        let wanted = "expected at least one of gyro_std_rad_s, accel_std_m_s2, mag_std_ut";
        section.mistake(section.at, format!("measures nothing; {wanted}"));
        return;
    }
    let gyro = ["gyro_bias_start_std_rad_s", "gyro_bias_walk", "gyro_range_rad_s"];
    let accel = ["accel_bias_start_std_m_s2", "accel_bias_walk", "accel_range_m_s2"];
    let both = [("gyro_std_rad_s", gyro, noise.gyro_std), ("accel_std_m_s2", accel, noise.accel_std)];
    for (own, its, std) in both {
        for key in its.iter().filter(|key| std.is_none() && section.has(key)) {
            let text = format!("`{key}` without `{own}`: that quantity is not measured; add it or remove this key");
            section.mistake(section.at_key(key), text);
        }
    }
}

fn read_mount(section: &Section) -> Mount {
    let nothing = Mount { rotation: Mat3::identity(), std_rad: MOUNT_STD_RAD, offset: [0.0; 3].map(Expr::constant) };
    let Some(mount) =
        section.get("mount").and_then(|slot| Section::of(slot, &["rotation", "rpy", "offset", "std_rad"]))
    else {
        return nothing;
    };
    let rotation = read_rotation(&mount).evaluate(&[]);
    if rotation.0.iter().flatten().any(|x| x.is_nan()) {
        let key = if mount.has("rpy") { "rpy" } else { "rotation" };
        mount.mistake(mount.at_key(key), "a mount's rotation takes plain numbers only, no parameters");
    }
    let std_rad = mount.get("std_rad").and_then(|s| s.positive("rad")).unwrap_or(MOUNT_STD_RAD);
    Mount { rotation, std_rad, offset: read_point(&mount, "offset") }
}

pub(super) fn read_closure(section: &Section) -> ClosureSpec {
    let side = |frame, point| (section.need_reference(frame, "\"r_hand\""), read_point(section, point));
    let axes = match (section.get("axis_a"), section.get("axis_b")) {
        (Some(a), Some(b)) => a.axis().zip(b.axis()).map(|(a, b)| [a, b]),
        (None, None) => None,
        (Some(_), None) => {
            section.mistake(section.at_key("axis_a"), "`axis_a` without `axis_b`; give both or neither");
            None
        }
        (None, Some(_)) => {
            section.mistake(section.at_key("axis_b"), "`axis_b` without `axis_a`; give both or neither");
            None
        }
    };
    let has_axes = section.has("axis_a") || section.has("axis_b");
    if section.has("std_axis") && !has_axes {
        section.mistake(section.at_key("std_axis"), "`std_axis` without `axis_a` and `axis_b`; add them or remove it");
    }
    let std_axis = if has_axes { need_positive(section, "std_axis", "0.005", "") } else { 1.0 };
    ClosureSpec {
        name: super::named(section, "\"r_grip\""),
        sides: [side("frame_a", "point_a"), side("frame_b", "point_b")],
        axes,
        std_m: need_positive(section, "std_m", "0.002", "m"),
        std_axis,
    }
}
