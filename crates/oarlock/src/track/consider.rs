//! Consider states: mounts, lengths, sensor positions and encoder zeros that are known roughly and not estimated.
//! `step` updates them.
//!
//! The *slopes* dx/dp are the errors of the mean that parameter errors of one standard deviation cause. They are
//! propagated with the state estimate (Schmidt 1966; in the form that leaves the filter unchanged: Friedland 1969).
//! They widen the bands and do not move the mean. The common scale of the parameters' errors, in units of their
//! standard deviations, is learnt. Where the model is correct, innovations are white, and their low-passed values are
//! small. Where it is wrong, they persist as the slopes predict.

mod averages;
mod delays;
mod doubt;
mod felt;
mod leftover;
mod scoring;
mod slopes;
mod tally;
mod twin;
mod worn_rigidly;

use super::hypothesis::Hypothesis;
use super::readings::Readings;
use super::subject::Subject;
use super::Calibration;
use crate::body::{Body, Moment};
use crate::config::{Config, Consider, FilterKind};
use crate::error::Result;
use crate::estimate::belief::Belief;
use crate::estimate::filter::{Apart, Filter, Info, Verdict};
use crate::estimate::information::{Carried, Columns, Force, Side};
use crate::estimate::learn::Learning;
use crate::estimate::transition::Transition;
use crate::estimate::{FastSystem, System};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::dense::Square;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kernels::tiles::padded;
use crate::sensor::MountValue;
use crate::sensor::Quantity;
use delays::Delays;
use doubt::Bounds;
pub use doubt::Doubt;
pub(super) use doubt::Shares;
use felt::Felt;
use leftover::leftover;
use scoring::Scoring;
use slopes::Prior;
use tally::Tally;
pub use tally::Window;
use twin::{twin, Role, Roles, ZERO_STD};
use worn_rigidly::worn_rigidly;

/// Larger slopes mean that the recursion has diverged.
const ABSURD: f64 = 1e6;

/// Consider states of a body with the workspace of their update.
#[derive(Debug, Clone)]
pub(super) struct Considering {
    arch: Arch,
    /// The same body with all consider states as states.
    twin: Body,
    scratch: Box<<Body as System>::Scratch>,
    straight: SparseJacobian,
    felt: Felt,
    roles: Vec<Role>,
    considered: ConsideredSlopes,
    /// Per row: the consider state that is its encoder's zero.
    zeros: Vec<Option<usize>>,
    /// Per row: whether its innovations persist only if the model is wrong, so that they are used for learning.
    telling: Vec<bool>,
    /// Mean of the twin, and per entry its index in the filter's state.
    mean: Vec<f64>,
    from: Vec<Option<usize>>,
    center: Vec<f64>,
    /// Numbers of states, rows and padded parameters.
    size: (usize, usize, usize),
    /// Number of parameters with a standard deviation from a calibration. They come first.
    told: usize,
    bounds: Bounds,
    how: Consider,
    /// Inflation of inertial noise and of rough readings as the current update uses them. What it learns applies to the
    /// next update.
    inflated: (f64, f64),
    /// Names of the consider states in their order.
    names: Vec<String>,
    /// Delays of clocks, and normal equations of all parameters; only for calibration.
    score: Option<Scoring>,
    /// Derivative of each innovation by each parameter, row-major.
    answers: Vec<f64>,
    /// dh/dp without its zeros, divided by noise.
    forces: Vec<Force>,
    /// Per row: one over the standard deviation of its noise; 0 if it was not used.
    weights: Vec<f64>,
    /// Workspaces for an update with all readings, and for one in parts.
    carried: Carried,
    apart: Vec<Apart>,
    parts: Option<Parts>,
    scales: Vec<f64>,
}

impl Considering {
    /// `None` without consider states.
    pub(super) fn new(
        body: &Body,
        mounts: &[Option<MountValue>],
        known: &Calibration,
        config: &Config,
    ) -> Result<Option<Self>> {
        let (twin, told) = twin(body, mounts, known, config)?;
        let Roles { roles, mut names, told, most, mut mounts } = Roles::of(body, &twin, known, &told);
        let mut zeros = vec![None; body.suite.len()];
        for source in &body.suite.sources {
            for part in source.parts.iter().filter(|p| p.quantity == Quantity::Joint) {
                zeros[part.rows.start] = Some(names.len());
                names.push(format!("{}.zero", source.name));
            }
        }
        if names.is_empty() {
            return Ok(None);
        }
        let parts = body.suite.sources.iter().flat_map(|s| &s.parts);
        let tells = |q: Quantity| matches!(q, Quantity::Gyro | Quantity::Mag | Quantity::Joint);
        let telling = parts.flat_map(|p| p.rows.clone().map(move |_| tells(p.quantity))).collect();
        let position = |name: &String| body.layout.names.iter().position(|own| own == name);
        let straight = twin.jacobian_pattern().unwrap_or_default();
        let mut mean = vec![0.0; twin.layout.dim()];
        for ((_, state), length) in twin.layout.lengths.iter().zip(twin.lengths()) {
            mean[*state] = length;
        }
        let (n, m, width) = (body.layout.dim(), body.suite.len(), padded(names.len()));
        mounts.resize(width, false);
        Ok(Some(Considering {
            arch: Arch::best(),
            scratch: Box::new(twin.scratch()),
            felt: Felt::new(&straight),
            forces: Vec::with_capacity(most_forces(&straight)),
            considered: ConsideredSlopes::new(&straight, &roles),
            straight,
            roles,
            zeros,
            telling,
            from: twin.layout.names.iter().map(position).collect(),
            mean,
            center: vec![0.0; m],
            size: (n, m, width),
            told,
            bounds: Bounds { mounts, most, reach: reach(body) },
            how: config.consider,
            inflated: (1.0, 1.0),
            apart: worn_rigidly(body, &names, width),
            names,
            score: None,
            answers: vec![0.0; m * width],
            weights: vec![0.0; m],
            carried: Carried::new(n, m, width),
            parts: (config.filter == FilterKind::Factorised).then(|| Parts::new(n, m, width)),
            scales: Vec::with_capacity(m),
            twin,
        }))
    }

    /// Starts to collect normal equations of all consider states and clock delays in windows, from `settle_s` after the
    /// first update on.
    pub(super) fn keep_score(&mut self, body: &Body, settle_s: f64, window_s: f64) {
        let (delays, sources) = Delays::new(body, &self.twin, self.names.len());
        self.names.extend(sources.into_iter().map(|name| format!("{name}.delay")));
        let (n, m, _) = self.size;
        let width = padded(self.names.len());
        self.size.2 = width;
        self.bounds.mounts.resize(width, false);
        self.answers = vec![0.0; m * width];
        self.carried = Carried::new(n, m, width);
        self.apart.iter_mut().for_each(|own| own.share.resize(width, 1.0));
        self.parts = self.parts.as_ref().map(|_| Parts::new(n, m, width));
        self.how = Consider::Always;
        self.score = Some(Scoring::new(delays, Tally::new(width, settle_s, window_s), (n, m, width)));
    }

    /// Names of the parameters, the standard deviations that are their units, and the windows.
    pub(super) fn score(&mut self) -> (Vec<(String, f64)>, Vec<Window>) {
        let mut stds = vec![ZERO_STD; self.names.len()];
        for (column, role) in self.roles.iter().enumerate() {
            if let Role::Considered(k, std) = role {
                // The column of an input is in units of its standard deviation.
                stds[*k] = if column < self.twin.layout.dim() { *std } else { ZERO_STD };
            }
        }
        let delays = self.names.iter().zip(&mut stds).filter(|(name, _)| name.ends_with(".delay"));
        delays.for_each(|(_, std)| *std = delays::DELAY_STD_S);
        let windows = self.score.as_mut().map_or(Vec::new(), |s| s.tally.close().to_vec());
        (self.names.iter().cloned().zip(stds).collect(), windows)
    }

    /// The doubt at the start: no parameter has affected the mean yet. `None` without consider states.
    pub(super) fn fresh(&self) -> Option<Doubt> {
        let scale = f64::from(u8::from(self.how == Consider::Always));
        (self.how != Consider::Off).then(|| Doubt::new(scale, self.size, self.told, self.bounds.clone()))
    }

    /// Whether a doubt belongs to these parameters.
    pub(super) fn fits(&self, doubt: &Doubt) -> bool {
        doubt.size() == self.size && doubt.told == self.told
    }

    /// Before an update: computes the derivatives of the readings at the mean, and for an update in parts P^-1 dx/dp.
    pub(super) fn look(&mut self, belief: &Belief, doubt: Option<&Doubt>, moment: &Moment) {
        if let (Some(doubt), Some(Parts { prior, .. })) = (doubt, &mut self.parts) {
            prior.divide(self.arch, &belief.covariance, &doubt.slopes);
        }
        let mean = &belief.mean;
        self.inflated = (belief.inflation, belief.roughness);
        if let Some(Scoring { delays, .. }) = &mut self.score {
            delays.look(belief.time_s, mean);
        }
        for (own, from) in self.mean.iter_mut().zip(&self.from) {
            if let Some(i) = from {
                *own = mean[*i];
            }
        }
        let Considering { twin, scratch, mean, center, straight, .. } = self;
        self.arch.run(Looking { twin, moment, scratch, mean, center, straight });
    }

    /// Applies the effect of the update to the slopes.
    fn follow(
        &mut self,
        doubt: &mut Doubt,
        (time_s, p, filter, innovation): (f64, &Square, &Filter<Body>, Option<&[f64]>),
        row_variance: impl Fn(usize) -> Option<f64>,
    ) {
        let slopes = &mut doubt.slopes[..];
        self.forces.clear();
        for t in 0..self.straight.triples.len() {
            self.answer(t, slopes, &row_variance);
        }
        if let (Some(scoring), Some(innovation)) = (&mut self.score, innovation) {
            if scoring.tally.begin(time_s) {
                let weighed = scoring.take_rows(filter, (&self.answers, &self.weights, innovation)).clone();
                gather_pull(&self.straight, &self.roles, &self.weights, &weighed, &mut scoring.pull);
                scoring.take_states(self.arch, p, filter.shift());
            }
        }
        if self.weights.iter().all(|w| *w == 0.0) {
            return; // The last update may be an earlier one.
        }
        let is_whole = filter.carry(&self.forces, &self.apart, &mut self.carried, slopes);
        if let Some(Parts { prior, forced, pull }) = self.parts.as_mut().filter(|_| !is_whole) {
            forced.clear();
            self.forces.iter().for_each(|f| forced.row_mut(f.row)[f.parameter] += f.by);
            filter.substitute(Side::Left, forced);
            filter.substitute(Side::Right, forced);
            gather_pull(&self.straight, &self.roles, &self.weights, forced, pull);
            prior.update(p, (filter, &self.apart), pull, slopes);
        }
        // Side by side; so written that NaN is absurd too.
        let is_sane = |some: &[f64]| some.iter().fold(true, |sane, s| sane & (s.abs() < ABSURD));
        if !slopes.chunks(self.size.2).all(is_sane) {
            tame(slopes);
        }
    }

    /// For a few rows: dh/dp divided by noise, and where it is used B = J dx/dp + dh/dp.
    fn answer(&mut self, t: usize, slopes: &[f64], variance: &impl Fn(usize) -> Option<f64>) {
        let (_, _, width) = self.size;
        let triple = &self.straight.triples[t];
        let noise = triple.each(variance);
        for i in 0..triple.count {
            self.weights[triple.row + i] = noise[i].map_or(0.0, |noise| 1.0 / noise.sqrt());
        }
        let answers = &mut self.answers[triple.row * width..][..triple.count * width];
        let is_used = self.score.is_some() || self.how != Consider::Always && self.telling[triple.row];
        if is_used && noise != [None; 3] {
            self.felt.of(&self.straight, &self.roles, triple).answer(self.arch, slopes, width, answers);
        }
        let slopes = &self.straight.slopes[triple.slopes.clone()];
        for (i, answer) in answers.chunks_exact_mut(width).enumerate().filter(|(i, _)| noise[*i].is_some()) {
            let row = triple.row + i;
            let (weight, forces) = (self.weights[row], &mut self.forces);
            let mut force = |k: usize, by: f64| {
                if by == 0.0 {
                    return;
                }
                forces.push(Force { row, parameter: k, by: by * weight });
                answer[k] += if is_used { by } else { 0.0 };
            };
            for &(at, k, std) in self.considered.of(t) {
                force(k, self.straight.slopes[at].rows[i] * std);
            }
            if let Some(k) = self.zeros[row] {
                force(k, ZERO_STD);
            }
            let delays = self.score.as_ref().map(|score| &score.delays);
            if let Some((k, late)) = delays.and_then(|d| d.answer(triple, i, slopes, &self.roles)) {
                force(k, late);
            }
        }
    }

    /// Learns the common scale of the parameters from persistent innovations.
    fn learn(&mut self, doubt: &mut Doubt, time_s: f64, innovation: &[f64], told: impl Fn(usize) -> bool) {
        if self.how != Consider::Always {
            let told = |r: usize| self.telling[r] && told(r);
            averages::take(self.arch, doubt, &self.answers, (time_s, innovation), told);
            averages::learn(doubt, &self.telling, &mut self.scales);
        }
    }

    /// Learns, after an update, the roughness of accelerometers and the scale of the consider states.
    pub(super) fn take_update(&mut self, subject: &Subject, update: &Update, one: &mut Hypothesis) {
        let Hypothesis { belief, doubt, .. } = one;
        let believed = |r: usize| update.believes(subject, r);
        let now = (belief.inflation, belief.roughness);
        let left = leftover(
            self.arch,
            &mut self.felt,
            (&self.straight, &self.roles, &subject.rough_rows),
            (&belief.covariance, update.filter.shift(), &update.info.innovation),
            |r| believed(r).then(|| update.readings.noise_variance(subject, r, now)),
        );
        learn_roughness(belief, left, update);
        let Some(doubt) = doubt else { return };
        let innovation = update.learning.map(|_| &update.info.innovation[..]);
        let before = self.inflated;
        let noise = |r: usize| believed(r).then(|| update.readings.noise_variance(subject, r, before));
        self.follow(doubt, (belief.time_s, &belief.covariance, update.filter, innovation), noise);
        self.learn(doubt, belief.time_s, &update.info.innovation, believed);
    }
}

/// Slopes of a Jacobian by consider states, of each of its triples.
#[derive(Debug, Clone)]
struct ConsideredSlopes {
    /// Index of the slope, the consider state, and its standard deviation.
    all: Vec<(usize, usize, f64)>,
    ends: Vec<usize>,
}

impl ConsideredSlopes {
    fn new(straight: &SparseJacobian, roles: &[Role]) -> Self {
        let (mut all, mut ends) = (Vec::new(), Vec::new());
        for triple in &straight.triples {
            for at in triple.slopes.clone() {
                if let Role::Considered(k, std) = roles[straight.slopes[at].state] {
                    all.push((at, k, std));
                }
            }
            ends.push(all.len());
        }
        ConsideredSlopes { all, ends }
    }

    fn of(&self, triple: usize) -> &[(usize, usize, f64)] {
        let first = if triple == 0 { 0 } else { self.ends[triple - 1] };
        &self.all[first..self.ends[triple]]
    }
}

/// Derivatives by parameters that there can be at most: by a column of the Jacobian, an encoder's zero and a clock's delay.
fn most_forces(straight: &SparseJacobian) -> usize {
    straight.triples.iter().map(|t| t.count * (t.slopes.len() + 2)).sum()
}

/// Largest variance of each state that is a joint's coordinate; infinite for all others. A joint is never known worse than
/// its range. The position of a body that travels has no range.
fn reach(body: &Body) -> Vec<f64> {
    let mut reach = vec![f64::INFINITY; body.layout.dim()];
    for (_, axis, slots) in body.moving().filter(|(_, axis, _)| !axis.travels) {
        reach[slots.q] = axis.range_std().powi(2);
    }
    reach
}

/// After a divergence: keeps the direction of the slopes, so that the bands stay wide. Slopes that are no numbers are lost.
fn tame(slopes: &mut [f64]) {
    let most = slopes.iter().fold(0.0, |most: f64, s| most.max(s.abs()));
    let factor = if slopes.iter().all(|s| s.is_finite()) { ABSURD / most } else { 0.0 };
    slopes.iter_mut().for_each(|s| *s = if factor > 0.0 { *s * factor } else { 0.0 });
}

/// The effect of an update.
pub(super) struct Update<'a> {
    readings: &'a Readings,
    info: &'a Info,
    filter: &'a Filter<Body>,
    /// `None` while several hypotheses compete.
    learning: Option<Learning>,
}

impl<'a> Update<'a> {
    pub(super) fn new(
        readings: &'a Readings,
        info: &'a Info,
        filter: &'a Filter<Body>,
        learning: Option<Learning>,
    ) -> Self {
        Update { readings, info, filter, learning }
    }

    fn believes(&self, subject: &Subject, row: usize) -> bool {
        !self.readings.z[row].is_nan() && self.info.parts[subject.part_of_row[row]] == Verdict::Accepted
    }
}

/// `squares` is the sum of squared residuals of accelerometers, for `count` readings.
fn learn_roughness(belief: &mut Belief, (squares, count): (f64, f64), update: &Update) {
    let Some(learning) = update.learning.filter(|_| count > 0.0 && update.filter.is_whole()) else { return };
    let (dt, ratio) = (update.filter.since_s(), squares / count);
    let roughness = learning.inflation(belief.roughness, belief.leftover, dt, ratio);
    belief.leftover = learning.usual_nis(belief.leftover, dt, ratio);
    belief.roughness = roughness;
}

impl Doubt {
    /// Propagates the slopes with the transition of the mean's error.
    pub(super) fn predict(&mut self, transition: &Transition) {
        transition.apply_to_rows(Arch::best(), &mut self.slopes, self.width);
    }

    /// Discards the effect on the mean after a new fit.
    pub(super) fn forget(&mut self) {
        self.slopes.fill(0.0);
    }
}

/// Workspace for an update in parts, limb by limb.
#[derive(Debug, Clone)]
struct Parts {
    prior: Prior,
    /// dh/dp, divided by noise, then by the filter's S (U5).
    forced: Columns,
    /// J'W dh/dp with W = (R^1/2 S R^1/2)^-1.
    pull: Vec<f64>,
}

impl Parts {
    fn new(states: usize, rows: usize, width: usize) -> Self {
        let forced = Columns::zeros(rows, width);
        Parts { prior: Prior::new(states, width), forced, pull: vec![0.0; states * width] }
    }
}

struct Looking<'a> {
    twin: &'a Body,
    moment: &'a Moment,
    scratch: &'a mut <Body as System>::Scratch,
    mean: &'a [f64],
    center: &'a mut [f64],
    straight: &'a mut SparseJacobian,
}

impl Kernel for Looking<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.twin.linearise_sparse::<FUSED>(self.moment, self.scratch, self.mean, self.center, self.straight);
    }
}

/// J'W times some columns, which are already divided by all of W but one standard deviation of the noise.
fn gather_pull(straight: &SparseJacobian, roles: &[Role], weights: &[f64], columns: &Columns, pull: &mut [f64]) {
    pull.fill(0.0);
    for triple in &straight.triples {
        for i in 0..triple.count {
            let (weight, column) = (weights[triple.row + i], columns.row(triple.row + i));
            if weight == 0.0 {
                continue;
            }
            let felt = straight.slopes[triple.slopes.clone()].iter().map(|s| (roles[s.state], s.rows[i]));
            for (role, by) in felt.chain(triple.added.map(|first| (roles[first + i], 1.0))) {
                if let Role::State(s) = role {
                    let pull = &mut pull[s * column.len()..(s + 1) * column.len()];
                    pull.iter_mut().zip(column).for_each(|(p, a)| *p += weight * by * a);
                }
            }
        }
    }
}
