//! Three traits that each kind of sensor implements in one file, and the list of all kinds.

use super::near::{Homes, Nearby, Stand};
use super::slopes::{Answers, Found, Group, Moving};
use super::{Fit, Heading, Mount, RowGroups, Scene, Sides, SlowError, Worn};
use crate::kernels::lane::{Lane, Real};
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::{Near, Reach, Wanted};
use crate::model::build::Lookup;
use crate::model::section::{Known, Section};
use crate::model::{Expr, Model};
use crate::rotation::{Mat3, Vec3};
use serde_json::{json, Value};

/// A sensor with names of frames and joints that are looked up once all frames are read.
pub(crate) type Pending<T> = Box<dyn FnOnce(&Lookup) -> Option<T>>;

/// Model and parameter values for a description.
pub(crate) struct Described<'a> {
    pub model: &'a Model,
    pub values: &'a [f64],
}

impl Described<'_> {
    pub fn frame(&self, frame: usize) -> &str {
        &self.model.frames[frame].name
    }

    pub fn point(&self, point: &[Expr; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i: usize| point[i].eval(self.values))
    }

    pub fn mount(&self, mount: &Mount) -> Value {
        json!({"rotation": mount.rotation.0, "offset": self.point(&mount.offset), "std_rad": mount.std_rad,
            "rigid": mount.rigid, "soft_std_rad": mount.soft_std_rad})
    }
}

/// A sensor as the model file describes it.
pub(crate) trait Kind: Sized {
    /// Name of the kind in `kind = "..."`.
    const NAME: &'static str;
    /// Its keys beside `name` and `kind`.
    const KEYS: Known;
    /// The type that predicts its rows.
    type Reader: Reads;

    /// Reads and checks the keys.
    fn read(section: &Section) -> Pending<Self>;
    /// Its keys as plain data, without `name` and `kind`.
    fn describe(&self, at: &Described) -> Value;
    /// The sensor at one set of parameters; `None` if its readings are inputs.
    fn reader(&self, fit: &Fit) -> Option<Self::Reader>;
    /// The frame that decides which limb it belongs to.
    fn frame(&self) -> Option<usize> {
        None
    }
    /// Its mount, if its orientation on the link matters.
    fn mount(&self) -> Option<&Mount> {
        None
    }
    /// The same, mutable.
    fn mount_mut(&mut self) -> Option<&mut Mount> {
        None
    }
    /// Points in frames that it reads and that no mount gives.
    fn points(&self) -> Vec<&[Expr; 3]> {
        Vec::new()
    }
    /// The unknown heading of its reference, if it has one.
    fn heading(&self) -> Option<&Heading> {
        None
    }
    /// Slow errors of its readings that are states.
    fn slow_errors(&self) -> Vec<SlowError> {
        Vec::new()
    }
}

/// A sensor or closure at one set of parameters and mounts: its rows, their prediction and their derivatives.
pub(crate) trait Reads {
    /// Its form on the rigid pieces of the tree.
    type Seat: Sits;

    /// Its rows.
    fn rows(&self) -> RowGroups;
    /// Marks the frames whose motion it depends on.
    fn mark_frames(&self, _needed: &mut [bool]) {}
    /// Marks the frames whose velocities or accelerations it depends on.
    fn mark_moving(&self, _moving: &mut [bool]) {}
    /// Predicts its rows.
    fn predict<T: Real>(&self, scene: &Scene<T>, out: &mut [T]);
    /// Columns of the Jacobian of its rows, which start at `row`.
    fn causes(&self, row: usize, answers: &Answers) -> Vec<Found>;
    /// Writes these columns.
    fn slopes<const FUSED: bool>(&self, groups: &[Group], at: Moving, out: &mut SparseJacobian);
    /// The sensor on the pieces of the tree, and the states that its rows from `row` on depend on.
    fn seat(&self, row: usize, homes: &Homes) -> (Self::Seat, Reach);
    /// Readings on a manifold: moves them from the rows to a reference, so that the rows become differences, and sets
    /// the rows to zero.
    fn refer(&self, _rows: &mut [f64]) -> Option<Mat3<f64>> {
        None
    }
}

/// A sensor or closure on the rigid pieces of the tree: its readings at points near a mean.
pub(crate) trait Sits {
    /// Marks what it needs of its pieces.
    fn mark(&self, _wanted: &mut [Wanted]) {}
    /// Computes its pose at the mean.
    fn settle(&self, _worn: Worn<f64>, _stand: &mut Stand) {}
    /// Second-order part of its readings by the rates, in the posture of the mean.
    fn curve<const FUSED: bool>(&self, _near: &Near<Lane<FUSED>>, _stand: &Stand, _out: &mut [Lane]) {}
    /// Predicts its rows.
    fn predict<const FUSED: bool>(&self, near: Nearby<FUSED>);
    /// A vector in its own axes, if it has axes; the vector is given in the axes of every piece.
    fn seen_by(&self, _v: &[Vec3<f64>], _mounts: &[Vec3<f64>]) -> Option<Vec3<f64>> {
        None
    }
}

/// Reads frame and point of two sides, which a joint must move relative to each other; `what` needs it.
pub(crate) fn read_sides(
    section: &Section,
    example: &str,
) -> impl FnOnce(&Lookup, &str) -> Option<Sides<[Expr; 3]>> + 'static {
    let side = |frame, point| (section.need_reference(frame, example), section.point(point));
    let (a, b) = (side("frame_a", "point_a"), side("frame_b", "point_b"));
    move |at, what| {
        // Both names are looked up, so that both mistakes are reported.
        let frames = (at.frame("frame_a", &a.0), at.frame("frame_b", &b.0));
        let sides = [(frames.0?, a.1), (frames.1?, b.1)];
        at.need_joint_between(sides[0].0, sides[1].0, what);
        Some(sides)
    }
}

/// Keys of all kinds, `name` and `kind` first.
pub(crate) fn all_keys(of_kinds: &[Known]) -> Vec<&'static str> {
    let mut keys = vec!["name", "kind"];
    for key in of_kinds.iter().copied().flatten() {
        if !keys.contains(key) {
            keys.push(key);
        }
    }
    keys
}

/// Keys that belong to other kinds of sensors.
pub(crate) fn refuse_others(section: &Section, kind: &str, own: Known, all: &[&str]) {
    for key in all.iter().filter(|key| section.has(key)) {
        if !["name", "kind"].contains(key) && !own.contains(key) {
            let article = if kind.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
            let text = format!("`{key}` is no key of {article} {kind}; it takes {}", own.join(", "));
            section.mistake(section.at_key(key), text);
        }
    }
}

/// The list of kinds: an enum for each of the three traits that forwards to the kind's implementation.
macro_rules! kinds {
    ($($name:ident: $file:ident,)*) => {
        /// A sensor of a model file.
        #[derive(Debug, Clone, PartialEq)]
        pub enum SensorKind {
            $(#[allow(missing_docs)] $name($file::$name),)*
        }

        impl SensorKind {
            /// Keys of all kinds.
            pub(crate) fn keys() -> Known {
                static KEYS: LazyLock<Vec<&str>> = LazyLock::new(|| all_keys(&[$($file::$name::KEYS),*]));
                &KEYS
            }

            /// Reads the keys of the kind that the file names.
            pub(crate) fn read(section: &Section) -> Option<Pending<SensorKind>> {
                let known = [$($file::$name::NAME),*].map(|name| (name, name));
                let named = section.need("kind", "\"imu\"")?.choice(&known)?;
                $(if named == $file::$name::NAME {
                    refuse_others(section, named, $file::$name::KEYS, Self::keys());
                    let pending = $file::$name::read(section);
                    return Some(Box::new(|at| pending(at).map(SensorKind::$name)));
                })*
                None
            }

            /// Name of the kind in `kind = "..."`.
            pub fn name(&self) -> &'static str {
                match self { $(SensorKind::$name(_) => $file::$name::NAME,)* }
            }

            /// Its keys as plain data, without `name` and `kind`.
            pub(crate) fn describe(&self, at: &Described) -> Value {
                match self { $(SensorKind::$name(s) => s.describe(at),)* }
            }

            /// The frame that decides which limb it belongs to.
            pub fn frame(&self) -> Option<usize> {
                match self { $(SensorKind::$name(s) => s.frame(),)* }
            }

            /// Its mount, if its orientation on the link matters.
            pub fn mount(&self) -> Option<&Mount> {
                match self { $(SensorKind::$name(s) => s.mount(),)* }
            }

            /// The same, mutable.
            pub fn mount_mut(&mut self) -> Option<&mut Mount> {
                match self { $(SensorKind::$name(s) => s.mount_mut(),)* }
            }

            /// Points in frames that it reads: its place on its link, or the ends of what it measures.
            pub fn points(&self) -> Vec<&[Expr; 3]> {
                let own = match self { $(SensorKind::$name(s) => s.points(),)* };
                self.mount().map(|mount| &mount.offset).into_iter().chain(own).collect()
            }

            /// The unknown heading of its reference, if it has one.
            pub fn heading(&self) -> Option<&Heading> {
                match self { $(SensorKind::$name(s) => s.heading(),)* }
            }

            /// Slow errors of its readings that are states.
            pub(crate) fn slow_errors(&self) -> Vec<SlowError> {
                match self { $(SensorKind::$name(s) => s.slow_errors(),)* }
            }

            /// The sensor at one set of parameters; `None` if its readings are inputs.
            fn reader(&self, fit: &Fit) -> Option<Reader> {
                match self { $(SensorKind::$name(s) => s.reader(fit).map(Reader::$name),)* }
            }
        }

        kinds!(@reads $($name: $file,)* Closure: closure,);
    };
    (@reads $($name:ident: $file:ident,)*) => {
        /// A sensor or closure that can predict its rows.
        #[derive(Debug, Clone)]
        enum Reader {
            $($name(<$file::$name as Kind>::Reader),)*
        }

        /// A sensor or closure on its rigid pieces.
        #[derive(Debug, Clone)]
        enum Seat {
            $($name(<<$file::$name as Kind>::Reader as Reads>::Seat),)*
        }

        impl Reads for Reader {
            type Seat = Seat;

            fn rows(&self) -> RowGroups {
                match self { $(Reader::$name(s) => s.rows(),)* }
            }

            fn mark_frames(&self, needed: &mut [bool]) {
                match self { $(Reader::$name(s) => s.mark_frames(needed),)* }
            }

            fn mark_moving(&self, moving: &mut [bool]) {
                match self { $(Reader::$name(s) => s.mark_moving(moving),)* }
            }

            #[inline(always)]
            fn predict<T: Real>(&self, scene: &Scene<T>, out: &mut [T]) {
                match self { $(Reader::$name(s) => s.predict(scene, out),)* }
            }

            fn causes(&self, row: usize, answers: &Answers) -> Vec<Found> {
                match self { $(Reader::$name(s) => s.causes(row, answers),)* }
            }

            #[inline(always)]
            fn slopes<const FUSED: bool>(&self, groups: &[Group], at: Moving, out: &mut SparseJacobian) {
                match self { $(Reader::$name(s) => s.slopes::<FUSED>(groups, at, out),)* }
            }

            fn seat(&self, row: usize, homes: &Homes) -> (Seat, Reach) {
                match self {
                    $(Reader::$name(s) => {
                        let (seat, reach) = s.seat(row, homes);
                        (Seat::$name(seat), reach)
                    })*
                }
            }

            fn refer(&self, rows: &mut [f64]) -> Option<Mat3<f64>> {
                match self { $(Reader::$name(s) => s.refer(rows),)* }
            }
        }

        impl Sits for Seat {
            fn mark(&self, wanted: &mut [Wanted]) {
                match self { $(Seat::$name(s) => s.mark(wanted),)* }
            }

            #[inline(always)]
            fn settle(&self, worn: Worn<f64>, stand: &mut Stand) {
                match self { $(Seat::$name(s) => s.settle(worn, stand),)* }
            }

            #[inline(always)]
            fn curve<const FUSED: bool>(&self, near: &Near<Lane<FUSED>>, stand: &Stand, out: &mut [Lane]) {
                match self { $(Seat::$name(s) => s.curve(near, stand, out),)* }
            }

            #[inline(always)]
            fn predict<const FUSED: bool>(&self, near: Nearby<FUSED>) {
                match self { $(Seat::$name(s) => s.predict(near),)* }
            }

            fn seen_by(&self, v: &[Vec3<f64>], mounts: &[Vec3<f64>]) -> Option<Vec3<f64>> {
                match self { $(Seat::$name(s) => s.seen_by(v, mounts),)* }
            }
        }
    };
}
pub(crate) use kinds;
