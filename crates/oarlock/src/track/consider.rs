//! Consider states: mounts, lengths, sensor positions and encoder zeros that are known roughly and not estimated.
//! `step` updates them.
//!
//! The *slopes* dx/dp are the errors of the mean that parameter errors of one standard deviation cause. They are
//! propagated with the state estimate (Schmidt 1966; in the form that leaves the filter unchanged: Friedland 1969).
//! They widen the bands and do not move the mean. The common scale of the parameters' errors, in units of their
//! standard deviations, is learnt. Where the model is correct, innovations are white, and their low-passed values are
//! small. Where it is wrong, they persist as the slopes predict.

mod delays;
mod doubt;
mod felt;
mod leftover;
mod scoring;
mod slopes;
mod tally;
mod twin;

use super::hypothesis::Hypothesis;
use super::readings::Readings;
use super::subject::Subject;
use super::Calibration;
use crate::body::{Body, Moment};
use crate::config::{Config, Consider, FilterKind};
use crate::error::Result;
use crate::estimate::belief::Belief;
use crate::estimate::filter::{Filter, Info, Verdict};
use crate::estimate::information::{Carried, Columns, Side};
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
pub use doubt::Doubt;
pub(super) use doubt::Shares;
use doubt::{Bounds, RowAverages, Squares};
use felt::Felt;
use leftover::leftover;
use scoring::Scoring;
use slopes::Prior;
use tally::Tally;
pub use tally::Window;
use twin::{twin, Role, Roles, ZERO_STD};

/// Time over which innovations are averaged, s: longer than the correlation of noise, learnt process noise and soft
/// tissue motion; shorter than a movement cycle.
const AVERAGE_S: f64 = 0.6;
/// Memories of the mean squares of averages, s. Parameters are constants, so evidence that they are wrong lasts, also while a
/// body moves in a way that does not show it. The short memory follows a unit that slips.
const MEMORIES_S: [f64; 2] = [5.0, 300.0];
/// Squared scales that the memories take from one reading at most. What goes on for minutes after a burst, such as a fault or a lost
/// estimate, must be bounded: two standard deviations.
const MOST_SQUARED: [f64; 2] = [f64::MAX, 4.0];
/// Averages with at most this multiple of white noise's mean square count as chance.
const CHANCE: f64 = 1.5;
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
    /// dh/dp, divided by noise, then by the filter's S (U5).
    forced: Columns,
    /// Per row: one over the standard deviation of its noise; 0 if it was not used.
    weights: Vec<f64>,
    /// Workspaces for an update with all readings, and for one in parts.
    carried: Carried,
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
            names,
            score: None,
            answers: vec![0.0; m * width],
            forced: Columns::zeros(m, width),
            weights: vec![0.0; m],
            carried: Carried::new(n, m, width),
            parts: (config.filter == FilterKind::Factorised).then(|| Parts::new(n, width)),
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
        self.forced = Columns::zeros(m, width);
        self.carried = Carried::new(n, m, width);
        self.parts = self.parts.as_ref().map(|_| Parts::new(n, width));
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
        self.forced.clear();
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
        let is_whole = filter.carry(&self.forced, &mut self.carried, slopes);
        if let Some(Parts { prior, pull }) = self.parts.as_mut().filter(|_| !is_whole) {
            filter.substitute(Side::Left, &mut self.forced);
            filter.substitute(Side::Right, &mut self.forced);
            gather_pull(&self.straight, &self.roles, &self.weights, &self.forced, pull);
            prior.update(p, filter, pull, slopes);
        }
        if !slopes.iter().all(|s| s.abs() < ABSURD) {
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
            let (weight, forced) = (self.weights[row], self.forced.row_mut(row));
            let mut force = |k: usize, by: f64| {
                forced[k] += by * weight;
                answer[k] += if is_used { by } else { 0.0 };
            };
            for slope in slopes {
                if let Role::Considered(k, std) = self.roles[slope.state] {
                    force(k, slope.rows[i] * std);
                }
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
        if self.how == Consider::Always {
            return;
        }
        let (_, m, width) = self.size;
        let telling = (0..m).filter(|&r| self.telling[r]);
        for r in telling.clone().filter(|&r| told(r)) {
            let range = r * width..(r + 1) * width;
            doubt.rows[r].take(&mut doubt.expected[range.clone()], &self.answers[range], (time_s, innovation[r]));
        }
        let [short, lasting] = [0, 1].map(|memory| {
            self.scales.clear();
            self.scales.extend(telling.clone().filter_map(|r| doubt.rows[r].squares[memory].scale_squared()));
            let middle = self.scales.len() / 2;
            (!self.scales.is_empty()).then(|| {
                let (_, &mut median, _) = self.scales.select_nth_unstable_by(middle, f64::total_cmp);
                median.max(0.0).sqrt()
            })
        });
        doubt.lasting = lasting.unwrap_or(doubt.lasting);
        if short.or(lasting).is_some() {
            doubt.scale = short.unwrap_or_default().max(doubt.lasting);
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

impl RowAverages {
    /// Adds one innovation and its derivatives by each parameter to the averages.
    fn take(&mut self, expected: &mut [f64], answers: &[f64], (time_s, innovation): (f64, f64)) {
        let dt = time_s - self.last_s;
        if !dt.is_finite() {
            (self.last, self.last_s) = (innovation, time_s);
            return;
        }
        let pace = (dt / AVERAGE_S).min(1.0);
        self.low += pace * (innovation - self.low);
        let mut owed = 0.0;
        for (e, a) in expected.iter_mut().zip(answers) {
            *e += pace * (a - *e);
            owed += *e * *e;
        }
        self.count += 1.0;
        let jump = innovation - self.last;
        let floor = pace / (2.0 - pace) * 0.5 * jump * jump;
        for (squares, (memory_s, most)) in self.squares.iter_mut().zip(MEMORIES_S.into_iter().zip(MOST_SQUARED)) {
            let keep = (dt / memory_s).max(1.0 / self.count).min(1.0);
            squares.power += keep * ((self.low * self.low).min(CHANCE * floor + most * owed) - squares.power);
            squares.white += keep * (floor - squares.white);
            squares.share += keep * (owed - squares.share);
        }
        (self.last, self.last_s) = (innovation, time_s);
    }
}

impl Squares {
    /// Squared scale of the parameters' errors; `None` where noise is larger than what they explain.
    fn scale_squared(&self) -> Option<f64> {
        (self.share > self.white && self.white > 0.0).then(|| (self.power - CHANCE * self.white) / self.share)
    }
}

/// Workspace for an update in parts, limb by limb.
#[derive(Debug, Clone)]
struct Parts {
    prior: Prior,
    /// J'W dh/dp with W = (R^1/2 S R^1/2)^-1.
    pull: Vec<f64>,
}

impl Parts {
    fn new(states: usize, width: usize) -> Self {
        Parts { prior: Prior::new(states, width), pull: vec![0.0; states * width] }
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
