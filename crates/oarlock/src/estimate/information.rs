//! Update in information form, for the filter: from predicted readings and innovations to correction, covariance and NIS.
//!
//! Equations U5 to U8 of docs/filter.md. P+ = X'X cannot lose its symmetry or its sign. Readings of inertial units stand first, so that
//! partial sums give their joint NIS.

mod carry;

use super::sigma::PredictedReadings;
use crate::kernels::arch::{with_simd, Arch, Kernel};
use crate::kernels::dense::{accumulate, NotPositive, Square};
use crate::kernels::registers::{F64x4, Simd};
use crate::kernels::tiles::{factor, find_starts, gram, padded, Panel, Rows, Sweep, VECTOR};
use std::ops::Range;

pub use carry::{Carried, Force};

/// Slot of a row that is not in use.
const NOWHERE: usize = usize::MAX;

/// Workspace of the update.
#[derive(Debug, Clone)]
pub struct InformationUpdate {
    states: usize,
    /// Position of each reading among those in use.
    slots: Vec<usize>,
    /// The readings in use, by position.
    rows: Vec<usize>,
    used: usize,
    inertial: usize,
    /// E', a row for each column of E.
    e_transposed: Panel,
    /// [S | H | y] of U5; behind U6, [U | W | w].
    s_h_y: Panel,
    /// [1 + W'W | W'w | rows of L' reversed]; behind U7, [V | b | X].
    v_b_x: Panel,
    /// [1 + W'W | W'w] of inertial units alone; behind U8, P+.
    inertial_v: Panel,
    /// Per vector of columns of `s_h_y`, and of `v_b_x`: the first row that may be nonzero.
    starts: Vec<usize>,
    v_starts: Vec<usize>,
    /// Per vector of columns of X: the first row that is not zero.
    reversed: Vec<usize>,
    zeros: Vec<usize>,
    /// Per slot: first column of H that is not zero, rounded down to a vector.
    firsts: Vec<usize>,
    /// Per source: covariance S + H H' of its innovations, divided by the noise.
    blocks: Vec<Square>,
    sources: Vec<Range<usize>>,
}

/// Normalised innovation squared of the used rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nis {
    /// Of all rows.
    pub nis: f64,
    /// Of the rows of inertial units.
    pub inertial: f64,
}

impl InformationUpdate {
    /// For so many rows, columns of E and states; `sources` are the rows whose innovation covariance is wanted.
    pub fn new(rows: usize, e_columns: usize, states: usize, sources: &[Range<usize>]) -> Self {
        let (m, n, wide) = (padded(rows), padded(states), padded(states + 1));
        let reversed: Vec<usize> = (0..n / VECTOR).map(|v| states.saturating_sub(VECTOR * (v + 1))).collect();
        InformationUpdate {
            states,
            slots: vec![NOWHERE; rows],
            rows: Vec::with_capacity(rows),
            used: 0,
            inertial: 0,
            e_transposed: Panel::zeros(padded(e_columns), m),
            s_h_y: Panel::zeros(rows, m + wide),
            v_b_x: Panel::zeros(states, wide + n),
            inertial_v: Panel::zeros(states, wide),
            starts: vec![0; (m + wide) / VECTOR],
            v_starts: [vec![0; wide / VECTOR], reversed.clone()].concat(),
            reversed,
            zeros: vec![0; n / VECTOR + 1],
            firsts: vec![0; rows],
            blocks: sources.iter().map(|s| Square::zeros(s.len())).collect(),
            sources: sources.to_vec(),
        }
    }

    fn states_at(&self) -> usize {
        padded(self.slots.len())
    }

    /// Position of a reading among those in use.
    #[inline(always)]
    fn slot(&self, row: usize) -> Option<usize> {
        Some(self.slots[row]).filter(|slot| *slot != NOWHERE)
    }

    /// Column of y: it fills up the last vector of H.
    fn reading_at(&self) -> usize {
        self.states_at() + self.states
    }

    /// Width of H and y.
    fn wide(&self) -> usize {
        padded(self.states + 1)
    }

    /// U5: S, H and y, divided by the noise, and the innovation covariance of each source.
    pub fn whiten(&mut self, arch: Arch, predicted: &PredictedReadings, readings: WeightedReadings) {
        arch.run(Dividing { information: self, predicted, readings });
        let m = self.used;
        find_starts(arch, &self.e_transposed, predicted.e_columns, 0..padded(m), &mut self.starts);
        let g = Rows { panel: &self.e_transposed, rows: 0..predicted.e_columns, column: 0, starts: &self.starts };
        gram(arch, &mut self.s_h_y, [m, padded(m)], g, true);
        for i in 0..m {
            self.s_h_y.row_mut(i)[i] += 1.0;
        }
        arch.run(Blocks { information: self });
        let y_at = self.reading_at();
        for (slot, &r) in readings.rows.iter().enumerate() {
            self.s_h_y.row_mut(slot)[y_at] = readings.y[r];
        }
    }

    #[inline(always)]
    fn divide<F: F64x4>(
        &mut self,
        simd: Simd<F>,
        predicted: &PredictedReadings,
        WeightedReadings { rows, inertial, weight, .. }: WeightedReadings,
    ) {
        (self.used, self.inertial) = (rows.len(), inertial);
        self.slots.fill(NOWHERE);
        self.rows.clear();
        self.rows.extend_from_slice(rows);
        let (h_at, n_pad) = (self.states_at(), padded(self.states));
        for (slot, &r) in rows.iter().enumerate() {
            self.slots[r] = slot;
            let row = &mut self.s_h_y.row_mut(slot)[h_at..];
            simd.scale(predicted.h.row(r), weight[r], row);
            self.firsts[slot] = simd.leading_zeros(&row[..n_pad]) * VECTOR;
        }
        self.transpose_e(simd, predicted, rows, weight);
    }

    /// E' from rows of E, four by four.
    #[inline(always)]
    fn transpose_e<F: F64x4>(&mut self, simd: Simd<F>, predicted: &PredictedReadings, rows: &[usize], weight: &[f64]) {
        for (v, four) in rows.chunks(VECTOR).enumerate() {
            let last = four[four.len() - 1];
            let from: [usize; VECTOR] = std::array::from_fn(|k| four.get(k).copied().unwrap_or(last));
            let scale: [f64; VECTOR] = std::array::from_fn(|k| if k < four.len() { weight[from[k]] } else { 0.0 });
            let from = from.map(|r| predicted.e.row(r));
            for i in (0..predicted.e_columns).step_by(VECTOR) {
                self.e_transposed.put_turned(simd, [i, v * VECTOR], from, i, scale);
            }
        }
    }

    #[inline(always)]
    fn fill_blocks<F: F64x4>(&mut self, simd: Simd<F>) {
        let (h_at, end) = (self.states_at(), self.states_at() + padded(self.states));
        let (s_h_y, firsts) = (&self.s_h_y, &self.firsts);
        for (block, rows) in self.blocks.iter_mut().zip(&self.sources) {
            let slots = &self.slots[rows.clone()];
            for (i, own) in slots.chunks(3).enumerate() {
                let Some(own) = three(own) else { continue };
                for (j, other) in slots.chunks(3).enumerate().skip(i) {
                    let Some(other) = three(other) else { continue };
                    let first =
                        |three: [usize; 3]| three.map(|slot| firsts[slot]).into_iter().fold(end - h_at, usize::min);
                    let from = h_at + first(own).max(first(other));
                    let row = |slot: usize| &s_h_y.row(slot)[from..end];
                    let products = simd.products(own.map(row), other.map(row));
                    for (p, a) in own.into_iter().enumerate().take(slots.len() - 3 * i) {
                        let from = if i == j { p } else { 0 };
                        let out = block.row_mut(3 * i + p)[3 * j..].iter_mut();
                        for (q, out) in out.enumerate().take(3).skip(from) {
                            let b = other[q];
                            *out = s_h_y.at(a.min(b), a.max(b)) + products[p][q];
                        }
                    }
                }
            }
        }
    }

    /// Innovation covariance of source `s`, divided by the noise; entries of missing rows are undefined.
    pub fn innovation_covariance(&self, s: usize) -> &Square {
        &self.blocks[s]
    }

    /// Takes a row out of the update: it becomes a row of the unit matrix with H = 0 and y = 0.
    pub fn reject(&mut self, row: usize) {
        if let Some(slot) = self.slot(row) {
            self.s_h_y.make_unit(slot);
        }
    }

    /// U6 and U7.
    pub fn solve(&mut self, arch: Arch, l_transposed: &Panel) -> Result<Nis, NotPositive> {
        let (h_at, y_at) = (self.states_at(), self.reading_at());
        let (n, m) = (self.states, self.used);
        let (n_pad, wide) = (padded(n), self.wide());
        let width = h_at + wide;
        let (symmetric, right) = self.starts.split_at_mut(h_at / VECTOR);
        symmetric.fill(NOWHERE);
        // S is sparse: rows without common second-order terms do not meet.
        find_starts(arch, &self.s_h_y, m, 0..padded(m), symmetric);
        starts_of(&self.firsts[..m], &mut right[..wide / VECTOR]);
        factor(arch, &mut self.s_h_y, Sweep { n: m, width, starts: &self.starts })?;
        let all =
            Rows { panel: &self.s_h_y, rows: 0..self.inertial, column: h_at, starts: &self.starts[h_at / VECTOR..] };
        gram(arch, &mut self.inertial_v, [n, wide], all.clone(), true);
        (0..n).for_each(|i| self.inertial_v.row_mut(i)[i] += 1.0);
        arch.run(Filling { v_b_x: &mut self.v_b_x, inertial_v: &self.inertial_v, l_transposed, n });
        let mut inertial = None;
        if 0 < self.inertial && self.inertial < m {
            factor(arch, &mut self.inertial_v, Sweep { n, width: wide, starts: &self.zeros })?;
            inertial = Some(squares(&self.s_h_y, 0..self.inertial, y_at) - squares(&self.inertial_v, 0..n, n));
        }
        gram(arch, &mut self.v_b_x, [n, wide], Rows { rows: self.inertial..m, ..all }, false);
        factor(arch, &mut self.v_b_x, Sweep { n, width: wide + n_pad, starts: &self.v_starts })?;
        let nis = squares(&self.s_h_y, 0..m, y_at) - squares(&self.v_b_x, 0..n, n);
        Ok(Nis { nis, inertial: inertial.unwrap_or(nis) })
    }

    /// U8: X'b into `shift`, X'X into `covariance`.
    pub fn posterior(&mut self, arch: Arch, shift: &mut [f64], covariance: &mut Square) {
        let (n, n_pad) = (self.states, padded(self.states));
        let at = self.wide();
        let x = Rows { panel: &self.v_b_x, rows: 0..n, column: at, starts: &self.reversed };
        gram(arch, &mut self.inertial_v, [n, n_pad], x, true);
        self.inertial_v.copy_to(covariance);
        shift.fill(0.0);
        let rows = |k: usize| &self.v_b_x.row(k)[at + n - 1 - k..at + n];
        for k in 0..n {
            // X is triangular with its columns in state order: row k begins at state n - 1 - k.
            let b = self.v_b_x.at(k, n);
            shift[n - 1 - k..].iter_mut().zip(rows(k)).for_each(|(s, x)| *s += b * x);
        }
    }

    /// After `solve`: multiplies columns by U'^-1 (`Side::Left`) or U^-1 (`Side::Right`). `columns` has `width` numbers for each
    /// reading, divided by its noise; those of readings not in use do not change.
    pub fn substitute(&self, arch: Arch, side: Side, columns: &mut Columns) {
        arch.run(Substituting { information: self, side, columns });
    }
}

/// Factor of S that [`InformationUpdate::substitute`] inverts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Side {
    /// U'.
    Left,
    /// U.
    Right,
}

/// Numbers for each reading, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Columns {
    /// Numbers a row.
    width: usize,
    data: Vec<f64>,
    /// Row that is being computed.
    own: Vec<f64>,
}

impl Columns {
    /// For so many readings.
    pub fn zeros(rows: usize, width: usize) -> Self {
        Columns { width, data: vec![0.0; rows * width], own: vec![0.0; width] }
    }

    /// Numbers of a reading.
    pub fn row(&self, r: usize) -> &[f64] {
        &self.data[r * self.width..(r + 1) * self.width]
    }

    /// Numbers of a reading.
    pub fn row_mut(&mut self, r: usize) -> &mut [f64] {
        &mut self.data[r * self.width..(r + 1) * self.width]
    }

    /// Sets all numbers to zero.
    pub fn clear(&mut self) {
        self.data.fill(0.0);
    }

    /// Row `r` less the sum of coefficient times row, divided by the pivot.
    #[inline(always)]
    fn eliminate(&mut self, r: usize, pivot: f64, terms: impl Iterator<Item = (f64, usize)>) {
        let Columns { width, data, own } = self;
        let row = |r: usize| &data[r * *width..(r + 1) * *width];
        own.copy_from_slice(row(r));
        accumulate(own, terms.map(|(by, other)| (-by, row(other))));
        data[r * *width..(r + 1) * *width].iter_mut().zip(own).for_each(|(x, own)| *x = *own / pivot);
    }
}

struct Substituting<'a> {
    information: &'a InformationUpdate,
    side: Side,
    columns: &'a mut Columns,
}

impl Kernel for Substituting<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let (u, rows) = (&self.information.s_h_y, &self.information.rows);
        for i in 0..rows.len() {
            match self.side {
                Side::Left => {
                    let terms = (0..i).map(|k| (u.at(k, i), rows[k]));
                    self.columns.eliminate(rows[i], u.at(i, i), terms);
                }
                Side::Right => {
                    let i = rows.len() - 1 - i;
                    let terms = (i + 1..rows.len()).map(|k| (u.at(i, k), rows[k]));
                    self.columns.eliminate(rows[i], u.at(i, i), terms);
                }
            }
        }
    }
}

/// Readings of an update.
#[derive(Debug, Clone, Copy)]
pub struct WeightedReadings<'a> {
    /// Rows in use, those of inertial units first.
    pub rows: &'a [usize],
    /// How many of them belong to inertial units.
    pub inertial: usize,
    /// Per row: one over the standard deviation of its noise.
    pub weight: &'a [f64],
    /// Per row: innovation times weight.
    pub y: &'a [f64],
}

struct Dividing<'a> {
    information: &'a mut InformationUpdate,
    predicted: &'a PredictedReadings,
    readings: WeightedReadings<'a>,
}

impl Kernel for Dividing<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| self.information.divide(simd, self.predicted, self.readings));
    }
}

/// [1 + W'W | W'w] of inertial units into `v_b_x`, and the rows of L' in reverse behind it.
struct Filling<'a> {
    v_b_x: &'a mut Panel,
    inertial_v: &'a Panel,
    l_transposed: &'a Panel,
    n: usize,
}

impl Kernel for Filling<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| {
            for k in 0..self.n {
                let known = self.inertial_v.row(k);
                let (left, right) = self.v_b_x.row_mut(k).split_at_mut(known.len());
                simd.copy(known, left);
                simd.copy(self.l_transposed.row(self.n - 1 - k), right);
            }
        });
    }
}

struct Blocks<'a> {
    information: &'a mut InformationUpdate,
}

impl Kernel for Blocks<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| self.information.fill_blocks(simd));
    }
}

/// Slots of up to three readings; a present one fills the place of a missing one. `None` if all are missing.
#[inline(always)]
fn three(slots: &[usize]) -> Option<[usize; 3]> {
    let there = *slots.iter().find(|slot| **slot != NOWHERE)?;
    Some(std::array::from_fn(|k| slots.get(k).copied().filter(|slot| *slot != NOWHERE).unwrap_or(there)))
}

/// For each vector of columns of H, the last of which contains y: the first row that may be nonzero.
fn starts_of(firsts: &[usize], starts: &mut [usize]) {
    let mut open = starts.len();
    for (slot, first) in firsts.iter().enumerate() {
        while open > 0 && first / VECTOR < open {
            open -= 1;
            starts[open] = slot;
        }
    }
    starts[..open].fill(firsts.len());
    starts[starts.len() - 1] = 0;
}

/// Sum of squares down a column.
#[inline(always)]
fn squares(panel: &Panel, rows: Range<usize>, column: usize) -> f64 {
    let mut sum = 0.0;
    for r in rows {
        sum += panel.at(r, column) * panel.at(r, column);
    }
    sum
}
