//! What is known only roughly and not estimated: mounts, lengths, places of units, zeros of encoders.
//!
//! Each of these parameters, a standard deviation off, would have led the filter astray by so much: the *slopes* dx/dp, carried along
//! with the belief (Schmidt 1966; in the form that leaves the filter as it is: Friedland 1969). They widen the bands and move
//! nothing. How far off the parameters are as a whole, in their standard deviations, is learnt: where the model is right, innovations
//! are white, and their low-passed values are as small as those of noise; where it is wrong they last as the slopes foretell.

mod delays;
mod tally;
mod twin;

use super::{Calibration, Tracker};
use crate::body::{Body, Moment};
use crate::config::{Config, Consider};
use crate::error::Result;
use crate::estimate::belief::Belief;
use crate::estimate::filter::Verdict;
use crate::estimate::transition::Transition;
use crate::estimate::{FastSystem, System};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::dense::{accumulate, Square};
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kernels::tiles::padded;
use crate::sensor::imu::MountValue;
use crate::sensor::Quantity;
use delays::Delays;
use tally::Tally;
pub use tally::Window;
use twin::{twin, Role, Roles, ZERO_STD};

/// Innovations are averaged over this, s: longer than noise and learnt driving remember, and than skin wobbles; shorter than a cycle of movement.
const AVERAGE_S: f64 = 0.6;
/// Memory of how large averages are, s.
const MEMORY_S: f64 = 5.0;
/// Averages up to this many times (squared) as large as those of white noise are chance.
const CHANCE: f64 = 1.5;
/// Slopes beyond this say that the recursion is no longer one.
const ABSURD: f64 = 1e3;
/// Numbers kept of each row: its average innovation, the last one, when that was, how many there were, and the mean squares of average,
/// white noise and expectation.
const PER_ROW: usize = 7;
/// Scale, how many numbers there are of each state, and how many of these are of parameters whose standard deviation a calibration tells.
const HEAD: usize = 3;

/// Room for the slopes of a body.
#[derive(Debug, Clone)]
pub(super) struct Considering {
    arch: Arch,
    /// The body with everything that is considered among its states.
    twin: Body,
    scratch: Box<<Body as System>::Scratch>,
    straight: SparseJacobian,
    roles: Vec<Role>,
    /// Of each row that an encoder's zero shifts.
    zeros: Vec<Option<usize>>,
    /// Rows whose innovations last only where the model is wrong.
    telling: Vec<bool>,
    /// Mean of the twin; where its entries stand in the filter's.
    mean: Vec<f64>,
    from: Vec<Option<usize>>,
    center: Vec<f64>,
    /// States, rows, and considered parameters, padded.
    size: (usize, usize, usize),
    /// Parameters whose standard deviation a calibration tells; they come first.
    told: usize,
    how: Consider,
    /// Of inertial noise and of rough readings, as the update has them: what it learns is for the next.
    inflated: (f64, f64),
    /// What is considered, in its order.
    names: Vec<String>,
    /// Of clocks that may be late, and normal equations of everything; only to calibrate.
    score: Option<(Delays, Tally)>,
    /// What an innovation owes to each parameter, row by row.
    answers: Vec<f64>,
    /// J'WB.
    pull: Vec<f64>,
    scales: Vec<f64>,
}

impl Considering {
    /// `None` where nothing is considered.
    pub(super) fn new(
        body: &Body,
        mounts: &[Option<MountValue>],
        known: &Calibration,
        config: &Config,
    ) -> Result<Option<Self>> {
        let (twin, told) = twin(body, mounts, known, config)?;
        let Roles { roles, mut names, told } = Roles::of(body, &twin, known, &told);
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
        let mut mean = vec![0.0; twin.layout.dim()];
        for ((_, state), length) in twin.layout.lengths.iter().zip(twin.lengths()) {
            mean[*state] = length;
        }
        let (n, m, width) = (body.layout.dim(), body.suite.len(), padded(names.len()));
        Ok(Some(Considering {
            arch: Arch::best(),
            scratch: Box::new(twin.scratch()),
            straight: twin.jacobian_pattern().unwrap_or_default(),
            roles,
            zeros,
            telling,
            from: twin.layout.names.iter().map(position).collect(),
            mean,
            center: vec![0.0; m],
            size: (n, m, width),
            told,
            how: config.consider,
            inflated: (1.0, 1.0),
            names,
            score: None,
            answers: vec![0.0; m * width],
            pull: vec![0.0; n * width],
            scales: Vec::with_capacity(m),
            twin,
        }))
    }

    /// Sums up what innovations say of everything that is considered and of clocks, in windows, from `settle_s` behind the first update
    /// on.
    pub(super) fn keep_score(&mut self, body: &Body, settle_s: f64, window_s: f64) {
        let (delays, sources) = Delays::new(body, &self.twin, self.names.len());
        self.names.extend(sources.into_iter().map(|name| format!("{name}.delay")));
        let (n, m, _) = self.size;
        let width = padded(self.names.len());
        self.size.2 = width;
        self.answers = vec![0.0; m * width];
        self.pull = vec![0.0; n * width];
        self.how = Consider::Always;
        self.score = Some((delays, Tally::new(width, settle_s, window_s)));
    }

    /// What is considered, with standard deviations that the windows count in, and the windows.
    pub(super) fn score(&mut self) -> (Vec<(String, f64)>, Vec<Window>) {
        let mut stds = vec![ZERO_STD; self.names.len()];
        for (column, role) in self.roles.iter().enumerate() {
            if let Role::Considered(k, std) = role {
                // Columns of inputs count in the standard deviation of these.
                stds[*k] = if column < self.twin.layout.dim() { *std } else { ZERO_STD };
            }
        }
        let delays = self.names.iter().zip(&mut stds).filter(|(name, _)| name.ends_with(".delay"));
        delays.for_each(|(_, std)| *std = delays::DELAY_STD_S);
        let windows = self.score.as_mut().map_or(Vec::new(), |(_, tally)| tally.close().to_vec());
        (self.names.iter().cloned().zip(stds).collect(), windows)
    }

    /// A first doubt: nothing has led astray yet. Empty where nothing is to be considered.
    pub(super) fn fresh(&self) -> Vec<f64> {
        if self.how == Consider::Off {
            return Vec::new();
        }
        let mut doubt = vec![0.0; self.len()];
        let scale = f64::from(u8::from(self.how == Consider::Always));
        doubt[..HEAD].copy_from_slice(&[scale, self.size.2 as f64, self.told as f64]);
        let (_, rows, _) = self.parts(&mut doubt);
        rows.chunks_mut(PER_ROW).for_each(|row| row[2] = f64::NAN);
        doubt
    }

    /// How many numbers that are.
    pub(super) fn len(&self) -> usize {
        let (n, m, width) = self.size;
        HEAD + n * width + m * (PER_ROW + width)
    }

    /// Slopes, what is kept of each row, and its expected averages.
    fn parts<'a>(&self, doubt: &'a mut [f64]) -> (&'a mut [f64], &'a mut [f64], &'a mut [f64]) {
        let (n, m, width) = self.size;
        let (slopes, rest) = doubt[HEAD..].split_at_mut(n * width);
        let (rows, expected) = rest.split_at_mut(m * PER_ROW);
        (slopes, rows, expected)
    }

    /// Takes the slopes on as the error of the mean goes.
    pub(super) fn predict(&self, transition: &Transition, doubt: &mut [f64]) {
        let (n, _, width) = self.size;
        if doubt.is_empty() {
            return;
        }
        transition.apply_to_rows(&mut doubt[HEAD..HEAD + n * width], width);
    }

    /// Forgets where the belief has been led: it was fitted anew.
    pub(super) fn forget(&self, doubt: &mut [f64]) {
        let (n, _, width) = self.size;
        if !doubt.is_empty() {
            doubt[HEAD..HEAD + n * width].fill(0.0);
        }
    }

    /// Finds how readings answer at the mean before an update.
    pub(super) fn look(&mut self, belief: &Belief, moment: &Moment) {
        let mean = &belief.mean;
        self.inflated = (belief.inflation, belief.roughness);
        if let Some((delays, _)) = &mut self.score {
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

    /// Takes in what the update did.
    pub(super) fn follow(
        &mut self,
        doubt: &mut [f64],
        (time_s, p, shift, innovation): (f64, &Square, &[f64], Option<&[f64]>),
        row_variance: impl Fn(usize) -> Option<f64>,
    ) {
        let (n, _, width) = self.size;
        self.pull.fill(0.0);
        let counts = innovation.is_some() && self.score.as_mut().is_some_and(|(_, tally)| tally.begin(time_s));
        let slopes = &mut doubt[HEAD..HEAD + n * width];
        for t in 0..self.straight.triples.len() {
            self.answer(t, slopes, innovation.filter(|_| counts), &row_variance);
        }
        if let Some((_, tally)) = self.score.as_mut().filter(|_| counts) {
            tally.keep(slopes);
        }
        self.arch.run(Following { slopes, p, pull: &self.pull, width });
        if let Some((_, tally)) = self.score.as_mut().filter(|_| counts) {
            tally.update(&self.pull, slopes, shift);
        }
        if !slopes.iter().all(|s| s.abs() < ABSURD) {
            slopes.fill(0.0);
        }
    }

    /// What an update has left of some readings, over what it should have: sum of squares, and how many readings these stand for
    /// (Helmert's components of variance; Teunissen and Amiri-Simkooei 2008).
    fn leftover(
        &self,
        rows: &[bool],
        (p, shift, innovation): (&Square, &[f64], &[f64]),
        variance: impl Fn(usize) -> Option<f64>,
    ) -> (f64, f64) {
        let (mut squares, mut count) = (0.0, 0.0);
        for triple in self.straight.triples.iter().filter(|t| rows[t.row]) {
            for i in 0..triple.count {
                let Some(noise) = variance(triple.row + i) else { continue };
                let slopes =
                    self.straight.slopes[triple.slopes.clone()].iter().map(|s| (self.roles[s.state], s.rows[i]));
                let added = triple.added.map(|first| (self.roles[first + i], 1.0));
                let by = |(role, by)| if let Role::State(s) = role { Some((s, by)) } else { None };
                let terms = slopes.chain(added).filter_map(by);
                let left = innovation[triple.row + i] - terms.clone().map(|(s, by)| by * shift[s]).sum::<f64>();
                let spread: f64 =
                    terms.clone().map(|(s, by)| by * terms.clone().map(|(t, bt)| p.at(s, t) * bt).sum::<f64>()).sum();
                squares += left * left / noise;
                count += (1.0 - spread / noise).max(0.0);
            }
        }
        (squares, count)
    }

    /// Of a few rows: B = J dx/dp + dh/dp, and their part of J'WB.
    fn answer(&mut self, t: usize, slopes: &[f64], counted: Option<&[f64]>, variance: &impl Fn(usize) -> Option<f64>) {
        let (_, _, width) = self.size;
        let triple = &self.straight.triples[t];
        for i in 0..triple.count {
            let row = triple.row + i;
            let Some(noise) = variance(row) else { continue };
            let answer = &mut self.answers[row * width..(row + 1) * width];
            answer.fill(0.0);
            let mut input_noise = 0.0;
            for slope in &self.straight.slopes[triple.slopes.clone()] {
                let by = slope.rows[i];
                match self.roles[slope.state] {
                    Role::State(s) => {
                        answer.iter_mut().zip(&slopes[s * width..(s + 1) * width]).for_each(|(a, x)| *a += by * x);
                    }
                    Role::Considered(k, std) => answer[k] += by * std,
                    Role::Nothing => {}
                }
                if slope.state >= self.straight.n {
                    input_noise += by * by;
                }
            }
            if let Some(Role::State(s)) = triple.added.map(|first| self.roles[first + i]) {
                answer.iter_mut().zip(&slopes[s * width..(s + 1) * width]).for_each(|(a, x)| *a += x);
            }
            if let Some(k) = self.zeros[row] {
                answer[k] += ZERO_STD;
            }
            if let Some((delays, _)) = &self.score {
                let felt = &self.straight.slopes[triple.slopes.clone()];
                if let Some((k, late)) = delays.answer(triple, i, felt, &self.roles) {
                    answer[k] += late;
                }
            }
            let weight = 1.0 / (noise + input_noise);
            if let (Some((_, tally)), Some(innovation)) = (&mut self.score, counted) {
                tally.row(answer, weight, innovation[row]);
            }
            for slope in &self.straight.slopes[triple.slopes.clone()] {
                if let Role::State(s) = self.roles[slope.state] {
                    let by = weight * slope.rows[i];
                    let pull = &mut self.pull[s * width..(s + 1) * width];
                    pull.iter_mut().zip(&*answer).for_each(|(p, a)| *p += by * a);
                }
            }
            if let Some(Role::State(s)) = triple.added.map(|first| self.roles[first + i]) {
                let pull = &mut self.pull[s * width..(s + 1) * width];
                pull.iter_mut().zip(&*answer).for_each(|(p, a)| *p += weight * a);
            }
        }
    }

    /// How far off the parameters are as a whole, from innovations that last.
    pub(super) fn learn(&mut self, doubt: &mut [f64], time_s: f64, innovation: &[f64], told: impl Fn(usize) -> bool) {
        if self.how == Consider::Always {
            return;
        }
        let (_, m, width) = self.size;
        let mut scales = std::mem::take(&mut self.scales);
        scales.clear();
        let (_, rows, expected) = self.parts(doubt);
        for r in (0..m).filter(|&r| self.telling[r]) {
            let kept: &mut [f64; PER_ROW] = rows[r * PER_ROW..].first_chunk_mut().expect("kept of each row");
            let expected = &mut expected[r * width..(r + 1) * width];
            if told(r) {
                average(kept, expected, &self.answers[r * width..(r + 1) * width], (time_s, innovation[r]));
            }
            let [.., power, white, share] = *kept;
            if share > white && white > 0.0 {
                scales.push((power - CHANCE * white) / share);
            }
        }
        let middle = scales.len() / 2;
        if !scales.is_empty() {
            let (_, &mut median, _) = scales.select_nth_unstable_by(middle, f64::total_cmp);
            doubt[0] = median.max(0.0).sqrt();
        }
        self.scales = scales;
    }
}

/// Takes one innovation and what it owes to each parameter into their averages.
fn average(kept: &mut [f64; PER_ROW], expected: &mut [f64], answers: &[f64], (time_s, innovation): (f64, f64)) {
    let [low, last, last_s, count, power, white, share] = kept;
    let dt = time_s - *last_s;
    if !dt.is_finite() {
        (*last, *last_s) = (innovation, time_s);
        return;
    }
    let pace = (dt / AVERAGE_S).min(1.0);
    *low += pace * (innovation - *low);
    let mut owed = 0.0;
    for (e, a) in expected.iter_mut().zip(answers) {
        *e += pace * (a - *e);
        owed += *e * *e;
    }
    *count += 1.0;
    let keep = (dt / MEMORY_S).max(1.0 / *count).min(1.0);
    let jump = innovation - *last;
    let floor = pace / (2.0 - pace) * 0.5 * jump * jump;
    *power += keep * (*low * *low - *power);
    *white += keep * (floor - *white);
    *share += keep * (owed - *share);
    (*last, *last_s) = (innovation, time_s);
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

/// dx/dp loses P J'WB: the gain that an update with the covariance P behind it has had.
struct Following<'a> {
    slopes: &'a mut [f64],
    p: &'a Square,
    pull: &'a [f64],
    width: usize,
}

impl Kernel for Following<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for (i, row) in self.slopes.chunks_exact_mut(self.width).enumerate() {
            let terms = self.p.row(i).iter().zip(self.pull.chunks_exact(self.width));
            accumulate(row, terms.map(|(p, pull)| (-p, pull)));
        }
    }
}

impl Tracker {
    /// Whether anything is made of the slopes: of noise that is learnt, or of what is considered.
    fn wants_slopes(&self, belief: &Belief) -> bool {
        !belief.doubt.is_empty() || self.settings.learning.memory_s.is_finite()
    }

    /// Before an update.
    pub(super) fn look_around(&mut self, belief: &Belief) {
        let wanted = self.wants_slopes(belief);
        if let Some(considering) = self.considering.as_mut().filter(|_| wanted) {
            considering.look(belief, &self.moment);
        }
    }

    /// Behind an update: what is considered has led the belief so much farther astray.
    pub(super) fn follow_doubt(&mut self, belief: &mut Belief) {
        let wanted = self.wants_slopes(belief);
        let Some(considering) = self.considering.as_mut().filter(|_| wanted) else { return };
        let (z, std, inertial) = (&self.z, &self.std, &self.inertial_rows);
        let (inflation, roughness, rough) = (belief.inflation, belief.roughness, &self.rough_rows);
        let believed = |r: usize| !z[r].is_nan() && self.info.parts[self.part_of[r]] == Verdict::Accepted;
        let inflated = |r: usize, (inflation, roughness): (f64, f64)| {
            let factor = if inertial[r] { inflation } else { 1.0 } * if rough[r] { roughness } else { 1.0 };
            believed(r).then_some(std[r] * std[r] * factor)
        };
        let (squares, count) = considering.leftover(
            &self.rough_rows,
            (&belief.covariance, self.filter.shift(), &self.info.innovation),
            |r| inflated(r, (inflation, roughness)),
        );
        if count > 0.0 && self.learns && self.filter.is_whole() {
            let (learning, dt) = (self.settings.learning, self.filter.since_s());
            let roughness = learning.inflation(belief.roughness, belief.leftover, dt, squares / count);
            belief.leftover = learning.usual_nis(belief.leftover, dt, squares / count);
            belief.roughness = roughness;
        }
        if belief.doubt.is_empty() {
            return;
        }
        let innovation = self.learns.then_some(&self.info.innovation[..]);
        let update = (belief.time_s, &belief.covariance, self.filter.shift(), innovation);
        let now = considering.inflated;
        considering.follow(&mut belief.doubt, update, |r| inflated(r, now));
        considering.learn(&mut belief.doubt, belief.time_s, &self.info.innovation, believed);
    }
}
