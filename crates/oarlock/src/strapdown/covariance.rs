//! Arithmetic on the covariance of strapdown links: prediction by blocks of 15 states, and readings of up to three rows. `filter` uses it.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::increment::{skew, sum, Increment};
use super::slides::Share;
use crate::kernels::arch::{madd, Arch, Kernel};
use crate::kernels::dense::Square;
use crate::rotation::{Mat3, Vec3};

/// States of a unit: orientation, velocity, position, biases of gyroscope and accelerometer.
pub const UNIT: usize = 15;

/// Transition of a unit's errors: identity but for these blocks, and its noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// s.
    pub duration_s: f64,
    /// Orientation by the gyroscope's bias.
    pub turn_gyro: Mat3<f64>,
    /// Velocity by orientation, gyroscope's and accelerometer's bias.
    pub velocity: [Mat3<f64>; 3],
    /// Position by the same.
    pub position: [Mat3<f64>; 3],
    /// Whether orientation, velocity and position are forgotten: the unit is silent.
    pub forgets: bool,
}

impl Step {
    /// Of a unit with orientation `before`, at velocity and position after it. Errors are right-invariant, so that gravity is the only way from
    /// orientation to velocity, and constant (Barrau and Bonnabel 2017). Returns its noise too, for
    /// `predict` to add after the transition.
    pub fn of(
        increment: &Increment,
        before: &Mat3<f64>,
        (velocity, position): (Vec3<f64>, Vec3<f64>),
        gravity: Vec3<f64>,
    ) -> (Step, [[f64; 9]; 9]) {
        let t = increment.duration_s;
        let after = before.times(&increment.rotation);
        let (v, p) = (skew(velocity), skew(position));
        let turn_gyro = after.times(&increment.rotation_gyro);
        let step = Step {
            duration_s: t,
            turn_gyro,
            velocity: [
                sum(&super::increment::ZERO, &skew(gravity), t),
                sum(&before.times(&increment.velocity_gyro), &v.times(&turn_gyro), 1.0),
                before.times(&increment.velocity_accel),
            ],
            position: [
                sum(&super::increment::ZERO, &skew(gravity), 0.5 * t * t),
                sum(&before.times(&increment.position_gyro), &p.times(&turn_gyro), 1.0),
                before.times(&increment.position_accel),
            ],
            forgets: false,
        };
        // G = [after, 0, 0; v after, before, 0; p after, 0, before]
        let (va, pa) = (v.times(&after), p.times(&after));
        let g = |r: usize, c: usize| match (r / 3, c / 3) {
            (0, 0) => after.0[r][c],
            (1, 0) => va.0[r - 3][c],
            (2, 0) => pa.0[r - 6][c],
            (1, 1) => before.0[r - 3][c - 3],
            (2, 2) => before.0[r - 6][c - 6],
            _ => 0.0,
        };
        let g: [[f64; 9]; 9] = std::array::from_fn(|r| std::array::from_fn(|c| g(r, c)));
        let s = &increment.covariance;
        let gs: [[f64; 9]; 9] =
            std::array::from_fn(|r| std::array::from_fn(|c| (0..9).map(|k| g[r][k] * s[k][c]).sum()));
        let noise = std::array::from_fn(|r| std::array::from_fn(|c| (0..9).map(|k| gs[r][k] * g[c][k]).sum()));
        (step, noise)
    }
}

/// X <- F X of the 15 rows at `first`.
#[inline(always)]
pub fn move_rows<const FUSED: bool>(step: &Step, rows: &mut [&mut [f64]; UNIT]) {
    let n = rows[0].len();
    if step.forgets {
        rows[..9].iter_mut().for_each(|row| row.fill(0.0));
        return;
    }
    let [f0, f1, f2, v0, v1, v2, p0, p1, p2, g0, g1, g2, a0, a1, a2] = rows;
    let (turn, gyro, accel) =
        ([&f0[..n], &f1[..n], &f2[..n]], [&g0[..n], &g1[..n], &g2[..n]], [&a0[..n], &a1[..n], &a2[..n]]);
    let (speed, place) = ([&mut v0[..n], &mut v1[..n], &mut v2[..n]], [&mut p0[..n], &mut p1[..n], &mut p2[..n]]);
    for (q, row) in place.into_iter().enumerate() {
        let ([t, g, a], dt) = (step.position.map(|m| m.0[q]), step.duration_s);
        for j in 0..n {
            let mut x = madd::<FUSED>(dt, speed[q][j], row[j]);
            for u in 0..3 {
                x = madd::<FUSED>(t[u], turn[u][j], x);
                x = madd::<FUSED>(g[u], gyro[u][j], x);
                x = madd::<FUSED>(a[u], accel[u][j], x);
            }
            row[j] = x;
        }
    }
    for (q, row) in speed.into_iter().enumerate() {
        let [t, g, a] = step.velocity.map(|m| m.0[q]);
        for j in 0..n {
            let mut x = row[j];
            for u in 0..3 {
                x = madd::<FUSED>(t[u], turn[u][j], x);
                x = madd::<FUSED>(g[u], gyro[u][j], x);
                x = madd::<FUSED>(a[u], accel[u][j], x);
            }
            row[j] = x;
        }
    }
    for (q, row) in [f0, f1, f2].into_iter().enumerate() {
        let g = step.turn_gyro.0[q];
        for j in 0..n {
            let mut x = row[j];
            for u in 0..3 {
                x = madd::<FUSED>(g[u], gyro[u][j], x);
            }
            row[j] = x;
        }
    }
}

/// x <- x F' of the 15 columns of one row.
#[inline(always)]
fn move_columns(step: &Step, x: &mut [f64]) {
    let x: &mut [f64; UNIT] = x.try_into().expect("15 columns");
    if step.forgets {
        x[..9].fill(0.0);
        return;
    }
    let old = *x;
    for q in 0..3 {
        let (mut speed, mut place, mut turn) = (0.0, step.duration_s * old[3 + q], 0.0);
        for u in 0..3 {
            turn += step.turn_gyro.0[q][u] * old[9 + u];
            for (k, from) in [0, 9, 12].into_iter().enumerate() {
                speed += step.velocity[k].0[q][u] * old[from + u];
                place += step.position[k].0[q][u] * old[from + u];
            }
        }
        x[q] = old[q] + turn;
        x[3 + q] = old[3 + q] + speed;
        x[6 + q] = old[6 + q] + place;
    }
}

/// Transitions of all units; states that accelerate them all along an axis; shares of states that decay; and of pairs of states from a first one.
type Transition<'a> = (&'a [Step], &'a [(usize, Vec3<f64>)], &'a [(usize, f64)], &'a [(usize, Share)]);

/// P <- F P F' for all units.
pub fn predict(arch: Arch, covariance: &mut Square, transition: Transition) {
    arch.run(Predicting { covariance, transition });
}

/// Adds what an acceleration of the room does to a unit: rows of its velocity and position, and of the acceleration.
pub fn push_rows(step: &Step, axis: Vec3<f64>, rows: &mut [&mut [f64]; 7]) {
    let [v0, v1, v2, p0, p1, p2, push] = rows;
    let t = if step.forgets { 0.0 } else { step.duration_s };
    for (row, by) in [v0, v1, v2].into_iter().zip(axis.0) {
        row.iter_mut().zip(push.iter()).for_each(|(x, s)| *x -= t * by * s);
    }
    for (row, by) in [p0, p1, p2].into_iter().zip(axis.0) {
        row.iter_mut().zip(push.iter()).for_each(|(x, s)| *x -= 0.5 * t * t * by * s);
    }
}

/// Rows of a unit's velocity and position, and of an acceleration of the room.
pub fn pushed_rows(unit: usize, push: usize) -> [usize; 7] {
    std::array::from_fn(|r| if r < 6 { UNIT * unit + 3 + r } else { push })
}

/// X <- F X of two rows.
pub fn mix_rows(share: &Share, [a, b]: [&mut [f64]; 2]) {
    for (a, b) in a.iter_mut().zip(b) {
        [*a, *b] = share.map(|row| row[0] * *a + row[1] * *b);
    }
}

struct Predicting<'a> {
    covariance: &'a mut Square,
    transition: Transition<'a>,
}

impl Kernel for Predicting<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Predicting { covariance, transition: (steps, pushed, decays, slides) } = self;
        for (i, step) in steps.iter().enumerate() {
            let mut rows = covariance.rows_mut::<UNIT>(std::array::from_fn(|r| UNIT * i + r));
            move_rows::<FUSED>(step, &mut rows);
            for (state, axis) in pushed {
                push_rows(step, *axis, &mut covariance.rows_mut::<7>(pushed_rows(i, *state)));
            }
        }
        for (state, share) in decays {
            covariance.row_mut(*state).iter_mut().for_each(|x| *x *= share);
        }
        for (first, share) in slides {
            mix_rows(share, covariance.rows_mut::<2>([*first, first + 1]));
        }
        for r in 0..covariance.n() {
            let row = covariance.row_mut(r);
            for (i, step) in steps.iter().enumerate() {
                move_columns(step, &mut row[UNIT * i..UNIT * (i + 1)]);
                let t = if step.forgets { 0.0 } else { step.duration_s };
                for (state, axis) in pushed {
                    for q in 0..3 {
                        row[UNIT * i + 3 + q] -= t * axis.0[q] * row[*state];
                        row[UNIT * i + 6 + q] -= 0.5 * t * t * axis.0[q] * row[*state];
                    }
                }
            }
            for (state, share) in decays {
                row[*state] *= share;
            }
            for (first, share) in slides {
                let pair = [row[*first], row[first + 1]];
                (0..2).for_each(|k| row[first + k] = share[k][0] * pair[0] + share[k][1] * pair[1]);
            }
        }
    }
}

/// Derivatives of up to three rows of readings by some states.
#[derive(Debug, Clone, Default)]
pub struct Rows {
    pub states: Vec<usize>,
    /// Per state: derivative of each row.
    pub slopes: Vec<[f64; 3]>,
}

impl Rows {
    pub fn clear(&mut self) {
        self.states.clear();
        self.slopes.clear();
    }

    /// One state with its derivatives.
    pub fn push_one(&mut self, state: usize, slope: [f64; 3]) {
        self.states.push(state);
        self.slopes.push(slope);
    }

    /// Three states from `first` on with a 3 x 3 derivative.
    pub fn push(&mut self, first: usize, m: &Mat3<f64>) {
        for q in 0..3 {
            self.states.push(first + q);
            self.slopes.push([m.0[0][q], m.0[1][q], m.0[2][q]]);
        }
    }
}

/// Workspace of readings: the correction of this instant so far, and P H'.
#[derive(Debug, Clone)]
pub struct Correction {
    arch: Arch,
    pub shift: Vec<f64>,
    /// Log-likelihood of the readings so far.
    pub log_likelihood: f64,
    spread: [Vec<f64>; 3],
}

impl Correction {
    pub fn new(n: usize) -> Self {
        Correction {
            arch: Arch::best(),
            shift: vec![0.0; n],
            log_likelihood: 0.0,
            spread: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
        }
    }

    /// Uses `count` rows with this innovation at the point of linearisation and these variances; corrects shift and covariance. Returns the
    /// normalised innovation squared.
    pub fn read(
        &mut self,
        covariance: &mut Square,
        rows: &Rows,
        count: usize,
        innovation: [f64; 3],
        variance: [f64; 3],
    ) -> f64 {
        let arch = self.arch;
        arch.run(Reading { correction: self, covariance, rows, count, innovation, variance })
    }
}

struct Reading<'a> {
    correction: &'a mut Correction,
    covariance: &'a mut Square,
    rows: &'a Rows,
    count: usize,
    innovation: [f64; 3],
    variance: [f64; 3],
}

impl Kernel for Reading<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> f64 {
        let Reading { correction, covariance, rows, count, mut innovation, variance } = self;
        let Correction { shift, spread, log_likelihood, .. } = correction;
        let n = covariance.n();
        let [x, y, z] = spread;
        let (x, y, z) = (&mut x[..n], &mut y[..n], &mut z[..n]);
        x.fill(0.0);
        y.fill(0.0);
        z.fill(0.0);
        for (state, slope) in rows.states.iter().zip(&rows.slopes) {
            let row = &covariance.row(*state)[..n];
            for r in 0..3 {
                innovation[r] -= slope[r] * shift[*state];
            }
            for j in 0..n {
                x[j] = madd::<FUSED>(slope[0], row[j], x[j]);
                y[j] = madd::<FUSED>(slope[1], row[j], y[j]);
                z[j] = madd::<FUSED>(slope[2], row[j], z[j]);
            }
        }
        let mut s = nalgebra::Matrix3::<f64>::identity();
        let all = [&*x, &*y, &*z];
        for r in 0..count {
            for c in 0..count {
                let sum: f64 = rows.states.iter().zip(&rows.slopes).map(|(i, h)| h[r] * all[c][*i]).sum();
                s[(r, c)] = sum + if r == c { variance[r] } else { 0.0 };
            }
        }
        let s = 0.5 * (s + s.transpose());
        let Some(inverse) = s.try_inverse() else { return f64::NAN };
        let mut weights = [0.0; 3];
        for r in 0..count {
            weights[r] = (0..count).map(|c| inverse[(r, c)] * innovation[c]).sum();
        }
        let w = |r: usize, c: usize| if r < count && c < count { inverse[(r, c)] } else { 0.0 };
        let w = [[w(0, 0), w(0, 1), w(0, 2)], [w(1, 0), w(1, 1), w(1, 2)], [w(2, 0), w(2, 1), w(2, 2)]];
        for i in 0..n {
            let own = [x[i], y[i], z[i]];
            let k = w.map(|w| -(w[0] * own[0] + w[1] * own[1] + w[2] * own[2]));
            shift[i] += weights[0] * own[0] + weights[1] * own[1] + weights[2] * own[2];
            if k == [0.0; 3] {
                continue;
            }
            let row = &mut covariance.row_mut(i)[..n];
            for j in 0..n {
                row[j] = madd::<FUSED>(k[0], x[j], madd::<FUSED>(k[1], y[j], madd::<FUSED>(k[2], z[j], row[j])));
            }
        }
        let nis: f64 = (0..count).map(|r| weights[r] * innovation[r]).sum();
        *log_likelihood -= 0.5 * (nis + s.determinant().abs().ln());
        nis
    }
}

/// Three rows and columns from `first` on.
pub fn block(covariance: &Square, first: usize) -> Mat3<f64> {
    Mat3(std::array::from_fn(|r| std::array::from_fn(|c| covariance.at(first + r, first + c))))
}

/// Makes a matrix symmetric that rounding made uneven.
pub fn even(a: &mut Square) {
    for i in 0..a.n() {
        for j in 0..i {
            let mean = 0.5 * (a.at(i, j) + a.at(j, i));
            *a.at_mut(i, j) = mean;
            *a.at_mut(j, i) = mean;
        }
    }
}
