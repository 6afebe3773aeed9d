//! What an iterated smoother minimises: twice the negative logarithm of the density of a whole course, up to a constant (Bell 1994;
//! Särkkä and Svensson 2020). `step` adds to it while a pass follows the course; `run` compares courses.

use crate::estimate::belief::Belief;
use crate::estimate::transition::{Block, Transition};
use crate::estimate::System;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// Sums the squares of what a course leaves unexplained, each divided by its covariance.
#[derive(Debug, Clone, Default)]
pub(super) struct Objective {
    sum: f64,
    transition: Transition,
    variance: Vec<f64>,
    moved: Vec<f64>,
    step: Vec<f64>,
}

impl Objective {
    /// The sum of all that was added.
    pub fn sum(&self) -> f64 {
        self.sum
    }

    /// Adds the prior of the first state.
    pub fn add_start<S: System>(&mut self, system: &S, prior: &Belief, first: &[f64]) {
        self.step.resize(first.len(), 0.0);
        system.difference(first, &prior.mean, &mut self.step);
        self.sum += squared(self.step.len(), |r, c| prior.covariance.at(r.min(c), r.max(c)), |r| self.step[r]);
    }

    /// Adds the process noise between two states of the course. Variances and process noise are those of the filter before the step.
    pub fn add_step<S: System>(&mut self, system: &S, before: &Belief, to_s: f64, (from, to): (&[f64], &[f64])) {
        self.variance.resize(from.len(), 0.0);
        self.step.resize(from.len(), 0.0);
        before.covariance.diagonal(&mut self.variance);
        system.transition(to_s - before.time_s, from, &self.variance, &before.drive, &mut self.transition);
        self.moved.clear();
        self.moved.extend(from);
        self.transition.apply_to_mean(&mut self.moved);
        system.difference(to, &self.moved, &mut self.step);
        // The noise of a rotation acts in its chart.
        self.transition.turnings.iter().for_each(|turning| divide(&turning.after, &mut self.step));
        self.sum += self.transition.blocks.iter().map(|block| process(block, &self.step)).sum::<f64>();
    }

    /// Adds the residuals of a sample's readings at the course, squared and divided by their covariance.
    pub fn add_readings(&mut self, squares: f64) {
        self.sum += squares;
    }
}

/// x <- F^-1 x.
fn divide(block: &Block, x: &mut [f64]) {
    let factor = Matrix3::from_fn(|r, c| block.factor[r][c]);
    let Some(inverse) = factor.try_inverse() else { return };
    let divided = inverse * Vector3::from(block.index.map(|i| x[i]));
    (0..3).for_each(|r| x[block.index[r]] = divided[r]);
}

fn process(block: &Block, step: &[f64]) -> f64 {
    squared(block.len, |r, c| block.noise[r][c], |r| step[block.index[r]])
}

/// x' P^-1 x over the rows with a variance: a constant has none, and does not move. Scaled to a unit diagonal, because variances differ by
/// many orders of magnitude.
fn squared(n: usize, p: impl Fn(usize, usize) -> f64, x: impl Fn(usize) -> f64) -> f64 {
    let rows: Vec<(usize, f64)> = (0..n).map(|r| (r, p(r, r).sqrt())).filter(|(_, std)| *std > 0.0).collect();
    let scaled = DMatrix::from_fn(rows.len(), rows.len(), |r, c| p(rows[r].0, rows[c].0) / (rows[r].1 * rows[c].1));
    let x = DVector::from_fn(rows.len(), |r, _| x(rows[r].0) / rows[r].1);
    scaled.cholesky().map_or(0.0, |factor| x.dot(&factor.solve(&x)))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::estimate::filter::{Filter, Gate, Info, Measurement, RowGroups, UpdateSettings};
    use crate::estimate::learn::Learning;
    use crate::estimate::sigma::Spread;
    use crate::estimate::smoother::Smoother;
    use crate::estimate::{FastSystem, Partition, Points};
    use crate::kernels::dense::Square;
    use crate::kernels::lane::{Lane, Real};
    use nalgebra::{Matrix2, Vector2};

    const DT_S: f64 = 0.2;
    const STD: f64 = 0.3;
    const Z: [f64; 3] = [0.4, -0.2, 0.9];
    const NOISE: [[f64; 3]; 3] = [[0.02, 0.01, 0.0], [0.01, 0.03, 0.0], [0.0; 3]];

    /// Position and velocity of a point on a line; its position is measured.
    pub(in crate::track) struct Line;

    impl System for Line {
        type Moment = ();
        type Scratch = ();

        fn partition(&self) -> Partition {
            Partition { pose: 1, rate: 1, linear: 0 }
        }

        fn row_count(&self) -> usize {
            1
        }

        fn scratch(&self) {}

        fn transition(&self, dt: f64, _: &[f64], _: &[f64], _: &[f64], out: &mut Transition) {
            let factor = [[1.0, dt, 0.0], [0.0, 1.0, 0.0], [0.0; 3]];
            out.clear();
            out.blocks.push(Block { index: [0, 1, 1], len: 2, factor, noise: NOISE, ..Block::walk(0, 0.0) });
        }

        fn readings(&self, _: &(), _: &mut (), at: Points, out: &mut [Lane]) {
            out[0] = at.at(0).scale(1.0);
        }

        fn linearise(&self, _: &(), _: &mut (), mean: &[f64], center: &mut [f64], jacobian: &mut [f64]) {
            center[0] = mean[0];
            jacobian.copy_from_slice(&[1.0, 0.0]);
        }
    }

    impl FastSystem for Line {}

    fn prior() -> Belief {
        Belief {
            time_s: 0.0,
            mean: vec![0.1, -0.5],
            covariance: Square::from_rows(2, vec![0.5, 0.2, 0.2, 2.0]).expect("square"),
            drive: Vec::new(),
            usual_nis: vec![1.0],
            inflation: 1.0,
            surprise: 1.0,
            rejected_since_s: vec![f64::NAN],
        }
    }

    fn objective(course: &[Vec<f64>]) -> f64 {
        let mut all = Objective::default();
        all.add_start(&Line, &prior(), &course[0]);
        for (k, states) in course.windows(2).enumerate() {
            let before = Belief { time_s: k as f64 * DT_S, ..prior() };
            all.add_step(&Line, &before, (k + 1) as f64 * DT_S, (&states[0], &states[1]));
        }
        course.iter().zip(Z).for_each(|(state, z)| all.add_readings(((z - state[0]) / STD).powi(2)));
        all.sum()
    }

    /// Least squares of the whole course in dense matrices.
    fn dense(course: &[Vec<f64>]) -> f64 {
        let squares = |p: Matrix2<f64>, x: Vector2<f64>| (x.transpose() * p.try_inverse().expect("regular") * x)[0];
        let state = |k: usize| Vector2::new(course[k][0], course[k][1]);
        let f = Matrix2::new(1.0, DT_S, 0.0, 1.0);
        let q = Matrix2::from_fn(|r, c| NOISE[r][c]);
        let start = squares(Matrix2::new(0.5, 0.2, 0.2, 2.0), state(0) - Vector2::new(0.1, -0.5));
        let steps: f64 = (1..Z.len()).map(|k| squares(q, state(k) - f * state(k - 1))).sum();
        start + steps + (0..Z.len()).map(|k| ((Z[k] - course[k][0]) / STD).powi(2)).sum::<f64>()
    }

    #[test]
    fn the_objective_of_a_linear_system_is_the_cost_of_dense_least_squares() {
        let course = [vec![0.3, 1.0], vec![0.2, -0.4], vec![0.7, 0.1]];
        assert!((objective(&course) / dense(&course) - 1.0).abs() < 1e-12);
    }

    fn update(filter: &mut Filter<Line>, groups: &RowGroups, belief: &mut Belief, z: f64) {
        let measured = Measurement {
            z: &[z],
            std: &[STD],
            excluded: &[false],
            strict: &[false],
            direction_tests: &[None],
            groups,
            linearise_at: None,
        };
        let settings = UpdateSettings {
            spread: Spread { alpha: 0.3, beta: 2.0, kappa: 0.0 },
            gate: Gate { on: false, slack: 1.0, patience_s: 1.0, strict_patience_s: 1.0 },
            learning: Learning { memory_s: f64::INFINITY, adapts: false },
        };
        filter.update(&Line, &(), belief, measured, settings, &mut Info::new(groups, 1)).expect("regular");
    }

    /// One pass of filter and smoother.
    fn smoothed() -> Vec<Vec<f64>> {
        let one = || std::iter::once(0..1).collect::<Vec<_>>();
        let groups = RowGroups { parts: one(), sources: one(), ..RowGroups::default() };
        let (mut filter, mut transition, mut now) = (Filter::extended(&Line, &groups), Transition::default(), prior());
        let mut nodes = Vec::new();
        update(&mut filter, &groups, &mut now, Z[0]);
        for (k, z) in Z.iter().enumerate().skip(1) {
            let filtered = now.clone();
            filter.predict(&Line, &mut now, k as f64 * DT_S, &mut transition);
            nodes.push((filtered, transition.clone(), now.clone()));
            update(&mut filter, &groups, &mut now, *z);
        }
        let (mut smoother, mut course) = (Smoother::new(2), vec![now.mean.clone()]);
        for (mut filtered, transition, predicted) in nodes.into_iter().rev() {
            smoother.back(&Line, &mut filtered, &transition, &predicted, &now).expect("regular");
            course.insert(0, filtered.mean.clone());
            now = filtered;
        }
        course
    }

    #[test]
    fn a_pass_on_a_linear_system_is_the_minimum() {
        let course = smoothed();
        let least = objective(&course);
        for (k, i) in (0..Z.len()).flat_map(|k| [(k, 0), (k, 1)]) {
            let [up, down] = [1e-3, -1e-3].map(|by| {
                let mut moved = course.clone();
                moved[k][i] += by;
                objective(&moved)
            });
            // A quadratic function rises alike on both sides of its minimum, and nowhere else.
            assert!(up > least && (up - down).abs() < 1e-6 * (up - least), "state {i} of sample {k}");
        }
    }
}
