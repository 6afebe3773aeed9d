//! Covariance of core and limbs for the factorised filter: given the core, limbs are uncorrelated.
//!
//! With P0 the covariance of the core, a limb is its regression on the core, B' x0, and a residual of covariance C:
//!
//! ```text
//! B = P0^-1 P0c    C = Pcc - P0c' B        P0c = P0 B    Pcc = C + B' P0 B    Pcd = B' P0 D
//! ```
//!
//! B and C do not change when the core is updated. Of all Gaussians with this structure it is the nearest to the given one: it has the same
//! P0, P0c and Pcc (Lauritzen 1996, section 5.2).
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::shear::Shear;
use super::split::Split;
use super::transition::{congruence, Block};
use crate::kernels::arch::{Arch, Kernel};
use crate::kernels::dense::{accumulate, NotPositive, Square};
use crate::kernels::tiles::{factor, padded, Panel, Sweep, RAISES};
use nalgebra::Matrix3;

/// Regression of a limb on the core.
#[derive(Debug, Clone)]
struct Limb {
    states: Vec<usize>,
    /// B, a row for every state of the core.
    slope: Vec<f64>,
    /// C.
    rest: Square,
    /// P0 B.
    cross: Vec<f64>,
    /// Workspace: one row of any limb.
    row: Vec<f64>,
}

/// Core and limbs.
#[derive(Debug, Clone)]
pub struct Star {
    core: Vec<usize>,
    limbs: Vec<Limb>,
    /// P0.
    center: Square,
    /// [P0 | P0c] becomes [U | U'^-1 P0c] with P0 = U'U.
    sweep: Panel,
    zeros: Vec<usize>,
}

/// Positions of core and limb in a matrix.
#[derive(Debug, Clone, Copy)]
pub struct Places<'a> {
    /// The core's states.
    pub core: &'a [usize],
    /// The limb's.
    pub limb: &'a [usize],
}

impl Star {
    /// Workspace for this split.
    pub fn new(split: &Split) -> Self {
        let core = split.core.len();
        let widest = split.limbs.iter().map(Vec::len).max().unwrap_or(0);
        let limb = |states: &Vec<usize>| Limb {
            states: states.clone(),
            slope: vec![0.0; core * states.len()],
            rest: Square::zeros(states.len()),
            cross: vec![0.0; core * states.len()],
            row: vec![0.0; widest],
        };
        let width = padded(core) + padded(widest);
        Star {
            core: split.core.clone(),
            limbs: split.limbs.iter().map(limb).collect(),
            center: Square::zeros(core),
            sweep: Panel::zeros(core, width),
            zeros: vec![0; width / crate::kernels::tiles::VECTOR],
        }
    }

    /// Takes a covariance of all states apart, without the first limb, whose stage comes first and needs no regression. Drops correlations
    /// between limbs beyond the core.
    pub fn open(&mut self, arch: Arch, p: &Square) -> Result<(), NotPositive> {
        let core = std::mem::take(&mut self.core);
        self.take_center(p, &core);
        let mut done = Ok(());
        for k in 1..self.limbs.len() {
            let states = std::mem::take(&mut self.limbs[k].states);
            done = done.and_then(|()| self.take_limb(arch, k, p, Places { core: &core, limb: &states }));
            self.limbs[k].states = states;
        }
        self.core = core;
        done
    }

    /// Takes the covariance of the core.
    pub fn take_center(&mut self, p: &Square, at: &[usize]) {
        for (i, &row) in at.iter().enumerate() {
            at.iter().enumerate().for_each(|(j, &column)| *self.center.at_mut(i, j) = p.at(row, column));
        }
    }

    /// Regression of limb `k` on the core, whose covariance was taken last.
    pub fn take_limb(&mut self, arch: Arch, k: usize, p: &Square, at: Places) -> Result<(), NotPositive> {
        let (n, column) = (at.core.len(), padded(at.core.len()));
        let width = column + padded(at.limb.len());
        let mut done = Ok(());
        // An empty core has no factor.
        for share in RAISES.into_iter().filter(|_| n > 0) {
            for (i, &row) in at.core.iter().enumerate() {
                let (from, right) = (p.row(row), &mut self.sweep.row_mut(i)[column..width]);
                right.fill(0.0);
                right.iter_mut().zip(at.limb).for_each(|(x, &j)| *x = from[j]);
            }
            self.sweep.copy_raised(&self.center, share);
            done = factor(arch, &mut self.sweep, Sweep { n, width, starts: &self.zeros });
            if done.is_ok() {
                break;
            }
        }
        done?;
        arch.run(Regressing { n, column, sweep: &self.sweep, limb: &mut self.limbs[k], p, at: at.limb });
        Ok(())
    }

    /// Covariance of core and limb `k`.
    pub fn assemble(&mut self, arch: Arch, k: usize, at: Places, out: &mut Square) {
        for (i, &row) in at.core.iter().enumerate() {
            at.core.iter().enumerate().for_each(|(j, &column)| *out.at_mut(row, column) = self.center.at(i, j));
        }
        arch.run(Assembling { center: &self.center, limb: &mut self.limbs[k], at, out });
    }

    /// Puts the covariance of all states together, but for the last limb, whose covariance with the core is `last`.
    pub fn close(&mut self, arch: Arch, last: &Square, at: Places, out: &mut Square) {
        let Some(end) = self.limbs.len().checked_sub(1) else { return };
        let width = at.limb.len();
        for (i, &row) in at.core.iter().enumerate() {
            let cross = &mut self.limbs[end].cross[i * width..(i + 1) * width];
            cross.iter_mut().zip(at.limb).for_each(|(x, &j)| *x = last.at(row, j));
        }
        for k in 0..end {
            let (core, states) = (std::mem::take(&mut self.core), std::mem::take(&mut self.limbs[k].states));
            self.assemble(arch, k, Places { core: &core, limb: &states }, out);
            (self.core, self.limbs[k].states) = (core, states);
        }
        for k in 1..=end {
            let (before, rest) = self.limbs.split_at_mut(k);
            before.iter_mut().for_each(|one| arch.run(Joining { one, other: &rest[0], out: &mut *out }));
        }
    }

    /// Correction of limb `k`, B' `step`, when the core is corrected by `step`; added to the `shift` of all states.
    pub fn follow(&self, k: usize, step: &[f64], shift: &mut [f64]) {
        let limb = &self.limbs[k];
        let rows = limb.slope.chunks(limb.states.len().max(1));
        for (row, step) in rows.zip(step) {
            limb.states.iter().zip(row).for_each(|(&state, b)| shift[state] += step * b);
        }
    }

    /// Transforms limb `k` to the tangent space at a new mean (P3, P4).
    pub fn carry(&mut self, arch: Arch, k: usize, blocks: &[Block], shears: &[Shear]) {
        let limb = &mut self.limbs[k];
        let width = limb.states.len();
        for block in blocks {
            if let Some(places) = places(&limb.states, block) {
                let local = Block { index: places, ..*block };
                congruence(arch, &local, &mut limb.rest);
                for row in limb.slope.chunks_mut(width) {
                    let old = places.map(|i| row[i]);
                    for r in 0..block.len {
                        row[places[r]] = (0..block.len).map(|c| block.factor[r][c] * old[c]).sum();
                    }
                }
            } else if let Some(places) = places(&self.core, block) {
                turn_rows(&mut limb.slope, width, places, block);
            }
        }
        for shear in shears {
            if let Some(own) = shear.among(&limb.states) {
                own.apply(&mut limb.rest);
                limb.slope.chunks_mut(width).for_each(|row| own.apply_to_row(row));
            } else if let Some(core) = shear.among(&self.core) {
                core.undo_transposed(&mut limb.slope, width);
            }
        }
    }
}

/// Positions of a block's coordinates among these states.
pub fn places(states: &[usize], block: &Block) -> Option<[usize; 3]> {
    let found = block.index.map(|i| states.binary_search(&i).ok());
    Some([found[0]?, found[1]?, found[2]?])
}

/// B becomes J'^-1 B when the coordinates of the core are transformed by J.
fn turn_rows(slope: &mut [f64], width: usize, places: [usize; 3], block: &Block) {
    let inside = |r: usize, c: usize| r < block.len && c < block.len;
    let j = Matrix3::from_fn(|r, c| if inside(r, c) { block.factor[r][c] } else { f64::from(r == c) });
    let Some(inverse) = j.try_inverse() else { return };
    for column in 0..width {
        let old = places.map(|i| slope[i * width + column]);
        for r in 0..block.len {
            slope[places[r] * width + column] = (0..block.len).map(|c| inverse[(c, r)] * old[c]).sum();
        }
    }
}

struct Regressing<'a> {
    n: usize,
    column: usize,
    sweep: &'a Panel,
    limb: &'a mut Limb,
    p: &'a Square,
    at: &'a [usize],
}

impl Kernel for Regressing<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Regressing { n, column, sweep, limb, p, at } = self;
        let width = at.len();
        let known = |k: usize| &sweep.row(k)[column..column + width];
        for (i, &row) in at.iter().enumerate() {
            let (from, rest) = (p.row(row), limb.rest.row_mut(i));
            rest[i..].iter_mut().zip(&at[i..]).for_each(|(x, &j)| *x = from[j]);
            accumulate(&mut rest[i..], (0..n).map(|k| (-known(k)[i], &known(k)[i..])));
        }
        limb.rest.mirror_upper();
        for i in (0..n).rev() {
            let (head, tail) = limb.slope.split_at_mut((i + 1) * width);
            let (row, u) = (&mut head[i * width..], sweep.row(i));
            row.copy_from_slice(known(i));
            accumulate(row, (i + 1..n).map(|k| (-u[k], &tail[(k - i - 1) * width..][..width])));
            let scale = 1.0 / u[i];
            row.iter_mut().for_each(|x| *x *= scale);
        }
    }
}

struct Assembling<'a> {
    center: &'a Square,
    limb: &'a mut Limb,
    at: Places<'a>,
    out: &'a mut Square,
}

impl Kernel for Assembling<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Assembling { center, limb, at, out } = self;
        let (n, width) = (at.core.len(), at.limb.len());
        for (i, &place) in at.core.iter().enumerate() {
            let row = &mut limb.cross[i * width..(i + 1) * width];
            row.fill(0.0);
            accumulate(row, (0..n).map(|k| (center.at(i, k), &limb.slope[k * width..(k + 1) * width])));
            put(row, place, at.limb, out);
        }
        for (i, &place) in at.limb.iter().enumerate() {
            let row = &mut limb.row[i..width];
            row.copy_from_slice(&limb.rest.row(i)[i..]);
            let (slope, cross) = (&limb.slope, &limb.cross);
            accumulate(row, (0..n).map(|k| (slope[k * width + i], &cross[k * width + i..(k + 1) * width])));
            put(row, place, &at.limb[i..], out);
        }
    }
}

/// Writes a row and the column equal to it.
#[inline(always)]
fn put(row: &[f64], place: usize, at: &[usize], out: &mut Square) {
    let to = out.row_mut(place);
    row.iter().zip(at).for_each(|(x, &j)| to[j] = *x);
    row.iter().zip(at).for_each(|(x, &j)| *out.at_mut(j, place) = *x);
}

struct Joining<'a> {
    one: &'a mut Limb,
    other: &'a Limb,
    out: &'a mut Square,
}

impl Kernel for Joining<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Joining { one, other, out } = self;
        let (rows, width) = (one.states.len(), other.states.len());
        let n = other.cross.len() / width.max(1);
        for (i, &place) in one.states.iter().enumerate() {
            let row = &mut one.row[..width];
            row.fill(0.0);
            accumulate(row, (0..n).map(|k| (one.slope[k * rows + i], &other.cross[k * width..(k + 1) * width])));
            put(row, place, &other.states, out);
        }
    }
}
