//! Bodies that fall apart: a pelvis that floats with two legs, and chains that share nothing.

/// World and processes; the azimuth is known unless a test says otherwise.
const WORLD: &str = r#"
[world]
up = [0, 0, 1]
forward = [1, 0, 0]
magnetic_norm_ut = 47.0
magnetic_dip_rad = "60*pi/180"
magnetic_azimuth_rad = 0.3
azimuth_fixed = true
[process]
hinge = { kind = "jerk", density = 2.0, start_std = [0.05, 0.2, 1.0] }
ball = { kind = "jerk", density = 2.0, start_std = [0.05, 0.2, 1.0] }
"#;

const UNIT: &str = "kind = \"imu\", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.05, mag_std_ut = 1.0";

/// A model of these parts, each with its joints, frames and sensors.
fn text(parts: &[[String; 3]], more: &str) -> String {
    let [joint, frame, sensor] = [0, 1, 2].map(|k| parts.iter().map(|part| part[k].as_str()).collect::<String>());
    format!(
        "format = 1\nname = \"limbs\"\ndescription = \"limbs on a core\"\n\
         joint = [{joint}]\nframe = [{frame}]\nsensor = [{sensor}]\n{more}{WORLD}"
    )
}

/// Two hinges on the root, one unit on each link.
fn chain(side: &str, turned: f64) -> [String; 3] {
    [
        format!(r#"{{ name = "{side}_first", kind = "hinge" }}, {{ name = "{side}_second", kind = "hinge" }},"#),
        format!(
            r#"
    {{ name = "{side}_upper", parent = "root", dh = {{ a = 0.4, alpha = "pi/2", d = 0.1, theta = {turned} }},
      joint = "{side}_first" }},
    {{ name = "{side}_lower", parent = "{side}_upper", dh = {{ a = 0.3, alpha = 0.2, d = 0, theta = -0.4 }},
      joint = "{side}_second" }},"#
        ),
        format!(
            r#"
    {{ name = "{side}_upper", frame = "{side}_upper", {UNIT}, mount.offset = [-0.2, 0.03, 0.01] }},
    {{ name = "{side}_lower", frame = "{side}_lower", {UNIT}, mount.offset = [-0.1, -0.02, 0.04],
      mount.rpy = [0.4, -0.2, 1.0] }},"#
        ),
    ]
}

/// Two chains that share nothing but the ground, or one of them.
pub fn chains(sides: &[&str]) -> String {
    let all = [("r", 0.3), ("l", -0.7)];
    let kept = all.iter().filter(|(side, _)| sides.contains(side));
    text(&kept.map(|(side, turned)| chain(side, *turned)).collect::<Vec<_>>(), "")
}

fn leg(side: &str, y: f64) -> [String; 3] {
    [
        format!(
            r#"{{ name = "{side}_hip", kind = "ball", angles = "YXY" }}, {{ name = "{side}_knee", kind = "hinge" }},"#
        ),
        format!(
            r#"
    {{ name = "{side}_thigh", parent = "pelvis", joint = "{side}_hip",
      transform = {{ translation = [0.02, {y}, -0.1], rpy = [0.2, 0.1, -0.1] }} }},
    {{ name = "{side}_shank", parent = "{side}_thigh", joint = "{side}_knee", axis = "y",
      transform = {{ translation = [0, 0.02, "-l_thigh_{side}"] }} }},"#
        ),
        format!(
            r#"
    {{ name = "{side}_thigh", frame = "{side}_thigh", {UNIT}, mount.offset = [0.03, 0, -0.2],
      mount.rpy = [0.4, -0.2, 1.0] }},
    {{ name = "{side}_shank", frame = "{side}_shank", {UNIT}, mount.offset = [0.02, 0, -0.15] }},
    {{ name = "{side}_angle", kind = "encoder", joint = "{side}_knee", std = 0.01 }},"#
        ),
    ]
}

/// A pelvis that is free and two legs on balls and hinges: the azimuth of the field and an acceleration of the ground are
/// everybody's, the length of a thigh is its leg's.
pub fn walker() -> String {
    let pelvis = [
        r#"
    { name = "pelvis", kind = "free",
      process = { kind = "singer", density = 4.0, start_std = [0.05, 0.2, 1.0], time_s = 0.5 },
      translation = { kind = "singer", density = 3.0, start_std = [0.1, 0.2, 1.0], time_s = 0.3 } },"#
            .to_string(),
        r#"
    { name = "pelvis", parent = "root", transform = { translation = [0.1, 0, 0.2], rpy = [0.2, -0.3, 0.5] },
      joint = "pelvis" },"#
            .to_string(),
        format!(
            r#"
    {{ name = "pelvis", frame = "pelvis", {UNIT}, mount.offset = [0.05, 0.02, -0.1] }},
    {{ name = "place", kind = "position", frame = "pelvis", point = [0.02, 0.1, 0.05], std_m = 0.01 }},"#
        ),
    ];
    let more = r#"
base_acceleration = [
    { name = "surge", axis = [1, 0, 0], density = 1.0, start_std = 0.5, time_s = 0.7, rise_s = 0.1 },
]
[parameters]
l_thigh_r = { default = 0.4, unit = "m", std = 0.01, label = "right thigh" }
l_thigh_l = { default = 0.4, unit = "m", std = 0.01, label = "left thigh" }
"#;
    let text = text(&[pelvis, leg("r", -0.1), leg("l", 0.1)], more);
    text.replace("azimuth_fixed = true", "azimuth_fixed = false")
}

/// Which limb a name belongs to, of bodies whose names say it: 1 is the right one, 2 the left one, 0 the core.
pub fn limb_of(name: &str) -> usize {
    let stem = name.strip_prefix("parameters.").unwrap_or(name);
    if stem.starts_with("r_") || stem.ends_with("_r") {
        1
    } else if stem.starts_with("l_") && !stem.ends_with("_b") {
        2
    } else {
        0
    }
}
