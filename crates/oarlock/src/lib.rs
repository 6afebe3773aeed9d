//! Oarlock's engine: tracks articulated bodies by sensor fusion. See ARCHITECTURE.md for how the modules point at each other.

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
pub mod track;

pub use config::Config;
pub use error::{Error, Result};
pub use model::Model;
