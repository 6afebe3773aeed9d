//! The factorised update from its equations: dense, one limb after the other, textbook weights.
//!
//! The core's readings go with the first limb. Before: whatever two limbs have in common goes by the core, Pcd = Pc0 P00^-1 P0d. Then, for each limb with the core, K
//! being these states: the scaled unscented update of K with its own readings; and all other states o follow by their
//! regression on K, A = PoK PKK^-1: xo += A dxK, PoK = A PKK+, Poo += A (PKK+ - PKK) A'.

use super::ukf::{Ukf, Weights};
use nalgebra::{DMatrix, DVector};

/// States, and the rows of each small filter.
pub struct Parts {
    pub core: Vec<usize>,
    pub limbs: Vec<Vec<usize>>,
    pub rows: Vec<Vec<usize>>,
}

impl Parts {
    /// From the number of the limb to which each state and row belongs, 0 being the core.
    pub fn new(states: &[usize], rows: &[usize]) -> Self {
        let of = |all: &[usize], k: usize| (0..all.len()).filter(|&i| all[i] == k).collect::<Vec<_>>();
        let limbs = 1..=states.iter().copied().max().expect("some");
        Parts {
            core: of(states, 0),
            limbs: limbs.clone().map(|k| of(states, k)).collect(),
            rows: limbs.map(|k| if k == 1 { [of(rows, 0), of(rows, 1)].concat() } else { of(rows, k) }).collect(),
        }
    }
}

fn pick(p: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |r, c| p[(rows[r], columns[c])])
}

fn put(p: &mut DMatrix<f64>, rows: &[usize], columns: &[usize], block: &DMatrix<f64>) {
    for (r, &row) in rows.iter().enumerate() {
        for (c, &column) in columns.iter().enumerate() {
            p[(row, column)] = block[(r, c)];
            p[(column, row)] = block[(r, c)];
        }
    }
}

/// A B^-1.
fn over(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    if b.is_empty() {
        return a.clone();
    }
    b.clone().cholesky().expect("positive").solve(&a.transpose()).transpose()
}

/// One update of the filter's belief.
pub fn update(filter: &mut Ukf, parts: &Parts, spread: [f64; 3], z: &[f64], std: &[f64], inputs: &[f64]) {
    for (k, one) in parts.limbs.iter().enumerate() {
        for other in &parts.limbs[k + 1..] {
            let p = &filter.covariance;
            let slope = over(&pick(p, one, &parts.core), &pick(p, &parts.core, &parts.core));
            let block = slope * pick(p, &parts.core, other);
            put(&mut filter.covariance, one, other, &block);
        }
    }
    for (k, rows) in parts.rows.iter().enumerate() {
        let mut own = parts.core.clone();
        own.extend(&parts.limbs[k]);
        own.sort_unstable();
        let rows: Vec<usize> = rows.iter().copied().filter(|&r| !z[r].is_nan()).collect();
        if !rows.is_empty() {
            stage(filter, &own, &rows, spread, (z, std, inputs));
        }
    }
}

fn stage(
    filter: &mut Ukf,
    own: &[usize],
    rows: &[usize],
    [alpha, beta, kappa]: [f64; 3],
    (z, std, inputs): (&[f64], &[f64], &[f64]),
) {
    let (all, n) = (filter.mean.len(), own.len());
    let w = Weights::new(n, alpha, beta, kappa);
    let prior = pick(&filter.covariance, own, own);
    let root = prior.clone().cholesky().expect("positive").unpack() * (n as f64 + w.lambda).sqrt();
    let read = |away: &DVector<f64>, inputs: &[f64]| {
        let mut delta = DVector::zeros(all);
        own.iter().zip(away.iter()).for_each(|(&i, x)| delta[i] = *x);
        filter.body.measure(&filter.at(&delta), inputs).select_rows(rows)
    };
    let mut places = vec![DVector::zeros(n)];
    places.extend(root.column_iter().flat_map(|c| [c.into_owned(), -c.into_owned()]));
    let readings: Vec<DVector<f64>> = places.iter().map(|x| read(x, inputs)).collect();
    let weight = |first: f64, i: usize| if i == 0 { first } else { w.others };
    let mut expected = DVector::zeros(rows.len());
    readings.iter().enumerate().for_each(|(i, y)| expected += y * weight(w.mean_0, i));
    let mut inner = DMatrix::from_diagonal(&DVector::from_vec(rows.iter().map(|&r| std[r] * std[r]).collect()));
    let mut cross = DMatrix::zeros(n, rows.len());
    for (i, (x, y)) in places.iter().zip(&readings).enumerate() {
        let away = y - &expected;
        inner += &away * away.transpose() * weight(w.covariance_0, i);
        cross += x * away.transpose() * weight(w.covariance_0, i);
    }
    for joint in filter.body.model.joints.iter().filter(|j| j.input && !inputs[j.first].is_nan()) {
        let mut off = inputs.to_vec();
        off[joint.first] += joint.input_std;
        let change = read(&DVector::zeros(n), &off) - &readings[0];
        inner += &change * change.transpose();
    }
    let measured = DVector::from_iterator(rows.len(), rows.iter().map(|&r| z[r]));
    let gain = over(&cross, &inner);
    let posterior = &prior - &gain * inner * gain.transpose();
    let step = gain * (measured - expected);
    spread_to_all(filter, own, &prior, &posterior, &step);
}

/// All states follow those that were updated.
fn spread_to_all(filter: &mut Ukf, own: &[usize], prior: &DMatrix<f64>, posterior: &DMatrix<f64>, step: &DVector<f64>) {
    let p = &filter.covariance;
    let others: Vec<usize> = (0..filter.mean.len()).filter(|i| !own.contains(i)).collect();
    let slope = over(&pick(p, &others, own), prior);
    let rest = pick(p, &others, &others) + &slope * (posterior - prior) * slope.transpose();
    let mut shift = DVector::zeros(filter.mean.len());
    own.iter().zip(step.iter()).for_each(|(&i, x)| shift[i] = *x);
    others.iter().zip((&slope * step).iter()).for_each(|(&i, x)| shift[i] = *x);
    put(&mut filter.covariance, own, own, posterior);
    put(&mut filter.covariance, &others, own, &(&slope * posterior));
    put(&mut filter.covariance, &others, &others, &rest);
    filter.covariance = (&filter.covariance + filter.covariance.transpose()) * 0.5;
    filter.shift(&shift);
}
