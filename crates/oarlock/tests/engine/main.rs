//! The engine from outside: one binary, because each would be linked with the whole engine again.
//!
//! A file beside this one is a module of it. `allocation` counts requests for memory and `fuzz` ends processes that hang, so
//! those two are binaries of their own.

#[path = "../support/mod.rs"]
mod support;

mod apart;
mod ball;
mod ekf;
mod exact;
mod factorised;
mod field;
mod hinge_chain;
mod identities;
mod linear;
mod many;
mod model_errors;
mod model_vectors;
mod numerics;
mod robust;
mod score;
mod statistics;
mod textbook;
mod tree_pairs;
mod vibration;
