//! Orientation sensor: reads a quaternion from a unit that does not export its raw signals.
//!
//! With the measured rotation R_m and the predicted one R_p, both sensor to reference, the rows are the rotation vector
//! Log(R_m' R_p) in sensor axes (Sola, Deray and Atchuthan 2018, eq. 26). The reading is zero, so that the innovation
//! is Log(R_p' R_m). The measured rotation thus becomes the reference of the rows.
//!
//! The error of such a unit is that of the filter inside it, which lasts for seconds. It is a state: a Gauss-Markov
//! process with standard deviation `std_rad` and time constant `correlation_time_s` (Gelb 1974, section 3.8). Readings
//! at 100 Hz therefore do not count as a hundred independent ones per second.

use super::kind::{Described, Kind, Pending, Reads, Sits};
use super::mount::turned;
use super::near::{Homes, Nearby};
use super::slopes::{times, transposed, Answers, Cause, Columns, Found, Group, Moving};
use super::{Fit, Heading, Mount, Quantity, RowGroups, Scene, SlowError};
use crate::kernels::lane::Real;
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::{Reach, Wanted};
use crate::kinematics::slopes::Kind as SlopeKind;
use crate::model::section::{Known, Section};
use crate::model::World;
use crate::rotation::turn::{right_jacobian, right_jacobian_inverse, Turn};
use crate::rotation::{Mat3, Vec3};
use serde_json::{json, Value};

/// Default correlation time of the slow error, s: the time constant with which VQF corrects the inclination by default
/// (Laidig and Seel 2023).
const CORRELATION_TIME_S: f64 = 3.0;
/// Default white noise, as a share of the slow error.
const WHITE_SHARE: f64 = 0.1;
/// Default heading drift of a device's reference, about a degree per minute, rad per sqrt(s).
const HEADING_WALK: f64 = 0.002;

/// An orientation sensor of a model file.
#[derive(Debug, Clone, PartialEq)]
pub struct Orientation {
    /// Index of the frame.
    pub frame: usize,
    /// Its mount on the link.
    pub mount: Mount,
    /// Standard deviation of the slow error about each axis, rad; of the total error if there is no slow one.
    pub std_rad: f64,
    /// Standard deviation of the white noise, rad.
    pub white_std_rad: f64,
    /// Correlation time of the slow error, s; 0: readings are independent.
    pub correlation_time_s: f64,
    /// Unknown heading of the device's reference; `None`: it has the model's.
    pub heading: Option<Heading>,
    /// Rotation from the device's reference (z up, x forward) to root axes.
    pub root_from_reference: Mat3<f64>,
}

impl Kind for Orientation {
    const NAME: &'static str = "orientation";
    const KEYS: Known = &[
        "frame",
        "mount",
        "std_rad",
        "white_std_rad",
        "correlation_time_s",
        "heading",
        "heading_group",
        "heading_walk",
    ];
    type Reader = OrientationReader;

    fn read(section: &Section) -> Pending<Self> {
        let frame = section.need_reference("frame", "\"pelvis\"");
        let mount = Mount::read(section);
        let std_rad = section.need_positive("std_rad", "0.03", "rad");
        let lasts = section.get("correlation_time_s").and_then(|slot| slot.not_negative("s"));
        let correlation_time_s = lasts.unwrap_or(CORRELATION_TIME_S);
        let independent = if correlation_time_s > 0.0 { WHITE_SHARE * std_rad } else { std_rad };
        let white = section.get("white_std_rad").and_then(|slot| slot.positive("rad"));
        if white.is_some() && correlation_time_s == 0.0 {
            let text =
                "`white_std_rad` with correlation_time_s = 0: then `std_rad` is the noise of every reading; remove one";
            section.mistake(section.at_key("white_std_rad"), text);
        }
        let white_std_rad = white.unwrap_or(independent);
        let heading = read_heading(section);
        Box::new(move |at| {
            let frame = at.frame("frame", &frame)?;
            let heading = heading.map(|(group, walk)| Heading { group: group.unwrap_or(at.name.text.clone()), walk });
            let root_from_reference = root_from_reference(&at.model.world);
            Some(Orientation { frame, mount, std_rad, white_std_rad, correlation_time_s, heading, root_from_reference })
        })
    }

    fn describe(&self, at: &Described) -> Value {
        let heading = self.heading.as_ref();
        json!({"frame": at.frame(self.frame), "std_rad": self.std_rad, "white_std_rad": self.white_std_rad,
            "correlation_time_s": self.correlation_time_s, "heading": if heading.is_some() { "unknown" } else { "known" },
            "heading_group": heading.map(|h| &h.group), "heading_walk": heading.map(|h| h.walk),
            "root_from_reference": self.root_from_reference.0,
            "mount": at.mount(&self.mount)})
    }

    fn reader(&self, fit: &Fit) -> Option<OrientationReader> {
        Some(OrientationReader {
            frame: self.frame,
            rotation: fit.given.map_or(self.mount.rotation, |given| given.0),
            root_from_reference: self.root_from_reference,
            std_rad: if self.correlation_time_s > 0.0 { self.white_std_rad } else { self.std_rad },
            turning: Turning { source: fit.source, mount: fit.mount, heading: fit.heading, up: fit.model.world.up },
        })
    }

    fn frame(&self) -> Option<usize> {
        Some(self.frame)
    }

    fn mount(&self) -> Option<&Mount> {
        Some(&self.mount)
    }

    fn mount_mut(&mut self) -> Option<&mut Mount> {
        Some(&mut self.mount)
    }

    fn heading(&self) -> Option<&Heading> {
        self.heading.as_ref()
    }

    fn slow_errors(&self) -> Vec<SlowError> {
        let time_s = self.correlation_time_s;
        let error = SlowError {
            quantity: Quantity::Orientation,
            name: "orientation_error",
            asked: None,
            start_std: self.std_rad,
            walk: self.std_rad * (2.0 / time_s).sqrt(),
            time_s,
        };
        if time_s > 0.0 {
            vec![error]
        } else {
            Vec::new()
        }
    }
}

/// Group, if the file names one, and random walk of an unknown heading.
fn read_heading(section: &Section) -> Option<(Option<String>, f64)> {
    let known = section.get("heading").and_then(|slot| slot.choice(&[("known", true), ("unknown", false)]));
    let group = section.get("heading_group").and_then(|slot| slot.name()).map(|name| name.text);
    let walk = section.get("heading_walk").and_then(|slot| slot.not_negative("rad per sqrt(s)"));
    if known.unwrap_or(true) {
        for key in ["heading_group", "heading_walk"].iter().filter(|key| section.has(key)) {
            let text =
                format!("`{key}` without heading = \"unknown\": a known heading has none; add it or remove this key");
            section.mistake(section.at_key(key), text);
        }
        return None;
    }
    Some((group, walk.unwrap_or(HEADING_WALK)))
}

/// From a reference with z up and x forward.
fn root_from_reference(world: &World) -> Mat3<f64> {
    let (up, forward) = (Vec3(world.up), Vec3(world.forward));
    Mat3([forward.0, up.cross(forward).0, up.0]).transposed()
}

/// States that rotate the readings of an orientation sensor, beside its frame's.
#[derive(Debug, Clone, Copy)]
struct Turning {
    /// Its number among the sources.
    source: usize,
    /// Number among the estimated mounts.
    mount: Option<usize>,
    /// Number among the estimated headings.
    heading: Option<usize>,
    up: [f64; 3],
}

impl Turning {
    /// Rotation from sensor axes to the device's reference, in root axes: `axes` rotated by the heading.
    #[inline(always)]
    fn seen<T: Real>(&self, axes: [Vec3<T>; 3], headings: &[T]) -> [Vec3<T>; 3] {
        let Some(&heading) = self.heading.and_then(|i| headings.get(i)) else { return axes };
        let turn = Mat3::about(Vec3(self.up.map(|x| heading.scale(x))));
        axes.map(|axis| turn.apply(axis))
    }

    /// Log(R_m' R_p) for the columns of R_p.
    #[inline(always)]
    fn rows<T: Real>(&self, axes: [Vec3<T>; 3], references: &[Mat3<f64>], headings: &[T]) -> Vec3<T> {
        let measured = &references[self.source];
        let [x, y, z] = self.seen(axes, headings).map(|axis| measured.transposed_apply(axis).0);
        let entries = [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]];
        Vec3(T::lanewise(entries, |m| {
            let rotation = Mat3([[m[0], m[1], m[2]], [m[3], m[4], m[5]], [m[6], m[7], m[8]]]);
            Turn::of(&rotation).log()
        }))
    }
}

/// An orientation sensor at one set of parameters and mounts.
#[derive(Debug, Clone)]
pub struct OrientationReader {
    frame: usize,
    /// Link from sensor.
    rotation: Mat3<f64>,
    root_from_reference: Mat3<f64>,
    std_rad: f64,
    turning: Turning,
}

impl OrientationReader {
    #[inline(always)]
    fn root_from_sensor<T: Real>(&self, frame: &Mat3<T>, mounts: &[Vec3<T>]) -> Mat3<T> {
        turned(frame.times_f64(&self.rotation), self.turning.mount, mounts)
    }
}

/// The columns of a rotation.
#[inline(always)]
fn columns<T: Real>(m: &Mat3<T>) -> [Vec3<T>; 3] {
    [m.column(0), m.column(1), m.column(2)]
}

impl Reads for OrientationReader {
    type Seat = OrientationSeat;

    fn rows(&self) -> RowGroups {
        vec![(Quantity::Orientation, &["rx", "ry", "rz"], vec![self.std_rad; 3])]
    }

    fn mark_frames(&self, needed: &mut [bool]) {
        needed[self.frame] = true;
    }

    #[inline(always)]
    fn predict<T: Real>(&self, scene: &Scene<T>, out: &mut [T]) {
        let axes = columns(&self.root_from_sensor(&scene.frames[self.frame].rotation, scene.worn.mounts));
        [out[0], out[1], out[2]] = self.turning.rows(axes, scene.references, scene.worn.headings).0;
    }

    fn causes(&self, row: usize, answers: &Answers) -> Vec<Found> {
        let mut columns = answers.chain(self.frame, 0, &[SlopeKind::Turn]);
        columns.extend(answers.mount(self.turning.mount));
        columns.extend(self.turning.heading.map(|i| (answers.columns.headings[i], (Cause::Own, 0))));
        vec![Found { row, count: 3, part: 0, columns }]
    }

    /// If R_p becomes R_p Exp(d), Log(R_m' R_p) changes by Jr^-1 d.
    #[inline(always)]
    fn slopes<const FUSED: bool>(&self, groups: &[Group], at: Moving, out: &mut SparseJacobian) {
        let axes = self.root_from_sensor(&at.frames[self.frame].rotation, at.worn.mounts);
        let rows = self.turning.rows(columns(&axes), at.references, at.worn.headings);
        let inverse = right_jacobian_inverse(rows.0);
        // For rotations in root axes: Jr^-1 R_p'. Its columns are the rows of R_p Jr^-T.
        let by_turn: Columns = transposed(&axes.times_transposed(&inverse));
        let mount = self.turning.mount.and_then(|i| at.worn.mounts.get(i));
        for group in groups {
            for (slope, (cause, _)) in out.rows_of(group.triple).iter_mut().zip(&group.causes) {
                slope.rows = match *cause {
                    Cause::Slope(k) => times::<FUSED>(&by_turn, at.slopes.slope(k).turn, [0.0; 4]),
                    Cause::Own => times::<FUSED>(&by_turn, Vec3(self.turning.up), [0.0; 4]),
                    Cause::Mount(k) => {
                        let own = right_jacobian(mount.map_or([0.0; 3], |m| m.0)).column(k);
                        let [x, y, z] = inverse.apply(own).0;
                        [x, y, z, 0.0]
                    }
                    Cause::Stretch(_) | Cause::Base(_) => [0.0; 4],
                };
            }
        }
    }

    fn seat(&self, row: usize, homes: &Homes) -> (OrientationSeat, Reach) {
        let own = homes.own_mount(self.turning.mount).max(homes.own_heading(self.turning.heading));
        let piece = homes.pieces.homes[self.frame].piece;
        let rotation = homes.rotation(self.frame).times(&self.rotation);
        (OrientationSeat { row, piece, rotation, turning: self.turning }, homes.reach(self.frame, own))
    }

    fn refer(&self, rows: &mut [f64]) -> Option<Mat3<f64>> {
        if rows.iter().any(|x| x.is_nan()) {
            rows.fill(f64::NAN);
            return None;
        }
        let measured = Turn::exp([rows[0], rows[1], rows[2]]).matrix();
        rows.fill(0.0);
        Some(self.root_from_reference.times(&measured))
    }
}

/// An orientation sensor on its rigid piece.
#[derive(Debug, Clone)]
pub struct OrientationSeat {
    row: usize,
    piece: usize,
    /// Piece from sensor.
    rotation: Mat3<f64>,
    turning: Turning,
}

impl Sits for OrientationSeat {
    fn mark(&self, wanted: &mut [Wanted]) {
        wanted[self.piece].place = true;
    }

    #[inline(always)]
    fn predict<const FUSED: bool>(&self, mut near: Nearby<FUSED>) {
        if !near.posed {
            near.keep(Some(self.row), 3);
            return;
        }
        let axes = turned(self.rotation.everywhere(), self.turning.mount, near.around.mounts);
        let axes = columns(&axes).map(|axis| near.direction(self.piece, axis));
        near.put(self.row, self.turning.rows(axes, near.around.references, near.around.headings));
    }

    fn seen_by(&self, v: &[Vec3<f64>], mounts: &[Vec3<f64>]) -> Option<Vec3<f64>> {
        Some(turned(self.rotation, self.turning.mount, mounts).apply_transposed(v[self.piece]))
    }
}
