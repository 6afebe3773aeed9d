//! A joint between two links: its angles from a relative rotation, and their derivatives. `skeleton` makes them, `angles` and `readings`
//! use them.

use super::filter::dot;
use super::increment::square;
use crate::rotation::turn::Turn;
use crate::rotation::{Mat3, Vec3};
use std::f64::consts::TAU;

/// A hinge of a joint: `entry` from the axes before it, then a turn about z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hinge {
    /// Its coordinate in the model.
    pub coordinate: usize,
    /// Sign of the turn about z.
    pub sign: f64,
    /// Rotation of the axes of this hinge in those before it.
    pub entry: Mat3<f64>,
}

/// What a joint lets turn. `Free` moves too.
#[derive(Debug, Clone, PartialEq)]
pub enum Turns {
    /// Coordinates from this one on: three of a position, three of a rotation vector.
    Free(usize, Mat3<f64>),
    /// Coordinates of a rotation vector.
    Ball(usize, Mat3<f64>),
    /// Up to three hinges that meet in a point; none: it does not turn.
    Hinges(Vec<Hinge>),
    /// A slide along an axis of the parent, by its coordinate: it turns nothing.
    Slide(usize, Mat3<f64>, Vec3<f64>),
}

/// Angles of a joint at one relative rotation.
#[derive(Debug, Clone, Copy)]
pub struct Angles {
    /// Number of coordinates.
    pub count: usize,
    /// Their values, rad; a rotation vector for balls.
    pub q: [f64; 3],
    /// Their change by a small turn of the child in its own axes: rows, `count` of them.
    pub by_turn: Mat3<f64>,
    /// Turn that the hinges do not explain, rad in the child's axes.
    pub off_axis: Vec3<f64>,
    /// Unit vectors at right angles to all hinges, in the child's axes; `3 - count` of them.
    pub normals: [Vec3<f64>; 3],
}

/// Steps of the search for two or three angles: it converges quadratically.
const STEPS: usize = 8;
/// Damping, rad2: a singular posture has angles with a band of half a turn, and no infinite ones.
const DAMPING: f64 = 1e-5;

impl Turns {
    /// Coordinates of the rotation.
    pub fn coordinates(&self) -> [Option<usize>; 3] {
        match self {
            Turns::Free(first, _) => [3, 4, 5].map(|k| Some(first + k)),
            Turns::Ball(first, _) => [0, 1, 2].map(|k| Some(first + k)),
            Turns::Hinges(hinges) => [0, 1, 2].map(|k| hinges.get(k).map(|h| h.coordinate)),
            Turns::Slide(..) => [None; 3],
        }
    }

    /// Number of directions in which it does not turn.
    pub fn locked(&self) -> usize {
        match self {
            Turns::Hinges(hinges) => 3 - hinges.len(),
            _ => 0,
        }
    }

    /// Parent from child at these angles.
    pub fn rotation(&self, q: [f64; 3]) -> Mat3<f64> {
        match self {
            Turns::Free(_, entry) | Turns::Ball(_, entry) => entry.times(&Mat3::about(Vec3(q))),
            Turns::Slide(_, entry, _) => *entry,
            Turns::Hinges(hinges) => hinges
                .iter()
                .zip(q)
                .fold(Mat3::identity(), |m, (h, q)| m.times(&h.entry).times(&Mat3::about_z(h.sign * q))),
        }
    }

    /// Angles at a rotation, parent from child, near `guess`.
    pub fn angles(&self, rotation: &Mat3<f64>, guess: [f64; 3]) -> Angles {
        let zero = Vec3([0.0; 3]);
        match self {
            Turns::Free(_, entry) | Turns::Ball(_, entry) => {
                let q = Turn::of(&entry.transposed().times(rotation)).log();
                Angles { count: 3, q, by_turn: Mat3::identity(), off_axis: zero, normals: [zero; 3] }
            }
            Turns::Slide(..) => {
                Angles { count: 0, q: [0.0; 3], by_turn: Mat3::identity(), off_axis: zero, normals: [zero; 3] }
            }
            Turns::Hinges(hinges) if hinges.len() == 1 => one_hinge(&hinges[0], rotation, guess[0]),
            Turns::Hinges(hinges) => self.some_hinges(hinges, rotation, guess),
        }
    }

    fn some_hinges(&self, hinges: &[Hinge], rotation: &Mat3<f64>, guess: [f64; 3]) -> Angles {
        let near = self.search(hinges, rotation, guess);
        // From a wrong side of a singular posture a search may stop: the other solution of three hinges, and zero.
        let (size, mut best) = (square(near.off_axis), near);
        if size > 1e-6 && hinges.len() == 3 {
            let others = [[0.0; 3], [guess[0] + 3.0, -guess[1], guess[2] + 3.0], [-guess[0], guess[1], -guess[2]]];
            for other in others.map(|q| self.search(hinges, rotation, q)) {
                if square(other.off_axis) < square(best.off_axis) {
                    best = other;
                }
            }
        }
        for (q, guess) in best.q.iter_mut().zip(guess) {
            *q = nearest(*q, guess);
        }
        best
    }

    /// Angular acceleration of the child in its own axes, rad/s2, by steady rates of the angles, rad/s: later hinges turn the axes of earlier ones.
    pub fn coupling(&self, q: [f64; 3], rates: [f64; 3]) -> Vec3<f64> {
        let Turns::Hinges(hinges) = self else { return Vec3([0.0; 3]) };
        let (mut coupling, mut later) = (Vec3([0.0; 3]), Vec3([0.0; 3]));
        for (axis, rate) in self.axes(hinges, q).into_iter().zip(rates).take(hinges.len()).rev() {
            coupling += (axis * rate).cross(later);
            later += axis * rate;
        }
        coupling
    }

    fn search(&self, hinges: &[Hinge], rotation: &Mat3<f64>, mut q: [f64; 3]) -> Angles {
        let mut axes = self.axes(hinges, q);
        let mut by_turn = inverse(&axes, hinges.len());
        let mut off_axis = Vec3([0.0; 3]);
        for _ in 0..STEPS {
            off_axis = Vec3(Turn::of(&self.rotation(q).transposed().times(rotation)).log());
            let step = by_turn.apply(off_axis).0;
            q.iter_mut().zip(step).take(hinges.len()).for_each(|(q, s)| *q += s);
            axes = self.axes(hinges, q);
            by_turn = inverse(&axes, hinges.len());
            if step.iter().all(|s| s.abs() < 1e-10) {
                break;
            }
        }
        let normals = match hinges.len() {
            0 => Mat3::identity().0.map(Vec3),
            2 => [unit(axes[0].cross(axes[1])), Vec3([0.0; 3]), Vec3([0.0; 3])],
            _ => [Vec3([0.0; 3]); 3],
        };
        Angles { count: hinges.len(), q, by_turn, off_axis, normals }
    }

    /// Axes of the hinges in the child's axes.
    fn axes(&self, hinges: &[Hinge], q: [f64; 3]) -> [Vec3<f64>; 3] {
        let mut axes = [Vec3([0.0; 3]); 3];
        let mut after = Mat3::identity();
        for (k, h) in hinges.iter().enumerate().rev() {
            axes[k] = after.apply_transposed(Vec3([0.0, 0.0, h.sign]));
            after = h.entry.times(&Mat3::about_z(h.sign * q[k])).times(&after);
        }
        axes
    }
}

fn unit(v: Vec3<f64>) -> Vec3<f64> {
    v * (1.0 / square(v).sqrt().max(1e-12))
}

fn nearest(angle: f64, guess: f64) -> f64 {
    angle - TAU * ((angle - guess) / TAU).round()
}

fn one_hinge(hinge: &Hinge, rotation: &Mat3<f64>, guess: f64) -> Angles {
    let m = hinge.entry.transposed().times(rotation);
    let angle = (m.0[1][0] - m.0[0][1]).atan2(m.0[0][0] + m.0[1][1]);
    let off_axis = Turn::of(&Mat3::about_z(angle).transposed().times(&m)).log();
    let by_turn = Mat3([[0.0, 0.0, hinge.sign], [0.0; 3], [0.0; 3]]);
    let normals = [Vec3([1.0, 0.0, 0.0]), Vec3([0.0, 1.0, 0.0]), Vec3([0.0; 3])];
    let q = [nearest(hinge.sign * angle, guess), 0.0, 0.0];
    Angles { count: 1, q, by_turn, off_axis: Vec3(off_axis), normals }
}

/// (J'J + damping)^-1 J' of the columns `axes`, the first `count` of which are used.
fn inverse(axes: &[Vec3<f64>; 3], count: usize) -> Mat3<f64> {
    let gram = nalgebra::Matrix3::from_fn(|i, j| match (i < count && j < count, i == j) {
        (true, same) => dot(axes[i], axes[j]) + if same { DAMPING } else { 0.0 },
        (false, same) => f64::from(u8::from(same)),
    });
    let inverse = gram.try_inverse().unwrap_or_else(nalgebra::Matrix3::identity);
    let mut out = [[0.0; 3]; 3];
    for (i, row) in out.iter_mut().enumerate().take(count) {
        for (k, x) in row.iter_mut().enumerate() {
            *x = (0..count).map(|j| inverse[(i, j)] * axes[j].0[k]).sum();
        }
    }
    Mat3(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hinges(count: usize) -> Turns {
        let entries = [Mat3::about_x(0.4), Mat3::about_x(1.3), Mat3::about_y(-1.2)];
        let hinge = |k: usize| Hinge { coordinate: k, sign: if k == 1 { -1.0 } else { 1.0 }, entry: entries[k] };
        Turns::Hinges((0..count).map(hinge).collect())
    }

    /// Newton's last step is below 1e-10, and damping leaves 1e-5 of that.
    const FOUND: f64 = 1e-9;

    #[test]
    fn angles_of_a_rotation_are_those_that_made_it() {
        for count in 1..=3 {
            let (turns, q) = (hinges(count), [0.7, -0.4, 0.9]);
            let found = turns.angles(&turns.rotation(q), [0.2, -0.1, 0.3]);
            let far = found.q.iter().zip(q).take(count).any(|(found, q)| (found - q).abs() > FOUND);
            assert!(!far, "{count}: {:?}", found.q);
            assert!(square(found.off_axis) < FOUND);
        }
    }

    #[test]
    fn a_small_turn_changes_them_by_their_derivative() {
        for count in 1..=3 {
            let (turns, q, turn) = (hinges(count), [0.7, -0.4, 0.9], [1e-6, -2e-6, 3e-6]);
            let before = turns.angles(&turns.rotation(q), q);
            let after = turns.angles(&turns.rotation(q).times(&Mat3::about(Vec3(turn))), q);
            let change = before.by_turn.apply(Vec3(turn)).0;
            // The turn squared, and the damping's share of it.
            let off = |k: usize| (after.q[k] - before.q[k] - change[k]).abs();
            assert!((0..count).all(|k| off(k) < 1e-10), "{count}: {change:?}");
        }
    }

    /// Angles that move with known rates and accelerations: the child's angular velocity is the sum of axes times rates, its change a difference.
    #[test]
    fn accelerations_of_angles_are_those_of_the_movement() {
        for count in 1..=3 {
            let (turns, q, rates, pushes) = (hinges(count), [0.7, -0.4, 0.9], [2.0, -1.5, 3.0], [-4.0, 6.0, 5.0]);
            let Turns::Hinges(all) = &turns else { unreachable!("hinges are hinges") };
            let spin = |t: f64| {
                let at = [0, 1, 2].map(|k| q[k] + rates[k] * t + 0.5 * pushes[k] * t * t);
                let axes = turns.axes(all, at);
                (0..count).fold(Vec3([0.0; 3]), |sum, k| sum + axes[k] * (rates[k] + pushes[k] * t))
            };
            let (h, now) = (1e-5, turns.angles(&turns.rotation(q), q));
            let slope = (spin(h) - spin(-h)) * (0.5 / h);
            let turning = slope - turns.coupling(now.q, rates);
            // A difference at 1e-5 s of rates up to 3 rad/s, and the damping.
            let off = |k: usize| (dot(Vec3(now.by_turn.0[k]), turning) - pushes[k]).abs();
            assert!((0..count).all(|k| off(k) < 1e-3), "{count}: {:?}", [0, 1, 2].map(off));
        }
    }
}
