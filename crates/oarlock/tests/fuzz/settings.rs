//! Configurations and calibrations of any numbers.

use super::campaign::campaign;
use super::models::answered;
use super::mutate::mutated;
use super::numbers::{index, odd, one_in, pick};
use super::streams::{samples, step_through};
use super::support::chance::Chance;
use super::support::{model, CHAIN, SCULLER};
use oarlock::config::{Config, FilterKind, Magnetometer, ProcessNoise};
use oarlock::model::Structure;
use oarlock::rotation::Mat3;
use oarlock::track::{Calibration, Tracker};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Within the range that is allowed, or any number.
fn number(chance: &mut Chance, low: f64, high: f64) -> f64 {
    if one_in(chance, 12) {
        odd(chance)
    } else {
        chance.between(low, high)
    }
}

pub fn config(chance: &mut Chance, coordinates: usize) -> Config {
    let names = ["gyro_bias", "accel_bias", "surge", "lengths", "mounts", "seat", "", "l_ua_r", "no_such"];
    let estimate = (0..index(chance, 4)).map(|_| pick(chance, &names).to_string()).collect();
    let guess = |chance: &mut Chance| {
        let count = if one_in(chance, 5) { index(chance, 30) } else { coordinates };
        (0..count).map(|_| odd(chance)).collect()
    };
    Config {
        structure: *pick(chance, &[None, Some(Structure::Tree), Some(Structure::Strapdown)]),
        estimate,
        closures: one_in(chance, 2),
        contacts: one_in(chance, 2),
        process_noise: *pick(chance, &[ProcessNoise::Jerk, ProcessNoise::Paper]),
        magnetometer: *pick(chance, &[Magnetometer::Off, Magnetometer::Gated, Magnetometer::On]),
        filter: *pick(chance, &[FilterKind::Ukf, FilterKind::Ekf, FilterKind::Factorised]),
        initial_q: one_in(chance, 4).then(|| guess(chance)),
        alpha: number(chance, 1e-4, 1.0),
        beta: number(chance, 1.0, 4.0),
        kappa: number(chance, 0.0, 3.0),
        merge_s: number(chance, 1e-6, 1e-2),
        sample_rate_hz: one_in(chance, 3).then(|| number(chance, 0.0, 1e3)),
        inputs: one_in(chance, 3)
            .then(|| vec![pick(chance, &["r_oar_phi", "seat", "l_oar_alpha", "no_such"]).to_string()]),
        stamp_std_s: one_in(chance, 3).then(|| BTreeMap::from([("back".to_string(), number(chance, 0.0, 1e-2))])),
        wait_s: number(chance, 0.0, 0.1),
        start_window_s: number(chance, 1e-3, 1.0),
        gate: one_in(chance, 2),
        gate_patience_s: number(chance, 1e-3, 1.0),
        belief_interval_s: number(chance, 1e-3, 10.0),
        output_rate_hz: one_in(chance, 3).then(|| number(chance, 1e-2, 1e3)),
    }
}

#[test]
fn configurations_are_used_or_refused() {
    let bodies = [model(CHAIN), model(CHAIN), model(SCULLER)];
    campaign("configurations", 40, |chance, fed| {
        let model = pick(chance, &bodies).clone();
        let config = config(chance, model.coordinate_count());
        write!(fed, "{} {config:?}", model.name).unwrap();
        let Some(mut tracker) = answered(Tracker::new(model, &Calibration::default(), &config)) else { return };
        let samples = samples(chance, &tracker, 8);
        step_through(&mut tracker, &samples);
    });
}

/// What the binding and files hand over: JSON with wounds.
#[test]
fn written_configurations_are_read_or_refused() {
    let whole = serde_json::to_string_pretty(&Config::default()).unwrap();
    campaign("written configurations", 1_000, |chance, fed| {
        *fed = mutated(chance, &whole, &[whole.as_str()]);
        match serde_json::from_str::<Config>(fed) {
            Ok(config) => drop(answered(config.check())),
            Err(why) => assert!(!why.to_string().is_empty()),
        }
    });
}

fn rotation(chance: &mut Chance) -> Mat3<f64> {
    let (sin, cos) = odd(chance).sin_cos();
    let mut rows = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
    rows.rotate_left(index(chance, 3));
    if one_in(chance, 4) {
        rows[index(chance, 3)][index(chance, 3)] = odd(chance);
    }
    Mat3(rows)
}

#[test]
fn calibrations_are_used_or_refused() {
    let bodies = [model(CHAIN), model(SCULLER)];
    campaign("calibrations", 40, |chance, fed| {
        let model = pick(chance, &bodies).clone();
        let mut calibration = Calibration::default();
        let wrong = if one_in(chance, 10) { "nobody" } else { "" };
        for p in &model.parameters {
            if !one_in(chance, 6) {
                continue;
            }
            let value =
                if one_in(chance, 3) { super::numbers::finite(chance) } else { p.default * chance.between(0.5, 2.0) };
            calibration.parameters.insert(format!("{}{wrong}", p.name), value);
        }
        for s in &model.sensors {
            if !one_in(chance, 3) {
                continue;
            }
            let offset = [0; 3].map(|_| if one_in(chance, 10) { odd(chance) } else { chance.normal() });
            calibration.mounts.insert(format!("{}{wrong}", s.name), (rotation(chance), offset));
            if one_in(chance, 3) {
                calibration.corrections.mag_offsets.insert(s.name.clone(), [0; 3].map(|_| odd(chance)));
            }
        }
        write!(fed, "{} {calibration:?}", model.name).unwrap();
        let Some(mut tracker) = answered(Tracker::new(model, &calibration, &Config::default())) else { return };
        let samples = samples(chance, &tracker, 6);
        step_through(&mut tracker, &samples);
    });
}
