//! What units tell that rest: how they are inclined, and the magnetic field.

use super::bodies::{signals, Bodies, FIELD_UT};
use super::signals::{small_turn, Noise, Readings, UP};
use nalgebra::{Matrix3, Rotation3, Vector3};
use oarlock::calibrate::aligned::{aligned_mount, Sight};
use oarlock::calibrate::local_field::{local_field, FieldOptions};
use oarlock::calibrate::pose_mounts::{pose_mounts, PoseMount, PoseOptions, PosedUnit};
use oarlock::rotation::Mat3;

const NOISE: Noise = Noise { gyro: 0.003, accel: 0.02, mag: 0.3 };
/// Noise of 0.02 m/s2 averaged over hundreds of rows.
const NOISE_RAD: f64 = 5e-4;

fn rows(m: Rotation3<f64>) -> Mat3<f64> {
    Mat3([0, 1, 2].map(|i| [0, 1, 2].map(|j| m[(i, j)])))
}

fn matrix(m: &Mat3<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| m.0[i][j])
}

fn posed(bodies: &Bodies, read: &Readings, off: Vector3<f64>, options: &PoseOptions) -> oarlock::Result<PoseMount> {
    let unit = PosedUnit {
        signals: signals("one", read),
        link_from_sensor: rows(Rotation3::new(off) * bodies.mount(0)),
        world_from_link: Mat3::identity(),
    };
    Ok(pose_mounts(&[unit], UP.into(), options)?.remove(0))
}

#[test]
fn a_tilted_mount_is_set_upright_and_keeps_its_heading() {
    let bodies = Bodies::resting(3).with_biases(4, 0.01, 0.0);
    let [read, _] = bodies.read(10.0, NOISE, 1);
    for (tilt, heading) in [(0.0, 0.0), (0.2, 0.0), (-0.4, 0.3)] {
        let off = Vector3::new(tilt, 0.0, 0.0);
        let nominal = Rotation3::new(UP * heading) * Rotation3::new(off);
        let found = posed(&bodies, &read, nominal.scaled_axis(), &PoseOptions::default()).expect("it rests");
        let left = small_turn(&matrix(&found.link_from_sensor), &bodies.mount(0));
        assert!((left - UP * heading).amax() < NOISE_RAD, "{left:?}");
        assert!((found.turned_rad - f64::abs(tilt)).abs() < NOISE_RAD);
        assert!(found.sensor_std_rad < 0.02 && found.std_rad > 0.05);
    }
}

#[test]
fn sway_widens_the_standard_deviation() {
    let [mut read, _] = Bodies::resting(3).read(10.0, NOISE, 1);
    let bodies = Bodies::resting(3);
    let calm = posed(&bodies, &read, Vector3::zeros(), &PoseOptions::default()).expect("it rests");
    for (k, row) in read.accel.iter_mut().enumerate() {
        row[0] += 0.004 * (k as f64 - 500.0);
    }
    let swaying = posed(&bodies, &read, Vector3::zeros(), &PoseOptions::default()).expect("it rests");
    assert!(swaying.sensor_std_rad > 3.0 * calm.sensor_std_rad);
}

#[test]
fn a_stretch_in_which_a_unit_moves_is_refused() {
    let bodies = Bodies::ball(3);
    let [read, _] = bodies.read(10.0, NOISE, 1);
    let named = PoseOptions { still_s: Some((2.0, 4.0)), ..PoseOptions::default() };
    let text = posed(&bodies, &read, Vector3::zeros(), &named).expect_err("it moves").to_string();
    assert!(text.contains("`one`") && text.contains("2.00 to 4.00 s"), "{text}");
    let text = posed(&bodies, &read, Vector3::zeros(), &PoseOptions::default()).expect_err("it moves").to_string();
    assert!(text.contains("no still stretch"), "{text}");
}

#[test]
fn one_direction_turns_a_mount_as_little_as_it_can_and_two_tell_it() {
    let truth = Rotation3::new(Vector3::new(0.3, -0.2, 0.5));
    let nominal = rows(Rotation3::new(Vector3::new(0.1, 0.05, -0.1)) * truth);
    let sight = |link: Vector3<f64>, std_rad: f64| Sight {
        in_sensor: (truth.inverse() * link).into(),
        in_link: link.into(),
        std_rad,
    };
    let one = aligned_mount(&nominal, &[sight(Vector3::z(), 0.01)]);
    let least = (matrix(&nominal) * (truth.inverse() * Vector3::z())).angle(&Vector3::z());
    assert!((one.turned_rad - least).abs() < 1e-6, "{} and {least}", one.turned_rad);
    assert!(one.left_rad[0] < 1e-7);
    let two = aligned_mount(&nominal, &[sight(Vector3::z(), 0.01), sight(Vector3::x(), 0.02)]);
    assert!(small_turn(&matrix(&two.link_from_sensor), &truth).amax() < 1e-7);
    let none = aligned_mount(&nominal, &[]);
    assert!(none.turned_rad < 1e-7);
}

/// A unit at rest in a few postures, one after the other, in an exact field.
fn postures(turns: &[Vector3<f64>], offset: Vector3<f64>) -> Readings {
    let mut all = Readings { time_s: vec![], gyro: vec![], accel: vec![], mag: vec![] };
    for (k, turn) in turns.iter().enumerate() {
        let from_world = Rotation3::new(*turn).inverse();
        for row in 0..600 {
            all.time_s.push(6.0 * k as f64 + 0.01 * row as f64);
            all.gyro.push([0.0; 3]);
            all.accel.push((from_world * UP * 9.81).into());
            all.mag.push((from_world * FIELD_UT + offset).into());
        }
    }
    all
}

fn dip() -> f64 {
    (-FIELD_UT.normalize().dot(&UP)).asin()
}

#[test]
fn norm_and_dip_are_found_at_rest() {
    let read = postures(&[Vector3::zeros(), Vector3::x()], Vector3::zeros());
    let found = local_field(&[(signals("one", &read), &read.mag)], &FieldOptions::default()).expect("it rests");
    assert!((found.norm_ut - FIELD_UT.norm()).abs() < 1e-9 && (found.dip_rad - dip()).abs() < 1e-9);
    assert_eq!((found.directions, found.departing_share), (2, 0.0));
}

#[test]
fn opposite_directions_cancel_a_constant_error() {
    use std::f64::consts::{FRAC_PI_2, PI};
    let offset = Vector3::new(2.0, -1.0, 3.0);
    let one = postures(&[Vector3::zeros()], offset);
    let turns =
        [Vector3::zeros(), Vector3::x() * PI, Vector3::z() * PI, Vector3::x() * FRAC_PI_2, -Vector3::x() * FRAC_PI_2];
    let all = postures(&turns, offset);
    let error = |read: &Readings| {
        let found = local_field(&[(signals("one", read), &read.mag)], &FieldOptions::default()).expect("it rests");
        (found.norm_ut - FIELD_UT.norm()).abs()
    };
    assert!(error(&all) < 0.5 * error(&one), "{} and {}", error(&all), error(&one));
}

#[test]
fn a_unit_beside_iron_for_a_while_is_passed_over_and_counted() {
    let turns = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
    let mut read = postures(&turns, Vector3::zeros());
    read.mag[600..900].iter_mut().for_each(|m| m[1] += 30.0);
    read.mag[1000..1010].fill([f64::NAN; 3]);
    let found = local_field(&[(signals("one", &read), &read.mag)], &FieldOptions::default()).expect("it rests");
    assert!((found.norm_ut - FIELD_UT.norm()).abs() < 1e-9 && (found.dip_rad - dip()).abs() < 1e-9);
    assert!((0.08..0.17).contains(&found.departing_share), "{}", found.departing_share);
    assert_eq!(found.units[0].departing_share, found.departing_share);
}

#[test]
fn a_field_that_nothing_calm_saw_is_refused() {
    let [read, _] = Bodies::ball(3).read(10.0, NOISE, 1);
    let text = local_field(&[(signals("one", &read), &read.mag)], &FieldOptions::default())
        .expect_err("it never rests")
        .to_string();
    assert!(text.contains("calm for"), "{text}");
    let short = local_field(&[(signals("one", &read), &read.mag[..5])], &FieldOptions::default());
    assert!(short.expect_err("too short").to_string().contains("5 rows of the magnetometer"));
}
