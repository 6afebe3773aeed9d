//! Calibration of one session from a short recording: mounts, sensor positions and magnetic disturbances. The Python
//! package `oarlock.calibration` uses it.
//!
//! A hinge chain needs a still stretch in a known posture and a swing. [`hinge_chain::mounts`] estimates the rotation
//! of every mount, [`lever_arms::lever_arms`] the sensor offsets and the link lengths, and [`magnetic::magnetic_field`]
//! the field and each sensor's constant offset.
//!
//! Any tree of bodies can be calibrated pair by pair. [`joint_centers::joint_center`] estimates the joint between two
//! bodies, [`hinge_axes::hinge_axis`] the axis of a hinge, [`pose_mounts::pose_mounts`] the inclination of the mounts
//! from a still stretch, and [`local_field::local_field`] the norm and dip of the magnetic field.

pub mod aligned;
pub mod chain_sensor;
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
mod matrix;
mod rest;
mod robust_fit;
mod spin_axis;
mod swing_sense;
mod turning;
mod windows;

/// Called at intervals by a search; false stops it with [`Error::Stopped`](crate::Error::Stopped).
pub type GoOn<'a> = &'a mut dyn FnMut() -> bool;

fn ask(go_on: GoOn) -> crate::Result<()> {
    if go_on() {
        Ok(())
    } else {
        Err(crate::Error::Stopped)
    }
}
