//! Measurement model: readings of all sensors and closures of a model, given the motion of its frames. `body` uses it.

pub mod closure;
pub mod encoder;
pub mod imu;
pub(crate) mod kind;
pub mod mount;
pub mod near;
pub mod orientation;
pub mod position;
pub mod range;
pub mod slopes;

use crate::kernels::lane::{Lane, Real};
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::{Near, Reach, Wanted};
use crate::kinematics::FrameMotion;
use crate::model::section::{Known, Section};
use crate::model::{Expr, Model, Point};
use crate::rotation::{Mat3, Vec3};
use kind::{all_keys, kinds, refuse_others, Described, Kind, Pending, Reads, Sits};
pub use mount::{Mount, MountValue};
use near::{Homes, Nearby, Stand};
use serde_json::Value;
use slopes::{Answers, Found, Group, Moving};
use std::ops::Range;
use std::sync::LazyLock;

// Every kind of sensor: its variant, and the file that implements it. A new kind adds one line.
kinds! {
    Imu: imu,
    Encoder: encoder,
    Position: position,
    Range: range,
    Orientation: orientation,
}

/// Rows that are accepted or rejected together.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Rows of the measurement vector.
    pub rows: Range<usize>,
    /// Their quantity.
    pub quantity: Quantity,
}

/// Physical quantity of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Angular velocity, rad/s.
    Gyro,
    /// Specific force, m/s2.
    Accel,
    /// Magnetic field, uT.
    Mag,
    /// A joint's value, rad or m.
    Joint,
    /// A point in root axes, m.
    Position,
    /// A closure's gap (m) and difference of axes.
    Closure,
    /// Angular velocity, rad/s; measured as zero while the unit rests.
    Rest,
    /// Velocity of a point that touches the ground, m/s in root axes; measured as zero while it stands.
    Contact,
    /// A distance, m.
    Range,
    /// A rotation vector from the measured to the predicted orientation, rad.
    Orientation,
}

impl Quantity {
    /// Whether a stream of `given` supplies it. A stream with one number a row does not name its quantity.
    pub fn is_fed_by(self, given: Quantity) -> bool {
        self == given || (self, given) == (Quantity::Range, Quantity::Joint)
    }

    /// Whether no sensor measures it: the tracker itself finds when its value is known.
    pub fn is_virtual(self) -> bool {
        matches!(self, Quantity::Rest | Quantity::Contact | Quantity::Closure)
    }

    /// Whether an inertial unit measures it.
    pub fn is_inertial(self) -> bool {
        matches!(self, Quantity::Gyro | Quantity::Accel | Quantity::Mag)
    }
}

/// A sensor or a closure: its rows in the measurement vector.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Name of the sensor or closure.
    pub name: String,
    /// All its rows.
    pub rows: Range<usize>,
    /// Its parts, such as gyroscope, accelerometer and magnetometer.
    pub parts: Vec<Part>,
    /// Standard deviation of each row's noise.
    pub std: Vec<f64>,
    /// Name of each row, such as `back.gyro_x`.
    pub row_names: Vec<String>,
}

impl Source {
    /// Whether it is an inertial unit.
    pub fn is_inertial(&self) -> bool {
        self.parts.iter().any(|p| p.quantity.is_inertial())
    }
}

/// A slow error of a sensor that is estimated: three states that are added to three rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowError {
    /// The quantity that it is added to.
    pub quantity: Quantity,
    /// Name of its states, such as `gyro_bias`.
    pub name: &'static str,
    /// The entry of `Config.estimate` that enables it; `None`: it is always estimated.
    pub asked: Option<&'static str>,
    /// Standard deviation at the start.
    pub start_std: f64,
    /// Random walk, per sqrt(s).
    pub walk: f64,
    /// Time constant of its decay, s; infinite: a random walk.
    pub time_s: f64,
}

/// The unknown heading of a device's reference, which is estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct Heading {
    /// Sensors of one group share it.
    pub group: String,
    /// Its random walk, rad per sqrt(s).
    pub walk: f64,
}

/// All sensors and closures of a model at one set of parameters and mounts.
#[derive(Debug, Clone)]
pub struct Suite {
    /// In the order of the model: sensors, then closures.
    pub sources: Vec<Source>,
    readers: Vec<Reader>,
}

/// Motion of a body and its surroundings: everything that readings depend on.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a, T> {
    /// Motion of all frames.
    pub frames: &'a [FrameMotion<T>],
    /// Values of all coordinates.
    pub q: &'a [T],
    /// Magnetic field in root axes, uT.
    pub magnetic_field: Vec3<T>,
    /// Lengths, mounts and headings.
    pub worn: Worn<'a, T>,
    /// Per source: the reference of readings that are differences from one.
    pub references: &'a [Mat3<f64>],
}

impl<T: Real> Scene<'_, T> {
    /// A point of a frame in root axes, m.
    #[inline(always)]
    fn place(&self, frame: usize, point: &Point) -> Vec3<T> {
        let frame = &self.frames[frame];
        frame.position + point.turned(&frame.rotation, self.worn.lengths)
    }
}

/// Estimated numbers of sensors and lengths.
#[derive(Debug, Clone, Copy)]
pub struct Worn<'a, T> {
    /// Values of the estimated parameters.
    pub lengths: &'a [T],
    /// Rotation vectors of the estimated mount errors, rad in sensor axes.
    pub mounts: &'a [Vec3<T>],
    /// Headings of the references of orientation sensors, rad.
    pub headings: &'a [T],
}

/// Parameter values, and which parameters, mounts and headings are estimated.
#[derive(Debug, Clone, Copy)]
pub struct Wearing<'a> {
    /// Values of all parameters.
    pub parameters: &'a [f64],
    /// Indices of the estimated parameters.
    pub estimated: &'a [usize],
    /// Indices of the sensors with an estimated mount.
    pub mounts: &'a [usize],
    /// Per sensor: number of its estimated heading. Empty: none.
    pub headings: &'a [Option<usize>],
}

/// Frame, or piece of the tree, and point of each end of a loop or distance.
pub type Sides<P> = [(usize, P); 2];

/// Everything that turns a sensor of a model file into one that predicts its rows.
pub(crate) struct Fit<'a> {
    model: &'a Model,
    worn: &'a Wearing<'a>,
    /// Calibrated mount that replaces the nominal one.
    given: Option<MountValue>,
    /// Number among the estimated mounts.
    mount: Option<usize>,
    /// Number among the estimated headings.
    heading: Option<usize>,
    /// Number among the sources.
    source: usize,
}

impl Fit<'_> {
    fn point(&self, point: &[Expr; 3]) -> Point {
        Point::of(point, self.worn.parameters, self.worn.estimated)
    }

    fn sides(&self, sides: &Sides<[Expr; 3]>) -> Sides<Point> {
        sides.each_ref().map(|(frame, point)| (*frame, self.point(point)))
    }
}

impl Suite {
    /// Lays out the measurement vector. `mounts` are (link from sensor, offset in the link, m) per sensor, where they
    /// differ from the nominal ones. Encoders of input joints have no rows: their readings are inputs.
    pub fn new(model: &Model, parameters: &[f64], mounts: &[Option<MountValue>]) -> Self {
        Self::worn(model, &Wearing { parameters, estimated: &[], mounts: &[], headings: &[] }, mounts)
    }

    /// The same with estimated lengths, mounts and headings.
    pub fn worn(model: &Model, worn: &Wearing, mounts: &[Option<MountValue>]) -> Self {
        let mut suite = Suite { sources: Vec::new(), readers: Vec::new() };
        for (i, (sensor, given)) in model.sensors.iter().zip(mounts).enumerate() {
            let mount = worn.mounts.iter().position(|&s| s == i);
            let (heading, source) = (worn.headings.get(i).copied().flatten(), suite.sources.len());
            if let Some(reader) = sensor.kind.reader(&Fit { model, worn, given: *given, mount, heading, source }) {
                suite.push(&sensor.name, reader);
            }
        }
        for closure in &model.closures {
            let source = suite.sources.len();
            let reader = closure.reader(&Fit { model, worn, given: None, mount: None, heading: None, source });
            reader.into_iter().for_each(|reader| suite.push(&closure.name, Reader::Closure(reader)));
        }
        suite
    }

    fn push(&mut self, name: &str, reader: Reader) {
        let first = self.len();
        let mut source = Source {
            name: name.to_string(),
            rows: first..first,
            parts: Vec::new(),
            std: Vec::new(),
            row_names: Vec::new(),
        };
        for (quantity, suffixes, std) in reader.rows() {
            let start = source.rows.end;
            source.rows.end += suffixes.len();
            source.parts.push(Part { rows: start..source.rows.end, quantity });
            source.std.extend(std);
            let named = |s: &&str| {
                if s.is_empty() {
                    name.to_string()
                } else {
                    format!("{name}.{s}")
                }
            };
            source.row_names.extend(suffixes.iter().map(named));
        }
        self.sources.push(source);
        self.readers.push(reader);
    }

    /// Length of the measurement vector.
    pub fn len(&self) -> usize {
        self.sources.last().map_or(0, |s| s.rows.end)
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Standard deviation of every row.
    pub fn std(&self) -> Vec<f64> {
        self.sources.iter().flat_map(|s| s.std.iter().copied()).collect()
    }

    /// Name of every row.
    pub fn row_names(&self) -> Vec<String> {
        self.sources.iter().flat_map(|s| s.row_names.iter().cloned()).collect()
    }

    /// Marks the frames whose motion source `i` depends on.
    pub fn mark_frames(&self, i: usize, needed: &mut [bool]) {
        self.readers[i].mark_frames(needed);
    }

    /// Marks the frames whose velocities or accelerations source `i` depends on.
    pub fn mark_moving(&self, i: usize, moving: &mut [bool]) {
        self.readers[i].mark_moving(moving);
    }

    /// Readings on a manifold: moves them from `z` to references, so that their rows become differences, and sets `z`
    /// to zero.
    pub fn refer(&self, z: &mut [f64], references: &mut [Mat3<f64>]) {
        for ((reader, source), reference) in self.readers.iter().zip(&self.sources).zip(references) {
            if let Some(taken) = reader.refer(&mut z[source.rows.clone()]) {
                *reference = taken;
            }
        }
    }

    /// Predicts the rows of every `active` source into `out`. Allocates nothing.
    #[inline(always)]
    pub fn predict<T: Real>(&self, scene: &Scene<T>, active: &[bool], out: &mut [T]) {
        for ((reader, source), _) in self.readers.iter().zip(&self.sources).zip(active).filter(|(_, on)| **on) {
            reader.predict(scene, &mut out[source.rows.clone()]);
        }
    }
}

/// Layout of a sensor's rows: quantity, suffix of each row's name, standard deviation of each.
type RowGroups = Vec<(Quantity, &'static [&'static str], Vec<f64>)>;
