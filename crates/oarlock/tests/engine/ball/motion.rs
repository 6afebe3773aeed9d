//! How a ball moves by itself: against derivatives of the exact retraction, quadrature, and a fine integration.

use super::chart::{away, moved, response, shifted, Square9, State};
use super::support::chance::Chance;
use super::support::{belief, body, model, plain, so3, start_std, worse};
use nalgebra::{DMatrix, Matrix3, SMatrix, Vector3};
use oarlock::body::Body;
use oarlock::estimate::belief::Belief;
use oarlock::estimate::transition::Transition;
use oarlock::estimate::System;
use oarlock::kernels::arch::Arch;
use oarlock::kernels::dense::Square;
use oarlock::motion::is_turn_observed;

/// A single ball with an inertial unit; `process` is its motion.
fn ball(process: &str, more: &str) -> Body {
    let text = format!(
        "format = 1\nname = \"ball\"\n[world]\nup = [0, 0, 1]\nforward = [1, 0, 0]\n\
         [[joint]]\nname = \"b\"\nkind = \"ball\"\nprocess = {{ {process} }}\n{more}\n\
         [[frame]]\nname = \"f\"\nparent = \"root\"\ntransform = {{}}\njoint = \"b\"\n\
         [[sensor]]\nname = \"s\"\nkind = \"imu\"\nframe = \"f\"\ngyro_std_rad_s = 0.01\naccel_std_m_s2 = 0.1\n"
    );
    body(&model(&text), &plain(&[]))
}

const DENSITY: f64 = 3.0;
const JERK: &str = "kind = \"jerk\", density = 3, start_std = [0.1, 0.5, 2]";
const SINGER: &str = "kind = \"singer\", density = 3, start_std = [0.1, 0.5, 2], time_s = 0.3";
const TAU: f64 = 0.3;

/// The engine's motion over `t`: mean, F and Q.
fn engine(body: &Body, x: &State, t: f64) -> (State, Square9, Square9) {
    let mut transition = Transition::default();
    body.transition(t, x.as_slice(), &[1e-6; 9], &mut transition);
    let mut mean = x.as_slice().to_vec();
    transition.apply_to_mean(&mut mean);
    let (mut f, mut q) = (Square9::identity().as_slice().to_vec(), Square::zeros(9));
    transition.apply_to_rows(Arch::best(), &mut f, 9);
    transition.apply_to_covariance(Arch::best(), &mut q);
    let [f, q] = [&f, q.as_slice()].map(Square9::from_row_slice);
    assert_transposed(&transition, &f.transpose(), &q);
    (State::from_row_slice(&mean), f, q)
}

/// The same of a ball that counts as not observed: mean and F.
fn held(body: &Body, x: &State, t: f64) -> (State, Square9) {
    let mut transition = Transition::default();
    body.transition(t, x.as_slice(), &[10.0; 9], &mut transition);
    let mut mean = x.as_slice().to_vec();
    transition.apply_to_mean(&mut mean);
    let mut f = Square9::identity().as_slice().to_vec();
    transition.apply_to_rows(Arch::best(), &mut f, 9);
    (State::from_row_slice(&mean), Square9::from_row_slice(&f))
}

/// The start's fit needs F' x and v' Q v of the same motion.
fn assert_transposed(transition: &Transition, transposed: &Square9, q: &Square9) {
    let v = State::from_fn(|i, _| (1.0 + i as f64).sin());
    let mut x = v.as_slice().to_vec();
    transition.apply_transposed(&mut x);
    assert!((State::from_row_slice(&x) - transposed * v).amax() < 1e-13);
    let along = v.dot(&(q * v));
    assert!((transition.noise_along(v.as_slice()) / along - 1.0).abs() < 1e-12);
}

/// States from slow to wild, and rotations up to half a turn.
fn states() -> Vec<State> {
    let mut chance = Chance::new(4);
    let sizes = [[0.0, 0.0, 0.0], [1e-9, 1e-8, 1e-7], [1e-4, 1e-3, 1e-2], [0.5, 1.0, 10.0], [2.0, 8.0, 60.0]];
    let mut states = Vec::new();
    for size in sizes.into_iter().chain([[3.1, 5.0, 20.0], [std::f64::consts::PI, 12.0, 100.0]]) {
        for _ in 0..5 {
            let part = |i: usize, chance: &mut Chance| Vector3::from_vec(chance.normals(3)).normalize() * size[i];
            let parts = [0, 1, 2].map(|i| part(i, &mut chance));
            states.push(State::from_fn(|i, _| parts[i / 3][i % 3]));
        }
    }
    states
}

const CASES: [(&str, f64); 2] = [(JERK, f64::INFINITY), (SINGER, TAU)];

/// Central differences of 1e-5 of a map with derivatives near one.
const SLOPE: f64 = 1e-9;
/// The same of a chart whose third derivatives reach 10, far from its origin.
const HELD_SLOPE: f64 = 1e-8;

#[test]
fn derivative_is_that_of_the_exact_retraction() {
    let (mut means, mut slopes) = (0.0, 0.0);
    for (process, tau) in CASES {
        let body = ball(process, "");
        for x in states() {
            for t in [1e-4, 0.01, 0.1] {
                let (mean, f, _) = engine(&body, &x, t);
                let wanted = moved(&x, tau, t);
                means = worse(means, away(&mean, &wanted).amax());
                let h = 1e-5;
                for k in 0..9 {
                    let step = State::from_fn(|i, _| if i == k { h } else { 0.0 });
                    let ends = [step, -step].map(|d| away(&moved(&shifted(&x, &d), tau, t), &wanted));
                    slopes = worse(slopes, ((ends[0] - ends[1]) / (2.0 * h) - f.column(k)).amax());
                }
            }
        }
    }
    println!("ball's motion: mean {means:.1e}, derivative {slopes:.1e}");
    assert!(means < 1e-12 && slopes < SLOPE);
}

/// Simpson's rule with 200 pieces of a polynomial of fourth degree, or nearly that.
const QUADRATURE: f64 = 1e-8;

#[test]
fn noise_is_the_integral_of_its_pushes() {
    let mut worst = 0.0;
    for (process, tau) in CASES {
        let body = ball(process, "");
        for x in states() {
            for t in [1e-4, 0.01, 0.1] {
                let (_, _, q) = engine(&body, &x, t);
                let phi = x.fixed_rows::<3>(3) * t + x.fixed_rows::<3>(6) * response(tau, t)[0];
                let out = so3::right_jacobian(phi);
                let mut wanted = Square9::zeros();
                let pieces = 200;
                for k in 0..=pieces {
                    let ends = k == 0 || k == pieces;
                    let weight =
                        if ends { 1.0 } else { 2.0 + 2.0 * f64::from(k % 2 == 1) } * t / (3.0 * f64::from(pieces));
                    let [p, v, a] = response(tau, t * f64::from(k) / f64::from(pieces));
                    let mut push = SMatrix::<f64, 9, 3>::zeros();
                    push.fixed_view_mut::<3, 3>(0, 0).copy_from(&(out * p));
                    push.fixed_view_mut::<3, 3>(3, 0).fill_diagonal(v);
                    push.fixed_view_mut::<3, 3>(6, 0).fill_diagonal(a);
                    wanted += push * push.transpose() * (weight * DENSITY * DENSITY);
                }
                let sigma = wanted.diagonal().map(f64::sqrt);
                let scaled = |m: &Square9| Square9::from_fn(|i, j| m[(i, j)] / (sigma[i] * sigma[j]));
                worst = worse(worst, (scaled(&q) - scaled(&wanted)).amax());
            }
        }
    }
    println!("ball's noise against quadrature: {worst:.1e}");
    assert!(worst < QUADRATURE, "{worst:e}");
}

/// The true linearised motion, e' = -w x e + dw: half a second in steps of 0.1 ms, rates in the child's axes.
fn finely(x: State, p: Square9, tau: f64, time_s: f64) -> (State, Square9) {
    let (h, mut x, mut p) = (1e-4, x, p);
    for _ in 0..(time_s / h).round() as usize {
        // To second order in h, with the rate in the middle.
        let middle = x.fixed_rows::<3>(3) + x.fixed_rows::<3>(6) * (0.5 * h);
        let mut f = Square9::identity();
        f.fixed_view_mut::<3, 3>(0, 0).copy_from(&so3::exp(-middle * h));
        let [push, rate, keep] = response(tau, h);
        f.fixed_view_mut::<3, 3>(0, 3).copy_from(&(so3::right_jacobian(middle * h) * h));
        f.fixed_view_mut::<3, 3>(0, 6).fill_diagonal(push);
        f.fixed_view_mut::<3, 3>(3, 6).fill_diagonal(rate);
        f.fixed_view_mut::<3, 3>(6, 6).fill_diagonal(keep);
        x = moved(&x, tau, h);
        p = f * p * f.transpose();
        (6..9).for_each(|i| p[(i, i)] += DENSITY * DENSITY * h);
    }
    (x, p)
}

/// Over a step of 10 ms a push of the acceleration is turned by up to w T in the meantime; the chart turns it by half of that
/// instead of a third. At 5 rad/s that is 0.8 % of what one step adds, and the rates' own error outweighs it.
const FINE_COVARIANCE: f64 = 5e-3;
/// The chart leaves out w x wd T^3 / 12 of each step: 5 rad/s x 20 rad/s2 over 50 steps is 0.4 mrad.
const FINE_MEAN_RAD: f64 = 5e-4;

#[test]
fn prediction_is_that_of_a_fine_integration() {
    let (mut means, mut covariances) = (0.0, 0.0);
    for (process, tau) in CASES {
        let body = ball(process, "");
        let mut chance = Chance::new(6);
        for _ in 0..6 {
            let sizes = [2.0, 3.0, 12.0];
            let x = State::from_fn(|i, _| sizes[i / 3] * chance.between(-1.0, 1.0));
            let start = Square9::from_diagonal(&State::from_fn(|i, _| [0.02_f64, 0.1, 0.5][i / 3].powi(2)));
            let (mut mean, mut p) = (x, start);
            for _ in 0..50 {
                let (next, f, q) = engine(&body, &mean, 0.01);
                (mean, p) = (next, f * p * f.transpose() + q);
            }
            let (wanted, fine) = finely(x, start, tau, 0.5);
            means = worse(means, away(&mean, &wanted).amax());
            let sigma = fine.diagonal().map(f64::sqrt);
            let gap = Square9::from_fn(|i, j| (p[(i, j)] - fine[(i, j)]) / (sigma[i] * sigma[j]));
            covariances = worse(covariances, gap.amax());
        }
    }
    println!("half a second of prediction: mean {means:.1e} rad, covariance {covariances:.1e} sigma sigma");
    assert!(means < FINE_MEAN_RAD && covariances < FINE_COVARIANCE);
}

/// Lets a belief go its way without readings.
fn coast(body: &Body, start: Belief, step: f64, steps: usize) -> Belief {
    let (n, mut belief) = (start.mean.len(), start);
    let mut transition = Transition::default();
    let mut variance = vec![0.0; n];
    for _ in 0..steps {
        belief.covariance.diagonal(&mut variance);
        body.transition(step, &belief.mean, &variance, &mut transition);
        transition.apply_to_mean(&mut belief.mean);
        transition.apply_to_covariance(Arch::best(), &mut belief.covariance);
    }
    belief
}

/// What is left after 200 s of a spring with a time constant below 1 s: rounding.
const SETTLED: f64 = 1e-9;

/// A ball that nothing observes comes to rest at its prior, from anywhere.
#[test]
fn held_ball_settles_at_its_prior() {
    let cone = "limits = { axis = \"y\", swing = [0.8, 1.6], twist = [-0.4, 1.0] }";
    for (limits, prior) in [("limits = [-1.2, 1.2]", [0.6; 3]), (cone, [0.4, 0.35, 0.8])] {
        for process in [JERK, SINGER] {
            assert_settled(&ball(process, &format!("rest = [0.3, -0.8, 0.5]\n{limits}")), prior);
        }
    }
}

fn assert_settled(body: &Body, prior: [f64; 3]) {
    let rest = Vector3::new(0.3, -0.8, 0.5);
    let mut chance = Chance::new(12);
    for k in 0..12 {
        let away = Vector3::from_vec(chance.normals(3)).normalize() * (0.25 * f64::from(k));
        let mut mean = chance.normals(9);
        mean[..3].copy_from_slice(so3::plus(rest, away).as_slice());
        let settled = coast(body, belief(body, 0.0, mean, &start_std(body)), 0.05, 4_000);
        let gap = so3::minus(so3::three(&settled.mean, 0), rest).norm();
        let spread = |i: usize| settled.covariance.at(i, i).sqrt();
        let shares = [0, 1, 2].map(|i| spread(i) / prior[i]);
        assert!(gap < SETTLED, "{gap} rad from rest");
        assert!(shares.iter().all(|s| (s - 1.0).abs() < SETTLED), "{shares:?}");
        let n = settled.mean.len();
        let p = DMatrix::from_row_slice(n, n, settled.covariance.as_slice());
        assert!(p.cholesky().is_some(), "the covariance kept its sign");
        assert!(settled.mean[3..].iter().all(|x| x.abs() < SETTLED), "{:?}", settled.mean);
    }
}

/// Motion with a spring for each direction: matrix exponentials in the chart at the rest.
fn sprung(x: &State, rest: Vector3<f64>, prior: [f64; 3], t: f64) -> State {
    let chart = so3::minus(x.fixed_rows::<3>(0).into(), rest);
    let mut out = State::zeros();
    for k in 0..3 {
        // White jerk d against a triple pole p has the variance 3 d^2 / (16 p^5).
        let p = (3.0 * DENSITY * DENSITY / (16.0 * prior[k] * prior[k])).powf(0.2);
        let a = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, -p * p * p, -3.0 * p * p, -3.0 * p);
        let next = (a * t).exp() * Vector3::new(chart[k], x[3 + k], x[6 + k]);
        (0..3).for_each(|i| out[3 * i + k] = next[i]);
    }
    let turned = so3::plus(rest, out.fixed_rows::<3>(0).into());
    out.fixed_rows_mut::<3>(0).copy_from(&turned);
    out
}

/// A ball with a cone that nothing observes: each direction has its own spring, and the derivatives are exact.
#[test]
fn held_motion_is_that_of_a_spring_in_each_direction() {
    let (rest, prior) = (Vector3::new(0.3, -0.8, 0.5), [0.8, 0.35, 0.4]);
    let cone = "limits = { axis = \"y\", swing = [1.6, 0.8], twist = [-0.4, 1.0] }";
    let body = ball(JERK, &format!("rest = [0.3, -0.8, 0.5]\n{cone}"));
    let (mut means, mut slopes) = (0.0, 0.0);
    for x in states().into_iter().filter(|x| x.fixed_rows::<3>(0).norm() < 2.1) {
        for t in [1e-3, 0.02, 0.1] {
            let (mean, f) = held(&body, &x, t);
            let wanted = sprung(&x, rest, prior, t);
            means = worse(means, away(&mean, &wanted).amax());
            let h = 1e-5;
            for k in 0..9 {
                let step = State::from_fn(|i, _| if i == k { h } else { 0.0 });
                let ends = [step, -step].map(|d| away(&sprung(&shifted(&x, &d), rest, prior, t), &wanted));
                slopes = worse(slopes, ((ends[0] - ends[1]) / (2.0 * h) - f.column(k)).amax());
            }
        }
    }
    println!("held ball's motion: mean {means:.1e}, derivative {slopes:.1e}");
    assert!(means < 1e-11 && slopes < HELD_SLOPE);
}

/// Whether the prior acts depends on each direction's own range.
#[test]
fn narrow_directions_count_by_their_own_range() {
    let cone = "limits = { axis = \"z\", swing = 1.6, twist = [-0.2, 0.2] }";
    let observed = |limits: &str, variance: [f64; 3]| is_turn_observed(&ball(JERK, limits).axes, &variance);
    // A twist that is known to 0.09 rad is hardly known beside its prior of 0.1 rad; a swing is, beside 0.8 rad.
    assert!(!observed(cone, [1e-4, 1e-4, 0.0081]) && observed(cone, [0.0081, 1e-4, 1e-4]));
    assert!(observed("limits = [-1.6, 1.6]", [1e-4, 1e-4, 0.0081]));
}
