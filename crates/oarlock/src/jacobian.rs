//! Exact derivatives of frames and readings by all coordinates and lengths, for callers that are no filter.

use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::slopes::{Columns, Kind, Slopes};
use crate::kinematics::{FrameMotion, JointMotion, Tree};
use crate::model::{Expr, JointKind, Model, Transform};
use crate::rotation::{Mat3, Vec3};
use crate::sensor::slopes::{Causes, Moving, Places};
use crate::sensor::{Suite, Wearing, Worn};

/// Joint coordinates of one instant, their rates, and lengths; see [`JointMotion`].
#[derive(Debug, Clone, Copy)]
pub struct Instant<'a> {
    /// rad or m.
    pub q: &'a [f64],
    /// Per s.
    pub qd: &'a [f64],
    /// Per s2.
    pub qdd: &'a [f64],
    /// m.
    pub lengths: &'a [f64],
}

/// A model at its parameters' values, with a column for every coordinate, rate, acceleration and length, in this order.
#[derive(Debug, Clone)]
pub struct Jacobians {
    tree: Tree,
    suite: Suite,
    slopes: Slopes,
    straight: SparseJacobian,
    causes: Causes,
    lengths: Vec<f64>,
    /// An orientation is read against that of the root.
    references: Vec<Mat3<f64>>,
    coordinates: usize,
}

/// Room for one instant.
#[derive(Debug, Clone)]
pub struct Room {
    slopes: Slopes,
    straight: SparseJacobian,
    frames: Vec<FrameMotion<f64>>,
    all: Vec<bool>,
}

/// Indices of the parameters that are lengths: some place follows from them, and no rotation.
pub fn lengths_of(model: &Model) -> Vec<usize> {
    let transforms = || model.frames.iter().flat_map(|f| [&f.before, &f.after]).flatten();
    let turning: Vec<usize> = transforms().flat_map(Transform::turned_by).collect();
    let moving: Vec<usize> = transforms().flat_map(Transform::moved_by).chain(points_moved_by(model)).collect();
    (0..model.parameters.len()).filter(|i| moving.contains(i) && !turning.contains(i)).collect()
}

/// Parameters that the points of sensors and closures read.
fn points_moved_by(model: &Model) -> Vec<usize> {
    let of_sensors = model.sensors.iter().flat_map(|s| s.kind.points());
    let of_closures = model.closures.iter().flat_map(|c| c.sides.iter().map(|(_, point)| point));
    of_sensors.chain(of_closures).flatten().flat_map(Expr::parameters).collect()
}

impl Jacobians {
    /// Of a model with these values of its parameters and with the mounts of its file.
    pub fn new(model: &Model, parameters: &[f64]) -> Self {
        let estimated = lengths_of(model);
        let wearing = Wearing { parameters, estimated: &estimated, mounts: &[], headings: &[] };
        let suite = Suite::worn(model, &wearing, &vec![None; model.sensors.len()]);
        let tree = Tree::with_lengths(model, parameters, &estimated);
        let n = model.coordinate_count();
        let lengths: Vec<usize> = (3 * n..3 * n + estimated.len()).collect();
        let slopes = tree.slopes(Columns { coordinates: columns(model), lengths: lengths.clone() });
        let coordinates = (0..n).map(Some).collect();
        let places = Places { coordinates, lengths, ..Places::default() };
        let (straight, causes) = suite.causes(3 * n, &slopes, &places);
        let values = estimated.iter().map(|&i| parameters[i]).collect();
        let references = vec![Mat3::identity(); suite.sources.len()];
        Jacobians { tree, suite, slopes, straight, causes, lengths: values, references, coordinates: n }
    }

    /// How many coordinates there are.
    pub fn coordinate_count(&self) -> usize {
        self.coordinates
    }

    /// Values of the lengths, m.
    pub fn lengths(&self) -> &[f64] {
        &self.lengths
    }

    /// The body, whose lengths come with every motion.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// How many lengths there are.
    pub fn length_count(&self) -> usize {
        self.lengths.len()
    }

    /// How many rows of readings there are.
    pub fn row_count(&self) -> usize {
        self.suite.len()
    }

    /// Columns of all rows: coordinates, rates, accelerations, lengths.
    pub fn width(&self) -> usize {
        3 * self.coordinates + self.lengths.len()
    }

    /// Room to work in.
    pub fn room(&self) -> Room {
        Room {
            slopes: self.slopes.clone(),
            straight: self.straight.clone(),
            frames: vec![FrameMotion::resting(Vec3([0.0; 3])); self.tree.len()],
            all: vec![true; self.tree.len().max(self.suite.sources.len())],
        }
    }

    /// Goes to a posture of a root that moves as `root`.
    pub fn stand(&self, root: FrameMotion<f64>, at: Instant, room: &mut Room) {
        let joints = JointMotion { q: at.q, qd: at.qd, qdd: at.qdd, lengths: at.lengths, anchors: &[] };
        let Room { slopes, frames, all, .. } = room;
        self.tree.motions_with_slopes(root, joints, &all[..self.tree.len()], frames, slopes);
    }

    /// Of a frame where the body stands, root axes: its origin's move by every column (m per unit; 3 rows of `width`), then
    /// its turn (rad per unit).
    pub fn frame(&self, frame: usize, room: &Room, out: &mut [f64]) {
        out.fill(0.0);
        let (width, place) = (self.width(), room.frames[frame].position);
        for number in room.slopes.chain(frame) {
            let slope = room.slopes.slope(number);
            if !matches!(slope.kind, Kind::Turn | Kind::Shift) {
                continue;
            }
            for (row, x) in slope.place(place).0.into_iter().chain(slope.turn.0).enumerate() {
                out[row * width + slope.column] += x;
            }
        }
    }

    /// Of every reading where the body stands in this magnetic field (uT, root axes): `row_count` rows of `width`.
    /// At the model's own lengths.
    pub fn readings(&self, magnetic_field: Vec3<f64>, room: &mut Room, out: &mut [f64]) {
        let Room { slopes, straight, frames, all } = room;
        let active = &all[..self.suite.sources.len()];
        let worn = Worn { lengths: &self.lengths, mounts: &[], headings: &[] };
        let magnetic_slope = Vec3([0.0; 3]);
        let at = Moving { frames, slopes, worn, magnetic_field, magnetic_slope, references: &self.references };
        self.suite.slopes::<false>(&self.causes, at, active, straight);
        self.suite.scatter(&self.causes, active, straight, self.width(), out);
    }
}

/// Columns of every coordinate that moves something.
fn columns(model: &Model) -> Vec<[Option<(usize, f64)>; 3]> {
    let n = model.coordinate_count();
    let mut found = vec![[None; 3]; n];
    for joint in model.joints.iter().filter(|j| j.kind != JointKind::Fixed) {
        joint.coordinates().for_each(|c| found[c] = [0, 1, 2].map(|order| Some((order * n + c, 1.0))));
    }
    found
}
