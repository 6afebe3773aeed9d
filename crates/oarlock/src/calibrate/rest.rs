//! Means and scatter of one inertial unit during a still stretch.

use super::signals::Signals;
use super::still::{mean, scatter};
use crate::{Error, Result};
use nalgebra::Vector3;

/// Means and scatter of a still stretch.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rest {
    /// The gyroscope's bias, rad/s.
    pub bias: Vector3<f64>,
    /// Up, a unit vector in sensor axes.
    pub up: Vector3<f64>,
    /// Norm of the mean specific force, m/s2.
    pub accel_norm: f64,
    /// Scatter of the noisiest axis: gyroscope, rad/s, and accelerometer, m/s2.
    pub noise: (f64, f64),
    pub still_s: (f64, f64),
}

impl Rest {
    /// # Errors
    /// [`Error::Data`] for fewer than 4 complete rows, or a specific force that is not gravity's.
    pub fn of(signals: &Signals, still_s: (f64, f64)) -> Result<Self> {
        let rows = signals.complete_rows(still_s);
        if rows.len() < 4 {
            return Err(Error::Data(format!(
                "sensor `{}`: {} complete rows in the still stretch {:.2} to {:.2} s, at least 4 are needed",
                signals.name,
                rows.len(),
                still_s.0,
                still_s.1
            )));
        }
        let gyro: Vec<[f64; 3]> = rows.iter().map(|&k| signals.gyro_rad_s[k]).collect();
        let accel: Vec<[f64; 3]> = rows.iter().map(|&k| signals.accel_m_s2[k]).collect();
        let (bias, force) = (mean(&gyro), mean(&accel));
        check_force(signals.name, force.norm())?;
        Ok(Self {
            bias,
            up: force.normalize(),
            accel_norm: force.norm(),
            noise: (scatter(&gyro), scatter(&accel)),
            still_s,
        })
    }
}

fn check_force(name: &str, norm_m_s2: f64) -> Result<()> {
    // Gravity lies between 9.76 and 9.84 m/s2 on Earth; a consumer accelerometer may be off by some percent.
    if (9.0..=10.6).contains(&norm_m_s2) {
        return Ok(());
    }
    let guess =
        if (0.9..=1.1).contains(&norm_m_s2) { " It looks as if it were in g: multiply by 9.80665." } else { "" };
    Err(Error::Data(format!(
        "sensor `{name}`: specific force at rest is {norm_m_s2:.4} m/s2, expected 9.0 to 10.6 m/s2.{guess} Check the \
         unit of the accelerometer and the still stretch"
    )))
}
