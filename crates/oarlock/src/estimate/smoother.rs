//! Rauch-Tung-Striebel smoother (1965), one step back at a time, for `track::run`. Allocates nothing after it is made.
//!
//! Equations S1 and S2 of ARCHITECTURE.md. With P the covariance at k, Pp = F P F' + Q the predicted one at k + 1 and Pn = X'X the smoothed
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
use crate::kernels::tiles::{factor, gram, padded, Panel, Rows, Sweep, RAISES, VECTOR};

/// Workspace of a smoother.
#[derive(Debug, Clone)]
pub struct Smoother {
    arch: Arch,
    n: usize,
    /// Pn in the tangent space at the predicted mean (P3).
    next: Square,
    /// X, upper triangular.
    x: Panel,
    /// [Pp | X' | F P | step] becomes [U | G | W | s].
    u_g_w_s: Panel,
    /// Per vector of its columns: the first row that is not zero.
    starts: Vec<usize>,
    /// [G'G | Y]; G'G is not used.
    y: Panel,
    /// P_s.
    covariance: Panel,
    zeros: Vec<usize>,
    step: Vec<f64>,
    shift: Vec<f64>,
    reset: Vec<Block>,
    shears: Vec<Shear>,
    rows: [Vec<f64>; 3],
}

impl Smoother {
    /// Workspace for `n` states.
    pub fn new(n: usize) -> Self {
        let width = padded(n);
        let own = |v: usize| if (width..2 * width).contains(&(v * VECTOR)) { v * VECTOR - width } else { 0 };
        Smoother {
            arch: Arch::best(),
            n,
            next: Square::zeros(n),
            x: Panel::zeros(n, width),
            u_g_w_s: Panel::zeros(n, 3 * width + VECTOR),
            starts: (0..3 * width / VECTOR + 1).map(own).collect(),
            y: Panel::zeros(n, 2 * width),
            covariance: Panel::zeros(n, width),
            zeros: vec![0; width / VECTOR],
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
        self.arch = arch;
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
        self.take_next(system, &predicted.mean, next)?;
        self.factorise(&filtered.covariance, transition, &predicted.covariance)?;
        self.add_squares(&mut filtered.covariance);
        system.shift(&mut filtered.mean, &self.shift);
        self.reset.clear();
        system.reset_jacobian(&self.shift, &mut self.reset);
        self.reset.iter().for_each(|block| congruence(self.arch, block, &mut filtered.covariance));
        self.shears.clear();
        system.shears(&filtered.mean, &self.shift, &mut self.shears);
        self.shears.iter().for_each(|shear| shear.apply(&mut filtered.covariance));
        Ok(())
    }

    /// X of S1.
    fn take_next<S: System>(&mut self, system: &S, predicted: &[f64], next: &Belief) -> Result<(), Diverged> {
        self.shift.iter_mut().zip(&self.step).for_each(|(back, x)| *back = -*x);
        self.reset.clear();
        system.reset_jacobian(&self.shift, &mut self.reset);
        self.next.clone_from(&next.covariance);
        self.reset.iter().for_each(|block| congruence(self.arch, block, &mut self.next));
        self.shears.clear();
        system.shears(predicted, &self.shift, &mut self.shears);
        self.shears.iter().for_each(|shear| shear.apply(&mut self.next));
        let sweep = Sweep { n: self.n, width: padded(self.n), starts: &self.zeros };
        self.x.copy_upper(&self.next);
        if factor(self.arch, &mut self.x, sweep).is_err() {
            // Nothing divides by X, so a direction without variance may be zero in it.
            semidefinite_factor(&mut self.next).map_err(broken)?;
            self.x.copy_upper(&self.next);
        }
        Ok(())
    }

    /// S1.
    fn factorise(&mut self, filtered: &Square, transition: &Transition, predicted: &Square) -> Result<(), Diverged> {
        let (arch, n) = (self.arch, self.n);
        let mut done = Ok(());
        for share in RAISES {
            arch.run(Filling { smoother: self, filtered, transition });
            self.u_g_w_s.copy_raised(predicted, share);
            let sweep = Sweep { n, width: 3 * padded(n) + VECTOR, starts: &self.starts };
            done = factor(arch, &mut self.u_g_w_s, sweep).map_err(broken);
            if done.is_ok() {
                break;
            }
        }
        done
    }

    /// S2: W's into `shift`, P_s in the place of P.
    fn add_squares(&mut self, covariance: &mut Square) {
        let (arch, n, width) = (self.arch, self.n, padded(self.n));
        let own = &self.starts[width / VECTOR..];
        gram(
            arch,
            &mut self.y,
            [n, 2 * width],
            Rows { panel: &self.u_g_w_s, rows: 0..n, column: width, starts: own },
            true,
        );
        let w = Rows { panel: &self.u_g_w_s, rows: 0..n, column: 2 * width, starts: &self.zeros };
        gram(arch, &mut self.covariance, [n, width], w, true);
        arch.run(Subtracting { smoother: self, from: covariance });
        let y = Rows { panel: &self.y, rows: 0..n, column: width, starts: &self.zeros };
        gram(arch, &mut self.covariance, [n, width], y, false);
        self.covariance.copy_to(covariance);
    }
}

fn broken(e: NotPositive) -> Diverged {
    Diverged { what: format!("smoothing met a covariance without sign (state {}, pivot {:.2e})", e.row, e.pivot) }
}

/// Fills in [X' | F P | xn - xp].
struct Filling<'a> {
    smoother: &'a mut Smoother,
    filtered: &'a Square,
    transition: &'a Transition,
}

impl Kernel for Filling<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Filling { smoother: s, filtered, transition } = self;
        let (n, width) = (s.n, padded(s.n));
        for i in 0..n {
            let row = s.u_g_w_s.row_mut(i);
            let own = &mut row[width..][..padded(i + 1)];
            for (j, x) in own.iter_mut().enumerate() {
                *x = if j <= i { s.x.at(j, i) } else { 0.0 };
            }
            row[2 * width..][..n].copy_from_slice(filtered.row(i));
            row[3 * width] = s.step[i];
        }
        let (before, after) = (|t: &Turning| t.before, |t: &Turning| t.after);
        for block in transition.turnings.iter().map(before).chain(transition.blocks.iter().copied()) {
            move_rows::<FUSED>(&block, &mut s.u_g_w_s, 2 * width, &mut s.rows);
        }
        for block in transition.turnings.iter().map(after) {
            move_rows::<FUSED>(&block, &mut s.u_g_w_s, 2 * width, &mut s.rows);
        }
    }
}

/// A <- F A for the columns of a panel that begin at `column`.
#[inline(always)]
fn move_rows<const FUSED: bool>(block: &Block, panel: &mut Panel, column: usize, old: &mut [Vec<f64>; 3]) {
    if block.len == 1 && block.factor[0][0] == 1.0 {
        return;
    }
    let n = old[0].len();
    for (old, &i) in old.iter_mut().zip(&block.index[..block.len]) {
        old.copy_from_slice(&panel.row(i)[column..][..n]);
    }
    let [x, y, z] = [&old[0][..n], &old[1][..n], &old[2][..n]];
    for r in 0..block.len {
        let (row, f) = (&mut panel.row_mut(block.index[r])[column..][..n], block.factor[r]);
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
    smoother: &'a mut Smoother,
    from: &'a Square,
}

impl Kernel for Subtracting<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Subtracting { smoother: s, from } = self;
        let (n, width) = (s.n, padded(s.n));
        s.shift.fill(0.0);
        for k in 0..n {
            let row = &s.u_g_w_s.row(k)[2 * width..];
            let step = row[width];
            for (x, w) in s.shift.iter_mut().zip(row) {
                *x = madd::<FUSED>(step, *w, *x);
            }
        }
        for i in 0..n {
            for (x, p) in s.covariance.row_mut(i)[i..n].iter_mut().zip(&from.row(i)[i..]) {
                *x = p - *x;
            }
        }
    }
}
