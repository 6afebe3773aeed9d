//! The effect of an update on derivatives of the mean by parameters: S+ = P+ (P^-1 S - J'W f), with f the derivatives of the readings.
//!
//! By U5 to U8 this is X'V'^-1 (L^-1 S - D f) with D = W'U'^-1. A reading depends on few parameters, so D f costs little once D is known.

use super::InformationUpdate;
use crate::kernels::arch::{with_simd, Arch, Kernel};
use crate::kernels::registers::{F64x4, Simd};
use crate::kernels::tiles::{padded, product, substitute, substitute_back, Lower, Panel, Rows, VECTOR};

/// Derivative of one reading by one parameter, divided by the reading's noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Force {
    /// The reading.
    pub row: usize,
    /// The parameter.
    pub parameter: usize,
    /// The derivative.
    pub by: f64,
}

/// Workspace of [`InformationUpdate::carry`].
#[derive(Debug, Clone)]
pub struct Carried {
    width: usize,
    /// U'.
    lower: Lower,
    /// D', a row for each reading in use.
    gain: Panel,
    /// (D f)', a row for each parameter, with the states in reverse order; and its transpose.
    pulled: Panel,
    turned: Panel,
    /// L^-1 S.
    prior: Panel,
    /// V'^-1 (L^-1 S - D f), with the states in reverse order.
    slopes: Panel,
    out: Panel,
    zeros: Vec<usize>,
    /// The slopes before the update.
    pub(in crate::estimate) before: Vec<f64>,
}

impl Carried {
    /// For so many states and readings; `width`, the number of parameters, is a multiple of a vector's length.
    pub fn new(states: usize, rows: usize, width: usize) -> Self {
        let n = padded(states);
        let of_states = Panel::zeros(n, width);
        Carried {
            width,
            lower: Lower::zeros(rows),
            gain: Panel::zeros(rows, n),
            pulled: Panel::zeros(width, n),
            turned: of_states.clone(),
            prior: of_states.clone(),
            slopes: of_states.clone(),
            out: of_states,
            zeros: vec![0; width / VECTOR],
            before: vec![0.0; states * width],
        }
    }
}

impl InformationUpdate {
    /// After `solve`: what the update makes of the derivatives `slopes`, a row for each state. `forces` are f; those of readings that are
    /// not in use count for nothing.
    pub fn carry(&self, arch: Arch, l_transposed: &Panel, forces: &[Force], carried: &mut Carried, slopes: &mut [f64]) {
        let (n, m, width) = (self.states, self.used, carried.width);
        let n_pad = padded(n);
        for (row, own) in slopes.chunks_exact(width).zip(carried.prior.rows_mut()) {
            own[..width].copy_from_slice(row);
        }
        substitute(arch, l_transposed, n, &mut carried.prior, width);
        carried.lower.transpose(arch, &self.s_h_y, m);
        let w = (&self.s_h_y, self.states_at());
        substitute_back(arch, &carried.lower, w, &mut carried.gain, n_pad);
        arch.run(Pulling { information: self, forces, carried });
        substitute(arch, &self.v_b_x, n, &mut carried.slopes, width);
        let Carried { slopes: z, out, zeros, .. } = carried;
        let x = Rows { panel: &self.v_b_x, rows: 0..n, column: self.wide(), starts: &self.reversed };
        product(arch, out, [n, width], [x, Rows { panel: z, rows: 0..n, column: 0, starts: zeros }]);
        slopes.chunks_exact_mut(width).zip(out.rows()).for_each(|(row, own)| row.copy_from_slice(&own[..width]));
    }
}

/// L^-1 S - D f into `slopes`, with the states in reverse order.
struct Pulling<'a> {
    information: &'a InformationUpdate,
    forces: &'a [Force],
    carried: &'a mut Carried,
}

impl Kernel for Pulling<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        with_simd!(FUSED, |simd| self.pull(simd));
    }
}

impl Pulling<'_> {
    #[inline(always)]
    fn pull<F: F64x4>(self, simd: Simd<F>) {
        let Carried { width, gain, pulled, turned, prior, slopes, .. } = self.carried;
        let n = self.information.states;
        pulled.clear();
        for force in self.forces {
            let Some(slot) = self.information.slot(force.row) else { continue };
            simd.add_scaled(gain.row(slot), force.by, pulled.row_mut(force.parameter));
        }
        for k in 0..*width / VECTOR {
            let rows = std::array::from_fn(|i| pulled.row(k * VECTOR + i));
            for i in 0..n.div_ceil(VECTOR) {
                turned.put_turned(simd, [i * VECTOR, k * VECTOR], rows, i * VECTOR, [1.0; VECTOR]);
            }
        }
        for i in 0..n {
            simd.difference(prior.row(n - 1 - i), turned.row(i), slopes.row_mut(i));
        }
    }
}
