//! The tree as rigid pieces: whatever is fixed behind a joint moves with it as one, so what is constant between two joints
//! is put together when the tree is made.

use super::{Fixed, Link, Moved, Swap, Tree};
use crate::model::{JointKind, Point};
use crate::rotation::Mat3;

/// All that one joint moves, up to the next ones. Its axes are those behind its joint.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// The frame that has the joint.
    pub frame: usize,
    /// The piece that carries the joint; pieces count from the root, which is the first.
    pub parent: usize,
    /// From the parent's axes to the joint's.
    pub entry: Fixed,
    pub facing: Option<Facing>,
    pub joint: Option<Moved>,
}

/// Which axis of the parent each axis of a joint is, and its sign.
#[derive(Debug, Clone)]
pub(super) struct Facing {
    pub axes: [usize; 3],
    pub signs: [f64; 3],
}

impl Facing {
    /// `None` where they are no axes of it.
    fn of(entry: &Fixed) -> Option<Self> {
        let axes = match entry.swap {
            Swap::Nothing => [(0, 1.0), (1, 1.0), (2, 1.0)],
            Swap::Axes(axes) => axes,
            Swap::Anything => return None,
        };
        Some(Facing { axes: axes.map(|a| a.0), signs: axes.map(|a| a.1) })
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
        let here = || Fixed::new(Mat3::identity(), Point::fixed([0.0; 3]));
        let root = Piece { frame: 0, parent: 0, facing: Facing::of(&here()), entry: here(), joint: None };
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
        self.pieces.push(Piece { frame, parent: before.piece, facing: Facing::of(&entry), entry, joint: Some(joint) });
        let own = Home { piece: self.len() - 1, rotation: Mat3::identity(), origin: Point::fixed([0.0; 3]) };
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
