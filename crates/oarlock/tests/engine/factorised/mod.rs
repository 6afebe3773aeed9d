//! The factorised filter: where a state falls apart, what its small filters make of it, and what that costs.

use crate::support;

mod agreement;
mod apart;
mod bodies;
mod plain;
mod split;
mod tracking;

use oarlock_oracle::ukf;
