//! The tree as rigid pieces: everything fixed to one joint's child moves as one, so constant transforms are combined
//! once.
//!
//! A piece may have any axes. After a hinge or slide along an axis of its parent it has axes parallel to the parent's
//! at zero angle, so that only the joint lies between the two.

use super::{Fixed, Link, Moved, Swap, Tree};
use crate::model::{JointKind, Point};
use crate::rotation::Mat3;

/// Everything that one joint moves, up to the next joints.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// The frame with the joint.
    pub frame: usize,
    /// The piece that carries the joint; the root is piece 0.
    pub parent: usize,
    /// Position of the joint in the parent's axes, from the parent's origin.
    pub arm: Point,
    pub ways: Ways,
    pub joint: Option<Moved>,
}

/// Axes of a joint.
#[derive(Debug, Clone)]
pub(super) struct Ways {
    /// Rotation from the joint's axes to the parent's, if they differ.
    pub entry: Option<Mat3<f64>>,
    /// Hinges and slides: index of the axis, and its sign.
    pub axis: usize,
    pub flip: f64,
    /// Rotation from the axes of the frame after the joint to the piece's, if they differ.
    pub home: Option<Mat3<f64>>,
}

impl Ways {
    /// About the z axis of the axes given by `entry`.
    fn of(entry: &Fixed, kind: JointKind) -> Self {
        let scalar = matches!(kind, JointKind::Hinge | JointKind::Slide);
        match entry.swap {
            Swap::Nothing => Ways { entry: None, axis: 2, flip: 1.0, home: None },
            Swap::Axes([_, _, (axis, flip)]) if scalar => Ways { entry: None, axis, flip, home: Some(entry.rotation) },
            _ => Ways { entry: Some(entry.rotation), axis: 2, flip: 1.0, home: None },
        }
    }
}

/// Place of a frame on its piece.
#[derive(Debug, Clone)]
pub struct Home {
    /// The piece that it belongs to.
    pub piece: usize,
    /// Piece from frame.
    pub rotation: Mat3<f64>,
    /// The frame's origin, m.
    pub origin: Point,
}

impl Home {
    /// A point of the frame in the piece's axes.
    pub fn point(&self, point: &Point) -> Point {
        self.origin.and_then(&self.rotation, point)
    }

    fn behind(&self, fixed: &Option<Fixed>) -> Home {
        let Some(fixed) = fixed else { return self.clone() };
        let (rotation, origin) = (self.rotation.times(&fixed.rotation), self.point(&fixed.translation));
        Home { piece: self.piece, rotation, origin }
    }
}

/// All pieces of a tree, the root first.
#[derive(Debug, Clone)]
pub struct Pieces {
    pub(super) pieces: Vec<Piece>,
    /// Place of every frame on its piece.
    pub homes: Vec<Home>,
}

impl Pieces {
    /// The pieces of a tree.
    pub fn new(tree: &Tree) -> Self {
        let here = Fixed::new(Mat3::identity(), Point::fixed([0.0; 3]));
        let ways = Ways::of(&here, JointKind::Fixed);
        let root = Piece { frame: 0, parent: 0, arm: here.translation, ways, joint: None };
        let mut found = Pieces { pieces: vec![root], homes: Vec::new() };
        found.homes.push(Home { piece: 0, rotation: Mat3::identity(), origin: Point::fixed([0.0; 3]) });
        for (i, link) in tree.links.iter().enumerate().skip(1) {
            let home = found.home(i, link);
            found.homes.push(home);
        }
        found
    }

    fn home(&mut self, frame: usize, link: &Link) -> Home {
        let before = self.homes[link.parent].behind(&link.before);
        let Some(joint) = link.joint.filter(|j| j.kind != JointKind::Fixed) else {
            return before.behind(&link.after);
        };
        let entry = Fixed::new(before.rotation, before.origin);
        let ways = Ways::of(&entry, joint.kind);
        let rotation = ways.home.unwrap_or(Mat3::identity());
        self.pieces.push(Piece { frame, parent: before.piece, arm: entry.translation, ways, joint: Some(joint) });
        let own = Home { piece: self.len() - 1, rotation, origin: Point::fixed([0.0; 3]) };
        own.behind(&link.after)
    }

    /// Number of pieces, including the root.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// False: there is always the root.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// The frame with a piece's joint.
    pub fn frame(&self, piece: usize) -> usize {
        self.pieces[piece].frame
    }

    /// The piece that carries another.
    pub fn parent(&self, piece: usize) -> usize {
        self.pieces[piece].parent
    }
}
