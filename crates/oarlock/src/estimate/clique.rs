//! Some states of a system and the readings that depend on no others, seen as a system of its own.

use super::transition::Transition;
use super::{Depth, FastSystem, Partition, Points, System, Vary};
use crate::kernels::lane::{Lane, LANES};
use crate::kernels::sparse_jacobian::Straight;

/// Which states, and where their derivatives stand.
#[derive(Debug, Clone)]
pub struct Clique {
    /// In the order of the whole.
    pub states: Vec<usize>,
    /// Of every row of the whole: whether it is read here.
    pub rows: Vec<bool>,
    part: Partition,
    straight: Option<Straight>,
    /// Of every slope, its number in the whole's.
    slopes: Vec<usize>,
}

impl Clique {
    /// Of `states`, on which nothing but `rows` depends; states are in order.
    pub fn new<S: FastSystem>(system: &S, states: Vec<usize>, rows: Vec<bool>) -> Self {
        let whole = system.partition();
        let count = |end: usize| states.iter().take_while(|&&s| s < end).count();
        let (pose, curved) = (count(whole.pose), count(whole.curved()));
        let part = Partition { pose, rate: curved - pose, linear: states.len() - curved };
        let mut slopes = Vec::new();
        let straight = system.straight().map(|all| {
            let mut own = Straight { n: states.len(), ..Straight::default() };
            let place = |state: usize| states.binary_search(&state).ok();
            for trio in all.trios.iter().filter(|t| rows[t.row]) {
                let found = trio.slopes.clone().filter_map(|k| Some((k, place(all.slopes[k].state)?)));
                let (numbers, columns): (Vec<usize>, Vec<usize>) = found.unzip();
                own.push(trio.row, trio.count, &columns, trio.added.and_then(place));
                slopes.extend(numbers);
            }
            own
        });
        Clique { states, rows, part, straight, slopes }
    }

    /// These coordinates of the whole.
    pub fn gather(&self, whole: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(&self.states).for_each(|(o, &s)| *o = whole[s]);
    }
}

/// A system of which one clique may vary, the rest being as it is in the room's mean.
#[derive(Debug)]
pub struct Within<'a, S: FastSystem> {
    /// The whole.
    pub system: &'a S,
    /// What varies.
    pub clique: &'a Clique,
}

/// Room for the whole.
#[derive(Debug, Clone)]
pub struct Room<C> {
    inner: C,
    /// Of the whole; whoever looks has filled in what does not vary.
    pub mean: Vec<f64>,
    delta: Vec<Lane>,
    straight: Option<Straight>,
}

impl<C> Room<C> {
    /// For any clique of `system`.
    pub fn new<S: FastSystem<Scratch = C>>(system: &S) -> Self {
        let n = system.partition().dim();
        Room {
            inner: system.scratch(),
            mean: vec![0.0; n],
            delta: vec![Lane([0.0; LANES]); n],
            straight: system.straight(),
        }
    }
}

impl<S: FastSystem> Within<'_, S> {
    #[inline(always)]
    fn place(&self, delta: &[Lane], room: &mut Room<S::Scratch>) {
        for (&state, delta) in self.clique.states.iter().zip(delta) {
            room.delta[state] = *delta;
        }
    }
}

/// To be looked at: moving is the whole's business.
impl<S: FastSystem> System for Within<'_, S> {
    type Moment = S::Moment;
    type Scratch = Room<S::Scratch>;

    fn partition(&self) -> Partition {
        self.clique.part
    }

    fn row_count(&self) -> usize {
        self.clique.rows.len()
    }

    fn scratch(&self) -> Room<S::Scratch> {
        Room::new(self.system)
    }

    fn input_std(&self) -> &[f64] {
        self.system.input_std()
    }

    fn transition(&self, _: f64, _: &[f64], _: &[f64], _: &[f64], out: &mut Transition) {
        out.clear();
    }

    fn linearise(&self, _: &S::Moment, _: &mut Room<S::Scratch>, _: &[f64], _: &mut [f64], _: &mut [f64]) {}

    fn readings(&self, moment: &S::Moment, room: &mut Room<S::Scratch>, at: Points, out: &mut [Lane]) {
        self.place(at.delta, room);
        let at = Points { mean: &room.mean, delta: &room.delta, off: at.off };
        self.system.readings(moment, &mut room.inner, at, out);
    }
}

impl<S: FastSystem> FastSystem for Within<'_, S> {
    fn depth(&self, row: usize) -> Depth {
        self.system.depth(row)
    }

    #[inline(always)]
    fn settle<const FUSED: bool>(&self, moment: &S::Moment, room: &mut Room<S::Scratch>, at: Points, out: &mut [Lane]) {
        room.delta.fill(Lane([0.0; LANES]));
        for (&state, &x) in self.clique.states.iter().zip(at.mean) {
            room.mean[state] = x;
        }
        let at = Points { mean: &room.mean, delta: &room.delta, off: at.off };
        self.system.settle::<FUSED>(moment, &mut room.inner, at, out);
    }

    #[inline(always)]
    fn readings_near<const FUSED: bool>(
        &self,
        moment: &S::Moment,
        room: &mut Room<S::Scratch>,
        at: Points,
        vary: Vary,
        out: &mut [Lane],
    ) {
        self.place(at.delta, room);
        let at = Points { mean: &room.mean, delta: &room.delta, off: at.off };
        let from = self.clique.states.get(vary.from).copied().unwrap_or(room.mean.len());
        let vary = Vary { from, inputs: vary.inputs };
        self.system.readings_near::<FUSED>(moment, &mut room.inner, at, vary, out);
    }

    fn straight(&self) -> Option<Straight> {
        self.clique.straight.clone()
    }

    #[inline(always)]
    fn straighten<const FUSED: bool>(&self, moment: &S::Moment, room: &mut Room<S::Scratch>, straight: &mut Straight) {
        let Some(whole) = &mut room.straight else { return };
        self.system.straighten::<FUSED>(moment, &mut room.inner, whole);
        for (own, &number) in straight.slopes.iter_mut().zip(&self.clique.slopes) {
            own.rows = whole.slopes[number].rows;
        }
    }

    #[inline(always)]
    fn curve<const FUSED: bool>(
        &self,
        moment: &S::Moment,
        room: &mut Room<S::Scratch>,
        delta: &[Lane],
        out: &mut [Lane],
    ) {
        self.place(delta, room);
        self.system.curve::<FUSED>(moment, &mut room.inner, &room.delta, out);
    }
}
