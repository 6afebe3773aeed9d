//! `Links`: what a model file states about strapdown links, by the kind of joints. `strapdown` uses it.
//!
//! Sources: joints of people slide by 0.3 to 2.3 cm (RMS, optics on trunk and arms) and nominal points are 2 to 10 cm off; joints of rigs are
//! machined or glued. Noise densities are those of consumer units with what lies between two samples.

use super::section::Section;

/// How a model is tracked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Structure {
    /// Each unit integrates its own gyroscope and accelerometer; joints are readings.
    Strapdown,
    /// Joint angles are states of a kinematic tree; gyroscopes and accelerometers are readings.
    Tree,
}

impl Structure {
    /// Its name in model files and settings.
    pub const fn name(self) -> &'static str {
        match self {
            Structure::Strapdown => "strapdown",
            Structure::Tree => "tree",
        }
    }
}

/// Kinds of joints that a `[links]` table names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointsOf {
    /// Of a person: soft, with nominal points.
    Bone,
    /// Of a rig that hands move: stiff joints, sensors glued by eye.
    HandRig,
    /// Machined.
    Machine,
    /// Of a person whose seat and hands a rig with encoders holds: skin under units, mounts by eye.
    BoneInRig,
}

/// How units sit on their links.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fixing {
    /// With skin between, as the model states it.
    Skin,
    /// With little skin. It is not tracked: it says whether there is any.
    ThinSkin,
    /// Without skin, on mounts that are off.
    Mount,
    /// Without skin, on mounts, points and lengths as the model has them.
    Exact,
}

impl Fixing {
    /// All, by number.
    pub const ALL: [Fixing; 4] = [Fixing::Skin, Fixing::ThinSkin, Fixing::Mount, Fixing::Exact];
}

/// Share of the statements about joints that those of a machine keep.
const RIGID_SHARE: f64 = 0.2;
/// Skin of `ThinSkin`, rad.
const THIN_RAD: f64 = 0.009;
/// A rotation, rad, or distance, m, that is none.
const NONE: f64 = 1e-4;

/// Statements about joints, units and the start. Standard deviations unless a name says otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Links {
    /// Distance between the two points of a joint, m, and its correlation time, s.
    pub joint_std_m: f64,
    /// See `joint_std_m`.
    pub joint_time_s: f64,
    /// Constant error of each of the two points, m.
    pub point_std_m: f64,
    /// Turn of a joint beside its hinges, rad; `None`: not read.
    pub hinge_std_rad: Option<f64>,
    /// Constant turn of a joint's axes against each of its links, rad, where no calibration tells it; `None`: there is none.
    pub axis_std_rad: Option<f64>,
    /// By how much limits of joints differ between people, or between file and machine, rad.
    pub limit_std_rad: f64,
    /// Constant turn of every unit on its bone, rad, where it is estimated; `None`: mounts are known.
    pub mount_std_rad: Option<f64>,
    /// Turn of every unit with its skin, rad, and its correlation time, s; `None`: there is none.
    pub skin_std_rad: Option<f64>,
    /// See `skin_std_rad`.
    pub skin_time_s: f64,
    /// Turn of the room, with what is fixed in it, about each axis, rad, and its correlation time, s; `None`: it does not turn.
    pub room_std_rad: Option<f64>,
    /// See `room_std_rad`.
    pub room_time_s: f64,
    /// How far apart points, m, and axes, rad, of the model's loops are at least, whatever each loop states.
    pub loop_std_m: f64,
    /// See `loop_std_m`.
    pub loop_axis_std_rad: f64,
    /// Share of their stated uncertainty that loops of the model, and that its parameters, have.
    pub loop_share: f64,
    /// See `loop_share`.
    pub length_share: f64,
    /// Magnetic field in the axes of a unit against the world's, uT, where all of it is used; `None`: only its heading is, weakly.
    pub field_std_ut: Option<f64>,
    /// Speed of every unit, m/s, and its correlation time, s.
    pub speed_std_m_s: f64,
    /// See `speed_std_m_s`.
    pub speed_time_s: f64,
    /// Distance of every unit from its start, m, and its correlation time, s. Not read if the body has contacts.
    pub place_std_m: f64,
    /// See `place_std_m`.
    pub place_time_s: f64,
    /// Gyroscope, rad/s per sqrt(Hz).
    pub gyro_density: f64,
    /// Accelerometer, m/s2 per sqrt(Hz), with what sliding and skin add.
    pub accel_density: f64,
    /// Share of the change between two readings of the gyroscope that is unknown in between, so that a hit widens itself.
    pub gyro_step_share: f64,
    /// The same of the accelerometer.
    pub accel_step_share: f64,
    /// Scale of the gyroscope.
    pub gyro_scale: f64,
    /// Rate of a unit that may rest, rad/s. Machines turn slowly and evenly for seconds, people do not.
    pub rest_below_rad_s: f64,
    /// Gyroscope's bias at rest, rad/s: what a resting unit may turn.
    pub rest_rate_std_rad_s: f64,
    /// Speed at rest, m/s; `None`: rest says nothing of it.
    pub rest_speed_std_m_s: Option<f64>,
    /// Correlation time of readings at rest, s.
    pub rest_time_s: f64,
    /// Heading of every link at the start, rad.
    pub start_std_rad: f64,
    /// Its tilt, rad, beside what the mean force says.
    pub start_tilt_std_rad: f64,
    /// Speed at the start, m/s.
    pub start_speed_std_m_s: f64,
    /// Position of a unit at the start, m.
    pub start_place_std_m: f64,
}

/// Standard deviation of a heading that nobody knows: that of a uniform angle, pi / sqrt(3), rad.
pub const UNKNOWN_RAD: f64 = 1.8;

const KEYS: [&str; 32] = [
    "joints",
    "joint_std_m",
    "joint_time_s",
    "point_std_m",
    "hinge_std_rad",
    "axis_std_rad",
    "limit_std_rad",
    "mount_std_rad",
    "skin_std_rad",
    "skin_time_s",
    "room_std_rad",
    "room_time_s",
    "loop_std_m",
    "loop_axis_std_rad",
    "field_std_ut",
    "speed_std_m_s",
    "speed_time_s",
    "place_std_m",
    "place_time_s",
    "gyro_density",
    "accel_density",
    "gyro_step_share",
    "accel_step_share",
    "gyro_scale",
    "rest_below_rad_s",
    "rest_rate_std_rad_s",
    "rest_speed_std_m_s",
    "rest_time_s",
    "start_std_rad",
    "start_tilt_std_rad",
    "start_speed_std_m_s",
    "start_place_std_m",
];

/// Of a person.
const BONE: Links = Links {
    joint_std_m: 0.03,
    joint_time_s: 0.2,
    point_std_m: 0.1,
    hinge_std_rad: None,
    axis_std_rad: None,
    limit_std_rad: 0.18,
    mount_std_rad: None,
    skin_std_rad: None,
    skin_time_s: 0.4,
    room_std_rad: None,
    room_time_s: 1.0,
    loop_std_m: NONE,
    loop_axis_std_rad: NONE,
    loop_share: 1.0,
    length_share: 1.0,
    field_std_ut: None,
    speed_std_m_s: 1.5,
    speed_time_s: 1.0,
    place_std_m: 1.0,
    place_time_s: 2.0,
    gyro_density: 0.002,
    accel_density: 0.1,
    gyro_step_share: 0.05,
    accel_step_share: 0.3,
    gyro_scale: 0.002,
    rest_below_rad_s: 0.1,
    rest_rate_std_rad_s: 0.01,
    rest_speed_std_m_s: None,
    rest_time_s: 0.3,
    start_std_rad: 0.05,
    start_tilt_std_rad: 0.1,
    start_speed_std_m_s: 1.0,
    start_place_std_m: 0.1,
};

impl Links {
    /// The statements of a kind.
    pub fn of(kind: JointsOf) -> Links {
        let rig = Links {
            joint_std_m: 0.003,
            joint_time_s: 0.05,
            rest_below_rad_s: 0.02,
            start_std_rad: UNKNOWN_RAD,
            start_tilt_std_rad: 0.5,
            gyro_step_share: 0.07,
            gyro_scale: 0.003,
            ..BONE
        };
        match kind {
            JointsOf::Bone => BONE,
            JointsOf::HandRig => Links { point_std_m: 0.01, hinge_std_rad: Some(0.1), axis_std_rad: Some(0.05), ..rig },
            JointsOf::Machine => {
                Links { point_std_m: 0.02, hinge_std_rad: Some(0.01), axis_std_rad: Some(0.02), ..rig }
            }
            JointsOf::BoneInRig => Links {
                joint_std_m: 0.005,
                joint_time_s: 0.02,
                point_std_m: 0.01,
                hinge_std_rad: Some(0.015),
                mount_std_rad: Some(0.05),
                skin_std_rad: Some(0.065),
                room_std_rad: Some(0.02),
                loop_std_m: 0.008,
                loop_axis_std_rad: 0.07,
                field_std_ut: Some(3.0),
                gyro_density: 0.003,
                start_std_rad: 0.15,
                ..BONE
            },
        }
    }

    /// The same where units sit like this; and whether that is decided, so that what is exact has the joints of a machine.
    pub fn with(&self, fixing: Fixing, is_decided: bool) -> Links {
        let skin = |rad: f64| Links { skin_std_rad: self.skin_std_rad.map(|_| rad), ..*self };
        let none = skin(NONE);
        let share = if is_decided { RIGID_SHARE } else { 1.0 };
        match fixing {
            Fixing::Skin => *self,
            Fixing::ThinSkin => skin(THIN_RAD),
            Fixing::Mount => none,
            Fixing::Exact => Links {
                mount_std_rad: self.mount_std_rad.map(|_| NONE),
                point_std_m: NONE,
                length_share: 0.01,
                joint_std_m: share * self.joint_std_m,
                hinge_std_rad: self.hinge_std_rad.map(|std| share * std),
                loop_share: share,
                ..none
            },
        }
    }

    pub(super) fn read(whole: &Section) -> Links {
        let Some(section) = whole.get("links").and_then(|slot| Section::of(slot, &KEYS)) else {
            return Links::of(JointsOf::HandRig);
        };
        let kinds = [
            ("bone", JointsOf::Bone),
            ("hand_rig", JointsOf::HandRig),
            ("machine", JointsOf::Machine),
            ("bone_in_rig", JointsOf::BoneInRig),
        ];
        let kind = section.get("joints").and_then(|slot| slot.choice(&kinds)).unwrap_or(JointsOf::HandRig);
        let mut links = Links::of(kind);
        let number = |key: &str, unit: &str| section.get(key).and_then(|slot| slot.positive(unit));
        for (key, value, unit) in links.numbers() {
            *value = number(key, unit).unwrap_or(*value);
        }
        links.hinge_std_rad = number("hinge_std_rad", "rad").or(links.hinge_std_rad);
        links.axis_std_rad = number("axis_std_rad", "rad").or(links.axis_std_rad);
        links.mount_std_rad = number("mount_std_rad", "rad").or(links.mount_std_rad);
        links.skin_std_rad = number("skin_std_rad", "rad").or(links.skin_std_rad);
        links.room_std_rad = number("room_std_rad", "rad").or(links.room_std_rad);
        links.field_std_ut = number("field_std_ut", "uT").or(links.field_std_ut);
        links.rest_speed_std_m_s = number("rest_speed_std_m_s", "m/s").or(links.rest_speed_std_m_s);
        links
    }

    fn numbers(&mut self) -> [(&'static str, &mut f64, &'static str); 24] {
        [
            ("joint_std_m", &mut self.joint_std_m, "m"),
            ("joint_time_s", &mut self.joint_time_s, "s"),
            ("point_std_m", &mut self.point_std_m, "m"),
            ("limit_std_rad", &mut self.limit_std_rad, "rad"),
            ("skin_time_s", &mut self.skin_time_s, "s"),
            ("room_time_s", &mut self.room_time_s, "s"),
            ("loop_std_m", &mut self.loop_std_m, "m"),
            ("loop_axis_std_rad", &mut self.loop_axis_std_rad, "rad"),
            ("speed_std_m_s", &mut self.speed_std_m_s, "m/s"),
            ("speed_time_s", &mut self.speed_time_s, "s"),
            ("place_std_m", &mut self.place_std_m, "m"),
            ("place_time_s", &mut self.place_time_s, "s"),
            ("gyro_density", &mut self.gyro_density, "rad/s per sqrt(Hz)"),
            ("accel_density", &mut self.accel_density, "m/s2 per sqrt(Hz)"),
            ("gyro_step_share", &mut self.gyro_step_share, ""),
            ("accel_step_share", &mut self.accel_step_share, ""),
            ("gyro_scale", &mut self.gyro_scale, ""),
            ("rest_below_rad_s", &mut self.rest_below_rad_s, "rad/s"),
            ("rest_rate_std_rad_s", &mut self.rest_rate_std_rad_s, "rad/s"),
            ("rest_time_s", &mut self.rest_time_s, "s"),
            ("start_std_rad", &mut self.start_std_rad, "rad"),
            ("start_tilt_std_rad", &mut self.start_tilt_std_rad, "rad"),
            ("start_speed_std_m_s", &mut self.start_speed_std_m_s, "m/s"),
            ("start_place_std_m", &mut self.start_place_std_m, "m"),
        ]
    }
}
