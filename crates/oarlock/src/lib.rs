//! Oarlock's engine: tracks articulated bodies by sensor fusion. ARCHITECTURE.md shows the modules and their dependencies.

pub mod body;
pub mod calibrate;
pub mod config;
pub mod corrections;
pub mod describe;
pub mod error;
pub mod estimate;
pub mod jacobian;
pub mod kernels;
pub mod kinematics;
pub mod model;
pub mod motion;
pub mod recording;
pub mod rotation;
pub mod sensor;
pub mod simulate;
pub mod state;
pub(crate) mod strapdown;
pub mod track;

pub use config::Config;
pub use error::{Error, Result};
pub use model::Model;
