//! Mount of a sensor: its rotation and position on the link. Inertial units and orientation sensors share it.

use crate::kernels::lane::Real;
use crate::model::section::Section;
use crate::model::spec::frame::read_rotation;
use crate::model::Expr;
use crate::rotation::{Mat3, Vec3};

/// Link from sensor, and the sensor's origin in the link's frame (m).
pub type MountValue = (Mat3<f64>, [f64; 3]);

/// Mount of a sensor in a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Mount {
    /// Link from sensor.
    pub rotation: Mat3<f64>,
    /// Standard deviation about each axis, rad, where the mount is estimated.
    pub std_rad: f64,
    /// Whether nothing soft lies under it: it never turns on its link.
    pub rigid: bool,
    /// What soft tissue turns it about each axis, rad: part of the bands of angles, and not estimated.
    pub soft_std_rad: f64,
    /// Sensor's position in the link's frame, m.
    pub offset: [Expr; 3],
}

/// Default standard deviation of a mount by eye, rad.
const MOUNT_STD_RAD: f64 = 0.1;

impl Mount {
    pub(crate) fn read(section: &Section) -> Mount {
        let keys = &["rotation", "rpy", "offset", "std_rad", "rigid", "soft_std_rad"];
        let Some(mount) = section.get("mount").and_then(|slot| Section::of(slot, keys)) else {
            let offset = [0.0; 3].map(Expr::constant);
            let rotation = Mat3::identity();
            return Mount { rotation, std_rad: MOUNT_STD_RAD, rigid: false, soft_std_rad: 0.0, offset };
        };
        let rotation = read_rotation(&mount).evaluate(&[]);
        if rotation.0.iter().flatten().any(|x| x.is_nan()) {
            let key = if mount.has("rpy") { "rpy" } else { "rotation" };
            mount.mistake(mount.at_key(key), "a mount's rotation takes plain numbers only, no parameters");
        }
        let std_rad = mount.get("std_rad").and_then(|s| s.positive("rad")).unwrap_or(MOUNT_STD_RAD);
        let rigid = mount.get("rigid").and_then(|s| s.flag()).unwrap_or(false);
        let soft_std_rad = mount.get("soft_std_rad").and_then(|s| s.positive("rad")).unwrap_or(0.0);
        Mount { rotation, std_rad, rigid, soft_std_rad, offset: mount.point("offset") }
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
