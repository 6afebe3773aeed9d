//! Corrections of time stamps and readings by a calibration: clocks, biases, scales, soft iron, encoder zeros.
//! `track::entry` applies them.

use crate::error::{Error, Result};
use crate::rotation::{Mat3, Vec3};
use crate::sensor::Quantity;
use std::collections::BTreeMap;

/// A stream's clock: at true time t its time stamp reads `t + offset_s + drift * t`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clock {
    /// Time stamp minus true time at t = 0, s.
    pub offset_s: f64,
    /// Drift, s per s.
    pub drift: f64,
}

impl Clock {
    /// True time of a time stamp, s; identical bits if offset and drift are zero.
    pub fn true_s(&self, stamp_s: f64) -> f64 {
        (stamp_s - self.offset_s) / (1.0 + self.drift)
    }
}

/// Zero and scale of a scalar stream: `value = scale * (reading - zero)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EncoderScale {
    /// Reading at value zero, rad or m.
    pub zero: f64,
    /// Value per unit of the reading.
    pub scale: f64,
}

impl EncoderScale {
    /// Value of a reading, rad or m.
    pub fn value(&self, reading: f64) -> f64 {
        self.scale * (reading - self.zero)
    }
}

/// Corrections by name of the stream; other streams are used as they are.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Corrections {
    /// Clocks.
    pub clocks: BTreeMap<String, Clock>,
    /// Scales of scalar streams.
    pub encoders: BTreeMap<String, EncoderScale>,
    /// Gyroscope's bias, rad/s in sensor axes.
    pub gyro_biases: BTreeMap<String, [f64; 3]>,
    /// Accelerometer's bias, m/s2 in sensor axes.
    pub accel_biases: BTreeMap<String, [f64; 3]>,
    /// Scale per axis: `true = (reading - bias) / scale`.
    pub accel_scales: BTreeMap<String, [f64; 3]>,
    /// Magnetometer's offset (hard iron), uT in sensor axes.
    pub mag_offsets: BTreeMap<String, [f64; 3]>,
    /// Inverse of soft iron: `true = matrix (reading - offset)`.
    pub mag_matrices: BTreeMap<String, Mat3<f64>>,
}

/// Correction of three readings along the axes of a sensor: `true = matrix (reading - zero) / scale`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triad {
    zero: [f64; 3],
    scale: [f64; 3],
    matrix: Option<Mat3<f64>>,
}

impl Triad {
    /// True values. A matrix mixes the axes, so that all are missing if one reading is.
    pub fn correct(&self, reading: &mut [f64]) {
        for (k, x) in reading.iter_mut().enumerate() {
            *x = self.along(k, *x);
        }
        if let (Some(matrix), &[x, y, z]) = (&self.matrix, &*reading) {
            reading.copy_from_slice(&matrix.apply(Vec3([x, y, z])).0);
        }
    }

    /// The same for one axis, without the matrix.
    pub fn along(&self, axis: usize, reading: f64) -> f64 {
        (reading - self.zero[axis]) / self.scale[axis]
    }
}

impl Corrections {
    /// Correction of a quantity of an inertial unit; `None` if there is none.
    pub fn triad(&self, unit: &str, quantity: Quantity) -> Option<Triad> {
        let (zero, scale, matrix) = match quantity {
            Quantity::Gyro => (self.gyro_biases.get(unit), None, None),
            Quantity::Accel => (self.accel_biases.get(unit), self.accel_scales.get(unit), None),
            Quantity::Mag => (self.mag_offsets.get(unit), None, self.mag_matrices.get(unit)),
            _ => (None, None, None),
        };
        let is_right = zero.is_none() && scale.is_none() && matrix.is_none();
        let (zero, scale) = (zero.copied().unwrap_or_default(), scale.copied().unwrap_or([1.0; 3]));
        (!is_right).then_some(Triad { zero, scale, matrix: matrix.copied() })
    }

    /// Refuses numbers that are not finite, and scales and matrices that cannot be inverted.
    pub fn check(&self) -> Result<()> {
        let threes = [&self.gyro_biases, &self.accel_biases, &self.accel_scales, &self.mag_offsets];
        let threes = threes.into_iter().flatten().map(|(name, x)| (name, x.to_vec()));
        let matrices = self.mag_matrices.iter().map(|(name, m)| (name, m.0.as_flattened().to_vec()));
        let encoders = self.encoders.iter().map(|(name, e)| (name, vec![e.zero, e.scale]));
        let clocks = self.clocks.iter().map(|(name, c)| (name, vec![c.offset_s, c.drift]));
        for (name, numbers) in threes.chain(matrices).chain(encoders).chain(clocks) {
            if !numbers.iter().all(|x| x.is_finite()) {
                return Err(Error::Data(format!("calibration of '{name}': {numbers:?}: expected finite numbers")));
            }
        }
        let scales = self.accel_scales.iter().map(|(name, s)| (name, s.iter().all(|s| *s > 0.0)));
        let encoders = self.encoders.iter().map(|(name, e)| (name, e.scale != 0.0));
        let clocks = self.clocks.iter().map(|(name, c)| (name, c.drift > -1.0));
        match scales.chain(encoders).chain(clocks).find(|(_, fits)| !fits) {
            Some((name, _)) => {
                let expected =
                    "positive scales of accelerometers, an encoder's scale that is not zero, a drift above -1";
                Err(Error::Data(format!("calibration of '{name}': expected {expected}")))
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_corrected_as_they_were_spoilt() {
        let named = |x| BTreeMap::from([("back".to_string(), x)]);
        let corrections = Corrections {
            accel_biases: named([0.1, -0.2, 0.3]),
            accel_scales: named([1.01, 0.98, 1.0]),
            mag_offsets: named([3.0, -2.0, 1.0]),
            mag_matrices: BTreeMap::from([("back".into(), Mat3([[0.0, 2.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.5]]))]),
            ..Corrections::default()
        };
        let mut accel = [2.0 * 1.01 + 0.1, 4.0 * 0.98 - 0.2, 9.0 + 0.3];
        corrections.triad("back", Quantity::Accel).unwrap().correct(&mut accel);
        assert!(accel.iter().zip([2.0, 4.0, 9.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{accel:?}");
        let mut mag = [13.0, 18.0, -7.0];
        corrections.triad("back", Quantity::Mag).unwrap().correct(&mut mag);
        assert_eq!(mag, [40.0, 10.0, -4.0]);
        assert_eq!(corrections.triad("back", Quantity::Gyro), None);
        assert_eq!(corrections.triad("seat", Quantity::Accel), None);
    }

    #[test]
    fn a_matrix_needs_all_axes_and_a_bias_does_not() {
        let mut corrections = Corrections::default();
        corrections.mag_offsets.insert("back".into(), [1.0; 3]);
        let missing = |c: &Corrections| {
            let mut mag = [f64::NAN, 2.0, 3.0];
            c.triad("back", Quantity::Mag).unwrap().correct(&mut mag);
            mag.map(f64::is_nan)
        };
        assert_eq!(missing(&corrections), [true, false, false]);
        corrections.mag_matrices.insert("back".into(), Mat3::identity());
        assert_eq!(missing(&corrections), [true; 3]);
    }

    #[test]
    fn numbers_that_wipe_out_are_refused() {
        let scales = BTreeMap::from([("a".to_string(), [1.0, 0.0, 1.0])]);
        let encoders = BTreeMap::from([("a".to_string(), EncoderScale { zero: 0.0, scale: 0.0 })]);
        let clocks = BTreeMap::from([("a".to_string(), Clock { offset_s: 0.0, drift: -1.0 })]);
        let biases = BTreeMap::from([("a".to_string(), [f64::NAN; 3])]);
        let right = Corrections::default();
        assert!(right.check().is_ok());
        let broken = [
            Corrections { gyro_biases: biases, ..right.clone() },
            Corrections { accel_scales: scales, ..right.clone() },
            Corrections { encoders, ..right.clone() },
            Corrections { clocks, ..right },
        ];
        for corrections in broken {
            assert!(matches!(corrections.check(), Err(Error::Data(text)) if text.contains("'a'")));
        }
    }
}
