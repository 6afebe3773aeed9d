//! Attaches a model's loops, and sensors that are no gyroscope or accelerometer, to its links. `skeleton` uses it.

use super::joint::Turns;
use super::pieces::Pieces;
use super::sensors::{Measures, Place, Sensor};
use super::skeleton::{Axes, End, Pose, Skeleton, Way};
use crate::body::Body;
use crate::error::{Error, Result};
use crate::model::transform::evaluate_three;
use crate::model::{Expr, SensorKind};
use crate::rotation::Vec3;
use crate::sensor::Quantity;

/// A body, its pieces, and the link of each.
pub struct Attach<'a> {
    pub body: &'a Body,
    pub pieces: &'a Pieces,
    pub place: &'a [Option<usize>],
}

impl Attach<'_> {
    /// Loops of the model: points, and axes, of two links or of a link and the room that stay together.
    pub fn loops(&self, skeleton: &mut Skeleton) -> Result<()> {
        for closure in &self.body.model.closures {
            let [(a, at_a), (b, at_b)] = &closure.sides;
            let (from, to) =
                (self.way(skeleton, *a, at_a, &closure.name)?, self.way(skeleton, *b, at_b, &closure.name)?);
            // A point of the room is read from the unit's side, in its axes.
            let (from, to) = if matches!(from.0, End::Room(_)) { (to, from) } else { (from, to) };
            let link = self.link(*a, &closure.name)?.or(self.link(*b, &closure.name)?).unwrap_or_default();
            let joined = skeleton.closure(link, from, to, Some(closure.std_m));
            skeleton.closures.push(joined);
            if let Some(axes) = closure.axes {
                let axis = |side: usize| -> Result<(Option<usize>, Vec3<f64>)> {
                    let frame = closure.sides[side].0;
                    let home = &self.pieces.homes[frame];
                    Ok((self.link(frame, &closure.name)?, home.rotation.apply(Vec3(axes[side]))))
                };
                skeleton.loop_axes.push(Axes { ends: [axis(0)?, axis(1)?], std: closure.std_axis });
            }
        }
        Ok(())
    }

    /// Encoders, positions and magnetometers of units.
    pub fn sensors(&self, skeleton: &mut Skeleton) -> Result<()> {
        let (model, suite) = (&self.body.model, &self.body.suite);
        let mut all = Vec::new();
        for sensor in &model.sensors {
            let source = suite.sources.iter().find(|s| s.name == sensor.name);
            let row = source.map(|s| Place::Row(s.rows.start));
            match &sensor.kind {
                SensorKind::Encoder(encoder) => {
                    let joint = &model.joints[encoder.joint];
                    let (at, std) = match joint.input {
                        true => (Some(Place::Input(joint.first)), joint.input_std),
                        false => (row, encoder.std),
                    };
                    let measures = skeleton.angle(joint.first);
                    all.extend(at.zip(measures).map(|(at, measures)| Sensor { at, std, measures }));
                }
                SensorKind::Position(position) => {
                    let (end, through) = self.way(skeleton, position.frame, &position.point, &sensor.name)?;
                    let measures = Measures::Point(end, through);
                    all.extend(row.map(|at| Sensor { at, std: position.std_m, measures }));
                }
                SensorKind::Imu(_) | SensorKind::Range(_) | SensorKind::Orientation(_) => {}
            }
        }
        for joint in model.joints.iter().filter(|j| j.input) {
            let at = Place::Input(joint.first);
            let measures = skeleton.angle(joint.first);
            if !all.iter().any(|s: &Sensor| s.at == at) {
                all.extend(measures.map(|measures| Sensor { at, std: joint.input_std, measures }));
            }
        }
        for (u, unit) in skeleton.units.iter().enumerate() {
            let mag = suite.sources[unit.source].parts.iter().find(|p| p.quantity == Quantity::Mag);
            let SensorKind::Imu(imu) = &model.sensors[unit.sensor].kind else { continue };
            let measures = Measures::Field(u);
            all.extend(mag.zip(imu.noise.mag_std).map(|(part, std)| Sensor {
                at: Place::Row(part.rows.start),
                std,
                measures,
            }));
        }
        skeleton.sensors = all;
        Ok(())
    }

    /// From a unit to a point of a frame, m in its axes.
    fn way(&self, skeleton: &Skeleton, frame: usize, point: &[Expr; 3], name: &str) -> Result<Way> {
        let home = &self.pieces.homes[frame];
        let at = home.origin + home.rotation.apply(Vec3(evaluate_three(point, &self.body.parameters)));
        Ok(self.link(frame, name)?.map_or((End::Room(at), Vec::new()), |l| skeleton.way(l, at)))
    }

    /// Link of a frame; `None`: the room.
    fn link(&self, frame: usize, name: &str) -> Result<Option<usize>> {
        let piece = self.pieces.homes[frame].piece;
        match self.place[piece] {
            None if piece > 0 => Err(Error::Model(format!(
                "model '{}': '{name}' is at frame '{}', between hinges that meet in a point; structure \"strapdown\" needs it on what \
                 they carry, or use structure \"tree\"",
                self.body.model.name, self.body.model.frames[frame].name
            ))),
            link => Ok(link),
        }
    }
}

impl Skeleton {
    /// The angle of the hinge with this coordinate.
    fn angle(&self, coordinate: usize) -> Option<Measures> {
        self.links.iter().enumerate().find_map(|(l, link)| {
            if matches!(link.turns, Turns::Slide(c, ..) if c == coordinate) {
                return Some(Measures::Input(coordinate));
            }
            let own = link.turns.coordinates().iter().position(|c| *c == Some(coordinate));
            own.map(|k| if link.pose == Pose::Driven { Measures::Input(coordinate) } else { Measures::Angle(l, k) })
        })
    }
}
