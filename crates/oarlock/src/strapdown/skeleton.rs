//! `Skeleton`: a model as links and joints: which links have units, how the others hang between them, and which joints close.

use super::attach::Attach;
use super::filter::dot;
use super::joint::{Hinge, Turns};
use super::pieces::Pieces;
use super::sensors::{Measures, Sensor};
use super::slides::{is_encoded, Slide};
use crate::body::{Body, Field};
use crate::error::{Error, Result};
use crate::model::transform::evaluate_three;
use crate::model::{BaseAcceleration, Joint, JointKind, Model, SensorKind};
use crate::rotation::{Mat3, Vec3};
use crate::sensor::{MountValue, Quantity};

/// Axes that move as one.
#[derive(Debug, Clone)]
pub struct Link {
    /// The link that carries its joint; `None`: the room.
    pub parent: Option<usize>,
    /// What its joint lets turn.
    pub turns: Turns,
    /// Position of the joint in the parent's axes, m. In its own axes it is the origin.
    pub arm: Vec3<f64>,
    /// How its orientation is known.
    pub pose: Pose,
    /// The frame behind its joint, and the link from that frame.
    pub frame: usize,
    pub frame_axes: Mat3<f64>,
    /// Rotation against the parent at rest, and how far it turns about its axes (standard deviations), rad.
    pub rest: Mat3<f64>,
    pub range_rad: [f64; 3],
    /// Hinges or ball of its joint, with their limits.
    pub joints: Vec<Joint>,
}

/// How a link's orientation is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pose {
    /// From its unit, by number.
    Unit(usize),
    /// From its own joint state, by number, against a link nearer to a unit; `None`: against the room.
    State(usize, Option<usize>),
    /// Between its parent and the child that its other joint carries: this share of their turn, from rest, belongs to its own joint. Two stiff
    /// joints in a row cannot be told apart by the units beyond them.
    Between(usize, f64),
    /// From encoders of its joint, against the room or another such link.
    Driven,
}

/// An inertial unit.
#[derive(Debug, Clone)]
pub struct Unit {
    /// Its source in the measurement vector, and the first rows of gyroscope and accelerometer.
    pub source: usize,
    pub gyro: usize,
    pub accel: usize,
    /// Its sensor in the model, and its link.
    pub sensor: usize,
    pub link: usize,
    /// Link from unit, and its position in the link, m.
    pub mount: Mat3<f64>,
    pub offset: Vec3<f64>,
    /// Standard deviations of its mount about the link's axes, rad.
    pub mount_std_rad: [f64; 3],
    /// Whether it never turns on its link.
    pub rigid: bool,
    /// What soft tissue turns it about each axis, rad.
    pub soft_std_rad: f64,
    /// The point that touches the ground, in the unit's axes, and its speed there, m/s.
    pub contact: Option<(Vec3<f64>, f64)>,
    /// White noise of a reading of gyroscope, rad/s, and accelerometer, m/s2, as the model states it.
    pub noise_std: [f64; 2],
    /// Start and random walk of the biases of gyroscope and accelerometer.
    pub bias: [[f64; 2]; 2],
}

/// Joints between two units, or between the room and a unit, that meet in a point through links without units.
#[derive(Debug, Clone)]
pub struct Closure {
    /// The link whose joint it is.
    pub link: usize,
    /// The unit whose axes read it, and the joint's point in them, m.
    pub from: End,
    /// From one to the other through links without units.
    pub through: Vec<Leg>,
    pub to: End,
    /// By how much each of its points is off where the model's parameters are, in the axes of its unit: variances, m2. Without those
    /// parameters that are states.
    pub spread_m2: [Vec3<f64>; 2],
    /// What the parameters that are states do to it.
    pub lengths: Vec<ByLength>,
    /// Of a loop of the model, how far its points are apart, standard deviation, m; `None`: a joint.
    pub loop_std_m: Option<f64>,
}

/// What one standard deviation of a parameter does to a closure, m: to its points in the axes of each end, and to its legs.
#[derive(Debug, Clone)]
pub struct ByLength {
    /// Number among the skeleton's lengths.
    pub number: usize,
    pub ends: [Vec3<f64>; 2],
    pub legs: Vec<Vec3<f64>>,
}

/// Axes of two links (`None`: of the room) that a loop of the model keeps together, and the standard deviation of their difference.
#[derive(Debug, Clone, Copy)]
pub struct Axes {
    pub ends: [(Option<usize>, Vec3<f64>); 2],
    pub std: f64,
}

/// One end of a closure.
#[derive(Debug, Clone, Copy)]
pub enum End {
    /// Unit, and the point in its axes, m.
    Unit(usize, Vec3<f64>),
    /// A point of the room, m.
    Room(Vec3<f64>),
}

impl End {
    /// Its unit; `None`: the room.
    pub fn unit(&self) -> Option<usize> {
        match self {
            End::Unit(u, _) => Some(*u),
            End::Room(_) => None,
        }
    }

    pub fn point_mut(&mut self) -> &mut Vec3<f64> {
        match self {
            End::Unit(_, point) | End::Room(point) => point,
        }
    }

    /// Its point, m.
    pub fn point(&self) -> Vec3<f64> {
        match self {
            End::Unit(_, point) | End::Room(point) => *point,
        }
    }
}

/// A vector in the axes of a link (`None`: of the room), m; along a slide, for each metre of its coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    pub link: Option<usize>,
    pub vector: Vec3<f64>,
    pub by: Option<usize>,
}

/// A unit's end, or the room's, and the legs from there to a point through links without a unit.
pub type Way = (End, Vec<Leg>);

/// A joint between two hinges that meet, on the piece between them: the link that carries it, its position there, and the hinges so far.
type Begun = (Option<usize>, Vec3<f64>, Vec<Hinge>);

/// Mounts of a calibration, by sensor of the model.
#[derive(Debug, Clone)]
pub struct Mounts {
    /// `None`: the nominal one.
    pub values: Vec<Option<MountValue>>,
    /// Standard deviations about the link's axes, rad.
    pub stds_rad: Vec<[f64; 3]>,
}

/// A model as links.
#[derive(Debug, Clone)]
pub struct Skeleton {
    /// Parents first.
    pub links: Vec<Link>,
    pub units: Vec<Unit>,
    /// Joints, then loops.
    pub closures: Vec<Closure>,
    pub loop_axes: Vec<Axes>,
    /// Sensors that are no gyroscope or accelerometer.
    pub sensors: Vec<Sensor>,
    /// Links with a joint state, by its number. Those that others hang on come first.
    pub loose: Vec<usize>,
    /// The vertical, and the reading of a resting accelerometer, m/s2, in the room's axes.
    pub up: Vec3<f64>,
    pub gravity_m_s2: f64,
    /// Horizontal vector from which azimuths count, the field's azimuth if it is known, rad, and its random walk, rad per sqrt(s).
    pub forward: Vec3<f64>,
    pub field: Field,
    pub azimuth_rad: Option<f64>,
    pub azimuth_walk: f64,
    /// Whether the root is accelerated in all directions: its joints turn against the room and go with nothing.
    pub pushed: bool,
    /// Else: accelerations of the room in some directions, all of the model's.
    pub pushes: Vec<BaseAcceleration>,
    /// Parameters of the model that are states, in standard deviations from their values: where loops of the model hold the links.
    pub lengths: Vec<usize>,
    /// Slides that no encoder reads.
    pub slides: Vec<Slide>,
    /// Coordinates of all joints at rest, rad or m: those of encoders that say nothing.
    pub rest: Vec<f64>,
    /// Whether the model has an encoder of it, by coordinate.
    pub encoded: Vec<bool>,
}

impl Skeleton {
    /// The links of a body whose units have readings if `present`, by source, and whose coordinates encoders read, after these.
    pub fn new(body: &Body, present: &[bool], mounts: &Mounts) -> Result<Self> {
        refuse_unknown(body)?;
        let mut skeleton = Self::of(body, present, mounts)?;
        skeleton.spread_points(body, present, mounts)?;
        Ok(skeleton)
    }

    /// Whether loops of the model hold links without a unit.
    pub fn is_held(&self) -> bool {
        self.closures.iter().any(|closure| closure.loop_std_m.is_some() && !closure.through.is_empty())
    }

    /// Moves each parameter by its standard deviation, and sees how far points and legs of closures go.
    fn spread_points(&mut self, body: &Body, present: &[bool], mounts: &Mounts) -> Result<()> {
        let mut moved = body.clone();
        let are_states = self.is_held();
        for (i, parameter) in body.model.parameters.iter().enumerate() {
            let Some(std) = parameter.std else { continue };
            moved.parameters[i] = body.parameters[i] + std;
            let other = Self::of(&moved, present, mounts)?;
            moved.parameters[i] = body.parameters[i];
            let number = self.lengths.len();
            for (own, other) in self.closures.iter_mut().zip(&other.closures) {
                let ends =
                    [(own.from, other.from), (own.to, other.to)].map(|(here, there)| there.point() - here.point());
                let legs = own.through.iter().zip(&other.through).map(|(here, there)| there.vector - here.vector);
                let by = ByLength { number, ends, legs: legs.collect() };
                if !are_states {
                    own.spread_m2.iter_mut().zip(ends).for_each(|(spread, end)| *spread += Vec3(end.0.map(|x| x * x)));
                } else if by.ends.iter().chain(&by.legs).any(|v| v.0 != [0.0; 3]) {
                    own.lengths.push(by);
                }
            }
            if self.closures.iter().any(|c| c.lengths.last().is_some_and(|by| by.number == number)) {
                self.lengths.push(i);
            }
        }
        Ok(())
    }

    fn of(body: &Body, present: &[bool], mounts: &Mounts) -> Result<Self> {
        let (pieces, world) = (Pieces::of(body), &body.model.world);
        let mut skeleton = Skeleton {
            links: Vec::new(),
            units: Vec::new(),
            closures: Vec::new(),
            loop_axes: Vec::new(),
            sensors: Vec::new(),
            loose: Vec::new(),
            up: Vec3(world.up),
            gravity_m_s2: world.gravity_m_s2,
            forward: Vec3(world.forward),
            field: Field::new(world, &body.parameters),
            azimuth_rad: world.azimuth_fixed.then_some(world.magnetic_azimuth_rad),
            azimuth_walk: world.azimuth_walk,
            pushed: is_pushed(&body.model),
            pushes: if is_pushed(&body.model) { Vec::new() } else { bounded(&body.model.base_accelerations) },
            lengths: Vec::new(),
            slides: Slide::all(body),
            rest: body.axes.iter().map(|axis| axis.rest).collect(),
            encoded: (0..body.axes.len()).map(|c| body.model.encoder(c).is_some()).collect(),
        };
        let sensors = body.model.sensors.iter().enumerate();
        let imus: Vec<(usize, usize)> = sensors
            .filter_map(|(i, sensor)| {
                let source = body.suite.sources.iter().position(|s| s.name == sensor.name)?;
                let SensorKind::Imu(imu) = &sensor.kind else { return None };
                (present[source] && imu.noise.gyro_std.is_some() && imu.noise.accel_std.is_some())
                    .then_some((i, source))
            })
            .collect();
        let frames: Vec<usize> = imus
            .iter()
            .map(|(i, _)| match &body.model.sensors[*i].kind {
                SensorKind::Imu(imu) => imu.frame,
                _ => 0,
            })
            .collect();
        let place = skeleton.place_links(body, &pieces, &frames)?;
        for ((sensor, source), frame) in imus.into_iter().zip(frames) {
            skeleton.place_unit(body, &pieces, &place, (sensor, source, frame), mounts)?;
        }
        skeleton.drive(&body.model, &present[body.suite.sources.len()..]);
        skeleton.hang(!body.model.closures.is_empty());
        if skeleton.units.is_empty() {
            return Err(Error::Data(format!(
                "model '{}': no unit has readings of gyroscope and accelerometer at the start; strapdown links need one",
                body.model.name
            )));
        }
        skeleton.refuse_adrift(body)?;
        skeleton.close();
        let attach = Attach { body, pieces: &pieces, place: &place };
        attach.loops(&mut skeleton)?;
        attach.sensors(&mut skeleton)?;
        Ok(skeleton)
    }

    /// Refuses links that no joints connect to a unit.
    fn refuse_adrift(&self, body: &Body) -> Result<()> {
        let adrift = self.links.iter().find(|link| matches!(link.pose, Pose::State(usize::MAX, _)));
        adrift.map_or(Ok(()), |link| {
            Err(Error::Data(format!(
                "model '{}': nothing tells how '{}' moves: no unit with readings of gyroscope and accelerometer is on it or on what its \
                 joints connect it to; give its unit's stream, or leave it out of the model",
                body.model.name, body.model.frames[link.frame].name
            )))
        })
    }

    /// Whether units have magnetometers.
    pub fn has_fields(&self) -> bool {
        self.sensors.iter().any(|sensor| matches!(sensor.measures, Measures::Field(_)))
    }

    /// The same room without links, units and joints.
    pub fn without_joints(&self) -> Self {
        let (links, units, closures, loop_axes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (sensors, loose, pushes) = (Vec::new(), Vec::new(), Vec::new());
        let (lengths, slides, rest, encoded) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Skeleton { links, units, closures, loop_axes, sensors, loose, pushes, lengths, slides, rest, encoded, ..*self }
    }

    /// Links of the model's pieces: hinges that meet in a point make one joint. Returns the link of each piece.
    fn place_links(&mut self, body: &Body, pieces: &Pieces, with_units: &[usize]) -> Result<Vec<Option<usize>>> {
        let model = &body.model;
        let mut place = vec![None; pieces.all.len()];
        let mut open: Vec<Option<Begun>> = vec![None; pieces.all.len()];
        for (p, piece) in pieces.all.iter().enumerate().skip(1) {
            let (joint, sign) = piece.joint;
            let joint = &model.joints[joint];
            let (parent, arm, mut hinges) = match open[piece.parent].clone() {
                Some(before) => before,
                None => (place[piece.parent], piece.arm, Vec::new()),
            };
            let turns = match joint.kind {
                JointKind::Free => Turns::Free(joint.first, piece.entry),
                JointKind::Ball => Turns::Ball(joint.first, piece.entry),
                JointKind::Slide => {
                    let axis = piece.entry.apply(Vec3([0.0, 0.0, sign]));
                    Turns::Slide(joint.first, piece.entry, axis)
                }
                _ => {
                    hinges.push(Hinge { coordinate: joint.first, sign, entry: piece.entry });
                    Turns::Hinges(hinges.clone())
                }
            };
            let children: Vec<usize> = (1..pieces.all.len()).filter(|c| pieces.all[*c].parent == p).collect();
            let meets = |c: usize| {
                let next = &pieces.all[c];
                model.joints[next.joint.0].kind == JointKind::Hinge && next.arm.0.iter().all(|x| x.abs() < 1e-9)
            };
            let is_between = joint.kind == JointKind::Hinge
                && hinges.len() < 3
                && children.len() == 1
                && meets(children[0])
                && !with_units.iter().any(|f| pieces.homes[*f].piece == p);
            if is_between {
                open[p] = Some((parent, arm, hinges));
                continue;
            }
            let (rest, range_rad) = rest_and_range(body, &turns);
            let frame_axes = pieces.homes[piece.frame].rotation;
            let coordinates = turns.coordinates().into_iter().flatten();
            let joints = coordinates.filter_map(|c| model.joints.iter().find(|j| j.first == c).cloned()).collect();
            self.links.push(Link {
                parent,
                turns,
                arm,
                pose: Pose::State(usize::MAX, None),
                rest,
                range_rad,
                joints,
                frame: piece.frame,
                frame_axes,
            });
            place[p] = Some(self.links.len() - 1);
        }
        Ok(place)
    }

    fn place_unit(
        &mut self,
        body: &Body,
        pieces: &Pieces,
        place: &[Option<usize>],
        (sensor, source, frame): (usize, usize, usize),
        mounts: &Mounts,
    ) -> Result<()> {
        let model = &body.model;
        let home = &pieces.homes[frame];
        let name = &model.sensors[sensor].name;
        let Some(mut link) = place[home.piece] else {
            return Err(Error::Model(format!(
                "model '{}': unit '{name}' stands in the room: structure \"strapdown\" needs units on links that move",
                model.name
            )));
        };
        if let Pose::Unit(other) = self.links[link].pose {
            let other = &model.sensors[self.units[other].sensor].name;
            return Err(Error::Model(format!(
                "model '{}': units '{other}' and '{name}' sit on one link: structure \"strapdown\" takes one; leave one out \
                 with Model.with_units, or use structure \"tree\"",
                model.name
            )));
        }
        if let Turns::Slide(..) = self.links[link].turns {
            link = self.place_rigidly(link);
        }
        let part = |quantity| {
            let parts = &body.suite.sources[source].parts;
            parts.iter().find(|p| p.quantity == quantity).map_or(0, |p| p.rows.start)
        };
        let SensorKind::Imu(imu) = &model.sensors[sensor].kind else { return Ok(()) };
        let nominal = || (imu.mount.rotation, evaluate_three(&imu.mount.offset, &body.parameters));
        let (rotation, offset) = mounts.values[sensor].unwrap_or_else(nominal);
        let mount = home.rotation.times(&rotation);
        let offset = home.origin + home.rotation.apply(Vec3(offset));
        let contact = imu.contact.as_ref().map(|c| {
            let point = home.origin + home.rotation.apply(Vec3(evaluate_three(&c.point, &body.parameters)));
            (mount.apply_transposed(point - offset), c.std_m_s)
        });
        let noise = &imu.noise;
        self.links[link].pose = Pose::Unit(self.units.len());
        self.units.push(Unit {
            source,
            gyro: part(Quantity::Gyro),
            accel: part(Quantity::Accel),
            sensor,
            link,
            mount,
            offset,
            mount_std_rad: mounts.stds_rad[sensor],
            rigid: imu.mount.rigid,
            soft_std_rad: imu.mount.soft_std_rad,
            contact,
            noise_std: [noise.gyro_std, noise.accel_std].map(|std| std.unwrap_or(0.0)),
            bias: [
                [noise.gyro_bias_start_std, noise.gyro_bias_walk],
                [noise.accel_bias_start_std, noise.accel_bias_walk],
            ],
        });
        Ok(())
    }
}

impl Skeleton {
    /// A link that a slide carries and that does not turn against it: a slide has no states of a unit.
    fn place_rigidly(&mut self, slide: usize) -> usize {
        let own = Link {
            parent: Some(slide),
            turns: Turns::Hinges(Vec::new()),
            arm: Vec3([0.0; 3]),
            rest: Mat3::identity(),
            joints: Vec::new(),
            ..self.links[slide].clone()
        };
        self.links.push(own);
        self.links.len() - 1
    }
}

/// Rotation of a joint at rest, and its range about the child's axes: that of its hinges, spread over all directions.
fn rest_and_range(body: &Body, turns: &Turns) -> (Mat3<f64>, [f64; 3]) {
    let coordinates: Vec<usize> = turns.coordinates().into_iter().flatten().collect();
    let mut q = [0.0; 3];
    q.iter_mut().zip(&coordinates).for_each(|(q, c)| *q = body.axes[*c].rest);
    let ranges = coordinates.iter().map(|c| body.axes[*c].prior_std().powi(2));
    let range = (ranges.sum::<f64>() / coordinates.len() as f64).sqrt();
    (turns.rotation(q), [range.min(WIDEST_RAD); 3])
}

/// Widest range of a joint without a unit, rad.
const WIDEST_RAD: f64 = 0.7;

/// Correlation time of an acceleration of the room whose model states none, s.
const PUSH_TIME_S: f64 = 0.3;

/// Accelerations that wander for ever would take the vertical with them: none lasts longer than the room keeps its speed.
fn bounded(pushes: &[BaseAcceleration]) -> Vec<BaseAcceleration> {
    let bound = |push: &BaseAcceleration| match push.time_s.is_finite() {
        true => push.clone(),
        false => BaseAcceleration {
            time_s: PUSH_TIME_S,
            density: push.start_std * (2.0 / PUSH_TIME_S).sqrt(),
            ..push.clone()
        },
    };
    pushes.iter().map(bound).collect()
}

/// Whether base accelerations have all three directions.
fn is_pushed(model: &Model) -> bool {
    let axes: Vec<Vec3<f64>> = model.base_accelerations.iter().map(|b| Vec3(b.axis)).collect();
    axes.len() == 3 && dot(axes[0].cross(axes[1]), axes[2]).abs() > 0.5
}

/// Refuses what strapdown links do not track yet.
fn refuse_unknown(body: &Body) -> Result<()> {
    let model = &body.model;
    let is_read = |kind: &SensorKind| !matches!(kind, SensorKind::Range(_) | SensorKind::Orientation(_));
    let sensors = model.sensors.iter().find(|s| !is_read(&s.kind));
    let what = sensors.map(|s| format!("sensor '{}' measures a distance or an orientation", s.name)).or_else(|| {
        let shared = Pieces::of(body).shared_joint();
        shared.map(|j| format!("joint '{}' moves several frames about different axes", model.joints[j].name))
    });
    match what {
        None => Ok(()),
        Some(what) => Err(Error::Model(format!(
            "model '{}': {what}; structure \"strapdown\" tracks links with inertial units that hinges, balls and free joints \
             connect. Use structure = \"tree\"",
            model.name
        ))),
    }
}

impl Skeleton {
    /// Links without a unit whose joints have encoders that are read, from the room on, and where loops of the model hold them; slides anywhere.
    fn drive(&mut self, model: &Model, is_read: &[bool]) {
        let has_loops = !model.closures.is_empty();
        for l in 0..self.links.len() {
            let link = &self.links[l];
            let is_known = |c: usize| is_encoded(model, c) && (is_read[c] || model.encoder(c).is_none());
            let has_encoders = match &link.turns {
                Turns::Slide(..) => true,
                Turns::Hinges(hinges) => hinges.iter().all(|h| is_known(h.coordinate)),
                Turns::Free(..) | Turns::Ball(..) => false,
            };
            let has_unit = matches!(link.pose, Pose::Unit(_));
            let is_slide = matches!(link.turns, Turns::Slide(..));
            let on_encoders = link.parent.is_none_or(|p| self.links[p].pose == Pose::Driven);
            if has_encoders && !has_unit && (is_slide || on_encoders || has_loops) {
                self.links[l].pose = Pose::Driven;
            }
        }
    }
}
