//! Every kind of mistake in a model file is refused with file, line, key and a way out.

use oarlock::model::read_model;
use oarlock::{Error, Model};
use proptest::prelude::*;

/// A small body without a mistake.
const BODY: &str = r#"format = 1
name = "arm"
[world]
up = [0, 1, 0]
forward = [0, 0, 1]
magnetic_norm_ut = 47.0
magnetic_dip_rad = "60*pi/180"
[parameters]
l_ua = { default = 0.315, unit = "m", std = 0.016, label = "upper arm" }
l_fa = 0.27
[process]
hinge = { kind = "jerk", density = 11.2, start_std = [0.2, 0.5, 5.0] }
[[joint]]
name = "shoulder"
kind = "hinge"
limits = ["-60*pi/180", "120*pi/180"]
rest = 0.1
[[joint]]
name = "elbow"
kind = "hinge"
[[frame]]
name = "upperarm"
parent = "root"
dh = { a = "l_ua", alpha = "pi/2", d = 0, theta = 0 }
joint = "shoulder"
[[frame]]
name = "forearm"
parent = "upperarm"
transform = { translation = ["l_fa", 0, 0] }
joint = "elbow"
sign = -1
axis = "y"
[[sensor]]
name = "wrist"
kind = "imu"
frame = "forearm"
gyro_std_rad_s = 0.01
mag_std_ut = 1.0
[sensor.mount]
rotation = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
offset = [0, "l_fa/2", 0]
[[sensor]]
name = "hinge"
kind = "encoder"
joint = "elbow"
std = 0.001
[[closure]]
name = "grip"
frame_a = "forearm"
frame_b = "root"
axis_a = "z"
axis_b = "-z"
std_m = 0.002
std_axis = 0.005
[[base_acceleration]]
name = "surge"
axis = [0, 0, 1]
density = 3.35
start_std = 3.0
"#;

fn mistakes(text: &str) -> Vec<String> {
    read_model(text, "body.toml").expect_err("the text has a mistake")
}

/// Changes one place of the body; expects these words so many lines below `from`, alone unless `others` may follow.
fn refused(from: &str, to: &str, below: isize, wanted: &str, others: bool) {
    assert_eq!(BODY.matches(from).count(), 1, "`{from}` stands once in the body");
    let above = BODY[..BODY.find(from).expect("found")].matches('\n').count();
    let place = format!("body.toml:{}: ", 1 + below + above as isize);
    let found = mistakes(&BODY.replace(from, to));
    assert!(
        found.iter().any(|m| m.starts_with(&place) && m.contains(wanted)) && (others || found.len() == 1),
        "expected `{place}... {wanted}`, found:\n{}",
        found.join("\n")
    );
}

#[test]
fn the_body_has_no_mistake() {
    let model = Model::from_toml(BODY, "body.toml").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((model.joints.len(), model.frames.len(), model.sensors.len()), (2, 3, 2));
    assert_eq!(model.frames[2].joint, Some((1, -1.0)));
    assert_eq!(model.joints[1].limits, [-std::f64::consts::PI, std::f64::consts::PI]);
}

#[test]
fn all_mistakes_are_told_in_the_order_of_the_file() {
    let text = BODY.replace("rest = 0.1", "rest = 9").replace("l_fa/2", "l_f/2").replace("0.002", "-1");
    let found = mistakes(&text);
    let lines: Vec<&str> = found.iter().map(|m| m.split(':').nth(1).expect("a line")).collect();
    assert_eq!(lines, ["17", "41", "53"], "{found:#?}");
    let Err(Error::Model(joined)) = Model::from_toml(&text, "body.toml") else { panic!("a model error") };
    assert_eq!(joined, found.join("\n"));
}

/// Each `name: from => to, lines below, message` is a test of its own; `and others`: it brings more mistakes.
macro_rules! refusals {
    ($($name:ident: $from:expr => $to:expr, $below:expr, $wanted:expr $(, and $others:ident)?;)*) => {
        $(#[test]
        fn $name() {
            refused($from, $to, $below, $wanted, 0 $(+ { stringify!($others).len() })? > 0);
        })*
    };
}

mod the_text {
    use super::*;
    refusals! {
        unquoted_expression: "theta = 0 }" => "theta = pi }", 0, "names and expressions stand in quotes";
        unquoted_name: "parent = \"root\"" => "parent = root", 0, "not valid TOML";
        decimal_comma: "l_fa = 0.27" => "l_fa = 0,27", 0, "Decimals are written with a point";
        unquoted_quotient: "rest = 0.1" => "rest = 10/2", 0, "names and expressions stand in quotes";
        key_twice: "rest = 0.1" => "rest = 0.1\nrest = 0.2", 1, "duplicate key";
        open_bracket: "[world]" => "[world", 0, "not valid TOML";
    }
}

mod the_whole {
    use super::*;
    refusals! {
        no_format: "format = 1\n" => "", 0, "key `format` is missing, such as format = 1";
        other_format: "format = 1" => "format = 2", 0, "format: 2 is not known; this version of oarlock reads format = 1";
        no_name: "format = 1\nname = \"arm\"" => "format = 1", 0, "key `name` is missing";
        unknown_table: "[parameters]" => "[[sensors]]\n[parameters]", 0, "unknown key `sensors`; did you mean `sensor`?";
        single_brackets: "[[base_acceleration]]" => "[base_acceleration]", 0, "expected one [[base_acceleration]] (double brackets)";
    }
}

mod the_world {
    use super::*;
    refusals! {
        missing: "[world]\nup = [0, 1, 0]\nforward = [0, 0, 1]\nmagnetic_norm_ut = 47.0\nmagnetic_dip_rad = \"60*pi/180\"\n" => "", -2, "table [world] is missing";
        unknown_key: "magnetic_norm_ut = 47.0" => "magnetic_norm_ut = 47.0\ngravity = 9.81", 1, "world: unknown key `gravity`; did you mean `gravity_m_s2`?";
        no_up: "up = [0, 1, 0]\n" => "", -1, "world: key `up` is missing, such as up = [0, 1, 0]";
        long_up: "up = [0, 1, 0]" => "up = [0, 2, 0]", 0, "world: up: length 2.000000, expected a unit vector: [0.000000000, 1.000000000";
        no_direction: "up = [0, 1, 0]" => "up = [0, 0, 0]", 0, "has no direction";
        not_horizontal: "forward = [0, 0, 1]" => "forward = [0, 0.6, 0.8]", 0, "forward is 53.130 deg from up";
        two_numbers: "up = [0, 1, 0]" => "up = [0, 1]", 0, "expected an axis such as \"z\", \"-x\" or [0, 0, 1], found a list of 2";
        gravity_in_g: "magnetic_norm_ut = 47.0" => "gravity_m_s2 = 1.0\nmagnetic_norm_ut = 47.0", 0, "multiples of g";
        dip_in_degrees: "\"60*pi/180\"\n[par" => "60\n[par", 0, "world: magnetic_dip_rad: 60 rad; expected -pi/2 to pi/2 rad";
        norm_in_gauss: "magnetic_norm_ut = 47.0" => "magnetic_norm_ut = 0.47", 0, "1 gauss = 100 uT";
        flag_in_quotes: "magnetic_norm_ut = 47.0" => "magnetic_norm_ut = 47.0\nazimuth_fixed = \"yes\"", 1, "expected true or false (without quotes), found \"yes\"";
    }

    #[test]
    fn a_magnetometer_needs_a_field() {
        let found = mistakes(&BODY.replace("magnetic_dip_rad = \"60*pi/180\"\n", ""));
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("body.toml:33: sensor `wrist` has a magnetometer"), "{}", found[0]);
    }
}

mod a_parameter {
    use super::*;
    refusals! {
        unknown_key: "unit = \"m\"" => "units = \"m\"", 0, "parameter `l_ua`: unknown key `units`; did you mean `unit`?";
        other_unit: "unit = \"m\"" => "unit = \"cm\"", 0, "parameter `l_ua`: unit: unknown unit `cm`";
        millimetres: "default = 0.315" => "default = 315", 0, "315 m; lengths are in m: 315 mm is 0.315";
        no_default: "default = 0.315, " => "", 0, "key `default` is missing";
        no_spread: "std = 0.016" => "std = 0", 0, "parameter `l_ua`: std: 0 m; expected more than 0 m";
        infinite: "l_fa = 0.27" => "l_fa = inf", 0, "parameter `l_fa`: inf is inf at the default parameters";
        of_another: "l_fa = 0.27" => "l_fa = \"l_ua\"", 0, "unknown name `l_ua`";
        named_pi: "l_fa = 0.27" => "l_fa = 0.27\npi = 3", 1, "`pi` is the number 3.14159";
        named_with_space: "l_fa = 0.27" => "l_fa = 0.27\n\"l fa\" = 3", 1, "expected letters, digits and `_`";
        a_text: "l_fa = 0.27" => "l_fa = \"long\"", 0, "column 1: unknown name `long`";
        a_flag: "l_fa = 0.27" => "l_fa = true", 0, "expected a number or an expression in quotes, found true";
    }
}

mod a_joint {
    use super::*;
    refusals! {
        unknown_key: "rest = 0.1" => "limit = [0, 1]", 0, "joint `shoulder`: unknown key `limit`; did you mean `limits`?";
        unnamed: "name = \"elbow\"\n" => "", -1, "joint number 2: key `name` is missing", and others;
        bad_name: "name = \"elbow\"" => "name = \"the elbow\"", 0, "try `the_elbow`", and others;
        no_kind: "name = \"elbow\"\nkind = \"hinge\"" => "name = \"elbow\"", -1, "joint `elbow`: key `kind` is missing, such as kind = \"hinge\"";
        unknown_kind: "name = \"elbow\"\nkind = \"hinge\"" => "name = \"elbow\"\nkind = \"hnge\"", 1, "joint `elbow`: kind: unknown kind `hnge`; did you mean `hinge`?";
        other_word: "name = \"elbow\"\nkind = \"hinge\"" => "name = \"elbow\"\nkind = \"revolute\"", 1, "did you mean `hinge`?";
        spherical: "name = \"elbow\"\nkind = \"hinge\"" => "name = \"elbow\"\nkind = \"spherical\"", 1, "unknown kind `spherical`; did you mean `ball`?";
        floating: "name = \"elbow\"\nkind = \"hinge\"" => "name = \"elbow\"\nkind = \"floating\"", 1, "unknown kind `floating`; did you mean `free`?";
        angles_of_a_hinge: "rest = 0.1" => "angles = \"YXY\"", 0, "joint `shoulder`: `angles`: only a ball or a free joint is read in a sequence of angles; remove it";
        translation_of_a_hinge: "rest = 0.1" => "translation = { density = 1 }", 0, "joint `shoulder`: `translation`: only a free joint moves freely in space; remove it";
        limits_turned_round: "[\"-60*pi/180\", \"120*pi/180\"]" => "[1, -1]", 0, "limits: lowest 1.0000 is not below highest -1.0000";
        limits_in_degrees: "[\"-60*pi/180\", \"120*pi/180\"]" => "[-60, 120]", 0, "many turns; write degrees as \"90*pi/180\"";
        one_limit: "[\"-60*pi/180\", \"120*pi/180\"]" => "[1]", 0, "expected two numbers [lowest, highest], found a list of 1";
        limit_of_parameter: "[\"-60*pi/180\", \"120*pi/180\"]" => "[-1, \"l_ua\"]", 0, "limits[2]: `l_ua` is a parameter; this key takes plain numbers only";
        rest_outside: "rest = 0.1" => "rest = 3", 0, "rest: 3 rad is outside the limits [-1.0472, 2.0944] rad";
        name_twice: "name = \"elbow\"" => "name = \"shoulder\"", 0, "joint `shoulder`: the name is taken by the joint of line 14; give it another", and others;
        nothing_moves: "joint = \"shoulder\"\n" => "", -11, "joint `shoulder` moves no frame; write joint = \"shoulder\" in a [[frame]] or remove it";
        fixed_with_limits: "name = \"shoulder\"\nkind = \"hinge\"\nlimits = [\"-60*pi/180\", \"120*pi/180\"]\nrest = 0.1" => "name = \"shoulder\"\nkind = \"fixed\"\nrest = 0", 2, "joint `shoulder`: `rest`: a fixed joint does not move; remove it";
        std_of_nothing: "rest = 0.1" => "std = 0.1", 0, "`std` is the noise of a reading, but nothing reads this joint";
        input_with_process: "rest = 0.1" => "input = true\nprocess = { density = 1 }", 1, "an input joint follows its stream";
        singer_without_time: "rest = 0.1" => "process = { kind = \"singer\", density = 1, start_std = [1, 2, 3] }", 0, "process: key `time_s` is missing, such as time_s = 0.3";
        time_without_singer: "rest = 0.1" => "process = { time_s = 0.3 }", 0, "process.time_s: only a `singer` motion decays; remove it, or write kind = \"singer\"";
        time_of_nothing: "rest = 0.1" => "process = { kind = \"singer\", density = 1, start_std = [1, 2, 3], time_s = 0 }", 0, "process.time_s: 0 s; expected more than 0 s";
        rest_of_three: "rest = 0.1" => "rest = [0, 0, 0.1]", 0, "joint `shoulder`: rest: expected";
        walk_with_three: "rest = 0.1" => "process = { kind = \"walk\", density = 1, start_std = [1, 2, 3] }", 0, "process.start_std: expected one number for a walk: [rad], found a list of 3";
        walk_without_density: "rest = 0.1" => "process = { kind = \"walk\", start_std = [1] }", 0, "key `density` is missing";
        jerk_with_one: "rest = 0.1" => "process = { start_std = [1] }", 0, "expected three numbers [rad, rad/s, rad/s2], found a list of 1";
        no_density: "density = 11.2" => "density = 0", 0, "process: hinge.density: 0 rad/s2 per sqrt(s); expected more than 0";
        process_of_a_stranger: "hinge = { kind" => "hnge = { kind", 0, "process: unknown key `hnge`; did you mean `hinge`?";
    }
}

/// The body with a ball at its shoulder, free in space if `kind` says so.
fn balled(kind: &str, keys: &str) -> String {
    let shoulder = "kind = \"hinge\"\nlimits = [\"-60*pi/180\", \"120*pi/180\"]\nrest = 0.1\n";
    assert!(BODY.contains(shoulder));
    BODY.replace(shoulder, &format!("kind = \"{kind}\"\n{keys}\n"))
}

/// Expects one mistake, in the line of the ball's own keys.
fn refused_ball(kind: &str, keys: &str, wanted: &str) {
    let found = mistakes(&balled(kind, keys));
    assert!(
        found.len() == 1 && found[0].starts_with("body.toml:16: ") && found[0].contains(wanted),
        "expected `body.toml:16: ... {wanted}`, found:\n{}",
        found.join("\n")
    );
}

mod a_ball {
    use super::*;

    #[test]
    fn and_a_free_joint_are_read() {
        let keys = "angles = \"YXY\"\nlimits = [-1, 1]\nrest = [0.1, 0.2, 0.3]";
        let model = Model::from_toml(&balled("ball", keys), "body.toml").unwrap_or_else(|e| panic!("{e}"));
        let ball = &model.joints[0];
        assert_eq!((ball.angles.as_str(), ball.limits, ball.first), ("YXY", [-1.0, 1.0], 0));
        assert_eq!(ball.rest, [0.1, 0.2, 0.3]);
        assert_eq!(model.coordinate_names(), ["shoulder.rx", "shoulder.ry", "shoulder.rz", "elbow"]);
        assert_eq!(model.joints[1].first, 3);
        let keys = "translation = { density = 7, limits = [-2, 2] }\nrest = [1, 2, 3, 0.1, 0.2, 0.3]";
        let model = Model::from_toml(&balled("free", keys), "body.toml").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(model.coordinate_names()[..4], ["shoulder.x", "shoulder.y", "shoulder.z", "shoulder.rx"]);
        let axes = model.axes();
        assert_eq!((axes[1].process.density, axes[1].limits, axes[1].rest), (7.0, [0.0, 4.0], 2.0));
        assert_eq!((axes[4].limits, axes[4].rest), ([-std::f64::consts::PI, std::f64::consts::PI], 0.2));
        assert_eq!(model.joints[0].angles, "ZXY");
    }

    #[test]
    fn has_a_cone_instead_of_equal_limits() {
        let read = |limits: &str| {
            let text = balled("ball", &format!("limits = {limits}"));
            let model = Model::from_toml(&text, "body.toml").unwrap_or_else(|e| panic!("{e}"));
            (model.joints[0].limits, model.axes()[..3].iter().map(|axis| axis.limits).collect::<Vec<_>>())
        };
        let (widest, about) = read("{ axis = \"y\", swing = 0.8, twist = [-0.5, 1.2] }");
        assert_eq!((widest, about), ([-1.2, 1.2], vec![[-0.8, 0.8], [-0.5, 1.2], [-0.8, 0.8]]));
        let (widest, about) = read("{ axis = \"x\", swing = [0.4, \"60*pi/180\"] }");
        let (pi, third) = (std::f64::consts::PI, std::f64::consts::FRAC_PI_3);
        assert_eq!((widest, about[0], about[1]), ([-pi, pi], [-pi, pi], [-0.4, 0.4]));
        assert!((about[2][1] - third).abs() < 1e-15 && about[2][0] == -about[2][1]);
    }

    #[test]
    fn with_a_bad_cone_is_refused() {
        let degrees =
            "limits.swing: 60.0000 rad; expected more than 0 and at most pi, the angle from the rest; write degrees";
        for (kind, limits, wanted) in [
            ("ball", "{ swing = 1 }", "limits: key `axis` is missing, such as axis = \"y\""),
            ("ball", "{ axis = \"y\" }", "limits: key `swing` is missing, such as swing = \"60*pi/180\""),
            ("ball", "{ axis = \"along\", swing = 1 }", "limits.axis: unknown axis `along`; valid: `x`, `y`, `z`"),
            ("ball", "{ axis = \"y\", swing = 60 }", degrees),
            ("ball", "{ axis = \"y\", swing = [1, -1] }", "limits.swing[2]: -1.0000 rad; expected more than 0"),
            ("ball", "{ axis = \"y\", swing = [1, 1, 1] }", "limits.swing: expected one angle or two"),
            ("ball", "{ axis = \"y\", swing = 1, twist = 1 }", "limits.twist: expected two numbers [lowest, highest]"),
            ("ball", "{ axis = \"y\", swing = 1, twist = [1, -1] }", "lowest 1.0000 is not below highest -1.0000"),
            ("ball", "{ axis = \"y\", swing = 1, twist = [-4, 1] }", "is more than half a turn from the rest"),
            ("ball", "{ axis = \"y\", swing = 1, twist = [0.2, 1] }", "[0.2000, 1.0000] rad excludes 0, the rest"),
            ("ball", "{ axis = \"y\", swing = 1, cone = 1 }", "limits: unknown key `cone`; "),
            (
                "free",
                "{ axis = \"y\", swing = 1 }",
                "limits: expected two numbers [lowest, highest], found a table of keys",
            ),
            (
                "hinge",
                "{ axis = \"y\", swing = 1 }",
                "limits: expected two numbers [lowest, highest], found a table of keys",
            ),
        ] {
            refused_ball(kind, &format!("limits = {limits}"), wanted);
        }
    }

    #[test]
    fn with_bad_angles_is_refused() {
        let wanted = "joint `shoulder`: angles: expected three axes in a row, no neighbours equal";
        for angles in ["YYX", "YXX", "YX", "YXYX", "yxy", "ABC", ""] {
            refused_ball("ball", &format!("angles = \"{angles}\""), wanted);
        }
    }

    #[test]
    fn with_keys_that_do_not_fit_is_refused() {
        let lopsided = "limits: [-1.0000, 1.5000] rad; a ball's limits count from its rest alike: expected [-a, a]";
        let turned = "rest: expected a rotation vector [rx, ry, rz] in rad";
        let walk = "process = { kind = \"walk\", density = 1, start_std = [1] }";
        for (kind, keys, wanted) in [
            ("ball", "limits = [-1, 1.5]", lopsided),
            ("free", "limits = [-1, 1.5]", lopsided),
            ("ball", "rest = 0.1", turned),
            ("ball", "rest = [0.1, 0.2]", turned),
            ("free", "rest = [1, 2, 3]", "rest: expected a place in m and a rotation vector in rad"),
            ("ball", "input = true", "joint `shoulder`: `input`: no encoder reads a rotation in all directions"),
            ("ball", walk, "a ball does not walk; expected kind = \"jerk\" or \"singer\""),
            ("ball", "translation = { density = 1 }", "`translation`: only a free joint moves freely in space"),
        ] {
            refused_ball(kind, keys, wanted);
        }
    }

    #[test]
    fn has_neither_sign_nor_axis() {
        let text = BODY.replace("name = \"elbow\"\nkind = \"hinge\"", "name = \"elbow\"\nkind = \"ball\"");
        let text =
            text.replace("[[sensor]]\nname = \"hinge\"\nkind = \"encoder\"\njoint = \"elbow\"\nstd = 0.001\n", "");
        let wanted = "frame `forearm`: joint `elbow` turns in all directions: remove `sign` and `axis`";
        for other in ["sign = -1\n", "axis = \"y\"\n"] {
            let found = mistakes(&text.replace(other, ""));
            assert!(found.len() == 1 && found[0].contains(wanted), "{found:#?}");
        }
        let plain = text.replace("sign = -1\n", "").replace("axis = \"y\"\n", "");
        assert!(read_model(&plain, "body.toml").is_ok());
    }

    #[test]
    fn has_no_encoder() {
        let text = BODY.replace("name = \"elbow\"\nkind = \"hinge\"", "name = \"elbow\"\nkind = \"ball\"");
        let found = mistakes(&text.replace("sign = -1\naxis = \"y\"\n", ""));
        let wanted =
            "sensor `hinge`: joint `elbow` turns in all directions, an encoder reads one; make it a hinge or slide";
        assert!(found.len() == 1 && found[0].contains(wanted), "{found:#?}");
    }
}

mod a_frame {
    use super::*;
    refusals! {
        unknown_key: "sign = -1" => "sgn = -1", 0, "frame `forearm`: unknown key `sgn`; did you mean `sign`?";
        unknown_parent: "parent = \"upperarm\"" => "parent = \"uperarm\"", 0, "frame `forearm`: parent: no frame `uperarm`; did you mean `upperarm`?";
        parent_is_a_joint: "parent = \"upperarm\"" => "parent = \"shoulder\"", 0, "no frame `shoulder` (`shoulder` is a joint)";
        own_parent: "parent = \"upperarm\"" => "parent = \"forearm\"", 0, "parents run in a circle: `forearm` -> `forearm`";
        circle: "parent = \"root\"" => "parent = \"forearm\"", 0, "parents run in a circle: `upperarm` -> `forearm` -> `upperarm`";
        named_root: "name = \"upperarm\"" => "name = \"root\"", 0, "`root` is always there and is not written", and others;
        neither_shape: "transform = { translation = [\"l_fa\", 0, 0] }\n" => "", -3, "frame `forearm`: expected dh = { a, alpha, d, theta } or transform";
        both_shapes: "transform = { translation = [\"l_fa\", 0, 0] }" => "transform = {}\ndh = { a = 0, alpha = 0, d = 0, theta = 0 }", 0, "has both `dh` and `transform`";
        short_row: "d = 0, " => "", 0, "frame `upperarm`: dh: key `d` is missing, such as d = 0";
        unknown_name: "a = \"l_ua\"" => "a = \"l_uaa\"", 0, "frame `upperarm`: dh.a: \"l_uaa\": column 1: unknown name `l_uaa`; did you mean `l_ua`?";
        divided_by_zero: "a = \"l_ua\"" => "a = \"1/(l_ua - l_ua)\"", 0, "is inf at the default parameters";
        alpha_in_degrees: "alpha = \"pi/2\"" => "alpha = 90", 0, "dh.alpha: 90 rad; more than a full turn: write degrees as \"90*pi/180\"";
        row_in_millimetres: "d = 0," => "d = 315,", 0, "dh.d: 315 m; lengths are in m";
        no_rotation: "{ translation = [\"l_fa\", 0, 0] }" => "{ rotation = [[1, 0, 0], [0, 2, 0], [0, 0, 1]] }", 0, "transform.rotation: no rotation: largest entry of |R R' - 1| is 3.000e0, determinant 2.000000";
        a_mirror: "{ translation = [\"l_fa\", 0, 0] }" => "{ rotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]] }", 0, "mirrors: largest entry of |R R' - 1| is 0.000e0, determinant -1";
        short_matrix: "{ translation = [\"l_fa\", 0, 0] }" => "{ rotation = [[1, 0, 0], [0, 1, 0]] }", 0, "expected three rows of three numbers";
        two_rotations: "{ translation = [\"l_fa\", 0, 0] }" => "{ rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], rpy = [0, 0, 0] }", 0, "has both `rotation` and `rpy`";
        rpy_in_degrees: "{ translation = [\"l_fa\", 0, 0] }" => "{ rpy = [0, 0, 90] }", 0, "transform.rpy[3]: 90 rad";
        unknown_joint: "joint = \"shoulder\"" => "joint = \"sholder\"", 0, "frame `upperarm`: joint: no joint `sholder`; did you mean `shoulder`?", and others;
        sign_of_two: "sign = -1" => "sign = -2", 0, "frame `forearm`: sign: -2; expected 1 or -1";
        axis_with_row: "joint = \"shoulder\"" => "joint = \"shoulder\"\naxis = \"z\"", 1, "`axis` goes with `transform`";
        axis_unknown: "axis = \"y\"" => "axis = \"up\"", 0, "expected an axis such as \"z\", \"-x\" or [0, 0, 1], found \"up\"";
    }
}

mod a_sensor {
    use super::*;
    refusals! {
        unknown_key: "gyro_std_rad_s = 0.01" => "gyro_std = 0.01", 0, "sensor `wrist`: unknown key `gyro_std`; did you mean `gyro_std_rad_s`?";
        unknown_kind: "kind = \"imu\"" => "kind = \"IMU9\"", 0, "sensor `wrist`: kind: unknown kind `IMU9`; did you mean `imu`?";
        orientation_as_imu: "kind = \"imu\"" => "kind = \"orientation\"", 2, "sensor `wrist`: `gyro_std_rad_s` is no key of an orientation; it takes frame, mount, std_rad", and others;
        unknown_frame: "frame = \"forearm\"" => "frame = \"forarm\"", 0, "sensor `wrist`: frame: no frame `forarm`; did you mean `forearm`?";
        frame_is_a_joint: "frame = \"forearm\"" => "frame = \"elbow\"", 0, "no frame `elbow` (`elbow` is a joint); valid: `root`, `upperarm`, `forearm`";
        no_frame: "kind = \"imu\"\nframe = \"forearm\"" => "kind = \"imu\"", -2, "sensor `wrist`: key `frame` is missing";
        measures_nothing: "gyro_std_rad_s = 0.01\nmag_std_ut = 1.0\n" => "", -4, "sensor `wrist`: measures nothing; expected at least one of gyro_std_rad_s";
        no_noise: "gyro_std_rad_s = 0.01" => "gyro_std_rad_s = 0", 0, "gyro_std_rad_s: 0 rad/s; expected more than 0 rad/s";
        bias_of_nothing: "mag_std_ut = 1.0" => "accel_bias_walk = 0.1", 0, "`accel_bias_walk` without `accel_std_m_s2`";
        key_of_another_kind: "mag_std_ut = 1.0" => "std = 0.1", 0, "`std` is no key of an imu; it takes frame, mount";
        mount_no_rotation: "[[0, -1, 0], [1, 0, 0], [0, 0, 1]]" => "[[0, -1, 0], [1, 0.5, 0], [0, 0, 1]]", 0, "sensor `wrist`: mount.rotation: no rotation";
        mount_turned_by_parameter: "[[0, -1, 0], [1, 0, 0], [0, 0, 1]]" => "[[0, -1, 0], [1, 0, 0], [0, 0, \"l_fa/0.27\"]]", 0, "a mount's rotation takes plain numbers only";
        mount_key: "offset = [0," => "ofset = [0,", 0, "sensor `wrist`: mount: unknown key `ofset`; did you mean `offset`?";
        unknown_joint: "joint = \"elbow\"\nstd" => "joint = \"elbo\"\nstd", 0, "sensor `hinge`: joint: no joint `elbo`; did you mean `elbow`?";
        encoder_without_std: "joint = \"elbow\"\nstd = 0.001" => "joint = \"elbow\"", -3, "sensor `hinge`: key `std` is missing, such as std = 0.001";
        range_on_one_frame: "kind = \"encoder\"\njoint = \"elbow\"\nstd = 0.001" => "kind = \"range\"\nframe_a = \"forearm\"\nframe_b = \"forearm\"\nstd_m = 0.01", -1, "sensor `hinge`: both sides are on frame `forearm`; expected two frames";
        range_without_end: "kind = \"encoder\"\njoint = \"elbow\"\nstd = 0.001" => "kind = \"range\"\nframe_a = \"forearm\"\nstd_m = 0.01", -2, "sensor `hinge`: key `frame_b` is missing";
        orientation_twice_white: "kind = \"encoder\"\njoint = \"elbow\"\nstd = 0.001" => "kind = \"orientation\"\nframe = \"forearm\"\nstd_rad = 0.01\ncorrelation_time_s = 0\nwhite_std_rad = 0.01", 4, "`white_std_rad` with correlation_time_s = 0";
        orientation_heading: "kind = \"encoder\"\njoint = \"elbow\"\nstd = 0.001" => "kind = \"orientation\"\nframe = \"forearm\"\nstd_rad = 0.01\nheading_walk = 0.1", 3, "`heading_walk` without heading = \"unknown\"";
        name_of_a_closure: "name = \"grip\"" => "name = \"wrist\"", 0, "closure `wrist`: the name is taken by the sensor of line 34; give it another";
    }

    #[test]
    fn an_encoder_on_a_fixed_joint_reads_nothing() {
        let found = mistakes(&BODY.replace("name = \"elbow\"\nkind = \"hinge\"", "name = \"elbow\"\nkind = \"fixed\""));
        assert_eq!(found.len(), 1);
        assert!(found[0].contains("sensor `hinge`: joint `elbow` is fixed"), "{}", found[0]);
    }
}

mod a_closure {
    use super::*;
    refusals! {
        unknown_frame: "frame_a = \"forearm\"" => "frame_a = \"forarm\"", 0, "closure `grip`: frame_a: no frame `forarm`; did you mean `forearm`?";
        no_frame: "frame_b = \"root\"\n" => "", -3, "closure `grip`: key `frame_b` is missing";
        same_frame: "frame_a = \"forearm\"" => "frame_a = \"root\"", -1, "closure `grip`: both sides are on frame `root`; expected two frames";
        one_axis: "axis_b = \"-z\"\n" => "", -1, "closure `grip`: `axis_a` without `axis_b`; give both or neither";
        axis_unknown: "axis_b = \"-z\"" => "axis_b = \"w\"", 0, "closure `grip`: axis_b: expected an axis";
        no_std: "std_m = 0.002\n" => "", -6, "closure `grip`: key `std_m` is missing";
        no_std_axis: "std_axis = 0.005\n" => "", -7, "closure `grip`: key `std_axis` is missing";
        std_axis_without_axes: "axis_a = \"z\"\naxis_b = \"-z\"\n" => "", 1, "`std_axis` without `axis_a` and `axis_b`; add them or remove it";
        unknown_key: "std_m = 0.002" => "std = 0.002", 0, "closure `grip`: unknown key `std`; did you mean `std_m`?";
    }
}

mod a_base_acceleration {
    use super::*;
    refusals! {
        unknown_key: "density = 3.35" => "densty = 3.35", 0, "base_acceleration `surge`: unknown key `densty`; did you mean `density`?";
        no_axis: "name = \"surge\"\naxis = [0, 0, 1]" => "name = \"surge\"", -1, "base_acceleration `surge`: key `axis` is missing";
        no_spread: "start_std = 3.0" => "start_std = -3", 0, "base_acceleration `surge`: start_std: -3 m/s2; expected more than 0 m/s2";
        slow_to_rise: "start_std = 3.0" => "start_std = 3.0\ntime_s = 0.3\nrise_s = 0.2", 2, "rise_s: 0.2 s; expected at most half of `time_s`, 0.15 s";
        named_as_a_joint: "name = \"surge\"" => "name = \"elbow\"", 0, "base_acceleration `elbow`: the name is taken by the joint of line 19";
        named_azimuth: "name = \"surge\"" => "name = \"azimuth\"", 0, "the name of the magnetic field's direction";
        twice_along_a_line: "start_std = 3.0" => "start_std = 3.0\n[[base_acceleration]]\nname = \"back\"\naxis = \"-z\"\ndensity = 1\nstart_std = 1", 2, "base_acceleration `back`: acts along the same line as `surge`";
    }
}

#[test]
fn a_loop_needs_a_joint_between_its_sides() {
    let plate = "[[frame]]\nname = \"plate\"\nparent = \"upperarm\"\ntransform = {}\n";
    let text = BODY
        .replace("[[frame]]\nname = \"forearm\"", &format!("{plate}[[frame]]\nname = \"forearm\""))
        .replace("frame_a = \"forearm\"", "frame_a = \"plate\"")
        .replace("frame_b = \"root\"", "frame_b = \"upperarm\"");
    let found = mistakes(&text);
    assert!(
        found.len() == 1 && found[0].contains("closure `grip`: no joint moves `plate` against `upperarm`"),
        "{found:#?}"
    );
}

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in any::<String>()) {
        let _ = read_model(&text, "body.toml").map_err(|found| assert!(!found.is_empty()));
    }

    #[test]
    fn a_body_with_any_hole_is_read_or_refused(start in 0usize..BODY.len(), length in 0usize..60, put in "[-\"={}\\[\\]a-z0-9.,\n]{0,6}") {
        let end = (start + length).min(BODY.len());
        let text = format!("{}{put}{}", &BODY[..start], &BODY[end..]);
        if let Err(found) = read_model(&text, "body.toml") {
            prop_assert!(!found.is_empty() && found.iter().all(|m| m.starts_with("body.toml:")));
        }
    }
}
