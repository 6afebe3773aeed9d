//! The filters with analytic Jacobians: the Jacobians, the extended filter, its iterations.

#[path = "../textbook/body.rs"]
mod body;
#[path = "../support/mod.rs"]
mod support;
#[allow(dead_code)] // of the plain unscented filter, the prediction and the moves
#[path = "../textbook/ukf.rs"]
mod ukf;

mod agreement;
mod jacobian;
mod mixed;
mod plain;
mod tracking;

use support::so3;
