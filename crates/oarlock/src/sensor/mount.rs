//! Mount of a sensor: its rotation and position on the link. Inertial units and orientation sensors share it.

use crate::kernels::lane::Real;
use crate::model::section::Section;
use crate::model::spec::frame::read_rotation;
use crate::model::Expr;
use crate::rotation::{Mat3, Vec3};

/// Link from sensor, and the sensor's origin in the link's frame (m).
pub type MountValue = (Mat3<f64>, [f64; 3]);

/// Slow rotation of a sensor against its link, as on soft tissue or foam, about each axis: m'' = -2 p m' - p^2 m + white noise.
/// Readings of the gyroscope contain m', so a random walk of m alone, whose rate is infinite, would not do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SoftMount {
    /// Standard deviation, rad.
    pub std_rad: f64,
    /// Integral of the autocorrelation from zero on, s: 2 / p.
    pub time_s: f64,
}

impl SoftMount {
    /// The pole p, 1/s.
    pub fn pole(&self) -> f64 {
        2.0 / self.time_s
    }

    /// Standard deviation of the rate, rad/s.
    pub fn rate_std(&self) -> f64 {
        self.pole() * self.std_rad
    }

    fn read(mount: &Section) -> Option<SoftMount> {
        let number = |key, unit| mount.get(key).and_then(|slot| slot.positive(unit));
        match (number(SOFT_STD, "rad"), number(SOFT_TIME, "s")) {
            (Some(std_rad), time_s) => Some(SoftMount { std_rad, time_s: time_s.unwrap_or(SOFT_TIME_S) }),
            (None, Some(_)) if !mount.has(SOFT_STD) => {
                mount.mistake(
                    mount.at_key(SOFT_TIME),
                    format!("`{SOFT_TIME}` without `{SOFT_STD}`: add it or remove this key"),
                );
                None
            }
            _ => None,
        }
    }
}

const SOFT_STD: &str = "turning_std_rad";
const SOFT_TIME: &str = "turning_time_s";
/// Default correlation time, s: a strap creeps over minutes. A faster rotation than that of limbs is removed by a low-pass.
const SOFT_TIME_S: f64 = 60.0;

/// Mount of a sensor in a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Mount {
    /// Link from sensor.
    pub rotation: Mat3<f64>,
    /// Standard deviation about each axis, rad, where the mount is estimated.
    pub std_rad: f64,
    /// How the sensor turns on the link, if it does; its rotation is then a state.
    pub soft: Option<SoftMount>,
    /// Sensor's position in the link's frame, m.
    pub offset: [Expr; 3],
}

/// Default standard deviation of a mount by eye, rad.
const MOUNT_STD_RAD: f64 = 0.1;

impl Mount {
    pub(crate) fn read(section: &Section) -> Mount {
        let keys = &["rotation", "rpy", "offset", "std_rad", SOFT_STD, SOFT_TIME];
        let Some(mount) = section.get("mount").and_then(|slot| Section::of(slot, keys)) else {
            let offset = [0.0; 3].map(Expr::constant);
            return Mount { rotation: Mat3::identity(), std_rad: MOUNT_STD_RAD, soft: None, offset };
        };
        let rotation = read_rotation(&mount).evaluate(&[]);
        if rotation.0.iter().flatten().any(|x| x.is_nan()) {
            let key = if mount.has("rpy") { "rpy" } else { "rotation" };
            mount.mistake(mount.at_key(key), "a mount's rotation takes plain numbers only, no parameters");
        }
        let std_rad = mount.get("std_rad").and_then(|s| s.positive("rad")).unwrap_or(MOUNT_STD_RAD);
        Mount { rotation, std_rad, soft: SoftMount::read(&mount), offset: mount.point("offset") }
    }
}

/// Rotation of a sensor on its link: the nominal one times the rotation of its estimated error, if it has one.
#[inline(always)]
pub(super) fn turned<T: Real>(nominal: Mat3<T>, number: Option<usize>, mounts: &[Vec3<T>]) -> Mat3<T> {
    match number.and_then(|i| mounts.get(i)) {
        Some(turn) => nominal.then(&Mat3::about(*turn)),
        None => nominal,
    }
}
