//! Axis of a hinge between two bodies, in the axes of one inertial unit on each, from their gyroscopes alone.
//!
//! The bodies' angular velocities differ by a rotation about the hinge, so their components normal to it have the same
//! norm: `|w1 x j1| = |w2 x j2|`. Both bodies may move freely; the relative orientation of the units does not enter.
//!
//! Source: T. Seel, T. Schauer and J. Raisch (2012), as in [`joint_centers`](super::joint_centers).

use super::robust_fit::{fit, Problem, Scatter};
use super::signals::Signals;
use super::windows::{PairedWindows, Window};
use crate::Result;
use nalgebra::{DMatrix, DVector, Matrix2, Rotation3, SymmetricEigen, Vector3};
use serde::Serialize;

/// Settings of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisOptions {
    /// Window over which the gyroscopes are averaged, s.
    pub window_s: f64,
    /// Correlation time of the residuals, s.
    pub correlation_s: f64,
}

impl Default for AxisOptions {
    /// For units worn on the limbs of a person.
    fn default() -> Self {
        Self { window_s: 0.1, correlation_s: 1.0 }
    }
}

/// Axis of a hinge and its quality.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundAxis {
    /// In the first unit's sensor axes, unit vector.
    pub first: [f64; 3],
    /// The same axis in the second unit's axes.
    pub second: [f64; 3],
    /// Standard deviation of each direction, rad, along the transverse direction with the largest one.
    pub std_rad: [f64; 2],
    /// Robust standard deviation of the residuals, rad/s.
    pub residual_rad_s: f64,
    /// Root mean square of the relative angular velocity about the axis, rad/s.
    pub hinge_rad_s: f64,
    /// From -1 to 1: confidence that both vectors point the same way along the hinge. Near 0 the motion does not
    /// determine it.
    pub sense: f64,
}

/// Estimates the axis. Its sign is arbitrary and common to both vectors if `sense` is clear.
///
/// # Errors
/// [`Error::Data`](crate::Error::Data) for malformed columns or no common stretch of time without gaps.
pub fn hinge_axis(units: [&Signals; 2], options: &AxisOptions) -> Result<FoundAxis> {
    let windows = PairedWindows::new(units, options.window_s)?;
    let rows_per_error = windows.within(options.correlation_s);
    let problem = Axes { pairs: &windows.pairs };
    let found = fit(&problem, &starts(), &Scatter { least: 1e-5, rows_per_error })?;
    let [first, mut second] = found.state;
    let mut sense = sense(&windows, [first, second]);
    if sense < 0.0 {
        (second, sense) = (-second, -sense);
    }
    let transverse_std = |unit: usize| {
        let block: Matrix2<f64> = found.estimate.covariance.fixed_view::<2, 2>(2 * unit, 2 * unit).into_owned();
        SymmetricEigen::new(block).eigenvalues.max().max(0.0).sqrt()
    };
    let turning = |pair: &[Window; 2]| (second.dot(&pair[1].rate) - first.dot(&pair[0].rate)).powi(2);
    Ok(FoundAxis {
        first: first.into(),
        second: second.into(),
        std_rad: [transverse_std(0), transverse_std(1)],
        residual_rad_s: found.spread,
        hinge_rad_s: (windows.pairs.iter().map(turning).sum::<f64>() / windows.pairs.len() as f64).sqrt(),
        sense,
    })
}

type Pair = [Vector3<f64>; 2];

fn starts() -> Vec<Pair> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    axes.iter().flat_map(|a| axes.iter().map(move |b| [*a, *b])).collect()
}

struct Axes<'a> {
    pairs: &'a [[Window; 2]],
}

impl Problem for Axes<'_> {
    type State = Pair;

    fn errors(&self, at: &Pair) -> DVector<f64> {
        let error = |pair: &[Window; 2]| pair[0].rate.cross(&at[0]).norm() - pair[1].rate.cross(&at[1]).norm();
        DVector::from_iterator(self.pairs.len(), self.pairs.iter().map(error))
    }

    fn slopes(&self, at: &Pair) -> DMatrix<f64> {
        let mut slopes = DMatrix::zeros(self.pairs.len(), 4);
        let across = at.map(|axis| transverse(&axis));
        for (row, pair) in self.pairs.iter().enumerate() {
            for (unit, sign) in [(0, 1.0), (1, -1.0)] {
                let off = pair[unit].rate.cross(&at[unit]);
                let direction = off.try_normalize(1e-9).unwrap_or_default();
                for (column, t) in across[unit].iter().enumerate() {
                    slopes[(row, 2 * unit + column)] = sign * direction.dot(&pair[unit].rate.cross(t));
                }
            }
        }
        slopes
    }

    fn plus(&self, at: &Pair, step: &DVector<f64>) -> Pair {
        std::array::from_fn(|unit| {
            let across = transverse(&at[unit]);
            let turn = at[unit].cross(&(across[0] * step[2 * unit] + across[1] * step[2 * unit + 1]));
            Rotation3::new(turn) * at[unit]
        })
    }

    /// No direction is preferred: starts a quarter turn away from the current fit.
    fn departure(&self, _: &Pair) -> (DVector<f64>, DVector<f64>) {
        (DVector::zeros(4), DVector::from_element(4, std::f64::consts::FRAC_PI_2))
    }
}

/// Two unit vectors normal to the axis and to each other; right-handed with it.
fn transverse(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let one = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    [one, axis.cross(&one)]
}

/// The component normal to the hinge rotates from one body to the other by the hinge's angle if both vectors point the
/// same way.
fn sense(windows: &PairedWindows, axes: Pair) -> f64 {
    const STRETCH_S: f64 = 5.0;
    let (mut alike, mut opposite) = (0.0, 0.0);
    let count = windows.within(STRETCH_S) as usize;
    for (pairs, times) in windows.pairs.chunks(count).zip(windows.time_s.chunks(count)) {
        alike += coherence(pairs, times, axes);
        opposite += coherence(pairs, times, [axes[0], -axes[1]]);
    }
    (alike - opposite) / (alike + opposite).max(f64::MIN_POSITIVE)
}

/// Length of the sum of the products of transverse rates, after the hinge's angle is removed.
fn coherence(pairs: &[[Window; 2]], times: &[f64], axes: Pair) -> f64 {
    let across = axes.map(|axis| transverse(&axis));
    let (mut angle, mut sum) = (0.0, (0.0, 0.0));
    for (k, pair) in pairs.iter().enumerate() {
        let rate = axes[1].dot(&pair[1].rate) - axes[0].dot(&pair[0].rate);
        angle += if k > 0 { rate * (times[k] - times[k - 1]) } else { 0.0 };
        let [one, two] = [0, 1].map(|u| across[u].map(|t| t.dot(&pair[u].rate)));
        // As complex numbers: the first times the conjugate of the second, rotated back by the angle.
        let product = (one[0] * two[0] + one[1] * two[1], one[1] * two[0] - one[0] * two[1]);
        let (sin, cos) = angle.sin_cos();
        sum.0 += product.0 * cos + product.1 * sin;
        sum.1 += product.1 * cos - product.0 * sin;
    }
    sum.0.hypot(sum.1)
}
