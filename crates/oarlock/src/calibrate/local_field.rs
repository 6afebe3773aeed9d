//! Strength and dip of the magnetic field where a recording was made.
//!
//! The norm needs no direction, and the dip only the angle between the magnetometer and up while the unit is still or slow,
//! so neither mounts nor postures play a part. A magnetometer's own constant error raises the norm in one direction and
//! lowers it in the opposite one: every direction that a unit took counts alike once it was held for a while. Medians pass
//! over a unit that came near iron for a moment; what departs from them is counted.

use super::robust_fit::median;
use super::signals::Signals;
use super::still::mean;
use crate::{Error, Result};
use nalgebra::Vector3;
use serde::Serialize;
use std::collections::BTreeMap;

/// Tuning of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldOptions {
    /// Over which readings are averaged, s.
    pub window_s: f64,
    /// A calm window turns at most this fast, rad/s.
    pub calm_rad_s: f64,
    /// In a calm window the mean specific force departs from the unit's usual one by at most this, m/s2.
    pub calm_m_s2: f64,
    /// A direction that is held for longer than this, s, counts no more for it. A shorter one counts less: where a swing
    /// turns round, up is told wrongly for a moment.
    pub direction_s: f64,
    /// Least time that all units together are calm, s.
    pub least_calm_s: f64,
    /// A window departs from the field if its norm does by more than this share,
    pub norm_tolerance: f64,
    /// or its dip by more than this, rad.
    pub dip_tolerance_rad: f64,
}

impl Default for FieldOptions {
    /// For rooms with some steel in them.
    fn default() -> Self {
        Self {
            window_s: 0.25,
            calm_rad_s: 0.7,
            calm_m_s2: 0.2,
            direction_s: 5.0,
            least_calm_s: 1.0,
            norm_tolerance: 0.1,
            dip_tolerance_rad: 10.0_f64.to_radians(),
        }
    }
}

/// A unit with its magnetometer, uT in sensor axes, at the unit's time stamps; rows that are not finite are passed over.
pub type MagneticUnit<'a> = (Signals<'a>, &'a [[f64; 3]]);

/// The field that most directions of all units agree about.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LocalField {
    /// Strength, uT.
    pub norm_ut: f64,
    /// Robust standard deviation between directions, uT: place, iron and the sensors' own errors.
    pub norm_std_ut: f64,
    /// Angle below the horizon, rad.
    pub dip_rad: f64,
    /// Robust standard deviation between directions, rad.
    pub dip_std_rad: f64,
    /// In how many directions units were calm. The standard deviations of one or two mean nothing.
    pub directions: usize,
    /// Share of the windows that depart from the field, 0 to 1.
    pub departing_share: f64,
    /// Each unit's own figures, in the order given.
    pub units: Vec<UnitField>,
}

/// What one unit saw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnitField {
    /// The sensor.
    pub name: String,
    /// Median strength, uT; NaN for a unit without readings.
    pub norm_ut: f64,
    /// Median dip, rad; NaN for a unit that is never calm.
    pub dip_rad: f64,
    /// In how many directions it was calm.
    pub directions: usize,
    /// How long it was calm, s.
    pub calm_s: f64,
    /// Share of its windows that depart from the common field, 0 to 1.
    pub departing_share: f64,
}

/// Finds the field.
///
/// # Errors
/// [`Error::Data`] where columns differ in length, or the units are not calm for `least_calm_s` altogether.
pub fn local_field(units: &[MagneticUnit], options: &FieldOptions) -> Result<LocalField> {
    let mut seen = Vec::with_capacity(units.len());
    for (signals, mag_ut) in units {
        signals.check()?;
        if mag_ut.len() != signals.time_s.len() {
            return Err(Error::Data(format!(
                "sensor `{}`: {} time stamps and {} rows of the magnetometer; they must be equal",
                signals.name,
                signals.time_s.len(),
                mag_ut.len()
            )));
        }
        seen.push(sights(signals, mag_ut, options));
    }
    let calm_s = |sights: &[Sight]| sights.iter().filter(|s| s.dip_rad.is_some()).count() as f64 * options.window_s;
    let all_calm_s: f64 = seen.iter().map(|sights| calm_s(sights)).sum();
    if all_calm_s < options.least_calm_s {
        return Err(Error::Data(format!(
            "magnetic field: the {} units with magnetometers are calm for {all_calm_s:.2} s altogether, at least {} s are \
             needed. Let them rest in the recording, or turn them slowly (below {} rad/s)",
            units.len(),
            options.least_calm_s,
            options.calm_rad_s
        )));
    }
    let most = options.direction_s / options.window_s;
    let norms_of = |sights: &Vec<Sight>| by_direction(sights, most, |s| Some(s.norm_ut));
    let dips_of = |sights: &Vec<Sight>| by_direction(sights, most, |s| s.dip_rad);
    let (norm_ut, norm_std_ut) = middle(&seen.iter().flat_map(norms_of).collect::<Vec<_>>());
    let dips: Vec<Weighed> = seen.iter().flat_map(dips_of).collect();
    let (dip_rad, dip_std_rad) = middle(&dips);
    let departs = |s: &Sight| {
        (s.norm_ut - norm_ut).abs() > options.norm_tolerance * norm_ut
            || s.dip_rad.is_some_and(|dip| (dip - dip_rad).abs() > options.dip_tolerance_rad)
    };
    let share = |sights: &[&Sight]| sights.iter().filter(|s| departs(s)).count() as f64 / sights.len().max(1) as f64;
    let of_unit = |((signals, _), sights): (&MagneticUnit, &Vec<Sight>)| {
        let dips = dips_of(sights);
        UnitField {
            name: signals.name.to_owned(),
            norm_ut: middle(&norms_of(sights)).0,
            directions: dips.len(),
            dip_rad: middle(&dips).0,
            calm_s: calm_s(sights),
            departing_share: share(&sights.iter().collect::<Vec<_>>()),
        }
    };
    Ok(LocalField {
        norm_ut,
        norm_std_ut,
        dip_rad,
        dip_std_rad,
        directions: dips.len(),
        departing_share: share(&seen.iter().flatten().collect::<Vec<_>>()),
        units: units.iter().zip(&seen).map(of_unit).collect(),
    })
}

/// One window.
struct Sight {
    norm_ut: f64,
    /// Where the unit is calm.
    dip_rad: Option<f64>,
    /// Of the field in sensor axes, coarsely: one of 26.
    direction: [i8; 3],
}

/// A figure and how much it counts.
type Weighed = (f64, f64);

/// The median of a figure in every direction, and in how many windows it was seen, at most `most`.
fn by_direction(sights: &[Sight], most: f64, of: impl Fn(&Sight) -> Option<f64>) -> Vec<Weighed> {
    let mut found: BTreeMap<[i8; 3], Vec<f64>> = BTreeMap::new();
    for sight in sights {
        if let Some(value) = of(sight) {
            found.entry(sight.direction).or_default().push(value);
        }
    }
    found.into_values().map(|values| (values.len() as f64, values)).map(|(n, v)| (median(v), n.min(most))).collect()
}

/// Weighed median, and the standard deviation of normal values with the same median distance from it.
fn middle(values: &[Weighed]) -> (f64, f64) {
    let centre = weighed_median(values.to_vec());
    (centre, 1.4826 * weighed_median(values.iter().map(|(v, weight)| ((v - centre).abs(), *weight)).collect()))
}

fn weighed_median(mut values: Vec<Weighed>) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|v| v.1).sum::<f64>();
    let mut below = 0.0;
    let reaches = |v: &&Weighed| {
        below += v.1;
        below >= half
    };
    values.iter().find(reaches).map_or(f64::NAN, |v| v.0)
}

/// Means of gyroscope's norm, force and field over a window.
struct Means {
    fastest_rad_s: f64,
    force: Vector3<f64>,
    field: Vector3<f64>,
    norm_ut: f64,
}

fn sights(signals: &Signals, mag_ut: &[[f64; 3]], options: &FieldOptions) -> Vec<Sight> {
    let windows = windows(signals, mag_ut, options.window_s);
    let slow = |w: &&Means| w.fastest_rad_s <= options.calm_rad_s;
    let usual = median(windows.iter().filter(slow).map(|w| w.force.norm()).collect());
    let sight = |w: &Means| {
        let calm = slow(&w) && (w.force.norm() - usual).abs() <= options.calm_m_s2 && usual > 1.0;
        let sine = -w.force.normalize().dot(&w.field.normalize());
        Sight {
            norm_ut: w.norm_ut,
            dip_rad: calm.then(|| sine.clamp(-1.0, 1.0).asin()),
            // 1.5 parts the sphere into faces, edges and corners of a cube.
            direction: (w.field.normalize() * 1.5).map(|x| x.round() as i8).into(),
        }
    };
    windows.iter().map(sight).collect()
}

/// Windows without gaps and with a field.
fn windows(signals: &Signals, mag_ut: &[[f64; 3]], window_s: f64) -> Vec<Means> {
    let (mut found, mut start) = (Vec::new(), 0);
    while start < signals.time_s.len() {
        let until_s = signals.time_s[start] + window_s;
        let count = signals.time_s[start..].partition_point(|&t| t < until_s).max(1);
        let window = start..start + count;
        start += count;
        let [rates, forces, fields] = [signals.gyro_rad_s, signals.accel_m_s2, mag_ut].map(|c| &c[window.clone()]);
        let norm = |v: &[f64; 3]| Vector3::from(*v).norm();
        let means = Means {
            fastest_rad_s: rates.iter().map(norm).fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a }),
            force: mean(forces),
            field: mean(fields),
            // Of single readings: turning inside the window would shorten the mean.
            norm_ut: fields.iter().map(norm).sum::<f64>() / count as f64,
        };
        let whole = means.force.norm().is_normal() && means.field.norm().is_normal() && means.fastest_rad_s.is_finite();
        if count >= 4 && whole {
            found.push(means);
        }
    }
    found
}
