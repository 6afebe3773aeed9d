//! The parameters of a score: mounts, lengths and sensor positions that are not states. In the augmented body they are states; its Jacobian gives
//! the derivatives by them.

use crate::body::Body;
use crate::config::Config;
use crate::error::Result;
use crate::estimate::System;
use crate::model::expr::Expr;
use crate::model::{Imu, Mount, Parameter, SensorKind};
use crate::rotation::Mat3;
use crate::sensor::MountValue;
use crate::state::{LENGTHS, MOUNTS};
use crate::track::Calibration;
use std::sync::Arc;

/// Standard deviation of a unit's position on its link in each direction, m.
const PLACE_STD_M: f64 = 0.01;
/// Standard deviation of an encoder's zero, rad or m.
pub(super) const ZERO_STD: f64 = 0.005;

/// Meaning of a column of the augmented body's Jacobian in the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Role {
    State(usize),
    /// Number of the parameter, and its standard deviation in the column's unit.
    Parameter(usize, f64),
    Nothing,
}

/// The same body with mounts, lengths and sensor positions as states.
pub(super) fn augmented(
    body: &Body,
    mounts: &[Option<MountValue>],
    known: &Calibration,
    config: &Config,
) -> Result<Body> {
    let mut model = (*body.model).clone();
    let mut values = body.parameters.clone();
    for parameter in &mut model.parameters {
        parameter.std = known.parameter_stds.get(&parameter.name).copied().or(parameter.std);
    }
    for (i, given) in mounts.iter().enumerate() {
        let stds = known.mount_offset_stds_m.get(&model.sensors[i].name).copied().unwrap_or([PLACE_STD_M; 3]);
        let SensorKind::Imu(Imu { mount: Mount { rotation, offset, .. }, .. }) = &mut model.sensors[i].kind else {
            continue;
        };
        let place = given.map_or_else(|| [0, 1, 2].map(|k| offset[k].eval(&body.parameters)), |given| given.1);
        *rotation = given.map_or(*rotation, |given| given.0);
        for k in 0..3 {
            let label = format!("place{i}_{k}");
            offset[k] = Expr::constant_plus(place[k], values.len());
            let (unit, std) = ("m".to_string(), Some(stds[k]));
            model.parameters.push(Parameter { name: label.clone(), label, unit, default: 0.0, std });
            values.push(0.0);
        }
    }
    let mut all = config.clone();
    all.estimate.extend([LENGTHS, MOUNTS].map(String::from));
    let none = vec![None; model.sensors.len()];
    Body::new(Arc::new(model), &values, &none, &all)
}

/// Role of every column of the augmented body's Jacobian; names of the parameters, and the standard deviations that are their units.
pub(super) fn roles(body: &Body, augmented: &Body, known: &Calibration) -> (Vec<Role>, Vec<(String, f64)>) {
    let layout = &augmented.layout;
    let own = |name: &String| body.layout.names.iter().position(|n| n == name);
    let mut roles: Vec<Role> = layout.names.iter().map(|name| own(name).map_or(Role::Nothing, Role::State)).collect();
    let mut columns: Vec<(usize, String, f64)> = Vec::new();
    let lengths = layout.lengths.iter();
    columns.extend(lengths.map(|(parameter, state)| {
        (*state, layout.names[*state].clone(), augmented.model.parameters[*parameter].std.unwrap_or(0.0))
    }));
    for (sensor, first) in &layout.mounts {
        let sensor = &augmented.model.sensors[*sensor];
        let Some(mount) = sensor.kind.mount() else { continue };
        let stds = known.mount_stds_rad.get(&sensor.name);
        let in_sensor = stds.map_or([mount.std_rad; 3], |stds| turned_std(&mount.rotation, stds));
        columns.extend((0..3).map(|k| (first + k, layout.names[first + k].clone(), in_sensor[k])));
    }
    columns.retain(|(column, _, std)| roles[*column] == Role::Nothing && *std > 0.0);
    let mut parameters = Vec::new();
    for (column, name, std) in columns {
        roles[column] = Role::Parameter(parameters.len(), std);
        parameters.push((name, std));
    }
    let inputs = augmented.model.joints.iter().filter(|j| j.input);
    for (joint, std) in inputs.zip(augmented.input_std()) {
        // The column of an input is scaled by its standard deviation.
        roles.push(Role::Parameter(parameters.len(), ZERO_STD / std));
        parameters.push((format!("{}.zero", joint.name), ZERO_STD));
    }
    (roles, parameters)
}

/// Standard deviations of a mount about the sensor's axes, from those about the link's axes.
fn turned_std(link_from_sensor: &Mat3<f64>, about_link_rad: &[f64; 3]) -> [f64; 3] {
    let column = |k: usize| (0..3).map(move |j| link_from_sensor.0[j][k] * about_link_rad[j]);
    [0, 1, 2].map(|k| column(k).map(|s| s * s).sum::<f64>().sqrt())
}
