//! One filter: predict exactly, update with every reading of a sample at once. Allocates nothing after it is made.
//!
//! The update is the unscented one (estimate/sigma.rs) in information form: with G and y divided by the noise,
//! 1 + G'G = V'V, b = V'^-1 G'y, and for the part of V and b that belongs to H: X = V22'^-1 (rows of U reversed),
//! x+ = x + X' b2, P+ = X'X. P+ cannot lose its symmetry or its sign.

mod search;
mod tangent;

use super::belief::Belief;
use super::dense::{accumulate, cholesky_of_gram, factor_of_covariance, solve_transposed, Square};
use super::gate::{self, Room};
use super::learn::{Correction, Learning};
use super::sigma::{Fan, Spread};
use super::transition::{carry, Block, Transition};
use super::System;
use search::Search;
use std::ops::Range;
use tangent::Tangent;

/// Which rows belong together.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Groups {
    /// Accepted or rejected together.
    pub parts: Vec<Range<usize>>,
    /// Reported together; each covers whole parts.
    pub sources: Vec<Range<usize>>,
    /// All rows of inertial units, whose joint consistency is reported.
    pub inertial: Vec<usize>,
}

/// What an update did with one source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceInfo {
    /// Normalised innovation squared over the used rows; NaN if none was used.
    pub nis: f64,
    /// Rows used.
    pub used: u8,
    /// Rows there but not believed.
    pub rejected: u8,
    /// Rows not there.
    pub missing: u8,
}

/// The report of one update.
#[derive(Debug, Clone, PartialEq)]
pub struct Info {
    /// Reading minus predicted reading, NaN where missing.
    pub innovation: Vec<f64>,
    /// Of all used rows together.
    pub nis: f64,
    /// Of all used rows of inertial units together, and how many there were.
    pub inertial: (f64, usize),
    /// In the order of the sources.
    pub sources: Vec<SourceInfo>,
    /// How well the readings fit, as the logarithm of a likelihood; what was rejected counts as just tolerable.
    pub evidence: f64,
}

impl Info {
    /// Room for `groups`.
    pub fn new(groups: &Groups, rows: usize) -> Self {
        let none = SourceInfo { nis: f64::NAN, used: 0, rejected: 0, missing: 0 };
        Info {
            innovation: vec![f64::NAN; rows],
            nis: f64::NAN,
            inertial: (f64::NAN, 0),
            sources: vec![none; groups.sources.len()],
            evidence: 0.0,
        }
    }
}

/// The belief is no longer a belief.
#[derive(Debug, Clone, PartialEq)]
pub struct Lost {
    /// What broke.
    pub what: String,
}

/// What an update is told.
#[derive(Debug, Clone, Copy)]
pub struct Sighting<'a> {
    /// Readings; NaN is missing.
    pub z: &'a [f64],
    /// Standard deviation of each row's noise.
    pub std: &'a [f64],
    /// Parts that are not to be believed whatever the innovation says.
    pub barred: &'a [bool],
    /// Parts that pass at the bare quantile or not at all.
    pub strict: &'a [bool],
    /// Rows that belong together.
    pub groups: &'a Groups,
}

/// How innovations are tested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gate {
    /// Test at all.
    pub on: bool,
    /// A part is odd when its normalised innovation squared exceeds the 1e-6 quantile this many times.
    pub slack: f64,
    /// A part rejected for longer than this is believed again, s: the belief may be wrong, not the sensor.
    pub patience_s: f64,
}

/// No belief is so wrong that a reading may be a million standard deviations off: that is no reading.
const ABSURD_NIS: f64 = 1e12;

/// How an update is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Manner {
    /// Of the sigma points.
    pub spread: Spread,
    /// Of innovations.
    pub gate: Gate,
    /// Of driving noise.
    pub learning: Learning,
}

/// Workspace of a filter.
#[derive(Debug, Clone)]
pub struct Filter<S: System> {
    scratch: S::Scratch,
    fan: Fan,
    /// Of a filter that linearises; without it, sigma points are spread.
    linear: Option<(Tangent, Search)>,
    factor: Square,
    gram: Square,
    x: Square,
    y: Vec<f64>,
    b: Vec<f64>,
    used: Vec<bool>,
    weight: Vec<f64>,
    shift: Vec<f64>,
    variance: Vec<f64>,
    rows: [Vec<f64>; 3],
    room: Room,
    /// Variance of each state before the update, and what the last prediction added to it.
    before: Vec<f64>,
    fresh: Vec<f64>,
    since_s: f64,
    carried: Vec<Block>,
    /// Of what the last update rejected.
    rejected_nis: f64,
    rejected_rows: usize,
}

impl<S: System> Filter<S> {
    /// Room for an unscented filter of `system`.
    pub fn new(system: &S, groups: &Groups) -> Self {
        let fan = Fan::new(system.partition(), system.input_std().len(), system.row_count());
        Self::with(system, groups, fan, None)
    }

    /// Room for an extended filter, which linearises the readings up to `rounds` times an update; from two on, it is the
    /// iterated one.
    pub fn extended(system: &S, groups: &Groups, rounds: usize) -> Self {
        let (n, m) = (system.partition().dim(), system.row_count());
        let tangent = Tangent::new(n, system.input_std().len(), m);
        let fan = tangent.fan(m);
        let search = Search::new(rounds, n, fan.width);
        Self::with(system, groups, fan, Some((tangent, search)))
    }

    fn with(system: &S, groups: &Groups, fan: Fan, linear: Option<(Tangent, Search)>) -> Self {
        let (n, m, width) = (system.partition().dim(), system.row_count(), fan.width);
        Filter {
            scratch: system.scratch(),
            fan,
            linear,
            factor: Square::zeros(n),
            gram: Square::zeros(width),
            x: Square::zeros(n),
            y: vec![0.0; m],
            b: vec![0.0; width],
            used: vec![false; m],
            weight: vec![0.0; m],
            shift: vec![0.0; n],
            variance: vec![0.0; n],
            rows: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
            room: Room::new(groups.inertial.len()),
            before: vec![0.0; n],
            fresh: vec![0.0; n],
            since_s: 0.0,
            carried: Vec::with_capacity(n),
            rejected_nis: 0.0,
            rejected_rows: 0,
        }
    }

    /// Forgets what earlier predictions added: a new sample is awaited.
    pub fn await_sample(&mut self) {
        self.fresh.fill(0.0);
        self.since_s = 0.0;
    }

    /// Moves the belief on to `to_s`; `transition` tells how it moved.
    pub fn predict(&mut self, system: &S, belief: &mut Belief, to_s: f64, transition: &mut Transition) {
        belief.covariance.diagonal(&mut self.variance);
        let dt = to_s - belief.time_s;
        system.transition(dt, &belief.mean, &self.variance, &belief.drive, transition);
        transition.apply_to_mean(&mut belief.mean);
        transition.apply_to_covariance(&mut belief.covariance, &mut self.rows);
        belief.time_s = to_s;
        for b in &transition.blocks {
            (0..b.len).for_each(|i| self.fresh[b.index[i]] += b.noise[i][i]);
        }
        self.since_s += dt;
    }

    /// Takes in the readings of one instant.
    pub fn update(
        &mut self,
        system: &S,
        moment: &S::Moment,
        belief: &mut Belief,
        sighting: Sighting,
        manner: Manner,
        info: &mut Info,
    ) -> Result<(), Lost> {
        if sighting.z.iter().all(|z| z.is_nan()) {
            self.report_missing(sighting, info);
            return Ok(());
        }
        self.factorise(&belief.covariance)?;
        match &mut self.linear {
            None => self.fan.spread(system, moment, &mut self.scratch, &belief.mean, &self.factor, manner.spread),
            Some((tangent, _)) => {
                tangent.prepare(&self.factor);
                tangent.spread(&mut self.fan, system, (moment, &mut self.scratch), (&belief.mean, &[]), sighting.z);
            }
        }
        self.whiten(sighting, belief.inflation, info);
        self.judge(sighting, manner, belief);
        self.report(sighting, info);
        self.learn_noise(belief, manner.learning, info.inertial);
        belief.covariance.diagonal(&mut self.before);
        self.solve()?;
        self.report_fit(info);
        self.iterate(system, moment, &belief.mean, sighting)?;
        self.combine(system, belief)?;
        self.learn(system, belief, manner.learning);
        Ok(())
    }

    fn learn(&mut self, system: &S, belief: &mut Belief, learning: Learning) {
        if self.since_s == 0.0 {
            return;
        }
        for (&i, drive) in system.driven().iter().zip(&mut belief.drive) {
            let after = belief.covariance.at(i, i);
            let c = Correction { shift: self.shift[i], before: self.before[i], after, fresh: self.fresh[i] };
            *drive = learning.drive(*drive, self.since_s, c);
        }
    }

    /// From the innovations of all inertial units together: what units say of each other shows in no single one.
    fn learn_noise(&self, belief: &mut Belief, learning: Learning, (nis, used): (f64, usize)) {
        if used == 0 || !nis.is_finite() {
            return;
        }
        let ratio = nis / used as f64;
        belief.inflation = learning.inflation(belief.inflation, belief.surprise, self.since_s, ratio);
        belief.surprise = learning.habit(belief.surprise, self.since_s, ratio);
    }

    fn factorise(&mut self, covariance: &Square) -> Result<(), Lost> {
        factor_of_covariance(covariance, &mut self.factor).map_err(|e| Lost {
            what: format!("the covariance lost its sign (state {}, pivot {:.2e})", e.row, e.pivot),
        })
    }

    fn whiten(&mut self, sighting: Sighting, inflation: f64, info: &mut Info) {
        let width = self.fan.width;
        self.weight.iter_mut().zip(sighting.std).for_each(|(w, std)| *w = 1.0 / std);
        if inflation > 1.0 {
            let factor = 1.0 / inflation.sqrt();
            sighting.groups.inertial.iter().for_each(|&r| self.weight[r] *= factor);
        }
        for (r, g) in self.fan.g.chunks_exact_mut(width).enumerate() {
            let v = sighting.z[r] - self.fan.center[r] - self.fan.bend[r];
            info.innovation[r] = v;
            self.used[r] = !v.is_nan();
            let weight = self.weight[r];
            self.y[r] = if self.used[r] { v * weight } else { 0.0 };
            let weight = if self.used[r] { weight } else { 0.0 };
            g.iter_mut().for_each(|x| *x = if weight == 0.0 { 0.0 } else { *x * weight });
        }
    }

    fn judge(&mut self, sighting: Sighting, manner: Manner, belief: &mut Belief) {
        let gate = manner.gate;
        let groups = sighting.groups;
        (self.rejected_nis, self.rejected_rows) = (0.0, 0);
        for (p, rows) in groups.parts.iter().enumerate() {
            let count = self.used[rows.clone()].iter().filter(|&&u| u).count();
            if count == 0 {
                continue;
            }
            let barred = sighting.barred[p];
            let slack = if sighting.strict[p] { 1.0 } else { gate.slack };
            let since = &mut belief.rejected_since_s[p];
            // At low rates patience spans a few samples at least.
            let patience_s = gate.patience_s.max(3.0 * self.since_s);
            let patient = since.is_nan() || belief.time_s - *since <= patience_s;
            let nis = gate::nis(&self.fan.g, self.fan.width, &self.y, rows.clone(), &mut self.room);
            // Written so that what is not a number is absurd too.
            let absurd = !nis.is_some_and(|x| x < ABSURD_NIS);
            let nis = nis.filter(|_| !absurd).unwrap_or(ABSURD_NIS);
            let habit = &mut belief.habit[p];
            let odd = absurd || (gate.on && patient && nis > slack * habit.max(1.0) * gate::threshold(count));
            if !barred {
                *habit = manner.learning.habit(*habit, self.since_s, nis / count as f64);
            }
            if odd && !barred {
                self.rejected_nis += nis.min(slack * gate::threshold(count));
                self.rejected_rows += count;
            }
            if barred || odd {
                self.used[rows.clone()].fill(false);
                self.y[rows.clone()].fill(0.0);
            }
            *since = match (odd, since.is_nan()) {
                (true, true) => belief.time_s,
                (true, false) => *since,
                _ => f64::NAN,
            };
        }
    }

    fn report(&mut self, sighting: Sighting, info: &mut Info) {
        let width = self.fan.width;
        for (g, _) in self.fan.g.chunks_exact_mut(width).zip(&self.used).filter(|(_, &used)| !used) {
            g.fill(0.0);
        }
        for (source, rows) in info.sources.iter_mut().zip(&sighting.groups.sources) {
            let there = rows.clone().filter(|&r| !info.innovation[r].is_nan()).count();
            let used = rows.clone().filter(|&r| self.used[r]).count();
            source.used = used as u8;
            source.rejected = (there - used) as u8;
            source.missing = (rows.len() - there) as u8;
            let nis = gate::nis(&self.fan.g, width, &self.y, rows.clone(), &mut self.room);
            source.nis = if used == 0 { f64::NAN } else { nis.unwrap_or(f64::NAN) };
        }
        let rows = sighting.groups.inertial.iter().copied();
        let used = rows.clone().filter(|&r| self.used[r]).count();
        let nis = gate::nis(&self.fan.g, width, &self.y, rows, &mut self.room);
        info.inertial = (if used == 0 { f64::NAN } else { nis.unwrap_or(f64::NAN) }, used);
    }

    fn report_missing(&mut self, sighting: Sighting, info: &mut Info) {
        info.innovation.fill(f64::NAN);
        info.nis = f64::NAN;
        info.inertial = (f64::NAN, 0);
        info.evidence = 0.0;
        for (source, rows) in info.sources.iter_mut().zip(&sighting.groups.sources) {
            *source = SourceInfo { nis: f64::NAN, used: 0, rejected: 0, missing: rows.len() as u8 };
        }
    }

    /// V and b.
    fn solve(&mut self) -> Result<(), Lost> {
        let width = self.fan.width;
        let broken = |e: super::dense::NotPositive| Lost {
            what: format!("the update broke (row {}, pivot {:.2e})", e.row, e.pivot),
        };
        cholesky_of_gram(&self.fan.g, &self.used, &mut self.gram).map_err(broken)?;
        self.b.fill(0.0);
        accumulate(&mut self.b, self.y.iter().copied().zip(self.fan.g.chunks_exact(width)));
        solve_transposed(&self.gram, 0, &mut self.b);
        Ok(())
    }

    fn report_fit(&self, info: &mut Info) {
        info.nis = squared(&self.y) - squared(&self.b);
        let rows = self.used.iter().filter(|&&used| used).count() + self.rejected_rows;
        info.evidence = evidence(info.nis + self.rejected_nis, rows);
    }

    fn combine(&mut self, system: &S, belief: &mut Belief) -> Result<(), Lost> {
        let (n, width) = (self.factor.n(), self.fan.width);
        self.solve_for_x(n, width - n);
        self.shift.fill(0.0);
        let b2 = &self.b[width - n..];
        accumulate(&mut self.shift, b2.iter().copied().zip(self.x.as_slice().chunks_exact(n)));
        system.shift(&mut belief.mean, &self.shift);
        for i in 0..n {
            let row = &mut belief.covariance.row_mut(i)[i..];
            row.fill(0.0);
            let x = &self.x;
            // Row k of X starts at column n - 1 - k.
            accumulate(row, (n - 1 - i..n).map(|k| (x.at(k, i), &x.row(k)[i..])));
        }
        belief.covariance.mirror_upper();
        self.carried.clear();
        system.carry(&self.shift, &mut self.carried);
        self.carried.iter().for_each(|block| carry(block, &mut belief.covariance, &mut self.rows));
        let finite = belief.mean.iter().all(|x| x.is_finite());
        if finite {
            Ok(())
        } else {
            Err(Lost { what: "the estimate is not a number".into() })
        }
    }

    /// X = V22'^-1 (rows of U reversed), by forward substitution.
    fn solve_for_x(&mut self, n: usize, offset: usize) {
        for k in 0..n {
            let start = n - 1 - k;
            let (above, row) = self.x.above_and_row(k);
            row[..start].fill(0.0);
            row[start..].copy_from_slice(&self.factor.row(start)[start..]);
            let gram = &self.gram;
            let terms = (0..k).map(|i| (-gram.at(offset + i, offset + k), &above[i * n + start..(i + 1) * n]));
            accumulate(&mut row[start..], terms);
            let scale = 1.0 / gram.at(offset + k, offset + k);
            row[start..].iter_mut().for_each(|x| *x *= scale);
        }
    }
}

/// So many samples in a row say the same: what a model gets wrong lasts.
const SAMPLES_ALIKE: f64 = 4.0;

/// Of a Student distribution with as many degrees of freedom as rows, so that a jolt decides nothing. Its determinant is
/// left out: while a body rests it would favour whatever posture predicts least motion.
pub fn evidence(nis: f64, rows: usize) -> f64 {
    let rows = rows.max(1) as f64;
    -0.5 * rows * (nis / rows).ln_1p() / SAMPLES_ALIKE
}

fn squared(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum()
}
