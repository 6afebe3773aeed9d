//! Balls and free joints: kinematics, motion, smoothing, and headings that nothing tells at first.

#[path = "../support/mod.rs"]
mod support;

mod absurd;
mod gauge;
mod hypotheses;
mod kinematics;
mod motion;
mod smoother;
