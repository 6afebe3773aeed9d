//! Motion of two sensors, averaged over windows of a common clock without an error of the average.
//!
//! The position of a sensor relative to a point of its body, `r`, rotates with the body, and its velocity there is `R
//! (w x r)`. The slope of the least-squares line through that velocity is the mean of the acceleration with weights `h
//! (h + 1) - j^2` (h half the window, j from its middle). Specific force averaged with the same weights therefore
//! equals that of the point plus `swirl r`. This needs no derivative of the angular velocity and is exact for any
//! rotation inside the window.

use super::clock::{common_clock, median_step, neighbours};
use super::rest::Rest;
use super::robust_fit::median;
use super::signals::Signals;
use super::still::{find_still, StillLimits};
use crate::{Error, Result};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Averages of one sensor, in its axes at the middle of the window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    /// Specific force, m/s2.
    pub force: Vector3<f64>,
    /// Acceleration of a point of the body is `swirl` times its position, 1/s2.
    pub swirl: Matrix3<f64>,
    /// Angular velocity, rad/s.
    pub rate: Vector3<f64>,
}

/// Windows that both sensors cover; they overlap by half.
pub(crate) struct PairedWindows {
    /// Middle of each window, s.
    pub time_s: Vec<f64>,
    pub pairs: Vec<[Window; 2]>,
    /// Interval between windows, s.
    pub spacing_s: f64,
    /// Standard deviation of each entry of the swirl due to the gyroscopes' noise, 1/s2.
    pub swirl_noise: [f64; 2],
}

/// Largest number of windows. More of them add no information and cost time.
const MOST: usize = 6000;

impl PairedWindows {
    /// # Errors
    /// [`Error::Data`] for malformed columns, or if the two have no common window without a gap.
    pub fn new(units: [&Signals; 2], window_s: f64) -> Result<Self> {
        units[0].check()?;
        units[1].check()?;
        let (clock, step_s) = common_clock(&[units[0].time_s, units[1].time_s])?;
        let half = (0.5 * window_s / step_s).round().max(1.0) as usize;
        let steady = [Steady::new(units[0], &clock, step_s)?, Steady::new(units[1], &clock, step_s)?];
        let stride = half.max(clock.len() / MOST);
        let whole = |k: &usize| steady.iter().all(|s| s.covers(*k, half));
        let middles: Vec<usize> = (half..clock.len() - half).step_by(stride).filter(whole).collect();
        if middles.len() < 16 {
            return Err(Error::Data(format!(
                "sensors `{}` and `{}`: {} windows of {window_s} s without a gap, at least 16 are needed",
                units[0].name,
                units[1].name,
                middles.len()
            )));
        }
        let pair = |&k: &usize| [steady[0].window(k, half, step_s), steady[1].window(k, half, step_s)];
        Ok(Self {
            pairs: middles.iter().map(pair).collect(),
            time_s: middles.iter().map(|&k| clock[k]).collect(),
            spacing_s: stride as f64 * step_s,
            swirl_noise: units.map(|unit| gyro_noise(unit) / (squares(half as f64).sqrt() * step_s)),
        })
    }

    /// Number of windows within `span_s`, at least 1.
    pub fn within(&self, span_s: f64) -> f64 {
        (span_s / self.spacing_s).max(1.0)
    }
}

/// One sensor on the common clock.
struct Steady {
    rates: Vec<Vector3<f64>>,
    forces: Vec<Vector3<f64>>,
    covered: Vec<bool>,
    /// Rotation from the axes after each step to those before it.
    steps: Vec<Rotation3<f64>>,
}

impl Steady {
    fn new(unit: &Signals, clock: &[f64], step_s: f64) -> Result<Self> {
        let row = |k: usize| (unit.time_s[k], (Vector3::from(unit.gyro_rad_s[k]), Vector3::from(unit.accel_m_s2[k])));
        let known: Vec<_> = (0..unit.time_s.len()).filter(|&k| unit.is_complete(k)).map(row).collect();
        if known.len() < 2 {
            return Err(Error::Data(format!("sensor `{}`: fewer than 2 complete rows", unit.name)));
        }
        let bias = resting_bias(unit);
        let longest_s = 2.5 * step_s.max(median_step(unit.time_s));
        let mut steady = Self { rates: vec![], forces: vec![], covered: vec![], steps: vec![] };
        for &t in clock {
            let ((t0, before), (t1, after)) = neighbours(&known, t);
            let share = ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
            steady.rates.push(before.0.lerp(&after.0, share) - bias);
            steady.forces.push(before.1.lerp(&after.1, share));
            steady.covered.push(t1 - t0 <= longest_s);
        }
        let middle = |w: &[Vector3<f64>]| Rotation3::new((w[0] + w[1]) * (0.5 * step_s));
        steady.steps = steady.rates.windows(2).map(middle).collect();
        Ok(steady)
    }

    fn covers(&self, k: usize, half: usize) -> bool {
        self.covered[k - half..=k + half].iter().all(|&c| c)
    }

    fn window(&self, k: usize, half: usize, step_s: f64) -> Window {
        let h = half as f64;
        let weight = |j: f64| (h * (h + 1.0) - j * j) / (2.0 * squares(h));
        let (mut force, mut rate) = (self.forces[k] * weight(0.0), self.rates[k] * weight(0.0));
        let mut slope = Matrix3::zeros();
        let (mut ahead, mut behind) = (Rotation3::identity(), Rotation3::identity());
        for i in 1..=half {
            let j = i as f64;
            ahead *= self.steps[k + i - 1];
            behind *= self.steps[k - i].inverse();
            force += (ahead * self.forces[k + i] + behind * self.forces[k - i]) * weight(j);
            rate += (ahead * self.rates[k + i] + behind * self.rates[k - i]) * weight(j);
            let turned = |m: &Rotation3<f64>, w: &Vector3<f64>| m.matrix() * w.cross_matrix();
            slope += (turned(&ahead, &self.rates[k + i]) - turned(&behind, &self.rates[k - i])) * j;
        }
        Window { force, swirl: slope / (squares(h) * step_s), rate }
    }
}

/// Sum of j^2 for j from -h to h.
fn squares(h: f64) -> f64 {
    h * (h + 1.0) * (2.0 * h + 1.0) / 3.0
}

/// Standard deviation of one reading of one axis, rad/s: the smaller one of the scatter at rest and that of third
/// differences, which suppress smooth motion. The median ignores knocks.
fn gyro_noise(unit: &Signals) -> f64 {
    // Third difference of white noise with unit variance: 1 + 9 + 9 + 1.
    const GAIN: f64 = 20.0;
    let third = |w: &[[f64; 3]]| [0, 1, 2].map(|i| (w[3][i] - 3.0 * w[2][i] + 3.0 * w[1][i] - w[0][i]).abs());
    let differences = unit.gyro_rad_s.windows(4).flat_map(third).filter(|d| d.is_finite());
    let moving = 1.4826 * median(differences.collect()) / GAIN.sqrt();
    let resting = longest_rest(unit).map_or(f64::INFINITY, |rest| rest.noise.0);
    // There is no median without readings.
    moving.min(resting).max(0.0)
}

/// The longest still stretch, if there is one.
fn longest_rest(unit: &Signals) -> Option<Rest> {
    let still = find_still(unit.name, unit.time_s, unit.gyro_rad_s, unit.accel_m_s2, &StillLimits::default());
    still.and_then(|span_s| Rest::of(unit, span_s)).ok()
}

/// The gyroscope's mean in the longest still stretch, zero without one. The constant rate of a turntable is no bias.
fn resting_bias(unit: &Signals) -> Vector3<f64> {
    const LARGEST_RAD_S: f64 = 0.1;
    let bias = longest_rest(unit).map_or(Vector3::zeros(), |rest| rest.bias);
    if bias.norm() < LARGEST_RAD_S {
        bias
    } else {
        Vector3::zeros()
    }
}
