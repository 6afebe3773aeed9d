//! The Jacobian of all readings: which columns each kind of sensor has, and where they stand.
#![allow(clippy::needless_range_loop)] // several arrays go in step

use super::kind::Reads;
use super::{Suite, Worn};
use crate::kernels::arch::madd;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::slopes::{Kind, Slopes};
use crate::kinematics::FrameMotion;
use crate::model::Point;
use crate::rotation::{Mat3, Vec3};

/// Where numbers that are no joints stand in the Jacobian.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Places {
    /// The first column that is asked for.
    pub from: usize,
    /// Per coordinate: its value.
    pub coordinates: Vec<Option<usize>>,
    /// Per estimated length.
    pub lengths: Vec<usize>,
    /// Per estimated mount: the first of three.
    pub mounts: Vec<usize>,
    /// Per estimated heading.
    pub headings: Vec<usize>,
    /// Of the magnetic field's azimuth.
    pub azimuth: Option<usize>,
    /// Base accelerations, and their directions in root axes.
    pub bases: Vec<(usize, [f64; 3])>,
    /// Per bias: the first row that it adds to, and its first state.
    pub biases: Vec<(usize, usize)>,
}

/// How a body stands and moves, and the derivatives of that by its joints and lengths.
#[derive(Debug, Clone, Copy)]
pub struct Moving<'a> {
    /// All frames.
    pub frames: &'a [FrameMotion<f64>],
    /// Their slopes.
    pub slopes: &'a Slopes,
    /// Lengths and mounts.
    pub worn: Worn<'a, f64>,
    /// uT, root axes.
    pub magnetic_field: Vec3<f64>,
    /// Per rad of azimuth.
    pub magnetic_slope: Vec3<f64>,
    /// Of every source whose readings are differences from one.
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

/// Why a reading has a column.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Cause {
    /// A slope of the tree, by its number.
    Slope(usize),
    /// A length that moves the sensor in its frame: m per unit, in the frame's axes.
    Stretch([f64; 3]),
    /// One of the three numbers of a mount.
    Mount(usize),
    /// A base acceleration.
    Base([f64; 3]),
    /// A state whose meaning only the kind of sensor knows.
    Own,
}

/// A column of the Jacobian with its cause and the side of a sensor that has two.
pub(crate) type Column = (usize, (Cause, usize));

/// Up to three neighbouring rows that have the same columns.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// The first row.
    pub row: usize,
    /// How many rows.
    pub count: usize,
    /// Which part of the sensor reads them, as the sensor's kind numbers its parts.
    pub part: usize,
    pub columns: Vec<Column>,
}

/// The same in the Jacobian.
#[derive(Debug, Clone)]
pub(crate) struct Group {
    pub triple: usize,
    pub part: usize,
    /// Of every slope, with its side.
    pub causes: Vec<(Cause, usize)>,
}

/// Why the slopes of a Jacobian are there.
#[derive(Debug, Clone)]
pub struct Causes {
    /// Per source.
    groups: Vec<Vec<Group>>,
}

/// The columns of whatever can move a sensor.
pub(crate) struct Answers<'a> {
    pub slopes: &'a Slopes,
    pub places: &'a Places,
}

impl Answers<'_> {
    /// Of the joints and lengths between the root and a frame.
    pub fn chain(&self, frame: usize, side: usize, kinds: &[Kind]) -> Vec<Column> {
        let slope = |k: usize| self.slopes.slope(k);
        let chain = self.slopes.chain(frame).into_iter().filter(|&k| kinds.contains(&slope(k).kind));
        chain.map(|k| (slope(k).column, (Cause::Slope(k), side))).collect()
    }

    /// Of the lengths on which a point of a frame depends.
    pub fn stretches(&self, point: &Point, side: usize) -> Vec<Column> {
        let column = |(l, slope): &(usize, [f64; 3])| (self.places.lengths[*l], (Cause::Stretch(*slope), side));
        point.slopes().iter().map(column).collect()
    }

    /// Of an estimated mount.
    pub fn mount(&self, number: Option<usize>) -> impl Iterator<Item = Column> {
        let first = number.map(|i| self.places.mounts[i]);
        first.into_iter().flat_map(|m| (0..3).map(move |k| (m + k, (Cause::Mount(k), 0))))
    }
}

impl Suite {
    /// Room for the rows of a Jacobian that has `n` columns of states and others behind them.
    pub fn causes(&self, n: usize, slopes: &Slopes, places: &Places) -> (SparseJacobian, Causes) {
        let mut straight = SparseJacobian { n, ..SparseJacobian::default() };
        let answers = Answers { slopes, places };
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

    /// Writes the rows of every `active` source: derivatives of what `predict` gives. Allocates nothing.
    #[inline(always)]
    pub fn slopes<const FUSED: bool>(&self, causes: &Causes, at: Moving, active: &[bool], out: &mut SparseJacobian) {
        let sources = self.readers.iter().zip(&causes.groups).zip(active);
        for ((reader, groups), _) in sources.filter(|(_, on)| **on) {
            reader.slopes::<FUSED>(groups, at, out);
        }
    }

    /// Writes out the rows of every `active` source in full.
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

/// How a point moves, in root axes; one on the second side counts negatively.
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

/// Three columns, of which the last number is none.
pub(super) type Columns = [[f64; 4]; 3];

/// `sum` and a matrix, given by its columns, times a vector.
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
