//! A body that lives the life that its model describes, and tells what its sensors read.

use super::chance::Chance;
use super::{so3, started};
use nalgebra::{DMatrix, DVector, Vector3};
use oarlock::body::Body;
use oarlock::config::Config;
use oarlock::estimate::belief::Belief;
use oarlock::estimate::transition::Transition;
use oarlock::estimate::{Points, System};
use oarlock::kernels::lane::{Lane, LANES};
use oarlock::recording::Sample;
use oarlock::sensor::Quantity;

pub struct Nature<'a> {
    pub body: &'a Body,
    pub state: Vec<f64>,
    pub chance: Chance,
}

impl<'a> Nature<'a> {
    /// Somewhere about `mean`, as far as `std` says.
    pub fn about(body: &'a Body, mean: &[f64], std: &[f64], mut chance: Chance) -> Self {
        let away: Vec<f64> = std.iter().map(|s| s * chance.normal()).collect();
        let mut state: Vec<f64> = mean.iter().zip(&away).map(|(m, a)| m + a).collect();
        for (_, slots) in &body.layout.turns {
            let turned = so3::plus(so3::three(mean, slots.q), so3::three(&away, slots.q));
            state[slots.q..slots.q + 3].copy_from_slice(turned.as_slice());
        }
        Nature { body, state, chance }
    }

    pub fn live(&mut self, dt: f64) {
        let (n, old) = (self.state.len(), self.state.clone());
        let mut transition = Transition::default();
        self.body.transition(dt, &self.state, &vec![0.0; n], &mut transition);
        // Rotations move in the chart at themselves, noise and all.
        let turns = &self.body.layout.turns;
        turns.iter().for_each(|(_, slots)| self.state[slots.q..slots.q + 3].fill(0.0));
        transition.turnings.clear();
        transition.apply_to_mean(&mut self.state);
        for b in &transition.blocks {
            let noise = DMatrix::from_fn(b.len, b.len, |r, c| b.noise[r][c]);
            let root = noise.cholesky().expect("positive").unpack();
            let kick = root * DVector::from_vec(self.chance.normals(b.len));
            (0..b.len).for_each(|r| self.state[b.index[r]] += kick[r]);
        }
        for (_, slots) in turns {
            let moved = so3::plus(so3::three(&old, slots.q), so3::three(&self.state, slots.q));
            self.state[slots.q..slots.q + 3].copy_from_slice(moved.as_slice());
        }
    }

    pub fn read(&mut self, time_s: f64) -> Sample {
        let body = self.body;
        let mut moment = body.moment();
        moment.active.fill(true);
        moment.needed.fill(true);
        let zero = vec![Lane([0.0; LANES]); self.state.len()];
        let mut out = vec![Lane([0.0; LANES]); body.suite.len()];
        let at = Points { mean: &self.state, delta: &zero, off: &[] };
        body.readings(&moment, &mut body.scratch(), at, &mut out);
        let noise: Vec<f64> = body.suite.std().iter().map(|std| std * self.chance.normal()).collect();
        let mut z: Vec<f64> = out.iter().zip(&noise).map(|(h, noise)| h.0[0] + noise).collect();
        for source in body.suite.sources.iter().filter(|s| s.parts[0].quantity == Quantity::Orientation) {
            // Errors turn what is measured.
            let slow = body.layout.errors.iter().find(|slot| body.model.sensors[slot.sensor].name == source.name);
            let slow = slow.map_or(Vector3::zeros(), |slot| so3::three(&self.state, slot.first));
            let noise = so3::three(&noise, source.rows.start);
            let clean = so3::three(&z, source.rows.start) - noise - slow;
            z[source.rows.clone()].copy_from_slice(so3::plus(clean, slow + noise).as_slice());
        }
        let offset_s = vec![0.0; body.suite.sources.len()];
        Sample { time_s, z, inputs: vec![f64::NAN; body.model.coordinate_count()], offset_s }
    }
}

/// From `mean` to `truth`, in the tangent space at the mean.
pub fn error(body: &Body, mean: &[f64], truth: &[f64]) -> DVector<f64> {
    let mut error = DVector::from_fn(truth.len(), |i, _| truth[i] - mean[i]);
    for (_, slots) in &body.layout.turns {
        let turn = so3::minus(so3::three(truth, slots.q), so3::three(mean, slots.q));
        error.rows_mut(slots.q, 3).copy_from(&turn);
    }
    error
}

/// Normalised squared error.
pub fn nees(body: &Body, belief: &Belief, truth: &[f64]) -> f64 {
    let n = truth.len();
    let p = DMatrix::from_row_slice(n, n, belief.covariance.as_slice());
    let error = error(body, &belief.mean, truth);
    error.dot(&p.cholesky().expect("positive").solve(&error))
}

/// Sums over runs that are drawn from the filter's own model.
pub struct Sums {
    /// At the end of each run.
    pub nees: f64,
    pub states: usize,
    pub nis: f64,
    /// Of the second sensor alone.
    pub one_sensor: f64,
    pub readings: usize,
}

impl Sums {
    /// At 100 Hz, from starts that are as uncertain as `std`; `seed` is that of the first run.
    pub fn of(body: &Body, config: &Config, std: &[f64], [runs, steps]: [usize; 2], seed: u64) -> Self {
        let mut sums = Sums { nees: 0.0, states: 0, nis: 0.0, one_sensor: 0.0, readings: 0 };
        for run in 0..runs {
            let mean = vec![0.0; std.len()];
            let mut nature = Nature::about(body, &mean, std, Chance::new(seed + run as u64));
            let mut tracker = started(body, config, mean, std);
            for k in 1..=steps {
                nature.live(0.01);
                tracker.step(&nature.read(k as f64 * 0.01)).unwrap();
                sums.nis += tracker.info().nis;
                sums.one_sensor += tracker.info().sources[1].nis;
                sums.readings += tracker.info().sources.iter().map(|s| usize::from(s.used)).sum::<usize>();
            }
            let now = tracker.belief().unwrap();
            sums.nees += nees(body, now, &nature.state);
            sums.states += std.len();
        }
        sums
    }

    /// Squared errors and innovations, as shares of what is said of them.
    pub fn shares(&self) -> [f64; 2] {
        [self.nees / self.states as f64, self.nis / self.readings as f64]
    }
}
