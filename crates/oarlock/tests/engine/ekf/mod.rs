//! The extended filter and its analytic Jacobians.

use crate::support;

mod agreement;
mod jacobian;
mod mixed;
mod plain;
mod tracking;

use oarlock_oracle::ukf;
