//! Recordings side by side: the same bits as alone on any number of threads, in order, each with its own fate.

use crate::support;

use oarlock::body::Body;
use oarlock::recording::Stream;
use oarlock::track::many::{track_many, Job};
use oarlock::track::run::{track, Run};
use oarlock::track::Calibration;
use oarlock::{Config, Error, Model};
use std::sync::Arc;
use support::chance::Chance;
use support::record::{punch_holes, rowed, streams, times};
use support::{body, model, SCULLER};

/// Of other lengths, so that workers finish in another order than they began.
const SAMPLES: [usize; 5] = [260, 90, 200, 60, 130];

fn recording(body: &Body, seed: u64, count: usize) -> Vec<Stream> {
    let mut chance = Chance::new(seed);
    let mut samples = rowed(body, &times(5.0, 0.01, count), &mut chance);
    punch_holes(body, &mut samples[30..], &mut chance);
    streams(body, &samples)
}

fn job(model: &Arc<Model>, streams: Vec<Stream>, smooth: bool) -> Job {
    Job { model: model.clone(), streams, calibration: Calibration::default(), config: Config::default(), smooth }
}

/// Every other one is smoothed, one has a length and a tuning of its own.
fn jobs() -> Vec<Job> {
    let model = model(SCULLER);
    let body = body(&model, &Config::default());
    let made = SAMPLES.iter().zip(1..);
    let mut jobs: Vec<Job> =
        made.map(|(&count, seed)| job(&model, recording(&body, seed, count), seed % 2 == 0)).collect();
    jobs[2].calibration.parameters.insert("l_ua_r".into(), 0.29);
    jobs[2].config.estimate = vec!["surge".into()];
    jobs
}

fn alone(job: &Job) -> Run {
    let Job { model, streams, calibration, config, smooth } = job.clone();
    let run = track(model, streams, &calibration, &config, None, &mut |_| true).unwrap();
    if smooth {
        run.smooth(&mut |_| true).unwrap()
    } else {
        run
    }
}

/// All numbers of a run; as text where a missing one equals another.
fn print(run: &Run) -> (Vec<u64>, String) {
    let s = &run.series;
    let numbers = s.time_s.iter().chain(&s.mean).chain(&s.std);
    (
        numbers.map(|x| x.to_bits()).collect(),
        format!("{:?} {:?} {:?} {:?}", s.nis, s.reports, run.last_belief(), run.smoothed),
    )
}

#[test]
fn side_by_side_is_alone_bit_for_bit() {
    let jobs = jobs();
    let expected: Vec<_> = jobs.iter().map(|job| print(&alone(job))).collect();
    for threads in [Some(1), Some(2), Some(4), None] {
        let done = track_many(jobs.clone(), threads, &mut |_| true).unwrap();
        let found: Vec<_> = done.iter().map(|d| print(&d.as_ref().unwrap().run)).collect();
        assert!(found == expected, "{threads:?} threads");
    }
}

#[test]
fn one_that_fails_stops_no_other() {
    let mut jobs = jobs();
    jobs[1].streams.clear();
    jobs[3].config.alpha = -1.0;
    let done = track_many(jobs, Some(2), &mut |_| true).unwrap();
    let failed: Vec<bool> = done.iter().map(Result::is_err).collect();
    assert_eq!(failed, [false, true, false, true, false]);
    assert!(matches!(&done[1], Err(Error::Data(text)) if text.contains("no row")), "{:?}", done[1].as_ref().err());
    assert!(matches!(&done[3], Err(Error::Data(text)) if text.contains("alpha")), "{:?}", done[3].as_ref().err());
}

#[test]
fn who_asks_may_stop_all() {
    let stopped = track_many(jobs(), Some(2), &mut |_| false);
    assert_eq!(stopped.err(), Some(Error::Stopped));
}

#[test]
fn progress_grows_to_one_on_the_calling_thread() {
    let (mut shares, here) = (Vec::new(), std::thread::current().id());
    let mut told = |share| {
        assert_eq!(std::thread::current().id(), here);
        shares.push(share);
        true
    };
    track_many(jobs(), Some(2), &mut told).unwrap();
    assert!(shares.is_sorted(), "{shares:?}");
    assert_eq!(shares.last(), Some(&1.0));
}

#[test]
fn nothing_to_do_and_nobody_to_do_it() {
    assert!(track_many(Vec::new(), None, &mut |_| true).unwrap().is_empty());
    let refused = track_many(jobs(), Some(0), &mut |_| true);
    assert!(matches!(&refused, Err(Error::Data(text)) if text.contains("threads = 0")));
}
