//! The extended filter as in textbooks (Jazwinski 1970, section 8.3), for comparison: dense, its Jacobian from differences. Prediction and
//! the manifold of rotations are those of the plain unscented filter.

use super::ukf::Ukf;
use nalgebra::{DMatrix, DVector};

/// Of differences of eighth order: what they cut off and what they round are both near 1e-14 of a reading.
const STEP: f64 = 0.02;
const FIRST: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];

/// Readings `at` a point and their derivative there.
fn linearised(at: &dyn Fn(&DVector<f64>) -> DVector<f64>, place: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let here = at(place);
    let mut jacobian = DMatrix::zeros(here.len(), place.len());
    for i in 0..place.len() {
        let moved = |steps: f64| {
            let mut there = place.clone();
            there[i] += steps * STEP;
            at(&there)
        };
        let differences = FIRST.iter().zip(1..).map(|(w, k)| (moved(f64::from(k)) - moved(-f64::from(k))) * (w / STEP));
        jacobian.set_column(i, &differences.sum::<DVector<f64>>());
    }
    (here, jacobian)
}

/// One update of `filter`'s belief, linearised at its mean.
///
/// Noisy inputs are states of their own here, with the variance of their readings, forgotten afterwards.
pub fn update(filter: &mut Ukf, z: &[f64], std: &[f64], inputs: &[f64]) {
    let rows: Vec<usize> = (0..z.len()).filter(|&r| !z[r].is_nan()).collect();
    if rows.is_empty() {
        return;
    }
    let n = filter.mean.len();
    let joints = filter.body.model.joints.iter();
    let noisy: Vec<_> = joints.filter(|j| j.input && !inputs[j.first].is_nan()).collect();
    let all = n + noisy.len();
    let mut prior = DMatrix::identity(all, all);
    prior.view_mut((0, 0), (n, n)).copy_from(&filter.covariance);
    let read = |place: &DVector<f64>| {
        let mut inputs = inputs.to_vec();
        noisy.iter().enumerate().for_each(|(k, j)| inputs[j.first] += place[n + k] * j.input_std);
        filter.body.measure(&filter.at(&place.rows(0, n).into_owned()), &inputs).select_rows(&rows)
    };
    let measured = DVector::from_vec(rows.iter().map(|&r| z[r]).collect());
    let noise = DMatrix::from_diagonal(&DVector::from_vec(rows.iter().map(|&r| std[r] * std[r]).collect()));
    let (h, jacobian) = linearised(&read, &DVector::zeros(all));
    let inner = &jacobian * &prior * jacobian.transpose() + &noise;
    let gain = inner.cholesky().expect("positive").solve(&(&jacobian * &prior)).transpose();
    let shift = &gain * (&measured - h);
    let keep = DMatrix::identity(all, all) - &gain * jacobian;
    let covariance = &keep * &prior * keep.transpose() + &gain * &noise * gain.transpose();
    filter.covariance = covariance.view((0, 0), (n, n)).into_owned();
    filter.shift(&shift.rows(0, n).into_owned());
}
