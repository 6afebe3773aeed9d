//! Rauch-Tung-Striebel smoother (1965), one step back at a time, for `track::run`. Allocates nothing after it is made.
//!
//! Equations S1 and S2 of docs/filter.md. With P the covariance at k, Pp = F P F' + Q the predicted one at k + 1 and Pn = X'X the smoothed
//! one there, one sweep gives
//!
//! ```text
//! Pp = U'U    G = U'^-1 X'    W = U'^-1 F P    s = U'^-1 (xn - xp)                      (S1)
//! ```
//!
//! and with the gain K = P F' Pp^-1 = W' U'^-1 the corrections are
//!
//! ```text
//! K (xn - xp) = W's        P + K (Pn - Pp) K' = (P - W'W) + Y'Y,    Y = G'W            (S2)
//! ```
//!
//! The bracket is P given that the next state is known. Both terms keep their sign, and there is no backward substitution.

use super::belief::Belief;
use super::filter::Diverged;
use super::shear::Shear;
use super::transition::{congruence, Block, Transition, Turning};
use super::System;
use crate::kernels::arch::{madd, Arch, Kernel};
use crate::kernels::dense::{semidefinite_factor, NotPositive, Square};
use crate::kernels::tiles::{factor, gram, padded, product, Panel, Rows, Sweep, RAISES, VECTOR};

/// Workspace of a step back (S1, S2), whatever the states mean.
///
/// States that are constant stand last. Their rows of K are those of the identity, so that W and Y have columns of U and X there, and only the
/// columns of the others are solved for.
#[derive(Debug, Clone)]
pub struct Backward {
    arch: Arch,
    /// The states in their order here, and how many of them are not constant.
    order: Vec<usize>,
    moving: usize,
    /// Pn in the tangent space at the predicted mean (P3), and Pp.
    next: Square,
    predicted: Square,
    /// X, upper triangular.
    x: Panel,
    /// F P.
    moved: Panel,
    /// [Pp | X' | F P | step] becomes [U | G | W | s].
    u_g_w_s: Panel,
    /// Per vector of its columns: the first row that is not zero.
    starts: Vec<usize>,
    w: Panel,
    y: Panel,
    /// P_s.
    covariance: Panel,
    zeros: Vec<usize>,
    step: Vec<f64>,
    /// Corrections of the states that are not constant.
    ordered: Vec<f64>,
    shift: Vec<f64>,
}

impl Backward {
    /// Workspace for `n` states, of which `constants` are in ascending order.
    pub fn new(n: usize, constants: &[usize]) -> Self {
        let is_moving = |i: &usize| constants.binary_search(i).is_err();
        let (moving, width) = (n - constants.len(), padded(n));
        let own = |v: usize| if (width..2 * width).contains(&(v * VECTOR)) { v * VECTOR - width } else { 0 };
        let all = 2 * width + padded(moving) + VECTOR;
        Backward {
            arch: Arch::best(),
            order: (0..n).filter(is_moving).chain(constants.iter().copied()).collect(),
            moving,
            next: Square::zeros(n),
            predicted: Square::zeros(n),
            x: Panel::zeros(n, width),
            moved: Panel::zeros(n, padded(moving)),
            u_g_w_s: Panel::zeros(n, all),
            starts: (0..all / VECTOR).map(own).collect(),
            w: Panel::zeros(n, width),
            y: Panel::zeros(n, width),
            covariance: Panel::zeros(n, width),
            zeros: vec![0; width / VECTOR],
            step: vec![0.0; n],
            ordered: vec![0.0; moving],
            shift: vec![0.0; n],
        }
    }

    /// Turns the filtered covariance at k into the smoothed one, given the predicted and the smoothed one at k + 1 in the tangent space of
    /// the prediction, and the step from the predicted to the smoothed mean. `advance` applies F to the columns of a panel. Returns the
    /// correction of the mean.
    pub fn step(
        &mut self,
        (next, predicted): (&Square, &Square),
        filtered: &mut Square,
        step: &[f64],
        advance: impl FnMut(&mut Panel),
    ) -> Result<&[f64], Diverged> {
        self.step.copy_from_slice(step);
        reorder(&self.order, next, &mut self.next);
        reorder(&self.order, predicted, &mut self.predicted);
        self.take_next()?;
        self.factorise(filtered, advance)?;
        self.add_squares(filtered, next);
        Ok(&self.shift)
    }

    /// X of S1.
    fn take_next(&mut self) -> Result<(), Diverged> {
        let n = self.order.len();
        let sweep = Sweep { n, width: padded(n), starts: &self.zeros };
        self.x.copy_upper(&self.next);
        if factor(self.arch, &mut self.x, sweep).is_err() {
            // Nothing divides by X, so a direction without variance may be zero in it.
            semidefinite_factor(&mut self.next).map_err(broken)?;
            self.x.copy_upper(&self.next);
        }
        Ok(())
    }

    /// S1.
    fn factorise(&mut self, filtered: &Square, mut advance: impl FnMut(&mut Panel)) -> Result<(), Diverged> {
        let n = self.order.len();
        for i in 0..n {
            let (row, from) = (self.moved.row_mut(i), filtered.row(i));
            row.iter_mut().zip(&self.order[..self.moving]).for_each(|(x, j)| *x = from[*j]);
        }
        advance(&mut self.moved);
        let mut done = Ok(());
        for share in RAISES {
            self.fill();
            self.u_g_w_s.copy_raised(&self.predicted, share);
            let sweep = Sweep { n, width: self.starts.len() * VECTOR, starts: &self.starts };
            done = factor(self.arch, &mut self.u_g_w_s, sweep).map_err(broken);
            if done.is_ok() {
                break;
            }
        }
        done
    }

    /// Fills in [X' | F P | xn - xp].
    fn fill(&mut self) {
        let (n, width, own) = (self.order.len(), padded(self.order.len()), padded(self.moving));
        for i in 0..n {
            let row = self.u_g_w_s.row_mut(i);
            for (j, x) in row[width..][..padded(i + 1)].iter_mut().enumerate() {
                *x = if j <= i { self.x.at(j, i) } else { 0.0 };
            }
            row[2 * width..][..own].copy_from_slice(&self.moved.row(self.order[i])[..own]);
            row[2 * width + own] = self.step[self.order[i]];
        }
    }

    /// S2: W's into `shift`, P_s in the place of P.
    fn add_squares(&mut self, covariance: &mut Square, next: &Square) {
        let (arch, n, moving) = (self.arch, self.order.len(), self.moving);
        let (width, own) = (padded(n), padded(moving));
        for i in 0..n {
            let (row, w) = (self.u_g_w_s.row(i), self.w.row_mut(i));
            w[..own].copy_from_slice(&row[2 * width..][..own]);
            (moving..n).for_each(|j| w[j] = if j >= i { row[j] } else { 0.0 });
        }
        let g = Rows { panel: &self.u_g_w_s, rows: 0..n, column: width, starts: &self.starts[width / VECTOR..] };
        let w = Rows { panel: &self.w, rows: 0..n, column: 0, starts: &self.zeros };
        product(arch, &mut self.y, [n, own], [g, w.clone()]);
        gram(arch, &mut self.covariance, [moving, width], w, true);
        for i in 0..n {
            let (x, y) = (self.x.row(i), self.y.row_mut(i));
            (moving..n).for_each(|j| y[j] = if j >= i { x[j] } else { 0.0 });
        }
        arch.run(Subtracting { backward: self, from: covariance });
        let y = Rows { panel: &self.y, rows: 0..n, column: 0, starts: &self.zeros };
        gram(arch, &mut self.covariance, [moving, width], y, false);
        for (i, row) in self.order.iter().enumerate() {
            for (j, column) in self.order.iter().enumerate().skip(i) {
                let x = if i < moving { self.covariance.at(i, j) } else { next.at(*row, *column) };
                *covariance.at_mut(*row, *column) = x;
                *covariance.at_mut(*column, *row) = x;
            }
        }
    }
}

/// Workspace of a smoother.
#[derive(Debug, Clone)]
pub struct Smoother {
    backward: Backward,
    /// Pn in the tangent space at the predicted mean (P3).
    next: Square,
    step: Vec<f64>,
    shift: Vec<f64>,
    reset: Vec<Block>,
    shears: Vec<Shear>,
    rows: [Vec<f64>; 3],
}

impl Smoother {
    /// Workspace for `n` states.
    pub fn new(n: usize) -> Self {
        Smoother {
            backward: Backward::new(n, &[]),
            next: Square::zeros(n),
            step: vec![0.0; n],
            shift: vec![0.0; n],
            reset: Vec::with_capacity(n),
            shears: Vec::with_capacity(n),
            rows: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
        }
    }

    /// Sets the instruction set, for comparisons.
    #[doc(hidden)]
    pub fn use_arch(&mut self, arch: Arch) {
        self.backward.arch = arch;
    }

    /// Turns `filtered` (at k) into the smoothed belief at k, given the transition to `predicted` (at k + 1) and the smoothed belief `next`
    /// at k + 1.
    pub fn back<S: System>(
        &mut self,
        system: &S,
        filtered: &mut Belief,
        transition: &Transition,
        predicted: &Belief,
        next: &Belief,
    ) -> Result<(), Diverged> {
        system.difference(&next.mean, &predicted.mean, &mut self.step);
        self.take_next(system, &predicted.mean, next);
        let Smoother { backward, next, step, rows, .. } = self;
        let arch = backward.arch;
        let advance = |panel: &mut Panel| arch.run(Moving { transition, panel, rows });
        let shift = backward.step((next, &predicted.covariance), &mut filtered.covariance, step, advance)?;
        self.shift.copy_from_slice(shift);
        system.shift(&mut filtered.mean, &self.shift);
        self.reset.clear();
        system.reset_jacobian(&self.shift, &mut self.reset);
        self.reset.iter().for_each(|block| congruence(arch, block, &mut filtered.covariance));
        self.shears.clear();
        system.shears(&filtered.mean, &self.shift, &mut self.shears);
        self.shears.iter().for_each(|shear| shear.apply(&mut filtered.covariance));
        Ok(())
    }

    /// Pn in the tangent space at the predicted mean.
    fn take_next<S: System>(&mut self, system: &S, predicted: &[f64], next: &Belief) {
        self.shift.iter_mut().zip(&self.step).for_each(|(back, x)| *back = -*x);
        self.reset.clear();
        system.reset_jacobian(&self.shift, &mut self.reset);
        self.next.clone_from(&next.covariance);
        self.reset.iter().for_each(|block| congruence(self.backward.arch, block, &mut self.next));
        self.shears.clear();
        system.shears(predicted, &self.shift, &mut self.shears);
        self.shears.iter().for_each(|shear| shear.apply(&mut self.next));
    }
}

/// Rows and columns of `from` in this order.
fn reorder(order: &[usize], from: &Square, to: &mut Square) {
    for (i, row) in order.iter().enumerate() {
        let from = from.row(*row);
        to.row_mut(i).iter_mut().zip(order).for_each(|(x, j)| *x = from[*j]);
    }
}

fn broken(e: NotPositive) -> Diverged {
    Diverged { what: format!("smoothing met a covariance without sign (state {}, pivot {:.2e})", e.row, e.pivot) }
}

/// F P by the blocks of a transition.
struct Moving<'a> {
    transition: &'a Transition,
    panel: &'a mut Panel,
    rows: &'a mut [Vec<f64>; 3],
}

impl Kernel for Moving<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Moving { transition, panel, rows } = self;
        let (before, after) = (|t: &Turning| t.before, |t: &Turning| t.after);
        for block in transition.turnings.iter().map(before).chain(transition.blocks.iter().copied()) {
            move_rows::<FUSED>(&block, panel, rows);
        }
        for block in transition.turnings.iter().map(after) {
            move_rows::<FUSED>(&block, panel, rows);
        }
    }
}

/// A <- F A.
#[inline(always)]
fn move_rows<const FUSED: bool>(block: &Block, panel: &mut Panel, old: &mut [Vec<f64>; 3]) {
    if block.len == 1 && block.factor[0][0] == 1.0 {
        return;
    }
    let n = old[0].len();
    for (old, &i) in old.iter_mut().zip(&block.index[..block.len]) {
        old.copy_from_slice(&panel.row(i)[..n]);
    }
    let [x, y, z] = [&old[0][..n], &old[1][..n], &old[2][..n]];
    for r in 0..block.len {
        let (row, f) = (&mut panel.row_mut(block.index[r])[..n], block.factor[r]);
        for j in 0..n {
            row[j] = f[0] * x[j];
        }
        if block.len == 3 {
            for j in 0..n {
                row[j] = madd::<FUSED>(f[2], z[j], madd::<FUSED>(f[1], y[j], row[j]));
            }
        } else if block.len == 2 {
            for j in 0..n {
                row[j] = madd::<FUSED>(f[1], y[j], row[j]);
            }
        }
    }
}

/// W's into the shift, and P - W'W (S2).
struct Subtracting<'a> {
    backward: &'a mut Backward,
    from: &'a Square,
}

impl Kernel for Subtracting<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Subtracting { backward: s, from } = self;
        let (n, column) = (s.order.len(), 2 * padded(s.order.len()));
        let mut corrections = std::mem::take(&mut s.ordered);
        corrections.fill(0.0);
        for k in 0..n {
            let row = &s.u_g_w_s.row(k)[column..];
            let step = row[padded(s.moving)];
            for (x, w) in corrections.iter_mut().zip(row) {
                *x = madd::<FUSED>(step, *w, *x);
            }
        }
        s.shift.copy_from_slice(&s.step);
        s.order.iter().zip(&corrections).for_each(|(i, x)| s.shift[*i] = *x);
        s.ordered = corrections;
        for (i, row) in s.order.iter().enumerate().take(s.moving) {
            let from = from.row(*row);
            for (x, j) in s.covariance.row_mut(i)[i..n].iter_mut().zip(&s.order[i..]) {
                *x = from[*j] - *x;
            }
        }
    }
}
