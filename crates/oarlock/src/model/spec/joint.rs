//! Reads `[[joint]]` and `[process]` of a model file.

mod range;

use crate::model::section::Section;
use crate::model::slot::{Named, Slot};
use crate::model::{Joint, JointKind, Process, ProcessKind, Translation};
use std::f64::consts::PI;

pub(in crate::model) const KEYS: [&str; 10] =
    ["name", "label", "kind", "limits", "rest", "process", "input", "std", "angles", "translation"];
const PROCESS_KEYS: [&str; 4] = ["kind", "density", "start_std", "time_s"];
const TRANSLATION_KEYS: [&str; 5] = ["kind", "density", "start_std", "time_s", "limits"];

/// Default standard deviation of an encoder, rad or m.
const INPUT_STD: f64 = 0.001;

/// A joint, and the standard deviation of its reading.
pub(in crate::model) struct JointSpec {
    pub(in crate::model) name: Named,
    pub(in crate::model) joint: Joint,
    /// `std` and its place.
    pub(in crate::model) std: Option<(f64, usize)>,
}

/// Default processes of joints.
pub(super) struct Defaults {
    hinge: Process,
    slide: Process,
    ball: Process,
    place: Process,
}

pub(super) fn read_defaults(whole: &Section) -> Defaults {
    let jerk = |density, start_std| Process {
        kind: ProcessKind::Jerk,
        density,
        start_std,
        start_known: false,
        time_s: f64::INFINITY,
    };
    let place = Process {
        kind: ProcessKind::Singer,
        density: 50.0,
        start_std: [0.1, 1.0, 3.0],
        start_known: true,
        time_s: 0.3,
    };
    let mut defaults = Defaults {
        hinge: jerk(11.2, [0.2, 0.5, 5.0]),
        slide: jerk(11.2, [0.02, 0.3, 3.0]),
        ball: jerk(40.0, [0.3, 1.0, 10.0]),
        place,
    };
    let Some(section) = whole.get("process").and_then(|slot| Section::of(slot, &["hinge", "slide", "ball"])) else {
        return defaults;
    };
    let kinds = [("hinge", &mut defaults.hinge, "rad"), ("slide", &mut defaults.slide, "m")];
    for (key, process, unit) in kinds.into_iter().chain([("ball", &mut defaults.ball, "rad")]) {
        if let Some(slot) = section.get(key) {
            // A default for all joints of a kind does not state where one of them starts.
            *process = Process { start_known: false, ..read_process(slot, process, unit) };
        }
    }
    defaults
}

fn read_process(slot: Slot, default: &Process, unit: &str) -> Process {
    match Section::of(slot, &PROCESS_KEYS) {
        Some(section) => read_process_of(&section, default, unit),
        None => *default,
    }
}

/// Missing keys keep the default's value if the kind is the same.
fn read_process_of(section: &Section, default: &Process, unit: &str) -> Process {
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
        ProcessKind::Jerk | ProcessKind::Singer => format!("{unit}/s2 per sqrt(s)"),
        ProcessKind::Walk => format!("{unit} per sqrt(s)"),
    };
    if let Some(density) = of_kind("density", "0.2").and_then(|s| s.positive(&per_root)) {
        process.density = density;
    }
    let example = if process.kind == ProcessKind::Walk { "[0.5]" } else { "[0.2, 0.5, 5.0]" };
    if let Some(start_std) = of_kind("start_std", example).and_then(|s| read_start_std(&s, process.kind, unit)) {
        process.start_std = start_std;
        process.start_known = true;
    }
    process.time_s = match (process.kind, section.get("time_s")) {
        (ProcessKind::Singer, _) => of_kind("time_s", "0.3").and_then(|s| s.positive("s")).unwrap_or(process.time_s),
        (_, None) => f64::INFINITY,
        (_, Some(slot)) => {
            slot.mistake("only a `singer` motion decays; remove it, or write kind = \"singer\"");
            f64::INFINITY
        }
    };
    process
}

fn read_process_kind(slot: &Slot) -> Option<ProcessKind> {
    let singer = ("singer", ProcessKind::Singer);
    slot.choice(&[("jerk", ProcessKind::Jerk), ("walk", ProcessKind::Walk), singer])
}

fn read_start_std(slot: &Slot, kind: ProcessKind, unit: &str) -> Option<[f64; 3]> {
    let positive = |slot: &Slot| slot.positive("");
    match kind {
        ProcessKind::Walk if slot.value.get_ref().as_array().is_none() => Some([slot.positive(unit)?, 0.0, 0.0]),
        ProcessKind::Walk => {
            let list = slot.list(1, &format!("one number for a walk: [{unit}]"))?;
            Some([positive(&list[0])?, 0.0, 0.0])
        }
        _ => slot.three(&format!("three numbers [{unit}, {unit}/s, {unit}/s2]"), |s| s.positive("")),
    }
}

pub(super) fn read(section: &Section, defaults: &Defaults) -> JointSpec {
    let name = super::named(section, "\"trunk\"");
    let kind = section.need("kind", "\"hinge\"").and_then(|slot| read_kind(&slot)).unwrap_or(JointKind::Hinge);
    let (default, unit) = match kind {
        JointKind::Slide => (&defaults.slide, "m"),
        JointKind::Hinge | JointKind::Fixed => (&defaults.hinge, "rad"),
        JointKind::Ball | JointKind::Free => (&defaults.ball, "rad"),
    };
    let cone = section.get("limits").filter(|slot| slot.is_table() && kind == JointKind::Ball).map(range::read_cone);
    let plain = section.get("limits").filter(|_| cone.is_none()).and_then(|slot| range::read_limits(&slot, kind));
    let cone = cone.flatten();
    let limits = cone.map(|cone| cone.widest()).or(plain).unwrap_or(match kind {
        JointKind::Fixed => [0.0, 0.0],
        JointKind::Slide => [-1.0, 1.0],
        _ => [-PI, PI],
    });
    let mut process = section.get("process").map_or(*default, |slot| read_process(slot, default, unit));
    process.start_known &= kind.turns_freely();
    let std = section.get("std").and_then(|s| Some((s.positive(unit)?, s.at())));
    let angles = section.get("angles").and_then(|slot| read_angles(&slot)).unwrap_or("ZXY".into());
    let joint = Joint {
        name: name.text.clone(),
        label: section.text_or_empty("label"),
        kind,
        first: 0,
        limits,
        cone,
        rest: range::read_rest(section, kind, limits, unit),
        process,
        translation: (kind == JointKind::Free).then(|| read_translation(section, defaults)),
        angles,
        input: section.flag("input"),
        input_std: std.map_or(INPUT_STD, |(std, _)| std),
    };
    check_sense(section, &joint);
    JointSpec { name, joint, std }
}

fn read_translation(whole: &Section, defaults: &Defaults) -> Translation {
    let default = Translation { process: defaults.place, limits: [-0.5, 0.5] };
    let Some(section) = whole.get("translation").and_then(|slot| Section::of(slot, &TRANSLATION_KEYS)) else {
        return default;
    };
    let limits = section.get("limits").and_then(|slot| range::read_limits(&slot, JointKind::Slide));
    Translation { process: read_process_of(&section, &default.process, "m"), limits: limits.unwrap_or(default.limits) }
}

fn read_kind(slot: &Slot) -> Option<JointKind> {
    let known = [
        ("fixed", JointKind::Fixed),
        ("hinge", JointKind::Hinge),
        ("slide", JointKind::Slide),
        ("ball", JointKind::Ball),
        ("free", JointKind::Free),
    ];
    let meant = match slot.text()? {
        "revolute" | "rotation" | "rotational" | "pin" | "angle" => "hinge",
        "prismatic" | "slider" | "translation" | "linear" => "slide",
        "weld" | "rigid" | "none" => "fixed",
        "spherical" | "gimbal" | "sphere" => "ball",
        "floating" | "freeflyer" | "6dof" => "free",
        _ => return slot.choice(&known),
    };
    slot.mistake(format!("unknown kind `{}`; did you mean `{meant}`?", slot.text()?));
    None
}

/// Three axes without equal neighbours.
fn read_angles(slot: &Slot) -> Option<String> {
    let text = slot.text()?;
    let letters: Vec<char> = text.chars().collect();
    let known = letters.len() == 3 && letters.iter().all(|c| "XYZ".contains(*c));
    if !known || letters[0] == letters[1] || letters[1] == letters[2] {
        slot.expected("three axes in a row, no neighbours equal: \"YXY\", \"XZY\" or \"ZXY\"");
        return None;
    }
    Some(text.to_string())
}

/// Reports keys that contradict each other.
fn check_sense(section: &Section, joint: &Joint) {
    let contradicts = |keys: &[&str], why: &str| {
        for key in keys.iter().filter(|key| section.has(key)) {
            section.mistake(section.at_key(key), format!("`{key}`: {why}; remove it"));
        }
    };
    if joint.kind == JointKind::Fixed {
        contradicts(&["limits", "rest", "process", "std", "input"], "a fixed joint does not move");
    } else if joint.kind.turns_freely() {
        contradicts(&["input", "std"], "no encoder reads a rotation in all directions");
        if joint.process.kind == ProcessKind::Walk {
            section.mistake(section.at_key("process"), "a ball does not walk; expected kind = \"jerk\" or \"singer\"");
        }
    } else if joint.input {
        contradicts(&["process"], "an input joint follows its stream and has no motion of its own");
    }
    if !joint.kind.turns_freely() {
        contradicts(&["angles"], "only a ball or a free joint is read in a sequence of angles");
    }
    if joint.kind != JointKind::Free {
        contradicts(&["translation"], "only a free joint moves freely in space");
    }
}
