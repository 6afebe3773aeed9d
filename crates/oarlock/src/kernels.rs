//! Arithmetic for all modules above: numbers side by side, tiles of matrices, triangular factors. No state, sensor or body.
//!
//! `rotation`, `kinematics` and `sensor` compute on [`lane`]; `estimate` writes its equations with [`tiles`], [`dense`],
//! [`sparse_jacobian`], [`mahalanobis`] and [`normal_equations`]. [`arch`] chooses the instruction set at run time.

pub mod arch;
pub mod dense;
pub mod lane;
pub mod mahalanobis;
pub mod normal_equations;
pub mod registers;
pub mod sparse_jacobian;
pub mod tiles;
mod trig;
