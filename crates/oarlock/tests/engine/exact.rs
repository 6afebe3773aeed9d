//! What must not depend on how a recording is worked off: live or whole, cut or uncut, once or twice.

use crate::support;

use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};
use oarlock::model::Model;
use oarlock::recording::{Sample, Stream};
use oarlock::track::hypothesis::Hypothesis;
use oarlock::track::run::{track, Run};
use oarlock::track::{Calibration, Status};
use std::sync::Arc;
use support::chance::Chance;
use support::record::{punch_holes, rowed, streams, times};
use support::{bits, body, model, settled, tracker, SCULLER};

struct Case {
    model: Arc<Model>,
    body: Body,
    config: Config,
    samples: Vec<Sample>,
}

/// Three seconds of a sculler with holes, everything estimated, learnt and gated as by default.
fn case(filter: FilterKind) -> Case {
    let config = Config { filter, ..settled() };
    let model = model(SCULLER);
    let body = body(&model, &config);
    let mut chance = Chance::new(11);
    let mut samples = rowed(&body, &times(5.0, 0.01, 300), &mut chance);
    punch_holes(&body, &mut samples[30..], &mut chance);
    // A jolt that the gate refuses, and a magnet.
    samples[100].z[..3].fill(80.0);
    samples[150].z[6..9].fill(70.0);
    Case { model, body, config, samples }
}

fn whole(case: &Case, streams: Vec<Stream>, start: Option<Hypothesis>) -> Run {
    let nominal = Calibration::default();
    track(case.model.clone(), streams, &nominal, &case.config, start, &mut |_| true).unwrap()
}

/// Filters with room of different kinds.
const FILTERS: [FilterKind; 2] = [FilterKind::Ukf, FilterKind::Factorised];

#[test]
fn live_is_whole_bit_for_bit() {
    FILTERS.map(case).iter().for_each(assert_live_is_whole);
}

fn assert_live_is_whole(case: &Case) {
    let run = whole(case, streams(&case.body, &case.samples), None);
    let mut tracker = tracker(&case.model, &case.config);
    let (mut times, mut mean, mut std) = (Vec::new(), Vec::new(), Vec::new());
    let mut nis = Vec::new();
    for sample in &case.samples {
        let mut keep = |s: &Sample, b: &Hypothesis, i: &oarlock::estimate::filter::Info| {
            times.push(s.time_s);
            mean.extend_from_slice(&b.belief.mean);
            std.extend(b.own_spread());
            nis.extend(i.sources.iter().map(|s| s.nis));
        };
        assert_ne!(tracker.step_with(sample, &mut keep).unwrap(), Status::OutOfOrder);
    }
    assert_eq!(run.series.time_s, times);
    assert_eq!(bits(&run.series.mean), bits(&mean));
    assert_eq!(bits(&run.series.std), bits(&std));
    let kept: Vec<f64> = run.series.nis.to_vec();
    assert_eq!(bits(&kept), bits(&nis));
    let rejected: u32 = run.series.reports.iter().map(|s| u32::from(s.rejected)).sum();
    assert!(rejected >= 6, "the faults were meant to be refused: {rejected}");
}

#[test]
fn cut_is_uncut_bit_for_bit() {
    FILTERS.map(case).iter().for_each(assert_cut_is_uncut);
}

fn assert_cut_is_uncut(case: &Case) {
    let uncut = whole(case, streams(&case.body, &case.samples), None);
    // Once inside and once behind what the gate refuses.
    for cut in [101, 170] {
        let first = whole(case, streams(&case.body, &case.samples[..cut]), None);
        let last = first.last().unwrap().clone();
        let second = whole(case, streams(&case.body, &case.samples[cut..]), Some(last));
        let both = |f: fn(&Run) -> &Vec<f64>| bits(&[f(&first).as_slice(), f(&second)].concat());
        assert_eq!(bits(&uncut.series.mean), both(|r| &r.series.mean));
        assert_eq!(bits(&uncut.series.std), both(|r| &r.series.std));
        // Compared as text, where a missing time equals another.
        let ends = [&uncut, &second].map(|r| format!("{:?}", r.last()));
        assert_eq!(ends[0], ends[1]);
    }
}

#[test]
fn twice_is_the_same_bit_for_bit() {
    let case = case(FilterKind::Ukf);
    let [a, b] = [0, 1].map(|_| {
        let run = whole(&case, streams(&case.body, &case.samples), None);
        run.smooth(&mut |_| true).unwrap()
    });
    assert_eq!(bits(&a.series.mean), bits(&b.series.mean));
    assert_eq!(bits(&a.series.std), bits(&b.series.std));
}

/// Filtering again between kept beliefs is the same arithmetic, so smoothing cannot depend on how many were kept.
#[test]
fn smoothing_does_not_depend_on_the_beliefs_kept() {
    let mut case = case(FilterKind::Ukf);
    let smoothed = |case: &Case| {
        let run = whole(case, streams(&case.body, &case.samples), None);
        let smooth = run.smooth(&mut |_| true).unwrap();
        (run, smooth)
    };
    case.config.belief_interval_s = 100.0;
    let (filtered, once) = smoothed(&case);
    assert_eq!(once.beliefs().count(), 1);
    for interval in [0.02, 0.37] {
        case.config.belief_interval_s = interval;
        let (_, again) = smoothed(&case);
        assert!(again.beliefs().count() > 5);
        assert_eq!(bits(&once.series.mean), bits(&again.series.mean), "every {interval} s");
        assert_eq!(bits(&once.series.std), bits(&again.series.std), "every {interval} s");
    }
    let n = case.body.layout.dim();
    let rows = once.series.time_s.len();
    assert_eq!(rows, 300);
    let end = |run: &Run| bits(&run.series.mean[(rows - 1) * n..]);
    assert_eq!(end(&once), end(&filtered), "the last is unchanged by smoothing");
    let narrower = |r: usize| {
        let row = r * n..(r + 1) * n;
        let pairs = once.series.std[row.clone()].iter().zip(&filtered.series.std[row]);
        pairs.filter(|(s, f)| *s <= &(*f * (1.0 + 1e-9))).count()
    };
    assert!((0..rows).all(|r| narrower(r) == n), "smoothing widens no band of noise");
}

#[test]
fn fewer_rows_are_the_same_rows() {
    let mut case = case(FilterKind::Ukf);
    let all = whole(&case, streams(&case.body, &case.samples), None).smooth(&mut |_| true).unwrap();
    case.config.output_rate_hz = Some(20.0);
    let some = whole(&case, streams(&case.body, &case.samples), None).smooth(&mut |_| true).unwrap();
    let n = case.body.layout.dim();
    assert!((55..=61).contains(&some.series.time_s.len()));
    for (k, t) in some.series.time_s.iter().enumerate() {
        let at = all.series.time_s.iter().position(|x| x == t).expect("a sample's time");
        let row = |run: &Run, k: usize| bits(&run.series.mean[k * n..(k + 1) * n]);
        assert_eq!(row(&some, k), row(&all, at));
    }
}
