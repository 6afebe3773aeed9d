//! Jacobian of the measurement model: the columns of each kind of sensor and their places. The extended filter and the
//! calibrations use it.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::kind::Reads;
use super::{Sides, Suite, Worn};
use crate::kernels::arch::madd;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::slopes::{Kind, Slopes};
use crate::kinematics::FrameMotion;
use crate::model::Point;
use crate::rotation::{Mat3, Vec3};

/// Columns of numbers other than rates and accelerations of joints.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Places {
    /// The first column of the Jacobian.
    pub from: usize,
    /// Per coordinate: its value.
    pub coordinates: Vec<Option<usize>>,
    /// Per estimated length: its column.
    pub lengths: Vec<usize>,
    /// Per estimated mount: the first of three columns.
    pub mounts: Vec<usize>,
    /// Per estimated heading: its column.
    pub headings: Vec<usize>,
    /// Column of the magnetic field's azimuth.
    pub azimuth: Option<usize>,
    /// Columns of base accelerations, and their directions in root axes.
    pub bases: Vec<(usize, [f64; 3])>,
    /// Per bias: the first row that it is added to, and its first state.
    pub biases: Vec<(usize, usize)>,
}

/// Motion of a body and its derivatives by joints and lengths.
#[derive(Debug, Clone, Copy)]
pub struct Moving<'a> {
    /// All frames.
    pub frames: &'a [FrameMotion<f64>],
    /// Derivatives of their motion.
    pub slopes: &'a Slopes,
    /// Lengths, mounts and headings.
    pub worn: Worn<'a, f64>,
    /// Magnetic field in root axes, uT.
    pub magnetic_field: Vec3<f64>,
    /// Its derivative by the azimuth, uT/rad.
    pub magnetic_slope: Vec3<f64>,
    /// Per source: the reference of readings that are differences from one.
    pub references: &'a [Mat3<f64>],
}

impl Moving<'_> {
    /// A point of a frame in root axes, m.
    #[inline(always)]
    pub(super) fn place(&self, frame: usize, point: &Point) -> Vec3<f64> {
        let motion = &self.frames[frame];
        motion.position + point.turned(&motion.rotation, self.worn.lengths)
    }
}

/// The number that a column of the Jacobian belongs to.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Cause {
    /// A slope of the tree (joint or length), by its number.
    Slope(usize),
    /// A length that moves the sensor on its frame: m per unit, in the frame's axes.
    Stretch([f64; 3]),
    /// One of the three numbers of a mount.
    Mount(usize),
    /// A base acceleration.
    Base([f64; 3]),
    /// A state that only the kind of sensor interprets.
    Own,
}

/// A column of the Jacobian, its cause, and the side of a sensor with two sides.
pub(crate) type Column = (usize, (Cause, usize));

/// Up to three neighbouring rows with the same columns.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// The first row.
    pub row: usize,
    /// Number of rows.
    pub count: usize,
    /// The part of the sensor that they belong to, as its kind numbers them.
    pub part: usize,
    pub columns: Vec<Column>,
}

/// The same rows in the Jacobian.
#[derive(Debug, Clone)]
pub(crate) struct Group {
    pub triple: usize,
    pub part: usize,
    /// Cause of every column, and its side.
    pub causes: Vec<(Cause, usize)>,
}

/// Causes of all columns of a Jacobian.
#[derive(Debug, Clone)]
pub struct Causes {
    /// Per source.
    groups: Vec<Vec<Group>>,
}

/// Finds the columns of everything that can move a sensor.
pub(crate) struct Answers<'a> {
    pub slopes: &'a Slopes,
    pub columns: &'a Places,
}

impl Answers<'_> {
    /// Columns of the joints and lengths between the root and a frame.
    pub fn chain(&self, frame: usize, side: usize, kinds: &[Kind]) -> Vec<Column> {
        let slope = |k: usize| self.slopes.slope(k);
        let chain = self.slopes.chain(frame).into_iter().filter(|&k| kinds.contains(&slope(k).kind));
        chain.map(|k| (slope(k).column, (Cause::Slope(k), side))).collect()
    }

    /// Columns of the lengths that a point of a frame depends on.
    pub fn stretches(&self, point: &Point, side: usize) -> Vec<Column> {
        let column = |(l, slope): &(usize, [f64; 3])| (self.columns.lengths[*l], (Cause::Stretch(*slope), side));
        point.slopes().iter().map(column).collect()
    }

    /// Columns of a point of a frame.
    pub fn place(&self, frame: usize, point: &Point, side: usize) -> Vec<Column> {
        let mut columns = self.chain(frame, side, &[Kind::Turn, Kind::Shift]);
        columns.extend(self.stretches(point, side));
        columns
    }

    /// Columns of both points.
    pub fn places(&self, sides: &Sides<Point>) -> Vec<Column> {
        sides.iter().enumerate().flat_map(|(side, (frame, point))| self.place(*frame, point, side)).collect()
    }

    /// Columns of an estimated mount.
    pub fn mount(&self, number: Option<usize>) -> impl Iterator<Item = Column> {
        let first = number.map(|i| self.columns.mounts[i]);
        first.into_iter().flat_map(|m| (0..3).map(move |k| (m + k, (Cause::Mount(k), 0))))
    }
}

impl Suite {
    /// A Jacobian with `n` columns of states, followed by others.
    pub fn causes(&self, n: usize, slopes: &Slopes, places: &Places) -> (SparseJacobian, Causes) {
        let mut straight = SparseJacobian { n, ..SparseJacobian::default() };
        let answers = Answers { slopes, columns: places };
        let groups = self.readers.iter().zip(&self.sources).map(|(reader, source)| {
            let mut found = Vec::new();
            for Found { row, count, part, columns } in reader.causes(source.rows.start, &answers) {
                let mut causes: Vec<_> = columns.into_iter().filter(|(column, ..)| *column >= places.from).collect();
                causes.sort_by_key(|(column, ..)| std::cmp::Reverse(*column));
                let bias = places.biases.iter().find(|(first, _)| *first == row).map(|b| b.1);
                if !causes.is_empty() || bias.is_some() {
                    let columns: Vec<usize> = causes.iter().map(|c| c.0).collect();
                    found.push(Group {
                        triple: straight.triples.len(),
                        part,
                        causes: causes.iter().map(|c| c.1).collect(),
                    });
                    straight.push(row, count, &columns, bias);
                }
            }
            found
        });
        let groups = groups.collect();
        (straight, Causes { groups })
    }

    /// Writes the rows of every `active` source: derivatives of the results of `predict`. Allocates nothing.
    #[inline(always)]
    pub fn slopes<const FUSED: bool>(&self, causes: &Causes, at: Moving, active: &[bool], out: &mut SparseJacobian) {
        let sources = self.readers.iter().zip(&causes.groups).zip(active);
        for ((reader, groups), _) in sources.filter(|(_, on)| **on) {
            reader.slopes::<FUSED>(groups, at, out);
        }
    }

    /// Writes the rows of every `active` source as a dense matrix.
    pub fn scatter(
        &self,
        causes: &Causes,
        active: &[bool],
        straight: &SparseJacobian,
        width: usize,
        jacobian: &mut [f64],
    ) {
        for ((source, groups), _) in self.sources.iter().zip(&causes.groups).zip(active).filter(|(_, on)| **on) {
            jacobian[source.rows.start * width..source.rows.end * width].fill(0.0);
            groups.iter().for_each(|g| straight.scatter(g.triple, width, jacobian));
        }
    }
}

/// Derivative of a point in root axes; negative on the second side.
#[inline(always)]
pub(super) fn moved(cause: Cause, side: usize, at: &Moving, frame: usize, place: Vec3<f64>) -> Vec3<f64> {
    let v = match cause {
        Cause::Slope(k) => at.slopes.slope(k).place(place),
        Cause::Stretch(by) => at.frames[frame].rotation.apply_f64(by),
        _ => Vec3::zero(),
    };
    if side == 0 {
        v
    } else {
        v * -1.0
    }
}

/// Rows of a point, or of the difference of two: frame and point of each side.
#[inline(always)]
pub(super) fn write_sides(group: &Group, at: Moving, sides: &[(usize, &Point)], out: &mut SparseJacobian) {
    let mut places = [Vec3::zero(); 2];
    for (to, (frame, point)) in places.iter_mut().zip(sides) {
        *to = at.place(*frame, point);
    }
    for (slope, (cause, side)) in out.rows_of(group.triple).iter_mut().zip(&group.causes) {
        let [x, y, z] = moved(*cause, *side, &at, sides[*side].0, places[*side]).0;
        slope.rows = [x, y, z, 0.0];
    }
}

/// Rows of the difference of two axes, each with its frame.
#[inline(always)]
pub(super) fn write_axes(group: &Group, at: Moving, sides: [(usize, [f64; 3]); 2], out: &mut SparseJacobian) {
    let axes = sides.map(|(frame, axis)| at.frames[frame].rotation.apply_f64(axis));
    for (slope, (cause, side)) in out.rows_of(group.triple).iter_mut().zip(&group.causes) {
        let Cause::Slope(k) = *cause else { continue };
        let v = at.slopes.slope(k).turn.cross(axes[*side]);
        let [x, y, z] = if *side == 0 { v.0 } else { (v * -1.0).0 };
        slope.rows = [x, y, z, 0.0];
    }
}

/// Three columns; the fourth number is padding.
pub(super) type Columns = [[f64; 4]; 3];

/// `sum` plus a matrix, given by its columns, times a vector.
#[inline(always)]
pub(super) fn times<const FUSED: bool>(columns: &Columns, v: Vec3<f64>, mut sum: [f64; 4]) -> [f64; 4] {
    for k in 0..3 {
        for i in 0..4 {
            sum[i] = madd::<FUSED>(columns[k][i], v.0[k], sum[i]);
        }
    }
    sum
}

/// The transpose of a matrix.
#[inline(always)]
pub(super) fn transposed(axes: &Mat3<f64>) -> Columns {
    axes.0.map(|[x, y, z]| [x, y, z, 0.0])
}
