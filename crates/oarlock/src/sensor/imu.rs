//! Inertial unit: angular velocity, specific force and magnetic field in its own axes (eq. 8, with the sensor's offset
//! on its link, and gravity once).

mod contact;
mod seen;

use super::kind::{Described, Kind, Pending, Reads, Sits};
use super::mount::turned;
use super::near::{put, Around, Homes, Nearby, Stand};
use super::slopes::{Answers, Cause, Column, Found, Group, Moving};
use super::{Fit, Mount, Quantity, RowGroups, Scene, SlowError, Worn};
use crate::kernels::lane::{Lane, Real};
use crate::kernels::sparse_jacobian::SparseJacobian;
use crate::kinematics::near::{Near, Reach, Wanted};
use crate::kinematics::slopes::Kind as SlopeKind;
use crate::kinematics::FrameMotion;
use crate::model::section::{Known, Section};
use crate::model::slot::Slot;
use crate::model::Point;
use crate::rotation::{Mat3, Vec3};
pub use contact::Contact;
use contact::ContactReader;
use seen::Seen;
use serde_json::{json, Value};

/// Noise of an inertial unit; a quantity that is `None` is not measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuNoise {
    /// Gyroscope, rad/s.
    pub gyro_std: Option<f64>,
    /// Accelerometer, m/s2.
    pub accel_std: Option<f64>,
    /// Magnetometer, uT.
    pub mag_std: Option<f64>,
    /// Standard deviation of the angular velocity at detected rest, rad/s; `None`: no rest detection.
    pub rest_std: Option<f64>,
    /// Range of the gyroscope, rad/s; `None`: unknown.
    pub gyro_range: Option<f64>,
    /// Range of the accelerometer, m/s2; `None`: unknown.
    pub accel_range: Option<f64>,
    /// Gyroscope's bias at the start, rad/s.
    pub gyro_bias_start_std: f64,
    /// Its random walk, rad/s per sqrt(s).
    pub gyro_bias_walk: f64,
    /// Accelerometer's bias at the start, m/s2.
    pub accel_bias_start_std: f64,
    /// Its random walk, m/s2 per sqrt(s).
    pub accel_bias_walk: f64,
}

/// Inertial unit on a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Imu {
    /// Index of the frame.
    pub frame: usize,
    /// Its mount on the link.
    pub mount: Mount,
    /// Its noise.
    pub noise: ImuNoise,
    /// The point of the frame that touches the ground while the unit's link stands.
    pub contact: Option<Contact>,
}

impl Kind for Imu {
    const NAME: &'static str = "imu";
    const KEYS: Known = &[
        "frame",
        "mount",
        "gyro_std_rad_s",
        "accel_std_m_s2",
        "mag_std_ut",
        "rest_std_rad_s",
        "contact",
        "gyro_range_rad_s",
        "accel_range_m_s2",
        "gyro_bias_start_std_rad_s",
        "gyro_bias_walk",
        "accel_bias_start_std_m_s2",
        "accel_bias_walk",
    ];
    type Reader = ImuReader;

    fn read(section: &Section) -> Pending<Self> {
        let noise = read_noise(section);
        check_quantities(section, &noise);
        let frame = section.need_reference("frame", "\"r_elbow\"");
        let mount = Mount::read(section);
        let contact = Contact::read(section, &noise);
        Box::new(move |at| {
            if noise.mag_std.is_some() {
                at.need_magnetic_field("has a magnetometer (mag_std_ut)");
            }
            if contact.is_some() && !at.model.base_accelerations.is_empty() {
                at.mistake(at.name.at, contact::ROOT_MOVES);
            }
            Some(Imu { frame: at.frame("frame", &frame)?, mount, noise, contact })
        })
    }

    fn describe(&self, at: &Described) -> Value {
        let noise = &self.noise;
        json!({"frame": at.frame(self.frame),
            "gyro_std_rad_s": noise.gyro_std, "accel_std_m_s2": noise.accel_std, "mag_std_ut": noise.mag_std,
            "rest_std_rad_s": noise.rest_std, "contact": self.contact.as_ref().map(|c| c.describe(at)),
            "gyro_range_rad_s": noise.gyro_range, "accel_range_m_s2": noise.accel_range,
            "mount": at.mount(&self.mount)})
    }

    fn reader(&self, fit: &Fit) -> Option<ImuReader> {
        let own = || (self.mount.rotation, fit.point(&self.mount.offset));
        let (rotation, offset) = fit.given.map_or_else(own, |(rotation, offset)| (rotation, Point::fixed(offset)));
        let contact = self.contact.as_ref().map(|c| c.reader(self.frame, fit));
        Some(ImuReader { frame: self.frame, rotation, offset, noise: self.noise, contact, mount: fit.mount })
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

    fn slow_errors(&self) -> Vec<SlowError> {
        let noise = &self.noise;
        let walks = |quantity, name, start_std, walk| SlowError {
            quantity,
            name,
            asked: Some(name),
            start_std,
            walk,
            time_s: f64::INFINITY,
        };
        let gyro = || walks(Quantity::Gyro, "gyro_bias", noise.gyro_bias_start_std, noise.gyro_bias_walk);
        let accel = || walks(Quantity::Accel, "accel_bias", noise.accel_bias_start_std, noise.accel_bias_walk);
        noise.gyro_std.map(|_| gyro()).into_iter().chain(noise.accel_std.map(|_| accel())).collect()
    }
}

fn read_noise(section: &Section) -> ImuNoise {
    let std = |key, unit| section.get(key).map(|slot: Slot| slot.positive(unit).unwrap_or(1.0));
    let walk = |key, default| section.get(key).and_then(|slot| slot.not_negative("")).unwrap_or(default);
    ImuNoise {
        gyro_std: std("gyro_std_rad_s", "rad/s"),
        accel_std: std("accel_std_m_s2", "m/s2"),
        mag_std: std("mag_std_ut", "uT"),
        rest_std: std("rest_std_rad_s", "rad/s"),
        gyro_range: std("gyro_range_rad_s", "rad/s"),
        accel_range: std("accel_range_m_s2", "m/s2"),
        gyro_bias_start_std: std("gyro_bias_start_std_rad_s", "rad/s").unwrap_or(0.02),
        gyro_bias_walk: walk("gyro_bias_walk", 1.1e-5),
        accel_bias_start_std: std("accel_bias_start_std_m_s2", "m/s2").unwrap_or(0.05),
        accel_bias_walk: walk("accel_bias_walk", 1.1e-4),
    }
}

fn check_quantities(section: &Section, noise: &ImuNoise) {
    if noise.gyro_std.is_none() && noise.accel_std.is_none() && noise.mag_std.is_none() {
        let wanted = "expected at least one of gyro_std_rad_s, accel_std_m_s2, mag_std_ut";
        section.mistake(section.at, format!("measures nothing; {wanted}"));
        return;
    }
    let gyro = ["gyro_bias_start_std_rad_s", "gyro_bias_walk", "gyro_range_rad_s"];
    let accel = ["accel_bias_start_std_m_s2", "accel_bias_walk", "accel_range_m_s2"];
    let both = [("gyro_std_rad_s", gyro, noise.gyro_std), ("accel_std_m_s2", accel, noise.accel_std)];
    for (own, its, std) in both {
        for key in its.iter().filter(|key| std.is_none() && section.has(key)) {
            let text = format!("`{key}` without `{own}`: that quantity is not measured; add it or remove this key");
            section.mistake(section.at_key(key), text);
        }
    }
}

/// An inertial unit at one set of parameters and mounts.
#[derive(Debug, Clone)]
pub struct ImuReader {
    frame: usize,
    rotation: Mat3<f64>,
    offset: Point,
    noise: ImuNoise,
    contact: Option<ContactReader>,
    /// Number among the estimated mounts.
    mount: Option<usize>,
}

/// Its parts; the groups of its Jacobian have the same numbers.
const GYRO: usize = 0;
const ACCEL: usize = 1;
const MAG: usize = 2;
const CONTACT: usize = 3;

/// First row of each part.
#[derive(Debug, Clone, Copy)]
struct Parts {
    gyro: Option<usize>,
    accel: Option<usize>,
    mag: Option<usize>,
    rest: Option<usize>,
    contact: Option<usize>,
}

impl ImuReader {
    /// The unit's axes; `mounts` are the rotation vectors of the estimated mounts.
    #[inline(always)]
    fn root_from_sensor<T: Real>(&self, frame: &FrameMotion<T>, mounts: &[Vec3<T>]) -> Mat3<T> {
        turned(frame.rotation.times_f64(&self.rotation), self.mount, mounts)
    }

    /// First row of each of its parts, if the first of all is `row`.
    fn parts(&self, row: usize) -> Parts {
        let mut next = row;
        let mut part = |std: Option<f64>| {
            std.map(|_| {
                next += 3;
                next - 3
            })
        };
        let noise = &self.noise;
        Parts {
            gyro: part(noise.gyro_std),
            accel: part(noise.accel_std),
            mag: part(noise.mag_std),
            rest: part(noise.rest_std),
            contact: part(self.contact.as_ref().map(|c| c.std_m_s)),
        }
    }
}

impl Reads for ImuReader {
    type Seat = ImuSeat;

    /// Rows in the order gyro, accel, mag, rest, contact, as far as the unit has them.
    fn rows(&self) -> RowGroups {
        let touches = self.contact.as_ref().map(|c| c.std_m_s);
        let groups: [(Quantity, &'static [&'static str], Option<f64>); 5] = [
            (Quantity::Gyro, &["gyro_x", "gyro_y", "gyro_z"], self.noise.gyro_std),
            (Quantity::Accel, &["accel_x", "accel_y", "accel_z"], self.noise.accel_std),
            (Quantity::Mag, &["mag_x", "mag_y", "mag_z"], self.noise.mag_std),
            (Quantity::Rest, &["rest_x", "rest_y", "rest_z"], self.noise.rest_std),
            (Quantity::Contact, &["contact_x", "contact_y", "contact_z"], touches),
        ];
        groups.into_iter().filter_map(|(q, names, std)| Some((q, names, vec![std?; 3]))).collect()
    }

    fn mark_frames(&self, needed: &mut [bool]) {
        needed[self.frame] = true;
    }

    fn mark_moving(&self, moving: &mut [bool]) {
        moving[self.frame] = true;
    }

    /// Readings in sensor axes.
    #[inline(always)]
    fn predict<T: Real>(&self, scene: &Scene<T>, out: &mut [T]) {
        let frame = &scene.frames[self.frame];
        let root_from_sensor = self.root_from_sensor(frame, scene.worn.mounts);
        let mut at = 0;
        if self.noise.gyro_std.is_some() {
            see(&root_from_sensor, frame.angular_velocity, out, &mut at);
        }
        if self.noise.accel_std.is_some() {
            let arm = self.offset.turned(&frame.rotation, scene.worn.lengths);
            see(&root_from_sensor, frame.proper_acceleration_at(arm), out, &mut at);
        }
        if self.noise.mag_std.is_some() {
            see(&root_from_sensor, scene.magnetic_field, out, &mut at);
        }
        if self.noise.rest_std.is_some() {
            see(&root_from_sensor, frame.angular_velocity, out, &mut at);
        }
        if let Some(contact) = &self.contact {
            out[at..at + 3].copy_from_slice(&contact.velocity(scene).0);
        }
    }

    fn causes(&self, row: usize, answers: &Answers) -> Vec<Found> {
        let Parts { gyro, accel, mag, rest, contact } = self.parts(row);
        let chain = |kinds: &[SlopeKind]| answers.chain(self.frame, 0, kinds);
        let found = |row, part, mut columns: Vec<Column>| {
            columns.extend(answers.mount(self.mount));
            Found { row, count: 3, part, columns }
        };
        let mut all = Vec::new();
        for row in gyro.into_iter().chain(rest) {
            all.push(found(row, GYRO, chain(&[SlopeKind::Turn, SlopeKind::Rate])));
        }
        if let Some(row) = accel {
            use SlopeKind::{Accel, Push, Rate, Shift, Turn};
            let mut columns = chain(&[Turn, Rate, Accel, Shift, Push]);
            columns.extend(answers.stretches(&self.offset, 0));
            columns.extend(answers.columns.bases.iter().map(|(column, axis)| (*column, (Cause::Base(*axis), 0))));
            all.push(found(row, ACCEL, columns));
        }
        if let Some(row) = mag {
            let mut mag = found(row, MAG, chain(&[SlopeKind::Turn]));
            mag.columns.extend(answers.columns.azimuth.map(|column| (column, (Cause::Own, 0))));
            all.push(mag);
        }
        let touches = contact.zip(self.contact.as_ref());
        all.extend(touches.map(|(row, c)| Found { row, count: 3, part: CONTACT, columns: c.columns(answers) }));
        all
    }

    #[inline(always)]
    fn slopes<const FUSED: bool>(&self, groups: &[Group], at: Moving, out: &mut SparseJacobian) {
        let axes = self.root_from_sensor(&at.frames[self.frame], at.worn.mounts);
        let seen = Seen::new::<FUSED>(at, self.frame, &self.offset, &axes);
        let mount = self.mount.and_then(|i| at.worn.mounts.get(i));
        for group in groups {
            match &self.contact {
                Some(contact) if group.part == CONTACT => contact.write(group, at, out),
                _ => seen.write::<FUSED>(group, mount, out),
            }
        }
    }

    fn seat(&self, row: usize, homes: &Homes) -> (ImuSeat, Reach) {
        let (piece, arm) = homes.place(self.frame, &self.offset);
        let contact = self.contact.as_ref().map(|c| homes.place(self.frame, &c.point).1);
        let touches = contact.as_ref().map_or(0, |point| homes.own(point));
        let own_reach = homes.own(&arm).max(homes.own_mount(self.mount)).max(touches);
        let rotation = homes.rotation(self.frame).times(&self.rotation);
        let seat = ImuSeat { piece, rotation, arm, contact, mount: self.mount, own_reach, parts: self.parts(row) };
        (seat, homes.reach(self.frame, own_reach))
    }
}

/// A vector in the axes of a sensor.
#[inline(always)]
fn see<T: Real>(root_from_sensor: &Mat3<T>, v: Vec3<T>, out: &mut [T], at: &mut usize) {
    [out[*at], out[*at + 1], out[*at + 2]] = root_from_sensor.apply_transposed(v).0;
    *at += 3;
}

/// An inertial unit on its rigid piece.
#[derive(Debug, Clone)]
pub struct ImuSeat {
    piece: usize,
    /// Piece from sensor.
    rotation: Mat3<f64>,
    arm: Point,
    /// Point that touches the ground, in the axes of the piece.
    contact: Option<Point>,
    /// Number among the estimated mounts.
    mount: Option<usize>,
    /// States that its mount and position depend on.
    own_reach: usize,
    parts: Parts,
}

impl Sits for ImuSeat {
    fn mark(&self, wanted: &mut [Wanted]) {
        let piece = &mut wanted[self.piece];
        piece.place = true;
        piece.motion |= self.parts.gyro.or(self.parts.accel).or(self.parts.rest).or(self.parts.contact).is_some();
        piece.field |= self.parts.mag.is_some();
    }

    #[inline(always)]
    fn settle(&self, worn: Worn<f64>, stand: &mut Stand) {
        stand.rotation = match self.mount.and_then(|i| worn.mounts.get(i)) {
            Some(turn) => self.rotation.times(&Mat3::about(*turn)),
            None => self.rotation,
        };
        stand.arm = self.arm.at(worn.lengths);
    }

    /// Reading of the accelerometer alone.
    #[inline(always)]
    fn curve<const FUSED: bool>(&self, near: &Near<Lane<FUSED>>, stand: &Stand, out: &mut [Lane]) {
        if let Some(row) = self.parts.accel {
            put(out, row, stand.rotation.transposed_apply(near.own[self.piece].felt_at(stand.arm)));
        }
    }

    #[inline(always)]
    fn predict<const FUSED: bool>(&self, mut near: Nearby<FUSED>) {
        let (around, stand) = (near.around, near.stand);
        let (differs, own) = (around.near.differs[self.piece], &around.near.own[self.piece]);
        let worn = near.posed && self.own_reach > around.perturbed.from;
        let axes = Axes { nominal: &self.rotation, stand: &stand.rotation, turn: self.turned(around, worn) };
        let Parts { gyro, accel, mag, rest, contact } = self.parts;
        if !differs.motion {
            near.keep(gyro, 3);
            near.keep(accel, 3);
            near.keep(rest, 3);
            near.keep(contact, 3);
        } else {
            if let Some(row) = accel {
                let felt = if worn { own.felt_off(self.arm.at(around.joints.lengths)) } else { own.felt_at(stand.arm) };
                near.put(row, axes.seen(felt));
            }
            if let Some(row) = gyro.or(rest) {
                let spin = axes.seen(own.spin);
                near.put(row, spin);
                if let Some(row) = rest {
                    near.put(row, spin);
                }
            }
            if let Some((row, point)) = contact.zip(self.contact.as_ref()) {
                let velocity = near.velocity(self.piece, point);
                near.put(row, velocity);
            }
        }
        let Some(row) = mag else { return };
        if differs.field || worn {
            let field = if differs.field { own.field } else { around.mean.field_in(self.piece) };
            near.put(row, axes.seen(field));
        } else {
            near.keep(mag, 3);
        }
    }

    fn seen_by(&self, v: &[Vec3<f64>], mounts: &[Vec3<f64>]) -> Option<Vec3<f64>> {
        let nominal = self.rotation.apply_transposed(v[self.piece]);
        let mount = self.mount.and_then(|i| mounts.get(i));
        Some(mount.map_or(nominal, |turn| Mat3::about(*turn).apply_transposed(nominal)))
    }
}

impl ImuSeat {
    /// Rotation of its mount relative to the mean's.
    #[inline(always)]
    fn turned<T: Real>(&self, around: &Around<T>, worn: bool) -> Option<Mat3<T>> {
        match self.mount {
            Some(i) if worn && i < around.mounts.len() => Some(Mat3::about(around.mounts[i])),
            _ => None,
        }
    }
}

/// Axes of a unit: those at the mean, or nominal ones with the estimated mount error.
struct Axes<'a, T> {
    nominal: &'a Mat3<f64>,
    stand: &'a Mat3<f64>,
    turn: Option<Mat3<T>>,
}

impl<T: Real> Axes<'_, T> {
    #[inline(always)]
    fn seen(&self, v: Vec3<T>) -> Vec3<T> {
        match &self.turn {
            Some(turn) => turn.apply_transposed(self.nominal.transposed_apply(v)),
            None => self.stand.transposed_apply(v),
        }
    }
}
