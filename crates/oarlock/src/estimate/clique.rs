//! Some states of a system and the readings that depend on no others, as a system of its own; for the factorised filter.

use super::transition::Transition;
use super::{Dependence, FastSystem, Partition, PerturbedStates, Points, System};
use crate::kernels::lane::{Lane, LANES};
use crate::kernels::sparse_jacobian::SparseJacobian;

/// Core and one limb: their states, rows and derivatives.
#[derive(Debug, Clone)]
pub struct Clique {
    /// States, in the order of the whole system.
    pub states: Vec<usize>,
    /// Per row of the whole: whether it belongs to this clique.
    pub rows: Vec<bool>,
    part: Partition,
    straight: Option<SparseJacobian>,
    /// Per slope: its number in the pattern of the whole.
    slopes: Vec<usize>,
}

impl Clique {
    /// `states` in order, on which only `rows` depend.
    pub fn new<S: FastSystem>(system: &S, states: Vec<usize>, rows: Vec<bool>) -> Self {
        let whole = system.partition();
        let count = |end: usize| states.iter().take_while(|&&s| s < end).count();
        let (pose, curved) = (count(whole.pose), count(whole.curved()));
        let part = Partition { pose, rate: curved - pose, linear: states.len() - curved };
        let mut slopes = Vec::new();
        let straight = system.linear_pattern().map(|all| {
            let mut own = SparseJacobian { n: states.len(), ..SparseJacobian::default() };
            let place = |state: usize| states.binary_search(&state).ok();
            for triple in all.triples.iter().filter(|t| rows[t.row]) {
                let found = triple.slopes.clone().filter_map(|k| Some((k, place(all.slopes[k].state)?)));
                let (numbers, columns): (Vec<usize>, Vec<usize>) = found.unzip();
                own.push(triple.row, triple.count, &columns, triple.added.and_then(place));
                slopes.extend(numbers);
            }
            own
        });
        Clique { states, rows, part, straight, slopes }
    }

    /// Picks the states of the clique out of a vector of the whole.
    pub fn gather(&self, whole: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(&self.states).for_each(|(o, &s)| *o = whole[s]);
    }
}

/// A system in which only one clique varies; the other states are those of the scratch's mean.
#[derive(Debug)]
pub struct CliqueSystem<'a, S: FastSystem> {
    /// The whole.
    pub system: &'a S,
    /// The states that vary.
    pub clique: &'a Clique,
}

/// Workspace, for any clique of a system.
#[derive(Debug, Clone)]
pub struct CliqueScratch<C> {
    inner: C,
    /// Mean of the whole; the caller fills in the states outside the clique.
    pub mean: Vec<f64>,
    delta: Vec<Lane>,
    straight: Option<SparseJacobian>,
}

impl<C> CliqueScratch<C> {
    /// Workspace for `system`.
    pub fn new<S: FastSystem<Scratch = C>>(system: &S) -> Self {
        let n = system.partition().dim();
        CliqueScratch {
            inner: system.scratch(),
            mean: vec![0.0; n],
            delta: vec![Lane([0.0; LANES]); n],
            straight: system.linear_pattern(),
        }
    }
}

impl<S: FastSystem> CliqueSystem<'_, S> {
    #[inline(always)]
    fn place(&self, delta: &[Lane], room: &mut CliqueScratch<S::Scratch>) {
        for (&state, delta) in self.clique.states.iter().zip(delta) {
            room.delta[state] = *delta;
        }
    }
}

/// For updates only: the whole system predicts, so there is no transition and no dense Jacobian.
impl<S: FastSystem> System for CliqueSystem<'_, S> {
    type Moment = S::Moment;
    type Scratch = CliqueScratch<S::Scratch>;

    fn partition(&self) -> Partition {
        self.clique.part
    }

    fn row_count(&self) -> usize {
        self.clique.rows.len()
    }

    fn scratch(&self) -> CliqueScratch<S::Scratch> {
        CliqueScratch::new(self.system)
    }

    fn input_std(&self) -> &[f64] {
        self.system.input_std()
    }

    fn transition(&self, _: f64, _: &[f64], _: &[f64], out: &mut Transition) {
        out.clear();
    }

    fn linearise(&self, _: &S::Moment, _: &mut CliqueScratch<S::Scratch>, _: &[f64], _: &mut [f64], _: &mut [f64]) {}

    fn readings(&self, moment: &S::Moment, room: &mut CliqueScratch<S::Scratch>, at: Points, out: &mut [Lane]) {
        self.place(at.delta, room);
        let at = Points { mean: &room.mean, delta: &room.delta, off: at.off };
        self.system.readings(moment, &mut room.inner, at, out);
    }
}

impl<S: FastSystem> FastSystem for CliqueSystem<'_, S> {
    fn dependence(&self, row: usize) -> Dependence {
        self.system.dependence(row)
    }

    #[inline(always)]
    fn readings_at_mean<const FUSED: bool>(
        &self,
        moment: &S::Moment,
        room: &mut CliqueScratch<S::Scratch>,
        at: Points,
        out: &mut [Lane],
    ) {
        room.delta.fill(Lane([0.0; LANES]));
        for (&state, &x) in self.clique.states.iter().zip(at.mean) {
            room.mean[state] = x;
        }
        let at = Points { mean: &room.mean, delta: &room.delta, off: at.off };
        self.system.readings_at_mean::<FUSED>(moment, &mut room.inner, at, out);
    }

    #[inline(always)]
    fn readings_near_mean<const FUSED: bool>(
        &self,
        moment: &S::Moment,
        room: &mut CliqueScratch<S::Scratch>,
        at: Points,
        perturbed: PerturbedStates,
        out: &mut [Lane],
    ) {
        self.place(at.delta, room);
        let at = Points { mean: &room.mean, delta: &room.delta, off: at.off };
        let from = self.clique.states.get(perturbed.from).copied().unwrap_or(room.mean.len());
        let perturbed = PerturbedStates { from, inputs: perturbed.inputs };
        self.system.readings_near_mean::<FUSED>(moment, &mut room.inner, at, perturbed, out);
    }

    fn linear_pattern(&self) -> Option<SparseJacobian> {
        self.clique.straight.clone()
    }

    #[inline(always)]
    fn linear_jacobian<const FUSED: bool>(
        &self,
        moment: &S::Moment,
        room: &mut CliqueScratch<S::Scratch>,
        straight: &mut SparseJacobian,
    ) {
        let Some(whole) = &mut room.straight else { return };
        self.system.linear_jacobian::<FUSED>(moment, &mut room.inner, whole);
        for (own, &number) in straight.slopes.iter_mut().zip(&self.clique.slopes) {
            own.rows = whole.slopes[number].rows;
        }
    }

    #[inline(always)]
    fn second_order<const FUSED: bool>(
        &self,
        moment: &S::Moment,
        room: &mut CliqueScratch<S::Scratch>,
        delta: &[Lane],
        out: &mut [Lane],
    ) {
        self.place(delta, room);
        self.system.second_order::<FUSED>(moment, &mut room.inner, &room.delta, out);
    }
}
