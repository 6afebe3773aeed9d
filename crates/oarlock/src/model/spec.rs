//! Reads a model's TOML text key by key. Every value is checked by itself; names are looked up later by `build`.
//!
//! After a mistake, reading continues with a substitute value, so that one pass finds all mistakes. The caller discards
//! the result if there was one.

pub(crate) mod frame;
mod joint;
mod world;

pub(super) use frame::{FrameSpec, Shape};
pub(super) use joint::JointSpec;

use super::locate::Mistakes;
use super::section::Section;
use super::slot::{shown_name, Named, Reader, Slot};
use super::{BaseAcceleration, Closure, Links, Parameter, Structure, World};
use crate::sensor::kind::{Kind, Pending};
use crate::sensor::SensorKind;
use toml::de::DeTable;

/// Content of the file.
pub(super) struct Spec {
    pub(super) name: String,
    pub(super) description: String,
    pub(super) structure: Option<Structure>,
    pub(super) links: Links,
    pub(super) world: World,
    /// Whether the world gives norm and dip of the magnetic field.
    pub(super) has_field: bool,
    pub(super) parameters: Vec<(Named, Parameter)>,
    pub(super) joints: Vec<JointSpec>,
    pub(super) frames: Vec<FrameSpec>,
    /// With names that are looked up later; `None`: of an unknown kind.
    pub(super) sensors: Vec<(Named, Option<Pending<SensorKind>>)>,
    pub(super) closures: Vec<(Named, Option<Pending<Closure>>)>,
    pub(super) base_accelerations: Vec<(Named, BaseAcceleration)>,
}

const STRUCTURES: [(&str, Structure); 2] =
    [(Structure::Strapdown.name(), Structure::Strapdown), (Structure::Tree.name(), Structure::Tree)];
/// The version of the file format that this code reads.
const FORMAT: f64 = 1.0;
const KEYS: [&str; 13] = [
    "format",
    "name",
    "description",
    "structure",
    "links",
    "world",
    "parameters",
    "process",
    "joint",
    "frame",
    "sensor",
    "closure",
    "base_acceleration",
];

/// Reads the text; `None` if it is not TOML.
pub(super) fn read_spec(text: &str, mistakes: &Mistakes) -> Option<Spec> {
    let (table, faults) = DeTable::parse_recoverable(text);
    // What follows the first fault is mostly its echo: a bracket that is not closed gives a hundred.
    if let Some(fault) = faults.first() {
        let at = fault.span().map_or(0, |span| span.start);
        mistakes.add(at, format!("not valid TOML: {}{}", fault.message(), syntax_hint(fault.message(), text, at)));
    }
    if !faults.is_empty() {
        return None;
    }
    let empty = Reader { mistakes, parameters: Vec::new(), defaults: Vec::new() };
    let whole = Section::whole(&empty, table.get_ref(), &KEYS);
    whole.refuse_unknown();
    let parameters = read_parameters(&whole);
    let reader = Reader {
        mistakes,
        parameters: parameters.iter().map(|(name, _)| name.text.clone()).collect(),
        defaults: parameters.iter().map(|(_, p)| p.default).collect(),
    };
    Some(read_whole(&Section::whole(&reader, table.get_ref(), &KEYS), parameters))
}

fn read_whole(whole: &Section, parameters: Vec<(Named, Parameter)>) -> Spec {
    check_format(whole);
    let (world, has_field) = world::read(whole);
    let defaults = joint::read_defaults(whole);
    Spec {
        name: whole.need("name", "\"sculler\"").and_then(|s| s.name()).map_or(String::new(), |n| n.text),
        description: whole.text_or_empty("description"),
        structure: whole.get("structure").and_then(|slot| slot.choice(&STRUCTURES)),
        links: Links::read(whole),
        world,
        has_field,
        parameters,
        joints: whole.tables("joint", &joint::KEYS).iter().map(|s| joint::read(s, &defaults)).collect(),
        frames: whole.tables("frame", &frame::KEYS).iter().map(frame::read).collect(),
        sensors: whole.tables("sensor", SensorKind::keys()).iter().map(read_sensor).collect(),
        closures: whole.tables("closure", Closure::KEYS).iter().map(read_closure).collect(),
        base_accelerations: whole
            .tables("base_acceleration", &world::BASE_ACCELERATION_KEYS)
            .iter()
            .map(world::read_base_acceleration)
            .collect(),
    }
}

fn read_sensor(section: &Section) -> (Named, Option<Pending<SensorKind>>) {
    (named(section, "\"back\""), SensorKind::read(section))
}

fn read_closure(section: &Section) -> (Named, Option<Pending<Closure>>) {
    (named(section, "\"r_grip\""), Some(Closure::read(section)))
}

fn check_format(whole: &Section) {
    let Some(slot) = whole.need("format", "1") else {
        return;
    };
    if let Some(found) = slot.number().filter(|f| *f != FORMAT) {
        slot.mistake(format!("{found} is not known; this version of oarlock reads format = {FORMAT}"));
    }
}

/// What was probably meant at a fault of TOML: a repeated table, a decimal comma, an expression without quotes.
fn syntax_hint(message: &str, text: &str, at: usize) -> &'static str {
    let (Some(before), Some(after)) = (text.get(..at), text.get(at..)) else {
        return "";
    };
    if message.starts_with("duplicate key") {
        return ". A table that comes several times has two brackets: [[joint]]";
    }
    let start = before.rfind('\n').map_or(0, |end| end + 1);
    let line = text[start..].lines().next().unwrap_or("");
    let decimal = |three: &[u8]| three[0].is_ascii_digit() && three[1] == b',' && three[2].is_ascii_digit();
    let of_commas = message.contains("comma") || message.contains("newline") || after.starts_with(',');
    if of_commas && line.as_bytes().windows(3).any(decimal) {
        return ". Decimals are written with a point: 0.52";
    }
    let value = before.trim_end_matches(' ').ends_with(['=', ',', '[']);
    let begins = after.trim_start_matches(' ').starts_with(|c: char| c.is_alphanumeric() || "-+(".contains(c));
    let computed = message.contains("invalid") && line.contains(['*', '/', '(']);
    if computed || (value && begins) {
        return ". Texts, names and expressions stand in quotes: \"l_b/2\"";
    }
    ""
}

/// The name of a table of `[[...]]`; empty after a mistake.
fn named(section: &Section, example: &str) -> Named {
    let name = section.need("name", example).and_then(|slot| slot.name());
    name.unwrap_or(Named { text: String::new(), at: section.at })
}

const PARAMETER_KEYS: [&str; 4] = ["default", "unit", "std", "label"];

fn read_parameters(whole: &Section) -> Vec<(Named, Parameter)> {
    let Some(slot) = whole.get("parameters") else {
        return Vec::new();
    };
    let Some(section) = Section::of_any(slot) else {
        return Vec::new();
    };
    section.entries().into_iter().map(|(name, slot)| read_parameter(name, slot)).collect()
}

fn read_parameter(name: Named, mut slot: Slot) -> (Named, Parameter) {
    slot.path = format!("parameter `{}`", shown_name(&name.text));
    check_parameter_name(&name, &slot);
    slot.check_length(&name.text);
    let mut parameter =
        Parameter { name: name.text.clone(), label: String::new(), unit: String::new(), default: f64::NAN, std: None };
    if slot.value.get_ref().as_table().is_none() {
        parameter.default = slot.number().unwrap_or(f64::NAN);
        return (name, parameter);
    }
    let Some(section) = Section::of(slot, &PARAMETER_KEYS) else {
        return (name, parameter);
    };
    parameter.label = section.text_or_empty("label");
    if let Some(unit) = section.get("unit") {
        parameter.unit = unit.choice(&[("m", "m"), ("rad", "rad"), ("", "")]).unwrap_or("").to_string();
    }
    let value = section.need("default", "0.52").and_then(|s| match parameter.unit.as_str() {
        "m" => s.length(),
        "rad" => s.angle(),
        _ => s.expr(),
    });
    parameter.default = value.map_or(f64::NAN, |e| e.eval(&[]));
    parameter.std = section.get("std").and_then(|s| s.positive(&parameter.unit));
    (name, parameter)
}

fn check_parameter_name(name: &Named, slot: &Slot) {
    let ascii = |c: char| c.is_alphanumeric() || c == '_';
    let starts = name.text.starts_with(|c: char| c.is_alphabetic() || c == '_');
    if name.text == "pi" {
        slot.mistake("`pi` is the number 3.14159...; expected another name");
    } else if !starts || !name.text.chars().all(ascii) {
        slot.mistake("no name: expected letters, digits and `_`, a letter first, so that expressions can use it");
    }
}
