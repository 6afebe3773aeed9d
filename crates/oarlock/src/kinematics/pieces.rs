//! The tree as rigid pieces: whatever is fixed behind a joint moves with it as one, so what is constant between two joints
//! is put together when the tree is made.
//!
//! A piece may take any axes. Behind a hinge or slide along an axis of its parent it takes the parent's own, turned or moved along with
//! the joint, so that nothing but the joint lies between the two.

use super::{Fixed, Link, Moved, Swap, Tree};
use crate::model::{JointKind, Point};
use crate::rotation::Mat3;

/// All that one joint moves, up to the next ones.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// The frame that has the joint.
    pub frame: usize,
    /// The piece that carries the joint; pieces count from the root, which is the first.
    pub parent: usize,
    /// From the parent's origin to the joint, in the parent's axes.
    pub arm: Point,
    pub ways: Ways,
    pub joint: Option<Moved>,
}

/// In which axes a joint turns.
#[derive(Debug, Clone)]
pub(super) struct Ways {
    /// Parent from the axes in which it turns, where these are not the parent's own.
    pub entry: Option<Mat3<f64>>,
    /// Along or about which of them, and whether the other way round: of hinges and slides.
    pub axis: usize,
    pub flip: f64,
    /// The piece's axes from the frame's behind the joint, where these are not the same.
    pub home: Option<Mat3<f64>>,
}

impl Ways {
    /// About the z axis of what `entry` leads to.
    fn of(entry: &Fixed, kind: JointKind) -> Self {
        let scalar = matches!(kind, JointKind::Hinge | JointKind::Slide);
        match entry.swap {
            Swap::Nothing => Ways { entry: None, axis: 2, flip: 1.0, home: None },
            Swap::Axes([_, _, (axis, flip)]) if scalar => Ways { entry: None, axis, flip, home: Some(entry.rotation) },
            _ => Ways { entry: Some(entry.rotation), axis: 2, flip: 1.0, home: None },
        }
    }
}

/// Where a frame is fixed.
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
    /// Of every frame.
    pub homes: Vec<Home>,
}

impl Pieces {
    /// Of a tree.
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

    /// How many there are, the root included.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// There is at least the root.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// The frame that has a piece's joint.
    pub fn frame(&self, piece: usize) -> usize {
        self.pieces[piece].frame
    }

    /// The piece that carries another.
    pub fn parent(&self, piece: usize) -> usize {
        self.pieces[piece].parent
    }
}
