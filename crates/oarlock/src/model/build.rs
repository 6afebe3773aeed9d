//! From what the file says to a model: names become indices, parents come before children.

mod check;
mod order;

use super::locate::Mistakes;
use super::slot::Named;
use super::spec::{read_spec, ClosureSpec, FrameSpec, JointSpec, SensorSpec, Shape, Spec, What};
use super::suggest;
use super::transform::{z_onto, Transform};
use super::{Closure, Frame, Joint, Model, Sensor, SensorKind};

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

/// The names that the file defines, and where to complain about others.
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

fn build(spec: Spec, mistakes: &Mistakes) -> Model {
    check::names(&spec, mistakes);
    let names = Names {
        joints: spec.joints.iter().map(|j| j.name.text.as_str()).collect(),
        frames: std::iter::once("root").chain(spec.frames.iter().map(|f| f.name.text.as_str())).collect(),
        mistakes,
    };
    let parents: Vec<Option<usize>> = spec.frames.iter().map(|f| parent(f, &names)).collect();
    let order = order::parents_first(&spec.frames, &parents, mistakes);
    let place = order::places(&order, spec.frames.len());
    let frames = order.iter().map(|i| frame(&spec.frames, &parents, *i, &place, &names)).collect();
    let mut model = Model {
        name: spec.name.clone(),
        description: spec.description.clone(),
        world: spec.world.clone(),
        parameters: spec.parameters.iter().map(|(_, p)| p.clone()).collect(),
        joints: numbered(spec.joints.iter().map(|j| j.joint.clone()).collect()),
        frames: std::iter::once(root()).chain::<Vec<Frame>>(frames).collect(),
        sensors: spec.sensors.iter().filter_map(|s| sensor(s, &place, &names)).collect(),
        closures: spec.closures.iter().filter_map(|c| closure(c, &place, &names)).collect(),
        base_accelerations: spec.base_accelerations.iter().map(|(_, b)| b.clone()).collect(),
    };
    check::whole(&spec, &model, mistakes);
    take_input_std(&spec.joints, &mut model);
    model
}

/// Joints with the places of their coordinates.
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

/// Frames take their places in the model from here on.
fn sensor(spec: &SensorSpec, place: &[usize], names: &Names) -> Option<Sensor> {
    let who = format!("sensor `{}`", spec.name.text);
    let frame = |name: &Option<Named>| Some(place[names.frame(&who, "frame", name.as_ref()?)?]);
    let kind = match &spec.what {
        What::Nothing => return None,
        What::Imu { frame: on, mount, noise } => {
            SensorKind::Imu { frame: frame(on)?, mount: mount.clone(), noise: *noise }
        }
        What::Encoder { joint, std } => {
            SensorKind::Encoder { joint: names.joint(&who, "joint", joint.as_ref()?)?, std: *std }
        }
        What::Position { frame: on, point, std } => {
            SensorKind::Position { frame: frame(on)?, point: point.clone(), std: *std }
        }
    };
    Some(Sensor { name: spec.name.text.clone(), kind })
}

fn closure(spec: &ClosureSpec, place: &[usize], names: &Names) -> Option<Closure> {
    let who = format!("closure `{}`", spec.name.text);
    let side = |key, (name, point): &(Option<Named>, [super::Expr; 3])| {
        Some((place[names.frame(&who, key, name.as_ref()?)?], point.clone()))
    };
    let sides = (side("frame_a", &spec.sides[0]), side("frame_b", &spec.sides[1]));
    Some(Closure {
        name: spec.name.text.clone(),
        sides: [sides.0?, sides.1?],
        axes: spec.axes,
        std_m: spec.std_m,
        std_axis: spec.std_axis,
    })
}

/// An input joint that gives no std of its own is as noisy as its encoder.
fn take_input_std(specs: &[JointSpec], model: &mut Model) {
    let Model { joints, sensors, .. } = model;
    for sensor in sensors.iter() {
        if let SensorKind::Encoder { joint, std } = sensor.kind {
            let own: Option<(f64, usize)> = specs[joint].std;
            let joint: &mut Joint = &mut joints[joint];
            if joint.input && own.is_none() {
                joint.input_std = std;
            }
        }
    }
}
