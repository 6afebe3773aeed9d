//! Mounts, lever arms and magnetometer offsets of simulated hinge chains.

mod refusals;
pub mod signals;

use nalgebra::{Matrix3, Rotation3, Vector3};
use oarlock::calibrate::chain_sensor::{ChainOptions, ChainSensor};
use oarlock::calibrate::hinge_chain::{mounts, FoundMount};
use oarlock::calibrate::lever_arms::{lever_arms, LeverOptions};
use oarlock::calibrate::magnetic::{magnetic_field, MagneticOptions};
use oarlock::calibrate::still::{find_still, StillLimits};
use oarlock::rotation::Mat3;
use signals::{onset, readings, small_turn, world_from_link, Hinge, Noise, Readings, White, UP};

const FIELD_UT: Vector3<f64> = Vector3::new(11.0, -45.0, 18.0);
const NAMES: [&str; 3] = ["upper", "middle", "lower"];
/// Without noise only the numerical differentiation of the signals is left, below 1e-6.
const DIFFERENTIATION_RAD: f64 = 1e-6;

fn swing_1(t: f64) -> f64 {
    0.7 * onset(t, 2.0) * (3.1 * (t - 2.0)).sin()
}

fn swing_2(t: f64) -> f64 {
    0.4 * onset(t, 2.0) * (4.3 * (t - 2.0)).sin()
}

fn swing_3(t: f64) -> f64 {
    0.5 * onset(t, 2.0) * (5.2 * (t - 2.0)).sin()
}

fn clock() -> Vec<f64> {
    (0..1024).map(|k| 0.003 + k as f64 / 128.0).collect()
}

/// Three level hinges; x of each link points down at rest, z along the hinges.
fn pendulum(white: &mut White, bias_std: f64) -> Vec<Hinge> {
    let hanging = Rotation3::from_axis_angle(&Vector3::z_axis(), -std::f64::consts::FRAC_PI_2);
    let angles: [fn(f64) -> f64; 3] = [swing_1, swing_2, swing_3];
    let hinge = |(k, angle): (usize, fn(f64) -> f64)| Hinge {
        parent_from_link: if k == 0 { hanging } else { Rotation3::identity() },
        axis: Vector3::z(),
        angle,
        to_next: Vector3::new(0.5, 0.01, 0.02),
        sensor: Vector3::new(0.2 + 0.05 * k as f64, -0.02, 0.03),
        link_from_sensor: white.rotation(),
        gyro_bias: white.vector(0.01),
        accel_bias: white.vector(bias_std),
        mag_offset: white.vector(8.0),
    };
    angles.into_iter().enumerate().map(hinge).collect()
}

fn all_readings(chain: &[Hinge], noise: Noise, seed: u64) -> Vec<Readings> {
    let one = |k| readings(chain, k, &clock(), FIELD_UT, noise, seed);
    (0..chain.len()).map(one).collect()
}

/// The sensors as a user states them: posture at time zero and hinge axes in the world.
fn sensors<'a>(chain: &[Hinge], data: &'a [Readings]) -> Vec<ChainSensor<'a>> {
    let one = |(k, r): (usize, &'a Readings)| {
        let rest = world_from_link(chain, k, 0.0);
        ChainSensor {
            name: NAMES[k],
            world_from_link: Mat3([0, 1, 2].map(|i| [0, 1, 2].map(|j| rest[(i, j)]))),
            hinge_axis_in_world: (rest * chain[k].axis).into(),
            time_s: &r.time_s,
            gyro_rad_s: &r.gyro,
            accel_m_s2: &r.accel,
            swing_s: None,
        }
    };
    data.iter().enumerate().map(one).collect()
}

fn found(sensors: &[ChainSensor], options: &ChainOptions) -> Vec<FoundMount> {
    mounts(sensors, UP.into(), options).expect("the chain is a good one")
}

/// Error of the mount about the axes of the link, rad.
fn error(mount: &FoundMount, hinge: &Hinge) -> Vector3<f64> {
    let rotation = Matrix3::from_fn(|i, j| mount.link_from_sensor.0[i][j]);
    small_turn(&rotation, &hinge.link_from_sensor)
}

#[test]
fn errors_of_mounts_agree_with_their_standard_deviations() {
    const BIAS_M_S2: f64 = 0.03;
    let noise = Noise { gyro: 0.002, accel: 0.02, mag: 0.3 };
    let options = ChainOptions {
        posture_std_rad: 0.0,
        accel_bias_std_m_s2: BIAS_M_S2,
        misalignment_std_rad: 0.0,
        ..ChainOptions::default()
    };
    let (mut about_hinge, mut about_up, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..12 {
        let chain = pendulum(&mut White::new(seed), BIAS_M_S2);
        let data = all_readings(&chain, noise, seed);
        for (mount, hinge) in found(&sensors(&chain, &data), &options).iter().zip(&chain) {
            let error = error(mount, hinge);
            about_hinge += (error.z / mount.std_about_hinge_rad).powi(2);
            about_up += (error.x / mount.std_about_up_rad).powi(2);
            count += 1.0;
            // The hinge axis is by far the better known of the two here, and decides.
            assert!(error.xy().norm() < 1e-3, "seed {seed}: {error:?}");
            for (found, truth) in mount.gyro_bias_rad_s.iter().zip(&hinge.gyro_bias) {
                assert!((found - truth).abs() < 5.0 * noise.gyro / (256.0_f64).sqrt());
            }
        }
    }
    // 99.9 % bounds of chi-square with 36 degrees of freedom, divided by 36.
    assert!((0.45..1.89).contains(&(about_hinge / count)), "{}", about_hinge / count);
    // A jackknife over eight blocks knows its own standard deviation to 25 %.
    assert!((0.3..3.0).contains(&(about_up / count)), "{}", about_up / count);
}

#[test]
fn bent_rest_and_reversed_neighbour_are_exact_without_noise() {
    let level = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.3);
    // Slanted, gravity tells the sense; the first link may then turn the other way first.
    let slanted = Rotation3::from_euler_angles(0.4, -0.2, 0.3);
    for (base, first) in [(level, swing_1 as fn(f64) -> f64), (slanted, |t| -swing_1(t))] {
        let mut chain = pendulum(&mut White::new(3), 0.0);
        chain[0].parent_from_link = base;
        chain[0].angle = first;
        chain[1].axis = -chain[1].axis;
        chain[1].angle = |t| 0.3 - swing_2(t);
        chain[2].parent_from_link = Rotation3::from_axis_angle(&Vector3::z_axis(), -0.5);
        let data = all_readings(&chain, Noise::default(), 3);
        for (mount, hinge) in found(&sensors(&chain, &data), &ChainOptions::default()).iter().zip(&chain) {
            assert!(error(mount, hinge).norm() < DIFFERENTIATION_RAD, "{mount:?}");
            assert!(mount.disagreement_rad.abs() < DIFFERENTIATION_RAD);
        }
    }
}

#[test]
fn first_turn_decides_the_sense() {
    let chain = pendulum(&mut White::new(5), 0.0);
    let data = all_readings(&chain, Noise::default(), 5);
    let options = ChainOptions { first_turn_positive: false, ..ChainOptions::default() };
    let half_turn = Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    for (mount, hinge) in found(&sensors(&chain, &data), &options).iter().zip(&chain) {
        let mirrored = Hinge { link_from_sensor: half_turn * hinge.link_from_sensor, ..hinge.clone() };
        let error = error(mount, &mirrored);
        assert!(error.norm() < DIFFERENTIATION_RAD, "{error:?} {mount:?}");
    }
}

#[test]
fn hinges_that_are_not_parallel_swing_one_at_a_time() {
    let mut chain = pendulum(&mut White::new(8), 0.0);
    chain.truncate(2);
    chain[0].angle = |t| 0.6 * onset(t, 2.0) * (1.0 - onset(t, 4.0)) * (4.0 * t - 8.0).sin();
    chain[1].axis = Vector3::new(0.2, 0.9, 0.4);
    chain[1].angle = |t| 0.6 * onset(t, 5.1) * (4.0 * t - 20.4).sin();
    let data = all_readings(&chain, Noise::default(), 8);
    let mut sensors = sensors(&chain, &data);
    sensors[0].swing_s = Some((2.0, 5.0));
    sensors[1].swing_s = Some((5.1, 8.0));
    let options = ChainOptions { still_s: Some((0.1, 1.9)), ..ChainOptions::default() };
    let mounts = found(&sensors, &options);
    for (mount, hinge) in mounts.iter().zip(&chain) {
        let error = error(mount, hinge);
        assert!(error.norm() < DIFFERENTIATION_RAD, "{error:?} {mount:?}");
    }
    let levers = lever_arms(&sensors, &mounts, UP.into(), &LeverOptions::default(), &mut || true).expect("good");
    let off = Vector3::from(levers[1].offset_m) - chain[1].sensor;
    let axis = chain[1].axis.normalize();
    assert!((off - axis * axis.dot(&off)).norm() < 0.005, "{off:?} {:?}", levers[1]);
    // A hinge may be placed anywhere along its axis; the bands have to say so.
    assert!(Vector3::from(levers[1].offset_std_m).norm() > 0.1, "{:?}", levers[1]);
}

#[test]
fn disagreement_is_shared_by_the_variances() {
    const TILT_RAD: f64 = 0.03;
    let chain = pendulum(&mut White::new(1), 0.0);
    let mut data = all_readings(&chain, Noise::default(), 1);
    let sensor_from_link = chain[0].link_from_sensor.inverse();
    let tilt = sensor_from_link * Rotation3::new(Vector3::y() * TILT_RAD) * chain[0].link_from_sensor;
    data[0].accel.iter_mut().for_each(|a| *a = (tilt * Vector3::from(*a)).into());
    let options = ChainOptions {
        posture_std_rad: 0.02,
        accel_bias_std_m_s2: 0.0,
        misalignment_std_rad: 0.01,
        ..ChainOptions::default()
    };
    let mount = &found(&sensors(&chain, &data), &options)[0];
    assert!((mount.disagreement_rad.abs() - TILT_RAD).abs() < DIFFERENTIATION_RAD);
    // 0.01^2 / (0.01^2 + 0.02^2) of it falls on the hinge axis.
    assert!((mount.axis_moved_rad - 0.2 * mount.disagreement_rad).abs() < DIFFERENTIATION_RAD);
    let turned = error(mount, &chain[0]);
    assert!((turned.y.abs() - 0.2 * TILT_RAD).abs() < DIFFERENTIATION_RAD, "{turned:?}");
    assert!(turned.x.abs().max(turned.z.abs()) < DIFFERENTIATION_RAD, "{turned:?}");
}

#[test]
fn lever_arms_and_link_lengths_are_found_within_their_bands() {
    let noise = Noise { gyro: 0.002, accel: 0.02, mag: 0.3 };
    for seed in 0..4 {
        let chain = pendulum(&mut White::new(seed), 0.03);
        let data = all_readings(&chain, noise, seed);
        let sensors = sensors(&chain, &data);
        let mounts = found(&sensors, &ChainOptions::default());
        let options = LeverOptions::default();
        let levers = lever_arms(&sensors, &mounts, UP.into(), &options, &mut || true).expect("good data");
        for (lever, hinge) in levers.iter().zip(&chain) {
            let mut checks = vec![(lever.offset_m, lever.offset_std_m, hinge.sensor)];
            checks.extend(lever.to_next_hinge_m.map(|(value, std)| (value, std, hinge.to_next)));
            for (value, std, truth) in checks {
                for axis in 0..2 {
                    let off = (value[axis] - truth[axis]).abs();
                    // 5 mm: what smoothing and the mount's error of some mrad leave.
                    assert!(off < 4.0 * std[axis] + 0.005, "seed {seed} {lever:?}: {off}");
                    assert!(std[axis] < 0.01, "seed {seed} {lever:?}");
                }
                assert_eq!((value[2], std[2]), (0.0, options.prior_std_m), "along the hinges");
            }
            // White noise after a parabola over nine samples is a quarter of it and more.
            assert!(lever.residual_m_s2 < 2.0 * noise.accel, "{lever:?}");
        }
        assert!(levers[2].to_next_hinge_m.is_none());
    }
}

#[test]
fn magnetometer_offsets_and_field_are_found() {
    let noise = Noise { gyro: 0.002, accel: 0.02, mag: 0.3 };
    let chain = pendulum(&mut White::new(11), 0.01);
    let data = all_readings(&chain, noise, 11);
    let sensors = sensors(&chain, &data);
    let mounts = found(&sensors, &ChainOptions::default());
    let columns: Vec<&[[f64; 3]]> = data.iter().map(|r| r.mag.as_slice()).collect();
    let field =
        magnetic_field(&sensors, &columns, &mounts, &MagneticOptions::default(), &mut || true).expect("good data");
    for axis in 0..3 {
        let off = (field.field_in_world_ut[axis] - FIELD_UT[axis]).abs();
        // 0.3 uT: what a mount's error of 5 mrad does to a field of 50 uT.
        assert!(off < 4.0 * field.field_std_ut[axis] + 0.3, "{field:?}");
    }
    for (offset, hinge) in field.offsets.iter().zip(&chain) {
        for axis in 0..3 {
            let off = (offset.offset_ut[axis] - hinge.mag_offset[axis]).abs();
            assert!(off < 4.0 * offset.offset_std_ut[axis] + 0.3, "{offset:?} {:?}", hinge.mag_offset);
        }
        assert!(offset.residual_ut < 1.5 * noise.mag, "{offset:?}");
        assert!(offset.residual_without_ut > 2.0 * offset.residual_ut, "{offset:?}");
    }
}

#[test]
fn still_stretch_ends_at_the_swing_and_at_gaps() {
    let chain = pendulum(&mut White::new(2), 0.0);
    let noise = Noise { gyro: 0.002, accel: 0.02, mag: 0.0 };
    let mut data = all_readings(&chain, noise, 2).remove(0);
    let limits = StillLimits::default();
    let whole = find_still("upper", &data.time_s, &data.gyro, &data.accel, &limits).expect("still");
    // The onset is smooth: the first 0.3 s of the swing are slower than the limit.
    assert!(whole.0 < 0.01 && (1.9..2.35).contains(&whole.1), "{whole:?}");
    data.gyro[64] = [f64::NAN; 3];
    let cut = find_still("upper", &data.time_s, &data.gyro, &data.accel, &limits).expect("still");
    assert!(cut.0 > data.time_s[64] && cut.1 == whole.1, "{cut:?}");
}
