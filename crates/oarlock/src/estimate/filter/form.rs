//! The two forms of the update: information (U5 to U8), and covariance (U10, U11) where that is faster and as exact.

use super::{Diverged, Filter, RowGroups};
use crate::estimate::covariance_form::CovarianceUpdate;
use crate::estimate::information::{Nis, WeightedReadings};
use crate::estimate::sigma::PredictedReadings;
use crate::estimate::FastSystem;
use crate::kernels::dense::{NotPositive, Square};
use crate::kernels::tiles::{factor, padded, Panel, Sweep, RAISES, VECTOR};

impl<S: FastSystem> Filter<S> {
    /// Workspace of an unscented filter of `system`, in covariance form where that pays.
    pub fn new(system: &S, groups: &RowGroups) -> Self {
        if CovarianceUpdate::pays(system.partition(), groups.inertial.len()) {
            Self::in_covariance_form(system, groups)
        } else {
            Self::in_information_form(system, groups)
        }
    }

    /// Workspace of an unscented filter that takes the covariance form wherever it is exact; the information form if `system` does not
    /// compute the Jacobian of its linear part, or hardly has one.
    pub fn in_covariance_form(system: &S, groups: &RowGroups) -> Self {
        let (part, rows) = (system.partition(), system.row_count());
        // A vector of other columns than poses, so that `complete` overwrites none of these.
        if system.linear_pattern().is_none() || part.dim() - part.pose < VECTOR {
            return Self::in_information_form(system, groups);
        }
        let predicted = PredictedReadings::of_poses(system);
        let update = CovarianceUpdate::new(rows, predicted.e_columns, part, &groups.sources);
        let n = part.dim();
        let l_transposed = Panel::zeros(n, padded(n) + VECTOR);
        Filter { covariance_form: Some(Box::new(update)), l_transposed, ..Self::with(system, groups, predicted, None) }
    }

    /// Workspace of an unscented filter that always takes the information form.
    pub fn in_information_form(system: &S, groups: &RowGroups) -> Self {
        Self::with(system, groups, PredictedReadings::new(system), None)
    }

    /// From now on updates have information form.
    pub fn leave_covariance_form(&mut self) {
        self.covariance_form = None;
        self.predicted.keep_all_columns();
    }

    /// Whether the last update had covariance form.
    #[doc(hidden)]
    pub fn had_covariance_form(&self) -> bool {
        self.exact_covariance_form().is_some()
    }

    fn exact_covariance_form(&self) -> Option<&CovarianceUpdate> {
        self.covariance_form.as_deref().filter(|update| update.is_exact())
    }

    fn exact_covariance_form_mut(&mut self) -> Option<&mut CovarianceUpdate> {
        self.covariance_form.as_deref_mut().filter(|update| update.is_exact())
    }

    /// L' of U1, or the part of it that the covariance form needs. Where rounding took the sign of a pivot, the diagonal is raised by a
    /// relative 1e-12.
    pub(super) fn factorise(&mut self, covariance: &Square) -> Result<(), Diverged> {
        let (arch, l_transposed) = (self.arch, &mut self.l_transposed);
        match &mut self.covariance_form {
            Some(update) => raising(|share| update.factorise(arch, covariance, share, l_transposed)),
            None => self.factorise_all(covariance),
        }
    }

    fn factorise_all(&mut self, covariance: &Square) -> Result<(), Diverged> {
        let n = covariance.n();
        raising(|share| {
            self.l_transposed.copy_raised(covariance, share);
            factor(self.arch, &mut self.l_transposed, Sweep { n, width: padded(n), starts: &self.starts })
        })
    }

    /// S of U5; or P_zz and K of U10, unless readings are too exact for that form.
    pub(super) fn whiten(&mut self, covariance: &Square) -> Result<(), Diverged> {
        let readings =
            WeightedReadings { rows: &self.rows, inertial: self.inertial_rows, weight: &self.weight, y: &self.y };
        if let Some(update) = &mut self.covariance_form {
            update.whiten(self.arch, (&self.predicted, &self.l_transposed, covariance), readings);
            if update.is_exact() {
                return Ok(());
            }
            self.factorise_all(covariance)?;
            self.predicted.complete(self.arch, &self.l_transposed);
        }
        let readings =
            WeightedReadings { rows: &self.rows, inertial: self.inertial_rows, weight: &self.weight, y: &self.y };
        self.information.whiten(self.arch, &self.predicted, readings);
        Ok(())
    }

    /// U6 and U7, or U11 up to w.
    pub(super) fn solve_update(&mut self) -> Result<Nis, Diverged> {
        let arch = self.arch;
        let solved = match self.exact_covariance_form_mut() {
            Some(update) => update.solve(arch),
            None => self.information.solve(arch, &self.l_transposed),
        };
        solved.map_err(broken)
    }

    /// Innovation covariance of a source, divided by the noise.
    pub(super) fn innovation_covariance(&self, source: usize) -> &Square {
        match self.exact_covariance_form() {
            Some(update) => update.innovation_covariance(source),
            None => self.information.innovation_covariance(source),
        }
    }

    /// Takes a row out of the update.
    pub(super) fn reject(&mut self, row: usize) {
        match self.exact_covariance_form_mut() {
            Some(update) => update.reject(row),
            None => self.information.reject(row),
        }
    }

    /// x+ - x into the shift, and P+.
    pub(super) fn take_posterior(&mut self, covariance: &mut Square) {
        let exact = self.covariance_form.as_deref_mut().filter(|update| update.is_exact());
        match exact {
            Some(update) => update.posterior(self.arch, &mut self.shift, covariance),
            None => self.information.posterior(self.arch, &mut self.shift, covariance),
        }
    }
}

fn raising(mut factorise: impl FnMut(f64) -> Result<(), NotPositive>) -> Result<(), Diverged> {
    let mut done = Ok(());
    for share in RAISES {
        done = factorise(share);
        if done.is_ok() {
            break;
        }
    }
    done.map_err(|e| Diverged {
        what: format!("the covariance lost its sign (state {}, pivot {:.2e})", e.row, e.pivot),
    })
}

pub(super) fn broken(e: NotPositive) -> Diverged {
    Diverged { what: format!("the update broke (row {}, pivot {:.2e})", e.row, e.pivot) }
}
