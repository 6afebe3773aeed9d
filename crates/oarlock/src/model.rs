//! `Model`: the body of a model file with its joints, frames, sensors, closures and parameters. It is immutable.

pub mod build;
pub mod cone;
pub mod expr;
mod inputs;
pub mod links;
mod locate;
pub mod point;
pub(crate) mod section;
pub(crate) mod slot;
pub mod spec;
pub mod suggest;
pub mod transform;

use crate::rotation::turn::minus;
pub use crate::sensor::closure::Closure;
pub use crate::sensor::encoder::Encoder;
pub use crate::sensor::imu::{Contact, Imu, ImuNoise};
pub use crate::sensor::orientation::Orientation;
pub use crate::sensor::position::Position;
pub use crate::sensor::range::Range;
pub use crate::sensor::{Mount, SensorKind};
pub use build::read_model;
use cone::{Beyond, Cone};
pub use expr::Expr;
pub use links::{Fixing, Links, Structure};
pub use point::Point;
use std::f64::consts::{PI, TAU};
pub use transform::{RotationExpr, Transform};

/// Kinds of joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// No motion.
    Fixed,
    /// A rotation, rad.
    Hinge,
    /// A translation, m.
    Slide,
    /// Any rotation: a rotation vector, rad.
    Ball,
    /// Any motion: a position, m, and a rotation vector, rad.
    Free,
}

impl JointKind {
    /// Number of coordinates.
    pub fn width(self) -> usize {
        match self {
            JointKind::Fixed | JointKind::Hinge | JointKind::Slide => 1,
            JointKind::Ball => 3,
            JointKind::Free => 6,
        }
    }

    /// Whether it rotates freely; its last three coordinates are then a rotation vector.
    pub fn turns_freely(self) -> bool {
        matches!(self, JointKind::Ball | JointKind::Free)
    }
}

/// Motion model of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProcessKind {
    /// Constant acceleration driven by white jerk: states q, qd, qdd.
    Jerk,
    /// Random walk: state q alone.
    Walk,
    /// Acceleration that decays while white jerk drives it (Singer 1970): states q, qd, qdd.
    Singer,
}

/// Process of a joint: motion model, noise and start distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Process {
    /// Motion model.
    pub kind: ProcessKind,
    /// Process noise: standard deviation of the driving increments per sqrt(s).
    pub density: f64,
    /// Standard deviations of q, qd, qdd at the start (only the first for a walk).
    pub start_std: [f64; 3],
    /// Whether a rotation's file gives the standard deviation of its first value about rest; otherwise the limits do.
    pub start_known: bool,
    /// Time constant of the acceleration, s; infinite except for `Singer`.
    pub time_s: f64,
}

/// Process of the position of a free joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Translation {
    /// Its process.
    pub process: Process,
    /// Soft limits of every coordinate about its rest, m.
    pub limits: [f64; 2],
}

impl Parameter {
    /// Whether it is a length with a standard deviation.
    pub fn can_be_estimated(&self) -> bool {
        self.unit == "m" && self.std.is_some()
    }
}

/// A joint: a named degree of freedom that one or more frames share.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Unique among joints.
    pub name: String,
    /// Description for people.
    pub label: String,
    /// Kind of joint.
    pub kind: JointKind,
    /// Index of its first coordinate.
    pub first: usize,
    /// Soft limits, rad or m: two standard deviations either side of their middle; of a ball, about each axis from
    /// `rest`, and the widest ones if it has a cone.
    pub limits: [f64; 2],
    /// Range of a ball that differs between directions.
    pub cone: Option<Cone>,
    /// Rest value of each coordinate, rad or m. An unobserved joint stays near it.
    pub rest: Vec<f64>,
    /// Its process; of a free joint, that of its rotation.
    pub process: Process,
    /// Process of a free joint's position.
    pub translation: Option<Translation>,
    /// Intrinsic Euler sequence for the display of a free rotation, such as `YXY`.
    pub angles: String,
    /// Whether its value comes from a stream and is no state.
    pub input: bool,
    /// Standard deviation of an input's reading, rad or m.
    pub input_std: f64,
}

/// One coordinate of a joint with its process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Its process.
    pub process: Process,
    /// Soft limits: two standard deviations either side of their middle.
    pub limits: [f64; 2],
    /// Rest value.
    pub rest: f64,
    /// Whether it is a position, which needs no sensor.
    pub place: bool,
    /// Whether it belongs to a rotation vector; its limits count from its rest.
    pub turns: bool,
    /// Whether the position is unbounded and only the velocity has a prior, because contacts measure velocities.
    pub travels: bool,
}

impl Axis {
    /// Standard deviation of its prior.
    pub fn prior_std(&self) -> f64 {
        (self.limits[1] - self.limits[0]) / 4.0
    }

    /// Largest standard deviation: with it a 95 % band reaches from one end of the range to the other.
    pub fn range_std(&self) -> f64 {
        2.0 * self.prior_std()
    }

    /// Standard deviation of the first value about rest, before any measurement.
    pub fn start_spread(&self) -> f64 {
        let known = if self.process.start_known { self.process.start_std[0] } else { f64::INFINITY };
        known.min(self.prior_std())
    }

    /// The same angle, less than half a turn from the middle of its soft limits.
    pub fn nearest(&self, angle: f64) -> f64 {
        let middle = 0.5 * (self.limits[0] + self.limits[1]);
        middle + (angle - middle + PI).rem_euclid(TAU) - PI
    }
}

impl Joint {
    /// Process of each coordinate.
    fn axes(&self) -> Vec<Axis> {
        let turns = self.kind.turns_freely();
        let axis = |(i, &rest): (usize, &f64)| match &self.translation {
            Some(t) if i < 3 => Axis {
                process: t.process,
                limits: t.limits.map(|x| x + rest),
                rest,
                place: true,
                turns: false,
                travels: false,
            },
            _ => {
                let limits = self.cone.map_or(self.limits, |cone| cone.limits_about(i));
                Axis { process: self.process, limits, rest, place: false, turns, travels: false }
            }
        };
        self.rest.iter().enumerate().map(axis).collect()
    }

    /// How far a ball with rotation vector `r` is beyond its range.
    pub fn beyond(&self, r: [f64; 3]) -> Beyond {
        let from_rest = minus(r, [self.rest[0], self.rest[1], self.rest[2]]);
        let [low, high] = self.limits;
        self.cone.map_or_else(
            || Beyond { angle: from_rest.iter().fold(low, |most, x| most.max(x.abs() - high)), range: high - low },
            |cone| cone.beyond(from_rest),
        )
    }

    /// Indices of its coordinates.
    pub fn coordinates(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.kind.width()
    }

    /// Index of the first coordinate of its rotation vector, if it rotates freely.
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
    /// Index and sign of the joint.
    pub joint: Option<(usize, f64)>,
    /// Fixed transform after the joint; `None` is the identity.
    pub after: Option<Transform>,
}

/// A named sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// Unique among sensors and closures.
    pub name: String,
    /// Kind and keys.
    pub kind: SensorKind,
}

/// An unmeasured acceleration of the root.
#[derive(Debug, Clone, PartialEq)]
pub struct BaseAcceleration {
    /// Unique among base accelerations.
    pub name: String,
    /// Description for people.
    pub label: String,
    /// Unit vector in root axes.
    pub axis: [f64; 3],
    /// Process noise, m/s2 per sqrt(s).
    pub density: f64,
    /// Standard deviation at the start, m/s2.
    pub start_std: f64,
    /// Time constant of its decay, s; infinite: a random walk.
    pub time_s: f64,
    /// Rise time of a change, s; 0: it changes at once.
    pub rise_s: f64,
    /// Whether it is always estimated, even if `Config.estimate` does not name it.
    pub always: bool,
}

impl BaseAcceleration {
    /// Stationary standard deviation of its rate, m/s3; only with a rise time.
    pub fn rate_std(&self) -> f64 {
        self.density / (2.0 * self.rise_s).sqrt()
    }
}

/// Gravity and the magnetic field.
#[derive(Debug, Clone, PartialEq)]
pub struct World {
    /// Up, a unit vector in root axes.
    pub up: [f64; 3],
    /// Horizontal unit vector in root axes that is azimuth 0.
    pub forward: [f64; 3],
    /// Gravity, m/s2.
    pub gravity_m_s2: f64,
    /// Norm of the magnetic field, uT.
    pub magnetic_norm_ut: Expr,
    /// Dip below the horizon, rad.
    pub magnetic_dip_rad: Expr,
    /// Azimuth from `forward` about `up`, rad.
    pub magnetic_azimuth_rad: f64,
    /// Whether the azimuth is known.
    pub azimuth_fixed: bool,
    /// Random walk of the azimuth, rad per sqrt(s).
    pub azimuth_walk: f64,
}

/// A length, position or angle of the body that a user may set.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Unique among parameters.
    pub name: String,
    /// Description for people.
    pub label: String,
    /// Unit: m, rad or empty.
    pub unit: String,
    /// Default value.
    pub default: f64,
    /// Prior standard deviation; `None`: unknown.
    pub std: Option<f64>,
}

/// A body, its sensors and closures.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Short name.
    pub name: String,
    /// One or two sentences.
    pub description: String,
    /// How it is tracked unless the configuration says otherwise; `None`: as strapdown links if its units allow it.
    pub structure: Option<Structure>,
    /// Statements for strapdown links.
    pub links: Links,
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
    /// [`crate::Error::Model`] with one line per mistake: file, line, key and what was expected.
    pub fn from_toml(text: &str, file: &str) -> crate::Result<Model> {
        read_model(text, file).map_err(|mistakes| crate::Error::Model(mistakes.join("\n")))
    }

    /// The encoder that reads a coordinate, so that whole turns of a hinge are known.
    pub fn encoder(&self, coordinate: usize) -> Option<&Sensor> {
        let reads =
            |kind: &SensorKind| matches!(kind, SensorKind::Encoder(e) if self.joints[e.joint].first == coordinate);
        self.sensors.iter().find(|sensor| reads(&sensor.kind))
    }

    /// Number of coordinates of all joints.
    pub fn coordinate_count(&self) -> usize {
        self.joints.iter().map(|j| j.kind.width()).sum()
    }

    /// Process of every coordinate.
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
