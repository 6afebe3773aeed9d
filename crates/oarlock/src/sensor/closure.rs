//! Closure: a virtual measurement of zero that keeps two points together, and optionally two axes (eqs. 15 to 18). It
//! has its own table `[[closure]]` in a model file.

use super::kind::{read_sides, Described, Kind, Pending, Reads, Sits};
use super::near::{Homes, Nearby};
use super::slopes::{write_axes, write_sides, Answers, Found, Group, Moving};
use super::{Fit, Quantity, RowGroups, Scene, Sides};
use crate::kernels::lane::Real;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::{Reach, Wanted};
use crate::kinematics::slopes::Kind as SlopeKind;
use crate::model::section::{Known, Section};
use crate::model::{Expr, Point};
use crate::rotation::Vec3;
use serde_json::{json, Value};

/// A closure of a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Closure {
    /// Unique among sensors and closures.
    pub name: String,
    /// Frame and point (m) of each side.
    pub sides: Sides<[Expr; 3]>,
    /// Unit axes in each frame that must agree.
    pub axes: Option<[[f64; 3]; 2]>,
    /// Standard deviation of the gap, m.
    pub std_m: f64,
    /// Standard deviation of each direction cosine.
    pub std_axis: f64,
}

impl Kind for Closure {
    const NAME: &'static str = "closure";
    const KEYS: Known = &["name", "frame_a", "point_a", "frame_b", "point_b", "axis_a", "axis_b", "std_m", "std_axis"];
    type Reader = ClosureReader;

    fn read(section: &Section) -> Pending<Self> {
        let axes = read_axes(section);
        let sides = read_sides(section, "\"r_hand\"");
        let std_m = section.need_positive("std_m", "0.002", "m");
        let has_axes = section.has("axis_a") || section.has("axis_b");
        let std_axis = if has_axes { section.need_positive("std_axis", "0.005", "") } else { 1.0 };
        Box::new(move |at| {
            let sides = sides(at, "a loop")?;
            Some(Closure { name: at.name.text.clone(), sides, axes, std_m, std_axis })
        })
    }

    fn describe(&self, at: &Described) -> Value {
        let [(a, point_a), (b, point_b)] = &self.sides;
        json!({"name": self.name, "frame_a": at.frame(*a), "frame_b": at.frame(*b),
            "point_a": at.point(point_a), "point_b": at.point(point_b),
            "axis_a": self.axes.map(|a| a[0]), "axis_b": self.axes.map(|a| a[1]),
            "std_m": self.std_m, "std_axis": self.std_axis})
    }

    fn reader(&self, fit: &Fit) -> Option<ClosureReader> {
        Some(ClosureReader {
            sides: fit.sides(&self.sides),
            axes: self.axes,
            std_m: self.std_m,
            std_axis: self.std_axis,
        })
    }
}

fn read_axes(section: &Section) -> Option<[[f64; 3]; 2]> {
    let axes = match (section.get("axis_a"), section.get("axis_b")) {
        (Some(a), Some(b)) => a.axis().zip(b.axis()).map(|(a, b)| [a, b]),
        (None, None) => None,
        (Some(_), None) => {
            section.mistake(section.at_key("axis_a"), "`axis_a` without `axis_b`; give both or neither");
            None
        }
        (None, Some(_)) => {
            section.mistake(section.at_key("axis_b"), "`axis_b` without `axis_a`; give both or neither");
            None
        }
    };
    if section.has("std_axis") && !(section.has("axis_a") || section.has("axis_b")) {
        section.mistake(section.at_key("std_axis"), "`std_axis` without `axis_a` and `axis_b`; add them or remove it");
    }
    axes
}

/// A closure at one set of parameters.
#[derive(Debug, Clone)]
pub struct ClosureReader {
    sides: Sides<Point>,
    axes: Option<[[f64; 3]; 2]>,
    std_m: f64,
    std_axis: f64,
}

/// Rows of the points, and of the axes.
const GAP: usize = 0;
const AXES: usize = 1;

impl Reads for ClosureReader {
    type Seat = ClosureSeat;

    /// Gap x, y, z, then the difference of the axes if they must agree.
    fn rows(&self) -> RowGroups {
        let gap: &'static [&'static str] = &["x", "y", "z"];
        let both: &'static [&'static str] = &["x", "y", "z", "axis_x", "axis_y", "axis_z"];
        let mut std = vec![self.std_m; 3];
        if self.axes.is_none() {
            return vec![(Quantity::Closure, gap, std)];
        }
        std.extend([self.std_axis; 3]);
        vec![(Quantity::Closure, both, std)]
    }

    fn mark_frames(&self, needed: &mut [bool]) {
        self.sides.iter().for_each(|s| needed[s.0] = true);
    }

    /// First side minus second side, in root axes.
    #[inline(always)]
    fn predict<T: Real>(&self, scene: &Scene<T>, out: &mut [T]) {
        let [(a, at_a), (b, at_b)] = &self.sides;
        let gap = scene.place(*a, at_a) - scene.place(*b, at_b);
        [out[0], out[1], out[2]] = gap.0;
        if let Some([za, zb]) = self.axes {
            let turn = scene.frames[*a].rotation.apply_f64(za) - scene.frames[*b].rotation.apply_f64(zb);
            [out[3], out[4], out[5]] = turn.0;
        }
    }

    fn causes(&self, row: usize, answers: &Answers) -> Vec<Found> {
        let gap = Found { row, count: 3, part: GAP, columns: answers.places(&self.sides) };
        let chains = self.sides.iter().enumerate();
        let axes = chains.flat_map(|(side, (frame, _))| answers.chain(*frame, side, &[SlopeKind::Turn]));
        let turned = self.axes.map(|_| Found { row: row + 3, count: 3, part: AXES, columns: axes.collect() });
        std::iter::once(gap).chain(turned).collect()
    }

    #[inline(always)]
    fn slopes<const FUSED: bool>(&self, groups: &[Group], at: Moving, out: &mut SparseJacobian) {
        let [(a, at_a), (b, at_b)] = &self.sides;
        for group in groups {
            match (group.part, self.axes) {
                (AXES, Some([za, zb])) => write_axes(group, at, [(*a, za), (*b, zb)], out),
                _ => write_sides(group, at, &[(*a, at_a), (*b, at_b)], out),
            }
        }
    }

    fn seat(&self, row: usize, homes: &Homes) -> (ClosureSeat, Reach) {
        let (sides, reach) = homes.sides(&self.sides);
        let axes = self.axes.map(|axes| [0, 1].map(|i| homes.rotation(self.sides[i].0).apply_f64(axes[i]).0));
        (ClosureSeat { row, sides, axes }, reach)
    }
}

/// A closure on its rigid pieces.
#[derive(Debug, Clone)]
pub struct ClosureSeat {
    row: usize,
    sides: Sides<Point>,
    axes: Option<[[f64; 3]; 2]>,
}

impl Sits for ClosureSeat {
    fn mark(&self, wanted: &mut [Wanted]) {
        self.sides.iter().for_each(|s| wanted[s.0].place = true);
    }

    #[inline(always)]
    fn predict<const FUSED: bool>(&self, mut near: Nearby<FUSED>) {
        if !near.posed {
            near.keep(Some(self.row), if self.axes.is_some() { 6 } else { 3 });
            return;
        }
        let gap = near.gap(&self.sides);
        near.put(self.row, gap);
        if let Some([za, zb]) = self.axes {
            let [(a, _), (b, _)] = self.sides;
            let turn = near.direction(a, Vec3::splat(za)) - near.direction(b, Vec3::splat(zb));
            near.put(self.row + 3, turn);
        }
    }
}
