//! Reads `[[frame]]` of a model file.

use crate::model::expr::Expr;
use crate::model::section::Section;
use crate::model::slot::{Named, Slot};
use crate::model::transform::{RotationExpr, Transform};

pub(in crate::model) const KEYS: [&str; 7] = ["name", "parent", "dh", "transform", "joint", "sign", "axis"];
const DH_KEYS: [&str; 4] = ["a", "alpha", "d", "theta"];
const TRANSFORM_KEYS: [&str; 3] = ["rotation", "rpy", "translation"];

/// A frame whose parent and joint are names that are looked up later.
pub(in crate::model) struct FrameSpec {
    pub(in crate::model) name: Named,
    pub(in crate::model) parent: Option<Named>,
    pub(in crate::model) joint: Option<Named>,
    pub(in crate::model) sign: f64,
    pub(in crate::model) has_axis: bool,
    pub(in crate::model) shape: Shape,
}

/// Order of the joint's motion and the fixed transform.
pub(in crate::model) enum Shape {
    /// The joint moves about or along the parent's z; the Denavit-Hartenberg row follows.
    Row(Transform),
    /// The transform comes first, then the joint's motion about or along `axis`.
    Fixed(RotationExpr, [Expr; 3], Option<[f64; 3]>),
}

pub(super) fn read(section: &Section) -> FrameSpec {
    let name = super::named(section, "\"r_elbow\"");
    if name.text == "root" {
        section.mistake(name.at, "`root` is always there and is not written; expected another name");
    }
    let joint = section.reference("joint");
    if joint.is_none() {
        for key in ["sign", "axis"].iter().filter(|key| section.has(key)) {
            section.mistake(section.at_key(key), format!("`{key}` without `joint`; name the joint or remove it"));
        }
    }
    FrameSpec {
        name,
        parent: section.need_reference("parent", "\"root\""),
        joint,
        sign: section.get("sign").and_then(|slot| read_sign(&slot)).unwrap_or(1.0),
        has_axis: section.has("axis"),
        shape: read_shape(section),
    }
}

fn read_sign(slot: &Slot) -> Option<f64> {
    let sign = slot.number()?;
    if sign.abs() != 1.0 {
        slot.mistake(format!("{sign}; expected 1 or -1"));
    }
    Some(sign)
}

fn read_shape(section: &Section) -> Shape {
    let nothing = Shape::Row(Transform::identity());
    match (section.get("dh"), section.get("transform")) {
        (Some(_), Some(_)) => {
            section.mistake(section.at_key("transform"), "has both `dh` and `transform`; expected one of them");
            nothing
        }
        (None, None) => {
            section
                .mistake(section.at, "expected dh = { a, alpha, d, theta } or transform = { rotation, translation }");
            nothing
        }
        (Some(row), None) => {
            if section.has("axis") {
                let text = "`axis` goes with `transform`; with `dh` the joint acts about the parent's z. Remove it";
                section.mistake(section.at_key("axis"), text);
            }
            Shape::Row(read_row(row).unwrap_or(Transform::identity()))
        }
        (None, Some(slot)) => {
            let (rotation, translation) = read_transform(slot);
            Shape::Fixed(rotation, translation, section.get("axis").and_then(|slot| slot.axis()))
        }
    }
}

fn read_row(slot: Slot) -> Option<Transform> {
    let section = Section::of(slot, &DH_KEYS)?;
    let length = |key| section.need(key, "0").and_then(|slot| slot.length());
    let angle = |key| section.need(key, "0").and_then(|slot| slot.angle());
    let (a, alpha, d, theta) = (length("a"), angle("alpha"), length("d"), angle("theta"));
    Some(Transform::Dh { a: a?, alpha: alpha?, d: d?, theta: theta? })
}

fn read_transform(slot: Slot) -> (RotationExpr, [Expr; 3]) {
    let zero = [0.0; 3].map(Expr::constant);
    let Some(section) = Section::of(slot, &TRANSFORM_KEYS) else {
        return (RotationExpr::Identity, zero);
    };
    let translation = section.get("translation").and_then(|slot| slot.point()).unwrap_or(zero);
    (read_rotation(&section), translation)
}

/// `rotation` or `rpy`, checked at the default parameters.
pub(crate) fn read_rotation(section: &Section) -> RotationExpr {
    match (section.get("rotation"), section.get("rpy")) {
        (Some(_), Some(_)) => {
            section.mistake(section.at_key("rpy"), "has both `rotation` and `rpy`; expected one of them");
            RotationExpr::Identity
        }
        (None, None) => RotationExpr::Identity,
        (Some(slot), None) => read_matrix(&slot).unwrap_or(RotationExpr::Identity),
        (None, Some(slot)) => match slot.three("three angles [roll, pitch, yaw] in rad", Slot::angle) {
            Some(angles) => RotationExpr::Rpy(angles),
            None => RotationExpr::Identity,
        },
    }
}

fn read_matrix(slot: &Slot) -> Option<RotationExpr> {
    let rotation = RotationExpr::Matrix(slot.matrix()?);
    let value = rotation.evaluate(&slot.reader.defaults);
    if value.0.iter().flatten().all(|x| x.is_finite()) {
        slot.check_rotation(&value);
    }
    Some(rotation)
}
