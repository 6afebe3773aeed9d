//! A linear system with every kind of state: a pose with rate and acceleration, one that is drawn to a place, and a constant.

use super::support;
use nalgebra::{DMatrix, DVector};
use oarlock::estimate::belief::Belief;
use oarlock::estimate::transition::{Block, Transition};
use oarlock::estimate::{FastSystem, Partition, Points, System};
use oarlock::kernels::dense::Square;
use oarlock::kernels::lane::{Lane, Real};

pub const STATES: usize = 5;
pub const ROWS: usize = 4;
const DENSITY2: f64 = 3.0;
const WALK2: f64 = 0.2;
/// The second pose is drawn here.
const HOME: f64 = 0.7;

/// States: two poses, the first one's rate and acceleration, a constant that adds to readings.
pub struct Linear {
    readings: [[f64; STATES]; ROWS],
    zero: [f64; ROWS],
    pub noise_std: [f64; ROWS],
}

impl Linear {
    pub fn new() -> Self {
        Linear {
            readings: [
                [1.0, 0.3, 0.0, 0.0, 0.0],
                [0.0, 0.8, -1.2, 0.4, 1.0],
                [0.5, -1.0, 0.0, 0.7, 0.0],
                [0.0, 0.0, 0.6, 0.0, -0.5],
            ],
            zero: [0.1, -0.2, 0.0, 0.4],
            noise_std: [0.3, 0.5, 0.2, 0.4],
        }
    }

    /// Rows that are there: H, innovation, R.
    pub fn seen(&self, z: &[f64], mean: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
        let rows: Vec<usize> = (0..ROWS).filter(|&r| !z[r].is_nan()).collect();
        let h = DMatrix::from_fn(rows.len(), STATES, |r, c| self.readings[rows[r]][c]);
        let v = DVector::from_fn(rows.len(), |r, _| z[rows[r]] - self.zero[rows[r]]) - &h * mean;
        let variance = DVector::from_fn(rows.len(), |r, _| self.noise_std[rows[r]].powi(2));
        (h, v, DMatrix::from_diagonal(&variance))
    }
}

impl System for Linear {
    type Moment = ();
    type Scratch = ();

    fn partition(&self) -> Partition {
        Partition { pose: 2, rate: 1, linear: 2 }
    }

    fn row_count(&self) -> usize {
        ROWS
    }

    fn scratch(&self) {}

    fn transition(&self, t: f64, _mean: &[f64], _variance: &[f64], out: &mut Transition) {
        let keep = (-t).exp();
        let mut drawn = Block::walk(1, WALK2 * (1.0 - keep * keep));
        drawn.factor[0][0] = keep;
        drawn.offset[0] = HOME * (1.0 - keep);
        let noise = [
            [t.powi(5) / 20.0, t.powi(4) / 8.0, t.powi(3) / 6.0],
            [t.powi(4) / 8.0, t.powi(3) / 3.0, t * t / 2.0],
            [t.powi(3) / 6.0, t * t / 2.0, t],
        ];
        let driven = Block {
            index: [0, 2, 3],
            len: 3,
            factor: [[1.0, t, 0.5 * t * t], [0.0, 1.0, t], [0.0, 0.0, 1.0]],
            offset: [0.0; 3],
            noise: noise.map(|row| row.map(|x| x * DENSITY2)),
        };
        out.clear();
        out.blocks.extend([drawn, driven, Block::walk(4, 0.01 * t)]);
    }

    fn linearise(&self, _: &(), _: &mut (), mean: &[f64], center: &mut [f64], jacobian: &mut [f64]) {
        for (r, center) in center.iter_mut().enumerate() {
            let terms = self.readings[r].iter().zip(mean);
            *center = self.zero[r] + terms.map(|(h, x)| h * x).sum::<f64>();
            jacobian[r * STATES..(r + 1) * STATES].copy_from_slice(&self.readings[r]);
        }
    }

    fn readings(&self, _: &(), _: &mut (), at: Points, out: &mut [Lane]) {
        for (r, out) in out.iter_mut().enumerate() {
            let terms = self.readings[r].iter().enumerate();
            *out = terms.fold(Lane::splat(self.zero[r]), |sum, (i, &h)| sum + at.at(i).scale(h));
        }
    }
}

impl FastSystem for Linear {}

/// F, offset and Q over `dt`.
pub fn dense(system: &Linear, dt: f64) -> (DMatrix<f64>, DVector<f64>, DMatrix<f64>) {
    let mut transition = Transition::default();
    system.transition(dt, &[0.0; STATES], &[0.0; STATES], &mut transition);
    support::dense(&transition, STATES)
}

/// A prior with correlations.
pub fn start() -> Belief {
    let root = DMatrix::from_fn(STATES, STATES, |r, c| match r.cmp(&c) {
        std::cmp::Ordering::Less => 0.0,
        std::cmp::Ordering::Equal => 1.0 + 0.1 * r as f64,
        std::cmp::Ordering::Greater => 0.3 / (1.0 + r as f64 - c as f64),
    });
    let p = &root * root.transpose();
    let rows = (0..STATES).flat_map(|i| (0..STATES).map(move |j| (i, j)));
    let covariance = Square::from_rows(STATES, rows.map(|at| p[at]).collect()).expect("square");
    Belief { time_s: 0.0, mean: vec![0.4, -0.3, 0.2, 1.0, 0.5], covariance, rejected_since_s: vec![f64::NAN; 2] }
}

pub fn matrix(square: &Square) -> DMatrix<f64> {
    DMatrix::from_row_slice(square.n(), square.n(), square.as_slice())
}
