//! The fast filter against a plain one written from the textbook, and either against reference vectors.

use crate::support;

mod agreement;
mod reference;
mod smoother;
mod tree;

use oarlock_oracle::{body, ukf};
