//! Magnetometer test: rejects readings of a disturbed field by norm, dip and innovation.
//!
//! Norm and dip do not depend on the heading. Iron nearby changes them, and a field with a wrong norm or dip may have a
//! wrong direction too. The dip is measured against the vertical of the state estimate. Both tests are those of VQF
//! (Laidig and Seel 2023, section 3.5). The model file's noise does not enter them, because it may be large to reduce
//! the weight of a field. A reading that passes both is tested by its innovation. A disturbance lasts while a body
//! passes it, so the innovation test has a longer patience than other sensors.
//!
//! Readings are late against the gyroscope of their unit: `lag` finds by how much, and they are rotated to the present.
//!
//! A deviation has four explanations. The field is bent here: `evidence` finds a wrong norm or a sudden change, and the
//! reading is not used. The unit carries iron: `iron` finds and subtracts it. The field differs for all units: their
//! norms deviate alike, and readings are scaled. What remains is a wrong posture, which the reading then corrects.

mod evidence;
mod iron;
mod lag;

use super::hypothesis::SourceMemory;
use super::readings::Readings;
use super::subject::Subject;
use crate::body::posture::Posture;
use crate::config::Magnetometer;
use crate::estimate::filter::{DirectionTest, Info, Verdict};
use crate::rotation::turn::norm;
use crate::rotation::Vec3;
use crate::sensor::Quantity;
pub(super) use evidence::FieldState;
use iron::dot;
pub(super) use iron::IronState;
pub(super) use lag::LagState;

/// Largest relative deviation of the norm.
const NORM_TOLERANCE: f64 = 0.15;
/// Largest deviation of the dip, rad (10 deg). It corresponds to the tolerance of the norm.
const DIP_TOLERANCE_RAD: f64 = 0.175;
/// The same in standard deviations of the estimated vertical; the larger one counts.
const HORIZON_SIGMAS: f64 = 5.0;
/// Time after which rejected innovations are accepted, s: the estimated heading is then wrong. A gyroscope whose bias
/// is known to 0.002 rad/s keeps a heading within a degree for this time.
pub(super) const PATIENCE_S: f64 = 10.0;

/// Norms of several units deviate alike if they differ by less than this share. Up to `USUAL_SHARE` the deviation is
/// that of the units.
const ALIKE_SHARE: f64 = 0.1;
const USUAL_SHARE: f64 = 0.05;

/// Errors of the field last for this long, s.
const ALIKE_S: f64 = 0.2;

/// Names of [`Field`] in its order.
pub const FIELD: [&str; 5] = ["missing", "undisturbed", "norm", "dip", "innovation"];

/// How a magnetometer's reading was judged. A disturbed one has the name of the first test that failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Field {
    /// No reading.
    Missing,
    /// Used.
    Undisturbed,
    /// Norm outside the tolerance.
    Norm,
    /// Dip outside the tolerance.
    Dip,
    /// Innovation outside the gate.
    Innovation,
}

impl Field {
    /// `missing`, `undisturbed`, `norm`, `dip`, `innovation`.
    pub fn name(self) -> &'static str {
        FIELD[self as usize]
    }
}

/// Per source: how its magnetometer's reading was judged.
pub(super) fn by_source<'a>(subject: &'a Subject, info: &'a Info) -> impl Iterator<Item = Field> + 'a {
    (0..subject.groups.sources.len()).map(|s| {
        let mut own = subject.parts_of(Quantity::Mag).filter(|&p| subject.source_of_part[p] == s);
        own.next().map_or(Field::Missing, |p| match info.parts[p] {
            Verdict::Missing | Verdict::Stuck => Field::Missing,
            Verdict::Accepted | Verdict::Clipped => Field::Undisturbed,
            Verdict::Excluded => Field::Norm,
            Verdict::WrongDirection => Field::Dip,
            Verdict::Outlier => Field::Innovation,
        })
    })
}

/// Tests magnetometers before an update.
#[derive(Debug, Clone)]
pub(super) struct Magnetic {
    usage: Magnetometer,
    /// Per part: excluded in this sample.
    pub excluded: Vec<bool>,
    /// Per part: deviation of its dip from the world's.
    pub direction_tests: Vec<Option<DirectionTest>>,
    /// Workspace for the mean.
    posture: Posture<f64>,
}

impl Magnetic {
    pub fn new(subject: &Subject, usage: Magnetometer) -> Self {
        let parts = subject.groups.parts.len();
        let posture = Posture::new(&subject.body);
        Magnetic { usage, excluded: vec![false; parts], direction_tests: vec![None; parts], posture }
    }

    /// Removes readings of magnetometers that are not used, and excludes those with a wrong norm.
    pub fn judge_norms(&mut self, subject: &Subject, readings: &mut Readings) {
        let norm = subject.body.field.norm_ut;
        self.excluded.fill(false);
        for p in subject.parts_of(Quantity::Mag) {
            let z = &mut readings.z[subject.groups.parts[p].clone()];
            match self.usage {
                Magnetometer::On => {}
                Magnetometer::Off => z.fill(f64::NAN),
                Magnetometer::Gated => {
                    let measured = z.iter().map(|x| x * x).sum::<f64>().sqrt();
                    self.excluded[p] = (measured - norm).abs() > NORM_TOLERANCE * norm;
                }
            }
        }
    }

    /// Corrects readings by the iron of their unit and by the common deviation of all norms, and tests the norms again,
    /// with the memory of each unit.
    pub fn follow_norms(
        &mut self,
        subject: &Subject,
        sources: &mut [SourceMemory],
        readings: &mut Readings,
        time_s: f64,
    ) {
        if self.usage != Magnetometer::Gated {
            return;
        }
        let norm_ut = subject.body.field.norm_ut;
        let scale = 1.0 / (1.0 + common_deviation(subject, sources));
        for p in subject.parts_of(Quantity::Gyro) {
            let (source, rate) = (subject.source_of_part[p], Vec3(readings.three(subject.groups.parts[p].start)));
            if rate.0.iter().all(|x| !x.is_nan()) {
                sources[source].lag.turn(rate, time_s + readings.offset_s[source]);
            }
        }
        for p in subject.parts_of(Quantity::Mag) {
            let rows = subject.groups.parts[p].clone();
            let (source, reading) = (subject.source_of_part[p], Vec3(readings.three(rows.start)));
            let SourceMemory { field, iron, lag, .. } = &mut sources[source];
            if reading.0.iter().any(|x| x.is_nan()) {
                continue;
            }
            // What is known of the iron is in the scale of the common field.
            let own = reading - iron.known_ut() * (1.0 / scale);
            let off = |by: f64| norm(own.0) * by / norm_ut - 1.0;
            let came_s = time_s + readings.offset_s[source];
            lag.follow(own * scale, norm_ut, came_s);
            self.excluded[p] = field.follow_norm([off(scale), off(1.0)], came_s, NORM_TOLERANCE);
            iron.follow(reading * scale, norm_ut, field.interval_s);
            readings.z[rows].copy_from_slice(&lag.undo(own * scale, came_s).0);
        }
    }

    /// Adds what iron nearby does to a field to the noise of its readings.
    pub fn raise(&self, subject: &Subject, sources: &[SourceMemory], readings: &mut Readings) {
        if self.usage != Magnetometer::Gated {
            return;
        }
        for p in subject.parts_of(Quantity::Mag) {
            let bent_ut = subject.body.field.norm_ut * sources[subject.source_of_part[p]].field.bent_share();
            if bent_ut > 0.0 {
                readings.std[subject.groups.parts[p].clone()].iter_mut().for_each(|std| *std = std.hypot(bent_ut));
            }
        }
    }

    /// Measures the dip of every field against the vertical of a mean. The filter supplies the uncertainty of the
    /// vertical.
    pub fn measure_dips(&mut self, subject: &Subject, sources: &mut [SourceMemory], readings: &Readings, mean: &[f64]) {
        self.direction_tests.fill(None);
        let gated = self.usage == Magnetometer::Gated;
        if !gated || subject.magnetic_rows().all(|r| readings.z[r].is_nan()) {
            return;
        }
        let body = &subject.body;
        body.lower_up(mean, &readings.moment, &mut self.posture);
        for p in subject.parts_of(Quantity::Mag) {
            let source = subject.source_of_part[p];
            let up = self.up_seen_by(subject, source);
            let measured = Vec3(readings.three(subject.groups.parts[p].start));
            self.direction_tests[p] = up.and_then(|up| direction(measured, up, body.field.norm_ut, body.field.dip_rad));
            if let Some(test) = &mut self.direction_tests[p] {
                let norm_ut = body.field.norm_ut;
                test.off = norm_ut * sources[source].field.follow_dip(test.off / norm_ut, DIP_TOLERANCE_RAD);
            }
        }
    }

    /// The vertical in the axes of a source, in the posture of the last dip measurement.
    pub fn up_seen_by(&self, subject: &Subject, source: usize) -> Option<Vec3<f64>> {
        subject.body.up_seen_by(source, &self.posture)
    }
}

/// Relative deviation that the norms of all units have in common; zero if there are fewer than two or they differ.
fn common_deviation(subject: &Subject, sources: &[SourceMemory]) -> f64 {
    let (mut low, mut high, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0);
    let units = subject.parts_of(Quantity::Mag).map(|p| subject.source_of_part[p]);
    for norm in units.filter_map(|s| sources[s].field.known_norm()) {
        (low, high, sum, count) = (norm.min(low), norm.max(high), sum + norm, count + 1);
    }
    if count < 2 || high - low > ALIKE_SHARE {
        return 0.0;
    }
    let mean = sum / f64::from(count);
    mean.signum() * (mean.abs() - USUAL_SHARE).max(0.0)
}

/// Number of readings, one every `dt` seconds, that have the information of one.
fn alike(dt: f64) -> f64 {
    (ALIKE_S / dt).max(1.0)
}

/// Variance of the field's error in one of many readings, for its residual squared: readings far off have less weight
/// (Student's distribution of three degrees of freedom).
fn lasting_variance(variance: f64, square: f64, dt: f64) -> f64 {
    variance * (1.0 + square / (3.0 * variance)) * alike(dt)
}

/// Parts whose innovations are tested without slack: magnetometers if `gated` is configured.
pub(super) fn strict(subject: &Subject, usage: Magnetometer) -> Vec<bool> {
    subject.quantities.iter().map(|&q| usage == Magnetometer::Gated && q == Quantity::Mag).collect()
}

/// Deviation of a measured field (uT) from the world's dip (rad), all in sensor axes; `None` for a zero field.
fn direction(measured: Vec3<f64>, up: Vec3<f64>, norm_ut: f64, dip_rad: f64) -> Option<DirectionTest> {
    let length = norm(measured.0);
    if !(length > 0.0 && length.is_finite()) {
        return None;
    }
    let towards = measured * (1.0 / length);
    let down = -dot(towards, up);
    let level = towards + up * down;
    let level = level * (1.0 / norm(level.0).max(f64::MIN_POSITIVE));
    // Direction in which the field moves if its dip increases.
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
