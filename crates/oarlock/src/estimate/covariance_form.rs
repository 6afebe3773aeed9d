//! Update in covariance form, for the filter of a system with clearly more states than readings: the result of U5 to U8 of ARCHITECTURE.md
//! by another way.
//!
//! Only columns of L that begin at a pose state have sigma points. With J the exact Jacobian by all other states, L_p these columns of L and H_p
//! theirs of H, this is
//!
//!   D = H_p - J L_p      K = D L_p' + J P      P_zz = S + D H_p' + K J'                                  (U10)
//!   P_zz = U'U    W = U'^-1 K    w = U'^-1 y    x+ = x + W'w    P+ = P - W'W    NIS = w'w                (U11)
//!
//! so that the other columns of L are not needed, nor a factor as large as the state. P+ is a difference. S is at least 1, so P+ is at least P
//! divided by the trace of P_zz, and that trace bounds what the difference loses: where readings are far more exact than what was
//! known before them, the update is left to the information form, whose P+ is a square.

use super::information::{Nis, WeightedReadings, NOWHERE};
use super::sigma::PredictedReadings;
use super::Partition;
use crate::kernels::arch::{madd, with_simd, Arch, Kernel};
use crate::kernels::dense::{NotPositive, Square};
use crate::kernels::registers::{F64x4, Part, Simd};
use crate::kernels::sparse_jacobian::{RowTriple, Slope, SparseJacobian};
use crate::kernels::tiles::{add_symmetric, factor, gram, padded, product, Panel, Rows, Sweep, VECTOR};
use std::ops::Range;

/// Fewest states for which this form is taken: what it saves grows with their cube. Smaller systems keep the information form and its digits.
const FEWEST_STATES: usize = 128;

/// Largest trace of P_zz, divided by the noise, at which the difference P - W'W may be taken: it loses so many times the rounding of P,
/// which keeps 1e-8 standard deviations. Sixteen units give 1e3, at a start up to 5e4, closures of a micrometre 1e9.
const LARGEST_TRACE: f64 = 1e5;

/// Workspace of the update.
#[derive(Debug, Clone)]
pub struct CovarianceUpdate {
    part: Partition,
    /// Position of each reading among those in use, and the reading of each position.
    slots: Vec<usize>,
    rows: Vec<usize>,
    inertial: usize,
    asked: Vec<bool>,
    /// Trace of P_zz.
    trace: f64,
    /// E', H_p' and D', columns divided by the noise; rows of the latter two in reverse order of the states.
    e_turned: Panel,
    h_turned: Panel,
    d_turned: Panel,
    /// J times something, and D, a row for each reading, not divided by the noise.
    product: Panel,
    d: Panel,
    /// L_p', rows in reverse order.
    l_reversed: Panel,
    l_starts: Vec<usize>,
    /// D L_p'.
    cross: Panel,
    /// [P_zz | K | y]; behind U11, [U | W | w].
    z_k_y: Panel,
    /// W'W.
    gain: Panel,
    /// Factor of the rates' part of P - L_p L_p'.
    rates: Panel,
    zeros: Vec<usize>,
    blocks: Vec<Square>,
    sources: Vec<Range<usize>>,
}

impl CovarianceUpdate {
    /// Whether this form is faster for so many states, of which readings are present at most samples.
    pub fn pays(part: Partition, usual_rows: usize) -> bool {
        part.dim() >= FEWEST_STATES && 2 * usual_rows <= part.dim()
    }

    /// For so many rows and columns of E; `sources` are the rows whose innovation covariance is wanted.
    pub fn new(rows: usize, e_columns: usize, part: Partition, sources: &[Range<usize>]) -> Self {
        let (m, n, p, wide) = (padded(rows), padded(part.dim()), padded(part.pose), padded(part.dim() + 1));
        CovarianceUpdate {
            part,
            slots: vec![NOWHERE; rows],
            rows: Vec::with_capacity(rows),
            inertial: 0,
            asked: vec![false; rows],
            trace: 0.0,
            e_turned: Panel::zeros(padded(e_columns), m),
            h_turned: Panel::zeros(p, m),
            d_turned: Panel::zeros(p, m),
            product: Panel::zeros(rows, n),
            d: Panel::zeros(rows, p),
            l_reversed: Panel::zeros(part.pose, n),
            l_starts: (0..n / VECTOR).map(|v| part.pose.saturating_sub(VECTOR * (v + 1))).collect(),
            cross: Panel::zeros(rows, n),
            z_k_y: Panel::zeros(rows, m + wide),
            gain: Panel::zeros(part.dim(), n),
            rates: Panel::zeros(part.rate, padded(part.rate)),
            zeros: vec![0; (m + wide) / VECTOR],
            blocks: sources.iter().map(|s| Square::zeros(s.len())).collect(),
            sources: sources.to_vec(),
        }
    }

    /// L' of U1, but only columns of poses, and the rates' part of those of rates.
    pub fn factorise(
        &mut self,
        arch: Arch,
        covariance: &Square,
        share: f64,
        l_transposed: &mut Panel,
    ) -> Result<(), NotPositive> {
        let Partition { pose, rate, .. } = self.part;
        let n = covariance.n();
        for i in 0..pose {
            let first = i / VECTOR * VECTOR;
            l_transposed.row_mut(i)[first..n].copy_from_slice(&covariance.row(i)[first..]);
            l_transposed.row_mut(i)[i] *= 1.0 + share;
        }
        factor(arch, l_transposed, Sweep { n: pose, width: padded(n), starts: &self.zeros })?;
        let known = Rows { panel: l_transposed, rows: 0..pose, column: pose, starts: &self.zeros };
        gram(arch, &mut self.rates, [rate, padded(rate)], known, true);
        for i in 0..rate {
            let own = &covariance.row(pose + i)[pose + i..pose + rate];
            self.rates.row_mut(i)[i..rate].iter_mut().zip(own).for_each(|(x, own)| *x = own - *x);
            self.rates.row_mut(i)[i] += share * own[0];
        }
        factor(arch, &mut self.rates, Sweep { n: rate, width: padded(rate), starts: &self.zeros })
            .map_err(|e| NotPositive { row: e.row + pose, ..e })?;
        for i in 0..rate {
            let own = &self.rates.row(i)[i..rate];
            l_transposed.row_mut(pose + i)[pose + i..pose + rate].copy_from_slice(own);
        }
        Ok(())
    }

    fn states_at(&self) -> usize {
        padded(self.slots.len())
    }

    /// Column of y: it fills up the last vector of K.
    fn reading_at(&self) -> usize {
        self.states_at() + self.part.dim()
    }

    /// U5 and U10, divided by the noise, and the innovation covariance of each source.
    pub fn whiten(
        &mut self,
        arch: Arch,
        (predicted, l_transposed, covariance): (&PredictedReadings, &Panel, &Square),
        readings: WeightedReadings,
    ) {
        let (n, p, m) = (self.part.dim(), self.part.pose, readings.rows.len());
        self.list(readings);
        let jacobian = predicted.jacobian();
        jacobian.product(arch, predicted.reversed_poses(), p, &self.asked, &mut self.product);
        arch.run(Turning { update: self, predicted, l_transposed, weight: readings.weight });
        let e = Rows { panel: &self.e_turned, rows: 0..predicted.e_columns, column: 0, starts: &self.zeros };
        gram(arch, &mut self.z_k_y, [m, padded(m)], e, true);
        let d = Rows { panel: &self.d_turned, rows: 0..p, column: 0, starts: &self.zeros };
        let h = Rows { panel: &self.h_turned, ..d.clone() };
        add_symmetric(arch, &mut self.z_k_y, m, [d.clone(), h]);
        let l = Rows { panel: &self.l_reversed, rows: 0..p, column: 0, starts: &self.l_starts };
        product(arch, &mut self.cross, [m, padded(n)], [d, l]);
        let whole = Part { data: covariance.as_slice(), from: 0, stride: n };
        jacobian.product(arch, whole, n, &self.asked, &mut self.product);
        arch.run(Crossing { update: self, jacobian, readings });
        self.trace = (0..m).map(|i| self.z_k_y.at(i, i)).sum();
        self.copy_blocks();
    }

    /// Whether P+ keeps its digits in this form; NaN has none.
    pub fn is_exact(&self) -> bool {
        self.trace <= LARGEST_TRACE
    }

    fn list(&mut self, readings: WeightedReadings) {
        self.inertial = readings.inertial;
        self.rows.clear();
        self.rows.extend_from_slice(readings.rows);
        self.slots.fill(NOWHERE);
        self.asked.fill(false);
        for (slot, &r) in readings.rows.iter().enumerate() {
            self.slots[r] = slot;
            self.asked[r] = true;
        }
    }

    fn copy_blocks(&mut self) {
        for (block, rows) in self.blocks.iter_mut().zip(&self.sources) {
            let slots = &self.slots[rows.clone()];
            for (i, &a) in slots.iter().enumerate().filter(|(_, slot)| **slot != NOWHERE) {
                for (j, &b) in slots.iter().enumerate().skip(i).filter(|(_, slot)| **slot != NOWHERE) {
                    *block.at_mut(i, j) = self.z_k_y.at(a.min(b), a.max(b));
                }
            }
        }
    }

    /// Innovation covariance of source `s`, divided by the noise; entries of missing rows are undefined.
    pub fn innovation_covariance(&self, s: usize) -> &Square {
        &self.blocks[s]
    }

    /// Takes a row out of the update: it becomes a row of the unit matrix with K = 0 and y = 0.
    pub fn reject(&mut self, row: usize) {
        let slot = self.slots[row];
        if slot != NOWHERE {
            self.z_k_y.make_unit(slot);
        }
    }

    /// U11 up to the NIS.
    pub fn solve(&mut self, arch: Arch) -> Result<Nis, NotPositive> {
        let (m, y_at) = (self.rows.len(), self.reading_at());
        let width = self.states_at() + padded(self.part.dim() + 1);
        factor(arch, &mut self.z_k_y, Sweep { n: m, width, starts: &self.zeros })?;
        let squares = |rows: Range<usize>| rows.map(|k| self.z_k_y.at(k, y_at).powi(2)).sum::<f64>();
        let (inertial, rest) = (squares(0..self.inertial), squares(self.inertial..m));
        Ok(Nis { nis: inertial + rest, inertial: if self.inertial > 0 { inertial } else { rest } })
    }

    /// W'w into `shift`; the covariance loses W'W.
    pub fn posterior(&mut self, arch: Arch, shift: &mut [f64], covariance: &mut Square) {
        let (n, at, y_at) = (self.part.dim(), self.states_at(), self.reading_at());
        let rows = 0..self.rows.len();
        let w = Rows { panel: &self.z_k_y, rows: rows.clone(), column: at, starts: &self.zeros };
        gram(arch, &mut self.gain, [n, padded(n)], w, true);
        for i in 0..n {
            let lost = &self.gain.row(i)[i..n];
            covariance.row_mut(i)[i..].iter_mut().zip(lost).for_each(|(p, lost)| *p -= lost);
        }
        covariance.mirror_upper();
        shift.fill(0.0);
        for k in rows {
            let by = self.z_k_y.at(k, y_at);
            shift.iter_mut().zip(&self.z_k_y.row(k)[at..]).for_each(|(s, w)| *s += by * w);
        }
    }
}

/// D, and transposes of D, E and H_p; L_p' in reverse.
struct Turning<'a> {
    update: &'a mut CovarianceUpdate,
    predicted: &'a PredictedReadings,
    l_transposed: &'a Panel,
    weight: &'a [f64],
}

impl Kernel for Turning<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Turning { update, predicted, l_transposed, weight } = self;
        with_simd!(FUSED, |simd| update.turn(simd, predicted, l_transposed, weight));
    }
}

impl CovarianceUpdate {
    #[inline(always)]
    fn turn<F: F64x4>(&mut self, simd: Simd<F>, predicted: &PredictedReadings, l_transposed: &Panel, weight: &[f64]) {
        let CovarianceUpdate { part, rows, d, product, e_turned, h_turned, d_turned, l_reversed, slots, .. } = self;
        let (p, first) = (part.pose, part.dim() - part.pose);
        let jacobian = predicted.jacobian();
        rows.iter().for_each(|&r| simd.copy(&predicted.h.row(r)[first..], d.row_mut(r)));
        for r in jacobian.triples.iter().flat_map(RowTriple::rows).filter(|&r| slots[r] != NOWHERE) {
            simd.difference(&predicted.h.row(r)[first..], product.row(r), d.row_mut(r));
        }
        for (v, four) in rows.chunks(VECTOR).enumerate() {
            let last = four[four.len() - 1];
            let from: [usize; VECTOR] = std::array::from_fn(|k| four.get(k).copied().unwrap_or(last));
            let scale: [f64; VECTOR] = std::array::from_fn(|k| if k < four.len() { weight[from[k]] } else { 0.0 });
            let turn = |out: &mut Panel, of: &Panel, at: usize, count: usize| {
                for i in (0..count).step_by(VECTOR) {
                    out.put_turned(simd, [i, v * VECTOR], from.map(|r| of.row(r)), at + i, scale);
                }
            };
            turn(e_turned, &predicted.e, 0, predicted.e_columns);
            turn(h_turned, &predicted.h, first, p);
            turn(d_turned, d, 0, p);
        }
        (0..p).for_each(|k| simd.copy(l_transposed.row(p - 1 - k), l_reversed.row_mut(k)));
    }
}

/// K and y, and what K J' adds to P_zz.
struct Crossing<'a> {
    update: &'a mut CovarianceUpdate,
    jacobian: &'a SparseJacobian,
    readings: WeightedReadings<'a>,
}

impl Kernel for Crossing<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Crossing { update, jacobian, readings } = self;
        with_simd!(FUSED, |simd| update.cross(simd, readings));
        for triple in &jacobian.triples {
            update.add_inner::<FUSED>(jacobian, triple, readings.weight);
        }
    }
}

impl CovarianceUpdate {
    #[inline(always)]
    fn cross<F: F64x4>(&mut self, simd: Simd<F>, readings: WeightedReadings) {
        let (at, y_at) = (self.states_at(), self.reading_at());
        for (slot, &r) in self.rows.iter().enumerate() {
            let row = self.z_k_y.row_mut(slot);
            row[slot] += 1.0;
            simd.copy(self.cross.row(slot), &mut row[at..]);
            // Rows without derivatives hold nothing here.
            simd.add_scaled(self.product.row(r), readings.weight[r], &mut row[at..]);
            row[y_at] = readings.y[r];
        }
    }

    /// Adds rows of J K', those of a triple, in the upper triangle.
    #[inline(always)]
    fn add_inner<const FUSED: bool>(&mut self, jacobian: &SparseJacobian, triple: &RowTriple, weight: &[f64]) {
        let own: [usize; 3] =
            std::array::from_fn(|i| if i < triple.count { self.slots[triple.row + i] } else { NOWHERE });
        let first = own.into_iter().min().unwrap_or(NOWHERE);
        let (at, m) = (self.states_at(), self.rows.len());
        let slopes = &jacobian.slopes[triple.slopes.clone()];
        for from in (first..m).step_by(VECTOR) {
            let others: [usize; VECTOR] = std::array::from_fn(|k| (from + k).min(m - 1));
            let sums = inner::<FUSED>(slopes, others.map(|slot| &self.z_k_y.row(slot)[at..]), triple.added);
            for (other, sum) in others.into_iter().zip(sums).take(m - from) {
                for (i, slot) in own.into_iter().enumerate().filter(|(_, slot)| *slot <= other) {
                    self.z_k_y.row_mut(slot)[other] += weight[triple.row + i] * sum[i];
                }
            }
        }
    }
}

/// Up to three rows of J times four columns.
#[inline(always)]
fn inner<const FUSED: bool>(
    slopes: &[Slope],
    columns: [&[f64]; VECTOR],
    added: Option<usize>,
) -> [[f64; VECTOR]; VECTOR] {
    let mut sums = columns.map(|k| added.map_or([0.0; VECTOR], |first| [k[first], k[first + 1], k[first + 2], 0.0]));
    for Slope { state, rows } in slopes {
        for (sum, column) in sums.iter_mut().zip(columns) {
            let by = column[*state];
            for i in 0..VECTOR {
                sum[i] = madd::<FUSED>(by, rows[i], sum[i]);
            }
        }
    }
    sums
}
