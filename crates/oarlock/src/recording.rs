//! Streams of readings, and their merging into samples.

pub mod column;
pub mod feed;
pub mod gathering;
mod own_rows;
pub mod rows;
pub mod ticks;
pub mod timing;

use crate::corrections::Clock;
use crate::error::{Error, Result};
use crate::model::suggest::hint;
use crate::model::{Model, SensorKind};
use crate::rotation::turn::Turn;
use crate::sensor::{Quantity, Suite};
use column::Column;
use gathering::Heads;
pub use gathering::{Cursor, Gathering};
use std::collections::BTreeMap;

/// One quantity of a stream, row-major; NaN is missing.
#[derive(Debug, Clone)]
pub struct Channel {
    /// Its quantity; encoders of input joints are `Joint` too.
    pub quantity: Quantity,
    /// `time_s.len()` rows of 1 (joint, range), 4 (orientation: a quaternion, scalar first) or 3 numbers.
    pub values: Column,
}

/// Readings of one sensor with its own time stamps.
#[derive(Debug, Clone)]
pub struct Stream {
    /// Name of the sensor or of an input joint.
    pub name: String,
    /// Time stamps, strictly increasing, s.
    pub time_s: Column,
    /// Its quantities.
    pub channels: Vec<Channel>,
}

/// All readings at one time.
#[derive(Debug, PartialEq, Default)]
pub struct Sample {
    /// Time on the recording's clock, s.
    pub time_s: f64,
    /// In the order of the measurement vector; NaN is missing. The tracker fills in the closures' rows. The rows of an
    /// orientation sensor contain the rotation vector of its measurement, rad.
    pub z: Vec<f64>,
    /// Per coordinate of the model: readings of input joints, NaN where missing.
    pub inputs: Vec<f64>,
    /// Per source: time of its readings after that of the sample, s. Empty: zero.
    pub offset_s: Vec<f64>,
}

impl Clone for Sample {
    fn clone(&self) -> Self {
        let Sample { time_s, z, inputs, offset_s } = self;
        Sample { time_s: *time_s, z: z.clone(), inputs: inputs.clone(), offset_s: offset_s.clone() }
    }

    /// Copies into existing memory: a step allocates nothing.
    fn clone_from(&mut self, from: &Self) {
        let Sample { time_s, z, inputs, offset_s } = self;
        *time_s = from.time_s;
        z.clone_from(&from.z);
        inputs.clone_from(&from.inputs);
        offset_s.clone_from(&from.offset_s);
    }
}

impl Sample {
    /// A sample without readings.
    pub fn empty(model: &Model, suite: &Suite) -> Self {
        Sample {
            time_s: f64::NAN,
            z: vec![f64::NAN; suite.len()],
            inputs: vec![f64::NAN; model.coordinate_count()],
            offset_s: vec![0.0; suite.sources.len()],
        }
    }

    /// Removes all readings.
    pub fn clear(&mut self) {
        self.z.fill(f64::NAN);
        self.inputs.fill(f64::NAN);
        self.offset_s.fill(0.0);
    }
}

/// A stream with its clock.
#[derive(Debug, Clone)]
struct Clocked {
    stream: Stream,
    clock: Clock,
}

impl Clocked {
    /// True time of a row, s.
    fn true_s(&self, row: usize) -> Option<f64> {
        self.stream.time_s.get(row).map(|stamp_s| self.clock.true_s(stamp_s))
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Target {
    Row(usize),
    Input(usize),
}

/// The streams that a model uses.
#[derive(Debug, Clone)]
pub struct Recording {
    streams: Vec<Clocked>,
    /// Per stream and channel: its rows in the sample.
    targets: Vec<Vec<Target>>,
    /// Per stream: its source; `None` for an input.
    sources: Vec<Option<usize>>,
    gathering: Gathering,
    /// Readings that the model does not use: quantity, and the streams that have it.
    unused: BTreeMap<String, Vec<String>>,
}

/// What a stream supplies.
#[derive(Debug, Clone)]
pub struct Feeds {
    /// Its source; `None` for an input.
    pub source: Option<usize>,
    /// First row of each part of the measurement vector that it supplies.
    pub rows: Vec<usize>,
    /// Coordinate of the input that it supplies.
    pub input: Option<usize>,
}

impl Recording {
    /// Checks time stamps, lengths and names. Readings are gathered by true time according to `clocks` (by stream).
    pub fn new(
        model: &Model,
        suite: &Suite,
        streams: Vec<Stream>,
        clocks: &BTreeMap<String, Clock>,
        gathering: Gathering,
    ) -> Result<Self> {
        let (streams_, unused) = (Vec::new(), BTreeMap::new());
        let mut recording =
            Recording { streams: streams_, targets: Vec::new(), sources: Vec::new(), gathering, unused };
        for stream in streams {
            let clock = clocks.get(&stream.name).copied().unwrap_or_default();
            let clocked = Clocked { stream, clock };
            check(&clocked)?;
            let targets = recording.targets_of(model, suite, &clocked.stream)?;
            let is_source = |s: &crate::sensor::Source| s.name == clocked.stream.name;
            let is_row = targets.iter().any(|t| matches!(t, Target::Row(_)));
            recording.sources.push(suite.sources.iter().position(is_source).filter(|_| is_row));
            let Clocked { stream, clock } = clocked;
            let stream = own_rows::without_lacking(stream, |i, _| targets[i] != Target::Row(usize::MAX));
            recording.targets.push(targets);
            recording.streams.push(Clocked { stream, clock });
        }
        Ok(recording)
    }

    fn targets_of(&mut self, model: &Model, suite: &Suite, stream: &Stream) -> Result<Vec<Target>> {
        if let Some(joint) = input_joint(model, &stream.name) {
            return Ok(vec![Target::Input(model.joints[joint].first); stream.channels.len()]);
        }
        let Some(source) = suite.sources.iter().find(|s| s.name == stream.name) else {
            return Err(unknown_stream(model, &stream.name));
        };
        let mut targets = Vec::new();
        for channel in &stream.channels {
            match source.parts.iter().find(|p| p.quantity.is_fed_by(channel.quantity)) {
                Some(part) => {
                    refuse_negative(part.quantity, stream, &channel.values)?;
                    targets.push(Target::Row(part.rows.start));
                }
                None => {
                    let what = format!("{:?}", channel.quantity).to_lowercase();
                    self.unused.entry(what).or_default().push(stream.name.clone());
                    targets.push(Target::Row(usize::MAX));
                }
            }
        }
        Ok(targets)
    }

    /// Notes on readings that the model does not use, one for each quantity.
    pub fn notes(&self) -> Vec<String> {
        let text = |(what, names): (&String, &Vec<String>)| {
            let sensors = if names.len() == 1 { "sensor has" } else { "sensors have" };
            format!(
                "{}: {what} readings are not used because the model's {sensors} none; to use them, add their noise to the \
                 model file",
                names.join(", ")
            )
        };
        self.unused.iter().map(text).collect()
    }

    /// The position before the first row.
    pub fn start(&self) -> Cursor {
        Cursor::new(self.streams.len())
    }

    /// Names of the streams.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.streams.iter().map(|s| s.stream.name.as_str())
    }

    /// The streams as they were recorded.
    pub fn streams(&self) -> impl Iterator<Item = &Stream> {
        self.streams.iter().map(|s| &s.stream)
    }

    /// Name of every stream, and what it supplies.
    pub fn feeds(&self) -> impl Iterator<Item = (&str, Feeds)> {
        self.names().zip(self.targets.iter().zip(&self.sources)).map(|(name, (targets, source))| {
            let mut feeds = Feeds { source: *source, rows: Vec::new(), input: None };
            for target in targets {
                match *target {
                    Target::Row(usize::MAX) => {}
                    Target::Row(first) => feeds.rows.push(first),
                    Target::Input(coordinate) => feeds.input = Some(coordinate),
                }
            }
            (name, feeds)
        })
    }

    /// Whether a stream of this source has a number of each of these quantities.
    pub fn has(&self, source: usize, quantities: &[Quantity]) -> bool {
        let own = self.streams.iter().zip(&self.sources).filter(|(_, s)| **s == Some(source));
        let channels = || own.clone().flat_map(|(clocked, _)| &clocked.stream.channels);
        let is_number = |channel: &Channel| channel.values.iter().any(|x| !x.is_nan());
        quantities.iter().all(|q| channels().any(|channel| channel.quantity == *q && is_number(channel)))
    }

    /// Rows of the stream that has most.
    pub fn longest(&self) -> usize {
        self.streams.iter().map(|s| s.stream.time_s.len()).max().unwrap_or_default()
    }

    /// First and last true time, s; `None` without rows.
    pub fn span_s(&self) -> Option<(f64, f64)> {
        let first = self.streams.iter().filter_map(|s| s.true_s(0)).reduce(f64::min)?;
        let last = self.streams.iter().filter_map(|s| s.true_s(s.stream.time_s.len().checked_sub(1)?));
        let last = last.reduce(f64::max)?;
        Some((first, last))
    }

    /// Reads the next sample; false at the end. Allocates nothing.
    pub fn next(&self, cursor: &mut Cursor, sample: &mut Sample) -> bool {
        self.gathering.next(self, cursor, sample)
    }
}

impl Heads for Recording {
    fn count(&self) -> usize {
        self.streams.len()
    }

    fn true_s(&self, stream: usize, row: usize) -> Option<f64> {
        self.streams[stream].true_s(row)
    }

    fn source(&self, stream: usize) -> Option<usize> {
        self.sources[stream]
    }

    fn put(&self, stream: usize, row: usize, sample: &mut Sample) {
        for (channel, target) in self.streams[stream].stream.channels.iter().zip(&self.targets[stream]) {
            let width = width(channel.quantity);
            match *target {
                Target::Row(usize::MAX) => {}
                Target::Row(first) if channel.quantity == Quantity::Orientation => {
                    let mut quaternion = [0.0; 4];
                    channel.values.read(row * width, &mut quaternion);
                    sample.z[first..first + 3].copy_from_slice(&Turn(quaternion).log());
                }
                Target::Row(first) => channel.values.read(row * width, &mut sample.z[first..first + width]),
                Target::Input(coordinate) => {
                    channel.values.read(row * width, &mut sample.inputs[coordinate..=coordinate]);
                }
            }
        }
    }
}

/// The input joint that a stream of this name supplies: the joint's own name, or that of an encoder on it.
pub fn input_joint(model: &Model, name: &str) -> Option<usize> {
    let encoder = model.sensors.iter().find_map(|s| match &s.kind {
        SensorKind::Encoder(encoder) if s.name == name => Some(encoder.joint),
        _ => None,
    });
    let joint = encoder.or_else(|| model.joints.iter().position(|j| j.name == name))?;
    model.joints[joint].input.then_some(joint)
}

fn unknown_stream(model: &Model, name: &str) -> Error {
    let inputs = model.joints.iter().filter(|j| j.input).map(|j| j.name.as_str());
    let known: Vec<&str> = model.sensors.iter().map(|s| s.name.as_str()).chain(inputs).collect();
    Error::Data(format!(
        "stream '{name}': model '{}' has no sensor of that name; {}. Its sensors and inputs: {}",
        model.name,
        hint(name, &known),
        known.join(", ")
    ))
}

/// A distance is not negative. Noise makes it so only if the points are within centimetres of each other.
fn refuse_negative(quantity: Quantity, stream: &Stream, values: &Column) -> Result<()> {
    let negative = values.iter().enumerate().find(|(_, x)| quantity == Quantity::Range && *x < 0.0);
    negative.map_or(Ok(()), |(i, x)| {
        Err(Error::Data(format!(
            "stream '{}': the distance is {x} m at {} s; a distance is not negative. If it is a position along a rail, use an \
             encoder on a slide; write NaN for a missing value",
            stream.name,
            stream.time_s.get(i).unwrap_or(f64::NAN)
        )))
    })
}

/// Length of a row.
fn width(quantity: Quantity) -> usize {
    match quantity {
        Quantity::Joint | Quantity::Range => 1,
        Quantity::Orientation => 4,
        _ => 3,
    }
}

fn check(clocked: &Clocked) -> Result<()> {
    let stream = &clocked.stream;
    let t = &stream.time_s;
    let times = || t.iter().map(|stamp_s| clocked.clock.true_s(stamp_s));
    if let Some((i, time_s)) = times().enumerate().find(|(_, x)| !x.is_finite()) {
        return Err(Error::Data(format!(
            "stream '{}': time_s[{i}] = {time_s}: time stamps must be finite, in seconds; drop that row",
            stream.name
        )));
    }
    let pairs = times().zip(times().skip(1)).enumerate();
    if let Some((i, (before, here))) = { pairs }.find(|(_, (before, here))| here <= before) {
        return Err(Error::Data(format!(
            "stream '{}': time_s[{}] = {here} s does not come after time_s[{i}] = {before} s; time stamps must increase: \
             sort the rows, drop repeated ones, or give each clock its own stream",
            stream.name,
            i + 1
        )));
    }
    for c in &stream.channels {
        let width = width(c.quantity);
        if c.values.len() != width * t.len() {
            return Err(Error::Data(format!(
                "stream '{}': {} time stamps but {} values of {:?}, expected {}",
                stream.name,
                t.len(),
                c.values.len(),
                c.quantity,
                width * t.len()
            )));
        }
        if let Some(i) = c.values.iter().position(|x| x.is_infinite()) {
            return Err(Error::Data(format!(
                "stream '{}': {:?} is infinite at {} s; write NaN for a missing value",
                stream.name,
                c.quantity,
                t.get(i / width).unwrap_or(f64::NAN)
            )));
        }
    }
    Ok(())
}
