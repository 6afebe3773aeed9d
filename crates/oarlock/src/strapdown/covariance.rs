//! Arithmetic on the covariance of strapdown links: prediction by blocks of 15 states, and readings of up to three rows. `filter` uses it.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::increment::{skew, sum, Increment};
use super::slides::Share;
use crate::kernels::arch::{madd, Arch, Kernel};
use crate::kernels::dense::{accumulate, Square};
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

/// Corrections by the readings of one instant so far: of the means, and of the covariance P, from which X'K is still to be subtracted: one pass
/// over P takes up all readings, and those that are read again need none.
#[derive(Debug, Clone)]
pub struct Correction {
    arch: Arch,
    pub shift: Vec<f64>,
    /// Log-likelihood of the readings so far.
    pub log_likelihood: f64,
    /// Rows of X = H P and of K = S^-1 H P, of which the first `waiting` count.
    spread: Vec<Vec<f64>>,
    gain: Vec<Vec<f64>>,
    waiting: usize,
}

impl Correction {
    pub fn new(n: usize) -> Self {
        let (spread, gain) = (Vec::new(), Vec::new());
        Correction { arch: Arch::best(), shift: vec![0.0; n], log_likelihood: 0.0, spread, gain, waiting: 0 }
    }

    /// Uses `count` rows with this innovation at the point of linearisation and these variances; corrects shift and covariance. Returns the
    /// normalised innovation squared.
    pub fn read(
        &mut self,
        covariance: &Square,
        rows: &Rows,
        count: usize,
        innovation: [f64; 3],
        variance: [f64; 3],
    ) -> f64 {
        while self.spread.len() < self.waiting + 3 {
            self.spread.push(vec![0.0; covariance.n()]);
            self.gain.push(vec![0.0; covariance.n()]);
        }
        let arch = self.arch;
        arch.run(Reading { correction: self, covariance, rows, count, innovation, variance })
    }

    /// Forgets the readings of this instant.
    pub fn clear(&mut self) {
        self.waiting = 0;
    }

    /// Lets the covariance take up all that was read, and makes it symmetric.
    pub fn finish(&mut self, covariance: &mut Square) {
        let arch = self.arch;
        arch.run(Subtracting { correction: self, covariance });
    }

    /// Variance of a reading along a direction of its rows.
    pub fn variance_along(&self, covariance: &Square, rows: &Rows, along: Vec3<f64>) -> f64 {
        let slopes = rows.slopes.iter().map(|s| s[0] * along.0[0] + s[1] * along.0[1] + s[2] * along.0[2]);
        let all: Vec<(usize, f64)> = rows.states.iter().copied().zip(slopes).collect();
        let times = |row: &[f64]| all.iter().map(|(j, g)| row[*j] * g).sum::<f64>();
        let before: f64 = all.iter().map(|(i, h)| h * times(covariance.row(*i))).sum();
        let taken = self.spread.iter().zip(&self.gain).take(self.waiting);
        before - taken.map(|(x, k)| times(x) * times(k)).sum::<f64>()
    }
}

struct Reading<'a> {
    correction: &'a mut Correction,
    covariance: &'a Square,
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
        let Correction { shift, spread, gain, waiting, log_likelihood, .. } = correction;
        let n = covariance.n();
        let (taken, own) = spread.split_at_mut(*waiting);
        let [x, y, z] = &mut own[..3] else { return f64::NAN };
        let (x, y, z) = (&mut x[..n], &mut y[..n], &mut z[..n]);
        x.fill(0.0);
        y.fill(0.0);
        z.fill(0.0);
        let mut all = [x, y, z];
        for (state, slope) in rows.states.iter().zip(&rows.slopes) {
            for r in 0..3 {
                innovation[r] -= slope[r] * shift[*state];
            }
            add::<FUSED>(&mut all, *slope, covariance.row(*state));
        }
        for (taken, gain) in taken.iter().zip(&*gain) {
            let mut by = [0.0; 3];
            for (state, slope) in rows.states.iter().zip(&rows.slopes) {
                for r in 0..3 {
                    by[r] = madd::<FUSED>(-slope[r], gain[*state], by[r]);
                }
            }
            add::<FUSED>(&mut all, by, taken);
        }
        let mut s = nalgebra::Matrix3::<f64>::identity();
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
            let row = &mut gain[*waiting + r];
            row.fill(0.0);
            for c in 0..count {
                weights[r] += inverse[(r, c)] * innovation[c];
                let (w, x) = (inverse[(r, c)], &all[c][..n]);
                for j in 0..n {
                    row[j] = madd::<FUSED>(w, x[j], row[j]);
                }
            }
            shift.iter_mut().zip(&*all[r]).for_each(|(shift, x)| *shift = madd::<FUSED>(weights[r], *x, *shift));
        }
        *waiting += count;
        let nis: f64 = (0..count).map(|r| weights[r] * innovation[r]).sum();
        *log_likelihood -= 0.5 * (nis + s.determinant().abs().ln());
        nis
    }
}

struct Subtracting<'a> {
    correction: &'a mut Correction,
    covariance: &'a mut Square,
}

impl Kernel for Subtracting<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Subtracting { correction: Correction { spread, gain, waiting, .. }, covariance } = self;
        // Of the symmetric matrix the upper triangle is enough.
        for i in 0..covariance.n() {
            let terms = spread.iter().zip(&*gain).take(*waiting).map(|(x, k)| (-k[i], &x[i..]));
            accumulate(&mut covariance.row_mut(i)[i..], terms);
        }
        covariance.mirror_upper();
        *waiting = 0;
    }
}

/// Adds `by` times a row to each of three.
#[inline(always)]
fn add<const FUSED: bool>([x, y, z]: &mut [&mut [f64]; 3], by: [f64; 3], row: &[f64]) {
    let n = row.len();
    let (x, y, z) = (&mut x[..n], &mut y[..n], &mut z[..n]);
    for j in 0..n {
        x[j] = madd::<FUSED>(by[0], row[j], x[j]);
        y[j] = madd::<FUSED>(by[1], row[j], y[j]);
        z[j] = madd::<FUSED>(by[2], row[j], z[j]);
    }
}

/// Three rows and columns from `first` on.
pub fn block(covariance: &Square, first: usize) -> Mat3<f64> {
    Mat3(std::array::from_fn(|r| std::array::from_fn(|c| covariance.at(first + r, first + c))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Some rows by some states, with an innovation for each row.
    type Part = (Rows, usize, [f64; 3]);

    fn parts() -> Vec<Part> {
        let some = |k: usize| ((7 * k + 3) % 11) as f64 / 11.0 - 0.4;
        let part = |p: usize| {
            let mut rows = Rows::default();
            (0..3).for_each(|s| rows.push_one((2 * p + 3 * s) % 7, [some(p + s), some(2 * p + s), some(3 * p + s)]));
            (rows, 1 + p % 3, [0.1, -0.2, 0.05].map(|x| x * (1.0 + p as f64)))
        };
        (0..5).map(part).collect()
    }

    #[test]
    fn readings_in_turn_are_one_update_with_all_rows() {
        const VARIANCE: f64 = 0.3;
        let before = DMatrix::from_fn(7, 7, |r, c| 1.0 / (1.0 + r as f64 + c as f64) + f64::from(u8::from(r == c)));
        let mut covariance = Square::from_rows(7, before.iter().copied().collect()).unwrap();
        let mut correction = Correction::new(7);
        let (mut h, mut z) = (DMatrix::zeros(0, 7), DVector::zeros(0));
        for (rows, count, innovation) in parts() {
            let along = Vec3([1.0, 0.0, 0.0]);
            let expected = correction.variance_along(&covariance, &rows, along);
            let mut alone = correction.clone();
            let nis = alone.read(&covariance, &rows, 1, [1.0, 0.0, 0.0], [VARIANCE; 3]);
            let at_shift: f64 = rows.states.iter().zip(&rows.slopes).map(|(i, h)| h[0] * correction.shift[*i]).sum();
            assert!((nis - (1.0 - at_shift).powi(2) / (expected + VARIANCE)).abs() < 1e-12);
            correction.read(&covariance, &rows, count, innovation, [VARIANCE; 3]);
            for r in 0..count {
                let at = h.nrows();
                h = h.insert_row(at, 0.0);
                rows.states.iter().zip(&rows.slopes).for_each(|(i, slope)| h[(at, *i)] += slope[r]);
                z = z.push(innovation[r]);
            }
        }
        correction.finish(&mut covariance);
        let s = &h * &before * h.transpose() + DMatrix::identity(h.nrows(), h.nrows()) * VARIANCE;
        let gain = &before * h.transpose() * s.try_inverse().unwrap();
        let (shift, after) = (&gain * z, &before - &gain * &h * &before);
        for r in 0..7 {
            assert!((correction.shift[r] - shift[r]).abs() < 1e-12);
            (0..7).for_each(|c| assert!((covariance.at(r, c) - after[(r, c)]).abs() < 1e-12));
        }
    }
}
