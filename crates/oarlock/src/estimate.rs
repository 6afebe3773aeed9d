//! The filter, the smoother and the start fit, for any system of states and readings; `body` and `track` use them. No bodies or sensors.
//!
//! What is estimated is a [`System`]; [`FastSystem`] adds what makes its updates cheaper.

pub mod belief;
pub mod clique;
pub mod filter;
pub mod information;
pub mod shear;
pub mod sigma;
pub mod smoother;
pub mod split;
pub mod star;
pub mod start;
pub mod transition;

use crate::kernels::lane::Lane;
use crate::kernels::sparse_jacobian::SparseJacobian;
use shear::Shear;
use split::Split;
use transition::{Block, Transition};

/// Order of the state: where readings are linear, no sigma points are needed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Partition {
    /// First block: whatever moves a frame or turns a reading. Readings are nonlinear in it.
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

    /// Number of states in which readings are nonlinear.
    pub fn curved(&self) -> usize {
        self.pose + self.rate
    }
}

/// Eight states in the lanes, given by their differences from one mean.
#[derive(Debug, Clone, Copy)]
pub struct Points<'a> {
    /// The mean.
    pub mean: &'a [f64],
    /// Difference of each point from the mean, in the tangent space.
    pub delta: &'a [Lane],
    /// Error of every noisy input.
    pub off: &'a [Lane],
}

impl Points<'_> {
    /// Coordinate `i` of all points; not for coordinates on a manifold.
    #[inline(always)]
    pub fn at(&self, i: usize) -> Lane {
        let mean = self.mean[i];
        Lane(self.delta[i].0.map(|x| x + mean))
    }
}

/// How a reading depends on the blocks of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Dependence {
    /// Function of poses alone.
    Pose,
    /// Affine in rates and in the linear block, at fixed poses.
    Affine,
    /// Nonlinear in poses, quadratic in rates, linear in the rest.
    Full,
}

/// In which states and inputs some points differ from the mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PerturbedStates {
    /// States from this one on.
    pub from: usize,
    /// Inputs too.
    pub inputs: bool,
}

/// What is estimated: its state, how the state moves by itself, and what is measured of it.
///
/// The first six methods have to be written. The others describe what a plain vector of states lacks: noisy inputs, and coordinates on
/// a manifold.
pub trait System {
    /// What the readings of one instant depend on besides the state: inputs, and which rows are present.
    type Moment: Clone;
    /// Workspace, made once.
    type Scratch;

    /// Order of the state.
    fn partition(&self) -> Partition;
    /// Length of the measurement vector.
    fn row_count(&self) -> usize;
    /// Workspace of this system.
    fn scratch(&self) -> Self::Scratch;
    /// Motion of `mean` over `dt` seconds; `variance` is the diagonal of the covariance.
    fn transition(&self, dt: f64, mean: &[f64], variance: &[f64], out: &mut Transition);
    /// h(x): predicted readings of the rows that are present, for every lane.
    fn readings(&self, moment: &Self::Moment, scratch: &mut Self::Scratch, at: Points, out: &mut [Lane]);
    /// h(x) and its Jacobian at the mean, row by row: a column for every coordinate of the tangent space at the mean, then one for each
    /// noisy input, scaled by its standard deviation.
    fn linearise(
        &self,
        moment: &Self::Moment,
        scratch: &mut Self::Scratch,
        mean: &[f64],
        center: &mut [f64],
        jacobian: &mut [f64],
    );

    /// Standard deviation of each noisy input.
    fn input_std(&self) -> &[f64] {
        &[]
    }
    /// Moves the mean by `delta`, a vector of the tangent space.
    fn shift(&self, mean: &mut [f64], delta: &[f64]) {
        mean.iter_mut().zip(delta).for_each(|(m, d)| *m += d);
    }
    /// Tangent vector that leads from `from` to `to`.
    fn difference(&self, to: &[f64], from: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(to.iter().zip(from)).for_each(|(o, (t, f))| *o = t - f);
    }
    /// Jacobian of the change of tangent space when the mean moves by `delta`, in blocks: a covariance P becomes J P J' (P3).
    fn reset_jacobian(&self, _delta: &[f64], _out: &mut Vec<Block>) {}
    /// Changes of a covariance beyond `reset_jacobian` after the mean has moved by `delta` to `mean` (P4, P5).
    fn shears(&self, _mean: &[f64], _delta: &[f64], _out: &mut Vec<Shear>) {}
}

/// What a system may tell of its structure to make an update cheaper. Every default is right for any system.
pub trait FastSystem: System {
    /// Core and limbs, for the factorised filter.
    fn split(&self) -> Split {
        Split::whole(self.partition().dim(), self.row_count())
    }
    /// `moment` restricted to these rows. Allocates nothing where `out` has been a moment of this system.
    fn narrow(&self, moment: &Self::Moment, asked: &[bool], out: &mut Self::Moment) {
        let _ = asked;
        out.clone_from(moment);
    }
    /// Which states row `row` depends on, and how.
    fn dependence(&self, _row: usize) -> Dependence {
        Dependence::Full
    }
    /// h(x) at the mean, in the first lane; may keep intermediate results for the methods below.
    #[inline(always)]
    fn readings_at_mean<const FUSED: bool>(
        &self,
        moment: &Self::Moment,
        scratch: &mut Self::Scratch,
        at: Points,
        out: &mut [Lane],
    ) {
        self.readings(moment, scratch, at, out);
    }
    /// h(x) for points that differ from the mean of the last `readings_at_mean` only as `perturbed` says.
    #[inline(always)]
    fn readings_near_mean<const FUSED: bool>(
        &self,
        moment: &Self::Moment,
        scratch: &mut Self::Scratch,
        at: Points,
        perturbed: PerturbedStates,
        out: &mut [Lane],
    ) {
        let _ = perturbed;
        self.readings(moment, scratch, at, out);
    }
    /// Pattern of the Jacobian by rates and linear block, if `linear_jacobian` computes it; sigma points are used there otherwise.
    /// Rows of [`Dependence::Pose`] are no part of it.
    fn linear_pattern(&self) -> Option<SparseJacobian> {
        None
    }
    /// Fills in that Jacobian, at the mean of the last `readings_at_mean`.
    #[inline(always)]
    fn linear_jacobian<const FUSED: bool>(&self, _: &Self::Moment, _: &mut Self::Scratch, _: &mut SparseJacobian) {}
    /// Second-order term of a change `delta` of the rates alone, for each row of [`Dependence::Full`], at the mean of the last
    /// `readings_at_mean`. Needed where `linear_pattern` is given.
    #[inline(always)]
    fn second_order<const FUSED: bool>(
        &self,
        _: &Self::Moment,
        _: &mut Self::Scratch,
        _delta: &[Lane],
        _out: &mut [Lane],
    ) {
    }
    /// Pattern of the whole Jacobian, inputs behind the states, if `linearise_sparse` computes it.
    fn jacobian_pattern(&self) -> Option<SparseJacobian> {
        None
    }
    /// As [`System::linearise`], into that pattern.
    #[inline(always)]
    fn linearise_sparse<const FUSED: bool>(
        &self,
        _: &Self::Moment,
        _: &mut Self::Scratch,
        _mean: &[f64],
        _center: &mut [f64],
        _straight: &mut SparseJacobian,
    ) {
    }
}
