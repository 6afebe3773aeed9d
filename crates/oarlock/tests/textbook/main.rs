//! The fast filter against a plain one written from the textbook, and either against reference vectors.

#[path = "../support/mod.rs"]
mod support;

mod agreement;
mod body;
mod reference;
mod smoother;
mod tree;
mod ukf;

use support::so3;
