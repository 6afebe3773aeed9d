//! A body in which every kind of joint carries every other and every kind of state can be estimated.

/// Hinge, free joint, slide, ball and a hinge that two frames share stand in one chain; a branch hangs on an input joint with
/// a sign and closes a loop; lengths stand in transforms, offsets and points.
pub const MIXED: &str = r#"
format = 1
name = "mixed"
description = "every kind of joint, sensor and state"
joint = [
    { name = "lean", kind = "hinge" },
    { name = "float", kind = "free" },
    { name = "rail", kind = "slide" },
    { name = "ball", kind = "ball" },
    { name = "bend", kind = "hinge" },
    { name = "drift", kind = "slide", process = { kind = "walk", density = 0.1, start_std = 0.1 } },
    { name = "wheel", kind = "hinge", input = true, std = 0.01 },
    { name = "ram", kind = "slide", input = true, std = 0.002 },
]
frame = [
    { name = "a", parent = "root", transform = { translation = [0.1, "l_first", 0.2], rpy = [0.2, -0.3, 0.5] },
      joint = "lean", axis = "y", sign = -1 },
    { name = "b", parent = "a", transform = { translation = [0.1, -0.2, 0.3], rpy = [1.0, 0.4, -0.6] }, joint = "float" },
    { name = "c", parent = "b", dh = { a = "l_first", alpha = "pi/3", d = "l_second - 0.1", theta = 0.3 },
      joint = "rail", sign = -1 },
    { name = "d", parent = "c", transform = { translation = [0, "0.5*l_second", -0.4], rpy = [0, 0.5, 0.3] },
      joint = "ball" },
    { name = "e", parent = "d", dh = { a = "l_second", alpha = -0.7, d = "2*l_first", theta = -0.4 }, joint = "bend" },
    { name = "f", parent = "e", dh = { a = 0.1, alpha = 0.2, d = 0, theta = 0 }, joint = "bend", sign = -1 },
    { name = "g", parent = "e", transform = { translation = [0, 0, "l_first"] }, joint = "drift", axis = "x" },
    { name = "h", parent = "a", transform = { translation = [0.3, "-l_second", 0] }, joint = "wheel", axis = "x",
      sign = -1 },
    { name = "i", parent = "h", transform = { translation = [0.1, 0.2, 0] }, joint = "ram", axis = "z" },
]
sensor = [
    { name = "on_b", kind = "imu", frame = "b", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.05, rest_std_rad_s = 0.005,
      mount.offset = [0.05, "0.1*l_first", -0.1], mount.std_rad = 0.1 },
    { name = "on_f", kind = "imu", frame = "f", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.05, mag_std_ut = 1.0,
      mount.offset = [0.03, 0, "-0.5*l_second"], mount.rpy = [0.4, -0.2, 1.0], mount.std_rad = 0.1 },
    { name = "on_g", kind = "imu", frame = "g", accel_std_m_s2 = 0.05, mag_std_ut = 1.0, mount.rpy = [0, 1.0, 0.3] },
    { name = "on_i", kind = "imu", frame = "i", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.05, mag_std_ut = 1.0 },
    { name = "place", kind = "position", frame = "f", point = [0.02, "l_second", 0.05], std_m = 0.01 },
    { name = "angle", kind = "encoder", joint = "bend", std = 0.01 },
]
closure = [
    { name = "grip", frame_a = "f", point_a = [0.1, "l_first", 0], axis_a = "z", frame_b = "i",
      point_b = [0, 0.2, "-l_second"], axis_b = "x", std_m = 0.002, std_axis = 0.005 },
    { name = "touch", frame_a = "c", frame_b = "g", std_m = 0.002 },
]
base_acceleration = [
    { name = "surge", axis = [1, 0, 0], density = 1.0, start_std = 0.5, time_s = 0.7 },
    { name = "heave", axis = [0, 0, 1], density = 0.5, start_std = 0.5 },
]
[parameters]
l_first = { default = 0.4, unit = "m", std = 0.05 }
l_second = { default = 0.3, unit = "m", std = 0.05 }
[world]
up = [0, 0, 1]
forward = [1, 0, 0]
magnetic_norm_ut = 47.0
magnetic_dip_rad = "60*pi/180"
"#;

/// The same on a root that stands still, with points that touch the ground.
pub fn standing() -> String {
    let (first, last) = (MIXED.find("base_acceleration"), MIXED.find("[parameters]"));
    let (first, last) = first.zip(last).expect("both sections");
    let still = [&MIXED[..first], &MIXED[last..]].concat();
    let touches = |point: &str| format!("contact = {{ point = {point}, std_m_s = 0.1 }}, mount.offset = [0.0");
    let on_b = still.replace("mount.offset = [0.05", &(touches("[0.2, \"-l_second\", 0.1]") + "5"));
    on_b.replace("mount.offset = [0.03", &(touches("[\"l_first\", 0.3, -0.2]") + "3"))
}
