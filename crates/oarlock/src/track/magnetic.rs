//! Magnetometers: whether a reading is the field of the world, by its norm, its dip and its innovation.
//!
//! Norm and dip are the field's alone, whatever the heading: iron nearby changes them, and what has changed them may have turned
//! the field too. The dip is the angle of the measured field below the horizon that the belief sees from the sensor. Tests of both
//! are those of VQF (Laidig and Seel 2023, section 3.5). The noise of the model file plays no part in them: it may be large to say how
//! little a field is to be trusted. What passes them is held against the belief in full. A disturbance lasts
//! while a body walks past it; so the belief is trusted longer than against other sensors, and what is rejected is no habit.

use super::readings::Readings;
use super::subject::Subject;
use crate::body::posture::Posture;
use crate::config::Magnetometer;
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

/// Of every source, what its magnetometer's reading was.
pub(super) fn by_source<'a>(subject: &'a Subject, info: &'a Info) -> impl Iterator<Item = Field> + 'a {
    (0..subject.groups.sources.len()).map(|s| {
        let mut own = subject.parts_of(Quantity::Mag).filter(|&p| subject.source_of_part[p] == s);
        own.next().map_or(Field::Missing, |p| match info.parts[p] {
            Verdict::Missing | Verdict::Stuck => Field::Missing,
            Verdict::Accepted | Verdict::Clipped => Field::Undisturbed,
            Verdict::Excluded => Field::Norm,
            Verdict::WrongDirection => Field::Dip,
            Verdict::Outlier | Verdict::Turned => Field::Innovation,
        })
    })
}

/// Tests magnetometers before an update.
#[derive(Debug, Clone)]
pub(super) struct Magnetic {
    usage: Magnetometer,
    /// Per part: not to be believed in this sample.
    pub excluded: Vec<bool>,
    /// Per part: how far its field is off the world's dip.
    pub direction_tests: Vec<Option<DirectionTest>>,
    /// Room for the belief's mean.
    posture: Posture<f64>,
}

impl Magnetic {
    pub fn new(subject: &Subject, usage: Magnetometer) -> Self {
        let parts = subject.groups.parts.len();
        let posture = Posture::new(&subject.body);
        Magnetic { usage, excluded: vec![false; parts], direction_tests: vec![None; parts], posture }
    }

    /// Silences magnetometers that are not to be used, and bars those whose norm is wrong.
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

    /// Measures the dip of every field against the horizon of a mean; the filter knows how certain that is.
    pub fn measure_dips(&mut self, subject: &Subject, readings: &Readings, mean: &[f64]) {
        self.direction_tests.fill(None);
        let gated = self.usage == Magnetometer::Gated;
        if !gated || subject.magnetic_rows().all(|r| readings.z[r].is_nan()) {
            return;
        }
        let body = &subject.body;
        body.lower_up(mean, &readings.moment, &mut self.posture);
        for p in subject.parts_of(Quantity::Mag) {
            let up = self.up_seen_by(subject, subject.source_of_part[p]);
            let measured = Vec3(readings.three(subject.groups.parts[p].start));
            self.direction_tests[p] = up.and_then(|up| direction(measured, up, body.field.norm_ut, body.field.dip_rad));
        }
    }

    /// The vertical in the axes of a source, in the posture in which dips were last measured.
    pub fn up_seen_by(&self, subject: &Subject, source: usize) -> Option<Vec3<f64>> {
        subject.body.up_seen_by(source, &self.posture)
    }
}

/// Parts that are no judge of motion: magnetometers, unless they are to be used whatever they read.
pub(super) fn strict(subject: &Subject, usage: Magnetometer) -> Vec<bool> {
    subject.quantities.iter().map(|&q| usage == Magnetometer::Gated && q == Quantity::Mag).collect()
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
