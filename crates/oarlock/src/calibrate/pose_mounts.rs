//! Inclination of units on their links, from one still stretch in a known posture.
//!
//! Gravity determines two of the three degrees of freedom of a mount. The third, the rotation about the vertical, keeps
//! its nominal value: the mount is rotated by the smallest angle that makes gravity agree.

use super::aligned::{aligned_mount, Sight};
use super::matrix::rows;
use super::rest::Rest;
use super::signals::Signals;
use super::still::{common_still, mean, still_stretches, StillLimits};
use crate::rotation::Mat3;
use crate::{Error, Result};
use nalgebra::Vector3;
use serde::Serialize;

/// A unit on a link whose posture is known.
#[derive(Debug, Clone, Copy)]
pub struct PosedUnit<'a> {
    /// Its readings.
    pub signals: Signals<'a>,
    /// Nominal mount: rotation from sensor to link axes.
    pub link_from_sensor: Mat3<f64>,
    /// Rotation from link to world (root) axes in the posture.
    pub world_from_link: Mat3<f64>,
}

/// Information from the user, and thresholds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseOptions {
    /// The still stretch (start, end), s; `None`: the longest one common to all units.
    pub still_s: Option<(f64, f64)>,
    /// Thresholds of stillness.
    pub still_limits: StillLimits,
    /// Share of a named stretch that must be still, 0 to 1: people sway and swallow.
    pub least_still_share: f64,
    /// Standard deviation of a person's posture, rad.
    pub posture_std_rad: f64,
    /// Constant error of the accelerometers, m/s2.
    pub accel_bias_std_m_s2: f64,
}

impl Default for PoseOptions {
    /// For a person who was shown the posture, with consumer MEMS sensors. A person who stands still sways: arms move
    /// back and forth by some hundredths of a rad/s. Most of it averages out; the standard deviation includes the rest.
    fn default() -> Self {
        Self {
            still_s: None,
            still_limits: StillLimits { gyro_scatter_rad_s: 0.1, accel_scatter_m_s2: 0.4, ..StillLimits::default() },
            least_still_share: 0.5,
            posture_std_rad: 3.0_f64.to_radians(),
            accel_bias_std_m_s2: 0.1,
        }
    }
}

/// A mount and its quality.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseMount {
    /// The sensor.
    pub name: String,
    /// Rotation from sensor to link axes; the nominal one about the vertical.
    #[serde(serialize_with = "rows")]
    pub link_from_sensor: Mat3<f64>,
    /// Angle between it and the nominal mount, rad.
    pub turned_rad: f64,
    /// Standard deviation of the inclination, each direction, rad: posture, sway, bias and noise.
    pub std_rad: f64,
    /// The sensor's part of it: sway, bias and noise, rad.
    pub sensor_std_rad: f64,
    /// Up in sensor axes, unit vector.
    pub up_in_sensor: [f64; 3],
    /// Gyroscope's bias in sensor axes, rad/s.
    pub gyro_bias_rad_s: [f64; 3],
    /// Scatter of the gyroscope's noisiest axis, rad/s.
    pub gyro_noise_rad_s: f64,
    /// Scatter of the accelerometer's noisiest axis, m/s2.
    pub accel_noise_m_s2: f64,
    /// Norm of the mean specific force, m/s2; its distance from gravity shows the accelerometer's bias.
    pub accel_norm_m_s2: f64,
    /// The still stretch used, s.
    pub still_s: (f64, f64),
}

/// Estimates the mounts. `up_in_world` is in the axes of `world_from_link`.
///
/// # Errors
/// [`Error::Data`] with the sensor's name and the values: malformed columns, no common still stretch, motion of a unit
/// in a named stretch, specific force at rest that is not in m/s2, an up vector of zero.
pub fn pose_mounts(units: &[PosedUnit], up_in_world: [f64; 3], options: &PoseOptions) -> Result<Vec<PoseMount>> {
    let up = Vector3::from(up_in_world).normalize();
    if !up.norm().is_normal() {
        return Err(Error::Data(format!("up {up_in_world:?} has no direction; expected a vector such as [0, 0, 1]")));
    }
    let signals: Vec<Signals> = units.iter().map(|u| u.signals).collect();
    for unit in &signals {
        unit.check()?;
    }
    let still_s = match options.still_s {
        Some(named) => {
            signals.iter().try_for_each(|unit| check_still(unit, named, options))?;
            named
        }
        None => common_still(&signals, &options.still_limits)?,
    };
    units.iter().map(|unit| unit.mount(still_s, up, options)).collect()
}

impl PosedUnit<'_> {
    fn mount(&self, still_s: (f64, f64), up: Vector3<f64>, options: &PoseOptions) -> Result<PoseMount> {
        let rest = Rest::of(&self.signals, still_s)?;
        let world = &self.world_from_link.transposed().0;
        let up_in_link = world.map(|row| Vector3::from(row).dot(&up));
        let constant = options.accel_bias_std_m_s2 / rest.accel_norm;
        let sensor_std_rad = self.wander(&rest).hypot(constant);
        let std_rad = sensor_std_rad.hypot(options.posture_std_rad);
        let sight = Sight { in_sensor: rest.up.into(), in_link: up_in_link, std_rad };
        let turned = aligned_mount(&self.link_from_sensor, &[sight]);
        Ok(PoseMount {
            name: self.signals.name.to_owned(),
            link_from_sensor: turned.link_from_sensor,
            turned_rad: turned.turned_rad,
            std_rad,
            sensor_std_rad,
            up_in_sensor: rest.up.into(),
            gyro_bias_rad_s: rest.bias.into(),
            gyro_noise_rad_s: rest.noise.0,
            accel_noise_m_s2: rest.noise.1,
            accel_norm_m_s2: rest.accel_norm,
            still_s,
        })
    }

    /// Change of up between four parts of the stretch, rad. Noise averages out; sway does not.
    fn wander(&self, rest: &Rest) -> f64 {
        const PARTS: usize = 4;
        let still = self.signals.complete_rows(rest.still_s);
        let parts: Vec<Vector3<f64>> = still
            .chunks(still.len().div_ceil(PARTS))
            .map(|part| mean(&part.iter().map(|&k| self.signals.accel_m_s2[k]).collect::<Vec<_>>()))
            .collect();
        let squares: f64 = parts.iter().map(|p| p.angle(&rest.up).powi(2)).sum();
        // Two directions of inclination.
        (squares / (2.0 * parts.len() as f64)).sqrt()
    }
}

fn check_still(unit: &Signals, named: (f64, f64), options: &PoseOptions) -> Result<()> {
    let inside = |s: &(f64, f64)| (s.1.min(named.1) - s.0.max(named.0)).max(0.0);
    let stretches = still_stretches(unit.time_s, unit.gyro_rad_s, unit.accel_m_s2, &options.still_limits);
    let share = stretches.iter().map(inside).sum::<f64>() / (named.1 - named.0);
    if share >= options.least_still_share {
        return Ok(());
    }
    Err(Error::Data(format!(
        "sensor `{}`: is still in {:.0} % of the stretch {:.2} to {:.2} s, at least {:.0} % are needed (scatter of one axis \
         at most {} rad/s and {} m/s2). Name another stretch, or leave it out to search for one",
        unit.name,
        100.0 * share.max(0.0),
        named.0,
        named.1,
        100.0 * options.least_still_share,
        options.still_limits.gyro_scatter_rad_s,
        options.still_limits.accel_scatter_m_s2
    )))
}
