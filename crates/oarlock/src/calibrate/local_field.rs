//! Norm and dip of the magnetic field at the place of a recording.
//!
//! The norm needs no direction. The dip needs only the angle between the magnetometer's reading and up while the unit
//! is still or slow. Neither mounts nor postures enter. A magnetometer's constant error raises the norm in one
//! direction and lowers it in the opposite one; therefore every direction that a unit held for a while has the same
//! weight. Medians ignore a unit that came near iron for a moment. The share of such outliers is reported.

use super::robust_fit::median;
use super::signals::Signals;
use super::still::mean;
use crate::{Error, Result};
use nalgebra::Vector3;
use serde::Serialize;
use std::collections::BTreeMap;

/// Settings of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldOptions {
    /// Window over which readings are averaged, s.
    pub window_s: f64,
    /// Largest angular velocity of a calm window, rad/s.
    pub calm_rad_s: f64,
    /// Largest difference between the mean specific force of a calm window and the unit's usual one, m/s2.
    pub calm_m_s2: f64,
    /// A direction held for longer than this, s, gets no more weight. A shorter one gets less, because the estimated
    /// vertical is wrong for a moment at the turning points of a swing.
    pub direction_s: f64,
    /// Least total calm time of all units, s.
    pub least_calm_s: f64,
    /// A window is an outlier if its norm deviates by more than this share,
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

/// A unit with its magnetometer, uT in sensor axes, at the unit's time stamps; rows that are not finite are ignored.
pub type MagneticUnit<'a> = (Signals<'a>, &'a [[f64; 3]]);

/// The field that fits most directions of all units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LocalField {
    /// Norm, uT.
    pub norm_ut: f64,
    /// Robust standard deviation between directions, uT. It includes differences in place, iron and the sensors'
    /// errors.
    pub norm_std_ut: f64,
    /// Dip below the horizon, rad.
    pub dip_rad: f64,
    /// Robust standard deviation between directions, rad.
    pub dip_std_rad: f64,
    /// Number of directions in which units were calm. With one or two of them the standard deviations are meaningless.
    pub directions: usize,
    /// Share of the windows that are outliers, 0 to 1.
    pub departing_share: f64,
    /// Results of each unit, in the order given.
    pub units: Vec<UnitField>,
}

/// Results of one unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnitField {
    /// The sensor.
    pub name: String,
    /// Median norm, uT; NaN for a unit without readings.
    pub norm_ut: f64,
    /// Median dip, rad; NaN for a unit that is never calm.
    pub dip_rad: f64,
    /// Number of directions in which it was calm.
    pub directions: usize,
    /// Calm time, s.
    pub calm_s: f64,
    /// Share of its windows that deviate from the common field, 0 to 1.
    pub departing_share: f64,
}

/// Estimates norm and dip.
///
/// # Errors
/// [`Error::Data`] if columns differ in length, or the total calm time is below `least_calm_s`.
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
    /// Dip, rad; `None` unless the unit is calm.
    dip_rad: Option<f64>,
    /// Coarse direction of the field in sensor axes, one of 26.
    direction: [i8; 3],
}

/// A value and its weight.
type Weighed = (f64, f64);

/// The median of a value in every direction, weighted by the number of its windows up to `most`.
fn by_direction(sights: &[Sight], most: f64, of: impl Fn(&Sight) -> Option<f64>) -> Vec<Weighed> {
    let mut found: BTreeMap<[i8; 3], Vec<f64>> = BTreeMap::new();
    for sight in sights {
        if let Some(value) = of(sight) {
            found.entry(sight.direction).or_default().push(value);
        }
    }
    found.into_values().map(|values| (values.len() as f64, values)).map(|(n, v)| (median(v), n.min(most))).collect()
}

/// Weighted median, and the standard deviation of a normal distribution with the same median deviation.
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

/// Means of the gyroscope's norm, the force and the field over a window.
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
            // 1.5 divides the sphere into the faces, edges and corners of a cube.
            direction: (w.field.normalize() * 1.5).map(|x| x.round() as i8).into(),
        }
    };
    windows.iter().map(sight).collect()
}

/// Windows without gaps, with a magnetic field.
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
            // Norm of single readings: averaging vectors while the unit rotates would reduce it.
            norm_ut: fields.iter().map(norm).sum::<f64>() / count as f64,
        };
        let whole = means.force.norm().is_normal() && means.field.norm().is_normal() && means.fastest_rad_s.is_finite();
        if count >= 4 && whole {
            found.push(means);
        }
    }
    found
}
