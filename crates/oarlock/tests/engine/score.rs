//! What innovations say of parameters that the filter takes as given, against parameters that are known to be wrong.

use crate::support;

use nalgebra::{DMatrix, DVector};
use oarlock::config::FilterKind;
use oarlock::recording::Stream;
use oarlock::track::score::{score, Score};
use oarlock::track::Calibration;
use oarlock::{Config, Error};
use std::collections::BTreeMap;
use support::chance::Chance;
use support::record::{rowed, streams, times};
use support::{body, lively_sculler, model};

const LATE_S: f64 = 0.004;
/// Here everything moves with one number, the same in each stroke, and nothing like driving noise: what back and an arm have in common
/// shows least, and is bent by up to 1.1 ms.
const DELAY_TOLERANCE_S: f64 = 1.2e-3;

fn stroke() -> Vec<Stream> {
    let body = body(&model(&lively_sculler()), &Config::default());
    streams(&body, &rowed(&body, &times(0.0, 0.008, 1500), &mut Chance::new(5)))
}

fn first(stream: &Stream) -> f64 {
    stream.time_s.iter().next().unwrap()
}

fn scored(streams: Vec<Stream>, known: &Calibration) -> Score {
    // Encoders of one logger are read together, so they stay inputs at their instants.
    let inputs = Some(model(&lively_sculler()).joints.iter().filter(|j| j.input).map(|j| j.name.clone()).collect());
    let sampling = Config { sample_rate_hz: Some(0.0), inputs, ..Config::default() };
    let config = Config { filter: FilterKind::Ekf, merge_s: 1e-5, ..sampling };
    score(model(&lively_sculler()), streams, known, &config, (2.0, 5.0), &mut |_| true).unwrap()
}

/// Parameters with their standard deviations, in the model's.
fn solved(score: &Score) -> BTreeMap<String, (f64, f64)> {
    let n = score.width;
    let sum = |f: &dyn Fn(&oarlock::track::score::Window) -> &Vec<f64>| {
        score.windows.iter().fold(vec![0.0; f(&score.windows[0]).len()], |mut all, w| {
            all.iter_mut().zip(f(w)).for_each(|(a, x)| *a += x);
            all
        })
    };
    let normal = DMatrix::from_row_slice(n, n, &sum(&|w| &w.normal)) + DMatrix::identity(n, n);
    let right = DVector::from_vec(sum(&|w| &w.right));
    let spread = normal.try_inverse().unwrap();
    let found = &spread * right;
    let named = score.parameters.iter().enumerate();
    named.map(|(k, (name, _))| (name.clone(), (found[k], spread[(k, k)].sqrt()))).collect()
}

fn moved(streams: &[Stream], name: &str, by_s: f64) -> Vec<Stream> {
    let mut streams = streams.to_vec();
    let stream = streams.iter_mut().find(|s| s.name == name).unwrap();
    stream.time_s = stream.time_s.iter().map(|t| t + by_s).collect::<Vec<f64>>().into();
    streams
}

#[test]
fn late_clocks_are_found_in_a_few_steps() {
    let mut streams = moved(&moved(&stroke(), "l_forearm", LATE_S), "back", -LATE_S);
    for _ in 0..4 {
        let score = scored(streams.clone(), &Calibration::default());
        let found = solved(&score);
        for (name, unit) in score.parameters.iter().filter(|(name, _)| name.ends_with(".delay") && name != "seat.delay")
        {
            streams = moved(&streams, name.trim_end_matches(".delay"), -found[name].0 * unit);
        }
    }
    for (stream, true_stream) in streams.iter().zip(&stroke()) {
        let away = first(stream) - first(true_stream);
        assert!(away.abs() < DELAY_TOLERANCE_S, "{}: {away} s", stream.name);
    }
}

#[test]
fn a_wrong_length_shows_where_it_is() {
    let model = model(&lively_sculler());
    let length = model.parameters.iter().find(|p| p.name == "l_ua_r").unwrap();
    let given = length.default + 0.5 * length.std.unwrap();
    let known = Calibration { parameters: [("l_ua_r".into(), given)].into(), ..Calibration::default() };
    let (right, wrong) = (scored(stroke(), &Calibration::default()), scored(stroke(), &known));
    let (right, wrong) = (solved(&right), solved(&wrong));
    let step = wrong["parameters.l_ua_r"].0 - right["parameters.l_ua_r"].0;
    let std = wrong["parameters.l_ua_r"].1;
    assert!((step + 0.5).abs() < 3.0 * std && std < 0.1, "{step} +- {std}");
    let mount = wrong["r_upperarm.mount_rx"];
    assert!(mount.0.abs() < 0.1 && mount.1 < 0.1, "{mount:?}");
}

#[test]
fn windows_are_symmetric_and_lose_no_sign() {
    let score = scored(stroke(), &Calibration::default());
    assert_eq!(score.windows.len(), 2);
    let (first, last) = (&score.windows[0], &score.windows[1]);
    assert!(first.span_s.0 >= 2.0 && first.span_s.1 < last.span_s.0 && first.rows > last.rows / 2);
    for window in &score.windows {
        let normal = DMatrix::from_row_slice(score.width, score.width, &window.normal);
        let size = normal.amax();
        assert!((&normal - normal.transpose()).amax() < 1e-9 * size);
        assert!(normal.symmetric_eigenvalues().min() > -1e-9 * size);
    }
}

#[test]
fn what_cannot_be_scored_is_refused() {
    let empty = score(
        model(&lively_sculler()),
        Vec::new(),
        &Calibration::default(),
        &Config::default(),
        (2.0, 5.0),
        &mut |_| true,
    );
    assert!(matches!(&empty, Err(Error::Data(text)) if text.contains("no row")), "{:?}", empty.err());
    let stopped =
        score(model(&lively_sculler()), stroke(), &Calibration::default(), &Config::default(), (2.0, 5.0), &mut |_| {
            false
        });
    assert_eq!(stopped.err(), Some(Error::Stopped));
}
