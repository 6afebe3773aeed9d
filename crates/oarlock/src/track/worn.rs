//! Checks a calibration against the model: parameter values, standard deviations and mounts.

use super::Calibration;
use crate::error::{Error, Result};
use crate::model::suggest::hint;
use crate::model::{Expr, Model};
use crate::rotation::Mat3;
use crate::sensor::MountValue;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Values of all parameters: the model's defaults where `given` has none.
pub fn parameter_values(model: &Model, given: &BTreeMap<String, f64>) -> Result<Vec<f64>> {
    let mut values: Vec<f64> = model.parameters.iter().map(|p| p.default).collect();
    let known: Vec<&str> = model.parameters.iter().map(|p| p.name.as_str()).collect();
    for (name, &value) in given {
        let Some(i) = known.iter().position(|k| k == name) else {
            return Err(Error::Data(format!(
                "parameter '{name}': model '{}' has none of that name; {}",
                model.name,
                hint(name, &known)
            )));
        };
        if !value.is_finite() {
            return Err(Error::Data(format!("parameter '{name}' = {value}: expected a finite number")));
        }
        values[i] = value;
    }
    Ok(values)
}

/// Refuses standard deviations of unknown names and ones that are not finite or negative.
pub(super) fn check_stds(model: &Model, given: &Calibration) -> Result<()> {
    let parameters: Vec<&str> = model.parameters.iter().map(|p| p.name.as_str()).collect();
    let units = units(model);
    let of_parameters =
        given.parameter_stds.iter().map(|(name, std)| ("parameter_stds", name, vec![*std], &parameters));
    let threes = [("mount_stds_rad", &given.mount_stds_rad), ("mount_offset_stds_m", &given.mount_offset_stds_m)];
    let of_units =
        threes.into_iter().flat_map(|(field, map)| map.iter().map(move |(name, three)| (field, name, three)));
    let of_units = of_units.map(|(field, name, three)| (field, name, three.to_vec(), &units));
    for (field, name, stds, known) in of_parameters.chain(of_units) {
        if !known.contains(&name.as_str()) {
            let text = format!("{field} '{name}': model '{}' has none of that name; {}", model.name, hint(name, known));
            return Err(Error::Data(text));
        }
        if !stds.iter().all(|std| std.is_finite() && *std >= 0.0) {
            return Err(Error::Data(format!("{field} '{name}' = {stds:?}: expected finite numbers from 0 on")));
        }
    }
    Ok(())
}

/// Smallest standard deviation of an estimated parameter, relative to the model's: zero would remove the state.
const LEAST_SHARE: f64 = 1e-6;

/// The model with the calibration's standard deviations.
pub(super) fn as_known(model: Arc<Model>, given: &Calibration) -> Arc<Model> {
    if given.parameter_stds.is_empty() {
        return model;
    }
    let mut known = (*model).clone();
    for parameter in &mut known.parameters {
        let told = given.parameter_stds.get(&parameter.name);
        parameter.std = parameter.std.map(|own| told.map_or(own, |told| told.max(LEAST_SHARE * own)));
    }
    Arc::new(known)
}

/// The model with the values, mounts and standard deviations of a calibration as its own.
pub fn calibrated(model: &Model, given: &Calibration) -> Result<Model> {
    let (values, mounts) = (parameter_values(model, &given.parameters)?, mount_values(model, &given.mounts)?);
    check_stds(model, given)?;
    let mut own = (*as_known(Arc::new(model.clone()), given)).clone();
    own.parameters.iter_mut().zip(values).for_each(|(parameter, value)| parameter.default = value);
    for (sensor, mount) in own.sensors.iter_mut().zip(mounts) {
        if let (Some(nominal), Some((rotation, offset))) = (sensor.kind.mount_mut(), mount) {
            (nominal.rotation, nominal.offset) = (rotation, offset.map(Expr::constant));
        }
    }
    Ok(own)
}

/// Names of the sensors with a mount.
fn units(model: &Model) -> Vec<&str> {
    model.sensors.iter().filter(|s| s.kind.mount().is_some()).map(|s| s.name.as_str()).collect()
}

/// Mount per sensor of the model; `None` for the nominal one.
pub fn mount_values(model: &Model, given: &BTreeMap<String, MountValue>) -> Result<Vec<Option<MountValue>>> {
    let known = units(model);
    for (name, (rotation, offset)) in given {
        if !known.contains(&name.as_str()) {
            return Err(Error::Data(format!(
                "mount '{name}': model '{}' has no inertial unit of that name; {}",
                model.name,
                hint(name, &known)
            )));
        }
        let (defect, det) = Mat3::rotation_defect(rotation);
        if !(defect < 1e-6 && (det - 1.0).abs() < 1e-6) {
            return Err(Error::Data(format!(
                "mount '{name}': link_from_sensor is no rotation: |R R' - 1| = {defect:.2e}, det = {det:.6}; \
                 expected an orthogonal matrix with determinant 1"
            )));
        }
        if offset.iter().any(|x| !x.is_finite()) {
            return Err(Error::Data(format!("mount '{name}': offset {offset:?} m must be finite")));
        }
    }
    Ok(model.sensors.iter().map(|s| given.get(&s.name).copied()).collect())
}
