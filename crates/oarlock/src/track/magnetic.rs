//! Magnetometers: whether a reading is the field of the world, by its norm, its dip and its innovation.
//!
//! Norm and dip are the field's alone, whatever the heading: iron nearby changes them, and what has changed them may have turned
//! the field too. The dip is the angle of the measured field below the horizon that the belief sees from the sensor. Tests of both
//! are those of VQF (Laidig and Seel 2023, section 3.5). The noise of the model file plays no part in them: it may be large to say how
//! little a field is to be trusted. What passes them is held against the belief in full. A disturbance lasts
//! while a body walks past it; so the belief is trusted longer than against other sensors, and what is rejected is no habit.

use super::Tracker;
use crate::config::Magnetometer;
use crate::estimate::belief::Belief;
use crate::estimate::filter::{DirectionTest, Info, Verdict};
use crate::rotation::Vec3;
use crate::sensor::Quantity;

/// A field whose norm is off by more than this share is disturbed.
const NORM_TOLERANCE: f64 = 0.15;
/// A field whose dip is off by more than this is disturbed, rad (10 deg): it is as far off as by the tolerance of the norm.
const DIP_TOLERANCE_RAD: f64 = 0.175;
/// ... or by so many standard deviations of the belief's horizon.
const HORIZON_SIGMAS: f64 = 5.0;
/// An innovation that is odd for longer is believed: the belief's heading is wrong, s. A gyroscope whose bias is known to 0.002 rad/s
/// keeps a heading within a degree meanwhile.
pub(super) const PATIENCE_S: f64 = 10.0;

/// What a magnetometer's reading may be, in the order of [`Field`].
pub const FIELD: [&str; 5] = ["missing", "undisturbed", "norm", "dip", "innovation"];

/// What a magnetometer's reading was: disturbed ones are named by the first test they failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// Not there.
    Missing,
    /// Used.
    Undisturbed,
    /// Stronger or weaker than the world's field.
    Norm,
    /// Steeper or flatter than the world's field.
    Dip,
    /// Far from what the belief expects.
    Innovation,
}

impl Field {
    /// `missing`, `undisturbed`, `norm`, `dip`, `innovation`.
    pub fn name(self) -> &'static str {
        FIELD[self as usize]
    }
}

impl Tracker {
    /// Of every source, what its magnetometer's reading was.
    pub fn fields<'a>(&'a self, info: &'a Info) -> impl Iterator<Item = Field> + 'a {
        self.groups.sources.iter().map(|source| {
            let parts = self.groups.parts.iter().zip(&self.quantities).zip(&info.parts);
            let mut own = parts.filter(|((rows, &q), _)| q == Quantity::Mag && source.contains(&rows.start));
            own.next().map_or(Field::Missing, |(_, verdict)| match verdict {
                Verdict::Missing | Verdict::Stuck => Field::Missing,
                Verdict::Accepted | Verdict::Clipped => Field::Undisturbed,
                Verdict::Excluded => Field::Norm,
                Verdict::WrongDirection => Field::Dip,
                Verdict::Outlier | Verdict::Turned => Field::Innovation,
            })
        })
    }

    /// Rows of magnetometers.
    pub(super) fn magnetic_rows(&self) -> impl Iterator<Item = usize> + '_ {
        let parts = self.groups.parts.iter().zip(&self.quantities);
        parts.filter(|(_, &q)| q == Quantity::Mag).flat_map(|(rows, _)| rows.clone())
    }

    /// Silences magnetometers that are not to be used, and bars those whose norm is wrong.
    pub(super) fn judge_norms(&mut self) {
        let norm = self.body.field.norm_ut;
        for (p, rows) in self.groups.parts.iter().enumerate() {
            self.excluded[p] = false;
            if self.quantities[p] != Quantity::Mag {
                continue;
            }
            let z = &mut self.z[rows.clone()];
            match self.config.magnetometer {
                Magnetometer::On => {}
                Magnetometer::Off => z.fill(f64::NAN),
                Magnetometer::Gated => {
                    let measured = z.iter().map(|x| x * x).sum::<f64>().sqrt();
                    self.excluded[p] = (measured - norm).abs() > NORM_TOLERANCE * norm;
                }
            }
        }
    }

    /// Measures the dip of every field against the horizon of the belief; the filter knows how certain that is.
    pub(super) fn measure_dips(&mut self, belief: &Belief) {
        self.direction_tests.fill(None);
        let gated = self.config.magnetometer == Magnetometer::Gated;
        if !gated || self.magnetic_rows().all(|r| self.z[r].is_nan()) {
            return;
        }
        self.body.lower_up(&belief.mean, &self.moment, &mut self.posture);
        for (p, rows) in self.groups.parts.iter().enumerate().filter(|(p, _)| self.quantities[*p] == Quantity::Mag) {
            let source = self.groups.sources.iter().position(|s| s.contains(&rows.start));
            let up = source.and_then(|s| self.body.up_seen_by(s, &self.posture));
            let measured = Vec3([self.z[rows.start], self.z[rows.start + 1], self.z[rows.start + 2]]);
            self.direction_tests[p] =
                up.and_then(|up| direction(measured, up, self.body.field.norm_ut, self.body.field.dip_rad));
        }
    }
}

/// How far a measured field (uT) lies from the world's dip (rad), all in sensor axes; `None` for no field at all.
fn direction(measured: Vec3<f64>, up: Vec3<f64>, norm_ut: f64, dip_rad: f64) -> Option<DirectionTest> {
    let dot = |a: Vec3<f64>, b: Vec3<f64>| -> f64 { a.0.iter().zip(b.0).map(|(a, b)| a * b).sum() };
    let length = dot(measured, measured).sqrt();
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let towards = measured * (1.0 / length);
    let down = -dot(towards, up);
    let level = towards + up * down;
    let level = level * (1.0 / dot(level, level).sqrt().max(f64::MIN_POSITIVE));
    // Where the field moves when it dips further.
    let along = level * -dip_rad.sin() + up * -dip_rad.cos();
    let off = norm_ut * (down.clamp(-1.0, 1.0).asin() - dip_rad);
    Some(DirectionTest { along: along.0, off, tolerance: norm_ut * DIP_TOLERANCE_RAD, sigmas: HORIZON_SIGMAS })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::Mat3;

    #[test]
    fn a_dip_is_measured_in_any_axes() {
        let turn = Mat3::about(Vec3([0.4, -1.1, 0.7]));
        let (up, dip_rad): (_, f64) = (turn.apply(Vec3([0.0, 0.0, 1.0])), 1.1);
        for off in [-0.3, 0.0, 0.2] {
            let dip: f64 = dip_rad + off;
            let field = turn.apply(Vec3([dip.cos() * 0.6, dip.cos() * 0.8, -dip.sin()])) * 50.0;
            let found = direction(field, up, 48.0, dip_rad).unwrap();
            assert!((found.off - 48.0 * off).abs() < 1e-9, "{}", found.off);
            let step = turn.apply(Vec3([-dip_rad.sin() * 0.6, -dip_rad.sin() * 0.8, -dip_rad.cos()]));
            assert!(found.along.iter().zip(step.0).all(|(a, b)| (a - b).abs() < 1e-9));
        }
        assert!(direction(Vec3([0.0; 3]), up, 48.0, dip_rad).is_none());
    }
}
