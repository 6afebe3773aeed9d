//! The filters with analytic Jacobians: the Jacobians, the extended filter, its iterations.

use crate::support;

mod agreement;
mod jacobian;
mod mixed;
mod plain;
mod tracking;

use oarlock_oracle::{body, ukf};
