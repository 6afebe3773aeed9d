//! The tree of a model as rigid pieces with the axes behind their joints. `skeleton` makes links of them.

use crate::body::Body;
use crate::model::JointKind;
use crate::rotation::{Mat3, Vec3};

/// Everything that one joint moves.
pub struct Piece {
    pub frame: usize,
    pub parent: usize,
    pub joint: (usize, f64),
    pub arm: Vec3<f64>,
    pub entry: Mat3<f64>,
}

impl Piece {
    /// Whether the same joint moves another piece in the same way.
    fn moves_as(&self, other: &Piece) -> bool {
        let near = |a: &Vec3<f64>, b: &Vec3<f64>| a.0.iter().zip(b.0).all(|(a, b)| (a - b).abs() < 1e-9);
        let rows = || self.entry.0.iter().zip(other.entry.0).all(|(a, b)| near(&Vec3(*a), &Vec3(b)));
        self.parent == other.parent && self.joint == other.joint && near(&self.arm, &other.arm) && rows()
    }
}

pub struct Home {
    pub piece: usize,
    pub rotation: Mat3<f64>,
    pub origin: Vec3<f64>,
}

/// The tree as rigid pieces with the axes behind their joints.
pub struct Pieces {
    pub all: Vec<Piece>,
    pub homes: Vec<Home>,
}

impl Pieces {
    /// A joint that moves several pieces.
    pub fn shared_joint(&self) -> Option<usize> {
        let mut joints: Vec<usize> = self.all.iter().skip(1).map(|p| p.joint.0).collect();
        joints.sort_unstable();
        joints.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0])
    }

    /// Of a body at its parameters.
    pub fn of(body: &Body) -> Self {
        let (here, zero) = (Mat3::identity(), Vec3([0.0; 3]));
        let mut pieces = Pieces {
            all: vec![Piece { frame: 0, parent: 0, joint: (0, 1.0), arm: zero, entry: here }],
            homes: vec![Home { piece: 0, rotation: here, origin: zero }],
        };
        for (i, frame) in body.model.frames.iter().enumerate().skip(1) {
            let step = |t: &Option<crate::model::Transform>| {
                t.as_ref().map_or((here, zero), |t| {
                    let (rotation, origin) = t.evaluate(&body.parameters);
                    (rotation, Vec3(origin))
                })
            };
            let parent = &pieces.homes[frame.parent];
            let (rotation, origin) = step(&frame.before);
            let mut home = Home {
                piece: parent.piece,
                origin: parent.origin + parent.rotation.apply(origin),
                rotation: parent.rotation.times(&rotation),
            };
            if let Some((joint, sign)) = frame.joint.filter(|(j, _)| body.model.joints[*j].kind != JointKind::Fixed) {
                let piece = Piece {
                    frame: i,
                    parent: home.piece,
                    joint: (joint, sign),
                    arm: home.origin,
                    entry: home.rotation,
                };
                let same = pieces.all.iter().skip(1).position(|p| p.moves_as(&piece)).map(|before| before + 1);
                let number = same.unwrap_or_else(|| {
                    pieces.all.push(piece);
                    pieces.all.len() - 1
                });
                home = Home { piece: number, rotation: here, origin: zero };
            }
            let (rotation, origin) = step(&frame.after);
            home.origin += home.rotation.apply(origin);
            home.rotation = home.rotation.times(&rotation);
            pieces.homes.push(home);
        }
        pieces
    }
}
