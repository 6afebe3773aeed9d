//! What the sensors and closed loops of a model read from the motion of its frames.

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
use near::{Around, Homes, Stand};
use serde_json::Value;
use slopes::{Answers, Found, Group, Moving};
use std::ops::Range;
use std::sync::LazyLock;

// Every kind of sensor: its variant, and the file that implements it.
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
    /// Of the measurement vector.
    pub rows: Range<usize>,
    /// What they measure.
    pub quantity: Quantity,
}

/// What a part of a measurement is.
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
    /// A loop's gap (m) and difference of axes.
    Closure,
    /// Angular velocity, rad/s, known to be zero while the unit rests.
    Rest,
    /// A distance, m.
    Range,
    /// A rotation vector from the measured to the predicted orientation, rad.
    Orientation,
}

impl Quantity {
    /// Whether a stream of `given` feeds it: a stream of one number a row does not say what it measures.
    pub fn is_fed_by(self, given: Quantity) -> bool {
        self == given || (self, given) == (Quantity::Range, Quantity::Joint)
    }

    /// Whether an inertial unit measures it.
    pub fn is_inertial(self) -> bool {
        matches!(self, Quantity::Gyro | Quantity::Accel | Quantity::Mag)
    }
}

/// A sensor or a closure: its rows in the measurement vector.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Of the sensor or closure.
    pub name: String,
    /// All its rows.
    pub rows: Range<usize>,
    /// Gyro, accel, mag ... of it.
    pub parts: Vec<Part>,
    /// Standard deviation of each row's noise.
    pub std: Vec<f64>,
    /// For people: `back.gyro_x`.
    pub row_names: Vec<String>,
}

impl Source {
    /// Whether it is an inertial unit.
    pub fn is_inertial(&self) -> bool {
        self.parts.iter().any(|p| p.quantity.is_inertial())
    }
}

/// An error of a sensor's readings that is estimated: three states that add to three rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowError {
    /// Whose rows it adds to.
    pub quantity: Quantity,
    /// Of its states: `gyro_bias`.
    pub name: &'static str,
    /// The word of `Config.estimate` that asks for it; `None`: it is always estimated.
    pub asked: Option<&'static str>,
    /// Standard deviation at the start.
    pub start_std: f64,
    /// Per sqrt(s).
    pub walk: f64,
    /// In which it decays, s; infinite: it walks.
    pub time_s: f64,
}

/// The reference of a device's orientations, turned about the vertical by an angle that is estimated.
#[derive(Debug, Clone, PartialEq)]
pub struct Heading {
    /// Sensors of the same group share it.
    pub group: String,
    /// How it drifts, rad per sqrt(s).
    pub walk: f64,
}

/// All sensors and closures of a model at one set of parameters and mounts.
#[derive(Debug, Clone)]
pub struct Suite {
    /// In the order of the model: sensors, then closures.
    pub sources: Vec<Source>,
    readers: Vec<Reader>,
}

/// How a body stands and moves, and what surrounds it: all that readings depend on.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a, T> {
    /// Motion of all frames.
    pub frames: &'a [FrameMotion<T>],
    /// Values of all coordinates.
    pub q: &'a [T],
    /// Root axes, uT.
    pub magnetic_field: Vec3<T>,
    /// Lengths and mounts.
    pub worn: Worn<'a, T>,
    /// Of every source whose readings are differences from one.
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

/// What is estimated of how the sensors are worn.
#[derive(Debug, Clone, Copy)]
pub struct Worn<'a, T> {
    /// Values of the parameters that are estimated.
    pub lengths: &'a [T],
    /// Rotation vectors by which the estimated mounts are off, rad in sensor axes.
    pub mounts: &'a [Vec3<T>],
    /// By which the references of orientation sensors are turned about the vertical, rad.
    pub headings: &'a [T],
}

/// Parameters, and what of the wearing is estimated.
#[derive(Debug, Clone, Copy)]
pub struct Wearing<'a> {
    /// Values of all parameters.
    pub parameters: &'a [f64],
    /// Indices of those that are estimated.
    pub estimated: &'a [usize],
    /// Indices of the sensors whose mount is estimated.
    pub mounts: &'a [usize],
    /// Per sensor: which of the headings that are estimated turns its reference. Empty: none.
    pub headings: &'a [Option<usize>],
}

/// The numbers with which a sensor of a model becomes one that predicts its rows.
pub(crate) struct Fit<'a> {
    model: &'a Model,
    worn: &'a Wearing<'a>,
    /// A calibrated mount in place of the model's.
    given: Option<MountValue>,
    /// Number among the sensors whose mount is estimated.
    mount: Option<usize>,
    /// Number among the headings that are estimated.
    heading: Option<usize>,
    /// Number among the sources.
    source: usize,
}

impl Fit<'_> {
    fn point(&self, point: &[Expr; 3]) -> Point {
        Point::of(point, self.worn.parameters, self.worn.estimated)
    }
}

impl Suite {
    /// Lays out the measurement vector. `mounts` are (link from sensor, offset in the link, m) per sensor, for those
    /// that differ from the model's own. Encoders of input joints have no rows: their values are inputs.
    pub fn new(model: &Model, parameters: &[f64], mounts: &[Option<MountValue>]) -> Self {
        Self::worn(model, &Wearing { parameters, estimated: &[], mounts: &[], headings: &[] }, mounts)
    }

    /// The same, with something of the wearing estimated.
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

    /// Nothing is measured.
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

    /// Marks the frames whose motion source `i` reads.
    pub fn mark_frames(&self, i: usize, needed: &mut [bool]) {
        self.readers[i].mark_frames(needed);
    }

    /// Marks the frames whose velocities or accelerations source `i` reads.
    pub fn mark_moving(&self, i: usize, moving: &mut [bool]) {
        self.readers[i].mark_moving(moving);
    }

    /// Of readings on a manifold: takes them from `z` as references, around which their rows are differences, and leaves zeros.
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

/// Rows of a sensor: quantity, suffix of each row's name, standard deviation of each.
type RowGroups = Vec<(Quantity, &'static [&'static str], Vec<f64>)>;
