//! The sign of each hinge axis of a chain.

use super::chain_sensor::{ChainOptions, ChainSensor};
use super::turning::Turning;
use crate::{Error, Result};
use nalgebra::Vector3;

/// Gives all axes the chain's common sense; returns each sensor's correlation with the one before it.
pub(crate) fn choose_signs(
    sensors: &[ChainSensor],
    turns: &mut [Turning],
    up_in_world: Vector3<f64>,
    options: &ChainOptions,
) -> Result<Vec<Option<f64>>> {
    let mut correlations = Vec::with_capacity(turns.len());
    for k in 0..turns.len() {
        let (before, rest) = turns.split_at_mut(k);
        let (here, sensor) = (&mut rest[0], &sensors[k]);
        let related = before.last().and_then(|previous| {
            let sense = sensors[k - 1].common_direction(sensor)?;
            Some(correlation(previous, here) * sense)
        });
        let reversed = match (reversed_by_gravity(sensor, here, up_in_world, options), related) {
            (Some(reversed), _) => reversed,
            (None, Some(related)) => {
                check_related(sensors[k - 1].name, sensor.name, related)?;
                related < 0.0
            }
            (None, None) => {
                let clear_rad = 0.5 * options.least_turn_rad;
                here.first_turns_positive(clear_rad) != options.first_turn_positive
            }
        };
        if reversed {
            here.reverse();
        }
        correlations.push(related.map(|r| if reversed { -r } else { r }));
    }
    Ok(correlations)
}

/// Whether the gyroscope's axis is the stated one reversed. Gravity decides it if the hinge is far enough from level.
fn reversed_by_gravity(
    sensor: &ChainSensor,
    here: &Turning,
    up_in_world: Vector3<f64>,
    options: &ChainOptions,
) -> Option<bool> {
    let stated = Vector3::from(sensor.hinge_axis_in_world).normalize().dot(&up_in_world);
    let slanted = stated.abs() > options.most_disagreement_rad.sin();
    slanted.then(|| stated * here.spin.axis.dot(&here.rest.up) < 0.0)
}

/// Correlation of the rates of two sensors while both swing; 0 without overlap.
fn correlation(a: &Turning, b: &Turning) -> f64 {
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (&t, &y) in b.time_s.iter().zip(&b.rate_rad_s) {
        let after = a.time_s.partition_point(|&s| s < t);
        if after == 0 || after == a.time_s.len() {
            continue;
        }
        let (t0, t1) = (a.time_s[after - 1], a.time_s[after]);
        let x = a.rate_rad_s[after - 1] + (a.rate_rad_s[after] - a.rate_rad_s[after - 1]) * (t - t0) / (t1 - t0);
        ab += x * y;
        aa += x * x;
        bb += y * y;
    }
    if aa > 0.0 && bb > 0.0 {
        ab / (aa * bb).sqrt()
    } else {
        0.0
    }
}

fn check_related(before: &str, name: &str, related: f64) -> Result<()> {
    const LEAST: f64 = 0.3;
    if related.abs() >= LEAST {
        return Ok(());
    }
    Err(Error::Data(format!(
        "sensors `{before}` and `{name}`: their turning correlates by {related:.2}, at least {LEAST} is needed to determine the \
         sense of the hinge axis. Let the chain swing as one"
    )))
}
