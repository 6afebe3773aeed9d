//! Axis of a hinge between two bodies, in the axes of one inertial unit on each, from their gyroscopes alone.
//!
//! The bodies' angular velocities differ by a rotation about the hinge, so their components normal to it have the same
//! norm: `|w1 x j1| = |w2 x j2|`. Both bodies may move freely; the relative orientation of the units does not enter.
//!
//! The estimate is the most likely one (maximum a posteriori), with the nominal mounts as prior. Biases and different scales
//! of the gyroscopes are estimated with it: if a body turns about one axis only, 2 % of scale look like 11 deg of axis.
//!
//! Source: T. Seel, T. Schauer and J. Raisch (2012), as in [`joint_centers`](super::joint_centers).

use super::robust_fit::{fit_as_scattered, Fit, Problem, Scatter};
use super::signals::Signals;
use super::windows::{PairedWindows, Window};
use super::GoOn;
use crate::Result;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, Matrix6x4, Rotation3, SymmetricEigen, Vector3, Vector4};
use serde::Serialize;

/// Settings of the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisOptions {
    /// Window over which the gyroscopes are averaged, s.
    pub window_s: f64,
    /// Correlation time of the residuals, s. It is raised if parts of the recording disagree more than it explains.
    pub correlation_s: f64,
    /// Constant errors of the gyroscopes, standard deviation, rad/s.
    pub gyro_bias_std_rad_s: f64,
    /// Relative difference between the scales of the two gyroscopes, standard deviation.
    pub gyro_scale_std: f64,
    /// Misalignment between the axes of one gyroscope, standard deviation, rad.
    pub misalignment_rad: f64,
}

impl Default for AxisOptions {
    /// For units worn on the limbs of a person. Typical data sheets of micromechanical gyroscopes state 1 to 3 % for the
    /// scale, and 1 % across the axes.
    fn default() -> Self {
        Self {
            window_s: 0.1,
            correlation_s: 1.0,
            gyro_bias_std_rad_s: 0.005,
            gyro_scale_std: 0.02,
            misalignment_rad: 0.01,
        }
    }
}

/// The axis according to the nominal mounts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NominalAxis {
    /// In the axes of each unit, unit vectors that point the same way along the hinge.
    pub axes: [[f64; 3]; 2],
    /// Standard deviation of each about any axis normal to it, rad.
    pub std_rad: [f64; 2],
}

/// Axis of a hinge and its quality.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FoundAxis {
    /// In the first unit's sensor axes, unit vector, on the side of the nominal one.
    pub first: [f64; 3],
    /// The same axis in the second unit's axes.
    pub second: [f64; 3],
    /// Standard deviation of each direction, rad, along the transverse direction with the largest one.
    pub std_rad: [f64; 2],
    /// Information of the motion alone, without the prior, 1/rad2: of small changes of `first` and `second`, row by row.
    pub information: [[f64; 6]; 6],
    /// Its information vector, 1/rad: `information` times the change that the motion alone asks for.
    pub pull: [f64; 6],
    /// Robust standard deviation of the residuals, rad/s.
    pub residual_rad_s: f64,
    /// Root mean square of the residuals, rad/s: unlike the robust one, a rest dilutes it as it dilutes the two below.
    pub residual_rms_rad_s: f64,
    /// Root mean square of both bodies' angular velocities normal to the axis, rad/s.
    pub transverse_rad_s: f64,
    /// Root mean square of the relative angular velocity about the axis, rad/s.
    pub hinge_rad_s: f64,
    /// From -1 to 1: confidence that both vectors point the same way along the hinge. Near 0 the motion does not
    /// determine it; below 0 it contradicts the nominal mounts.
    pub sense: f64,
}

/// Estimates the axis.
///
/// # Errors
/// [`Error::Data`](crate::Error::Data) for malformed columns or no common stretch of time without gaps.
pub fn hinge_axis(
    units: [&Signals; 2],
    nominal: &NominalAxis,
    options: &AxisOptions,
    go_on: GoOn,
) -> Result<FoundAxis> {
    let windows = PairedWindows::new(units, options.window_s)?;
    let expected = nominal.axes.map(|axis| Vector3::from(axis).normalize());
    let problem = Axes { pairs: &windows.pairs, expected, prior_std: nominal.std_rad, options };
    let scatter = Scatter { least: 1e-5, rows_per_error: windows.within(options.correlation_s) };
    let found = fit_as_scattered(&problem, &problem.starts(), &scatter, OWN, go_on)?;
    Ok(problem.told(&found, &windows))
}

/// The axes stand first.
const OWN: usize = 4;
const BIASES: [usize; 2] = [4, 7];
const SCALE: usize = 10;
const UNKNOWNS: usize = 11;

#[derive(Debug, Clone)]
struct State {
    axes: [Vector3<f64>; 2],
    biases: [Vector3<f64>; 2],
    /// Of the second gyroscope against the first.
    scale: f64,
}

struct Axes<'a> {
    pairs: &'a [[Window; 2]],
    expected: [Vector3<f64>; 2],
    prior_std: [f64; 2],
    options: &'a AxisOptions,
}

impl Axes<'_> {
    /// The nominal axes, and those of the units.
    fn starts(&self) -> Vec<State> {
        let own = [Vector3::x(), Vector3::y(), Vector3::z()];
        let pairs = own.iter().flat_map(|a| own.iter().map(move |b| [*a, *b]));
        let state = |axes| State { axes, biases: [Vector3::zeros(); 2], scale: 0.0 };
        std::iter::once(self.expected).chain(pairs).map(state).collect()
    }

    /// Angular velocity of each body.
    fn rates(&self, pair: &[Window; 2], at: &State) -> [Vector3<f64>; 2] {
        [pair[0].rate - at.biases[0], (pair[1].rate - at.biases[1]) * (1.0 + at.scale)]
    }

    fn told(&self, found: &Fit<State>, windows: &PairedWindows) -> FoundAxis {
        let axes = found.state.axes;
        let covariance = found.estimate.covariance.fixed_view::<4, 4>(0, 0).into_owned();
        let transverse_std = |unit: usize| {
            let block: Matrix2<f64> = covariance.fixed_view::<2, 2>(2 * unit, 2 * unit).into_owned();
            SymmetricEigen::new(block).eigenvalues.max().max(0.0).sqrt()
        };
        let (information, pull) = self.motion_alone(found);
        let turning = |pair: &[Window; 2]| (axes[1].dot(&pair[1].rate) - axes[0].dot(&pair[0].rate)).powi(2);
        let transverse = |pair: &[Window; 2]| {
            let [one, two] = self.rates(pair, &found.state);
            (one.cross(&axes[0]).norm_squared() + two.cross(&axes[1]).norm_squared()) / 2.0
        };
        let rms = |squares: &dyn Fn(&[Window; 2]) -> f64| {
            (windows.pairs.iter().map(squares).sum::<f64>() / windows.pairs.len() as f64).sqrt()
        };
        FoundAxis {
            first: axes[0].into(),
            second: axes[1].into(),
            std_rad: [transverse_std(0), transverse_std(1)],
            information: std::array::from_fn(|i| std::array::from_fn(|j| information[(i, j)])),
            pull: std::array::from_fn(|i| pull[i]),
            residual_rad_s: found.spread,
            residual_rms_rad_s: self.errors(&found.state).norm() / (windows.pairs.len() as f64).sqrt(),
            transverse_rad_s: rms(&transverse),
            hinge_rad_s: rms(&turning),
            sense: sense(windows, axes),
        }
    }

    /// Information matrix and vector of both axes without their prior, in sensor axes. At the estimate both balance, so the
    /// vector is the prior's with the other sign.
    fn motion_alone(&self, found: &Fit<State>) -> (nalgebra::Matrix6<f64>, nalgebra::Vector6<f64>) {
        let (departure, std) = self.departure(&found.state);
        let prior = Matrix4::from_diagonal(&Vector4::from_fn(|k, _| std[k].powi(-2)));
        let formal: Matrix4<f64> = found.estimate.formal.fixed_view::<4, 4>(0, 0).into_owned();
        let pull = prior * departure.fixed_rows::<4>(0);
        let seen = formal.try_inverse().map_or(Matrix4::zeros(), |whole| whole - prior);
        let eigen = SymmetricEigen::new(seen);
        let rounded = eigen.eigenvectors
            * Matrix4::from_diagonal(&eigen.eigenvalues.map(|x| x.max(0.0)))
            * eigen.eigenvectors.transpose();
        // A misalignment of the sensor's own axes adds to the variance that the motion leaves.
        let misaligned = Matrix4::identity() + rounded * self.options.misalignment_rad.powi(2);
        let less = misaligned.try_inverse().unwrap_or_else(Matrix4::identity);
        let mut into = Matrix6x4::zeros();
        for unit in 0..2 {
            for (k, across) in transverse(&found.state.axes[unit]).iter().enumerate() {
                into.fixed_view_mut::<3, 1>(3 * unit, 2 * unit + k).copy_from(across);
            }
        }
        (into * less * rounded * into.transpose(), into * less * pull)
    }
}

impl Problem for Axes<'_> {
    type State = State;

    fn errors(&self, at: &State) -> DVector<f64> {
        let error = |pair: &[Window; 2]| {
            let [one, two] = self.rates(pair, at);
            one.cross(&at.axes[0]).norm() - two.cross(&at.axes[1]).norm()
        };
        DVector::from_iterator(self.pairs.len(), self.pairs.iter().map(error))
    }

    fn slopes(&self, at: &State) -> DMatrix<f64> {
        let mut slopes = DMatrix::zeros(self.pairs.len(), UNKNOWNS);
        let across = at.axes.map(|axis| transverse(&axis));
        let gains = [1.0, 1.0 + at.scale];
        for (row, pair) in self.pairs.iter().enumerate() {
            let rates = self.rates(pair, at);
            for (unit, sign) in [(0, 1.0), (1, -1.0)] {
                let off = rates[unit].cross(&at.axes[unit]);
                let direction = off.try_normalize(1e-9).unwrap_or_default();
                for (column, t) in across[unit].iter().enumerate() {
                    slopes[(row, 2 * unit + column)] = sign * direction.dot(&rates[unit].cross(t));
                }
                let by_bias = at.axes[unit].cross(&direction) * (-sign * gains[unit]);
                slopes.fixed_view_mut::<1, 3>(row, BIASES[unit]).copy_from(&by_bias.transpose());
            }
            slopes[(row, SCALE)] = -rates[1].cross(&at.axes[1]).norm() / gains[1];
        }
        slopes
    }

    fn plus(&self, at: &State, step: &DVector<f64>) -> State {
        let turned = |unit: usize| {
            let across = transverse(&at.axes[unit]);
            let turn = at.axes[unit].cross(&(across[0] * step[2 * unit] + across[1] * step[2 * unit + 1]));
            let axis = Rotation3::new(turn) * at.axes[unit];
            // Neither end of an axis differs in the readings: the nominal one's side.
            axis * 1_f64.copysign(axis.dot(&self.expected[unit]))
        };
        let bias = |unit: usize| at.biases[unit] + step.fixed_rows::<3>(BIASES[unit]);
        State { axes: [turned(0), turned(1)], biases: [bias(0), bias(1)], scale: at.scale + step[SCALE] }
    }

    fn departure(&self, at: &State) -> (DVector<f64>, DVector<f64>) {
        let mut departure = DVector::zeros(UNKNOWNS);
        let mut std = DVector::from_element(UNKNOWNS, self.options.gyro_bias_std_rad_s);
        for unit in 0..2 {
            let axis = at.axes[unit];
            let nominal = self.expected[unit] * 1_f64.copysign(axis.dot(&self.expected[unit]));
            let turn = Rotation3::rotation_between(&nominal, &axis).map_or(Vector3::zeros(), |r| r.scaled_axis());
            for (k, across) in transverse(&axis).iter().enumerate() {
                departure[2 * unit + k] = turn.cross(&axis).dot(across);
                std[2 * unit + k] = self.prior_std[unit];
            }
            departure.rows_mut(BIASES[unit], 3).copy_from(&at.biases[unit]);
        }
        departure[SCALE] = at.scale;
        std[SCALE] = self.options.gyro_scale_std;
        (departure, std)
    }
}

/// Two unit vectors normal to the axis and to each other; right-handed with it.
fn transverse(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let one = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    [one, axis.cross(&one)]
}

/// The component normal to the hinge rotates from one body to the other by the hinge's angle if both vectors point the
/// same way.
fn sense(windows: &PairedWindows, axes: [Vector3<f64>; 2]) -> f64 {
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
fn coherence(pairs: &[[Window; 2]], times: &[f64], axes: [Vector3<f64>; 2]) -> f64 {
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
