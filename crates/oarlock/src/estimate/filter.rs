//! One filter: predict exactly, update with every reading of a sample at once. Allocates nothing after it is made.
//!
//! The update is the unscented one (estimate/sigma.rs) in information form (estimate/solve.rs).

mod gate;
mod limbs;
mod linearised;

use super::belief::Belief;
use super::information::{InformationUpdate, WeightedReadings};
use super::learn::{Correction, Learning};
use super::sigma::{PredictedReadings, ReadingContext, Spread};
use super::transition::{congruence, Block, Transition};
use super::FastSystem;
use crate::kernels::arch::Arch;
use crate::kernels::dense::{NotPositive, Square};
use crate::kernels::tiles::{factor, padded, Panel, Sweep, RAISES, VECTOR};
use limbs::Limbs;
use linearised::Linearised;
use std::ops::Range;

/// Which rows belong together.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RowGroups {
    /// Accepted or rejected together.
    pub parts: Vec<Range<usize>>,
    /// Reported together; each covers whole parts.
    pub sources: Vec<Range<usize>>,
    /// All rows of inertial units, whose joint consistency is reported.
    pub inertial: Vec<usize>,
    /// Those of them whose noise is learnt by itself, beside that of all.
    pub rough: Vec<usize>,
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

/// What became of a part of the measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Not there.
    Missing,
    /// Used.
    Accepted,
    /// Not to be believed whatever the belief.
    Excluded,
    /// Too far off in the direction of its slant.
    WrongDirection,
    /// Too large an innovation.
    Outlier,
    /// Kept from the filter: its field has turned.
    Turned,
    /// Some or all of its rows kept from the filter: at the end of the range.
    Clipped,
    /// Kept from the filter: it repeats itself.
    Stuck,
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
    /// In the order of the parts.
    pub parts: Vec<Verdict>,
    /// How well the readings fit, as the logarithm of a likelihood; what was rejected counts as just tolerable.
    pub log_likelihood: f64,
    /// The belief was given up before, because its sensors contradicted it.
    pub lost: bool,
}

impl Info {
    /// Room for `groups`.
    pub fn new(groups: &RowGroups, rows: usize) -> Self {
        let none = SourceInfo { nis: f64::NAN, used: 0, rejected: 0, missing: 0 };
        Info {
            innovation: vec![f64::NAN; rows],
            nis: f64::NAN,
            inertial: (f64::NAN, 0),
            sources: vec![none; groups.sources.len()],
            parts: vec![Verdict::Missing; groups.parts.len()],
            log_likelihood: 0.0,
            lost: false,
        }
    }
}

/// The belief is no longer a belief.
#[derive(Debug, Clone, PartialEq)]
pub struct Diverged {
    /// What broke.
    pub what: String,
}

/// A direction in which a part is tested by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionTest {
    /// Unit vector over the part's three rows, which have the same noise.
    pub along: [f64; 3],
    /// How far off the part is in this direction.
    pub off: f64,
    /// How far it may be off.
    pub tolerance: f64,
    /// ... or so many standard deviations of the belief, where these are more.
    pub sigmas: f64,
}

/// What an update is told.
#[derive(Debug, Clone, Copy)]
pub struct Measurement<'a> {
    /// Readings; NaN is missing.
    pub z: &'a [f64],
    /// Standard deviation of each row's noise.
    pub std: &'a [f64],
    /// Parts that are not to be believed whatever the innovation says.
    pub excluded: &'a [bool],
    /// Parts that pass at the bare quantile or not at all, and whose oddities are no habit.
    pub strict: &'a [bool],
    /// Of parts that are tested in one direction by itself.
    pub direction_tests: &'a [Option<DirectionTest>],
    /// Rows that belong together.
    pub groups: &'a RowGroups,
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
    /// The same of a strict part, which is believed from then on until it fits.
    pub strict_patience_s: f64,
}

/// No belief is so wrong that a reading may be a million standard deviations off: that is no reading.
const ABSURD_NIS: f64 = 1e12;

/// How an update is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpdateSettings {
    /// Of the sigma points.
    pub spread: Spread,
    /// Of innovations.
    pub gate: Gate,
    /// Of driving noise.
    pub learning: Learning,
}

/// Workspace of a filter.
#[derive(Debug, Clone)]
pub struct Filter<S: FastSystem> {
    arch: Arch,
    scratch: S::Scratch,
    predicted: PredictedReadings,
    /// Of a filter that linearises; without it, sigma points are spread.
    linear: Option<Linearised>,
    /// Of a factorised one, which works limb by limb; the stage of each source and the one that is on.
    limbs: Option<Box<Limbs<S::Scratch, S::Moment>>>,
    stages: Vec<usize>,
    stage: usize,
    information: InformationUpdate,
    /// U with U'U = P.
    l_transposed: Panel,
    /// Starts of its columns.
    starts: Vec<usize>,
    /// All rows in the order in which they are worked off, inertial units first, and of these, how many there are.
    order: Vec<usize>,
    inertial: Vec<bool>,
    /// Those of them that are there.
    rows: Vec<usize>,
    inertial_rows: usize,
    y: Vec<f64>,
    used: Vec<bool>,
    /// Source of each part; what the last tests said, of each part or source.
    part_sources: Vec<usize>,
    tested: Vec<f64>,
    weight: Vec<f64>,
    shift: Vec<f64>,
    variance: Vec<f64>,
    /// Variance of each state before the update, and what the last prediction added to it.
    before: Vec<f64>,
    fresh: Vec<f64>,
    since_s: f64,
    reset: Vec<Block>,
    /// Of what the last update rejected.
    rejected_nis: f64,
    rejected_rows: usize,
}

impl<S: FastSystem> Filter<S> {
    /// Room for an unscented filter of `system`.
    pub fn new(system: &S, groups: &RowGroups) -> Self {
        Self::with(system, groups, PredictedReadings::new(system), None)
    }

    /// Room for an extended filter, which linearises the readings at the mean.
    pub fn extended(system: &S, groups: &RowGroups) -> Self {
        Self::with(system, groups, PredictedReadings::straight(system), Some(Linearised::new(system)))
    }

    /// Room for a factorised filter; where the system does not fall apart it is the unscented one.
    pub fn factorised(system: &S, groups: &RowGroups) -> Self {
        let whole = Self::new(system, groups);
        match Limbs::new(system, groups) {
            Some((limbs, stages)) => Filter { limbs: Some(Box::new(limbs)), stages, ..whole },
            None => whole,
        }
    }

    fn with(system: &S, groups: &RowGroups, predicted: PredictedReadings, linear: Option<Linearised>) -> Self {
        let (n, m) = (system.partition().dim(), system.row_count());
        let mut inertial = vec![false; m];
        groups.inertial.iter().for_each(|&r| inertial[r] = true);
        let mut order: Vec<usize> = (0..m).collect();
        order.sort_by_key(|&r| (!inertial[r], system.dependence(r)));
        let source_of = |part: &Range<usize>| groups.sources.iter().take_while(|s| s.end <= part.start).count();
        Filter {
            arch: Arch::best(),
            scratch: system.scratch(),
            linear,
            limbs: None,
            stages: vec![0; groups.sources.len()],
            stage: 0,
            information: InformationUpdate::new(m, predicted.e_columns, n, &groups.sources),
            predicted,
            l_transposed: Panel::zeros(n, padded(n)),
            starts: vec![0; padded(n) / VECTOR],
            order,
            inertial,
            rows: Vec::with_capacity(m),
            inertial_rows: 0,
            y: vec![0.0; m],
            used: vec![false; m],
            part_sources: groups.parts.iter().map(source_of).collect(),
            tested: vec![f64::NAN; groups.parts.len().max(groups.sources.len())],
            weight: vec![0.0; m],
            shift: vec![0.0; n],
            variance: vec![0.0; n],
            before: vec![0.0; n],
            fresh: vec![0.0; n],
            since_s: 0.0,
            reset: Vec::with_capacity(n),
            rejected_nis: 0.0,
            rejected_rows: 0,
        }
    }

    /// Uses these instructions instead of the best ones; to compare.
    #[doc(hidden)]
    pub fn use_arch(&mut self, arch: Arch) {
        self.arch = arch;
    }

    /// Whether all readings of an update are taken at once, so that innovations and shift belong together.
    pub fn is_whole(&self) -> bool {
        self.limbs.is_none()
    }

    /// By how much the last update moved the mean.
    pub fn shift(&self) -> &[f64] {
        &self.shift
    }

    /// Time since the update before the last, s.
    pub fn since_s(&self) -> f64 {
        self.since_s
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
        transition.apply_to_covariance(self.arch, &mut belief.covariance);
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
        measured: Measurement,
        settings: UpdateSettings,
        info: &mut Info,
    ) -> Result<(), Diverged> {
        if measured.z.iter().all(|z| z.is_nan()) {
            self.report_missing(measured, info);
            return Ok(());
        }
        info.innovation.fill(f64::NAN);
        if let Some(mut limbs) = self.limbs.take() {
            let done = self.update_limbs(&mut limbs, (system, moment), belief, measured, settings, info);
            self.limbs = Some(limbs);
            return done;
        }
        self.list_rows(measured.z, |_| true);
        self.factorise(&belief.covariance)?;
        match &mut self.linear {
            None => {
                let context =
                    ReadingContext { system, moment, mean: &belief.mean, rows: &self.rows, spread: settings.spread };
                self.predicted.spread(self.arch, context, &mut self.scratch, &self.l_transposed);
            }
            Some(linearised) => {
                let context =
                    ReadingContext { system, moment, mean: &belief.mean, rows: &self.rows, spread: settings.spread };
                linearised.spread(self.arch, &mut self.predicted, context, &mut self.scratch, &self.l_transposed);
            }
        }
        self.innovate(measured, (belief.inflation, belief.roughness), info);
        let (rows, inertial) = (&self.rows, self.inertial_rows);
        let readings = WeightedReadings { rows, inertial, weight: &self.weight, y: &self.y };
        self.information.whiten(self.arch, &self.predicted, readings);
        self.gate_parts(measured, settings, belief, info);
        self.report(measured, info);
        belief.covariance.diagonal(&mut self.before);
        self.solve(measured, info)?;
        self.combine(system, belief)?;
        self.learn_noise(belief, settings.learning, info.inertial);
        self.learn(system, belief, settings.learning);
        Ok(())
    }

    fn factorise(&mut self, covariance: &Square) -> Result<(), Diverged> {
        let n = covariance.n();
        let sweep = Sweep { n, width: padded(n), starts: &self.starts };
        let mut done = Ok(());
        for share in RAISES {
            self.l_transposed.copy_raised(covariance, share);
            done = factor(self.arch, &mut self.l_transposed, sweep);
            if done.is_ok() {
                break;
            }
        }
        done.map_err(|e| Diverged {
            what: format!("the covariance lost its sign (state {}, pivot {:.2e})", e.row, e.pivot),
        })
    }

    /// Rows that are there and asked for.
    fn list_rows(&mut self, z: &[f64], asked: impl Fn(usize) -> bool) {
        self.rows.clear();
        self.rows.extend(self.order.iter().copied().filter(|&r| !z[r].is_nan() && asked(r)));
        self.inertial_rows = self.rows.iter().take_while(|&&r| self.inertial[r]).count();
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
        belief.surprise = learning.usual_nis(belief.surprise, self.since_s, ratio);
    }

    fn innovate(&mut self, measured: Measurement, (inflation, roughness): (f64, f64), info: &mut Info) {
        self.weight.iter_mut().zip(measured.std).for_each(|(w, std)| *w = 1.0 / std);
        if inflation > 1.0 {
            let factor = 1.0 / inflation.sqrt();
            measured.groups.inertial.iter().for_each(|&r| self.weight[r] *= factor);
        }
        if roughness > 1.0 {
            let factor = 1.0 / roughness.sqrt();
            measured.groups.rough.iter().for_each(|&r| self.weight[r] *= factor);
        }
        self.used.fill(false);
        self.y.fill(0.0);
        for &r in &self.rows {
            let v = measured.z[r] - self.predicted.h0[r] - self.predicted.d[r];
            info.innovation[r] = v;
            self.y[r] = v * self.weight[r];
            self.used[r] = true;
        }
    }

    fn solve(&mut self, measured: Measurement, info: &mut Info) -> Result<(), Diverged> {
        let verdict = self.information.solve(self.arch, &self.l_transposed).map_err(broken)?;
        let inertial = measured.groups.inertial.iter().filter(|&&r| self.used[r]).count();
        info.inertial = (if inertial == 0 { f64::NAN } else { verdict.inertial }, inertial);
        info.nis = verdict.nis;
        let rows = self.used.iter().filter(|&&used| used).count() + self.rejected_rows;
        info.log_likelihood = log_likelihood(info.nis + self.rejected_nis, rows);
        Ok(())
    }

    fn combine(&mut self, system: &S, belief: &mut Belief) -> Result<(), Diverged> {
        self.information.posterior(self.arch, &mut self.shift, &mut belief.covariance);
        system.shift(&mut belief.mean, &self.shift);
        self.reset.clear();
        system.reset_jacobian(&self.shift, &mut self.reset);
        self.reset.iter().for_each(|block| congruence(self.arch, block, &mut belief.covariance));
        let finite = belief.mean.iter().all(|x| x.is_finite());
        if finite {
            Ok(())
        } else {
            Err(Diverged { what: "the estimate is not a number".into() })
        }
    }
}

fn broken(e: NotPositive) -> Diverged {
    Diverged { what: format!("the update broke (row {}, pivot {:.2e})", e.row, e.pivot) }
}

/// So many samples in a row say the same: what a model gets wrong lasts.
const SAMPLES_ALIKE: f64 = 4.0;

/// Of a Student distribution with as many degrees of freedom as rows, so that a jolt decides nothing. Its determinant is
/// left out: while a body rests it would favour whatever posture predicts least motion.
pub fn log_likelihood(nis: f64, rows: usize) -> f64 {
    let rows = rows.max(1) as f64;
    -0.5 * rows * (nis / rows).ln_1p() / SAMPLES_ALIKE
}
