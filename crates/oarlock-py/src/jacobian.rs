//! Jacobians of frames and readings, as arrays.

use crate::motion::{Lengths, Motion, Roots};
use crate::run::each_row;
use oarlock::jacobian::{Instant, Jacobians};
use oarlock::kinematics::FrameMotion;
use oarlock::rotation::Vec3;
use pyo3::prelude::*;

/// By coordinate (rows, frames, 6, n_coordinates) and by length (rows, frames, 3, n_lengths).
pub fn of_frames(
    py: Python<'_>,
    jacobians: &Jacobians,
    frames: &[usize],
    q: &[f64],
    lengths: Option<&Lengths>,
    rows: usize,
) -> PyResult<[Vec<f64>; 2]> {
    let n = jacobians.coordinate_count();
    let still = vec![0.0; n];
    let root = FrameMotion::resting(Vec3([0.0; 3]));
    let (mut room, width) = (jacobians.room(), jacobians.width());
    let mut one = vec![0.0; 6 * width];
    let count = rows * frames.len();
    let mut by_coordinate = Vec::with_capacity(count * 6 * n);
    let mut by_length = Vec::with_capacity(count * 3 * jacobians.length_count());
    each_row(py, rows, |row| {
        let q = &q[row * n..(row + 1) * n];
        jacobians.stand(
            root,
            Instant { q, qd: &still, qdd: &still, lengths: lengths.map_or(jacobians.lengths(), |l| l.at(row)) },
            &mut room,
        );
        for &frame in frames {
            jacobians.frame(frame, &room, &mut one);
            one.chunks(width.max(1)).for_each(|row| by_coordinate.extend(&row[..n]));
            one.chunks(width.max(1)).take(3).for_each(|row| by_length.extend(&row[3 * n..]));
        }
    })?;
    Ok([by_coordinate, by_length])
}

/// By q, qd, qdd (rows, n_measurements, n_coordinates) and by length (rows, n_measurements, n_lengths).
pub fn of_readings(py: Python<'_>, jacobians: &Jacobians, motion: &Motion, roots: &Roots) -> PyResult<[Vec<f64>; 4]> {
    let (n, width) = (jacobians.coordinate_count(), jacobians.width());
    let mut room = jacobians.room();
    let mut one = vec![0.0; jacobians.row_count() * width];
    let mut out =
        [n, n, n, jacobians.length_count()].map(|c| Vec::with_capacity(motion.rows * jacobians.row_count() * c));
    each_row(py, motion.rows, |row| {
        let ((root, field), [q, qd, qdd]) = (roots.at(row), motion.row(row));
        jacobians.stand(root, Instant { q, qd, qdd, lengths: jacobians.lengths() }, &mut room);
        jacobians.readings(field, &mut room, &mut one);
        for row in one.chunks(width.max(1)) {
            for (k, out) in out.iter_mut().enumerate() {
                out.extend(&row[k * n..if k == 3 { width } else { (k + 1) * n }]);
            }
        }
    })?;
    Ok(out)
}
