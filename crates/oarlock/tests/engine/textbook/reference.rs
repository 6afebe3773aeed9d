//! Engine and textbook against vectors from an independent implementation.

use super::body::{Motion, Naive};
use super::support::{body, model, numbers, plain, vectors, worse, SCULLER};
use super::ukf::Weights;
use nalgebra::{DVector, Matrix3, Vector3};
use oarlock::body::Body;
use oarlock::config::ProcessNoise;
use oarlock::estimate::{Points, System};
use oarlock::kernels::lane::{Lane, LANES};
use oarlock::kinematics::FrameMotion;
use oarlock::model::{Expr, Imu, ImuNoise, Model, Mount, Sensor, SensorKind};
use oarlock::motion::{joint_block, Now};
use oarlock::rotation::{Mat3, Vec3};
use oarlock::state::Slots;
use oarlock::track::loops::{readings, readings_from};
use serde_json::Value;
use std::sync::Arc;

/// What the vectors promise for signals up to some tens of m/s2 and uT.
const SIGNALS: f64 = 1e-9;
/// What they promise for lengths and direction cosines.
const GAPS: f64 = 1e-12;
/// A few roundings of a double.
const ROUNDING: f64 = 1e-15;

#[test]
fn weights_are_the_textbooks() {
    for case in vectors("filter_blocks.json")["unscented_weights"].as_array().unwrap() {
        let of = |key: &str| case[key].as_f64().unwrap();
        let w = Weights::new(of("n") as usize, of("alpha"), of("beta"), of("kappa"));
        let pairs = [(w.lambda, of("lam")), (w.mean_0, of("Wm0")), (w.covariance_0, of("Wc0")), (w.others, of("Wi"))];
        // n + lambda loses as many digits as 1 / alpha^2 has.
        let tolerance = 4.0 * ROUNDING * of("n") / of("alpha").powi(2);
        for (found, wanted) in pairs {
            assert!((found - wanted).abs() <= tolerance * wanted.abs().max(1.0), "{found} {wanted}");
        }
    }
}

#[test]
fn driving_noise_is_as_listed() {
    let blocks = vectors("filter_blocks.json");
    let dt = blocks["dt"].as_f64().unwrap();
    let model = model(SCULLER);
    let mut axis = model.axes()[1];
    axis.process.density = 1.0 / dt.sqrt();
    let slots = Slots { q: 0, rates: Some((1, 2)) };
    let now = Now { dt, held: false };
    for (kind, name) in [(ProcessNoise::Paper, "paper"), (ProcessNoise::Jerk, "wnj")] {
        let block = joint_block(&axis, slots, now, kind);
        for r in 0..3 {
            let wanted = numbers(&blocks["Q_block_unit_sigma"][name][r]);
            for (found, wanted) in block.noise[r].iter().zip(wanted) {
                assert!((found / wanted - 1.0).abs() <= 2.0 * ROUNDING, "{name}: {found} {wanted}");
            }
        }
    }
}

/// A state of the vectors in the engine's order.
fn state(body: &Body, x: &[f64]) -> Vec<f64> {
    let at = |j: usize| body.layout.coordinates[j].expect("a state");
    let mut state = vec![0.0; body.layout.dim()];
    let driven = [0, 1, 2, 3, 4, 5, 6, 9, 10, 11, 12, 13];
    for (k, j) in driven.into_iter().enumerate() {
        let (rate, accel) = at(j).rates.expect("driven");
        (state[at(j).q], state[rate], state[accel]) = (x[3 * k], x[3 * k + 1], x[3 * k + 2]);
    }
    for (k, j) in [7, 8, 14, 15].into_iter().enumerate() {
        state[at(j).q] = x[36 + k];
    }
    state[body.layout.azimuth.expect("estimated")] = body.model.world.magnetic_azimuth_rad;
    state
}

fn inputs(body: &Body, encoders: &[f64]) -> Vec<f64> {
    let mut inputs = vec![0.0; body.model.coordinate_count()];
    [16, 17, 19, 20].into_iter().zip(encoders).for_each(|(j, &x)| inputs[j] = x);
    inputs
}

#[test]
fn measurement_vector_agrees_in_every_lane() {
    let (model, blocks) = (model(SCULLER), vectors("filter_blocks.json"));
    let body = body(&model, &plain(&[]));
    let textbook = Naive::new(&model, model.default_parameters(), &body.layout.names);
    let (mut ours, mut plainly) = (0.0_f64, 0.0_f64);
    for (k, h) in blocks["h"].as_array().unwrap().iter().enumerate() {
        let (wanted, x) = (numbers(h), state(&body, &numbers(&blocks["x"][k])));
        let mut moment = body.moment();
        moment.inputs = inputs(&body, &numbers(&blocks["enc_phiR_alphaR_phiL_alphaL"][k]));
        moment.active.fill(true);
        moment.needed.fill(true);
        let zero = vec![Lane([0.0; LANES]); x.len()];
        let mut out = vec![Lane([0.0; LANES]); body.suite.len()];
        let at = Points { mean: &x, delta: &zero, off: &[] };
        body.readings(&moment, &mut body.scratch(), at, &mut out);
        assert_eq!(wanted.len(), out.len());
        let plain = textbook.measure(&DVector::from_vec(x), &moment.inputs);
        for ((lane, wanted), plain) in out.iter().zip(&wanted).zip(plain.iter()) {
            lane.0.iter().for_each(|found| ours = worse(ours, (found - wanted).abs()));
            plainly = worse(plainly, (plain - wanted).abs());
        }
    }
    println!("h: engine {ours:.1e}, textbook {plainly:.1e}");
    assert!(ours < SIGNALS && plainly < SIGNALS);
}

/// The sculler with the sensors of the vector file instead of its own.
fn with_sensors(sensors: &Value) -> Model {
    let mut model = (*model(SCULLER)).clone();
    let noise = ImuNoise {
        gyro_std: Some(1.0),
        accel_std: Some(1.0),
        mag_std: Some(1.0),
        rest_std: None,
        gyro_range: None,
        accel_range: None,
        gyro_bias_start_std: 0.02,
        gyro_bias_walk: 1.1e-5,
        accel_bias_start_std: 0.05,
        accel_bias_walk: 1.1e-4,
    };
    let sensor = |s: &Value| {
        let rotation = [0, 1, 2].map(|i| three(&s["R_link_from_sensor"][i]));
        let offset = three(&s["offset_in_link"]).map(Expr::constant);
        let mount = Mount { rotation: Mat3(rotation), std_rad: 0.1, rigid: false, soft_std_rad: 0.0, offset };
        let frame = s["frame"].as_u64().expect("a frame") as usize;
        let name = s["name"].as_str().expect("a name").to_string();
        Sensor { name, kind: SensorKind::Imu(Imu { frame, mount, noise, contact: None }) }
    };
    model.sensors = sensors.as_array().expect("sensors").iter().map(sensor).collect();
    model
}

fn three(value: &Value) -> [f64; 3] {
    numbers(value).try_into().expect("three numbers")
}

#[test]
fn inertial_signals_agree_on_still_and_moving_roots() {
    let v = vectors("imu.json");
    let model = Arc::new(with_sensors(&v["sensors"]));
    let body = body(&model, &plain(&[]));
    let textbook = Naive::new(&model, model.default_parameters(), &body.layout.names);
    let vector = |value: &Value| Vector3::from(three(value));
    let (mut ours, mut plainly) = (0.0_f64, 0.0_f64);
    for k in 0..10 {
        let world_from_root = Matrix3::from_fn(|i, j| numbers(&v["base_R_world_from_root"][k][i])[j]);
        let into_root = |x: &Value| world_from_root.transpose() * vector(x);
        let field = into_root(&v["mag_world_uT"]);
        let force = vector(&v["base_acc"][k]) - into_root(&v["gravity_world"]);
        let (spin, spin_rate) = (vector(&v["base_omega"][k]), vector(&v["base_omegadot"][k]));
        let [q, qd, qdd] = ["q", "qd", "qdd"].map(|key| numbers(&v[key][k]));
        let lanes = |v: Vector3<f64>| Vec3([v.x, v.y, v.z]);
        let root = FrameMotion {
            angular_velocity: lanes(spin),
            angular_acceleration: lanes(spin_rate),
            ..FrameMotion::resting(lanes(force))
        };
        let found = readings_from(&body, root, lanes(field), &q, &qd, &qdd);
        let joints: Vec<[f64; 3]> = (0..q.len()).map(|j| [q[j], qd[j], qdd[j]]).collect();
        let root = Motion { spin, spin_rate, ..super::body::resting(force) };
        let plain = textbook.rows(root, field, &joints);
        for s in 0..11 {
            for (i, wanted) in numbers(&v["out_gyro_acc_mag"][k][s]).iter().enumerate() {
                ours = worse(ours, (found[9 * s + i] - wanted).abs());
                plainly = worse(plainly, (plain[9 * s + i] - wanted).abs());
            }
        }
    }
    println!("inertial signals: engine {ours:.1e}, textbook {plainly:.1e}");
    assert!(ours < SIGNALS && plainly < SIGNALS);
}

#[test]
fn loops_have_the_listed_gaps() {
    let (model, v) = (model(SCULLER), vectors("closure.json"));
    let body = body(&model, &plain(&[]));
    let mut worst: f64 = 0.0;
    for (q, wanted) in v["q"].as_array().unwrap().iter().zip(v["residual_rp_rz_lp_lz"].as_array().unwrap()) {
        let (q, still) = (numbers(q), [0.0; 22]);
        let found = readings(&body, &q, &still, &still);
        for (found, wanted) in found[46..].iter().zip(numbers(wanted)) {
            worst = worse(worst, (found - wanted).abs());
        }
    }
    println!("loops: {worst:.1e}");
    assert!(worst < GAPS);
}
