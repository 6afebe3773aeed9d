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
