//! A small body with every kind of joint.

/// The same body, its start so well known that readings are nearly straight there: from 0.05 rad the curvature that no sigma
/// point sees adds 3 % to NEES, and an eighth to that of the first smoothed state.
pub fn narrow() -> String {
    narrow_of(TREE)
}

pub fn narrow_of(tree: &str) -> String {
    let wide = ["[0.05, 0.2, 1.0]", "[0.1, 0.2, 1.0]", "[0.02, 0.2, 1.0]"];
    wide.iter().fold(tree.to_string(), |text, wide| text.replace(wide, "[0.02, 0.05, 0.25]"))
}

/// A body with its pelvis on a ball that stands still, and a field whose azimuth is a state: body and field may turn together.
pub fn standing(text: &str) -> String {
    let free = r#"kind = "free",
      process = { kind = "singer", density = 4.0, start_std = [0.05, 0.2, 1.0], time_s = 0.5 },
      translation = { kind = "singer", density = 3.0, start_std = [0.1, 0.2, 1.0], time_s = 0.3 } }"#;
    let ball = r#"kind = "ball",
      process = { kind = "singer", density = 4.0, start_std = [0.05, 0.2, 1.0], time_s = 0.5 } }"#;
    assert!(text.contains(free), "the pelvis");
    text.replace(free, ball).replace("azimuth_fixed = true", "azimuth_fixed = false")
}

/// A pelvis that is free, a thigh on a ball, a shank on a hinge, a sled on a slide; one inertial unit each, a position on the
/// pelvis and an encoder at the knee, which alone could not tell its own bias.
pub const TREE: &str = r#"
format = 1
name = "tree"
description = "every kind of joint"
joint = [
    { name = "pelvis", kind = "free",
      process = { kind = "singer", density = 4.0, start_std = [0.05, 0.2, 1.0], time_s = 0.5 },
      translation = { kind = "singer", density = 3.0, start_std = [0.1, 0.2, 1.0], time_s = 0.3 } },
    { name = "hip", kind = "ball", angles = "YXY" },
    { name = "knee", kind = "hinge" },
    { name = "rail", kind = "slide" },
]
frame = [
    { name = "pelvis", parent = "root", transform = { translation = [0.1, 0, 0.2], rpy = [0.2, -0.3, 0.5] },
      joint = "pelvis" },
    { name = "thigh", parent = "pelvis", transform = { translation = [0.1, -0.2, 0.3], rpy = [1.0, 0.4, -0.6] },
      joint = "hip" },
    { name = "shank", parent = "thigh", transform = { translation = [0, 0.1, -0.4] }, joint = "knee", axis = "y" },
    { name = "sled", parent = "shank", transform = { translation = [0, 0, -0.3], rpy = [0, 0.5, 0] }, joint = "rail",
      axis = "x", sign = -1 },
]
sensor = [
    { name = "pelvis", kind = "imu", frame = "pelvis", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.05, mag_std_ut = 1.0,
      mount.offset = [0.05, 0.02, -0.1] },
    { name = "thigh", kind = "imu", frame = "thigh", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.05, mag_std_ut = 1.0,
      mount.offset = [0.03, 0, -0.2], mount.rpy = [0.4, -0.2, 1.0] },
    { name = "sled", kind = "imu", frame = "sled", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.05, mag_std_ut = 1.0,
      mount.rpy = [0, 1.0, 0.3] },
    { name = "place", kind = "position", frame = "pelvis", point = [0.02, 0.1, 0.05], std_m = 0.01 },
    { name = "angle", kind = "encoder", joint = "knee", std = 0.01 },
]
base_acceleration = [
    { name = "surge", axis = [1, 0, 0], density = 1.0, start_std = 0.5, time_s = 0.7 },
    { name = "heave", axis = [0, 0, 1], density = 0.5, start_std = 0.5, rise_s = 0.05 },
]
[world]
up = [0, 0, 1]
forward = [1, 0, 0]
magnetic_norm_ut = 47.0
magnetic_dip_rad = "60*pi/180"
magnetic_azimuth_rad = 0.3
azimuth_fixed = true
[process]
hinge = { kind = "jerk", density = 2.0, start_std = [0.05, 0.2, 1.0] }
slide = { kind = "jerk", density = 1.0, start_std = [0.02, 0.2, 1.0] }
ball = { kind = "jerk", density = 2.0, start_std = [0.05, 0.2, 1.0] }
"#;

/// The same body with distances and orientations: one with the model's own heading and slow errors, two whose devices share an
/// unknown heading, one of them with independent errors.
pub fn spanned() -> String {
    let more = r#"    { name = "span", kind = "range", frame_a = "sled", point_a = [0.1, 0, -0.2], frame_b = "root",
      point_b = [1.5, 0.4, 0], std_m = 0.01 },
    { name = "stride", kind = "range", frame_a = "shank", frame_b = "pelvis", point_b = [-0.3, 0.2, 0.4], std_m = 0.005 },
    { name = "north", kind = "orientation", frame = "pelvis", mount.rpy = [0.1, 0.7, -0.4], std_rad = 0.03,
      correlation_time_s = 0.4 },
    { name = "astray", kind = "orientation", frame = "thigh", mount.rpy = [-0.5, 0.2, 0.9], std_rad = 0.02,
      white_std_rad = 0.01, heading = "unknown", heading_group = "device" },
    { name = "lone", kind = "orientation", frame = "sled", std_rad = 0.02, correlation_time_s = 0, heading = "unknown",
      heading_group = "device", heading_walk = 0.01 },
]"#;
    TREE.replacen("]\nbase_acceleration", &format!("{more}\nbase_acceleration"), 1)
}
