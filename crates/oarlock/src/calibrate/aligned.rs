//! The mount that agrees best with directions known in both sensor and link axes, closest to the nominal mount.

use super::matrix::{mat3, matrix, rows};
use crate::rotation::Mat3;
use nalgebra::{Matrix3, Matrix4, Quaternion, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};
use serde::Serialize;

/// One direction in both axes, unit vectors, and its uncertainty, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// In sensor axes.
    pub in_sensor: [f64; 3],
    /// In link axes.
    pub in_link: [f64; 3],
    /// Standard deviation of the angle between the two, rad.
    pub std_rad: f64,
}

/// An estimated mount.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TurnedMount {
    /// Rotation from sensor to link axes.
    #[serde(serialize_with = "rows")]
    pub link_from_sensor: Mat3<f64>,
    /// Angle between it and the nominal mount, rad.
    pub turned_rad: f64,
    /// Residual angle of each sight, rad.
    pub left_rad: Vec<f64>,
}

/// The rotation nearest to `nominal` among those that fit the sights best, weighted by their standard deviations.
///
/// With one sight the nominal mount is rotated by the smallest angle that makes it agree and keeps its nominal heading
/// about the sight. Source: G. Wahba (1965), "A least squares estimate of satellite attitude", solved by Davenport's
/// eigenvector method.
pub fn aligned_mount(nominal: &Mat3<f64>, sights: &[Sight]) -> TurnedMount {
    let nominal = matrix(nominal);
    let strongest = sights.iter().map(|s| s.std_rad.powi(-2)).fold(f64::NAN, f64::max);
    // Far below any sight's weight, far above rounding: it decides only directions that no sight determines.
    let mut profile = nominal * if strongest.is_nan() { 1.0 } else { 1e-7 * strongest };
    for sight in sights {
        let (own, link) = (Vector3::from(sight.in_sensor), Vector3::from(sight.in_link));
        profile += link * own.transpose() * sight.std_rad.powi(-2);
    }
    let turned = *best_rotation(&profile).to_rotation_matrix().matrix();
    let left = |s: &Sight| (turned * Vector3::from(s.in_sensor)).angle(&Vector3::from(s.in_link));
    TurnedMount {
        link_from_sensor: mat3(&turned),
        turned_rad: Rotation3::from_matrix_unchecked(turned * nominal.transpose()).angle(),
        left_rad: sights.iter().map(left).collect(),
    }
}

/// The rotation R that maximises the trace of R' `profile`.
fn best_rotation(profile: &Matrix3<f64>) -> UnitQuaternion<f64> {
    let p = profile;
    let across = Vector3::new(p.m32 - p.m23, p.m13 - p.m31, p.m21 - p.m12);
    let mut gain = Matrix4::zeros();
    gain[(0, 0)] = p.trace();
    gain.fixed_view_mut::<1, 3>(0, 1).copy_from(&across.transpose());
    gain.fixed_view_mut::<3, 1>(1, 0).copy_from(&across);
    gain.fixed_view_mut::<3, 3>(1, 1).copy_from(&(p + p.transpose() - Matrix3::identity() * p.trace()));
    let eigen = SymmetricEigen::new(gain);
    let best = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    UnitQuaternion::from_quaternion(Quaternion::new(best[0], best[1], best[2], best[3]))
}
