//! Two bodies on a ball without magnetometers: nothing tells their headings against each other but the way they move.

use super::support::chance::Chance;
use super::support::record::{streams, times};
use super::support::wave::Wave;
use super::support::{bits, body, model, so3, tracker};
use nalgebra::{Matrix3, Vector3};
use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};
use oarlock::kinematics::FrameMotion;
use oarlock::model::Model;
use oarlock::recording::Sample;
use oarlock::rotation::Vec3;
use oarlock::track::hypothesis::Hypothesis;
use oarlock::track::loops::readings_from;
use oarlock::track::run::{track, Run};
use oarlock::track::{Calibration, Tracker};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A trunk that turns and is pushed about, and an arm that hangs from it.
pub const PAIR: &str = r#"
format = 1
name = "pair"
description = "two bodies on a ball"
joint = [
    { name = "trunk", kind = "ball" },
    { name = "shoulder", kind = "ball" },
]
frame = [
    { name = "trunk", parent = "root", transform = {}, joint = "trunk" },
    { name = "arm", parent = "trunk", transform = { translation = [0.1, -0.2, 0.3] }, joint = "shoulder" },
]
sensor = [
    { name = "trunk", kind = "imu", frame = "trunk", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.1,
      mount.offset = [0.02, 0.05, 0] },
    { name = "arm", kind = "imu", frame = "arm", gyro_std_rad_s = 0.01, accel_std_m_s2 = 0.1,
      mount.offset = [0.05, 0, -0.25] },
]
base_acceleration = [
    { name = "push_x", axis = "x", density = 20, start_std = 3, time_s = 0.3, always = true },
    { name = "push_y", axis = "y", density = 20, start_std = 3, time_s = 0.3, always = true },
    { name = "push_z", axis = "z", density = 20, start_std = 3, time_s = 0.3, always = true },
]
[world]
up = [0, 0, 1]
forward = [1, 0, 0]
"#;

pub struct Pair {
    pub model: Arc<Model>,
    pub body: Body,
    pub config: Config,
    wave: Wave,
}

impl Pair {
    /// The arm's heading against the trunk is `heading` at first, rad.
    pub fn new(heading: f64, seed: u64) -> Self {
        Pair::swinging(heading, [0.7, 0.9], seed)
    }

    /// Amplitudes (rad) and frequencies (Hz) up to these.
    pub fn swinging(heading: f64, [amplitude, hz]: [f64; 2], seed: u64) -> Self {
        let model = model(PAIR);
        let config = Config { estimate: vec!["gyro_bias".into()], ..Config::default() };
        let body = body(&model, &config);
        let mut wave = Wave::random(&model, amplitude, hz, &mut Chance::new(seed));
        wave.coordinates.iter_mut().for_each(|(middle, _)| *middle = 0.0);
        wave.coordinates[5].0 = heading;
        Pair { model, body, config, wave }
    }

    fn push(t: f64) -> Vector3<f64> {
        let sines = [(1.5, 0.7), (1.0, 1.1), (0.8, 0.9)];
        Vector3::from(sines.map(|(a, hz)| a * (TAU * hz * t + a).sin()))
    }

    pub fn samples(&self, seconds: f64) -> Vec<Sample> {
        let mut chance = Chance::new(17);
        let one = |t: f64| {
            let p = self.wave.at(t);
            let force = Vec3(self.body.field.lift) + Vec3(Self::push(t).into());
            let root = FrameMotion::resting(force);
            let mut z = readings_from(&self.body, root, Vec3([0.0; 3]), &p.q, &p.qd, &p.qdd);
            let std = self.body.suite.std();
            z.iter_mut().zip(std).for_each(|(z, std)| *z += std * chance.normal());
            Sample { time_s: t, z, ..Sample::empty(&self.body.model, &self.body.suite) }
        };
        times(0.0, 0.01, (seconds / 0.01) as usize).into_iter().map(one).collect()
    }

    /// Of the shoulder, in the arm's axes.
    pub fn error(&self, mean: &[f64], t: f64) -> Vector3<f64> {
        so3::minus(so3::three(&self.wave.at(t).q, 3), so3::three(mean, 3))
    }

    /// Root from trunk.
    pub fn trunk(&self, t: f64) -> Matrix3<f64> {
        so3::exp(so3::three(&self.wave.at(t).q, 0))
    }

    pub fn tracker(&self) -> Tracker {
        tracker(&self.model, &self.config)
    }

    pub fn run(&self, samples: &[Sample], start: Option<Hypothesis>) -> Run {
        let streams = streams(&self.body, samples);
        track(self.model.clone(), streams, &Calibration::default(), &self.config, start, &mut |_| true).unwrap()
    }
}

/// Standard deviations, those of all hypotheses together.
fn spread(body: &Body, one: &Hypothesis) -> Vec<f64> {
    let mut std = vec![0.0; one.belief.mean.len()];
    one.spread(body, &mut std);
    std
}

/// A heading counts as found when the shoulder stays this close, rad (10 deg).
const FOUND_RAD: f64 = 0.175;
/// Motions of about a second tell it within a few periods, slow and small ones later.
const WITHIN_S: [([f64; 2], u64, f64); 3] = [([0.7, 0.9], 1, 3.0), ([0.7, 0.9], 2, 3.0), ([0.25, 0.4], 3, 4.0)];
/// How many of its own standard deviations the shoulder may be off at any time. The spread of some hypotheses is no Gaussian's:
/// no tail is farther than the farthest of them.
const COVERED: f64 = 4.0;

#[test]
fn every_heading_is_found_and_never_claimed_before() {
    [FilterKind::Ukf, FilterKind::Ekf].into_iter().for_each(assert_every_heading_is_found);
}

fn assert_every_heading_is_found(filter: FilterKind) {
    let every = if filter == FilterKind::Ukf { 1 } else { 4 };
    for (swing, seed, within_s) in WITHIN_S {
        for k in (0..12).step_by(every) {
            let mut pair = Pair::swinging(TAU * f64::from(k) / 12.0, swing, seed);
            pair.config.filter = filter;
            let mut tracker = pair.tracker();
            let (mut found_s, mut alone_s, mut worst, mut most, mut last) = (0.0, 0.0, 0.0_f64, 0, 0.0);
            for sample in &pair.samples(6.0) {
                let mut see = |s: &Sample, b: &Hypothesis, _: &oarlock::estimate::filter::Info| {
                    let error = pair.error(&b.belief.mean, s.time_s).norm();
                    let std = spread(&pair.body, b);
                    let total = std[3..6].iter().map(|s| s * s).sum::<f64>().sqrt();
                    worst = worst.max(error / total);
                    most = most.max(b.rivals.len() + 1);
                    found_s = if error > FOUND_RAD { s.time_s } else { found_s };
                    alone_s = if b.rivals.is_empty() { alone_s } else { s.time_s };
                    last = error;
                };
                tracker.step_with(sample, &mut see).unwrap();
            }
            println!(
                "{filter:?}, seed {seed}, {} deg: found after {found_s:.2} s, one of {most} left after {alone_s:.2} s, \
                 at worst {worst:.1} sigma, {last:.3} rad at the end",
                30 * k
            );
            assert!(most > 6, "several hypotheses were meant to compete: {most}");
            assert!(found_s < within_s, "{k}: {found_s} s");
            assert!(worst < COVERED, "{k}: {worst} sigma");
        }
    }
}

#[test]
fn live_is_whole_while_hypotheses_are_alive() {
    let pair = Pair::new(2.0, 1);
    let samples = pair.samples(3.0);
    let run = pair.run(&samples, None);
    let mut tracker = pair.tracker();
    let (mut mean, mut std, mut several) = (Vec::new(), Vec::new(), 0);
    for sample in &samples {
        let mut keep = |_: &Sample, b: &Hypothesis, _: &oarlock::estimate::filter::Info| {
            mean.extend_from_slice(&b.belief.mean);
            std.extend(spread(&pair.body, b));
            several += usize::from(!b.rivals.is_empty());
        };
        tracker.step_with(sample, &mut keep).unwrap();
    }
    assert!(several > 20, "{several}");
    assert_eq!(bits(&run.series.mean), bits(&mean));
    assert_eq!(bits(&run.series.std), bits(&std));
}

#[test]
fn cut_is_uncut_while_hypotheses_are_alive() {
    let pair = Pair::new(4.0, 1);
    let samples = pair.samples(3.0);
    let uncut = pair.run(&samples, None);
    let mut alive = 0;
    for cut in [12, 20, 45, 150] {
        let first = pair.run(&samples[..cut], None);
        let last = first.last().unwrap().clone();
        alive += usize::from(!last.rivals.is_empty());
        let second = pair.run(&samples[cut..], Some(last));
        let both = |f: fn(&Run) -> &Vec<f64>| bits(&[f(&first).as_slice(), f(&second)].concat());
        assert_eq!(bits(&uncut.series.mean), both(|r| &r.series.mean), "cut at {cut}");
        assert_eq!(bits(&uncut.series.std), both(|r| &r.series.std), "cut at {cut}");
        let ends = [&uncut, &second].map(|r| format!("{:?}", r.last()));
        assert_eq!(ends[0], ends[1], "cut at {cut}");
    }
    assert!(alive >= 2, "some cuts were meant to fall among hypotheses: {alive}");
}

/// Going back, the winner was right from the beginning, where the filter did not know yet. The end is as it was.
#[test]
fn smoothing_follows_the_winner() {
    for heading in [1.5, 3.0, 4.5] {
        let pair = Pair::new(heading, 2);
        let mut once: Option<Run> = None;
        for interval in [1.0, 0.13] {
            let pair =
                Pair { config: Config { belief_interval_s: interval, ..pair.config.clone() }, ..Pair::new(heading, 2) };
            let filtered = pair.run(&pair.samples(5.0), None);
            let smooth = filtered.smooth(&mut |_| true).unwrap();
            let (n, rows) = (pair.body.layout.dim(), smooth.series.time_s.len());
            let errors = |run: &Run| -> Vec<f64> {
                let row = |r: usize| pair.error(&run.series.mean[r * n..(r + 1) * n], run.series.time_s[r]).norm();
                (0..rows).map(row).collect()
            };
            let (before, after) = (errors(&filtered), errors(&smooth));
            let rms = |e: &[f64]| (e.iter().map(|x| x * x).sum::<f64>() / e.len() as f64).sqrt();
            let worst = |e: &[f64]| e.iter().copied().fold(0.0, f64::max);
            println!(
                "{heading}: filtered {:.3} rad rms, {:.3} at worst; smoothed {:.3} and {:.3}",
                rms(&before),
                worst(&before),
                rms(&after),
                worst(&after)
            );
            assert!(worst(&before) > 0.5, "nothing to find");
            assert!(worst(&after) < FOUND_RAD, "{}", worst(&after));
            let end = |run: &Run| bits(&run.series.mean[(rows - 1) * n..]);
            assert_eq!(end(&filtered), end(&smooth), "the last is unchanged by smoothing");
            if let Some(once) = &once {
                assert_eq!(bits(&once.series.mean), bits(&smooth.series.mean), "whatever beliefs were kept");
            }
            once = Some(smooth);
        }
    }
}

/// Seconds of readings, then as many without, again and again; more often than any count of partings was ever bounded.
const ROUND_S: f64 = 3.0;
const ROUNDS: usize = 24;

/// Behind every silence the heading is unknown, hypotheses compete, and one wins; smoothing follows each winner.
#[test]
fn hypotheses_open_again_and_again() {
    let pair = Pair::new(1.0, 1);
    let samples: Vec<Sample> = pair.samples(2.0 * ROUND_S * ROUNDS as f64);
    let speaks = |s: &&Sample| ((s.time_s / ROUND_S).floor() as usize).is_multiple_of(2);
    let samples: Vec<Sample> = samples.iter().filter(speaks).cloned().collect();
    let (mut tracker, mut openings, mut several) = (pair.tracker(), 0, false);
    for sample in &samples {
        let mut see = |_: &Sample, b: &Hypothesis, _: &oarlock::estimate::filter::Info| {
            openings += usize::from(!several && !b.rivals.is_empty());
            several = !b.rivals.is_empty();
        };
        tracker.step_with(sample, &mut see).unwrap();
    }
    assert!(openings >= ROUNDS - 1, "a bank for each silence was meant to open: {openings}");
    let filtered = pair.run(&samples, None);
    let smooth = filtered.smooth(&mut |_| true).unwrap();
    let n = pair.body.layout.dim();
    let error = |run: &Run, r: usize| pair.error(&run.series.mean[r * n..(r + 1) * n], run.series.time_s[r]).norm();
    let each = samples.len() / ROUNDS;
    let ends: Vec<f64> = (1..=ROUNDS).map(|k| error(&filtered, k * each - 1)).collect();
    let starts: Vec<f64> = (0..ROUNDS).map(|k| error(&smooth, k * each)).collect();
    println!("{openings} openings; filtered before each silence {ends:.3?}; smoothed behind each {starts:.3?}");
    let found = |errors: &[f64]| errors.iter().filter(|e| **e < FOUND_RAD).count();
    assert!(found(&ends) == ROUNDS && found(&starts) == ROUNDS, "{ends:?} {starts:?}");
}

/// Who says of a joint how far it may start from rest leaves nothing to try: no hypotheses, and no more doubt than said.
#[test]
fn a_start_that_is_known_opens_no_bank() {
    let known = "name = \"shoulder\", kind = \"ball\", process = { start_std = [0.2, 1.0, 10.0] }";
    let pair = Pair::new(0.1, 1);
    let samples = pair.samples(1.0);
    let told = model(&PAIR.replace("name = \"shoulder\", kind = \"ball\"", known));
    for (model, most) in [(pair.model.clone(), 12), (told, 1)] {
        let mut tracker = tracker(&model, &pair.config);
        let mut seen = Vec::new();
        for sample in &samples {
            let mut see = |_: &Sample, b: &Hypothesis, _: &oarlock::estimate::filter::Info| {
                seen.push((b.rivals.len() + 1, spread(&pair.body, b)[3..6].iter().map(|s| s * s).sum::<f64>().sqrt()));
            };
            tracker.step_with(sample, &mut see).unwrap();
        }
        let rivals = seen.iter().map(|s| s.0).max().unwrap();
        assert!(if most == 1 { rivals == 1 } else { rivals > 6 }, "{rivals}");
        // Three directions, each as uncertain as said at most.
        assert!(most > 1 || seen[0].1 <= 0.2 * 3_f64.sqrt(), "{}", seen[0].1);
    }
}
