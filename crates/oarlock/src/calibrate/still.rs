//! Finds the still stretches of a recording.

use super::signals::Signals;
use crate::{Error, Result};
use nalgebra::Vector3;

/// Thresholds of stillness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StillLimits {
    /// Length of the window in which the scatter is measured, s.
    pub window_s: f64,
    /// Largest standard deviation of one gyroscope axis inside a window, rad/s.
    pub gyro_scatter_rad_s: f64,
    /// Largest standard deviation of one accelerometer axis inside a window, m/s2.
    pub accel_scatter_m_s2: f64,
    /// Shortest stretch to report, s.
    pub least_s: f64,
}

impl Default for StillLimits {
    /// Ten times the noise of consumer MEMS sensors at 100 Hz, well below any movement by hand.
    fn default() -> Self {
        Self { window_s: 0.25, gyro_scatter_rad_s: 0.02, accel_scatter_m_s2: 0.15, least_s: 0.5 }
    }
}

/// All still stretches (start, end) in s of one sensor, in order of time.
///
/// `time_s` increases; `gyro_rad_s` and `accel_m_s2` have the same length (rows beyond the shortest column are ignored)
/// and are in sensor axes. A window with a value that is not finite is not still. The list may be empty.
pub fn still_stretches(
    time_s: &[f64],
    gyro_rad_s: &[[f64; 3]],
    accel_m_s2: &[[f64; 3]],
    limits: &StillLimits,
) -> Vec<(f64, f64)> {
    let rows = time_s.len().min(gyro_rad_s.len()).min(accel_m_s2.len());
    let time_s = &time_s[..rows];
    let mut stretches: Vec<(f64, f64)> = Vec::new();
    for window in windows(time_s, limits.window_s) {
        let (gyro, accel) = (scatter(&gyro_rad_s[window.clone()]), scatter(&accel_m_s2[window.clone()]));
        let calm = gyro <= limits.gyro_scatter_rad_s && accel <= limits.accel_scatter_m_s2;
        if !calm {
            continue;
        }
        let (start, end) = (time_s[window.start], time_s[window.end - 1]);
        match stretches.last_mut() {
            Some(last) if start <= last.1 => last.1 = end,
            _ => stretches.push((start, end)),
        }
    }
    stretches
}

/// The longest still stretch (start, end) in s of one sensor; arguments as in [`still_stretches`].
///
/// # Errors
/// [`Error::Data`] if none is as long as `limits.least_s`; the message gives the scatter of the calmest window.
pub fn find_still(
    name: &str,
    time_s: &[f64],
    gyro_rad_s: &[[f64; 3]],
    accel_m_s2: &[[f64; 3]],
    limits: &StillLimits,
) -> Result<(f64, f64)> {
    let stretches = still_stretches(time_s, gyro_rad_s, accel_m_s2, limits);
    longest(&stretches, limits.least_s)
        .ok_or_else(|| Error::Data(no_still_text(name, time_s, gyro_rad_s, accel_m_s2, limits)))
}

/// The longest stretch in which all sensors are still, (start, end) in s.
///
/// # Errors
/// [`Error::Data`] if there is none.
pub fn common_still(sensors: &[Signals], limits: &StillLimits) -> Result<(f64, f64)> {
    let mut common = vec![(f64::NEG_INFINITY, f64::INFINITY)];
    for s in sensors {
        find_still(s.name, s.time_s, s.gyro_rad_s, s.accel_m_s2, limits)?;
        let own = still_stretches(s.time_s, s.gyro_rad_s, s.accel_m_s2, limits);
        common = intersection(&common, &own);
    }
    longest(&common, limits.least_s).ok_or_else(|| {
        let names: Vec<&str> = sensors.iter().map(|s| s.name).collect();
        Error::Data(format!(
            "sensors {}: each is still for {} s, but never all at once. Hold the whole body still, or name the stretch",
            names.join(", "),
            limits.least_s
        ))
    })
}

/// The longest stretch of at least `least_s`.
pub(crate) fn longest(stretches: &[(f64, f64)], least_s: f64) -> Option<(f64, f64)> {
    let length = |s: &(f64, f64)| s.1 - s.0;
    stretches.iter().copied().filter(|s| length(s) >= least_s).max_by(|a, b| length(a).total_cmp(&length(b)))
}

/// The intersection of the stretches `a` and `b`.
pub(crate) fn intersection(a: &[(f64, f64)], b: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let pairs = a.iter().flat_map(|x| b.iter().map(move |y| (x.0.max(y.0), x.1.min(y.1))));
    pairs.filter(|(start, end)| end > start).collect()
}

fn no_still_text(name: &str, time_s: &[f64], gyro: &[[f64; 3]], accel: &[[f64; 3]], limits: &StillLimits) -> String {
    let rows = time_s.len().min(gyro.len()).min(accel.len());
    let calmest = windows(&time_s[..rows], limits.window_s)
        .map(|w| (scatter(&gyro[w.clone()]), scatter(&accel[w.clone()]), time_s[w.start]))
        .filter(|(g, a, _)| g.is_finite() && a.is_finite())
        .min_by(|x, y| x.0.total_cmp(&y.0));
    let found = match calmest {
        Some((g, a, at)) => {
            format!("the calmest {} s, from {at:.2} s, scatter by {g:.3} rad/s and {a:.2} m/s2", limits.window_s)
        }
        None => format!("no window of {} s without gaps", limits.window_s),
    };
    format!(
        "sensor `{name}`: no still stretch of {} s (scatter of one axis at most {} rad/s and {} m/s2); {found}. \
         Hold the body still for a few seconds in the model's posture, or name the stretch yourself",
        limits.least_s, limits.gyro_scatter_rad_s, limits.accel_scatter_m_s2
    )
}

/// Windows of `length_s` that overlap by half; an incomplete last one is left out.
fn windows(time_s: &[f64], length_s: f64) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
    let mut start = 0;
    std::iter::from_fn(move || {
        let first = *time_s.get(start)?;
        let count = time_s[start..].partition_point(|&t| t < first + length_s);
        let window = start..start + count;
        (window.end < time_s.len() && count >= 4).then(|| {
            start += (count / 2).max(1);
            window
        })
    })
}

/// The largest standard deviation of the three axes; NaN if a value is not finite.
pub(crate) fn scatter(values: &[[f64; 3]]) -> f64 {
    let count = values.len() as f64;
    let mean = mean(values);
    let squares = values.iter().fold(Vector3::zeros(), |sum, v| {
        let d = Vector3::from(*v) - mean;
        sum + d.component_mul(&d)
    });
    // nalgebra's `max` ignores NaN.
    if squares.iter().all(|s| s.is_finite()) {
        (squares.max() / count).sqrt()
    } else {
        f64::NAN
    }
}

/// The mean of the vectors.
pub(crate) fn mean(values: &[[f64; 3]]) -> Vector3<f64> {
    values.iter().fold(Vector3::zeros(), |sum, v| sum + Vector3::from(*v)) / values.len() as f64
}
