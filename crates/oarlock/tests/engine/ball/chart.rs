//! A ball's state of nine numbers (rotation vector, rate, acceleration) and its exact motion.

use super::support::so3;
use nalgebra::{SMatrix, SVector};

pub type State = SVector<f64, 9>;
pub type Square9 = SMatrix<f64, 9, 9>;

/// What a unit of acceleration at 0 has become t later: angle, rate, acceleration.
pub fn response(tau: f64, t: f64) -> [f64; 3] {
    if tau.is_infinite() {
        return [t * t / 2.0, t, 1.0];
    }
    let e = (-t / tau).exp();
    [tau * (t - tau * (1.0 - e)), tau * (1.0 - e), e]
}

/// The exact motion in the chart at the rotation itself: R Exp(phi), phi, w and wd being linear in the rates.
pub fn moved(x: &State, tau: f64, t: f64) -> State {
    let [r, w, a] = [0, 3, 6].map(|i| x.fixed_rows::<3>(i).into_owned());
    let [p, v, k] = response(tau, t);
    let mut out = State::zeros();
    out.fixed_rows_mut::<3>(0).copy_from(&so3::plus(r, w * t + a * p));
    out.fixed_rows_mut::<3>(3).copy_from(&(w + a * v));
    out.fixed_rows_mut::<3>(6).copy_from(&(a * k));
    out
}

pub fn shifted(x: &State, d: &State) -> State {
    let mut out = x + d;
    let [r, e] = [x, d].map(|v| v.fixed_rows::<3>(0).into_owned());
    out.fixed_rows_mut::<3>(0).copy_from(&so3::plus(r, e));
    out
}

pub fn away(to: &State, from: &State) -> State {
    let mut out = to - from;
    let [to, from] = [to, from].map(|v| v.fixed_rows::<3>(0).into_owned());
    out.fixed_rows_mut::<3>(0).copy_from(&so3::minus(to, from));
    out
}
