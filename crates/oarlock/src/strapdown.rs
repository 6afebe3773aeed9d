//! Strapdown links: each inertial unit integrates its own gyroscope and accelerometer; joints with their limits, bounds, rest and contact are the
//! readings.
//!
//! A unit has 15 states: orientation R, velocity v, position p, and the biases of both sensors. A joint has the error of each of its two points.
//! Errors are right-invariant (Barrau and Bonnabel 2017): with R = Exp(f) R^, v = Exp(f) v^ + xv, p = Exp(f) p^ + xp, a turn of everything about the
//! vertical is one constant direction that no reading sees. No joint angle is a state and there is no motion model, so a unit never turns
//! otherwise than its own gyroscope measured. `track` uses this for models with `structure = "strapdown"`.

pub mod angles;
mod attach;
pub mod check;
pub(crate) mod covariance;
mod driven;
pub mod filter;
mod hang;
pub mod increment;
mod joint;
mod late;
mod limits;
mod pieces;
mod readings;
pub mod sensors;
pub mod skeleton;
mod skin;
pub mod slides;
pub mod smoother;
mod start;
