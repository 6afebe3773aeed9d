//! Going back over a body with balls: smoother, as sure as it says, and least squares where motions are small.

use super::chart::{away, moved, response, shifted, Square9, State};
use super::support::chance::Chance;
use super::support::chi_square::interval_999;
use super::support::nature::{error, nees, Nature};
use super::support::record::streams;
use super::support::tree::narrow;
use super::support::{body, fresh, model, plain, so3, start_std, worse};
use nalgebra::{DMatrix, DVector, SMatrix, Vector3};
use oarlock::body::Body;
use oarlock::config::Config;
use oarlock::model::Model;
use oarlock::recording::Sample;
use oarlock::track::hypothesis::Hypothesis;
use oarlock::track::run::{track, Run};
use oarlock::track::Calibration;
use std::sync::Arc;

const STEP_S: f64 = 0.01;

fn tracked(model: &Arc<Model>, body: &Body, config: &Config, samples: &[Sample], start: Hypothesis) -> Run {
    let (streams, nominal) = (streams(body, samples), Calibration::default());
    track(model.clone(), streams, &nominal, config, Some(start), &mut |_| true).unwrap()
}

/// How much of the filter's error the smoother may leave where a second of future is there: of values that are measured ten
/// times as well as they move, a good part; measured 0.2 to 0.6.
const LEFT: f64 = 0.9;
const RUNS: usize = 40;
const STEPS: usize = 120;

#[test]
fn smoothed_errors_are_smaller_and_as_large_as_said() {
    let model = model(&narrow());
    let config = Config { belief_interval_s: 0.4, ..plain(&["gyro_bias", "accel_bias", "surge", "heave"]) };
    let body = body(&model, &config);
    let (n, std) = (body.layout.dim(), start_std(&body));
    let part = body.layout.partition;
    let blocks = [
        ("poses", 0..part.pose),
        ("rates", part.pose..part.curved()),
        ("accelerations", part.curved()..part.curved() + part.rate),
    ];
    let (mut filtered2, mut smoothed2, mut sums) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for run in 0..RUNS {
        let mean = vec![0.0; n];
        let mut nature = Nature::about(&body, &mean, &std, Chance::new(4_000 + run as u64));
        let (mut truth, mut samples) = (Vec::new(), Vec::new());
        for k in 1..=STEPS {
            nature.live(STEP_S);
            samples.push(nature.read(k as f64 * STEP_S));
            truth.push(nature.state.clone());
        }
        let filtered = tracked(&model, &body, &config, &samples, fresh(&body, 0.0, mean, &std));
        let smooth = filtered.smooth(&mut |_| true).unwrap();
        let row = |run: &Run, k: usize| run.series.mean[k * n..(k + 1) * n].to_vec();
        assert_eq!(row(&smooth, STEPS - 1), row(&filtered, STEPS - 1), "the end is as it was");
        for (k, truth) in truth.iter().enumerate().take(STEPS - 20) {
            let errors = [&filtered, &smooth].map(|run| error(&body, &row(run, k), truth));
            for (b, (_, block)) in blocks.iter().enumerate() {
                filtered2[b] += errors[0].rows(block.start, block.len()).norm_squared();
                smoothed2[b] += errors[1].rows(block.start, block.len()).norm_squared();
            }
        }
        assert_eq!(smooth.beliefs().count(), 3);
        for (sum, belief) in sums.iter_mut().zip(smooth.beliefs()) {
            let k = (belief.time_s / STEP_S).round() as usize - 1;
            *sum += nees(&body, &belief, &truth[k]);
        }
    }
    for (b, (name, _)) in blocks.iter().enumerate() {
        let left = (smoothed2[b] / filtered2[b]).sqrt();
        println!("{name}: smoothing leaves {left:.3} of the error");
        assert!(left < LEFT, "{name}: {left}");
    }
    let (low, high) = interval_999(RUNS * n);
    for sum in sums {
        let each = |x: f64| x / (RUNS * n) as f64;
        println!("smoothed NEES {:.4} each, bounds {:.4} to {:.4}", each(sum), each(low), each(high));
        assert!(low < sum && sum < high, "{sum}");
    }
}

const BALL: &str = r#"
format = 1
name = "ball"
joint = [
    { name = "b", kind = "ball",
      process = { kind = "singer", density = 0.05, start_std = [0.002, 0.005, 0.02], time_s = 0.5 } },
]
frame = [
    { name = "f", parent = "root", transform = {}, joint = "b" },
]
sensor = [
    { name = "s", kind = "imu", frame = "f", gyro_std_rad_s = 0.002, accel_std_m_s2 = 0.03, mag_std_ut = 0.2 },
]
[world]
up = [0, 0, 1]
forward = [1, 0, 0]
magnetic_norm_ut = 50
magnetic_dip_rad = 1
azimuth_fixed = true
"#;
const TAU: f64 = 0.5;
const DENSITY: f64 = 0.05;
const NOISE: [f64; 3] = [0.002, 0.03, 0.2];

/// What the singer's noise gathers in a step from `x`, by Simpson's rule, in the tangent space behind it.
fn noise(x: &State) -> Square9 {
    let mut q = SMatrix::<f64, 3, 3>::zeros();
    let pieces = 400;
    for k in 0..=pieces {
        let weight = if k == 0 || k == pieces { 1.0 } else { 2.0 + 2.0 * f64::from(k % 2 == 1) };
        let g = Vector3::from(response(TAU, STEP_S * f64::from(k) / f64::from(pieces)));
        q += g * g.transpose() * (weight * STEP_S / (3.0 * f64::from(pieces)) * DENSITY * DENSITY);
    }
    let gathered = Square9::from_fn(|i, j| if i % 3 == j % 3 { q[(i / 3, j / 3)] } else { 0.0 });
    let phi = so3::three(x.as_slice(), 3) * STEP_S + so3::three(x.as_slice(), 6) * response(TAU, STEP_S)[0];
    let mut out = Square9::identity();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&so3::right_jacobian(phi));
    out * gathered * out.transpose()
}

/// Turn rate, what holds the unit up, and the field, each seen from the unit.
fn readings(x: &State) -> State {
    let back = so3::exp(so3::three(x.as_slice(), 0)).transpose();
    let field = Vector3::new(1.0_f64.cos(), 0.0, -1.0_f64.sin()) * 50.0;
    let parts = [so3::three(x.as_slice(), 3), back * Vector3::new(0.0, 0.0, 9.80665), back * field];
    State::from_fn(|i, _| parts[i / 3][i % 3])
}

/// Derivative of a map from states to nine numbers, given how its values differ.
fn slope(f: impl Fn(&State) -> State, minus: impl Fn(&State, &State) -> State, x: &State) -> Square9 {
    let (h, here) = (1e-5, f(x));
    let mut out = Square9::zeros();
    for k in 0..9 {
        let step = State::from_fn(|i, _| if i == k { h } else { 0.0 });
        let [up, down] = [step, -step].map(|d| minus(&f(&shifted(x, &d)), &here));
        out.set_column(k, &((up - down) / (2.0 * h)));
    }
    out
}

/// All states at once by Gauss and Newton: prior, motion and readings as one least-squares problem, whitened and solved by
/// orthogonal triangles. Returns the states and their covariances.
fn batch(start: &State, std: &[f64], samples: &[Sample]) -> (Vec<State>, DMatrix<f64>) {
    let count = samples.len() + 1;
    let mut states: Vec<State> =
        std::iter::successors(Some(*start), |x| Some(moved(x, TAU, STEP_S))).take(count).collect();
    let prior = Square9::from_diagonal(&State::from_fn(|i, _| 1.0 / std[i]));
    let weight = Square9::from_diagonal(&State::from_fn(|i, _| 1.0 / NOISE[i / 3]));
    let mut covariance = DMatrix::zeros(0, 0);
    for _ in 0..6 {
        let rows = 9 * (2 * count - 1);
        let (mut design, mut wanted) = (DMatrix::zeros(rows, 9 * count), DVector::zeros(rows));
        let mut put = |row: usize, at: usize, slope: &Square9, residual: Option<State>| {
            design.view_mut((9 * row, 9 * at), (9, 9)).copy_from(slope);
            residual.iter().for_each(|r| wanted.rows_mut(9 * row, 9).copy_from(r));
        };
        let seen = |x: &State| away(start, x);
        put(0, 0, &(prior * -slope(seen, |a, b| a - b, &states[0])), Some(prior * seen(&states[0])));
        for (k, sample) in samples.iter().enumerate() {
            let (now, next) = (states[k], states[k + 1]);
            let half = noise(&now).cholesky().expect("positive").l().try_inverse().expect("a triangle");
            let gap = |a: &State, b: &State| away(a, &moved(b, TAU, STEP_S));
            let minus = |a: &State, b: &State| a - b;
            put(2 * k + 1, k, &(half * slope(|x| gap(&next, x), minus, &now)), Some(half * -gap(&next, &now)));
            put(2 * k + 1, k + 1, &(half * slope(|x| gap(x, &now), minus, &next)), None);
            let missed = State::from_row_slice(&sample.z) - readings(&next);
            put(2 * k + 2, k + 1, &(weight * slope(readings, minus, &next)), Some(weight * missed));
        }
        let qr = design.qr();
        let (right, triangle) = (qr.q().transpose() * wanted, qr.r());
        let step = triangle.solve_upper_triangular(&right).expect("every state is known");
        let one = DMatrix::identity(9 * count, 9 * count);
        let inverse = triangle.solve_upper_triangular(&one).expect("every state is known");
        covariance = &inverse * inverse.transpose();
        for (k, state) in states.iter_mut().enumerate() {
            *state = shifted(state, &State::from_row_slice(step.rows(9 * k, 9).as_slice()));
        }
    }
    (states, covariance)
}

/// Errors of 2 mrad bend what is read by that share of them; the filter sees it through its sigma points, least squares does
/// not. Ten times larger errors were ten times farther apart.
const SMALL_ERRORS_SIGMA: f64 = 5e-3;

#[test]
fn small_errors_are_smoothed_to_least_squares() {
    assert_least_squares("nearly at rest", [0.0; 9]);
    // A turn of 3 degrees in every step, from any posture: what is small is how little is known, not the motion.
    assert_least_squares("spinning", [2.5, -0.8, 0.6, 3.0, -2.0, 4.0, 5.0, 10.0, -8.0]);
}

fn assert_least_squares(what: &str, start: [f64; 9]) {
    let found = Compared::new(start);
    println!("{what}: {found:?}");
    assert!(found.mean < SMALL_ERRORS_SIGMA && found.bands < SMALL_ERRORS_SIGMA, "{found:?}");
    assert!(found.filtered > 0.5, "smoothing did nothing: {found:?}");
}

/// Largest differences from least squares in 40 samples, in its standard deviations.
#[derive(Debug)]
struct Compared {
    mean: f64,
    bands: f64,
    /// Of the filter's mean.
    filtered: f64,
}

impl Compared {
    fn new(start: [f64; 9]) -> Self {
        let model = model(BALL);
        let config = plain(&[]);
        let body = body(&model, &config);
        let mut std = start_std(&body);
        std[..3].fill(0.002);
        let mut nature = Nature::about(&body, &start, &std, Chance::new(31));
        let mut samples = Vec::new();
        for k in 1..=40 {
            nature.live(STEP_S);
            samples.push(nature.read(k as f64 * STEP_S));
        }
        let filtered = tracked(&model, &body, &config, &samples, fresh(&body, 0.0, start.to_vec(), &std));
        let smooth = filtered.smooth(&mut |_| true).unwrap();
        let (states, covariance) = batch(&State::from(start), &std, &samples);
        let mut found = Compared { mean: 0.0, bands: 0.0, filtered: 0.0 };
        for k in 0..samples.len() {
            let row = |run: &Run| State::from_row_slice(&run.series.mean[9 * k..9 * (k + 1)]);
            for i in 0..9 {
                let at = 9 * (k + 1) + i;
                let sigma = covariance[(at, at)].sqrt();
                found.mean = worse(found.mean, away(&row(&smooth), &states[k + 1])[i].abs() / sigma);
                found.filtered = worse(found.filtered, away(&row(&filtered), &states[k + 1])[i].abs() / sigma);
                found.bands = worse(found.bands, (smooth.series.std[9 * k + i] / sigma - 1.0).abs());
            }
        }
        found
    }
}
