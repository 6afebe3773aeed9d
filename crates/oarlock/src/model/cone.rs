//! Range of a ball joint: a cone for the swing of one axis of the child, and the twist about that axis.
//!
//! The rotation from rest is a twist about the axis, then a swing about a line perpendicular to it (Dobrowolski 2015).
//! `Joint` contains it; the start, the notes and the description of a model use it.

/// An elliptic cone and a range of twist, both counted from rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// The child's axis that lies in the cone: 0, 1 or 2 for x, y, z.
    pub axis: usize,
    /// Largest swing about the two other axes, in the order x, y, z, rad.
    pub swing: [f64; 2],
    /// Least and largest twist about `axis`, rad.
    pub twist: [f64; 2],
}

/// How far a rotation is beyond a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beyond {
    /// Angle beyond the nearest limit, rad; negative inside.
    pub angle: f64,
    /// Width of the range in this direction, rad.
    pub range: f64,
}

impl Beyond {
    /// As a share of the range.
    pub fn share(&self) -> f64 {
        self.angle / self.range
    }
}

impl Cone {
    /// The two axes that are not its own, in the order x, y, z.
    fn others(&self) -> [usize; 2] {
        [[1, 2], [0, 2], [0, 1]][self.axis]
    }

    /// The narrowest symmetric range that contains the limits of every coordinate, rad.
    pub fn widest(&self) -> [f64; 2] {
        let most = self.swing.iter().chain(&self.twist).fold(0.0f64, |most, x| most.max(x.abs()));
        [-most, most]
    }

    /// Soft limits of one coordinate of the rotation vector from rest.
    pub fn limits_about(&self, coordinate: usize) -> [f64; 2] {
        match self.others().iter().position(|&k| k == coordinate) {
            Some(k) => [-self.swing[k], self.swing[k]],
            None => self.twist,
        }
    }

    /// Swing about the two other axes and twist of a rotation vector from rest, at most half a turn long.
    pub fn parts(&self, r: [f64; 3]) -> ([f64; 2], f64) {
        let angle = r.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (sin, cos) = (0.5 * angle).sin_cos();
        let scale = if angle > 0.0 { sin / angle } else { 0.5 };
        let [a, b] = self.others();
        let (along, across) = (scale * r[self.axis], [scale * r[a], scale * r[b]]);
        // The rotation is the swing after the twist, so the swing's axis is turned by half the twist.
        let half_twist = along.atan2(cos);
        let swing = 2.0 * across[0].hypot(across[1]).atan2(along.hypot(cos));
        // x, z in this order are left-handed about y.
        let (s, c) = (if self.axis == 1 { -half_twist } else { half_twist }).sin_cos();
        let (u, v) = (c * across[0] - s * across[1], s * across[0] + c * across[1]);
        let length = u.hypot(v);
        let unit = if length > 0.0 { [u / length, v / length] } else { [0.0; 2] };
        (unit.map(|x| x * swing), 2.0 * half_twist)
    }

    /// How far a rotation vector from rest is beyond the cone or the twist, whichever is the larger share of its range.
    pub fn beyond(&self, r: [f64; 3]) -> Beyond {
        let ([a, b], twist) = self.parts(r);
        let swing = a.hypot(b);
        // The ellipse's radius in the direction of the swing is swing / depth.
        let depth = (a / self.swing[0]).hypot(b / self.swing[1]);
        let most = if depth > 0.0 { swing / depth } else { self.swing[0].min(self.swing[1]) };
        let swung = Beyond { angle: swing - most, range: 2.0 * most };
        let [low, high] = self.twist;
        let twisted = Beyond { angle: (twist - high).max(low - twist), range: high - low };
        if swung.share() > twisted.share() {
            swung
        } else {
            twisted
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{UnitQuaternion, Vector3};
    use std::f64::consts::PI;

    /// The rotation vector of a twist about an axis and then a swing, composed by nalgebra.
    fn composed(axis: usize, swing: [f64; 2], twist: f64) -> [f64; 3] {
        let [a, b] = [[1, 2], [0, 2], [0, 1]][axis];
        let (mut line, mut along) = (Vector3::zeros(), Vector3::zeros());
        (line[a], line[b], along[axis]) = (swing[0], swing[1], twist);
        let turned = UnitQuaternion::from_scaled_axis(line) * UnitQuaternion::from_scaled_axis(along);
        turned.scaled_axis().into()
    }

    #[test]
    fn parts_are_those_of_a_twist_and_then_a_swing() {
        let swings = [[0.0, 0.0], [1e-9, -2e-9], [0.3, 0.0], [0.0, -1.2], [-0.7, 0.9], [2.0, 1.5]];
        let cone = |axis| Cone { axis, swing: [1.0; 2], twist: [-1.0, 1.0] };
        for axis in 0..3 {
            for swing in swings {
                for twist in [0.0, 1e-10, 0.4, -1.7, 3.0, -3.1] {
                    let (swung, twisted) = cone(axis).parts(composed(axis, swing, twist));
                    let gaps = [swung[0] - swing[0], swung[1] - swing[1], twisted - twist];
                    assert!(gaps.iter().all(|g| g.abs() < 1e-13), "{axis} {swing:?} {twist}: {gaps:?}");
                }
            }
        }
    }

    #[test]
    fn beyond_is_the_angle_to_the_ellipse_or_to_the_end_of_the_twist() {
        let cone = Cone { axis: 2, swing: [0.5, 1.0], twist: [-0.3, 0.9] };
        let beyond = |swing, twist| cone.beyond(composed(2, swing, twist));
        // The ellipse's radius at 45 degrees: 1 / sqrt(0.5 / 0.5^2 + 0.5 / 1^2).
        let edge = (2.0f64 / 5.0).sqrt();
        let slanted = |angle: f64| [angle / 2f64.sqrt(), angle / 2f64.sqrt()];
        for (swing, twist, angle, range) in [
            ([0.7, 0.0], 0.2, 0.2, 1.0),
            ([0.0, -1.3], 0.2, 0.3, 2.0),
            (slanted(edge + 0.1), 0.0, 0.1, 2.0 * edge),
            ([0.1, 0.1], 1.0, 0.1, 1.2),
            ([0.1, 0.1], -0.8, 0.5, 1.2),
            ([0.6, 0.0], -0.8, 0.5, 1.2),
        ] {
            let found = beyond(swing, twist);
            let gaps = [found.angle - angle, found.range - range];
            assert!(gaps.iter().all(|g| g.abs() < 1e-13), "{swing:?} {twist}: {found:?}");
        }
        assert!(beyond([0.0, 0.0], 0.0).angle < 0.0 && beyond([0.3, 0.5], 0.8).angle < 0.0);
        let all = Cone { axis: 1, swing: [PI; 2], twist: [-PI, PI] };
        assert!(all.beyond([0.0, PI, 0.0]).angle <= 0.0 && all.beyond([0.0, 0.0, -PI]).angle <= 0.0);
    }

    #[test]
    fn limits_of_coordinates_are_those_of_swing_and_twist() {
        let cone = Cone { axis: 1, swing: [0.5, 1.0], twist: [-0.3, 0.9] };
        assert_eq!([0, 1, 2].map(|k| cone.limits_about(k)), [[-0.5, 0.5], [-0.3, 0.9], [-1.0, 1.0]]);
        assert_eq!(cone.widest(), [-1.0, 1.0]);
    }
}
