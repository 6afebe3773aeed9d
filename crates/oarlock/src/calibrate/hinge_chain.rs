//! Mounts of the sensors of a hinge chain, from a still stretch and a swing.
//!
//! While the chain stands still in a known posture, gravity determines two of the three degrees of freedom of a mount.
//! The axis about which the sensor rotates in the swing is the link's hinge axis, which determines two more; one of
//! them is thus determined twice. There the two are weighted by their uncertainties, and their difference is reported
//! as `disagreement_rad`.
//!
//! During its swing a sensor must rotate about one axis that is fixed in the world. Parallel hinges may swing at the
//! same time. Of hinges that are not parallel only one may move at a time, and each sensor names its own `swing_s`.

use super::chain_sensor::{ChainOptions, ChainSensor};
use super::matrix::{mat3, matrix, rows};
use super::still::common_still;
use super::swing_sense::choose_signs;
use super::turning::Turning;
use crate::rotation::Mat3;
use crate::{Error, Result};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// A mount and its quality.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundMount {
    /// The sensor.
    pub name: String,
    /// Rotation from sensor to link axes.
    #[serde(serialize_with = "rows")]
    pub link_from_sensor: Mat3<f64>,
    /// Standard deviation of a rotation about the hinge axis, rad: the joint angle's zero.
    pub std_about_hinge_rad: f64,
    /// Standard deviation of a rotation about the direction that is normal to the hinge axis and nearest to up, rad.
    pub std_about_up_rad: f64,
    /// Standard deviation of a rotation about the third direction, in which gravity and hinge axis are combined, rad.
    pub std_about_third_rad: f64,
    /// Excess of the sensor's angle between up and hinge axis over the model's, rad.
    pub disagreement_rad: f64,
    /// The part of the disagreement assigned to the hinge axis, rad; the rest is assigned to gravity.
    pub axis_moved_rad: f64,
    /// Hinge axis in sensor axes, measured by the gyroscope, unit vector.
    pub axis_in_sensor: [f64; 3],
    /// Up in sensor axes, measured by the accelerometer, unit vector.
    pub up_in_sensor: [f64; 3],
    /// Share of the squared angular velocity off the axis, 0 to 1.
    pub off_axis_share: f64,
    /// Correlation of the rotation about the stated axis with that of the previous sensor; `None`: nothing to compare.
    pub neighbour_correlation: Option<f64>,
    /// Least and largest angle about the hinge during the swing, rad, from the gyroscope.
    pub swing_range_rad: (f64, f64),
    /// Gyroscope's bias in sensor axes, rad/s.
    pub gyro_bias_rad_s: [f64; 3],
    /// Scatter of the gyroscope's noisiest axis at rest, rad/s.
    pub gyro_noise_rad_s: f64,
    /// Scatter of the accelerometer's noisiest axis at rest, m/s2.
    pub accel_noise_m_s2: f64,
    /// Norm of the mean specific force at rest, m/s2; its distance from gravity shows the accelerometer's bias.
    pub accel_norm_m_s2: f64,
    /// The still stretch used, s.
    pub still_s: (f64, f64),
}

/// Estimates the mounts of a chain's sensors. `up_in_world` is in the axes of `world_from_link`.
///
/// Gyroscope and accelerometer cannot determine the sign of a level hinge's axis: a rotation about an axis is the
/// negative rotation about the reverse axis. `first_turn_positive` decides the first sensor's sign. Each further sign
/// is chosen so that the rotation correlates with the neighbour's, as in a chain that swings as a whole. A hinge that
/// is not parallel to the previous one is treated as a first one. If the hinge slants by more than
/// `most_disagreement_rad`, gravity determines the sign.
///
/// # Errors
/// [`Error::Data`] with the sensor's name and the values: columns of different length, no common still stretch,
/// specific force at rest that is not in m/s2, no swing, a swing about more than one axis, neighbours whose rotations
/// are not correlated, a vertical hinge, a posture that contradicts gravity and hinge axis.
pub fn mounts(sensors: &[ChainSensor], up_in_world: [f64; 3], options: &ChainOptions) -> Result<Vec<FoundMount>> {
    let up = Vector3::from(up_in_world).normalize();
    if !up.norm().is_normal() {
        return Err(Error::Data(format!("up {up_in_world:?} has no direction; expected a vector such as [0, 0, 1]")));
    }
    for sensor in sensors {
        sensor.check()?;
    }
    let still_s = match options.still_s {
        Some(named) => named,
        None => common_still(&sensors.iter().map(ChainSensor::signals).collect::<Vec<_>>(), &options.still_limits)?,
    };
    let mut turns = Vec::with_capacity(sensors.len());
    for sensor in sensors {
        turns.push(Turning::of(sensor, still_s, options)?);
    }
    let correlations = choose_signs(sensors, &mut turns, up, options)?;
    let found = sensors.iter().zip(&turns).zip(correlations);
    found.map(|((sensor, turning), correlation)| turning.mount(sensor, up, correlation, options)).collect()
}

impl Turning {
    fn mount(
        &self,
        sensor: &ChainSensor,
        up_in_world: Vector3<f64>,
        neighbour_correlation: Option<f64>,
        options: &ChainOptions,
    ) -> Result<FoundMount> {
        let axis_in_world = Vector3::from(sensor.hinge_axis_in_world).normalize();
        let (stated, seen) = (axis_in_world.angle(&up_in_world), self.spin.axis.angle(&self.rest.up));
        check_posture(sensor.name, stated, seen, options)?;
        let axis_std = self.spin.std_rad.hypot(options.misalignment_std_rad);
        let up_std = options.posture_std_rad.hypot(options.accel_bias_std_m_s2 / self.rest.accel_norm);
        let disagreement = seen - stated;
        let axis_moved = disagreement * axis_std.powi(2) / (axis_std.powi(2) + up_std.powi(2));
        let world = triad(axis_in_world, up_in_world, 0.0);
        let own = triad(self.spin.axis, self.rest.up, axis_moved);
        let link_from_world = matrix(&sensor.world_from_link).transpose();
        Ok(FoundMount {
            name: sensor.name.to_owned(),
            link_from_sensor: mat3(&(link_from_world * world * own.transpose())),
            std_about_hinge_rad: up_std / stated.sin(),
            std_about_up_rad: axis_std,
            std_about_third_rad: (axis_std.powi(-2) + up_std.powi(-2)).powf(-0.5),
            disagreement_rad: disagreement,
            axis_moved_rad: axis_moved,
            axis_in_sensor: self.spin.axis.into(),
            up_in_sensor: self.rest.up.into(),
            off_axis_share: self.spin.off_axis_share,
            neighbour_correlation,
            swing_range_rad: self.range(),
            gyro_bias_rad_s: self.rest.bias.into(),
            gyro_noise_rad_s: self.rest.noise.0,
            accel_noise_m_s2: self.rest.noise.1,
            accel_norm_m_s2: self.rest.accel_norm,
            still_s: self.rest.still_s,
        })
    }
}

/// Columns: the axis rotated by `moved` towards up, the direction normal to it nearest to up, their normal.
fn triad(axis: Vector3<f64>, up: Vector3<f64>, moved: f64) -> Matrix3<f64> {
    let normal = axis.cross(&up).normalize();
    let axis = axis * moved.cos() + normal.cross(&axis) * moved.sin();
    Matrix3::from_columns(&[axis, normal.cross(&axis), normal])
}

fn check_posture(name: &str, stated: f64, seen: f64, options: &ChainOptions) -> Result<()> {
    let (stated_deg, seen_deg) = (stated.to_degrees(), seen.to_degrees());
    // The hinge axis does not determine a rotation about itself. Gravity along that axis does not either.
    if stated.sin().min(seen.sin()) < 15.0_f64.to_radians().sin() {
        return Err(Error::Data(format!(
            "sensor `{name}`: the hinge is {stated_deg:.1} deg from vertical by the model and {seen_deg:.1} deg by the \
             sensor; gravity determines a mount only if the hinge is at least 15 deg from vertical; choose another posture"
        )));
    }
    if (seen - stated).abs() > options.most_disagreement_rad {
        return Err(Error::Data(format!(
            "sensor `{name}`: up and hinge axis enclose {seen_deg:.1} deg by the sensor and {stated_deg:.1} deg by the \
             model, at most {:.1} deg apart are allowed. Check the posture of the still stretch and the hinge's axis",
            options.most_disagreement_rad.to_degrees()
        )));
    }
    Ok(())
}
