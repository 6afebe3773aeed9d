//! Reads `limits` and `rest` of a joint.

use crate::model::cone::Cone;
use crate::model::section::Section;
use crate::model::slot::Slot;
use crate::model::JointKind;
use std::f64::consts::{PI, TAU};

const CONE_KEYS: [&str; 3] = ["axis", "swing", "twist"];

/// Largest limit, one and a half turns: larger ones are probably in degrees.
const HINGE_BOUND_RAD: f64 = 1.5 * TAU;
/// Half a turn, with room for one that is written in decimals.
const HALF_TURN_RAD: f64 = PI + 1e-6;

pub(super) fn read_limits(slot: &Slot, kind: JointKind) -> Option<[f64; 2]> {
    let ends: Vec<_> = slot.list(2, "two numbers [lowest, highest]")?.iter().map(Slot::number).collect();
    let [Some(low), Some(high)] = ends[..] else {
        return None;
    };
    if low >= high {
        slot.mistake(format!("lowest {low:.4} is not below highest {high:.4}; expected [lowest, highest]"));
        return None;
    }
    if kind != JointKind::Slide && low.abs().max(high.abs()) > HINGE_BOUND_RAD {
        slot.mistake(format!("[{low:.4}, {high:.4}] rad is many turns; write degrees as \"90*pi/180\""));
    }
    if kind.turns_freely() && low + high != 0.0 {
        slot.mistake(format!("[{low:.4}, {high:.4}] rad; a ball's limits count from its rest alike: expected [-a, a]"));
    }
    Some([low, high])
}

pub(super) fn read_rest(section: &Section, kind: JointKind, [low, high]: [f64; 2], unit: &str) -> Vec<f64> {
    let inside = |x: f64| low <= x && x <= high;
    let middle = if inside(0.0) { 0.0 } else { 0.5 * (low + high) };
    let Some(slot) = section.get("rest") else {
        return vec![middle; kind.width()];
    };
    if kind.width() > 1 {
        let wanted = match kind {
            JointKind::Ball => "a rotation vector [rx, ry, rz] in rad",
            _ => "a place in m and a rotation vector in rad: [x, y, z, rx, ry, rz]",
        };
        let numbers = slot.list(kind.width(), wanted).unwrap_or_default();
        let numbers: Option<Vec<f64>> = numbers.iter().map(Slot::number).collect();
        return numbers.filter(|n| n.len() == kind.width()).unwrap_or(vec![0.0; kind.width()]);
    }
    let rest = slot.number().unwrap_or(middle);
    if !inside(rest) && !section.path.is_empty() {
        slot.mistake(format!("{rest} {unit} is outside the limits [{low:.4}, {high:.4}] {unit}"));
    }
    vec![rest]
}

/// A cone and a range of twist: `{ axis = "y", swing = 0.8, twist = [-1.2, 1.2] }`. Without `twist` any twist is inside.
pub(super) fn read_cone(slot: Slot) -> Option<Cone> {
    let section = Section::of(slot, &CONE_KEYS)?;
    let axis = section.need("axis", "\"y\"").and_then(|slot| slot.choice(&[("x", 0), ("y", 1), ("z", 2)]));
    let swing = section.need("swing", "\"60*pi/180\"").and_then(|slot| read_swing(&slot));
    let twist = section.get("twist").map_or(Some([-PI, PI]), |slot| read_twist(&slot));
    Some(Cone { axis: axis?, swing: swing?, twist: twist? })
}

/// One angle, or one about each of the two other axes.
fn read_swing(slot: &Slot) -> Option<[f64; 2]> {
    if slot.value.get_ref().as_array().is_none() {
        return read_swing_angle(slot).map(|angle| [angle; 2]);
    }
    let wanted = "one angle or two: the largest swing about each of the other two axes, in the order x, y, z, in rad";
    let angles: Option<Vec<f64>> = slot.list(2, wanted)?.iter().map(read_swing_angle).collect();
    angles?.try_into().ok()
}

fn read_swing_angle(slot: &Slot) -> Option<f64> {
    let angle = slot.number()?;
    if angle <= 0.0 || angle > HALF_TURN_RAD {
        slot.mistake(format!(
            "{angle:.4} rad; expected more than 0 and at most pi, the angle from the rest; write degrees as \"60*pi/180\""
        ));
        return None;
    }
    Some(angle)
}

fn read_twist(slot: &Slot) -> Option<[f64; 2]> {
    let ends: Option<Vec<f64>> = slot.list(2, "two numbers [lowest, highest]")?.iter().map(Slot::number).collect();
    let [low, high]: [f64; 2] = ends?.try_into().ok()?;
    if low >= high {
        slot.mistake(format!("lowest {low:.4} is not below highest {high:.4}; expected [lowest, highest]"));
        return None;
    }
    if low < -HALF_TURN_RAD || high > HALF_TURN_RAD {
        slot.mistake(format!(
            "[{low:.4}, {high:.4}] rad is more than half a turn from the rest; write degrees as \"90*pi/180\""
        ));
        return None;
    }
    if low > 0.0 || high < 0.0 {
        slot.mistake(format!("[{low:.4}, {high:.4}] rad excludes 0, the rest; change `rest` or the range"));
        return None;
    }
    Some([low, high])
}
