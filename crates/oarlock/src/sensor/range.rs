//! Range sensor: distance between two points of the body, or between the body and its surroundings.

use super::kind::{read_sides, Described, Kind, Pending, Reads, Sits};
use super::near::{Homes, Nearby};
use super::slopes::{moved, Answers, Found, Group, Moving};
use super::{Fit, Quantity, RowGroups, Scene, Sides};
use crate::kernels::lane::Real;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::{Reach, Wanted};
use crate::model::section::{Known, Section};
use crate::model::{Expr, Point};
use crate::rotation::Vec3;
use serde_json::{json, Value};

/// A range sensor of a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Range {
    /// Frame and point (m) of each end.
    pub ends: Sides<[Expr; 3]>,
    /// Standard deviation, m.
    pub std_m: f64,
}

impl Kind for Range {
    const NAME: &'static str = "range";
    const KEYS: Known = &["frame_a", "point_a", "frame_b", "point_b", "std_m"];
    type Reader = RangeReader;

    fn read(section: &Section) -> Pending<Self> {
        let ends = read_sides(section, "\"seat\"");
        let std_m = section.need_positive("std_m", "0.005", "m");
        Box::new(move |at| Some(Range { ends: ends(at, "a distance")?, std_m }))
    }

    fn describe(&self, at: &Described) -> Value {
        let [(a, point_a), (b, point_b)] = &self.ends;
        json!({"frame_a": at.frame(*a), "point_a": at.point(point_a),
            "frame_b": at.frame(*b), "point_b": at.point(point_b), "std_m": self.std_m})
    }

    fn reader(&self, fit: &Fit) -> Option<RangeReader> {
        Some(RangeReader { ends: fit.sides(&self.ends), std_m: self.std_m })
    }

    fn points(&self) -> Vec<&[Expr; 3]> {
        self.ends.iter().map(|(_, point)| point).collect()
    }
}

/// Below this distance (m) the direction from one point to the other is lost in rounding.
const LEAST_M: f64 = 1e-9;

/// The length of a vector.
#[inline(always)]
fn length<T: Real>(v: Vec3<T>) -> T {
    let [x, y, z] = v.0;
    let [length] = T::lanewise([x * x + y * y + z * z], |[square]| [square.sqrt()]);
    length
}

/// A range sensor at one set of parameters.
#[derive(Debug, Clone)]
pub struct RangeReader {
    ends: Sides<Point>,
    std_m: f64,
}

impl Reads for RangeReader {
    type Seat = RangeSeat;

    /// One row with the sensor's own name.
    fn rows(&self) -> RowGroups {
        vec![(Quantity::Range, &[""], vec![self.std_m])]
    }

    fn mark_frames(&self, needed: &mut [bool]) {
        self.ends.iter().for_each(|end| needed[end.0] = true);
    }

    #[inline(always)]
    fn predict<T: Real>(&self, scene: &Scene<T>, out: &mut [T]) {
        let [(a, at_a), (b, at_b)] = &self.ends;
        out[0] = length(scene.place(*a, at_a) - scene.place(*b, at_b));
    }

    fn causes(&self, row: usize, answers: &Answers) -> Vec<Found> {
        vec![Found { row, count: 1, part: 0, columns: answers.places(&self.ends) }]
    }

    /// The derivative is that of the points' difference along the unit vector between them. It does not exist where the
    /// points coincide; zero, the mean over all directions, is used there.
    #[inline(always)]
    fn slopes<const FUSED: bool>(&self, groups: &[Group], at: Moving, out: &mut SparseJacobian) {
        let places = [0, 1].map(|i| at.place(self.ends[i].0, &self.ends[i].1));
        let gap = places[0] - places[1];
        let distance = length(gap);
        let unit = if distance < LEAST_M { Vec3::zero() } else { gap * (1.0 / distance) };
        for group in groups {
            for (slope, (cause, side)) in out.rows_of(group.triple).iter_mut().zip(&group.causes) {
                let [x, y, z] = moved(*cause, *side, &at, self.ends[*side].0, places[*side]).0;
                slope.rows = [x * unit.0[0] + y * unit.0[1] + z * unit.0[2], 0.0, 0.0, 0.0];
            }
        }
    }

    fn seat(&self, row: usize, homes: &Homes) -> (RangeSeat, Reach) {
        let (ends, reach) = homes.sides(&self.ends);
        (RangeSeat { row, ends }, reach)
    }
}

/// A range sensor with its points on rigid pieces.
#[derive(Debug, Clone)]
pub struct RangeSeat {
    row: usize,
    ends: Sides<Point>,
}

impl Sits for RangeSeat {
    fn mark(&self, wanted: &mut [Wanted]) {
        self.ends.iter().for_each(|end| wanted[end.0].place = true);
    }

    #[inline(always)]
    fn predict<const FUSED: bool>(&self, mut near: Nearby<FUSED>) {
        if near.posed {
            near.out[self.row] = length(near.gap(&self.ends)).cast();
        } else {
            near.keep(Some(self.row), 1);
        }
    }
}
