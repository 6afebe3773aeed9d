//! The textbook's filter on Oarlock's models, dense and plain: what the engine is tested and timed against.
//!
//! `body`, `so3` and `ukf` take the description of a model from the engine and nothing else; `race` sets the engine's own filters
//! beside it. Plain is not wasteful: names are looked up once, and no sigma point allocates.

pub mod body;
pub mod course;
pub mod race;
pub mod so3;
pub mod ukf;
