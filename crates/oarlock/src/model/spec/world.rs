//! Reads `[world]` and `[[base_acceleration]]` of a model file.

use crate::model::section::Section;
use crate::model::slot::{Named, Slot};
use crate::model::{BaseAcceleration, Expr, World};
use std::f64::consts::FRAC_PI_2;

const KEYS: [&str; 8] = [
    "up",
    "forward",
    "gravity_m_s2",
    "magnetic_norm_ut",
    "magnetic_dip_rad",
    "magnetic_azimuth_rad",
    "azimuth_fixed",
    "azimuth_walk",
];
pub(in crate::model) const BASE_ACCELERATION_KEYS: [&str; 8] =
    ["name", "label", "axis", "density", "start_std", "time_s", "rise_s", "always"];

/// Standard gravity, exact by definition.
const GRAVITY_M_S2: f64 = 9.80665;
/// On Earth the field is 22 to 67 uT; steel indoors may halve or double it.
const MAGNETIC_NORM_UT: std::ops::RangeInclusive<f64> = 5.0..=200.0;
/// Default random walk of the root's heading against the field, rad per sqrt(s).
const AZIMUTH_WALK: f64 = 0.002;
/// Tolerance of the right angle between up and forward, as a cosine.
const RIGHT_ANGLE_TOLERANCE: f64 = 1e-6;

pub(super) fn read(whole: &Section) -> (World, bool) {
    let mut world = World {
        up: [0.0, 1.0, 0.0],
        forward: [0.0, 0.0, 1.0],
        gravity_m_s2: GRAVITY_M_S2,
        magnetic_norm_ut: Expr::constant(1.0),
        magnetic_dip_rad: Expr::constant(0.0),
        magnetic_azimuth_rad: 0.0,
        azimuth_fixed: false,
        azimuth_walk: AZIMUTH_WALK,
    };
    let Some(slot) = whole.get("world") else {
        whole.mistake(0, "table [world] is missing, such as [world] up = [0, 1, 0] forward = [0, 0, 1]");
        return (world, true);
    };
    let Some(section) = Section::of(slot, &KEYS) else {
        return (world, true);
    };
    read_directions(&section, &mut world);
    read_gravity(&section, &mut world);
    let has_field = read_field(&section, &mut world);
    (world, has_field)
}

fn read_directions(section: &Section, world: &mut World) {
    let up = section.need("up", "[0, 1, 0]").and_then(|s| s.axis());
    let forward = section.need("forward", "[0, 0, 1]").and_then(|s| s.axis());
    let (Some(up), Some(forward)) = (up, forward) else {
        return;
    };
    let cosine: f64 = up.iter().zip(forward).map(|(a, b)| a * b).sum();
    if cosine.abs() > RIGHT_ANGLE_TOLERANCE {
        let angle = cosine.clamp(-1.0, 1.0).acos().to_degrees();
        let text = format!("forward is {angle:.3} deg from up; expected a horizontal direction, 90 deg from up");
        section.mistake(section.at_key("forward"), text);
    }
    (world.up, world.forward) = (up, forward);
}

fn read_gravity(section: &Section, world: &mut World) {
    let Some(slot) = section.get("gravity_m_s2") else {
        return;
    };
    let Some(gravity) = slot.not_negative("m/s2") else {
        return;
    };
    if (0.9..1.1).contains(&gravity) {
        slot.mistake(format!("{gravity} m/s2 looks like multiples of g; expected m/s2, such as 9.80665"));
    }
    world.gravity_m_s2 = gravity;
}

/// Whether norm and dip are given.
fn read_field(section: &Section, world: &mut World) -> bool {
    if let Some((slot, norm)) = section.get("magnetic_norm_ut").and_then(|s| s.expr().map(|e| (s, e))) {
        let value = norm.eval(&slot.reader.defaults);
        if !MAGNETIC_NORM_UT.contains(&value) {
            slot.mistake(format!("{value} uT; the Earth's field is 22 to 67 uT (1 gauss = 100 uT)"));
        }
        world.magnetic_norm_ut = norm;
    }
    if let Some((slot, dip)) = section.get("magnetic_dip_rad").and_then(|s| s.expr().map(|e| (s, e))) {
        let value = dip.eval(&slot.reader.defaults);
        if value.abs() > FRAC_PI_2 {
            slot.mistake(format!("{value} rad; expected -pi/2 to pi/2 rad; write degrees as \"60*pi/180\""));
        }
        world.magnetic_dip_rad = dip;
    }
    if let Some(slot) = section.get("magnetic_azimuth_rad") {
        world.magnetic_azimuth_rad = slot.angle().and_then(|_| slot.number()).unwrap_or(0.0);
    }
    world.azimuth_fixed = section.flag("azimuth_fixed");
    if let Some(slot) = section.get("azimuth_walk") {
        world.azimuth_walk = slot.not_negative("rad per sqrt(s)").unwrap_or(AZIMUTH_WALK);
    }
    section.has("magnetic_norm_ut") && section.has("magnetic_dip_rad")
}

pub(super) fn read_base_acceleration(section: &Section) -> (Named, BaseAcceleration) {
    let name = super::named(section, "\"surge\"");
    let read = |key, example, unit| section.need(key, example).and_then(|s| s.positive(unit)).unwrap_or(1.0);
    let time_s = section.get("time_s").and_then(|s| s.positive("s")).unwrap_or(f64::INFINITY);
    let acceleration = BaseAcceleration {
        name: name.text.clone(),
        label: section.text_or_empty("label"),
        axis: section.need("axis", "[0, 0, 1]").and_then(|s| s.axis()).unwrap_or([0.0, 0.0, 1.0]),
        density: read("density", "3.35", "m/s2 per sqrt(s)"),
        start_std: read("start_std", "3.0", "m/s2"),
        time_s,
        rise_s: section.get("rise_s").and_then(|s| rise(&s, time_s)).unwrap_or(0.0),
        always: section.flag("always"),
    };
    (name, acceleration)
}

/// A rise time comparable to the decay time would be another model, and the formula cancels near equality.
fn rise(slot: &Slot, time_s: f64) -> Option<f64> {
    let rise_s = slot.positive("s")?;
    if rise_s > 0.5 * time_s {
        let text = format!("{rise_s} s; expected at most half of `time_s`, {} s", 0.5 * time_s);
        slot.mistake(text);
        return None;
    }
    Some(rise_s)
}
