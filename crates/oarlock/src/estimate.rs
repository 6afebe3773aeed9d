//! Sigma-point estimation. Knows states, readings and time, and nothing of bodies or sensors.

pub mod belief;
pub mod clique;
pub mod filter;
pub mod learn;
pub mod sigma;
pub mod smoother;
pub mod solve;
pub mod split;
pub mod star;
pub mod start;
pub mod transition;

use crate::kernels::lane::Lane;
use crate::kernels::sparse_jacobian::Straight;
use split::Split;
use transition::{Block, Transition};

/// How the state is ordered: what is linear where decides which sigma points need a twin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Partition {
    /// First block: whatever moves a frame or turns a reading. Readings are curved in it.
    pub pose: usize,
    /// Second block: rates. Readings are quadratic in them.
    pub rate: usize,
    /// The rest: accelerations, biases, accelerations of the base. Readings are linear in them.
    pub linear: usize,
}

impl Partition {
    /// Dimension of the tangent space.
    pub fn dim(&self) -> usize {
        self.pose + self.rate + self.linear
    }

    /// How many columns need a plus and a minus point.
    pub fn curved(&self) -> usize {
        self.pose + self.rate
    }
}

/// Eight states side by side, around one mean.
#[derive(Debug, Clone, Copy)]
pub struct Points<'a> {
    /// In the middle.
    pub mean: &'a [f64],
    /// From there, in the tangent space.
    pub delta: &'a [Lane],
    /// How far every input is off what the moment says.
    pub off: &'a [Lane],
}

impl Points<'_> {
    /// A coordinate that simply adds.
    #[inline(always)]
    pub fn at(&self, i: usize) -> Lane {
        let mean = self.mean[i];
        Lane(self.delta[i].0.map(|x| x + mean))
    }
}

/// Of which states a reading is which function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Depth {
    /// Of poses alone.
    Pose,
    /// Affine in rates and in the linear block, at fixed poses.
    Affine,
    /// Of everything.
    Full,
}

/// In what some points may differ from the mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Vary {
    /// In states from this one on.
    pub from: usize,
    /// In inputs.
    pub inputs: bool,
}

/// What is estimated: how it moves by itself and what is read from it.
pub trait System {
    /// What the readings of one instant depend on besides the state: inputs, and which rows are there.
    type Moment: Clone;
    /// Room to work in, made once.
    type Scratch;

    /// Order of the state.
    fn partition(&self) -> Partition;
    /// Length of the measurement vector.
    fn row_count(&self) -> usize;
    /// How the state falls apart for a factorised filter: not at all, unless the system says so.
    fn split(&self) -> Split {
        Split::whole(self.partition().dim(), self.row_count())
    }
    /// The same moment for one who asks for these rows alone. Allocates nothing where `out` has been a moment of this system.
    fn narrow(&self, moment: &Self::Moment, asked: &[bool], out: &mut Self::Moment) {
        let _ = asked;
        out.clone_from(moment);
    }
    /// Standard deviation of each noisy input that the readings depend on besides the state.
    fn input_std(&self) -> &[f64];
    /// Room to work in.
    fn scratch(&self) -> Self::Scratch;
    /// Moves the mean by `delta` (tangent space).
    fn shift(&self, mean: &mut [f64], delta: &[f64]) {
        mean.iter_mut().zip(delta).for_each(|(m, d)| *m += d);
    }
    /// Tangent vector that leads from `from` to `to`.
    fn difference(&self, to: &[f64], from: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(to.iter().zip(from)).for_each(|(o, (t, f))| *o = t - f);
    }
    /// How the tangent space turns when the mean moves by `delta`: pushes the blocks that carry a covariance along.
    fn carry(&self, _delta: &[f64], _out: &mut Vec<Block>) {}
    /// Coordinates whose own driving noise the filter may learn: the ones that it enters first.
    fn driven(&self) -> &[usize];
    /// Motion of `mean` over `dt` seconds; `variance` is the diagonal of the covariance, `drive` the factor on the driving noise of
    /// each driven coordinate (1 where it is absent).
    fn transition(&self, dt: f64, mean: &[f64], variance: &[f64], drive: &[f64], out: &mut Transition);
    /// Readings of the rows that are there, for every lane.
    fn readings(&self, moment: &Self::Moment, scratch: &mut Self::Scratch, at: Points, out: &mut [Lane]);
    /// Readings of the rows that are there, at the mean alone, and their derivative: a row of numbers for each reading, one for
    /// every coordinate of the tangent space at the mean and one for each noisy input, for a change of its standard deviation.
    fn linearise(
        &self,
        moment: &Self::Moment,
        scratch: &mut Self::Scratch,
        mean: &[f64],
        center: &mut [f64],
        jacobian: &mut [f64],
    );
    /// What row `row` depends on.
    fn depth(&self, _row: usize) -> Depth {
        Depth::Full
    }
    /// The same at the mean itself, in the first lane; what is found out on the way may be kept for points that share it.
    #[inline(always)]
    fn settle<const FUSED: bool>(
        &self,
        moment: &Self::Moment,
        scratch: &mut Self::Scratch,
        at: Points,
        out: &mut [Lane],
    ) {
        self.readings(moment, scratch, at, out);
    }
    /// The same for points that share with the mean, last settled at, all but what they `vary` in.
    #[inline(always)]
    fn readings_near<const FUSED: bool>(
        &self,
        moment: &Self::Moment,
        scratch: &mut Self::Scratch,
        at: Points,
        vary: Vary,
        out: &mut [Lane],
    ) {
        let _ = vary;
        self.readings(moment, scratch, at, out);
    }
    /// Room for the derivatives of all readings by rates and linear block, where the system tells them; else points are spread there.
    /// Readings that depend on poses alone are no rows of it.
    fn straight(&self) -> Option<Straight> {
        None
    }
    /// These derivatives, at the mean last settled at.
    #[inline(always)]
    fn straighten<const FUSED: bool>(&self, _: &Self::Moment, _: &mut Self::Scratch, _: &mut Straight) {}
    /// What the square of a change `delta` of the rates alone adds to each reading of [`Depth::Full`], at the poses of the mean last
    /// settled at.
    #[inline(always)]
    fn curve<const FUSED: bool>(&self, _: &Self::Moment, _: &mut Self::Scratch, _delta: &[Lane], _out: &mut [Lane]) {}
    /// Room for what [`System::linearise`] gives, without zeros, where the system can give it so: inputs are columns behind the states.
    fn tangent(&self) -> Option<Straight> {
        None
    }
    /// The same as [`System::linearise`], into this room.
    #[inline(always)]
    fn linearise_into<const FUSED: bool>(
        &self,
        _: &Self::Moment,
        _: &mut Self::Scratch,
        _mean: &[f64],
        _center: &mut [f64],
        _straight: &mut Straight,
    ) {
    }
}
