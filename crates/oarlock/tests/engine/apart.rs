//! Sensors that do not tick together: samples at regular times, rows at a clean rate, readings that arrive late and unordered.

use crate::support;

use oarlock::recording::feed::Place;
use oarlock::recording::{input_joint, Gathering, Recording, Sample, Stream};
use oarlock::track::arrivals::{Arrivals, Counts};
use oarlock::track::run::{track, Run};
use oarlock::track::{Calibration, Tracker};
use oarlock::Config;
use support::chance::Chance;
use support::record::{rowed, streams, times};
use support::{body, model, SCULLER};

/// Rates of the sensors, Hz, and the standard deviation of their time stamps, s.
const RATES_HZ: [(&str, f64); 10] = [
    ("back", 100.0),
    ("r_upperarm", 120.0),
    ("r_forearm", 60.0),
    ("l_upperarm", 150.0),
    ("l_forearm", 100.0),
    ("seat", 50.0),
    ("r_oar_phi", 20.0),
    ("r_oar_alpha", 20.0),
    ("l_oar_phi", 97.3),
    ("l_oar_alpha", 97.3),
];
const JITTER_S: f64 = 0.5e-3;

/// Each sensor at a rate of its own, with jitter and lost readings.
fn apart(seconds: f64) -> Vec<Stream> {
    let body = body(&model(SCULLER), &Config::default());
    let mut chance = Chance::new(8);
    let one = |(name, rate_hz): (&str, f64)| {
        let regular = times(1.0 + 0.1 / rate_hz, 1.0 / rate_hz, (seconds * rate_hz) as usize);
        let samples = rowed(&body, &regular, &mut chance);
        let mut stream = streams(&body, &samples).into_iter().find(|s| s.name == name).unwrap();
        let jittered = regular.iter().map(|t| t + JITTER_S * chance.normal().clamp(-3.0, 3.0));
        stream.time_s = jittered.collect::<Vec<f64>>().into();
        stream
    };
    RATES_HZ.into_iter().map(one).collect()
}

fn tracked(streams: Vec<Stream>, config: &Config) -> Run {
    track(model(SCULLER), streams, &Calibration::default(), config, None, &mut |_| true).unwrap()
}

#[test]
fn sensors_that_tick_together_are_read_at_their_instants_and_their_encoders_stay_inputs() {
    let body = body(&model(SCULLER), &Config::default());
    let together = streams(&body, &rowed(&body, &times(0.0, 0.008, 200), &mut Chance::new(3)));
    let run = tracked(together.clone(), &Config::default());
    assert_eq!(run.config().sample_rate_hz, Some(0.0));
    let inputs = run.config().inputs.clone().unwrap();
    // Feathering has no encoder and nothing depends on it.
    assert_eq!(inputs, ["r_oar_phi", "r_oar_alpha", "r_oar_theta", "l_oar_phi", "l_oar_alpha", "l_oar_theta"]);
    let lost: Vec<Stream> = together.into_iter().filter(|s| s.name != "l_oar_alpha").collect();
    let inputs = tracked(lost, &Config::default()).config().inputs.clone().unwrap();
    assert!(!inputs.contains(&"l_oar_alpha".to_string()), "the closure depends on it: {inputs:?}");
}

#[test]
fn rows_of_sensors_apart_come_at_a_clean_rate_with_every_joint() {
    let run = tracked(apart(2.0), &Config::default());
    assert_eq!(run.config().output_rate_hz, Some(150.0));
    let ticks = run.series.time_s.iter().map(|t| t * 150.0);
    assert!(ticks.clone().all(|k| (k - k.round()).abs() < 1e-9));
    let steps: Vec<f64> = run.series.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    assert!(steps.iter().all(|dt| (dt - 1.0 / 150.0).abs() < 1e-9), "a row is missing");
    assert!(run.series.mean.iter().chain(&run.series.std).chain(run.series.inputs.iter()).all(|x| x.is_finite()));
    let slow = tracked(apart(2.0), &Config { output_rate_hz: Some(40.0), ..Config::default() });
    assert_eq!((slow.config().output_rate_hz, slow.config().sample_rate_hz), (Some(40.0), Some(160.0)));
    assert!(slow.series.time_s.iter().all(|t| (t * 40.0 - (t * 40.0).round()).abs() < 1e-9));
}

#[test]
fn no_reading_is_lost_in_gathering() {
    let streams = apart(2.0);
    let config = tracked(streams.clone(), &Config::default()).config().clone();
    let tracker = Tracker::new(model(SCULLER), &Calibration::default(), &config).unwrap();
    let body = tracker.body();
    let all =
        Recording::new(&body.model, &body.suite, streams.clone(), &Default::default(), Gathering::of(&config)).unwrap();
    let (mut cursor, mut sample, mut last_s) = (all.start(), tracker.empty_sample(), f64::NEG_INFINITY);
    let mut counts = vec![0; body.suite.sources.len()];
    while all.next(&mut cursor, &mut sample) {
        assert!(sample.time_s > last_s);
        last_s = sample.time_s;
        for (source, count) in body.suite.sources.iter().zip(&mut counts) {
            *count += usize::from(source.rows.clone().any(|r| !sample.z[r].is_nan()));
        }
        // Half a tick, or a whole one where a reading moved on to the slot between.
        assert!(sample.offset_s.iter().all(|s| s.abs() <= 1.0 / 150.0), "{:?}", sample.offset_s);
    }
    for (source, count) in body.suite.sources.iter().zip(counts) {
        let given = streams.iter().find(|s| s.name == source.name).map_or(0, |s| s.time_s.len());
        assert_eq!(count, given, "{}", source.name);
    }
}

/// A reading of one sensor with its time of arrival.
struct Arrival {
    at_s: f64,
    place: Place,
    reading: Sample,
}

/// All readings in the order in which they arrive, `delay_s` after they were taken.
fn arriving(tracker: &Tracker, streams: &[Stream], mut delay_s: impl FnMut() -> f64) -> Vec<Arrival> {
    let body = tracker.body();
    let mut all = Vec::new();
    for stream in streams {
        let alone = vec![stream.clone()];
        let one = Recording::new(
            &body.model,
            &body.suite,
            alone,
            &Default::default(),
            Gathering::Instants { merge_s: 1e-9, rows: None },
        )
        .unwrap();
        let place = match input_joint(&body.model, &stream.name) {
            Some(joint) => Place::Input(body.model.joints[joint].first),
            None => Place::Source(body.suite.sources.iter().position(|s| s.name == stream.name).unwrap()),
        };
        let (mut cursor, mut reading) = (one.start(), tracker.empty_sample());
        while one.next(&mut cursor, &mut reading) {
            all.push(Arrival { at_s: reading.time_s + delay_s(), place, reading: reading.clone() });
        }
    }
    all.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    all
}

/// Time and mean of an estimate.
type Estimate = (f64, Vec<f64>);

/// The estimates of a live run over arrivals, how these came, and the mean of the last state estimate.
fn live(mut tracker: Tracker, all: &[Arrival]) -> (Vec<Estimate>, Counts, Vec<f64>) {
    let (mut arrivals, mut given) = (Arrivals::new(&tracker), Vec::new());
    for Arrival { place, reading, .. } in all {
        let mut sink = |_: &_, one: &oarlock::track::hypothesis::Hypothesis, _: &_| {
            given.push((one.belief.time_s, one.belief.mean.clone()));
        };
        arrivals.take(&mut tracker, *place, reading, &mut sink).unwrap();
    }
    arrivals.finish(&mut tracker, &mut |_, one, _| given.push((one.belief.time_s, one.belief.mean.clone()))).unwrap();
    assert_eq!(arrivals.waiting(), 0);
    let last = tracker.belief().unwrap().mean.clone();
    (given, arrivals.counts(), last)
}

fn live_tracker(config: &Config) -> Tracker {
    Tracker::new(model(SCULLER), &Calibration::default(), config).unwrap()
}

#[test]
fn shuffled_delivery_gives_the_bits_of_the_recording() {
    for together in [false, true] {
        let body = body(&model(SCULLER), &Config::default());
        let stroke = || streams(&body, &rowed(&body, &times(0.0, 0.008, 300), &mut Chance::new(3)));
        let streams = if together { stroke() } else { apart(2.0) };
        let every = Config { output_rate_hz: Some(0.0), ..Config::default() };
        let run = tracked(streams.clone(), &every);
        let tracker = live_tracker(run.config());
        let mut chance = Chance::new(4);
        let all = arriving(&tracker, &streams, || 0.025 * chance.uniform());
        let (given, counts, _) = live(tracker, &all);
        assert_eq!(counts, Counts { received: all.len(), ..Counts::default() });
        let width = run.series.mean.len() / run.series.time_s.len();
        assert_eq!(given.len(), run.series.time_s.len());
        for (k, (time_s, mean)) in given.iter().enumerate() {
            assert_eq!(time_s.to_bits(), run.series.time_s[k].to_bits());
            let expected = &run.series.mean[k * width..(k + 1) * width];
            assert!(mean.iter().zip(expected).all(|(a, b)| a.to_bits() == b.to_bits()), "row {k}");
        }
    }
}

#[test]
fn late_readings_are_used_by_going_back_or_counted() {
    let streams = apart(2.0);
    let run = tracked(streams.clone(), &Config::default());
    let expected = run.last().unwrap().belief.mean.clone();
    for (late_s, is_used) in [(0.2, true), (0.8, false)] {
        let tracker = live_tracker(run.config());
        let mut count = 0;
        // Not within the start window, which is fitted once, and not at the end, where nothing comes after them.
        let all = arriving(&tracker, &streams, || {
            count += 1;
            if count % 100 == 50 {
                late_s
            } else {
                0.0
            }
        });
        let late = all.iter().filter(|a| a.at_s > a.reading.time_s);
        let in_time = |a: &&Arrival| a.reading.time_s > 1.3 && a.reading.time_s + late_s < 2.9;
        let sure = late.clone().filter(in_time).count();
        let (_, counts, last) = live(tracker, &all);
        assert_eq!(counts.received, all.len());
        if is_used {
            assert!(counts.late >= sure && sure > 5, "{counts:?}, {sure} for sure");
            if counts.too_late == 0 {
                assert!(last.iter().zip(&expected).all(|(a, b)| a.to_bits() == b.to_bits()));
            }
        } else {
            assert!(counts.too_late >= sure && sure > 3, "{counts:?}, {sure} for sure");
        }
    }
}

#[test]
fn a_repeated_reading_is_counted() {
    let streams = apart(0.5);
    let run = tracked(streams.clone(), &Config::default());
    let mut tracker = live_tracker(run.config());
    let all = arriving(&tracker, &streams, || 0.0);
    let mut arrivals = Arrivals::new(&tracker);
    for _ in 0..2 {
        arrivals.take(&mut tracker, all[0].place, &all[0].reading, &mut |_, _, _| {}).unwrap();
    }
    assert_eq!(arrivals.counts(), Counts { received: 2, repeated: 1, ..Counts::default() });
}
