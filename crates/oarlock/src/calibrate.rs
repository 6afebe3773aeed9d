//! What a short recording tells about one wearing: how the sensors sit on their links, where they sit, what disturbs
//! their magnetometers.
//!
//! A hinge chain needs a still stretch in a known posture and a swing. [`hinge_chain::mounts`] finds the rotation of
//! every mount, [`lever_arms::lever_arms`] the offsets of the sensors and the lengths of the links, and
//! [`magnetic::magnetic_field`] the field and each sensor's constant offset from it.

pub mod hinge_chain;
pub mod lever_arms;
pub mod magnetic;
pub mod still;

mod chain_motion;
mod least_squares;
mod spin_axis;
mod swing_sense;
mod turning;
