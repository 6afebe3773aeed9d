//! Motion models of states: white jerk, decaying accelerations, random walks, and the spring that keeps unobserved
//! joints near their prior.

use crate::config::ProcessNoise;
use crate::estimate::transition::{Block, Transition, Turning};
use crate::model::{Axis, BaseAcceleration, ProcessKind};
use crate::rotation::turn::{left_jacobian_inverse, minus, plus, right_jacobian, right_jacobian_inverse};
use crate::sensor::SlowError;
use crate::state::{PushSlot, Slots};

/// A joint with a standard deviation above this share of its prior's counts as not observed and is kept near its prior.
pub const HELD_SHARE: f64 = 0.8;

/// Whether a coordinate with this variance counts as observed.
pub fn is_observed(axis: &Axis, variance: f64) -> bool {
    variance.sqrt() < HELD_SHARE * axis.prior_std()
}

/// Whether the prior acts on a coordinate: on one that is not observed. A body that travels has a prior of its velocity.
pub fn is_held(axis: &Axis, slots: Slots, variance: &[f64]) -> bool {
    match slots.rates {
        Some((rate, _)) if axis.travels => variance[rate].sqrt() >= HELD_SHARE * prior_speed(axis),
        _ => !is_observed(axis, variance[slots.q]),
    }
}

/// Whether a rotation vector with these variances counts as observed: their sum, each relative to its own prior.
pub fn is_turn_observed(axes: &[Axis], variance: &[f64]) -> bool {
    let prior = axes[0].prior_std();
    // The ratio of equal priors is exactly one.
    let relative = axes.iter().zip(variance).map(|(axis, v)| v * (prior / axis.prior_std()).powi(2));
    is_observed(&axes[0], relative.sum())
}

/// Input of a motion model: time step and state of a coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Now {
    /// Time step, s.
    pub dt: f64,
    /// Whether it counts as not observed, so that its prior acts on it.
    pub held: bool,
}

/// Motion of one coordinate.
pub fn joint_block(axis: &Axis, slots: Slots, now: Now, noise: ProcessNoise) -> Block {
    let Now { dt, held, .. } = now;
    let density2 = axis.process.density * axis.process.density;
    let Some((rate, accel)) = slots.rates else {
        return if held { held_walk(slots.q, axis, density2, dt) } else { Block::walk(slots.q, density2 * dt) };
    };
    let index = [slots.q, rate, accel];
    if held {
        let block = if axis.travels { held_speed } else { held_jerk };
        return block(index, axis, density2, dt);
    }
    let mut block = Block { index, len: 3, factor: coasting(dt), offset: [0.0; 3], noise: [[0.0; 3]; 3] };
    block.noise = match (axis.process.kind, noise) {
        (ProcessKind::Singer, _) => {
            let tau = axis.process.time_s;
            block.factor = decaying(tau, dt);
            let mut noise = gathered(dt, |t| response(tau, t));
            // In a step of many times tau all points of the quadrature lie where the acceleration has decayed.
            noise[2][2] = noise[2][2].max(if dt > 20.0 * tau { 0.5 * tau } else { 0.0 });
            noise.map(|row| row.map(|x| x * density2))
        }
        (_, ProcessNoise::Jerk) => white_jerk(dt).map(|row| row.map(|x| x * density2 * dt)),
        (_, ProcessNoise::Paper) => printed(dt).map(|row| row.map(|x| x * density2 * dt)),
    };
    block
}

/// Motion of a rotation vector. Its three coordinates move independently in a chart, and the chart's derivatives
/// convert to it and back. The chart is at the rotation itself, R Exp(phi) with the rotation phi during the step, so
/// that the error becomes Jr(phi) (Jl(phi)^-1 e + d phi). For an unobserved joint the chart is at its rest.
pub fn push_turn(axes: &[Axis], slots: Slots, mean: &[f64], now: Now, noise: ProcessNoise, out: &mut Transition) {
    let index = [slots.q, slots.q + 1, slots.q + 2];
    let block = |i: usize| {
        let own = Slots { q: slots.q + i, rates: slots.rates.map(|(rate, accel)| (rate + i, accel + i)) };
        // The chart's origin is the rest.
        joint_block(&Axis { rest: 0.0, ..axes[i] }, own, now, noise)
    };
    let blocks = [0, 1, 2].map(block);
    let r = index.map(|i| mean[i]);
    let rest = [axes[0].rest, axes[1].rest, axes[2].rest];
    let held = now.held;
    let (anchor, chart) = if held { (rest, minus(r, rest)) } else { (r, [0.0; 3]) };
    let moved = [0, 1, 2].map(|k| {
        let b = &blocks[k];
        let rates = slots.rates.map_or([0.0; 2], |(rate, accel)| [mean[rate + k], mean[accel + k]]);
        b.factor[0][0] * chart[k] + b.factor[0][1] * rates[0] + b.factor[0][2] * rates[1]
    });
    let before = if held { right_jacobian_inverse(chart) } else { left_jacobian_inverse(moved) };
    let turning = Turning {
        chart,
        value: plus(anchor, moved),
        before: Block::linear(index, before.0),
        after: Block::linear(index, right_jacobian(moved).0),
    };
    out.turnings.push(turning);
    out.blocks.extend(blocks);
}

/// A base acceleration that decays or is a random walk: a' = -a / time_s + r. The rate r is white noise or, with a rise
/// time, white noise through a lag of `rise_s`.
pub fn base_block(base: &BaseAcceleration, slot: PushSlot, dt: f64) -> Block {
    let (density2, alpha) = (base.density * base.density, 1.0 / base.time_s);
    let keep = (-alpha * dt).exp();
    let Some(rate) = slot.rate else {
        let mut block = Block::walk(slot.state, density2 * faded(2.0 * alpha, dt));
        block.factor[0][0] = keep;
        return block;
    };
    let beta = 1.0 / base.rise_s;
    let mut block = Block { index: [slot.state, rate, rate], len: 2, ..Block::walk(slot.state, 0.0) };
    block.factor = [[keep, risen(alpha, beta, dt), 0.0], [0.0, (-beta * dt).exp(), 0.0], [0.0; 3]];
    let unit = rising_noise(alpha, beta, dt);
    block.noise = unit.map(|row| row.map(|x| x * density2 * beta * beta));
    block
}

/// Motion of one axis of a sensor's slow error over `dt`: a random walk or a decay.
pub fn error_block(error: &SlowError, state: usize, dt: f64) -> Block {
    let (variance, rate) = (error.walk * error.walk, 1.0 / error.time_s);
    let mut block = Block::walk(state, variance * faded(2.0 * rate, dt));
    block.factor[0][0] = (-rate * dt).exp();
    block
}

/// Integral of exp(-k s) over `t`.
fn faded(k: f64, t: f64) -> f64 {
    if k == 0.0 {
        t
    } else {
        -(-k * t).exp_m1() / k
    }
}

/// Response after `t` of an acceleration with decay rate `alpha` to an initial unit rate with decay rate `beta`.
fn risen(alpha: f64, beta: f64, t: f64) -> f64 {
    (-alpha * t).exp() * faded(beta - alpha, t)
}

/// Covariance of acceleration and rate after `t` with unit white noise on the rate.
fn rising_noise(alpha: f64, beta: f64, t: f64) -> [[f64; 3]; 3] {
    if beta * t < 0.5 {
        // The closed form is inaccurate here.
        return gathered(t, |s| [risen(alpha, beta, s), (-beta * s).exp(), 0.0]);
    }
    let (slow, both, fast) = (faded(2.0 * alpha, t), faded(alpha + beta, t), faded(2.0 * beta, t));
    let perturbed = beta - alpha;
    let cross = (both - fast) / perturbed;
    [[(slow - 2.0 * both + fast) / (perturbed * perturbed), cross, 0.0], [cross, fast, 0.0], [0.0; 3]]
}

/// Constant acceleration.
fn coasting(t: f64) -> [[f64; 3]; 3] {
    [[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]]
}

/// Response of value, rate and acceleration after `t` to a unit impulse of the acceleration, which decays with `tau`
/// (Singer 1970).
fn response(tau: f64, t: f64) -> [f64; 3] {
    let x = t / tau;
    if x < 1e-3 {
        // The closed form is inaccurate here.
        return [t * t * (0.5 - x / 6.0 + x * x / 24.0), t * (1.0 - x / 2.0 + x * x / 6.0), (-x).exp()];
    }
    let lost = -(-x).exp_m1();
    [tau * tau * (x - lost), tau * lost, 1.0 - lost]
}

fn decaying(tau: f64, t: f64) -> [[f64; 3]; 3] {
    let [p, v, a] = response(tau, t);
    [[1.0, t, p], [0.0, 1.0, v], [0.0, 0.0, a]]
}

/// Gauss-Legendre abscissae and weights on [0, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// Covariance after `t` under unit white noise with impulse response `response`, by Gauss quadrature: a sum of squares,
/// where closed forms cancel.
fn gathered(t: f64, response: impl Fn(f64) -> [f64; 3]) -> [[f64; 3]; 3] {
    let mut sum = [[0.0; 3]; 3];
    for (x, weight) in GAUSS {
        let g = response(x * t);
        for (row, a) in sum.iter_mut().zip(g) {
            row.iter_mut().zip(g).for_each(|(s, b)| *s += weight * t * a * b);
        }
    }
    sum
}

/// White-noise jerk (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.3), scaled so that 1 is the rms increment of the
/// acceleration over `dt`.
fn white_jerk(t: f64) -> [[f64; 3]; 3] {
    let (t2, t3, t4) = (t * t, t * t * t, t * t * t * t);
    [[t4 / 20.0, t3 / 8.0, t2 / 6.0], [t3 / 8.0, t2 / 3.0, t / 2.0], [t2 / 6.0, t / 2.0, 1.0]]
}

/// Eq. 6 of Ruffaldi, Peppoloni and Filippeschi. Its misprinted row is read as G G' with G = [T^2/2, T, 1].
fn printed(t: f64) -> [[f64; 3]; 3] {
    let g = [0.5 * t * t, t, 1.0];
    g.map(|a| g.map(|b| a * b))
}

/// The same white jerk with a critically damped spring (triple pole). Its stationary distribution is the joint's prior:
/// mean `rest`, standard deviation `prior_std`. Exact for any dt.
fn held_jerk(index: [usize; 3], axis: &Axis, density2: f64, dt: f64) -> Block {
    let s2 = axis.prior_std() * axis.prior_std();
    let pole = held_pole(axis, density2);
    let factor = triple_pole(pole, dt);
    let (l2, l4) = (pole * pole, pole.powi(4));
    let settled = [[s2, 0.0, -s2 * l2 / 3.0], [0.0, s2 * l2 / 3.0, 0.0], [-s2 * l2 / 3.0, 0.0, s2 * l4]];
    let offset = [0, 1, 2].map(|r| axis.rest * (f64::from(r == 0) - factor[r as usize][0]));
    Block { index, len: 3, factor, offset, noise: driving(&factor, &settled) }
}

/// Pole of `held_jerk`, 1/s: with it the white jerk's stationary standard deviation is the prior's.
fn held_pole(axis: &Axis, density2: f64) -> f64 {
    (3.0 * density2 / (16.0 * axis.prior_std().powi(2))).powf(0.2)
}

/// Standard deviation of the velocity of a coordinate that its prior bounds, per s: that of `held_jerk`.
fn prior_speed(axis: &Axis) -> f64 {
    axis.prior_std() * held_pole(axis, axis.process.density * axis.process.density) / 3.0_f64.sqrt()
}

/// The same white jerk with a critically damped spring on the velocity, v'' = -2 p v' - p^2 v: the velocity's stationary
/// standard deviation is `prior_speed`, and the position is free.
fn held_speed(index: [usize; 3], axis: &Axis, density2: f64, dt: f64) -> Block {
    let p = (density2 / (4.0 * prior_speed(axis).powi(2))).cbrt();
    let jolted = |t: f64| double_pole(p, t).map(|row| row[2]);
    let noise = gathered(dt, jolted).map(|row| row.map(|x| x * density2));
    Block { index, len: 3, factor: double_pole(p, dt), offset: [0.0; 3], noise }
}

/// exp(A t) of x''' = -2 p x'' - p^2 x'.
fn double_pole(p: f64, t: f64) -> [[f64; 3]; 3] {
    let (x, e) = (p * t, (-p * t).exp());
    // The closed form of the last is inaccurate for short times.
    let travelled = if x < 1e-3 { t * t * (0.5 - x / 3.0) } else { (1.0 - e * (1.0 + x)) / (p * p) };
    [[1.0, (2.0 - e * (2.0 + x)) / p, travelled], [0.0, e * (1.0 + x), t * e], [0.0, -p * x * e, e * (1.0 - x)]]
}

/// Process noise that keeps the `settled` covariance stationary: S - F S F'.
fn driving(factor: &[[f64; 3]; 3], settled: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let mut noise = *settled;
    for (r, row) in noise.iter_mut().enumerate() {
        for (c, x) in row.iter_mut().enumerate() {
            for a in 0..3 {
                for b in 0..3 {
                    *x -= factor[r][a] * settled[a][b] * factor[c][b];
                }
            }
        }
    }
    noise
}

/// exp(A t) of x''' = -3 p x'' - 3 p^2 x' - p^3 x.
fn triple_pole(p: f64, t: f64) -> [[f64; 3]; 3] {
    // The response is zero by then, and the powers of a longer t would overflow.
    let t = t.min(500.0 / p);
    let e = (-p * t).exp();
    let (p2, p3, p4, t2) = (p * p, p * p * p, p * p * p * p, t * t);
    let rows = [
        [1.0 + p * t + p2 * t2 / 2.0, t + p * t2, t2 / 2.0],
        [-p3 * t2 / 2.0, 1.0 + p * t - p2 * t2, t - p * t2 / 2.0],
        [-p3 * t + p4 * t2 / 2.0, -3.0 * p2 * t + p3 * t2, 1.0 - 2.0 * p * t + p2 * t2 / 2.0],
    ];
    rows.map(|row| row.map(|x| x * e))
}

/// A random walk with a restoring term, so that its stationary distribution is the prior.
fn held_walk(index: usize, axis: &Axis, density2: f64, dt: f64) -> Block {
    let s2 = axis.prior_std() * axis.prior_std();
    let keep = (-dt * density2 / (2.0 * s2)).exp();
    let mut block = Block::walk(index, s2 * (1.0 - keep * keep));
    block.factor[0][0] = keep;
    block.offset[0] = axis.rest * (1.0 - keep);
    block
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spring_is_the_solution_of_its_equation() {
        let (p, t, h) = (2.3, 0.7, 1e-5);
        let (f, g) = (triple_pole(p, t), triple_pole(p, t + h));
        let before = triple_pole(p, t - h);
        let a = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-p * p * p, -3.0 * p * p, -3.0 * p]];
        for r in 0..3 {
            for c in 0..3 {
                let slope = (g[r][c] - before[r][c]) / (2.0 * h);
                let expected: f64 = (0..3).map(|k| a[r][k] * f[k][c]).sum();
                assert!((slope - expected).abs() < 1e-8, "{r} {c}: {slope} {expected}");
            }
        }
    }

    #[test]
    fn spring_noise_over_a_short_step_is_white_jerk() {
        let (density2, s2, dt) = (125.0_f64, 0.25_f64, 1e-3);
        let pole = (3.0 * density2 / (16.0 * s2)).powf(0.2);
        let (l2, l4) = (pole * pole, pole.powi(4));
        let settled = [[s2, 0.0, -s2 * l2 / 3.0], [0.0, s2 * l2 / 3.0, 0.0], [-s2 * l2 / 3.0, 0.0, s2 * l4]];
        let noise = driving(&triple_pole(pole, dt), &settled);
        assert!((noise[2][2] / (density2 * dt) - 1.0).abs() < 0.02, "{}", noise[2][2] / (density2 * dt));
    }

    #[test]
    fn decaying_noise_is_singers() {
        // The closed form of Singer (1970), far enough from zero to be accurate.
        for (tau, t) in [(0.3, 0.3), (0.1, 0.15)] {
            let (a, x): (f64, f64) = (1.0 / tau, t / tau);
            let (e, e2) = ((-x).exp(), (-2.0 * x).exp());
            let closed = [
                (1.0 - e2 + 2.0 * x + 2.0 * x.powi(3) / 3.0 - 2.0 * x * x - 4.0 * x * e) / (2.0 * a.powi(5)),
                (e2 + 1.0 - 2.0 * e + 2.0 * x * e - 2.0 * x + x * x) / (2.0 * a.powi(4)),
                (1.0 - e2 - 2.0 * x * e) / (2.0 * a.powi(3)),
                (4.0 * e - 3.0 - e2 + 2.0 * x) / (2.0 * a.powi(3)),
                (e2 + 1.0 - 2.0 * e) / (2.0 * a * a),
                (1.0 - e2) / (2.0 * a),
            ];
            let q = gathered(t, |t| response(tau, t));
            let found = [q[0][0], q[0][1], q[0][2], q[1][1], q[1][2], q[2][2]];
            for (f, c) in found.iter().zip(closed) {
                // Five-point Gauss quadrature is exact up to the ninth power.
                assert!((f / c - 1.0).abs() < 1e-7, "{f} {c}");
            }
        }
    }

    fn push(time_s: f64, rise_s: f64) -> BaseAcceleration {
        let (name, label) = (String::new(), String::new());
        BaseAcceleration {
            name,
            label,
            axis: [1.0, 0.0, 0.0],
            density: 3.0,
            start_std: 1.0,
            time_s,
            rise_s,
            always: true,
        }
    }

    fn rising(time_s: f64, rise_s: f64, dt: f64) -> Block {
        base_block(&push(time_s, rise_s), PushSlot { state: 0, rate: Some(1), number: 0 }, dt)
    }

    /// Entry (r, c) of F and Q of two steps of two states.
    fn of_two(step: &Block, r: usize, c: usize) -> (f64, f64) {
        let through = |a: usize, b: usize| step.factor[r][a] * step.noise[a][b] * step.factor[c][b];
        let noise: f64 = step.noise[r][c] + (0..2).map(|a| through(a, 0) + through(a, 1)).sum::<f64>();
        ((0..2).map(|k| step.factor[r][k] * step.factor[k][c]).sum(), noise)
    }

    /// F and Q of two steps equal those of one step twice as long, on either side of the change of formula and across
    /// it.
    #[test]
    fn two_steps_of_a_rising_push_are_one() {
        for (time_s, rise_s, dt) in
            [(0.3, 0.02, 0.003), (0.3, 0.02, 0.006), (0.3, 0.02, 0.4), (f64::INFINITY, 0.05, 0.02)]
        {
            let (half, whole) = (rising(time_s, rise_s, dt), rising(time_s, rise_s, 2.0 * dt));
            for r in 0..2 {
                for c in 0..2 {
                    let (factor, noise) = of_two(&half, r, c);
                    assert!((factor - whole.factor[r][c]).abs() < 1e-12, "{dt} {r} {c}");
                    assert!((noise / whole.noise[r][c] - 1.0).abs() < 1e-9, "{dt} {r} {c}: {noise}");
                }
            }
        }
    }

    /// In the long run, a rise time near zero gives the variance of no rise time, and the rate has its start variance.
    #[test]
    fn a_push_that_rises_at_once_jumps() {
        let (risen, jumped) =
            (rising(0.3, 1e-5, 0.1), base_block(&push(0.3, 0.0), PushSlot { state: 0, rate: None, number: 0 }, 0.1));
        assert!((risen.noise[0][0] / jumped.noise[0][0] - 1.0).abs() < 1e-3);
        let rate_std = push(0.3, 1e-5).rate_std();
        assert!((risen.noise[1][1].sqrt() / rate_std - 1.0).abs() < 1e-9);
    }

    #[test]
    fn without_end_to_its_time_an_acceleration_stays() {
        let (long, coast) = (decaying(1e9, 0.02), coasting(0.02));
        let (noise, white) = (gathered(0.02, |t| response(1e9, t)), white_jerk(0.02));
        for r in 0..3 {
            for c in 0..3 {
                assert!((long[r][c] - coast[r][c]).abs() < 1e-9);
                assert!((noise[r][c] / (white[r][c] * 0.02) - 1.0).abs() < 1e-8, "{r} {c}");
            }
        }
    }
}
