//! Readings taken as straight lines through one state: the columns of an extended Kalman filter.
//!
//! With P = U'U and the Jacobian J, they are H = J U' and, for every noisy input, J's own column. There are no second-order
//! ones: what curvature adds to the mean reading and to its variance is left out.

use crate::estimate::sigma::{Fan, Look};
use crate::estimate::FastSystem;
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::dense::accumulate;
use crate::kernels::sparse_jacobian::{turn, Straight};
use crate::kernels::tiles::{padded, Panel, VECTOR};

/// Room for linearised readings.
#[derive(Debug, Clone)]
pub struct Tangent {
    n: usize,
    inputs: usize,
    /// Of systems that give it without zeros.
    straight: Option<Straight>,
    /// Else a row for each reading: states, then noisy inputs.
    jacobian: Vec<f64>,
    asked: Vec<bool>,
    /// Row j is column j of the factor of the covariance, reversed.
    factor: Panel,
}

impl Tangent {
    /// For a system of `n` states.
    pub fn new<S: FastSystem>(system: &S) -> Self {
        let (n, inputs, rows) = (system.partition().dim(), system.input_std().len(), system.row_count());
        let straight = system.tangent();
        let size = if straight.is_some() { 0 } else { rows * (n + inputs) };
        let factor = Panel::zeros(n, padded(n));
        Tangent { n, inputs, straight, jacobian: vec![0.0; size], asked: vec![false; rows], factor }
    }

    /// Fills the fan; `root` is the factor of the covariance. Allocates nothing.
    pub fn spread<S: FastSystem>(
        &mut self,
        arch: Arch,
        fan: &mut Fan,
        look: Look<S>,
        scratch: &mut S::Scratch,
        root: &Panel,
    ) {
        arch.run(Turning { root, n: self.n, turned: &mut self.factor });
        if self.straight.is_none() {
            look.system.linearise(look.moment, scratch, look.mean, &mut fan.center, &mut self.jacobian);
        }
        arch.run(Columns { tangent: self, fan, look, scratch });
    }

    #[inline(always)]
    fn dense(&self, fan: &mut Fan, rows: &[usize]) {
        let (n, width) = (self.n, self.n + self.inputs);
        for &r in rows {
            let (slopes, of_inputs) = self.jacobian[r * width..(r + 1) * width].split_at(n);
            fan.even.row_mut(r)[..of_inputs.len()].copy_from_slice(of_inputs);
            let row = fan.odd.row_mut(r);
            row.fill(0.0);
            let last = slopes.iter().rposition(|&s| s != 0.0).unwrap_or(0);
            // From the beginning of a vector.
            let start = (n - 1 - last) / VECTOR * VECTOR;
            let factor = &self.factor;
            accumulate(&mut row[start..], (0..=last).map(|j| (slopes[j], &factor.row(j)[start..])));
        }
    }
}

struct Turning<'a> {
    root: &'a Panel,
    n: usize,
    turned: &'a mut Panel,
}

impl Kernel for Turning<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        turn(self.root, self.n, self.turned);
    }
}

struct Columns<'a, S: FastSystem> {
    tangent: &'a mut Tangent,
    fan: &'a mut Fan,
    look: Look<'a, S>,
    scratch: &'a mut S::Scratch,
}

impl<S: FastSystem> Kernel for Columns<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Columns { tangent, fan, look, scratch } = self;
        let Some(straight) = &mut tangent.straight else { return tangent.dense(fan, look.rows) };
        look.system.linearise_into::<FUSED>(look.moment, scratch, look.mean, &mut fan.center, straight);
        tangent.asked.fill(false);
        look.rows.iter().for_each(|&r| tangent.asked[r] = true);
        straight.times::<FUSED>(&tangent.factor, tangent.n, &tangent.asked, &mut fan.odd);
        straight.inputs(&tangent.asked, tangent.inputs, &mut fan.even);
    }
}
