//! `Scoring`: derivatives of the filter's mean by parameters that are not states, and the normal equations that the innovations give. `step`
//! updates it while a recording is scored.
//!
//! dx/dp is the error of the mean that a parameter error of one standard deviation causes. It follows the filter's own gain, which it does not
//! change (Friedland 1969).

use super::delays::{Delays, DELAY_STD_S};
use super::mount_axes::apart;
use super::normal_equations::{NormalEquations, Window};
use super::parameters::{augmented, roles, Role, ZERO_STD};
use crate::body::{Body, Moment};
use crate::config::Config;
use crate::error::Result;
use crate::estimate::belief::Belief;
use crate::estimate::filter::{Apart, Filter, Info, Verdict};
use crate::estimate::information::{Carried, Columns, Force, Side};
use crate::estimate::transition::Transition;
use crate::estimate::{FastSystem, System};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::dense::{accumulate, Square};
use crate::kernels::sparse_jacobian::{RowTriple, SparseJacobian};
use crate::kernels::tiles::padded;
use crate::sensor::{MountValue, Quantity};
use crate::track::hypothesis::Hypothesis;
use crate::track::readings::Readings;
use crate::track::subject::Subject;
use crate::track::Calibration;

/// Larger derivatives mean that the recursion has diverged.
const ABSURD: f64 = 1e6;

/// Parameters of a body with the workspace of their update.
#[derive(Debug, Clone)]
pub(in crate::track) struct Scoring {
    arch: Arch,
    /// The same body with the parameters as states.
    augmented: Body,
    scratch: Box<<Body as System>::Scratch>,
    jacobian: SparseJacobian,
    roles: Vec<Role>,
    /// Mean of the augmented body, and per entry its index in the filter's state.
    mean: Vec<f64>,
    from: Vec<Option<usize>>,
    center: Vec<f64>,
    /// Per row: the parameter that is its encoder's zero.
    zeros: Vec<Option<usize>>,
    delays: Delays,
    /// Names and units.
    parameters: Vec<(String, f64)>,
    /// Numbers of states and of padded parameters.
    size: (usize, usize),
    apart: Vec<Apart>,
    carried: Carried,
    /// dh/dp without its zeros, divided by noise.
    forces: Vec<Force>,
    /// Per row: one over the standard deviation of its noise; 0 if it was not used.
    weights: Vec<f64>,
    /// B = J dx/dp + dh/dp and the innovations, divided by noise, then by factors of the filter's S (U5).
    sensitivities: Columns,
    innovations: Columns,
    /// J'WB and P+ J'WB.
    pull: Vec<f64>,
    explained: Vec<f64>,
    equations: NormalEquations,
}

impl Scoring {
    /// `None` if no parameter is uncertain.
    pub(super) fn new(
        body: &Body,
        mounts: &[Option<MountValue>],
        known: &Calibration,
        config: &Config,
        (settle_s, window_s): (f64, f64),
    ) -> Result<Option<Self>> {
        let augmented = augmented(body, mounts, known, config)?;
        let (roles, mut parameters) = roles(body, &augmented, known);
        let mut zeros = vec![None; body.suite.len()];
        for source in &body.suite.sources {
            for part in source.parts.iter().filter(|p| p.quantity == Quantity::Joint) {
                zeros[part.rows.start] = Some(parameters.len());
                parameters.push((format!("{}.zero", source.name), ZERO_STD));
            }
        }
        if parameters.is_empty() {
            return Ok(None);
        }
        let (delays, sources) = Delays::new(body, &augmented, parameters.len());
        parameters.extend(sources.into_iter().map(|name| (format!("{name}.delay"), DELAY_STD_S)));
        let position = |name: &String| body.layout.names.iter().position(|own| own == name);
        let mut mean = vec![0.0; augmented.layout.dim()];
        for ((_, state), length) in augmented.layout.lengths.iter().zip(augmented.lengths()) {
            mean[*state] = length;
        }
        let (n, m, width) = (body.layout.dim(), body.suite.len(), padded(parameters.len()));
        Ok(Some(Scoring {
            arch: Arch::best(),
            scratch: Box::new(augmented.scratch()),
            jacobian: augmented.jacobian_pattern().unwrap_or_default(),
            roles,
            from: augmented.layout.names.iter().map(position).collect(),
            mean,
            center: vec![0.0; m],
            zeros,
            delays,
            apart: apart(body, &parameters, width),
            parameters,
            size: (n, width),
            carried: Carried::new(n, m, width),
            forces: Vec::new(),
            weights: vec![0.0; m],
            sensitivities: Columns::zeros(m, width),
            innovations: Columns::zeros(m, 1),
            pull: vec![0.0; n * width],
            explained: vec![0.0; n * width],
            equations: NormalEquations::new(width, settle_s, window_s),
            augmented,
        }))
    }

    /// Names of the parameters, the standard deviations that are their units, and the windows.
    pub(super) fn finish(self) -> (Vec<(String, f64)>, Vec<Window>) {
        (self.parameters, self.equations.finish())
    }

    /// Before an update: computes the derivatives of the readings at the mean.
    pub(in crate::track) fn linearise(&mut self, belief: &Belief, slopes: &mut Vec<f64>, moment: &Moment) {
        // At the start no parameter has affected the mean.
        slopes.resize(self.size.0 * self.size.1, 0.0);
        self.delays.follow(belief.time_s, &belief.mean);
        for (own, from) in self.mean.iter_mut().zip(&self.from) {
            if let Some(i) = from {
                *own = belief.mean[*i];
            }
        }
        let Scoring { augmented, scratch, mean, center, jacobian, .. } = self;
        self.arch.run(Linearising { augmented, moment, scratch, mean, center, jacobian });
    }

    /// Applies a prediction to the derivatives.
    pub(in crate::track) fn predict(&self, transition: &Transition, slopes: &mut [f64]) {
        if !slopes.is_empty() {
            transition.apply_to_rows(self.arch, slopes, self.size.1);
        }
    }

    /// Applies an update to the derivatives. Its innovations count in the normal equations if `counts`.
    pub(in crate::track) fn take_update(
        &mut self,
        (subject, readings): (&Subject, &Readings),
        (filter, info): (&Filter<Body>, &Info),
        one: &mut Hypothesis,
        counts: bool,
    ) {
        let accepts = |r: usize| info.parts[subject.part_of_row[r]] == Verdict::Accepted && !readings.z[r].is_nan();
        for (r, weight) in self.weights.iter_mut().enumerate() {
            *weight = if accepts(r) { filter.weight(r) } else { 0.0 };
        }
        self.differentiate(&one.slopes);
        if counts && self.equations.begin(one.belief.time_s) {
            self.add_innovations(filter, &info.innovation);
            self.subtract_states(&one.belief.covariance, filter.shift());
        }
        if self.weights.iter().all(|w| *w == 0.0) {
            return; // The last update of the filter may be an earlier one.
        }
        filter.carry(&self.forces, &self.apart, &mut self.carried, &mut one.slopes);
        if !one.slopes.iter().all(|s| s.abs() < ABSURD) {
            one.slopes.fill(0.0);
        }
    }

    /// dh/dp and B of all rows in use, divided by noise.
    fn differentiate(&mut self, slopes: &[f64]) {
        let Scoring { jacobian, roles, zeros, delays, weights, forces, sensitivities, size: (_, width), .. } = self;
        forces.clear();
        sensitivities.clear();
        for (triple, i, weight) in rows_in_use(jacobian, weights) {
            let (row, columns) = (triple.row + i, &jacobian.slopes[triple.slopes.clone()]);
            let of_column = columns.iter().filter_map(|slope| match roles[slope.state] {
                Role::Parameter(k, std) => Some((k, slope.rows[i] * std)),
                _ => None,
            });
            let zero = zeros[row].map(|k| (k, ZERO_STD));
            let all = of_column.chain(zero).chain(delays.derivative(triple, i, columns, roles));
            forces.extend(all.map(|(parameter, by)| Force { row, parameter, by: by * weight }).filter(|f| f.by != 0.0));
            let states = states(jacobian, roles, triple, i);
            let terms = states.map(|(s, by)| (weight * by, &slopes[s * *width..(s + 1) * *width]));
            accumulate(sensitivities.row_mut(row), terms);
        }
        forces.iter().for_each(|f| sensitivities.row_mut(f.row)[f.parameter] += f.by);
    }

    /// Adds the rows of an update to the normal equations, and multiplies B by all of W but one standard deviation of the noise.
    fn add_innovations(&mut self, filter: &Filter<Body>, innovation: &[f64]) {
        let Scoring { weights, sensitivities, innovations, equations, .. } = self;
        innovations.clear();
        let used = weights.iter().enumerate().filter(|(_, w)| **w > 0.0);
        used.clone().for_each(|(r, w)| innovations.row_mut(r)[0] = w * innovation[r]);
        filter.substitute(Side::Left, sensitivities);
        filter.substitute(Side::Left, innovations);
        used.for_each(|(r, _)| equations.add_row(sensitivities.row(r), innovations.row(r)[0]));
        filter.substitute(Side::Right, sensitivities);
    }

    /// Subtracts what the update of the states explains.
    fn subtract_states(&mut self, p: &Square, shift: &[f64]) {
        let Scoring { jacobian, roles, weights, sensitivities, pull, explained, size: (_, width), .. } = self;
        pull.fill(0.0);
        for (triple, i, weight) in rows_in_use(jacobian, weights) {
            let own = sensitivities.row(triple.row + i);
            for (s, by) in states(jacobian, roles, triple, i) {
                accumulate(&mut pull[s * *width..(s + 1) * *width], std::iter::once((weight * by, own)));
            }
        }
        explained.fill(0.0);
        self.arch.run(Multiplying { out: explained, p, of: pull, width: *width });
        self.equations.subtract_states(pull, explained, shift);
    }
}

/// Rows that were used: their triple, their number in it, and their weight.
fn rows_in_use<'a>(
    jacobian: &'a SparseJacobian,
    weights: &'a [f64],
) -> impl Iterator<Item = (&'a RowTriple, usize, f64)> {
    let rows = jacobian.triples.iter().flat_map(move |t| (0..t.count).map(move |i| (t, i, weights[t.row + i])));
    rows.filter(|(_, _, weight)| *weight > 0.0)
}

/// States that a row depends on, with its derivatives. A state may occur twice.
fn states<'a>(
    jacobian: &'a SparseJacobian,
    roles: &'a [Role],
    triple: &'a RowTriple,
    i: usize,
) -> impl Iterator<Item = (usize, f64)> + 'a {
    let slopes = jacobian.slopes[triple.slopes.clone()].iter().map(move |s| (roles[s.state], s.rows[i]));
    let of_state = |(role, by)| if let Role::State(s) = role { Some((s, by)) } else { None };
    slopes.chain(triple.added.map(|first| (roles[first + i], 1.0))).filter_map(of_state)
}

struct Linearising<'a> {
    augmented: &'a Body,
    moment: &'a Moment,
    scratch: &'a mut <Body as System>::Scratch,
    mean: &'a [f64],
    center: &'a mut [f64],
    jacobian: &'a mut SparseJacobian,
}

impl Kernel for Linearising<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.augmented.linearise_sparse::<FUSED>(self.moment, self.scratch, self.mean, self.center, self.jacobian);
    }
}

/// Adds P times some rows.
struct Multiplying<'a> {
    out: &'a mut [f64],
    p: &'a Square,
    of: &'a [f64],
    width: usize,
}

impl Kernel for Multiplying<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for (i, row) in self.out.chunks_exact_mut(self.width).enumerate() {
            accumulate(row, self.p.row(i).iter().copied().zip(self.of.chunks_exact(self.width)));
        }
    }
}
