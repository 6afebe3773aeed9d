//! Derivatives of readings by the delay of a clock: a reading `d` late was measured `d` before its time stamp, so dh/dd
//! = -(J dx/dt).

use super::parameters::Role;
use crate::body::Body;
use crate::kernels::sparse_jacobian::{RowTriple, Slope};

/// Unit of a delay, s.
pub(super) const DELAY_STD_S: f64 = 0.01;
/// Time over which accelerations are averaged before they are differentiated, s. The state contains no jerk.
const JERK_S: f64 = 0.03;

/// Delays of all sensors as parameters.
#[derive(Debug, Clone)]
pub(super) struct Delays {
    /// Per row: its sensor's delay.
    of_row: Vec<Option<usize>>,
    /// Column of the augmented body's Jacobian, and the state of its rate.
    paces: Vec<(usize, usize)>,
    /// Column of an acceleration, its state, and its previous average.
    accelerations: Vec<(usize, usize, f64)>,
    since_s: f64,
    /// Per column of the augmented body's Jacobian: its rate of change.
    pace: Vec<f64>,
}

impl Delays {
    /// Numbers the delays of all sensors from `first` on; also returns the names of their sources.
    pub(super) fn new(body: &Body, augmented: &Body, first: usize) -> (Self, Vec<String>) {
        let (mut of_row, mut names) = (vec![None; body.suite.len()], Vec::new());
        for source in &body.suite.sources {
            let measured = source.parts.iter().filter(|p| !p.quantity.is_virtual());
            let rows: Vec<usize> = measured.flat_map(|p| p.rows.clone()).collect();
            if rows.is_empty() {
                continue;
            }
            rows.iter().for_each(|&r| of_row[r] = Some(first + names.len()));
            names.push(source.name.clone());
        }
        let (mut paces, mut accelerations) = (Vec::new(), Vec::new());
        let coordinates = body.layout.coordinates.iter().zip(&augmented.layout.coordinates);
        for (own, column) in coordinates.filter_map(|(own, column)| own.zip(*column)) {
            if let (Some((rate, acceleration)), Some((v, a))) = (own.rates, column.rates) {
                paces.extend([(column.q, rate), (v, acceleration)]);
                accelerations.push((a, acceleration, f64::NAN));
            }
        }
        let pace = vec![0.0; augmented.layout.dim()];
        (Delays { of_row, paces, accelerations, since_s: f64::NAN, pace }, names)
    }

    /// Updates the rates of change from the state.
    pub(super) fn follow(&mut self, time_s: f64, mean: &[f64]) {
        for &(column, state) in &self.paces {
            self.pace[column] = mean[state];
        }
        let dt = time_s - self.since_s;
        self.since_s = time_s;
        for (column, state, average) in &mut self.accelerations {
            if !dt.is_finite() {
                *average = mean[*state];
                continue;
            }
            let keep = (-dt / JERK_S).exp();
            self.pace[*column] = (mean[*state] - *average) / JERK_S;
            *average = mean[*state] + keep * (*average - mean[*state]);
        }
    }

    /// Number of the row's delay, and the derivative of the row's reading by it.
    pub(super) fn derivative(
        &self,
        triple: &RowTriple,
        i: usize,
        slopes: &[Slope],
        roles: &[Role],
    ) -> Option<(usize, f64)> {
        let moving = slopes.iter().filter(|s| matches!(roles[s.state], Role::State(_)));
        let pace: f64 = moving.map(|s| s.rows[i] * self.pace[s.state]).sum();
        self.of_row[triple.row + i].map(|k| (k, -DELAY_STD_S * pace))
    }
}
