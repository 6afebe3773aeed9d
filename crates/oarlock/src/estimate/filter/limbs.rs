//! The factorised update of [`Filter`]: one unscented update for each limb with the core, in turn. Equations in docs/filters.md.
//!
//! Each uses the readings of its limb; readings of the core alone go with the first. The correction of the core reaches the other limbs through
//! their regression on the core (`estimate::star`): messages on a junction tree (Lauritzen and Spiegelhalter 1988), whose nodes are the core
//! with a limb. For linear readings the result is one update of all states with all readings. Correlations between limbs beyond the core,
//! which prediction brings about, are dropped (Boyen and Koller 1998).

use super::broken;
use super::{log_likelihood, Diverged, Filter, Info, Measurement, RowGroups, UpdateSettings};
use crate::estimate::belief::Belief;
use crate::estimate::clique::{Clique, CliqueScratch, CliqueSystem};
use crate::estimate::information::{InformationUpdate, WeightedReadings};
use crate::estimate::sigma::{PredictedReadings, ReadingContext};
use crate::estimate::split::Split;
use crate::estimate::star::{places, Places, Star};
use crate::estimate::transition::{congruence, Block};
use crate::estimate::FastSystem;
use crate::kernels::arch::Arch;
use crate::kernels::dense::{NotPositive, Square};
use crate::kernels::tiles::{padded, Panel, VECTOR};
use std::mem::swap;
use std::ops::Range;

/// The update of a limb with the core.
#[derive(Debug, Clone)]
struct Stage {
    limb: usize,
    clique: Clique,
    /// Where core and limb stand among the clique's states.
    core_at: Vec<usize>,
    limb_at: Vec<usize>,
    predicted: PredictedReadings,
    information: InformationUpdate,
    l_transposed: Panel,
    starts: Vec<usize>,
    covariance: Square,
    mean: Vec<f64>,
    shift: Vec<f64>,
}

impl Stage {
    fn new<S: FastSystem>(system: &S, groups: &RowGroups, split: &Split, limb: usize, rows: Vec<bool>) -> Self {
        let own = &split.limbs[limb];
        let mut states = [&split.core[..], own].concat();
        states.sort_unstable();
        let n = states.len();
        let at = |some: &[usize]| some.iter().filter_map(|s| states.binary_search(s).ok()).collect();
        let (core_at, limb_at) = (at(&split.core), at(own));
        let clique = Clique::new(system, states, rows);
        let predicted = PredictedReadings::new(&CliqueSystem { system, clique: &clique });
        Stage {
            limb,
            core_at,
            limb_at,
            information: InformationUpdate::new(system.row_count(), predicted.e_columns, n, &groups.sources),
            predicted,
            l_transposed: Panel::zeros(n, padded(n)),
            starts: vec![0; padded(n) / VECTOR],
            covariance: Square::zeros(n),
            mean: vec![0.0; n],
            shift: vec![0.0; n],
            clique,
        }
    }

    fn places(&self) -> Places<'_> {
        Places { core: &self.core_at, limb: &self.limb_at }
    }
}

/// Workspace of a factorised update.
#[derive(Debug, Clone)]
pub(super) struct Limbs<C, M> {
    split: Split,
    stages: Vec<Stage>,
    star: Star,
    room: CliqueScratch<C>,
    /// The moment restricted to a stage's rows; made at the first sample.
    moment: Option<M>,
    /// Correction of the core by the stage, of all states by the stage, and of all states by all stages.
    step: Vec<f64>,
    shift: Vec<f64>,
    total: Vec<f64>,
}

impl<C, M> Limbs<C, M> {
    /// With the stage of each source; `None` if the system has no limbs.
    pub fn new<S: FastSystem<Scratch = C, Moment = M>>(system: &S, groups: &RowGroups) -> Option<(Self, Vec<usize>)> {
        let split = system.split();
        if split.limbs.is_empty() {
            return None;
        }
        let limb_of = |source: &Range<usize>| split.row_limbs[source.clone()].iter().find_map(|l| *l);
        let limbs: Vec<usize> = groups.sources.iter().map(|source| limb_of(source).unwrap_or(0)).collect();
        let stage = |limb: usize| {
            let mut rows = vec![false; system.row_count()];
            let own = groups.sources.iter().zip(&limbs).filter(|(_, l)| **l == limb);
            own.for_each(|(source, _)| rows[source.clone()].fill(true));
            Stage::new(system, groups, &split, limb, rows)
        };
        let n = system.partition().dim();
        let made = Limbs {
            stages: (0..split.limbs.len()).map(stage).collect(),
            star: Star::new(&split),
            room: CliqueScratch::new(system),
            moment: None,
            step: vec![0.0; split.core.len()],
            shift: vec![0.0; n],
            total: vec![0.0; n],
            split,
        };
        Some((made, limbs))
    }

    /// Covariance of core and limb before the update of stage `k`.
    fn take_covariance(&mut self, k: usize, arch: Arch, whole: &Square) {
        let stage = &mut self.stages[k];
        if k > 0 {
            let at = Places { core: &stage.core_at, limb: &stage.limb_at };
            return self.star.assemble(arch, stage.limb, at, &mut stage.covariance);
        }
        for (i, &state) in stage.clique.states.iter().enumerate() {
            stage.clique.gather(whole.row(state), stage.covariance.row_mut(i));
        }
    }

    /// Keeps the regression of stage `k` on the core after its update, for later stages that correct the core.
    fn keep_regression(&mut self, k: usize, arch: Arch) -> Result<(), NotPositive> {
        if k + 1 == self.stages.len() {
            return Ok(());
        }
        let stage = &self.stages[k];
        self.star.take_limb(arch, stage.limb, &stage.covariance, stage.places())
    }

    fn close(&mut self, arch: Arch, whole: &mut Square) {
        let Some(stage) = self.stages.last() else { return };
        for (i, &state) in stage.clique.states.iter().enumerate() {
            let (from, to) = (stage.covariance.row(i), whole.row_mut(state));
            stage.clique.states.iter().zip(from).for_each(|(&j, x)| to[j] = *x);
        }
        self.star.close(arch, &stage.covariance, stage.places(), whole);
    }

    /// After the update of stage `k`: corrects all states, and transforms covariances to the new mean.
    fn correct_others<S: FastSystem<Scratch = C, Moment = M>>(
        &mut self,
        k: usize,
        with: (&S, &mut Filter<S>),
        mean: &mut [f64],
    ) {
        let (system, filter) = with;
        let stage = &mut self.stages[k];
        self.shift.fill(0.0);
        stage.clique.states.iter().zip(&stage.shift).for_each(|(&state, x)| self.shift[state] = *x);
        self.step.iter_mut().zip(&stage.core_at).for_each(|(step, &i)| *step = stage.shift[i]);
        let others = (0..self.split.limbs.len()).filter(|&other| other != stage.limb);
        others.clone().for_each(|other| self.star.follow(other, &self.step, &mut self.shift));
        system.shift(mean, &self.shift);
        self.room.mean.copy_from_slice(mean);
        self.total.iter_mut().zip(&self.shift).for_each(|(total, x)| *total += x);
        filter.reset.clear();
        system.reset_jacobian(&self.shift, &mut filter.reset);
        for block in &filter.reset {
            if let Some(index) = places(&stage.clique.states, block) {
                congruence(filter.arch, &Block { index, ..*block }, &mut stage.covariance);
            }
        }
        filter.shears.clear();
        system.shears(mean, &self.shift, &mut filter.shears);
        let own = filter.shears.iter().filter_map(|shear| shear.among(&stage.clique.states));
        own.for_each(|shear| shear.apply(&mut stage.covariance));
        others.for_each(|other| self.star.carry(filter.arch, other, &filter.reset, &filter.shears));
        self.star.take_center(&stage.covariance, &stage.core_at);
    }
}

impl<S: FastSystem> Filter<S> {
    /// Updates the belief with the readings of one instant, limb by limb.
    pub(super) fn update_limbs(
        &mut self,
        limbs: &mut Limbs<S::Scratch, S::Moment>,
        of: (&S, &S::Moment),
        belief: &mut Belief,
        measured: Measurement,
        settings: UpdateSettings,
        info: &mut Info,
    ) -> Result<(), Diverged> {
        limbs.star.open(self.arch, &belief.covariance).map_err(broken)?;
        limbs.room.mean.copy_from_slice(&belief.mean);
        limbs.total.fill(0.0);
        let (mut nis, mut inertial, mut rejected) = (0.0, (0.0, 0), (0.0, 0));
        for k in 0..limbs.stages.len() {
            self.stage = k;
            limbs.take_covariance(k, self.arch, &belief.covariance);
            self.swap_workspace(&mut limbs.stages[k]);
            let done = self.update_stage(limbs, k, of, belief, measured, settings, info);
            self.swap_workspace(&mut limbs.stages[k]);
            let has_readings = done?;
            if has_readings {
                limbs.correct_others(k, (of.0, self), &mut belief.mean);
            }
            limbs.keep_regression(k, self.arch).map_err(broken)?;
            if has_readings {
                nis += info.nis;
                let (own, count) = info.inertial;
                inertial = if count > 0 { (inertial.0 + own, inertial.1 + count) } else { inertial };
            }
            rejected = (rejected.0 + self.rejected_nis, rejected.1 + self.rejected_rows);
        }
        limbs.close(self.arch, &mut belief.covariance);
        let used: usize = info.sources.iter().map(|s| usize::from(s.used)).sum();
        info.nis = nis;
        info.inertial = if inertial.1 > 0 { inertial } else { (f64::NAN, 0) };
        info.log_likelihood = log_likelihood(nis + rejected.0, used + rejected.1);
        self.shift.copy_from_slice(&limbs.total);
        self.reset.clear();
        of.0.reset_jacobian(&self.shift, &mut self.reset);
        self.shears.clear();
        of.0.shears(&belief.mean, &self.shift, &mut self.shears);
        if !belief.mean.iter().all(|x| x.is_finite()) {
            return Err(Diverged { what: "the estimate is not a number".into() });
        }
        Ok(())
    }

    /// Exchanges the workspace of the filter with that of a stage.
    fn swap_workspace(&mut self, stage: &mut Stage) {
        swap(&mut self.predicted, &mut stage.predicted);
        swap(&mut self.information, &mut stage.information);
        swap(&mut self.l_transposed, &mut stage.l_transposed);
        swap(&mut self.starts, &mut stage.starts);
    }

    /// U1 to U8 for one stage; false if it had no reading.
    #[allow(clippy::too_many_arguments)]
    fn update_stage(
        &mut self,
        limbs: &mut Limbs<S::Scratch, S::Moment>,
        k: usize,
        (system, moment): (&S, &S::Moment),
        belief: &mut Belief,
        measured: Measurement,
        settings: UpdateSettings,
        info: &mut Info,
    ) -> Result<bool, Diverged> {
        let Limbs { stages, room, moment: narrowed, .. } = limbs;
        let stage = &mut stages[k];
        let asked = &stage.clique.rows;
        self.list_rows(measured.z, |r| asked[r]);
        if self.rows.is_empty() || stage.mean.is_empty() {
            self.used.fill(false);
            self.gate_parts(measured, settings, belief, info);
            self.report(measured, info);
            return Ok(false);
        }
        let narrowed = narrowed.get_or_insert_with(|| moment.clone());
        system.narrow(moment, asked, narrowed);
        stage.clique.gather(&belief.mean, &mut stage.mean);
        self.factorise(&stage.covariance)?;
        let within = CliqueSystem { system, clique: &stage.clique };
        let context = ReadingContext {
            system: &within,
            moment: &*narrowed,
            mean: &stage.mean,
            rows: &self.rows,
            spread: settings.spread,
        };
        self.predicted.from_sigma_points(self.arch, context, room, &self.l_transposed);
        self.innovate(measured, info);
        let readings =
            WeightedReadings { rows: &self.rows, inertial: self.inertial_rows, weight: &self.weight, y: &self.y };
        self.information.whiten(self.arch, &self.predicted, readings);
        self.gate_parts(measured, settings, belief, info);
        self.report(measured, info);
        self.solve(measured, info)?;
        self.information.posterior(self.arch, &mut stage.shift, &mut stage.covariance);
        Ok(true)
    }
}
