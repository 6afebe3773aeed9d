//! Simulated signals of inertial units, by numerical differentiation of poses. Independent of the filter's measurement
//! model.
//!
//! Poses are computed at nine instants around each time stamp, `step_s` apart. Linear acceleration is the second
//! central difference of the sensor's position. Angular velocity is the first central difference of the logarithm of
//! its orientation relative to the middle. Both are of eighth order (Fornberg 1988).

use crate::kinematics::{FrameMotion, JointMotion, Tree};
use crate::rotation::{Mat3, Vec3};

/// Number of instants around a time stamp, including it.
pub const STENCIL: usize = 9;
const FIRST: [f64; 4] = [4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0];
const SECOND: [f64; 5] = [-205.0 / 72.0, 8.0 / 5.0, -1.0 / 5.0, 8.0 / 315.0, -1.0 / 560.0];

/// A simulated sensor on a frame.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// Index of the frame.
    pub frame: usize,
    /// Rotation from sensor to link axes.
    pub rotation: Mat3<f64>,
    /// Position in the link, m.
    pub offset: [f64; 3],
}

/// Surroundings in root axes: specific force at rest, magnetic field, and the root's own acceleration.
#[derive(Debug, Clone, Copy)]
pub struct Around {
    /// m/s2.
    pub lift: [f64; 3],
    /// uT.
    pub magnetic_field: [f64; 3],
    /// m/s2.
    pub root_acceleration: [f64; 3],
}

/// Gyroscope rad/s, accelerometer m/s2, magnetometer uT, in sensor axes.
pub type Signals = [f64; 9];

/// Signals at the middle of `q`, the joint values at the nine instants, `step_s` apart.
pub fn signals(tree: &Tree, q: &[&[f64]; STENCIL], step_s: f64, around: &Around, spots: &[Spot]) -> Vec<Signals> {
    let poses: Vec<Vec<(Mat3<f64>, Vec3<f64>)>> = q.iter().map(|q| poses(tree, q, spots)).collect();
    let at = |i: usize| {
        let track: [(Mat3<f64>, Vec3<f64>); STENCIL] = std::array::from_fn(|k| poses[k][i]);
        differentiate(&track, step_s, around)
    };
    (0..spots.len()).map(at).collect()
}

fn poses(tree: &Tree, q: &[f64], spots: &[Spot]) -> Vec<(Mat3<f64>, Vec3<f64>)> {
    let still = vec![0.0; q.len()];
    let root = FrameMotion::resting(Vec3([0.0; 3]));
    let mut frames = vec![root; tree.len()];
    tree.motions(
        root,
        JointMotion { q, qd: &still, qdd: &still, lengths: &[], anchors: &[] },
        &vec![true; tree.len()],
        &mut frames,
    );
    let spot = |s: &Spot| {
        let f = &frames[s.frame];
        (f.rotation.times(&s.rotation), f.position + f.rotation.apply_f64(s.offset))
    };
    spots.iter().map(spot).collect()
}

fn differentiate(track: &[(Mat3<f64>, Vec3<f64>); STENCIL], step_s: f64, around: &Around) -> Signals {
    let middle = STENCIL / 2;
    let sensor_from_root = track[middle].0.transposed();
    let mut spin = Vec3([0.0; 3]);
    let mut acceleration = track[middle].1 * SECOND[0];
    for k in 1..=middle {
        let (after, before) = (&track[middle + k], &track[middle - k]);
        let turn = |p: &(Mat3<f64>, Vec3<f64>)| logarithm(&sensor_from_root.times(&p.0));
        spin += (turn(after) - turn(before)) * FIRST[k - 1];
        acceleration += (after.1 + before.1) * SECOND[k];
    }
    let force = acceleration * (1.0 / (step_s * step_s)) + Vec3(around.root_acceleration) + Vec3(around.lift);
    let mut out = [0.0; 9];
    out[..3].copy_from_slice(&(spin * (1.0 / step_s)).0);
    out[3..6].copy_from_slice(&sensor_from_root.apply(force).0);
    out[6..].copy_from_slice(&sensor_from_root.apply(Vec3(around.magnetic_field)).0);
    out
}

/// Rotation vector of a rotation of less than a right angle, rad.
fn logarithm(r: &Mat3<f64>) -> Vec3<f64> {
    let m = &r.0;
    let axis = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]].map(|x| 0.5 * x);
    let sin = axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    let scale = if sin < 1e-8 { 1.0 + sin * sin / 6.0 } else { sin.asin() / sin };
    Vec3(axis) * scale
}
