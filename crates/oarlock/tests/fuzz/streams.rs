//! Readings and stamps of any kind, as samples and as recordings.

use super::campaign::campaign;
use super::models::{answered, TEXTS};
use super::numbers::{index, odd, one_in, pick};
use super::settings::config;
use super::support::absurd::is_sound;
use super::support::chance::Chance;
use super::support::model;
use oarlock::config::Config;
use oarlock::model::SensorKind;
use oarlock::recording::{Channel, Sample, Stream};
use oarlock::sensor::Quantity;
use oarlock::track::run::track;
use oarlock::track::{Calibration, Status, Tracker};
use oarlock::Error;
use std::fmt::Write;

/// How odd a recording is: most are nearly right, for those come far.
#[derive(Clone, Copy)]
struct Wildness {
    value: usize,
    missing: usize,
    stamp: usize,
}

impl Wildness {
    fn any(chance: &mut Chance) -> Self {
        let mut share = || [3, 30, 400, 1_000_000][index(chance, 4)];
        Wildness { value: share(), missing: share(), stamp: share() }
    }

    fn value(self, chance: &mut Chance) -> f64 {
        if one_in(chance, self.missing) {
            f64::NAN
        } else if one_in(chance, self.value) {
            odd(chance)
        } else {
            chance.normal()
        }
    }

    fn step(self, chance: &mut Chance) -> f64 {
        match one_in(chance, self.stamp) {
            true => [0.0, -0.5, 30.0, 1e5, odd(chance)][index(chance, 5)],
            false => chance.between(1e-4, 0.05),
        }
    }
}

/// Samples of a body that moves at random, with wounds.
pub fn samples(chance: &mut Chance, tracker: &Tracker, count: usize) -> Vec<Sample> {
    let wild = Wildness::any(chance);
    let empty = tracker.empty_sample();
    let mut clock = 0.0;
    let mut one = || {
        let time_s: f64 = clock + wild.step(chance);
        clock = if time_s.is_finite() { time_s } else { clock };
        let mut sample = Sample { time_s, ..empty.clone() };
        sample.z.iter_mut().for_each(|z| *z = wild.value(chance));
        sample.inputs.iter_mut().for_each(|x| *x = wild.value(chance));
        sample
    };
    (0..count).map(|_| one()).collect()
}

/// Steps through; whatever was taken in left a belief.
pub fn step_through(tracker: &mut Tracker, samples: &[Sample]) {
    for sample in samples {
        match tracker.step(sample) {
            Ok(Status::Tracking) => assert!(is_sound(tracker.belief().expect("a belief")), "{:?}", tracker.belief()),
            Ok(Status::Starting | Status::OutOfOrder) => {}
            Err(Error::Diverged { text, .. } | Error::Data(text)) => assert!(text.len() > 20, "{text}"),
            Err(other) => panic!("{other}"),
        }
    }
    if let Err(error) = tracker.finish(&mut |_, one, _| assert!(is_sound(&one.belief), "{:?}", one.belief)) {
        assert!(matches!(error, Error::Diverged { .. } | Error::Data(_)), "{error}");
    }
}

#[test]
fn samples_are_answered() {
    let bodies = TEXTS.map(model);
    campaign("samples", 12, |chance, fed| {
        let model = pick(chance, &bodies).clone();
        let config = if one_in(chance, 2) { Config::default() } else { config(chance, model.coordinate_count()) };
        let Some(mut tracker) = answered(Tracker::new(model.clone(), &Calibration::default(), &config)) else { return };
        let samples = samples(chance, &tracker, 25);
        write!(fed, "{} {config:?}\n{samples:?}", model.name).unwrap();
        step_through(&mut tracker, &samples);
    });
}

fn stream(chance: &mut Chance, name: &str, quantities: &[Quantity], rows: usize, wild: Wildness) -> Stream {
    let mut clock = 0.0;
    let time_s: Vec<f64> = (0..rows)
        .map(|_| {
            clock += wild.step(chance);
            clock
        })
        .collect();
    let mut channel = |&quantity: &Quantity| {
        let width = if quantity == Quantity::Joint { 1 } else { 3 };
        let count = if one_in(chance, 60) { index(chance, 50) } else { rows * width };
        let values: Vec<f64> = (0..count).map(|_| wild.value(chance)).collect();
        Channel { quantity, values: values.into() }
    };
    let channels = quantities.iter().map(&mut channel).collect();
    Stream { name: name.into(), time_s: time_s.into(), channels }
}

#[test]
fn recordings_are_answered() {
    let bodies = TEXTS.map(model);
    campaign("recordings", 12, |chance, fed| {
        let model = pick(chance, &bodies).clone();
        let config = if one_in(chance, 2) { Config::default() } else { config(chance, model.coordinate_count()) };
        let (wild, rows) = (Wildness::any(chance), index(chance, 40));
        let mut streams = Vec::new();
        for sensor in &model.sensors {
            let quantities: &[Quantity] = match sensor.kind {
                SensorKind::Imu { .. } => &[Quantity::Gyro, Quantity::Accel, Quantity::Mag],
                SensorKind::Encoder { .. } => &[Quantity::Joint],
                SensorKind::Position { .. } => &[Quantity::Position],
                SensorKind::Range { .. } => &[Quantity::Range],
                SensorKind::Orientation { .. } => &[Quantity::Orientation],
            };
            let kept = &quantities[..1 + index(chance, quantities.len())];
            if !one_in(chance, 6) {
                streams.push(stream(chance, &sensor.name, kept, rows, wild));
            }
        }
        write!(fed, "{} {config:?}\n{streams:?}", model.name).unwrap();
        let run = track(model, streams, &Calibration::default(), &config, None, &mut |_| true);
        let Some(run) = answered(run) else { return };
        assert!(run.last().is_none_or(|one| is_sound(&one.belief)));
        assert!(run.series.mean.iter().all(|x| x.is_finite()));
        if let Some(smooth) = answered(run.smooth(&mut |_| true)) {
            assert!(smooth.series.mean.iter().all(|x| x.is_finite()));
        }
    });
}
