//! `Layout`: the order of the state vector (poses, rates, accelerations, slow states). All filters use it.

use crate::config::{Config, Magnetometer, DEFAULT_ESTIMATE};
use crate::error::{Error, Result};
use crate::estimate::Partition;
use crate::model::{Joint, JointKind, Model, ProcessKind, SensorKind};
use crate::sensor::SlowError;

/// Indices of a coordinate's value, rate and acceleration. The three of a rotation vector are adjacent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slots {
    /// Value.
    pub q: usize,
    /// Rate and acceleration, unless the joint is a random walk.
    pub rates: Option<(usize, usize)>,
}

/// A slow error of a sensor, such as a bias: three states that are added to a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorSlot {
    /// Index of the sensor in the model.
    pub sensor: usize,
    /// First index in the state.
    pub first: usize,
    /// Its process.
    pub error: SlowError,
}

/// A base acceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PushSlot {
    /// Index in the state.
    pub state: usize,
    /// Index of its rate, if it has a rise time.
    pub rate: Option<usize>,
    /// Index of the base acceleration in the model.
    pub number: usize,
}

/// Order of the state vector.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Per coordinate of the model's joints; `None` for inputs and fixed joints.
    pub coordinates: Vec<Option<Slots>>,
    /// Index and slot of the first coordinate of every rotation vector.
    pub turns: Vec<(usize, Slots)>,
    /// Parameter and state of every estimated length.
    pub lengths: Vec<(usize, usize)>,
    /// Sensor and first state of every estimated mount.
    pub mounts: Vec<(usize, usize)>,
    /// Headings of references of orientation sensors: state, and random walk (rad per sqrt(s)).
    pub headings: Vec<(usize, f64)>,
    /// Per sensor of the model: number of its heading.
    pub heading_of: Vec<Option<usize>>,
    /// State of the magnetic field's azimuth.
    pub azimuth: Option<usize>,
    /// Estimated slow errors, in the order of the sensors.
    pub errors: Vec<ErrorSlot>,
    /// Estimated base accelerations.
    pub pushes: Vec<PushSlot>,
    /// Names of the states: `trunk`, `trunk.velocity`, `trunk.acceleration`, `azimuth`, `back.gyro_bias_x`, `surge`.
    pub names: Vec<String>,
    /// Sizes of the blocks of the state.
    pub partition: Partition,
}

impl Layout {
    /// The layout of `model` under `config`.
    pub fn new(model: &Model, config: &Config) -> Result<Self> {
        check_names(model, config)?;
        let mut layout = Layout {
            coordinates: vec![None; model.coordinate_count()],
            turns: Vec::new(),
            lengths: Vec::new(),
            mounts: Vec::new(),
            headings: Vec::new(),
            heading_of: vec![None; model.sensors.len()],
            azimuth: None,
            errors: Vec::new(),
            pushes: Vec::new(),
            names: Vec::new(),
            partition: Partition { pose: 0, rate: 0, linear: 0 },
        };
        layout.place_poses(model, config);
        layout.place_rates(model);
        layout.place_slow(model, config);
        layout.partition.linear = layout.names.len() - layout.partition.curved();
        Ok(layout)
    }

    fn push(&mut self, name: String) -> usize {
        self.names.push(name);
        self.names.len() - 1
    }

    /// States that move a frame or rotate a reading.
    fn place_poses(&mut self, model: &Model, config: &Config) {
        let moving = |j: &&Joint| !j.input && j.kind != JointKind::Fixed;
        let names = model.coordinate_names();
        for c in model.joints.iter().filter(moving).flat_map(Joint::coordinates) {
            let q = self.push(names[c].clone());
            self.coordinates[c] = Some(Slots { q, rates: None });
        }
        if estimates_azimuth(model, config) {
            self.azimuth = Some(self.push("azimuth".into()));
        }
        let wants = |name: &str| config.estimate.iter().any(|e| e == name);
        for (i, parameter) in model.parameters.iter().enumerate().filter(|(_, p)| p.can_be_estimated()) {
            if wants(LENGTHS) || wants(&parameter.name) {
                let state = self.push(format!("parameters.{}", parameter.name));
                self.lengths.push((i, state));
            }
        }
        let mounted = |s: &crate::model::Sensor| s.kind.mount().is_some() && wants(MOUNTS);
        for (i, sensor) in model.sensors.iter().enumerate().filter(|(_, s)| mounted(s)) {
            self.mounts.push((i, self.names.len()));
            self.names.extend(["x", "y", "z"].map(|a| format!("{}.mount_r{a}", sensor.name)));
        }
        self.place_headings(model);
        self.partition.pose = self.names.len();
    }

    /// Sensors of one group share a heading.
    fn place_headings(&mut self, model: &Model) {
        let mut groups: Vec<&str> = Vec::new();
        for (i, sensor) in model.sensors.iter().enumerate() {
            let Some(heading) = sensor.kind.heading() else { continue };
            let known = groups.iter().position(|group| *group == heading.group);
            self.heading_of[i] = Some(known.unwrap_or(groups.len()));
            if known.is_none() {
                groups.push(&heading.group);
                let state = self.push(format!("{}.heading", heading.group));
                self.headings.push((state, heading.walk));
            }
        }
    }

    fn place_rates(&mut self, model: &Model) {
        let names = model.coordinate_names();
        let with_rates: Vec<usize> = model
            .axes()
            .iter()
            .enumerate()
            .filter(|(c, axis)| self.coordinates[*c].is_some() && axis.process.kind != ProcessKind::Walk)
            .map(|(c, _)| c)
            .collect();
        for (rank, &c) in with_rates.iter().enumerate() {
            let slots = self.coordinates[c].as_mut().expect("filtered above");
            let rate = self.partition.pose + rank;
            slots.rates = Some((rate, rate + with_rates.len()));
        }
        for what in ["velocity", "acceleration"] {
            self.names.extend(with_rates.iter().map(|&c| format!("{}.{what}", names[c])));
        }
        self.partition.rate = with_rates.len();
        let turns = model.joints.iter().filter_map(Joint::turn);
        self.turns = turns.filter_map(|c| Some((c, self.coordinates[c]?))).collect();
    }

    fn place_slow(&mut self, model: &Model, config: &Config) {
        let wants = |name: &str| config.estimate.iter().any(|e| e == name);
        for (i, sensor) in model.sensors.iter().enumerate() {
            for error in sensor.kind.slow_errors().into_iter().filter(|e| e.asked.is_none_or(wants)) {
                self.errors.push(ErrorSlot { sensor: i, first: self.names.len(), error });
                self.names.extend(["x", "y", "z"].map(|a| format!("{}.{}_{a}", sensor.name, error.name)));
            }
        }
        for (i, base) in model.base_accelerations.iter().enumerate() {
            if base.always || wants(&base.name) {
                let state = self.push(base.name.clone());
                let rate = (base.rise_s > 0.0).then(|| self.push(format!("{}.rate", base.name)));
                self.pushes.push(PushSlot { state, rate, number: i });
            }
        }
    }

    /// Dimension of the state.
    pub fn dim(&self) -> usize {
        self.names.len()
    }
}

/// Entry of `Config.estimate`: all lengths with a standard deviation.
pub const LENGTHS: &str = "lengths";
/// Entry of `Config.estimate`: the mounts of the inertial units.
pub const MOUNTS: &str = "mounts";

fn estimates_azimuth(model: &Model, config: &Config) -> bool {
    let has_mag = |s: &crate::model::Sensor| matches!(&s.kind, SensorKind::Imu(imu) if imu.noise.mag_std.is_some());
    !model.world.azimuth_fixed && config.magnetometer != Magnetometer::Off && model.sensors.iter().any(has_mag)
}

fn check_names(model: &Model, config: &Config) -> Result<()> {
    let own = model.base_accelerations.iter().map(|b| b.name.as_str());
    let lengths = model.parameters.iter().filter(|p| p.can_be_estimated()).map(|p| p.name.as_str());
    let own = own.chain([LENGTHS, MOUNTS]).chain(lengths);
    let own = own.filter(|name| !DEFAULT_ESTIMATE.contains(name));
    let known: Vec<&str> = DEFAULT_ESTIMATE.into_iter().chain(own).collect();
    match config.estimate.iter().find(|e| !known.contains(&e.as_str())) {
        None => Ok(()),
        Some(odd) => Err(Error::Data(format!(
            "config: estimate has '{odd}', which model '{}' does not know; it can estimate: {}",
            model.name,
            known.join(", ")
        ))),
    }
}
