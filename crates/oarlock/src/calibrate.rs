//! What a short recording tells about one wearing: how the sensors sit on their links, where they sit, what disturbs
//! their magnetometers.
//!
//! A hinge chain needs a still stretch in a known posture and a swing. [`hinge_chain::mounts`] finds the rotation of
//! every mount, [`lever_arms::lever_arms`] the offsets of the sensors and the lengths of the links, and
//! [`magnetic::magnetic_field`] the field and each sensor's constant offset from it.
//!
//! Any tree of bodies can be taken pair by pair: [`joint_centers::joint_center`] finds where two bodies are joined,
//! [`hinge_axes::hinge_axis`] the axis if they are joined by a hinge. [`pose_mounts::pose_mounts`] takes the inclination of
//! the mounts from a still stretch, and [`local_field::local_field`] the strength and dip of the magnetic field.

pub mod aligned;
pub mod hinge_axes;
pub mod hinge_chain;
pub mod joint_centers;
pub mod lever_arms;
pub mod local_field;
pub mod magnetic;
pub mod pose_mounts;
pub mod signals;
pub mod still;

mod chain_motion;
mod clock;
mod least_squares;
mod rest;
mod robust_fit;
mod spin_axis;
mod swing_sense;
mod turning;
mod windows;
