//! A textbook filter for Oarlock's models, dense and plain. The engine is tested and timed against it.
//!
//! `body`, `so3` and `ukf` use only the model description from the engine; `race` times the engine's filters beside it.
//! The code is plain but not wasteful: names are looked up once, and sigma points do not allocate.

pub mod body;
pub mod course;
pub mod race;
pub mod so3;
pub mod ukf;
