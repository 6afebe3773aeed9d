//! What a body is: frames, joints, sensors, loops and parameters. Never changes once built.

pub mod build;
pub mod expr;
mod locate;
pub mod point;
pub(crate) mod section;
pub(crate) mod slot;
pub mod spec;
pub mod suggest;
pub mod transform;

pub use crate::sensor::closure::Closure;
pub use crate::sensor::encoder::Encoder;
pub use crate::sensor::imu::{Imu, ImuNoise};
pub use crate::sensor::orientation::Orientation;
pub use crate::sensor::position::Position;
pub use crate::sensor::range::Range;
pub use crate::sensor::{Mount, SensorKind};
pub use build::read_model;
pub use expr::Expr;
pub use point::Point;
use std::f64::consts::{PI, TAU};
pub use transform::{RotationExpr, Transform};

/// What a joint lets move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Nothing.
    Fixed,
    /// A rotation, rad.
    Hinge,
    /// A translation, m.
    Slide,
    /// Any rotation: a rotation vector, rad.
    Ball,
    /// Any motion: a place, m, and a rotation vector, rad.
    Free,
}

impl JointKind {
    /// How many coordinates it has.
    pub fn width(self) -> usize {
        match self {
            JointKind::Fixed | JointKind::Hinge | JointKind::Slide => 1,
            JointKind::Ball => 3,
            JointKind::Free => 6,
        }
    }

    /// Whether it turns freely, its last three coordinates being a rotation vector.
    pub fn turns_freely(self) -> bool {
        matches!(self, JointKind::Ball | JointKind::Free)
    }
}

/// How a joint moves by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProcessKind {
    /// Constant acceleration driven by white jerk: states q, qd, qdd.
    Jerk,
    /// Random walk: state q alone.
    Walk,
    /// Acceleration that decays while white jerk drives it (Singer 1970): states q, qd, qdd.
    Singer,
}

/// A joint's own motion and its spread at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Process {
    /// Which motion.
    pub kind: ProcessKind,
    /// Standard deviation of the driving increments per sqrt(s).
    pub density: f64,
    /// Of q, qd, qdd at the start (only the first for a walk).
    pub start_std: [f64; 3],
    /// A rotation's own joint says how far its first value may lie from rest; else the limits do.
    pub start_known: bool,
    /// In which the acceleration decays, s; infinite but for `Singer`.
    pub time_s: f64,
}

/// How the place of a free joint moves by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Translation {
    /// Its own motion.
    pub process: Process,
    /// Soft range of every coordinate about its rest, m.
    pub limits: [f64; 2],
}

impl Parameter {
    /// Whether it is a length of which is said how well it is known.
    pub fn can_be_estimated(&self) -> bool {
        self.unit == "m" && self.std.is_some()
    }
}

/// A joint: a named degree of freedom that one or more frames share.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Unique among joints.
    pub name: String,
    /// For people.
    pub label: String,
    /// What it lets move.
    pub kind: JointKind,
    /// Index of its first coordinate.
    pub first: usize,
    /// Soft range, rad or m: two standard deviations either side of its middle; of a ball, about each axis from `rest`.
    pub limits: [f64; 2],
    /// Where it is held while nothing observes it, rad or m, by coordinate.
    pub rest: Vec<f64>,
    /// Its own motion; of a free joint, that of its rotation.
    pub process: Process,
    /// The rest of a free joint's own motion.
    pub translation: Option<Translation>,
    /// Intrinsic sequence of axes by which people read a free rotation: `YXY`.
    pub angles: String,
    /// Its value comes from a stream and is no state.
    pub input: bool,
    /// Standard deviation of an input's reading, rad or m.
    pub input_std: f64,
}

/// How one coordinate of a joint moves by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Its own motion.
    pub process: Process,
    /// Soft range: two standard deviations either side of its middle.
    pub limits: [f64; 2],
    /// Where it is held while nothing observes it.
    pub rest: f64,
    /// It is a place that no sensor has to tell; how strongly it is driven is learnt all the same.
    pub place: bool,
    /// It belongs to a rotation vector, whose limits count from its rest.
    pub turns: bool,
}

impl Axis {
    /// Standard deviation of its prior.
    pub fn prior_std(&self) -> f64 {
        (self.limits[1] - self.limits[0]) / 4.0
    }

    /// Standard deviation of the first value from rest, before anything is measured.
    pub fn start_spread(&self) -> f64 {
        let known = if self.process.start_known { self.process.start_std[0] } else { f64::INFINITY };
        known.min(self.prior_std())
    }

    /// The same angle, less than half a turn from the middle of its soft range.
    pub fn nearest(&self, angle: f64) -> f64 {
        let middle = 0.5 * (self.limits[0] + self.limits[1]);
        middle + (angle - middle + PI).rem_euclid(TAU) - PI
    }
}

impl Joint {
    /// How its coordinates move by themselves.
    fn axes(&self) -> Vec<Axis> {
        let turns = self.kind.turns_freely();
        let axis = |(i, &rest): (usize, &f64)| match &self.translation {
            Some(t) if i < 3 => {
                Axis { process: t.process, limits: t.limits.map(|x| x + rest), rest, place: true, turns: false }
            }
            _ => Axis { process: self.process, limits: self.limits, rest, place: false, turns },
        };
        self.rest.iter().enumerate().map(axis).collect()
    }

    /// Indices of its coordinates.
    pub fn coordinates(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.kind.width()
    }

    /// Index of the first coordinate of its rotation vector, if it turns freely.
    pub fn turn(&self) -> Option<usize> {
        self.kind.turns_freely().then(|| self.first + self.kind.width() - 3)
    }

    /// Name of each coordinate.
    pub fn coordinate_names(&self) -> Vec<String> {
        let suffixes: &[&str] = match self.kind {
            JointKind::Fixed | JointKind::Hinge | JointKind::Slide => return vec![self.name.clone()],
            JointKind::Ball => &["rx", "ry", "rz"],
            JointKind::Free => &["x", "y", "z", "rx", "ry", "rz"],
        };
        suffixes.iter().map(|s| format!("{}.{s}", self.name)).collect()
    }
}

/// A frame: parent, then `before`, then the joint's motion about z, then `after`.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Unique among frames; frame 0 is `root`.
    pub name: String,
    /// Index of the parent; always smaller than the frame's own.
    pub parent: usize,
    /// Fixed transform from the parent to the joint; `None` is the identity.
    pub before: Option<Transform>,
    /// Index of the joint and its sign.
    pub joint: Option<(usize, f64)>,
    /// Fixed transform behind the joint; `None` is the identity.
    pub after: Option<Transform>,
}

/// A named sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// Unique among sensors and closures.
    pub name: String,
    /// What it reads.
    pub kind: SensorKind,
}

/// An unmeasured acceleration of the root.
#[derive(Debug, Clone, PartialEq)]
pub struct BaseAcceleration {
    /// Unique among base accelerations.
    pub name: String,
    /// For people.
    pub label: String,
    /// Unit vector in root axes.
    pub axis: [f64; 3],
    /// m/s2 per sqrt(s).
    pub density: f64,
    /// m/s2.
    pub start_std: f64,
    /// In which it decays, s; infinite: it walks.
    pub time_s: f64,
    /// In which a push builds up, s; 0: it jumps.
    pub rise_s: f64,
    /// It is estimated whether `Config.estimate` names it or not.
    pub always: bool,
}

impl BaseAcceleration {
    /// Standard deviation of its rate in the long run, m/s3; for one that does not jump.
    pub fn rate_std(&self) -> f64 {
        self.density / (2.0 * self.rise_s).sqrt()
    }
}

/// Gravity and the magnetic field.
#[derive(Debug, Clone, PartialEq)]
pub struct World {
    /// Unit vector in root axes.
    pub up: [f64; 3],
    /// Horizontal unit vector in root axes from which the azimuth counts.
    pub forward: [f64; 3],
    /// m/s2.
    pub gravity_m_s2: f64,
    /// uT.
    pub magnetic_norm_ut: Expr,
    /// Below the horizon, rad.
    pub magnetic_dip_rad: Expr,
    /// From `forward` about `up`, rad.
    pub magnetic_azimuth_rad: f64,
    /// The azimuth is known.
    pub azimuth_fixed: bool,
    /// rad per sqrt(s).
    pub azimuth_walk: f64,
}

/// A length, a place or an angle of the body that a person may set.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Unique among parameters.
    pub name: String,
    /// For people.
    pub label: String,
    /// m, rad or empty.
    pub unit: String,
    /// Value unless set.
    pub default: f64,
    /// Prior standard deviation; `None` is unknown.
    pub std: Option<f64>,
}

/// A body, its sensors and its loops.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Short name.
    pub name: String,
    /// One or two sentences.
    pub description: String,
    /// Gravity and magnetic field.
    pub world: World,
    /// In file order; expressions refer to them by index.
    pub parameters: Vec<Parameter>,
    /// In file order.
    pub joints: Vec<Joint>,
    /// Root first, parents before children, otherwise in file order.
    pub frames: Vec<Frame>,
    /// In file order.
    pub sensors: Vec<Sensor>,
    /// In file order.
    pub closures: Vec<Closure>,
    /// In file order.
    pub base_accelerations: Vec<BaseAcceleration>,
}

impl Model {
    /// Reads a model's TOML text; `file` names it in messages.
    ///
    /// # Errors
    /// [`crate::Error::Model`] with every mistake on a line of its own, each with file, line, key and what was expected.
    pub fn from_toml(text: &str, file: &str) -> crate::Result<Model> {
        read_model(text, file).map_err(|mistakes| crate::Error::Model(mistakes.join("\n")))
    }

    /// How many coordinates all joints have together.
    pub fn coordinate_count(&self) -> usize {
        self.joints.iter().map(|j| j.kind.width()).sum()
    }

    /// How every coordinate moves by itself.
    pub fn axes(&self) -> Vec<Axis> {
        self.joints.iter().flat_map(Joint::axes).collect()
    }

    /// Name of every coordinate: that of the joint, or `shoulder.rx`, `pelvis.x`.
    pub fn coordinate_names(&self) -> Vec<String> {
        self.joints.iter().flat_map(Joint::coordinate_names).collect()
    }

    /// Every parameter's default, in the order of [`Model::parameters`].
    pub fn default_parameters(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.default).collect()
    }
}
