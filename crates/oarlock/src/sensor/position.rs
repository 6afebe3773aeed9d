//! Position sensor: reads a point of a frame in root axes.

use super::kind::{Described, Kind, Pending, Reads, Sits};
use super::near::{Homes, Nearby};
use super::slopes::{write_sides, Answers, Found, Group, Moving};
use super::{Fit, Quantity, RowGroups, Scene};
use crate::kernels::lane::Real;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::{Reach, Wanted};
use crate::model::section::{Known, Section};
use crate::model::{Expr, Point};
use serde_json::{json, Value};

/// A position sensor of a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Position {
    /// Index of the frame.
    pub frame: usize,
    /// Point in the frame, m.
    pub point: [Expr; 3],
    /// Standard deviation, m.
    pub std_m: f64,
}

impl Kind for Position {
    const NAME: &'static str = "position";
    const KEYS: Known = &["frame", "point", "std_m"];
    type Reader = PositionReader;

    fn read(section: &Section) -> Pending<Self> {
        let frame = section.need_reference("frame", "\"r_wrist\"");
        let point = section.point("point");
        let std_m = section.need_positive("std_m", "0.002", "m");
        Box::new(move |at| Some(Position { frame: at.frame("frame", &frame)?, point, std_m }))
    }

    fn describe(&self, at: &Described) -> Value {
        json!({"frame": at.frame(self.frame), "std_m": self.std_m, "point": at.point(&self.point)})
    }

    fn reader(&self, fit: &Fit) -> Option<PositionReader> {
        Some(PositionReader { frame: self.frame, point: fit.point(&self.point), std_m: self.std_m })
    }

    fn points(&self) -> Vec<&[Expr; 3]> {
        vec![&self.point]
    }
}

/// A position sensor at one set of parameters.
#[derive(Debug, Clone)]
pub struct PositionReader {
    frame: usize,
    point: Point,
    std_m: f64,
}

impl Reads for PositionReader {
    type Seat = PositionSeat;

    fn rows(&self) -> RowGroups {
        vec![(Quantity::Position, &["x", "y", "z"], vec![self.std_m; 3])]
    }

    fn mark_frames(&self, needed: &mut [bool]) {
        needed[self.frame] = true;
    }

    #[inline(always)]
    fn predict<T: Real>(&self, scene: &Scene<T>, out: &mut [T]) {
        [out[0], out[1], out[2]] = scene.place(self.frame, &self.point).0;
    }

    fn causes(&self, row: usize, answers: &Answers) -> Vec<Found> {
        let columns = answers.place(self.frame, &self.point, 0);
        vec![Found { row, count: 3, part: 0, columns }]
    }

    #[inline(always)]
    fn slopes<const FUSED: bool>(&self, groups: &[Group], at: Moving, out: &mut SparseJacobian) {
        for group in groups {
            write_sides(group, at, &[(self.frame, &self.point)], out);
        }
    }

    fn seat(&self, row: usize, homes: &Homes) -> (PositionSeat, Reach) {
        let (piece, point) = homes.place(self.frame, &self.point);
        let reach = homes.reach(self.frame, homes.own(&point));
        (PositionSeat { row, piece, point }, reach)
    }
}

/// A position sensor on its rigid piece.
#[derive(Debug, Clone)]
pub struct PositionSeat {
    row: usize,
    piece: usize,
    point: Point,
}

impl Sits for PositionSeat {
    fn mark(&self, wanted: &mut [Wanted]) {
        wanted[self.piece].place = true;
    }

    #[inline(always)]
    fn predict<const FUSED: bool>(&self, mut near: Nearby<FUSED>) {
        if near.posed {
            let place = near.place(self.piece, &self.point);
            near.put(self.row, place);
        } else {
            near.keep(Some(self.row), 3);
        }
    }
}
