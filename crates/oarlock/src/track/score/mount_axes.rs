//! Which parameters are errors in the body's own axes: mounts of units, on the rotation next below each.

use crate::body::Body;
use crate::estimate::filter::Apart;
use crate::model::{Model, SensorKind};

/// For each rotation of the state: 0 for mounts of the units that turn with it, with no other ball or free joint between; 1 for all else.
///
/// A wrong mount rotates all readings of its unit, and with them the update, in the axes of the body that carries the unit: the error is
/// constant there (behind a hinge, nearly so). Any other error is constant in the axes of the parent.
pub(super) fn apart(body: &Body, parameters: &[(String, f64)], width: usize) -> Vec<Apart> {
    let of_rotation = |&(coordinate, slots): &(usize, crate::state::Slots)| {
        let is_own = |name: &String| {
            unit_of(&body.model, name).and_then(|frame| rotation_below(body, frame)) == Some(coordinate)
        };
        let mut share = vec![1.0; width];
        let own = share.iter_mut().zip(parameters).filter(|(_, (name, _))| is_own(name));
        own.for_each(|(share, _)| *share = 0.0);
        Apart { state: slots.q, share }
    };
    body.layout.turns.iter().map(of_rotation).collect()
}

/// The frame of the unit whose mount this is.
fn unit_of(model: &Model, name: &str) -> Option<usize> {
    let (unit, _) = name.rsplit_once(".mount_r")?;
    let sensor = model.sensors.iter().find(|sensor| sensor.name == unit)?;
    match &sensor.kind {
        SensorKind::Imu(imu) => Some(imu.frame),
        _ => None,
    }
}

/// First coordinate of the rotation nearest below a frame.
fn rotation_below(body: &Body, mut frame: usize) -> Option<usize> {
    while frame > 0 {
        let here = &body.model.frames[frame];
        if let Some((joint, _)) = here.joint {
            let own = body.model.joints[joint].coordinates();
            if let Some((coordinate, _)) = body.layout.turns.iter().find(|(first, _)| own.contains(first)) {
                return Some(*coordinate);
            }
        }
        frame = here.parent;
    }
    None
}
