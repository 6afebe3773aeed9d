//! What the sensors and closed loops of a model read from the motion of its frames.

pub mod closure;
pub mod encoder;
pub mod imu;
pub mod near;
pub mod position;
pub mod slopes;

use crate::kernels::lane::Real;
use crate::kinematics::FrameMotion;
use crate::model::{Model, Point, SensorKind};
use crate::rotation::Vec3;
use std::ops::Range;

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
}

impl Quantity {
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

/// A sensor that can predict its rows.
#[derive(Debug, Clone)]
enum Reader {
    Imu(imu::Imu),
    Encoder(encoder::Encoder),
    Position(position::Position),
    Closure(closure::Loop),
}

/// All sensors and closures of a model at one set of parameters and mounts.
#[derive(Debug, Clone)]
pub struct Suite {
    /// In the order of the model: sensors, then closures.
    pub sources: Vec<Source>,
    readers: Vec<Reader>,
}

/// What surrounds the body, in root axes.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings<T> {
    /// uT.
    pub magnetic_field: Vec3<T>,
}

/// What is estimated of how the sensors are worn.
#[derive(Debug, Clone, Copy)]
pub struct Worn<'a, T> {
    /// Values of the parameters that are estimated.
    pub lengths: &'a [T],
    /// Rotation vectors by which the estimated mounts are off, rad in sensor axes.
    pub mounts: &'a [Vec3<T>],
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
}

impl Suite {
    /// Lays out the measurement vector. `mounts` are (link from sensor, offset in the link, m) per sensor, for those
    /// that differ from the model's own. Encoders of input joints read nothing here: their values are inputs.
    pub fn new(model: &Model, parameters: &[f64], mounts: &[Option<imu::MountValue>]) -> Self {
        Self::worn(model, &Wearing { parameters, estimated: &[], mounts: &[] }, mounts)
    }

    /// The same, with something of the wearing estimated.
    pub fn worn(model: &Model, worn: &Wearing, mounts: &[Option<imu::MountValue>]) -> Self {
        let mut suite = Suite { sources: Vec::new(), readers: Vec::new() };
        for (i, (sensor, mount)) in model.sensors.iter().zip(mounts).enumerate() {
            match &sensor.kind {
                SensorKind::Imu { .. } => {
                    let number = worn.mounts.iter().position(|&s| s == i);
                    suite.push(&sensor.name, Reader::Imu(imu::Imu::new(&sensor.kind, worn, mount, number)))
                }
                SensorKind::Encoder { joint, std } if !model.joints[*joint].input => {
                    let reader = encoder::Encoder { coordinate: model.joints[*joint].first, std: *std };
                    suite.push(&sensor.name, Reader::Encoder(reader))
                }
                SensorKind::Encoder { .. } => {}
                SensorKind::Position { frame, point, std } => {
                    let point = Point::of(point, worn.parameters, worn.estimated);
                    let reader = position::Position { frame: *frame, point, std: *std };
                    suite.push(&sensor.name, Reader::Position(reader));
                }
            }
        }
        for c in &model.closures {
            suite.push(&c.name, Reader::Closure(closure::Loop::new(c, worn)));
        }
        suite
    }

    fn push(&mut self, name: &str, reader: Reader) {
        let first = self.len();
        let rows = match &reader {
            Reader::Imu(s) => s.rows(),
            Reader::Encoder(s) => s.rows(),
            Reader::Position(s) => s.rows(),
            Reader::Closure(s) => s.rows(),
        };
        let mut source = Source {
            name: name.to_string(),
            rows: first..first,
            parts: Vec::new(),
            std: Vec::new(),
            row_names: Vec::new(),
        };
        for (quantity, suffixes, std) in rows {
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
        match &self.readers[i] {
            Reader::Imu(s) => needed[s.frame] = true,
            Reader::Encoder(_) => {}
            Reader::Position(s) => needed[s.frame] = true,
            Reader::Closure(s) => s.frames().into_iter().for_each(|f| needed[f] = true),
        }
    }

    /// Marks the frames whose velocities or accelerations source `i` reads.
    pub fn mark_moving(&self, i: usize, moving: &mut [bool]) {
        if let Reader::Imu(s) = &self.readers[i] {
            moving[s.frame] = true;
        }
    }

    /// Predicts the rows of every `active` source into `out`. Allocates nothing.
    pub fn predict<T: Real>(
        &self,
        frames: &[FrameMotion<T>],
        q: &[T],
        surroundings: &Surroundings<T>,
        worn: Worn<T>,
        active: &[bool],
        out: &mut [T],
    ) {
        for ((reader, source), &on) in self.readers.iter().zip(&self.sources).zip(active) {
            if !on {
                continue;
            }
            let out = &mut out[source.rows.clone()];
            match reader {
                Reader::Imu(s) => s.predict(&frames[s.frame], surroundings, worn, out),
                Reader::Encoder(s) => out[0] = q[s.coordinate],
                Reader::Position(s) => s.predict(&frames[s.frame], worn, out),
                Reader::Closure(s) => s.predict(frames, worn, out),
            }
        }
    }
}

/// Rows of a sensor: quantity, suffix of each row's name, standard deviation of each.
type RowGroups = Vec<(Quantity, &'static [&'static str], Vec<f64>)>;
