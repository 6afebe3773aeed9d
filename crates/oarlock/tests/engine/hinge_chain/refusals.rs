//! Recordings that cannot give mounts, and what is said about them.

use super::signals::{Noise, Readings, White, GRAVITY, UP};
use super::{all_readings, pendulum, sensors};
use oarlock::calibrate::chain_sensor::{ChainOptions, ChainSensor};
use oarlock::calibrate::hinge_chain::mounts;
use oarlock::calibrate::lever_arms::{lever_arms, LeverOptions};
use oarlock::calibrate::magnetic::{magnetic_field, MagneticOptions};
use oarlock::Error;

const NOISE: Noise = Noise { gyro: 0.002, accel: 0.02, mag: 0.3 };

/// The text with which a chain is refused after `spoil`.
fn refusal(spoil: impl FnOnce(&mut Vec<Readings>, &mut Vec<super::Hinge>)) -> String {
    let mut chain = pendulum(&mut White::new(4), 0.0);
    let mut data = all_readings(&chain, NOISE, 4);
    spoil(&mut data, &mut chain);
    text_of(mounts(&sensors(&chain, &data), UP.into(), &ChainOptions::default()))
}

fn text_of<T: std::fmt::Debug>(result: oarlock::Result<T>) -> String {
    match result {
        Err(Error::Data(text)) => text,
        other => panic!("expected an error of the data, got {other:?}"),
    }
}

fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}

#[test]
fn no_still_stretch() {
    let text = refusal(|data, _| {
        for (k, row) in data[1].gyro.iter_mut().enumerate() {
            row[0] += 0.5 * (k as f64).sin();
        }
    });
    assert_says(&text, &["`middle`", "no still stretch of 0.5 s", "rad/s", "Hold the body still"]);
}

#[test]
fn never_still_together() {
    let text = refusal(|data, _| {
        for (index, part) in [(0, 0..150), (1, 100..350)] {
            for k in part {
                data[index].gyro[k][0] += 0.5 * (k as f64).sin();
            }
        }
    });
    assert_says(&text, &["upper, middle, lower", "never all at once"]);
}

#[test]
fn no_swing() {
    let text = refusal(|data, chain| {
        chain[2].angle = |_| 0.0;
        let rest = data[2].gyro[..256].to_vec();
        for (k, row) in data[2].gyro.iter_mut().enumerate() {
            *row = rest[k % rest.len()];
        }
    });
    assert_says(&text, &["`lower`", "turns by", "deg only", "at least 11.5 deg"]);
}

#[test]
fn turning_about_two_axes() {
    let text = refusal(|data, chain| {
        let square = chain[1].link_from_sensor.inverse() * nalgebra::Vector3::x();
        for (k, row) in data[1].gyro.iter_mut().enumerate().skip(300) {
            let extra = square * (0.05 * k as f64).sin();
            row.iter_mut().zip(&extra).for_each(|(x, e)| *x += e);
        }
    });
    assert_says(&text, &["`middle`", "% of the gyroscope's energy", "off one axis", "5.0 %"]);
}

#[test]
fn accelerometer_in_g() {
    let text = refusal(|data, _| {
        data[0].accel.iter_mut().flatten().for_each(|x| *x /= GRAVITY);
    });
    assert_says(&text, &["`upper`", "m/s2, expected 9.0 to 10.6", "in g: multiply by 9.80665"]);
}

#[test]
fn neighbours_unrelated() {
    let text = refusal(|data, chain| {
        let axis = chain[2].link_from_sensor.inverse() * chain[2].axis;
        for (t, row) in data[2].time_s.clone().iter().zip(&mut data[2].gyro) {
            let rate = if *t > 2.0 { 2.0 * (9.0 * t).sin() } else { 0.0 };
            *row = (axis * rate).into();
        }
    });
    assert_says(&text, &["`middle` and `lower`", "correlates by", "at least 0.3", "swing as one"]);
}

#[test]
fn vertical_hinge_and_contradicting_posture() {
    let chain = pendulum(&mut White::new(4), 0.0);
    let data = all_readings(&chain, NOISE, 4);
    let options = ChainOptions::default();
    let with_axis = |axis: [f64; 3]| {
        let stated: Vec<ChainSensor> =
            sensors(&chain, &data).into_iter().map(|s| ChainSensor { hinge_axis_in_world: axis, ..s }).collect();
        text_of(mounts(&stated, UP.into(), &options))
    };
    assert_says(&with_axis([0.0, 2.0, 0.1]), &["`upper`", "from vertical by the model"]);
    let slanted = with_axis([0.0, 1.0, 1.0]);
    assert_says(&slanted, &["enclose 90.", "by the sensor and 45.0 deg by the model", "posture"]);
    assert_says(&with_axis([0.0; 3]), &["`upper`", "no direction"]);
}

#[test]
fn columns_and_clocks() {
    let short = refusal(|data, _| data[2].accel.truncate(1000));
    assert_says(&short, &["`lower`", "1024 time stamps", "1000 of the accelerometer"]);
    let back = refusal(|data, _| data[0].time_s[500] = 1.0);
    assert_says(&back, &["`upper`", "does not increase", "to 1 s (row 500)"]);
    let gaps = refusal(|data, _| data[0].gyro.iter_mut().for_each(|row| row[1] = f64::NAN));
    assert_says(&gaps, &["`upper`", "no still stretch", "without gaps"]);
}

#[test]
fn lever_arms_and_magnetometers() {
    let chain = pendulum(&mut White::new(4), 0.0);
    let mut data = all_readings(&chain, NOISE, 4);
    data[1].mag.iter_mut().for_each(|row| *row = [0.0; 3]);
    let mut sensors = sensors(&chain, &data);
    let mounts = mounts(&sensors, UP.into(), &ChainOptions::default()).expect("good data");
    let too_few = lever_arms(&sensors, &mounts[..2], UP.into(), &LeverOptions::default(), &mut || true);
    assert_says(&text_of(too_few), &["3 sensors and 2 mounts"]);
    let columns: Vec<&[[f64; 3]]> = data.iter().map(|r| r.mag.as_slice()).collect();
    let zero = magnetic_field(&sensors, &columns, &mounts, &MagneticOptions::default(), &mut || true);
    assert_says(&text_of(zero), &["`middle`", "reads zero throughout"]);
    let stopped = lever_arms(&sensors, &mounts, UP.into(), &LeverOptions::default(), &mut || false);
    assert_eq!(stopped, Err(Error::Stopped));
    let later: Vec<f64> = data[2].time_s.iter().map(|t| t + 100.0).collect();
    sensors[2].time_s = &later;
    let apart = lever_arms(&sensors, &mounts, UP.into(), &LeverOptions::default(), &mut || true);
    assert_says(&text_of(apart), &["sensors share", "on one clock"]);
}
