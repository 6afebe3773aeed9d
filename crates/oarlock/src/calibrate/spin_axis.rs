//! The axis about which a sensor rotates during a swing.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// The axis in sensor axes, and how well one axis explains the rotation.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpinAxis {
    /// Unit vector; its sign is arbitrary.
    pub axis: Vector3<f64>,
    /// Share of the squared angular velocity that is not about the axis, 0 to 1.
    pub off_axis_share: f64,
    /// Standard deviation of the axis' direction, rad per transverse direction.
    pub std_rad: f64,
}

const BLOCKS: usize = 8;

/// The principal direction of angular velocities (rad/s, bias removed), with its scatter between blocks of the swing.
///
/// The standard deviation is the delete-one-block jackknife. Deviations from one axis (play in the hinge, vibration)
/// are correlated in time, so that the number of samples would give too small a value.
pub(crate) fn spin_axis(rates: &[Vector3<f64>]) -> SpinAxis {
    let length = rates.len().div_ceil(BLOCKS).max(1);
    let blocks: Vec<Matrix3<f64>> = rates.chunks(length).map(second_moment).collect();
    let total: Matrix3<f64> = blocks.iter().sum();
    if !(total.trace().is_finite() && total.trace() > 0.0) {
        // The eigenvalue iteration does not end on a matrix with infinite entries.
        return SpinAxis { axis: Vector3::z(), off_axis_share: 1.0, std_rad: f64::INFINITY };
    }
    let (axis, largest) = principal(total);
    let axes: Vec<Vector3<f64>> = blocks.iter().map(|block| aligned(principal(total - block).0, axis)).collect();
    let centre: Vector3<f64> = axes.iter().sum::<Vector3<f64>>() / axes.len() as f64;
    let spread: f64 = axes.iter().map(|a| (a - centre).norm_squared()).sum();
    let count = axes.len() as f64;
    let off_axis_share = (1.0 - largest / total.trace()).max(0.0);
    SpinAxis { axis, off_axis_share, std_rad: (spread / 2.0 * (count - 1.0) / count).sqrt() }
}

fn second_moment(rates: &[Vector3<f64>]) -> Matrix3<f64> {
    rates.iter().map(|w| w * w.transpose()).sum()
}

fn principal(moment: Matrix3<f64>) -> (Vector3<f64>, f64) {
    let eigen = SymmetricEigen::new(moment);
    let (index, value) = eigen.eigenvalues.argmax();
    (eigen.eigenvectors.column(index).into_owned(), value)
}

fn aligned(axis: Vector3<f64>, to: Vector3<f64>) -> Vector3<f64> {
    if axis.dot(&to) < 0.0 {
        -axis
    } else {
        axis
    }
}
