//! `[[joint]]` and `[process]`.

use crate::model::section::Section;
use crate::model::slot::{Named, Slot};
use crate::model::{Joint, JointKind, Process, ProcessKind};
use std::f64::consts::{PI, TAU};

pub(in crate::model) const KEYS: [&str; 8] = ["name", "label", "kind", "limits", "rest", "process", "input", "std"];
const PROCESS_KEYS: [&str; 3] = ["kind", "density", "start_std"];

/// A turn and a half either way: farther limits are degrees.
const HINGE_BOUND_RAD: f64 = 1.5 * TAU;
/// Reading of an encoder that says nothing about itself, rad or m.
const INPUT_STD: f64 = 0.001;

/// A joint, and what the file said about the noise of its reading.
pub(in crate::model) struct JointSpec {
    pub(in crate::model) name: Named,
    pub(in crate::model) joint: Joint,
    /// `std` and its place.
    pub(in crate::model) std: Option<(f64, usize)>,
}

/// The motion of joints that give none of their own.
pub(super) struct Defaults {
    hinge: Process,
    slide: Process,
}

pub(super) fn read_defaults(whole: &Section) -> Defaults {
    let jerk = |start_std| Process { kind: ProcessKind::Jerk, density: 11.2, start_std };
    let mut defaults = Defaults { hinge: jerk([0.2, 0.5, 5.0]), slide: jerk([0.02, 0.3, 3.0]) };
    let Some(section) = whole.get("process").and_then(|slot| Section::of(slot, &["hinge", "slide"])) else {
        return defaults;
    };
    if let Some(slot) = section.get("hinge") {
        defaults.hinge = read_process(slot, &defaults.hinge, "rad");
    }
    if let Some(slot) = section.get("slide") {
        defaults.slide = read_process(slot, &defaults.slide, "m");
    }
    defaults
}

/// Keys that are left out keep the default's value as long as the kind is the same.
fn read_process(slot: Slot, default: &Process, unit: &str) -> Process {
    let Some(section) = Section::of(slot, &PROCESS_KEYS) else {
        return *default;
    };
    let mut process = *default;
    if let Some(kind) = section.get("kind").and_then(|s| read_process_kind(&s)) {
        process.kind = kind;
    }
    let changed = process.kind != default.kind;
    let of_kind = |key, example| {
        if changed {
            section.need(key, example)
        } else {
            section.get(key)
        }
    };
    let per_root = match process.kind {
        ProcessKind::Jerk => format!("{unit}/s2 per sqrt(s)"),
        ProcessKind::Walk => format!("{unit} per sqrt(s)"),
    };
    if let Some(density) = of_kind("density", "0.2").and_then(|s| s.positive(&per_root)) {
        process.density = density;
    }
    let example = if process.kind == ProcessKind::Jerk { "[0.2, 0.5, 5.0]" } else { "[0.5]" };
    if let Some(start_std) = of_kind("start_std", example).and_then(|s| read_start_std(&s, process.kind, unit)) {
        process.start_std = start_std;
    }
    process
}

fn read_process_kind(slot: &Slot) -> Option<ProcessKind> {
    if slot.value.get_ref().as_str() == Some("singer") {
        slot.mistake("`singer` is not yet supported; use \"jerk\" or \"walk\"");
        return None;
    }
    slot.choice(&[("jerk", ProcessKind::Jerk), ("walk", ProcessKind::Walk)])
}

fn read_start_std(slot: &Slot, kind: ProcessKind, unit: &str) -> Option<[f64; 3]> {
    let positive = |slot: &Slot| slot.positive("");
    match kind {
        ProcessKind::Walk if slot.value.get_ref().as_array().is_none() => Some([slot.positive(unit)?, 0.0, 0.0]),
        ProcessKind::Walk => {
            let list = slot.list(1, &format!("one number for a walk: [{unit}]"))?;
            Some([positive(&list[0])?, 0.0, 0.0])
        }
        ProcessKind::Jerk => slot.three(&format!("three numbers [{unit}, {unit}/s, {unit}/s2]"), |s| s.positive("")),
    }
}

pub(super) fn read(section: &Section, defaults: &Defaults) -> JointSpec {
    let name = super::named(section, "\"trunk\"");
    let kind = section.need("kind", "\"hinge\"").and_then(|slot| read_kind(&slot)).unwrap_or(JointKind::Hinge);
    let (default, unit) = match kind {
        JointKind::Slide => (&defaults.slide, "m"),
        JointKind::Hinge | JointKind::Fixed => (&defaults.hinge, "rad"),
    };
    let limits = section.get("limits").and_then(|slot| read_limits(&slot, kind)).unwrap_or(match kind {
        JointKind::Fixed => [0.0, 0.0],
        JointKind::Hinge => [-PI, PI],
        JointKind::Slide => [-1.0, 1.0],
    });
    let std = section.get("std").and_then(|s| Some((s.positive(unit)?, s.at())));
    let joint = Joint {
        name: name.text.clone(),
        label: section.text_or_empty("label"),
        kind,
        limits,
        rest: read_rest(section, limits, unit),
        process: section.get("process").map_or(*default, |slot| read_process(slot, default, unit)),
        input: section.flag("input"),
        input_std: std.map_or(INPUT_STD, |(std, _)| std),
    };
    check_sense(section, &joint);
    JointSpec { name, joint, std }
}

fn read_kind(slot: &Slot) -> Option<JointKind> {
    let known = [("fixed", JointKind::Fixed), ("hinge", JointKind::Hinge), ("slide", JointKind::Slide)];
    let meant = match slot.text()? {
        "ball" | "free" => {
            let way_out = "use hinges and slides in a row, each with a frame of its own";
            slot.mistake(format!("`{}` is not yet supported; {way_out}", slot.text()?));
            return None;
        }
        "revolute" | "rotation" | "rotational" | "pin" | "angle" => "hinge",
        "prismatic" | "slider" | "translation" | "linear" => "slide",
        "weld" | "rigid" | "none" => "fixed",
        _ => return slot.choice(&known),
    };
    slot.mistake(format!("unknown kind `{}`; did you mean `{meant}`?", slot.text()?));
    None
}

fn read_limits(slot: &Slot, kind: JointKind) -> Option<[f64; 2]> {
    let ends: Vec<_> = slot.list(2, "two numbers [lowest, highest]")?.iter().map(Slot::number).collect();
    let [Some(low), Some(high)] = ends[..] else {
        return None;
    };
    if low >= high {
        slot.mistake(format!("lowest {low:.4} is not below highest {high:.4}; expected [lowest, highest]"));
        return None;
    }
    if kind == JointKind::Hinge && low.abs().max(high.abs()) > HINGE_BOUND_RAD {
        slot.mistake(format!("[{low:.4}, {high:.4}] rad is many turns; write degrees as \"90*pi/180\""));
    }
    Some([low, high])
}

fn read_rest(section: &Section, [low, high]: [f64; 2], unit: &str) -> f64 {
    let inside = |x: f64| low <= x && x <= high;
    let middle = if inside(0.0) { 0.0 } else { 0.5 * (low + high) };
    let Some(slot) = section.get("rest") else {
        return middle;
    };
    let rest = slot.number().unwrap_or(middle);
    if !inside(rest) && !section.path.is_empty() {
        slot.mistake(format!("{rest} {unit} is outside the limits [{low:.4}, {high:.4}] {unit}"));
    }
    rest
}

/// Keys that contradict each other.
fn check_sense(section: &Section, joint: &Joint) {
    let contradicts = |keys: &[&str], why: &str| {
        for key in keys.iter().filter(|key| section.has(key)) {
            section.mistake(section.at_key(key), format!("`{key}`: {why}; remove it"));
        }
    };
    if joint.kind == JointKind::Fixed {
        contradicts(&["limits", "rest", "process", "std", "input"], "a fixed joint does not move");
    } else if joint.input {
        contradicts(&["process"], "an input joint follows its stream and has no motion of its own");
    }
}
