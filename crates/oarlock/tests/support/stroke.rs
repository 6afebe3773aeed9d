//! A sculler who holds the oars: seat, trunk and oars swing between catch and finish, the arms follow by closing the loops.

use super::{numbers, vectors};
use nalgebra::{DMatrix, DVector};
use oarlock::body::Body;
use oarlock::track::loops::readings;

/// Joint values and their derivatives, rad or m per s and s2.
#[derive(Clone, Debug)]
pub struct Posture {
    pub q: Vec<f64>,
    pub qd: Vec<f64>,
    pub qdd: Vec<f64>,
}

/// Natural cubic splines of all joints over the way from catch (0) to finish (1).
pub struct Stroke {
    knots: Vec<Vec<f64>>,
    /// Second derivatives at the knots.
    bends: Vec<Vec<f64>>,
    period_s: f64,
}

const KNOTS: usize = 81;
const ARMS: std::ops::Range<usize> = 2..16;
/// A closed loop, m and direction cosines.
const CLOSED: f64 = 1e-9;

impl Stroke {
    pub fn new(body: &Body, period_s: f64) -> Self {
        let closed = vectors("closure.json");
        let (catch, finish) = (numbers(&closed["q"][10]), numbers(&closed["q"][11]));
        let mut q = catch.clone();
        let mut knots = Vec::new();
        for k in 0..KNOTS {
            let s = k as f64 / (KNOTS - 1) as f64;
            for j in (0..q.len()).filter(|j| !ARMS.contains(j)) {
                q[j] = catch[j] + s * (finish[j] - catch[j]);
            }
            close(body, &mut q);
            knots.push(q.clone());
        }
        let bends = bends(&knots);
        Stroke { knots, bends, period_s }
    }

    pub fn at(&self, time_s: f64) -> Posture {
        let w = 2.0 * std::f64::consts::PI / self.period_s;
        let (sin, cos) = (w * time_s).sin_cos();
        // Never quite at the ends, where the spline stops.
        let (s, sd, sdd) = (0.5 - 0.48 * cos, 0.48 * w * sin, 0.48 * w * w * cos);
        let joints = self.knots[0].len();
        let along: Vec<[f64; 3]> = (0..joints).map(|j| self.along(j, s)).collect();
        Posture {
            q: along.iter().map(|f| f[0]).collect(),
            qd: along.iter().map(|f| f[1] * sd).collect(),
            qdd: along.iter().map(|f| f[2] * sd * sd + f[1] * sdd).collect(),
        }
    }

    /// Value, slope and bend of joint `j` at `s`.
    fn along(&self, j: usize, s: f64) -> [f64; 3] {
        let h = 1.0 / (KNOTS - 1) as f64;
        let k = ((s / h) as usize).min(KNOTS - 2);
        let (b, a) = (s / h - k as f64, 1.0 - (s / h - k as f64));
        let (y0, y1) = (self.knots[k][j], self.knots[k + 1][j]);
        let (m0, m1) = (self.bends[k][j], self.bends[k + 1][j]);
        let value = a * y0 + b * y1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * h * h / 6.0;
        let slope = (y1 - y0) / h + ((3.0 * b * b - 1.0) * m1 - (3.0 * a * a - 1.0) * m0) * h / 6.0;
        [value, slope, a * m0 + b * m1]
    }
}

/// Moves the arms by the shortest way until the hands hold the oars.
fn close(body: &Body, q: &mut [f64]) {
    for _ in 0..30 {
        let gap = gap(body, q);
        if gap.amax() < CLOSED {
            return;
        }
        let mut slope = DMatrix::zeros(gap.len(), ARMS.len());
        for (c, j) in ARMS.enumerate() {
            let mut bumped = q.to_vec();
            bumped[j] += 1e-6;
            slope.set_column(c, &((self::gap(body, &bumped) - &gap) / 1e-6));
        }
        let square = &slope * slope.transpose() + DMatrix::identity(gap.len(), gap.len()) * 1e-9;
        let weights = square.cholesky().expect("positive").solve(&gap);
        let step = slope.transpose() * weights;
        ARMS.enumerate().for_each(|(c, j)| q[j] -= step[c]);
    }
    panic!("the hands do not reach the oars: {}", gap(body, q).amax());
}

fn gap(body: &Body, q: &[f64]) -> DVector<f64> {
    let still = vec![0.0; q.len()];
    let all = readings(body, q, &still, &still);
    DVector::from_row_slice(&all[all.len() - 12..])
}

fn bends(knots: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let (n, h) = (knots.len(), 1.0 / (knots.len() - 1) as f64);
    let mut a = DMatrix::<f64>::identity(n, n);
    let mut b = DMatrix::zeros(n, knots[0].len());
    for k in 1..n - 1 {
        (a[(k, k - 1)], a[(k, k)], a[(k, k + 1)]) = (1.0, 4.0, 1.0);
        for j in 0..knots[0].len() {
            let bend = knots[k - 1][j] - 2.0 * knots[k][j] + knots[k + 1][j];
            b[(k, j)] = 6.0 * bend / (h * h);
        }
    }
    let m = a.lu().solve(&b).expect("diagonally dominant");
    (0..n).map(|k| m.row(k).iter().copied().collect()).collect()
}
