//! Readings of one inertial unit, the input of all calibrations in this module.

use crate::{Error, Result};

/// Gyroscope and accelerometer of one unit, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct Signals<'a> {
    /// Name for error messages.
    pub name: &'a str,
    /// Increasing time stamps, s.
    pub time_s: &'a [f64],
    /// Angular velocity in sensor axes, rad/s; rows that are not finite are ignored.
    pub gyro_rad_s: &'a [[f64; 3]],
    /// Specific force in sensor axes, m/s2: at rest it points up.
    pub accel_m_s2: &'a [[f64; 3]],
}

impl Signals<'_> {
    /// # Errors
    /// [`Error::Data`] where the columns differ in length or time does not increase.
    pub fn check(&self) -> Result<()> {
        let (t, g, a) = (self.time_s.len(), self.gyro_rad_s.len(), self.accel_m_s2.len());
        if t != g || t != a {
            return Err(Error::Data(format!(
                "sensor `{}`: {t} time stamps, {g} rows of the gyroscope and {a} of the accelerometer; they must be equal",
                self.name
            )));
        }
        let increases = |w: &[f64]| w[1] > w[0];
        match self.time_s.windows(2).position(|w| !increases(w)) {
            Some(k) => Err(Error::Data(format!(
                "sensor `{}`: time does not increase from {} s to {} s (row {})",
                self.name,
                self.time_s[k],
                self.time_s[k + 1],
                k + 1
            ))),
            None => Ok(()),
        }
    }

    /// Whether both readings of a row are finite.
    pub(crate) fn is_complete(&self, row: usize) -> bool {
        self.gyro_rad_s[row].iter().chain(&self.accel_m_s2[row]).all(|x| x.is_finite())
    }

    /// The complete rows between two times, inclusive.
    pub(crate) fn complete_rows(&self, span_s: (f64, f64)) -> Vec<usize> {
        let inside = |&row: &usize| (span_s.0..=span_s.1).contains(&self.time_s[row]) && self.is_complete(row);
        (0..self.time_s.len()).filter(inside).collect()
    }
}
