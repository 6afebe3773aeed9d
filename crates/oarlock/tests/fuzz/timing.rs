//! Streams whose stamps are each in order and fit together badly: other rates, other starts, other epochs, near misses.

use super::campaign::campaign;
use super::models::answered;
use super::numbers::{index, one_in, pick};
use super::support::absurd::is_sound;
use super::support::chance::Chance;
use super::support::{model, CHAIN, SCULLER};
use oarlock::config::{Config, FilterKind};
use oarlock::model::{Model, SensorKind};
use oarlock::recording::{Channel, Stream};
use oarlock::sensor::Quantity;
use oarlock::track::run::track;
use oarlock::track::Calibration;
use std::fmt::Write;

const RATES_HZ: [f64; 6] = [0.3, 10.0, 100.0, 125.0, 1e3, 3e4];
const EPOCHS_S: [f64; 5] = [0.0, -1e3, 1e5, 1.7e9, 9e15];

/// How much later than the others a stream begins: none, about one merging, a silence, another day.
fn lateness(chance: &mut Chance, merge_s: f64) -> f64 {
    *pick(chance, &[0.0, 1e-12, 0.5 * merge_s, merge_s, 1.000_000_1 * merge_s, 0.03, 2.0, -2.0, 70.0, 86_400.0])
}

fn stamps(chance: &mut Chance, epoch_s: f64, merge_s: f64, rows: usize) -> Vec<f64> {
    let step_s = 1.0 / pick(chance, &RATES_HZ);
    let jitter = *pick(chance, &[0.0, 0.3, 0.999]);
    let bursts = one_in(chance, 5);
    let gap = one_in(chance, 4).then(|| index(chance, rows));
    let mut clock = epoch_s + lateness(chance, merge_s);
    let mut times = Vec::with_capacity(rows);
    for k in 0..rows {
        let scale = if bursts && k % 8 != 0 { 1e-4 } else { 1.0 };
        clock += scale * step_s * (1.0 - jitter * chance.uniform());
        if gap == Some(k) {
            clock += *pick(chance, &[0.5, 1.5, 40.0, 4e3]);
        }
        // Where a double cannot tell two stamps apart the next one follows.
        clock = times.last().map_or(clock, |&last: &f64| clock.max(last.next_up()));
        times.push(clock);
    }
    times
}

fn stream(chance: &mut Chance, name: &str, quantities: &[Quantity], time_s: &[f64]) -> Stream {
    let missing = *pick(chance, &[2, 20, 1_000_000]);
    let level = |quantity| match quantity {
        Quantity::Accel => [0.0, 9.81, 0.0],
        Quantity::Mag => [20.0, -40.0, 0.0],
        _ => [0.0; 3],
    };
    let channel = |&quantity: &Quantity| {
        let width = if quantity == Quantity::Joint { 1 } else { 3 };
        let number = |k: usize| {
            if one_in(chance, missing) {
                f64::NAN
            } else {
                level(quantity)[k % width] + 0.1 * chance.normal()
            }
        };
        Channel { quantity, values: (0..time_s.len() * width).map(number).collect::<Vec<_>>().into() }
    };
    let channels = quantities
        .iter()
        .map({
            let mut channel = channel;
            move |q| channel(q)
        })
        .collect();
    Stream { name: name.into(), time_s: time_s.to_vec().into(), channels }
}

fn streams(chance: &mut Chance, model: &Model, merge_s: f64) -> Vec<Stream> {
    let epoch_s = *pick(chance, &EPOCHS_S);
    let mut found: Vec<Stream> = Vec::new();
    for sensor in &model.sensors {
        let quantities: &[Quantity] = match sensor.kind {
            SensorKind::Imu { .. } => &[Quantity::Gyro, Quantity::Accel, Quantity::Mag],
            SensorKind::Encoder { .. } => &[Quantity::Joint],
            SensorKind::Position { .. } => &[Quantity::Position],
            SensorKind::Range { .. } => &[Quantity::Range],
            SensorKind::Orientation { .. } => &[Quantity::Orientation],
        };
        let rows = *pick(chance, &[1, 2, 15, 40]);
        // Now and then in another epoch altogether.
        let own_s = if one_in(chance, 25) { *pick(chance, &EPOCHS_S) } else { epoch_s };
        let times = match found.last() {
            Some(last) if one_in(chance, 3) => {
                let shift = lateness(chance, merge_s);
                let mut times: Vec<f64> = last.time_s.iter().map(|t| t + shift).collect();
                times.dedup();
                times
            }
            _ => stamps(chance, own_s, merge_s, rows),
        };
        if !one_in(chance, 8) {
            found.push(stream(chance, &sensor.name, quantities, &times));
        }
    }
    found
}

#[test]
fn clocks_that_fit_badly_are_answered() {
    let bodies = [model(CHAIN), model(CHAIN), model(SCULLER)];
    campaign("timing", 4, |chance, fed| {
        let model = pick(chance, &bodies).clone();
        let config = Config {
            merge_s: *pick(chance, &[0.0005, 0.0005, 1e-9, 0.02]),
            output_rate_hz: one_in(chance, 3).then(|| *pick(chance, &[1.0, 100.0, 1e4])),
            filter: *pick(chance, &[FilterKind::Ukf, FilterKind::Ukf, FilterKind::Ekf, FilterKind::Factorised]),
            belief_interval_s: *pick(chance, &[0.01, 5.0]),
            ..Config::default()
        };
        let streams = streams(chance, &model, config.merge_s);
        write!(fed, "{} {config:?}\n{streams:?}", model.name).unwrap();
        let run = track(model, streams, &Calibration::default(), &config, None, &mut |_| true);
        let Some(run) = answered(run) else { return };
        assert!(run.last().is_none_or(|one| is_sound(&one.belief)));
        assert!(run.series.time_s.windows(2).all(|pair| pair[0] < pair[1]), "{:?}", run.series.time_s);
        assert!(run.series.mean.iter().all(|x| x.is_finite()));
        if let Some(smooth) = answered(run.smooth(&mut |_| true)) {
            assert!(smooth.series.mean.iter().all(|x| x.is_finite()));
        }
    });
}
