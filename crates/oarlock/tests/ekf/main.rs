//! The filters with analytic Jacobians: the Jacobians, the extended filter, its iterations.

#[path = "../support/mod.rs"]
mod support;

mod jacobian;
mod mixed;
