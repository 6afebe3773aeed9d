//! Iron that moves with a unit (hard iron): a constant field in its axes, found from the norm of its readings, for `magnetic`.
//!
//! The norm does not depend on the posture, so that a wrong posture cannot pass for iron, nor iron for a wrong posture. A Kalman filter of
//! three states expects |m - b| to be the norm of the field. A component that the unit's rotation has not shown stays zero.

use super::lasting_variance;
use crate::rotation::turn::norm;
use crate::rotation::Vec3;

/// Standard deviation of the iron's field before any reading, and of the norm of a field indoors, as shares of the field's norm.
const PRIOR: f64 = 0.1;
const NORM: f64 = 0.05;
/// Time in which the iron may have become another one, s.
const LASTS_S: f64 = 600.0;
/// Norms beyond this share of the field's are those of a magnet in passing.
const PASSING: f64 = 0.35;
/// Chi-square of three degrees of freedom that chance exceeds once in a thousand: below it there is no iron.
const CHANCE: f64 = 16.3;

/// The iron's field; NaN where there is no value yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::track) struct IronState {
    /// Mean, uT.
    pub field_ut: [f64; 3],
    /// Covariance, uT2: xx, yy, zz, xy, xz, yz.
    pub covariance: [f64; 6],
}

impl IronState {
    pub const NONE: IronState = IronState { field_ut: [f64::NAN; 3], covariance: [f64::NAN; 6] };

    /// The field to subtract from a reading: the mean, reduced as far as it may be chance.
    pub fn known_ut(&self) -> Vec3<f64> {
        let chi_square = self.chi_square();
        if chi_square.is_nan() || chi_square <= CHANCE {
            return Vec3([0.0; 3]);
        }
        Vec3(self.field_ut) * (1.0 - CHANCE / chi_square)
    }

    /// Adds a reading, uT, `dt` seconds after the one before.
    pub fn follow(&mut self, reading: Vec3<f64>, norm_ut: f64, dt: f64) {
        let prior = (PRIOR * norm_ut).powi(2);
        if self.field_ut[0].is_nan() {
            *self = IronState { field_ut: [0.0; 3], covariance: [prior, prior, prior, 0.0, 0.0, 0.0] };
        }
        let own = reading - Vec3(self.field_ut);
        let length = norm(own.0);
        let off = length - norm_ut;
        if !(dt > 0.0 && length > 0.0 && off.abs() < PASSING * norm_ut) {
            return;
        }
        for p in &mut self.covariance[..3] {
            *p = (*p + prior * dt / LASTS_S).min(prior);
        }
        let along = own * (1.0 / length);
        let pulled = self.times(along);
        let variance = lasting_variance((NORM * norm_ut).powi(2), off * off, dt) + dot(along, pulled);
        for i in 0..3 {
            self.field_ut[i] += pulled.0[i] * off / variance;
        }
        let [x, y, z] = pulled.0;
        let taken = [x * x, y * y, z * z, x * y, x * z, y * z];
        self.covariance.iter_mut().zip(taken).for_each(|(p, t)| *p -= t / variance);
    }

    fn times(&self, v: Vec3<f64>) -> Vec3<f64> {
        let ([xx, yy, zz, xy, xz, yz], [x, y, z]) = (self.covariance, v.0);
        Vec3([xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z])
    }

    /// Mean' covariance^-1 mean, by the adjugate.
    fn chi_square(&self) -> f64 {
        let [xx, yy, zz, xy, xz, yz] = self.covariance;
        let adjugate = [
            yy * zz - yz * yz,
            xx * zz - xz * xz,
            xx * yy - xy * xy,
            xz * yz - xy * zz,
            xy * yz - xz * yy,
            xy * xz - yz * xx,
        ];
        let determinant = xx * adjugate[0] + xy * adjugate[3] + xz * adjugate[4];
        let inverse = IronState { covariance: adjugate.map(|a| a / determinant), ..*self };
        dot(Vec3(self.field_ut), inverse.times(Vec3(self.field_ut)))
    }
}

pub(super) fn dot(a: Vec3<f64>, b: Vec3<f64>) -> f64 {
    a.0.iter().zip(b.0).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::Mat3;

    const FIELD_UT: f64 = 45.0;

    /// What is found in half a minute of rotation.
    fn found(iron: Vec3<f64>, turn: impl Fn(f64) -> Vec3<f64>) -> Vec3<f64> {
        let mut state = IronState::NONE;
        for k in 0..3000 {
            let t = 0.01 * f64::from(k);
            let field = Mat3::about(turn(t)).apply(Vec3([0.4 * FIELD_UT, 0.0, -(0.84f64.sqrt()) * FIELD_UT]));
            state.follow(field + iron, FIELD_UT, 0.01);
        }
        state.known_ut()
    }

    #[test]
    fn iron_is_found_by_rotation_about_several_axes() {
        let iron = Vec3([3.0, -5.0, 2.0]);
        let found = found(iron, |t| Vec3([2.0 * (0.7 * t).sin(), 1.5 * (0.9 * t).cos(), 2.5 * (0.4 * t).sin()]));
        // In half a minute the prior and the reduction of what may be chance leave a sixth.
        let off = found - iron;
        assert!(dot(off, off) < dot(iron, iron) * 0.2f64.powi(2), "{found:?}");
    }

    #[test]
    fn a_unit_without_iron_is_not_corrected_to_the_bit() {
        assert_eq!(found(Vec3([0.0; 3]), |t| Vec3([(0.7 * t).sin(), 1.5 * (0.9 * t).cos(), 0.0])), Vec3([0.0; 3]));
    }

    #[test]
    fn iron_across_the_field_of_a_unit_at_rest_is_not_guessed() {
        let found = found(Vec3([0.0, 5.0, 0.0]), |_| Vec3([0.0; 3]));
        assert!(found.0[1].abs() < 0.5, "{found:?}");
    }
}
