//! Entry of a sample: applies the calibration's corrections to its readings, once and before all other stages.

use crate::body::Body;
use crate::corrections::{Corrections, EncoderScale, Triad};
use crate::error::{Error, Result};
use crate::model::suggest::hint;
use crate::model::SensorKind;
use crate::recording::Sample;
use crate::sensor::Quantity;
use std::ops::Range;

/// The corrections of one body, by position in the sample.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    triads: Vec<(Range<usize>, Triad)>,
    /// Rows of encoders, and coordinates of inputs.
    encoders: Vec<(usize, EncoderScale)>,
    inputs: Vec<(usize, EncoderScale)>,
}

impl Entry {
    pub fn new(body: &Body, corrections: &Corrections) -> Result<Self> {
        corrections.check()?;
        check_magnetometers(body, corrections)?;
        let parts = || body.suite.sources.iter().flat_map(|s| s.parts.iter().map(move |part| (&s.name, part)));
        let triad = |(name, part): (&String, &crate::sensor::Part)| {
            Some((part.rows.clone(), corrections.triad(name, part.quantity)?))
        };
        let encoder = |(name, part): (&String, &crate::sensor::Part)| {
            let scale = corrections.encoders.get(name).filter(|_| part.quantity == Quantity::Joint)?;
            Some((part.rows.start, *scale))
        };
        Ok(Entry {
            triads: parts().filter_map(triad).collect(),
            encoders: parts().filter_map(encoder).collect(),
            inputs: inputs(body, corrections),
        })
    }

    /// Corrects all readings of a sample.
    pub fn correct(&self, sample: &mut Sample) {
        for (rows, triad) in &self.triads {
            triad.correct(&mut sample.z[rows.clone()]);
        }
        for (row, scale) in &self.encoders {
            sample.z[*row] = scale.value(sample.z[*row]);
        }
        for (coordinate, scale) in &self.inputs {
            sample.inputs[*coordinate] = scale.value(sample.inputs[*coordinate]);
        }
    }

    /// Corrects the reading of one row, without the cross-axis terms.
    pub fn along(&self, row: usize, reading: f64) -> f64 {
        let triad = self.triads.iter().find(|(rows, _)| rows.contains(&row));
        triad.map_or(reading, |(rows, triad)| triad.along(row - rows.start, reading))
    }
}

/// An input joint takes the stream of its own name, or the stream of an encoder on it.
fn inputs(body: &Body, corrections: &Corrections) -> Vec<(usize, EncoderScale)> {
    let model = &body.model;
    let inputs = model.joints.iter().enumerate().filter(|(_, j)| j.input);
    let scale = |(i, joint): (usize, &crate::model::Joint)| {
        let reads = |s: &&crate::model::Sensor| matches!(&s.kind, SensorKind::Encoder(e) if e.joint == i);
        let encoders = model.sensors.iter().filter(reads).map(|s| &s.name);
        let scale = std::iter::once(&joint.name).chain(encoders).find_map(|name| corrections.encoders.get(name))?;
        Some((joint.first, *scale))
    };
    inputs.filter_map(scale).collect()
}

/// A unit of which the model leaves out the magnetometer is corrected in what it has.
fn check_magnetometers(body: &Body, corrections: &Corrections) -> Result<()> {
    let known: Vec<&str> = body.suite.sources.iter().map(|s| s.name.as_str()).collect();
    match corrections.mag_offsets.keys().find(|name| !known.contains(&name.as_str())) {
        Some(name) => Err(Error::Data(format!(
            "magnetometer offset '{name}': model '{}' has no sensor of that name; {}",
            body.model.name,
            hint(name, &known)
        ))),
        None => Ok(()),
    }
}
