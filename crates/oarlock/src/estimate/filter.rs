//! The filter: prediction and update, for the tracker. Allocates nothing after it is made.
//!
//! Equation numbers are those of docs/filter.md. U1 to U4 are computed in `estimate::sigma` (U9 in
//! `linearised`), U5 to U8 in `estimate::information`, the gate in `gate`, the factorised update in `limbs`.

mod gate;
mod limbs;
mod linearised;
mod measurement;
mod report;

use super::belief::Belief;
use super::information::{Carried, Columns, Force, InformationUpdate, Side, WeightedReadings};
use super::shear::Shear;
use super::sigma::{PredictedReadings, ReadingContext, Spread};
use super::transition::{apply_to_rows, congruence, Block, Transition};
use super::FastSystem;
use crate::kernels::arch::Arch;
use crate::kernels::dense::{NotPositive, Square};
use crate::kernels::tiles::{factor, padded, Panel, Sweep, RAISES, VECTOR};
use limbs::Limbs;
use linearised::Linearised;
pub use measurement::{DirectionTest, Gate, Measurement, RowGroups, UpdateSettings};
pub use report::{Diverged, Info, SourceInfo, Verdict};
use std::ops::Range;

/// Workspace of a filter.
#[derive(Debug, Clone)]
pub struct Filter<S: FastSystem> {
    arch: Arch,
    scratch: S::Scratch,
    predicted: PredictedReadings,
    /// Of an extended filter; without it, sigma points are used.
    linear: Option<Linearised>,
    /// Of a factorised filter, which updates limb by limb; the stage of each source and the current one.
    limbs: Option<Box<Limbs<S::Scratch, S::Moment>>>,
    stages: Vec<usize>,
    stage: usize,
    information: InformationUpdate,
    /// L' of U1, upper triangular.
    l_transposed: Panel,
    /// First row of each of its vectors of columns that is not zero.
    starts: Vec<usize>,
    /// All rows in the order of the update: inertial units first.
    order: Vec<usize>,
    /// Per row: whether it belongs to an inertial unit.
    inertial: Vec<bool>,
    /// Rows present in this update, and how many of them belong to inertial units; they come first.
    rows: Vec<usize>,
    inertial_rows: usize,
    /// Innovations divided by their noise.
    y: Vec<f64>,
    used: Vec<bool>,
    /// Source of each part.
    part_sources: Vec<usize>,
    /// NIS of each part or source in the last tests.
    tested: Vec<f64>,
    /// Per row: one over the standard deviation of its noise.
    weight: Vec<f64>,
    /// x+ - x.
    shift: Vec<f64>,
    variance: Vec<f64>,
    /// Time since the last sample, s.
    since_s: f64,
    /// Jr(delta) of P3.
    reset: Vec<Block>,
    /// I + B of P4.
    shears: Vec<Shear>,
    /// NIS and number of the rows that the last update rejected.
    rejected_nis: f64,
    rejected_rows: usize,
}

impl<S: FastSystem> Filter<S> {
    /// Workspace of an unscented filter.
    pub fn new(system: &S, groups: &RowGroups) -> Self {
        Self::with(system, groups, PredictedReadings::new(system), None)
    }

    /// Workspace of an extended filter, which linearises the readings at the mean.
    pub fn extended(system: &S, groups: &RowGroups) -> Self {
        Self::with(system, groups, PredictedReadings::linear(system), Some(Linearised::new(system)))
    }

    /// Workspace of a factorised filter; it is the unscented one if the system has no limbs.
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
            since_s: 0.0,
            reset: Vec::with_capacity(n),
            shears: Vec::with_capacity(n),
            rejected_nis: 0.0,
            rejected_rows: 0,
        }
    }

    /// Sets the instruction set, for comparisons.
    #[doc(hidden)]
    pub fn use_arch(&mut self, arch: Arch) {
        self.arch = arch;
    }

    /// x+ - x of the last update.
    pub fn shift(&self) -> &[f64] {
        &self.shift
    }

    /// One over the standard deviation of a reading's noise, as the last update used it.
    pub fn weight(&self, row: usize) -> f64 {
        self.weight[row]
    }

    /// Multiplies columns by the inverse of a factor of S, as the last update used it; see [`InformationUpdate::substitute`]. For a whole
    /// update in information form.
    pub fn substitute(&self, side: Side, columns: &mut Columns) {
        self.information.substitute(self.arch, side, columns);
    }

    /// The effect of the last update, a whole one in information form, on derivatives of the mean, a row for each state (P3, P4); see
    /// [`InformationUpdate::carry`]. `apart` has every rotation.
    pub fn carry(&self, forces: &[Force], apart: &[Apart], carried: &mut Carried, slopes: &mut [f64]) {
        carried.before.copy_from_slice(slopes);
        self.information.carry(self.arch, &self.l_transposed, forces, carried, slopes);
        for block in &self.reset {
            let Some(own) = apart.iter().find(|own| own.state == block.index[0]) else { continue };
            leave_chart(self.arch, (block, &self.shift, &own.share), &carried.before, slopes);
        }
        self.follow_shears(apart, slopes);
    }

    /// P4, by its share in each column.
    fn follow_shears(&self, apart: &[Apart], slopes: &mut [f64]) {
        for shear in &self.shears {
            let Some(own) = apart.iter().find(|own| own.state == shear.from) else { continue };
            shear.apply_to_columns(slopes, own.share.iter().copied());
        }
    }

    /// Starts a new sample.
    pub fn begin_sample(&mut self) {
        self.since_s = 0.0;
    }

    /// Predicts the belief at `to_s` (P1, P2); `transition` is the motion that was used.
    pub fn predict(&mut self, system: &S, belief: &mut Belief, to_s: f64, transition: &mut Transition) {
        belief.covariance.diagonal(&mut self.variance);
        let dt = to_s - belief.time_s;
        system.transition(dt, &belief.mean, &self.variance, transition);
        transition.apply_to_mean(&mut belief.mean);
        transition.apply_to_covariance(self.arch, &mut belief.covariance);
        belief.time_s = to_s;
        self.since_s += dt;
    }

    /// Updates the belief with the readings of one instant.
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
        self.factorise(&belief.covariance)?; // U1: L'
        self.predict_readings(system, moment, &belief.mean, settings.spread); // U1, U2: h0, H, E, d
        self.innovate(measured, info); // U3: y
        self.whiten(); // U5: S
        self.gate_parts(measured, settings, belief, info);
        self.report(measured, info);
        self.solve(measured, info)?; // U6, U7: W, w, V, b, X
        self.combine(system, belief)?; // U8, P3: x+, P+
        Ok(())
    }

    /// h0, H, E and d: from sigma points (U1, U2), or linearised (U9).
    fn predict_readings(&mut self, system: &S, moment: &S::Moment, mean: &[f64], spread: Spread) {
        let context = ReadingContext { system, moment, mean, rows: &self.rows, spread };
        let (arch, scratch, l_transposed) = (self.arch, &mut self.scratch, &self.l_transposed);
        match &mut self.linear {
            None => self.predicted.from_sigma_points(arch, context, scratch, l_transposed),
            Some(linearised) => linearised.fill(arch, &mut self.predicted, context, scratch, l_transposed),
        }
    }

    /// Lists the rows that are present and belong to the stage.
    fn list_rows(&mut self, z: &[f64], asked: impl Fn(usize) -> bool) {
        self.rows.clear();
        self.rows.extend(self.order.iter().copied().filter(|&r| !z[r].is_nan() && asked(r)));
        self.inertial_rows = self.rows.iter().take_while(|&&r| self.inertial[r]).count();
    }

    /// L' of U1. Where rounding took the sign of a pivot, the diagonal is raised by a relative 1e-12.
    fn factorise(&mut self, covariance: &Square) -> Result<(), Diverged> {
        let n = covariance.n();
        let mut done = Ok(());
        for share in RAISES {
            self.l_transposed.copy_raised(covariance, share);
            done = factor(self.arch, &mut self.l_transposed, Sweep { n, width: padded(n), starts: &self.starts });
            if done.is_ok() {
                break;
            }
        }
        done.map_err(|e| Diverged {
            what: format!("the covariance lost its sign (state {}, pivot {:.2e})", e.row, e.pivot),
        })
    }

    /// S of U5.
    fn whiten(&mut self) {
        let readings =
            WeightedReadings { rows: &self.rows, inertial: self.inertial_rows, weight: &self.weight, y: &self.y };
        self.information.whiten(self.arch, &self.predicted, readings);
    }

    /// U3, divided by the noise.
    fn innovate(&mut self, measured: Measurement, info: &mut Info) {
        self.weight.iter_mut().zip(measured.std).for_each(|(w, std)| *w = 1.0 / std);
        self.used.fill(false);
        self.y.fill(0.0);
        for &r in &self.rows {
            let v = measured.z[r] - self.predicted.h0[r] - self.predicted.d[r];
            info.innovation[r] = v;
            self.y[r] = v * self.weight[r];
            self.used[r] = true;
        }
    }

    /// U6 and U7, and what they say of the readings.
    fn solve(&mut self, measured: Measurement, info: &mut Info) -> Result<(), Diverged> {
        let verdict = self.information.solve(self.arch, &self.l_transposed).map_err(broken)?;
        let inertial = measured.groups.inertial.iter().filter(|&&r| self.used[r]).count();
        info.inertial = (if inertial == 0 { f64::NAN } else { verdict.inertial }, inertial);
        info.nis = verdict.nis;
        let rows = self.used.iter().filter(|&&used| used).count() + self.rejected_rows;
        info.log_likelihood = log_likelihood(info.nis + self.rejected_nis, rows);
        Ok(())
    }

    /// U8, P3 and P4.
    fn combine(&mut self, system: &S, belief: &mut Belief) -> Result<(), Diverged> {
        self.information.posterior(self.arch, &mut self.shift, &mut belief.covariance);
        system.shift(&mut belief.mean, &self.shift);
        self.reset.clear();
        system.reset_jacobian(&self.shift, &mut self.reset);
        self.reset.iter().for_each(|block| congruence(self.arch, block, &mut belief.covariance));
        self.shears.clear();
        system.shears(&belief.mean, &self.shift, &mut self.shears);
        self.shears.iter().for_each(|shear| shear.apply(&mut belief.covariance));
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

/// For a rotation, by parameter: 1 if its error stays in the axes of what carries the body, 0 if it stays in the body's own.
#[derive(Debug, Clone)]
pub struct Apart {
    /// First state of the rotation.
    pub state: usize,
    /// A number for each parameter.
    pub share: Vec<f64>,
}

/// The derivative S+ of a rotation by a parameter after an update by delta(p), of R Exp(S p) Exp(delta): what is from before turns with the
/// mean, the change of delta follows Jr(delta) of P3. Exp(delta)' S + Jr (S+ - S) = S + Jr (S+ - S - delta x S). An error of the body's own
/// axes turns delta too, by -S x delta, so that delta x S is left out.
fn leave_chart(arch: Arch, (jr, shift, share): (&Block, &[f64], &[f64]), before: &[f64], slopes: &mut [f64]) {
    let (width, [x, y, z]) = (share.len(), jr.index);
    let add = |slopes: &mut [f64], to: usize, by: f64, from: usize| {
        let from = &before[from * width..(from + 1) * width];
        slopes[to * width..(to + 1) * width].iter_mut().zip(from).for_each(|(s, b)| *s += by * b);
    };
    for (i, j, k) in [(x, y, z), (y, z, x), (z, x, y)] {
        add(slopes, i, -1.0, i);
        let [to_j, to_k] = [j, k].map(|r| &before[r * width..(r + 1) * width]);
        let turned =
            to_j.iter().zip(to_k).zip(share).map(|((b_j, b_k), share)| share * (shift[k] * b_j - shift[j] * b_k));
        slopes[i * width..(i + 1) * width].iter_mut().zip(turned).for_each(|(s, t)| *s += t);
    }
    apply_to_rows(arch, std::slice::from_ref(jr), slopes, width);
    jr.index.into_iter().for_each(|i| add(slopes, i, 1.0, i));
}

/// Model errors last for several samples, so a sample counts as this share of an independent one.
const SAMPLES_ALIKE: f64 = 4.0;

/// Log-likelihood of a hypothesis: Student's, with as many degrees of freedom as rows, so that one jolt does not decide. The determinant is
/// left out: while a body rests it would favour whatever posture predicts least motion.
pub fn log_likelihood(nis: f64, rows: usize) -> f64 {
    let rows = rows.max(1) as f64;
    -0.5 * rows * (nis / rows).ln_1p() / SAMPLES_ALIKE
}
