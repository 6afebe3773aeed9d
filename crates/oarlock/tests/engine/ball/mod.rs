//! Balls and free joints: kinematics, motion, smoothing, and headings that nothing tells at first.

use crate::support;

mod absurd;
mod chart;
mod gauge;
mod hypotheses;
mod kinematics;
mod motion;
mod slopes;
mod smoother;
