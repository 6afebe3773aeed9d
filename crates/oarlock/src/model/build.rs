//! Builds a model from the file's content: names become indices, parents precede children.

mod check;
mod order;

use super::locate::Mistakes;
use super::slot::Named;
use super::spec::{read_spec, FrameSpec, JointSpec, Shape, Spec};
use super::suggest;
use super::transform::{z_onto, Transform};
use super::{Encoder, Frame, Joint, Model, Sensor, SensorKind};
use std::cell::Cell;

/// Reads a model's TOML text; `file` names it in messages.
///
/// # Errors
/// Every mistake in the order of the file, each as `file:line: where: what was expected`.
pub fn read_model(text: &str, file: &str) -> Result<Model, Vec<String>> {
    let mistakes = Mistakes::of(file, text);
    let model = read_spec(text, &mistakes).map(|spec| build(spec, &mistakes));
    match model {
        Some(model) if mistakes.is_empty() => Ok(model),
        _ => Err(mistakes.finish()),
    }
}

/// The names that the file defines, and where to report unknown ones.
struct Names<'a> {
    joints: Vec<&'a str>,
    /// Root first, then in file order.
    frames: Vec<&'a str>,
    mistakes: &'a Mistakes<'a>,
}

impl Names<'_> {
    /// Index of a joint.
    fn joint(&self, who: &str, key: &str, name: &Named) -> Option<usize> {
        self.find(who, key, name, ("joint", &self.joints), ("frame", &self.frames))
    }

    /// Index of a frame in file order, root being 0.
    fn frame(&self, who: &str, key: &str, name: &Named) -> Option<usize> {
        self.find(who, key, name, ("frame", &self.frames), ("joint", &self.joints))
    }

    fn find(
        &self,
        who: &str,
        key: &str,
        name: &Named,
        (kind, valid): (&str, &[&str]),
        (other_kind, others): (&str, &[&str]),
    ) -> Option<usize> {
        let found = valid.iter().position(|v| *v == name.text);
        if found.is_none() {
            let confused = match others.contains(&name.text.as_str()) {
                true => format!(" (`{}` is a {other_kind})", name.text),
                false => String::new(),
            };
            let hint = suggest::hint(&name.text, valid);
            self.mistakes.add(name.at, format!("{who}: {key}: no {kind} `{}`{confused}; {hint}", name.text));
        }
        found
    }
}

/// Requests of a sensor or closure to the rest of the file, with its name for messages.
pub(crate) struct Lookup<'a> {
    /// Name in messages, such as "sensor `back`".
    who: String,
    pub(crate) name: Named,
    /// All names of frames and joints.
    pub(crate) model: &'a Model,
    names: &'a Names<'a>,
    /// Index in the model of every frame of the file.
    place: &'a [usize],
    /// Whether the world gives norm and dip of the magnetic field, or a request for them was reported already.
    has_field: &'a Cell<bool>,
}

impl Lookup<'_> {
    pub(crate) fn frame(&self, key: &str, name: &Option<Named>) -> Option<usize> {
        Some(self.place[self.names.frame(&self.who, key, name.as_ref()?)?])
    }

    pub(crate) fn joint(&self, key: &str, name: &Option<Named>) -> Option<usize> {
        self.names.joint(&self.who, key, name.as_ref()?)
    }

    pub(crate) fn mistake(&self, at: usize, text: impl AsRef<str>) {
        self.names.mistakes.add(at, format!("{}: {}", self.who, text.as_ref()));
    }

    /// Requires norm and dip of the magnetic field; `reason` is for the message.
    pub(crate) fn need_magnetic_field(&self, reason: &str) {
        if !self.has_field.replace(true) {
            let text = format!(
                "{} {reason}, but [world] lacks magnetic_norm_ut (such as 47.0) or magnetic_dip_rad (such as \"60*pi/180\")",
                self.who
            );
            self.names.mistakes.add(self.name.at, text);
        }
    }

    /// Requires a joint that moves one frame relative to the other; `what` needs it.
    pub(crate) fn need_joint_between(&self, a: usize, b: usize, what: &str) {
        let name = |frame: usize| &self.model.frames[frame].name;
        if a == b {
            self.mistake(self.name.at, format!("both sides are on frame `{}`; expected two frames", name(a)));
        } else if self.names.mistakes.is_empty() && !check::moves(self.model, [a, b]) {
            let text =
                format!("no joint moves `{}` against `{}`; {what} needs one between its sides", name(a), name(b));
            self.mistake(self.name.at, text);
        }
    }
}

fn build(mut spec: Spec, mistakes: &Mistakes) -> Model {
    check::names(&spec, mistakes);
    let joint_names: Vec<String> = spec.joints.iter().map(|j| j.name.text.clone()).collect();
    let frame_names: Vec<String> = spec.frames.iter().map(|f| f.name.text.clone()).collect();
    let names = Names {
        joints: joint_names.iter().map(String::as_str).collect(),
        frames: std::iter::once("root").chain(frame_names.iter().map(String::as_str)).collect(),
        mistakes,
    };
    let parents: Vec<Option<usize>> = spec.frames.iter().map(|f| parent(f, &names)).collect();
    let order = order::parents_first(&spec.frames, &parents, mistakes);
    let place = order::places(&order, spec.frames.len());
    let frames = order.iter().map(|i| frame(&spec.frames, &parents, *i, &place, &names)).collect();
    let mut model = Model {
        name: spec.name.clone(),
        description: spec.description.clone(),
        structure: spec.structure,
        links: spec.links,
        world: spec.world.clone(),
        parameters: spec.parameters.iter().map(|(_, p)| p.clone()).collect(),
        joints: numbered(spec.joints.iter().map(|j| j.joint.clone()).collect()),
        frames: std::iter::once(root()).chain::<Vec<Frame>>(frames).collect(),
        sensors: Vec::new(),
        closures: Vec::new(),
        base_accelerations: spec.base_accelerations.iter().map(|(_, b)| b.clone()).collect(),
    };
    add_sensors(&mut spec, &mut model, &names, &place);
    check::whole(&spec, &model, mistakes);
    take_input_std(&spec.joints, &mut model);
    model
}

/// Joints with the indices of their coordinates.
fn numbered(mut joints: Vec<Joint>) -> Vec<Joint> {
    let mut first = 0;
    for joint in &mut joints {
        joint.first = first;
        first += joint.kind.width();
    }
    joints
}

fn root() -> Frame {
    Frame { name: "root".to_string(), parent: 0, before: None, joint: None, after: None }
}

fn parent(frame: &FrameSpec, names: &Names) -> Option<usize> {
    names.frame(&format!("frame `{}`", frame.name.text), "parent", frame.parent.as_ref()?)
}

fn frame(specs: &[FrameSpec], parents: &[Option<usize>], i: usize, place: &[usize], names: &Names) -> Frame {
    let spec = &specs[i];
    let who = format!("frame `{}`", spec.name.text);
    let joint = spec.joint.as_ref().and_then(|name| names.joint(&who, "joint", name));
    let (before, after) = match &spec.shape {
        Shape::Row(row) => (None, Some(row.clone())),
        Shape::Fixed(rotation, translation, axis) => {
            let turn = axis.filter(|a| *a != [0.0, 0.0, 1.0]).map(z_onto);
            let rotation = match turn {
                Some(turn) => super::RotationExpr::Turned(Box::new(rotation.clone()), turn),
                None => rotation.clone(),
            };
            let before = Transform::Fixed { rotation, translation: translation.clone() };
            (Some(before), turn.map(|turn| Transform::turn(turn.transposed())))
        }
    };
    Frame {
        name: spec.name.text.clone(),
        parent: place[parents[i].unwrap_or(0)],
        before,
        joint: joint.map(|j| (j, spec.sign)),
        after,
    }
}

/// Sensors and closures, after all frames have their indices.
fn add_sensors(spec: &mut Spec, model: &mut Model, names: &Names, place: &[usize]) {
    let has_field = Cell::new(spec.has_field);
    let (mut sensors, mut closures) = (Vec::new(), Vec::new());
    let lookup = |kind: &str, name: &Named| Lookup {
        who: format!("{kind} `{}`", name.text),
        name: name.clone(),
        model,
        names,
        place,
        has_field: &has_field,
    };
    for (name, pending) in spec.sensors.iter_mut() {
        let found = pending.take().and_then(|pending| pending(&lookup("sensor", name)));
        sensors.extend(found.map(|kind| Sensor { name: name.text.clone(), kind }));
    }
    for (name, pending) in spec.closures.iter_mut() {
        closures.extend(pending.take().and_then(|pending| pending(&lookup("closure", name))));
    }
    (model.sensors, model.closures) = (sensors, closures);
}

/// An input joint without `std` has the noise of its encoder.
fn take_input_std(specs: &[JointSpec], model: &mut Model) {
    let Model { joints, sensors, .. } = model;
    for sensor in sensors.iter() {
        if let SensorKind::Encoder(Encoder { joint, std }) = sensor.kind {
            let own: Option<(f64, usize)> = specs[joint].std;
            let joint: &mut Joint = &mut joints[joint];
            if joint.input && own.is_none() {
                joint.input_std = std;
            }
        }
    }
}
