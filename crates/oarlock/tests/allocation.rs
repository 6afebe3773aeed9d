//! A step allocates nothing once the start is found.

#![allow(unsafe_code)] // an allocator that counts cannot be written without

mod support;

use oarlock::config::{Config, FilterKind};
use oarlock::model::Model;
use oarlock::recording::Sample;
use oarlock::track::run::track;
use oarlock::track::{Calibration, Status};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use support::chance::Chance;
use support::record::{punch_holes, streams, times, Scene};
use support::stroke::Stroke;
use support::tree::TREE;
use support::wave::Wave;
use support::{body, lively_sculler, model, tracker};

struct Counting;

thread_local! {
    /// Requests for memory by this thread; other threads belong to the test runner.
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

fn count() {
    // Gone while a thread ends.
    let _ = REQUESTS.try_with(|r| r.set(r.get() + 1));
}

// SAFETY: hands every request on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(ptr, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, ptr: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(ptr, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn sculler() -> Arc<Model> {
    model(&lively_sculler())
}

fn samples(config: &Config) -> Vec<Sample> {
    let model = sculler();
    let body = body(&model, config);
    let stroke = Stroke::new(&body, 2.2);
    let scene = Scene { body: &body, motion: &|t| stroke.at(t), surge: &|_| 0.0, azimuth_rad: 0.5, noise: 1.0 };
    let mut chance = Chance::new(5);
    let mut samples = scene.samples(&times(0.0, 0.01, 520), &mut chance);
    punch_holes(&body, &mut samples[20..], &mut chance);
    for k in (40..500).step_by(60) {
        samples[k].z[..6].fill(150.0);
        samples[k + 20].z[6..9].fill(90.0);
    }
    samples[300].z.fill(f64::NAN);
    samples
}

const FILTERS: [FilterKind; 3] = [FilterKind::Ukf, FilterKind::Ekf, FilterKind::Factorised];

#[test]
fn steps_allocate_nothing() {
    FILTERS.into_iter().for_each(assert_steps_allocate_nothing);
}

fn assert_steps_allocate_nothing(filter: FilterKind) {
    let config = Config { filter, ..Config::default() };
    let samples = samples(&config);
    let mut tracker = tracker(&sculler(), &config);
    for sample in &samples[..20] {
        tracker.step(sample).unwrap();
    }
    let (mut used, mut rejected, mut missing) = (0, 0, 0);
    let mut loops = 0;
    let before = REQUESTS.get();
    for sample in &samples[20..] {
        assert_eq!(tracker.step(sample).unwrap(), Status::Tracking);
        for source in &tracker.info().sources {
            used += u32::from(source.used);
            rejected += u32::from(source.rejected);
            missing += u32::from(source.missing);
        }
        let sources = &tracker.info().sources;
        loops += usize::from(sources[sources.len() - 1].used);
    }
    let requests = REQUESTS.get() - before;
    println!("500 steps: {used} rows used, {rejected} rejected, {missing} missing, {requests} allocations");
    assert!(loops > 2_000 && rejected > 30 && missing > 2_000, "{loops} {rejected} {missing}");
    assert_eq!(requests, 0);
    let grown = vec![0_u8; tracker.info().sources.len()];
    assert!(REQUESTS.get() > before && !grown.is_empty(), "the count itself works");
}

/// What smoothing allocates for each belief that was kept: a copy or two of it.
const PER_KEPT_BELIEF: usize = 60;

#[test]
fn steps_back_allocate_nothing() {
    let config = Config { belief_interval_s: 1.0, ..Config::default() };
    let (model, samples) = (sculler(), samples(&config));
    let body = body(&model, &config);
    let smoothing = |count: usize| {
        let (streams, nominal) = (streams(&body, &samples[..count]), Calibration::default());
        let run = track(model.clone(), streams, &nominal, &config, None, &mut |_| true).unwrap();
        let before = REQUESTS.get();
        let smooth = run.smooth(&mut |_| true).unwrap();
        let requests = REQUESTS.get() - before;
        (smooth.beliefs().count(), requests)
    };
    // The room that stretches share is there behind the first of them.
    let ((few, short), (many, long)) = (smoothing(215), smoothing(515));
    println!("smoothing 300 samples more, {} beliefs more: {} allocations more", many - few, long - short);
    assert_eq!(many - few, 3);
    assert!(long - short < PER_KEPT_BELIEF * (many - few), "{short} {long}");
}

/// Balls and free joints, with a compass: one hypothesis from the beginning. While several compete, a step does allocate: beliefs
/// are copied, ranked and given up.
#[test]
fn steps_with_balls_allocate_nothing() {
    FILTERS.into_iter().for_each(assert_steps_with_balls_allocate_nothing);
}

fn assert_steps_with_balls_allocate_nothing(filter: FilterKind) {
    let config = Config { filter, ..Config::default() };
    let model = model(TREE);
    let body = body(&model, &config);
    let mut chance = Chance::new(6);
    let wave = Wave::random(&model, 0.5, 0.8, &mut chance);
    let motion = |t: f64| wave.at(t);
    let scene = Scene { body: &body, motion: &motion, surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
    let mut samples = scene.samples(&times(0.0, 0.01, 320), &mut chance);
    // Single readings only: behind a silence the posture is fitted anew, which allocates.
    for sample in &mut samples[20..] {
        for x in sample.z.iter_mut().filter(|_| chance.uniform() < 0.05) {
            *x = f64::NAN;
        }
    }
    samples[100].z[..6].fill(150.0);
    let mut tracker = tracker(&model, &config);
    for sample in &samples[..20] {
        tracker.step(sample).unwrap();
    }
    let before = REQUESTS.get();
    for sample in &samples[20..] {
        assert_eq!(tracker.step(sample).unwrap(), Status::Tracking);
    }
    let requests = REQUESTS.get() - before;
    assert!(tracker.hypothesis().unwrap().rivals.is_empty());
    println!("300 steps with balls: {requests} allocations");
    assert_eq!(requests, 0);
}
