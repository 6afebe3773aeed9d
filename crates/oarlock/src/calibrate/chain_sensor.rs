//! Readings of one sensor of a hinge chain, what the user says about the chain, and thresholds, for `hinge_chain` and its stages.

use super::signals::Signals;
use super::still::StillLimits;
use crate::rotation::Mat3;
use crate::{Error, Result};
use nalgebra::Vector3;

/// One sensor of the chain with its readings. A chain is listed from its base to its tip, one sensor per link.
#[derive(Debug, Clone, Copy)]
pub struct ChainSensor<'a> {
    /// Name for error messages.
    pub name: &'a str,
    /// Rotation from link to world (root) axes, in the posture of the still stretch.
    pub world_from_link: Mat3<f64>,
    /// Axis of the hinge that moves the link, in world axes, in the same posture; need not be a unit vector.
    pub hinge_axis_in_world: [f64; 3],
    /// Increasing time stamps, s.
    pub time_s: &'a [f64],
    /// Angular velocity in sensor axes, rad/s; rows that are not finite are ignored.
    pub gyro_rad_s: &'a [[f64; 3]],
    /// Specific force in sensor axes, m/s2: at rest it points up.
    pub accel_m_s2: &'a [[f64; 3]],
    /// When this sensor swings about its hinge alone, (start, end) in s; `None`: whenever the chain is not still.
    pub swing_s: Option<(f64, f64)>,
}

impl<'a> ChainSensor<'a> {
    /// Its readings.
    pub(crate) fn signals(&self) -> Signals<'a> {
        Signals { name: self.name, time_s: self.time_s, gyro_rad_s: self.gyro_rad_s, accel_m_s2: self.accel_m_s2 }
    }

    /// # Errors
    /// [`Error::Data`] for a hinge axis without direction or malformed columns.
    pub(crate) fn check(&self) -> Result<()> {
        let axis = Vector3::from(self.hinge_axis_in_world).norm();
        if !axis.is_normal() {
            return Err(Error::Data(format!(
                "sensor `{}`: the hinge axis {:?} has no direction; expected a vector such as [0, 0, 1]",
                self.name, self.hinge_axis_in_world
            )));
        }
        self.signals().check()
    }

    /// Whether a time belongs to its swing.
    pub(crate) fn swings_at(&self, time_s: f64, still_s: (f64, f64)) -> bool {
        match self.swing_s {
            Some((start, end)) => (start..=end).contains(&time_s),
            None => !(still_s.0..=still_s.1).contains(&time_s),
        }
    }

    /// 1 or -1 for two hinges parallel within 5 deg, in the same or the opposite sense.
    pub(crate) fn common_direction(&self, other: &ChainSensor) -> Option<f64> {
        let (a, b) = (Vector3::from(self.hinge_axis_in_world), Vector3::from(other.hinge_axis_in_world));
        let cosine = a.normalize().dot(&b.normalize());
        (cosine.abs() > 5.0_f64.to_radians().cos()).then(|| cosine.signum())
    }
}

/// Information from the user, and thresholds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChainOptions {
    /// The still stretch (start, end) in s; `None`: the longest one common to all sensors.
    pub still_s: Option<(f64, f64)>,
    /// Thresholds of stillness.
    pub still_limits: StillLimits,
    /// Whether the first clear rotation of the first link (half of `least_turn_rad`) is positive.
    pub first_turn_positive: bool,
    /// Standard deviation of the still posture and of the stated hinge axes, rad.
    pub posture_std_rad: f64,
    /// Constant error of the accelerometers, m/s2.
    pub accel_bias_std_m_s2: f64,
    /// Misalignment between the gyroscope's axes and the accelerometer's, rad.
    pub misalignment_std_rad: f64,
    /// Largest share of the squared angular velocity off the hinge axis, 0 to 1.
    pub most_off_axis_share: f64,
    /// Largest angle by which gravity and hinge axis may disagree, rad.
    pub most_disagreement_rad: f64,
    /// Least rotation about the hinge, rad.
    pub least_turn_rad: f64,
}

impl Default for ChainOptions {
    /// For consumer MEMS sensors on links whose hinges were levelled by eye.
    fn default() -> Self {
        Self {
            still_s: None,
            still_limits: StillLimits::default(),
            first_turn_positive: true,
            posture_std_rad: 1.0_f64.to_radians(),
            accel_bias_std_m_s2: 0.05,
            misalignment_std_rad: 0.3_f64.to_radians(),
            most_off_axis_share: 0.05,
            most_disagreement_rad: 10.0_f64.to_radians(),
            least_turn_rad: 0.2,
        }
    }
}
