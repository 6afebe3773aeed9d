//! Whatever comes in is answered: a result or an error that says something, never a panic and never silence.
//!
//! Without `OARLOCK_FUZZ_SECONDS` every campaign runs a fixed number of cases from fixed seeds. With it, each goes on for so
//! long from seeds that `OARLOCK_FUZZ_SEED` starts; `make fuzz` does this. A case that fails names its seed and what it was fed.

#[path = "../support/mod.rs"]
mod support;

mod campaign;
mod expressions;
mod findings;
mod models;
mod mutate;
mod numbers;
mod odd_models;
mod settings;
mod streams;
mod timing;
