//! The twin: the same body with all consider states as states. Its Jacobian gives the derivatives by them.

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

/// Meaning of a column of the twin's Jacobian in the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Role {
    State(usize),
    /// Number of the consider state, and its standard deviation in the column's unit.
    Considered(usize, f64),
    Nothing,
}

/// Builds the twin: mounts, lengths and sensor positions become states. Also returns, per parameter, whether a
/// calibration gave its standard deviation.
pub(super) fn twin(
    body: &Body,
    mounts: &[Option<MountValue>],
    known: &Calibration,
    config: &Config,
) -> Result<(Body, Vec<bool>)> {
    let mut model = (*body.model).clone();
    let mut parameters = body.parameters.clone();
    let mut told = vec![false; parameters.len()];
    for (parameter, told) in model.parameters.iter_mut().zip(&mut told) {
        let std = known.parameter_stds.get(&parameter.name).copied();
        *told = std.is_some();
        parameter.std = std.or(parameter.std);
    }
    for (i, given) in mounts.iter().enumerate() {
        let stds = known.mount_offset_stds_m.get(&model.sensors[i].name);
        let SensorKind::Imu(Imu { mount: Mount { rotation, offset, .. }, .. }) = &mut model.sensors[i].kind else {
            continue;
        };
        let place = given.map_or_else(|| [0, 1, 2].map(|k| offset[k].eval(&body.parameters)), |given| given.1);
        *rotation = given.map_or(*rotation, |given| given.0);
        for k in 0..3 {
            let label = format!("place{i}_{k}");
            offset[k] = Expr::constant_plus(place[k], parameters.len());
            let (unit, std) = ("m".to_string(), Some(stds.map_or(PLACE_STD_M, |stds| stds[k])));
            model.parameters.push(Parameter { name: label.clone(), label, unit, default: 0.0, std });
            parameters.push(0.0);
            told.push(stds.is_some());
        }
    }
    let mut all = config.clone();
    all.estimate.extend([LENGTHS, MOUNTS].map(String::from));
    let none = vec![None; model.sensors.len()];
    Ok((Body::new(Arc::new(model), &parameters, &none, &all)?, told))
}

/// A consider state.
struct Wanted {
    column: usize,
    std: f64,
    /// If a calibration gave its standard deviation: the one without the calibration relative to it; infinite if unknown.
    most: Option<f64>,
    is_mount: bool,
}

impl Wanted {
    /// `nominal`: if a calibration gave `std`, the standard deviation without it, as far as the model has one.
    fn new(column: usize, std: f64, nominal: Option<Option<f64>>) -> Self {
        let most = nominal.map(|nominal| nominal.map_or(f64::INFINITY, |nominal| nominal / std));
        Wanted { column, std, most, is_mount: false }
    }

    fn mount(column: usize, std: f64, nominal: Option<Option<f64>>) -> Self {
        Wanted { is_mount: true, ..Wanted::new(column, std, nominal) }
    }
}

/// Role of every column of the twin's Jacobian, names of the consider states, and how many of them have a standard
/// deviation from a calibration. These come first.
pub(super) struct Roles {
    pub(super) roles: Vec<Role>,
    pub(super) names: Vec<String>,
    pub(super) told: usize,
    /// For each of these: its standard deviation without the calibration, relative to the calibration's.
    pub(super) most: Vec<f64>,
    /// For each consider state: whether it is a mount's.
    pub(super) mounts: Vec<bool>,
}

impl Roles {
    pub(super) fn of(body: &Body, twin: &Body, known: &Calibration, told: &[bool]) -> Self {
        let own = |name: &String| body.layout.names.iter().position(|n| n == name);
        let state = |name: &String| own(name).map_or(Role::Nothing, Role::State);
        let mut roles: Vec<Role> = twin.layout.names.iter().map(state).collect();
        let states = roles.len();
        roles.resize(states + twin.input_std().len(), Role::Nothing);
        let mut wanted: Vec<Wanted> = Vec::new();
        for (parameter, state) in &twin.layout.lengths {
            let std = twin.model.parameters[*parameter].std.unwrap_or(0.0);
            let nominal = body.model.parameters.get(*parameter).map_or(Some(PLACE_STD_M), |own| own.std);
            wanted.push(Wanted::new(*state, std, told[*parameter].then_some(nominal)));
        }
        for (sensor, first) in &twin.layout.mounts {
            let sensor = &twin.model.sensors[*sensor];
            let Some(mount) = sensor.kind.mount() else { continue };
            let stds = known.mount_stds_rad.get(&sensor.name);
            let in_sensor = stds.map_or([mount.std_rad; 3], |stds| turned_std(&mount.rotation, stds));
            let nominal = stds.map(|_| Some(mount.std_rad));
            wanted.extend((0..3).map(|k| Wanted::mount(first + k, in_sensor[k], nominal)));
        }
        // The column of an input is scaled by its standard deviation.
        wanted
            .extend(twin.input_std().iter().enumerate().map(|(i, std)| Wanted::new(states + i, ZERO_STD / std, None)));
        wanted.retain(|one| roles[one.column] == Role::Nothing && one.std > 0.0);
        wanted.sort_by_key(|one| one.most.is_none());
        for (k, one) in wanted.iter().enumerate() {
            roles[one.column] = Role::Considered(k, one.std);
        }
        let most: Vec<f64> = wanted.iter().filter_map(|one| one.most).collect();
        let inputs = twin.model.joints.iter().filter(|j| j.input).map(|j| format!("{}.zero", j.name));
        let columns: Vec<String> = twin.layout.names.iter().cloned().chain(inputs).collect();
        let names = wanted.iter().map(|one| columns[one.column].clone()).collect();
        let mounts = wanted.iter().map(|one| one.is_mount).collect();
        Roles { roles, names, told: most.len(), most, mounts }
    }
}

/// Standard deviations of a mount about the sensor's axes, from those about the link's axes.
fn turned_std(link_from_sensor: &Mat3<f64>, about_link_rad: &[f64; 3]) -> [f64; 3] {
    let column = |k: usize| (0..3).map(move |j| link_from_sensor.0[j][k] * about_link_rad[j]);
    [0, 1, 2].map(|k| column(k).map(|s| s * s).sum::<f64>().sqrt())
}
