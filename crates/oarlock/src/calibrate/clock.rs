//! Resamples sensors with different time stamps on one even grid.

use crate::{Error, Result};
use nalgebra::Vector3;

/// Even grid over the span of all sensors, with the first one's median interval; and that interval.
///
/// # Errors
/// [`Error::Data`] if the grid has fewer than 16 points.
pub(crate) fn common_clock(clocks: &[&[f64]]) -> Result<(Vec<f64>, f64)> {
    let start = clocks.iter().map(|t| t.first().copied().unwrap_or(f64::NAN)).fold(f64::NEG_INFINITY, f64::max);
    let end = clocks.iter().map(|t| t.last().copied().unwrap_or(f64::NAN)).fold(f64::INFINITY, f64::min);
    let first = clocks.first().copied().unwrap_or(&[]);
    let step_s = median_step(first);
    let count = ((end - start) / step_s + 1e-6).floor();
    // A clock with very uneven intervals would need a grid larger than the memory.
    let most = 10.0 * first.len() as f64;
    if !(16.0..=most).contains(&count) {
        return Err(Error::Data(format!(
            "the sensors share {:.3} s, from {start:.3} to {end:.3} s, at steps of {step_s} s: at least 16 even steps \
             are needed. Check that the sensors are on one clock",
            end - start
        )));
    }
    Ok(((0..=count as usize).map(|k| start + k as f64 * step_s).collect(), step_s))
}

/// Median interval of a clock, s; NaN for fewer than two time stamps.
pub(crate) fn median_step(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The rows before and after a time; `known` has at least two, in order of time.
pub(crate) fn neighbours<T>(known: &[(f64, T)], t: f64) -> (&(f64, T), &(f64, T)) {
    let after = known.partition_point(|row| row.0 < t).clamp(1, known.len() - 1);
    (&known[after - 1], &known[after])
}

/// Linear interpolation, constant beyond the ends.
pub(crate) fn interpolated(known: &[(f64, Vector3<f64>)], t: f64) -> Vector3<f64> {
    let ((t0, v0), (t1, v1)) = neighbours(known, t);
    v0 + (v1 - v0) * ((t - t0) / (t1 - t0)).clamp(0.0, 1.0)
}
