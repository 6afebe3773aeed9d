//! The extended filter and its analytic Jacobians.

#[path = "../support/mod.rs"]
mod support;

mod agreement;
mod jacobian;
mod mixed;
mod plain;
mod tracking;

use oarlock_oracle::{body, ukf};
