//! How states move by themselves: white jerk, random walks, and the spring that holds what nothing observes.

use crate::config::ProcessNoise;
use crate::estimate::transition::Block;
use crate::model::{Joint, ProcessKind};
use crate::state::JointSlots;

/// Above this share of its prior's standard deviation a joint counts as not observed and is held by its prior.
pub const HELD_SHARE: f64 = 0.8;

/// Standard deviation of a joint's prior: its soft limits are two of them either side.
pub fn prior_std(joint: &Joint) -> f64 {
    (joint.limits[1] - joint.limits[0]) / 4.0
}

/// Whether a joint whose value has this variance counts as observed.
pub fn is_observed(joint: &Joint, variance: f64) -> bool {
    variance.sqrt() < HELD_SHARE * prior_std(joint)
}

/// A joint's present, and how far to look ahead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Now {
    /// s.
    pub dt: f64,
    /// Of its value.
    pub variance: f64,
    /// Factor on the variance of its driving noise.
    pub drive: f64,
}

/// Motion of one joint. While it is held, the model's own driving noise counts, not the learnt one.
pub fn joint_block(joint: &Joint, slots: JointSlots, now: Now, noise: ProcessNoise) -> Block {
    let dt = now.dt;
    let held = !is_observed(joint, now.variance);
    let density2 = joint.process.density * joint.process.density * if held { 1.0 } else { now.drive };
    match (joint.process.kind, slots.rates) {
        (ProcessKind::Jerk, Some((rate, accel))) => {
            let index = [slots.q, rate, accel];
            if held {
                return held_jerk(index, joint, density2, dt);
            }
            let noise = match noise {
                ProcessNoise::Jerk => white_jerk(dt),
                ProcessNoise::Paper => printed(dt),
            };
            let factor = [[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]];
            let noise = noise.map(|row| row.map(|x| x * density2 * dt));
            Block { index, len: 3, factor, offset: [0.0; 3], noise }
        }
        _ if held => held_walk(slots.q, joint, density2, dt),
        _ => Block::walk(slots.q, density2 * dt),
    }
}

/// White-noise jerk (Bar-Shalom, Li and Kirubarajan 2001, section 6.2.3), scaled so that a unit is the rms increment of
/// the acceleration over `dt`.
fn white_jerk(t: f64) -> [[f64; 3]; 3] {
    let (t2, t3, t4) = (t * t, t * t * t, t * t * t * t);
    [[t4 / 20.0, t3 / 8.0, t2 / 6.0], [t3 / 8.0, t2 / 3.0, t / 2.0], [t2 / 6.0, t / 2.0, 1.0]]
}

/// Eq. 6 of Ruffaldi, Peppoloni and Filippeschi, its garbled row read as G G' with G = [T^2/2, T, 1].
fn printed(t: f64) -> [[f64; 3]; 3] {
    let g = [0.5 * t * t, t, 1.0];
    g.map(|a| g.map(|b| a * b))
}

/// The same white jerk against a critically damped spring (triple pole) that leaves the joint, in the long run, within
/// its prior: mean `rest`, standard deviation `prior_std`. Exact over any dt.
fn held_jerk(index: [usize; 3], joint: &Joint, density2: f64, dt: f64) -> Block {
    let s2 = prior_std(joint) * prior_std(joint);
    let pole = (3.0 * density2 / (16.0 * s2)).powf(0.2);
    let factor = triple_pole(pole, dt);
    let (l2, l4) = (pole * pole, pole.powi(4));
    let settled = [[s2, 0.0, -s2 * l2 / 3.0], [0.0, s2 * l2 / 3.0, 0.0], [-s2 * l2 / 3.0, 0.0, s2 * l4]];
    let offset = [0, 1, 2].map(|r| joint.rest * (f64::from(r == 0) - factor[r as usize][0]));
    Block { index, len: 3, factor, offset, noise: driving(&factor, &settled) }
}

/// Noise that keeps the `settled` covariance where it is: S - F S F'.
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
    // Nothing is left by then, and the powers of a longer t would overflow.
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

/// A walk that is drawn back to `rest` just so fast that it stays within the prior.
fn held_walk(index: usize, joint: &Joint, density2: f64, dt: f64) -> Block {
    let s2 = prior_std(joint) * prior_std(joint);
    let keep = (-dt * density2 / (2.0 * s2)).exp();
    let mut block = Block::walk(index, s2 * (1.0 - keep * keep));
    block.factor[0][0] = keep;
    block.offset[0] = joint.rest * (1.0 - keep);
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
}
