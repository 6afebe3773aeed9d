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
                pieces.all.push(piece);
                home = Home { piece: pieces.all.len() - 1, rotation: here, origin: zero };
            }
            let (rotation, origin) = step(&frame.after);
            home.origin += home.rotation.apply(origin);
            home.rotation = home.rotation.times(&rotation);
            pieces.homes.push(home);
        }
        pieces
    }
}
