//! The effect of an update in parts, limb by limb, on the slopes dx/dp, for `consider`: S+ = P+ (P^-1 S - J'W dh/dp). A whole update has a
//! shorter way (`InformationUpdate::carry`).
//!
//! J is the one that the update used: with sigma points L'J' is H of U2, and W includes the curvature (U5). With the derivative at the mean in
//! its place, the recursion S - P+ J'W (J S + dh/dp) is no contraction where a heading is uncertain by tens of degrees, and grows without bound.

use crate::body::Body;
use crate::estimate::filter::{Apart, Filter};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::dense::{accumulate, Square};
use crate::kernels::tiles::{factor, padded, Panel, Sweep, RAISES, VECTOR};

/// P before the update, factored, and the slopes divided by a factor.
#[derive(Debug, Clone)]
pub(super) struct Prior {
    states: usize,
    width: usize,
    /// [P | S]; behind `divide`, [U | U'^-1 S] with P = U'U.
    panel: Panel,
    starts: Vec<usize>,
    own: Vec<f64>,
    before: Vec<f64>,
    /// What the move of the mean adds to the part by P+.
    moved: Vec<f64>,
    /// Whether P could be factored.
    known: bool,
}

impl Prior {
    /// For so many states and parameters.
    pub(super) fn new(states: usize, width: usize) -> Self {
        let all = padded(states) + width;
        let panel = Panel::zeros(states, all);
        Prior {
            states,
            width,
            panel,
            starts: vec![0; all / VECTOR],
            own: vec![0.0; width],
            before: vec![0.0; states * width],
            moved: vec![0.0; states * width],
            known: false,
        }
    }

    /// U'^-1 S. Where rounding took the sign of a pivot, the diagonal of P is raised.
    pub(super) fn divide(&mut self, arch: Arch, p: &Square, slopes: &[f64]) {
        let (n, at) = (self.states, padded(self.states));
        let sweep = Sweep { n, width: at + self.width, starts: &self.starts };
        self.known = RAISES.iter().any(|&share| {
            self.panel.copy_raised(p, share);
            for (i, row) in slopes.chunks_exact(self.width).enumerate() {
                self.panel.row_mut(i)[at..at + self.width].copy_from_slice(row);
            }
            factor(arch, &mut self.panel, sweep).is_ok()
        });
    }

    /// The slopes after an update with the covariance P+; `pull` is J'W dh/dp and is overwritten. Zero if P could not be factored.
    pub(super) fn update(
        &mut self,
        p: &Square,
        (filter, apart): (&Filter<Body>, &[Apart]),
        pull: &mut [f64],
        slopes: &mut [f64],
    ) {
        if !self.known {
            slopes.fill(0.0);
            return;
        }
        self.before.copy_from_slice(slopes);
        self.moved.fill(0.0);
        filter.follow_mean(&self.before, apart, &mut self.moved);
        slopes.fill(0.0);
        let (arch, width) = (Arch::best(), self.width);
        arch.run(Back { prior: self, pull });
        filter.undo_transposed(pull);
        arch.run(Multiplying { out: slopes, p, of: pull.chunks_exact(width), width });
        filter.leave_shears(apart, slopes);
        slopes.iter_mut().zip(&self.moved).for_each(|(s, moved)| *s += moved);
    }
}

/// `pull` becomes U^-1 times the right part, less itself.
struct Back<'a> {
    prior: &'a mut Prior,
    pull: &'a mut [f64],
}

impl Kernel for Back<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Prior { states, width, panel, own, .. } = self.prior;
        let at = padded(*states);
        for i in (0..*states).rev() {
            let row = panel.row(i);
            own.copy_from_slice(&row[at..at + *width]);
            accumulate(own, (i + 1..*states).map(|k| (-row[k], &panel.row(k)[at..at + *width])));
            let pivot = row[i];
            panel.row_mut(i)[at..at + *width].iter_mut().zip(&*own).for_each(|(x, own)| *x = own / pivot);
        }
        for (i, pull) in self.pull.chunks_exact_mut(*width).enumerate() {
            pull.iter_mut().zip(&panel.row(i)[at..]).for_each(|(p, x)| *p = x - *p);
        }
    }
}

/// Adds P times some rows.
pub(super) struct Multiplying<'a, R> {
    pub(super) out: &'a mut [f64],
    pub(super) p: &'a Square,
    pub(super) of: R,
    pub(super) width: usize,
}

impl<'a, R: Iterator<Item = &'a [f64]> + Clone> Kernel for Multiplying<'a, R> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for (i, row) in self.out.chunks_exact_mut(self.width).enumerate() {
            accumulate(row, self.p.row(i).iter().copied().zip(self.of.clone()));
        }
    }
}
