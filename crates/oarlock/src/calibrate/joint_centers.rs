//! Position of the joint between two bodies, in the axes of one inertial unit on each, from motion alone.
//!
//! Both units measure the joint's specific force in their own axes: `|f1 - K1 r1| = |f2 - K2 r2|`, with `r` from the
//! joint to the unit, and `K` from the angular velocity and acceleration of the body. The mounts and the relative
//! orientation of the units do not enter.
//!
//! Source: T. Seel, T. Schauer and J. Raisch (2012), "Joint axis and position estimation from inertial measurement data by
//! exploiting kinematic constraints"; F. Olsson and K. Halvorsen (2017), "Experimental evaluation of joint position
//! estimation using inertial sensors", for a robust loss. Here the constraint is averaged over [`windows`](super::windows).

use super::robust_fit::{fit_as_scattered, Fit, Problem, Scatter};
use super::signals::Signals;
use super::windows::{PairedWindows, Window};
use super::GoOn;
use crate::{Error, Result};
use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, RowVector3, SymmetricEigen, Vector3};
use serde::Serialize;
use std::ops::Range;

/// Settings of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CenterOptions {
    /// Window over which force and motion are averaged, s. Longer windows suppress soft mounting but also quick motion.
    pub window_s: f64,
    /// Prior standard deviation of each coordinate, m.
    pub prior_std_m: f64,
    /// Constant errors of the accelerometers, standard deviation, m/s2.
    pub accel_bias_std_m_s2: f64,
    /// Relative difference between the scales of the two accelerometers, standard deviation.
    pub accel_scale_std: f64,
    /// Correlation time of the residuals (soft tissue, play), s. It is raised if parts of the recording disagree more than it
    /// explains.
    pub correlation_s: f64,
    /// A direction with a larger standard deviation counts as loose, m.
    pub loose_std_m: f64,
}

impl Default for CenterOptions {
    /// For units worn on the limbs of a person.
    fn default() -> Self {
        Self {
            window_s: 0.2,
            prior_std_m: 0.3,
            accel_bias_std_m_s2: 0.2,
            accel_scale_std: 0.02,
            correlation_s: 1.0,
            loose_std_m: 0.05,
        }
    }
}

/// Position of a joint and its quality.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundCenter {
    /// From the joint to the first unit, in its sensor axes, m.
    pub first_m: [f64; 3],
    /// From the joint to the second unit, in its sensor axes, m.
    pub second_m: [f64; 3],
    /// Standard deviations of the two, m.
    pub first_std_m: [f64; 3],
    /// See `first_std_m`.
    pub second_std_m: [f64; 3],
    /// Covariance of both vectors together, m2, row by row.
    pub covariance_m2: [[f64; 6]; 6],
    /// Directions in which the motion does not determine the position, the loosest first. The direction along a hinge's
    /// axis is always among them.
    pub loose: Vec<LooseDirection>,
    /// Robust standard deviation of the residuals of the specific force's norm, m/s2.
    pub residual_m_s2: f64,
    /// Constant errors of both accelerometers, m/s2, as far as their difference determines them.
    pub accel_bias_m_s2: [[f64; 3]; 2],
    /// Root mean square of each unit's angular velocity, rad/s.
    pub turning_rad_s: [f64; 2],
    /// Time that the windows cover, s.
    pub used_s: f64,
}

/// A direction in which the joint may be moved without a noticeable change of the readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LooseDirection {
    /// In the first unit's axes. Both vectors together have length 1.
    pub first: [f64; 3],
    /// In the second unit's axes.
    pub second: [f64; 3],
    /// Standard deviation, m.
    pub std_m: f64,
}

/// Estimates the joint between two bodies. `expected` is the prior: joint to unit, in each unit's sensor axes, m. A
/// direction that the motion does not determine keeps that value.
///
/// # Errors
/// [`Error::Data`] for malformed columns, an expected value that is not finite, or no common stretch of time without
/// gaps.
pub fn joint_center(
    units: [&Signals; 2],
    expected: [[f64; 3]; 2],
    options: &CenterOptions,
    go_on: GoOn,
) -> Result<FoundCenter> {
    if !expected.iter().flatten().all(|x| x.is_finite()) {
        return Err(Error::Data(format!(
            "sensors `{}` and `{}`: the joint is expected at {expected:?} m, which is not finite",
            units[0].name, units[1].name
        )));
    }
    let windows = PairedWindows::new(units, options.window_s)?;
    let rows_per_error = windows.within(options.correlation_s);
    let problem = Center {
        pairs: &windows.pairs,
        expected: expected.map(Vector3::from),
        swirl_noise: windows.swirl_noise,
        options,
    };
    let scatter = Scatter { least: 1e-4, rows_per_error };
    let found = fit_as_scattered(&problem, &starts(options.prior_std_m), &scatter, FIRST_BIAS, go_on)?;
    Ok(problem.told(&found, &windows))
}

/// Starts at the prior, and displaced along each axis in the same or the opposite way for both units.
fn starts(prior_std_m: f64) -> Vec<DVector<f64>> {
    let mut starts = vec![DVector::zeros(UNKNOWNS)];
    for axis in 0..3 {
        for (first, second) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let mut start = DVector::zeros(UNKNOWNS);
            start[FIRST + axis] = 0.7 * first * prior_std_m;
            start[SECOND + axis] = 0.7 * second * prior_std_m;
            starts.push(start);
        }
    }
    starts
}

const FIRST: usize = 0;
const SECOND: usize = 3;
const FIRST_BIAS: usize = 6;
const SECOND_BIAS: usize = 9;
const SCALE: usize = 12;
const UNKNOWNS: usize = 13;

struct Center<'a> {
    pairs: &'a [[Window; 2]],
    expected: [Vector3<f64>; 2],
    /// Standard deviation of each entry of the windows' swirl, 1/s2.
    swirl_noise: [f64; 2],
    options: &'a CenterOptions,
}

impl Center<'_> {
    /// The joint's specific force, measured by each unit.
    fn forces(&self, pair: &[Window; 2], at: &DVector<f64>) -> [Vector3<f64>; 2] {
        let three = |first: usize| Vector3::from(at.fixed_rows::<3>(first));
        let [one, two] = pair;
        let r = [self.expected[0] + three(FIRST), self.expected[1] + three(SECOND)];
        [
            one.force - three(FIRST_BIAS) - one.swirl * r[0],
            two.force * (1.0 + at[SCALE]) - three(SECOND_BIAS) - two.swirl * r[1],
        ]
    }

    fn told(&self, found: &Fit<DVector<f64>>, windows: &PairedWindows) -> FoundCenter {
        let (value, std) = (&found.estimate.value, &found.estimate.std);
        let three = |v: &DVector<f64>, first: usize| [v[first], v[first + 1], v[first + 2]];
        let place = |first: usize, expected: Vector3<f64>| (expected + Vector3::from(three(value, first))).into();
        let covariance = found.estimate.covariance.fixed_view::<6, 6>(0, 0).into_owned();
        let turning = |i: usize| {
            let sum: f64 = self.pairs.iter().map(|pair| pair[i].rate.norm_squared()).sum();
            (sum / self.pairs.len() as f64).sqrt()
        };
        FoundCenter {
            first_m: place(FIRST, self.expected[0]),
            second_m: place(SECOND, self.expected[1]),
            first_std_m: three(std, FIRST),
            second_std_m: three(std, SECOND),
            covariance_m2: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
            loose: loose_directions(covariance, self.options.loose_std_m),
            residual_m_s2: found.spread,
            accel_bias_m_s2: [three(value, FIRST_BIAS), three(value, SECOND_BIAS)],
            turning_rad_s: [turning(0), turning(1)],
            used_s: windows.pairs.len() as f64 * windows.spacing_s,
        }
    }
}

impl Problem for Center<'_> {
    type State = DVector<f64>;

    fn errors(&self, at: &DVector<f64>) -> DVector<f64> {
        let error = |pair: &[Window; 2]| {
            let [one, two] = self.forces(pair, at);
            one.norm() - two.norm()
        };
        DVector::from_iterator(self.pairs.len(), self.pairs.iter().map(error))
    }

    fn slopes(&self, at: &DVector<f64>) -> DMatrix<f64> {
        let mut slopes = DMatrix::zeros(self.pairs.len(), UNKNOWNS);
        for (row, pair) in self.pairs.iter().enumerate() {
            let [one, two] = self.forces(pair, at).map(|f| f.try_normalize(1e-9).unwrap_or_default().transpose());
            let mut set = |first: usize, slope: RowVector3<f64>| {
                slopes.fixed_view_mut::<1, 3>(row, first).copy_from(&slope);
            };
            set(FIRST, -one * pair[0].swirl);
            set(SECOND, two * pair[1].swirl);
            set(FIRST_BIAS, -one);
            set(SECOND_BIAS, two);
            slopes[(row, SCALE)] = -(two * pair[1].force)[0];
        }
        slopes
    }

    fn plus(&self, at: &DVector<f64>, step: &DVector<f64>) -> DVector<f64> {
        at + step
    }

    /// Effect of a gyroscope's noise: `n x r` for a lever `r`, projected on the joint's force.
    fn slope_noise(&self, at: &DVector<f64>, rows: Range<usize>, weights: &DVector<f64>) -> Option<DMatrix<f64>> {
        let mut information = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
        for (unit, first) in [FIRST, SECOND].into_iter().enumerate() {
            let across = |row: usize| {
                let f = self.forces(&self.pairs[row], at)[unit].try_normalize(1e-9).unwrap_or_default();
                (Matrix3::identity() - f * f.transpose()) * weights[row]
            };
            let sum: Matrix3<f64> = rows.clone().map(across).sum();
            information.fixed_view_mut::<3, 3>(first, first).copy_from(&(sum * self.swirl_noise[unit].powi(2)));
        }
        Some(information)
    }

    fn departure(&self, at: &DVector<f64>) -> (DVector<f64>, DVector<f64>) {
        let mut std = DVector::from_element(UNKNOWNS, self.options.prior_std_m);
        std.rows_mut(FIRST_BIAS, 6).fill(self.options.accel_bias_std_m_s2);
        std[SCALE] = self.options.accel_scale_std;
        (at.clone(), std)
    }
}

fn loose_directions(covariance: Matrix6<f64>, loose_std_m: f64) -> Vec<LooseDirection> {
    let eigen = SymmetricEigen::new(covariance);
    let mut loose: Vec<LooseDirection> = (0..6)
        .map(|k| {
            let v = eigen.eigenvectors.column(k);
            LooseDirection {
                first: [v[0], v[1], v[2]],
                second: [v[3], v[4], v[5]],
                std_m: eigen.eigenvalues[k].max(0.0).sqrt(),
            }
        })
        .filter(|direction| direction.std_m > loose_std_m)
        .collect();
    loose.sort_by(|a, b| b.std_m.total_cmp(&a.std_m));
    loose
}
