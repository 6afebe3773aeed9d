//! Whatever comes in, a step ends with an answer, and what it cannot use changes nothing.

use crate::support;

use oarlock::body::Body;
use oarlock::config::{Config, FilterKind};
use oarlock::estimate::belief::Belief;
use oarlock::kernels::dense::Square;
use oarlock::model::Model;
use oarlock::recording::{Channel, Sample, Stream};
use oarlock::sensor::Quantity;
use oarlock::track::run::track;
use oarlock::track::{Calibration, Status, Tracker};
use oarlock::Error;
use proptest::prelude::*;
use std::sync::Arc;
use support::absurd::{self, is_sound, odd, odd_samples, odd_time};
use support::chance::Chance;
use support::record::{times, Scene};
use support::stroke::Stroke;
use support::wave::Wave;
use support::{body, fresh, lively_sculler, model, plain, start_std, started, tracker, worse, CHAIN, SCULLER};

fn any_filter() -> impl Strategy<Value = FilterKind> {
    prop_oneof![Just(FilterKind::Ukf), Just(FilterKind::Ekf)]
}

fn step_through(tracker: &mut Tracker, samples: &[Sample]) {
    absurd::step_through(tracker, samples, |tracker| is_sound(tracker.belief().unwrap()));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn absurd_samples_are_answered(samples in odd_samples(odd(), odd(), [18, 2]), gate in any::<bool>(), filter in any_filter()) {
        let model = model(CHAIN);
        let config = Config { gate, filter, ..Config::default() };
        step_through(&mut tracker(&model, &config), &samples);
        let body = body(&model, &config);
        step_through(&mut started(&body, &config, vec![0.0; body.layout.dim()], &start_std(&body)), &samples);
    }

    #[test]
    fn absurd_recordings_are_answered(
        stamps in prop::collection::vec(odd_time(), 0..20),
        values in prop::collection::vec(odd(), 0..60),
        sorted in any::<bool>(),
    ) {
        let model = model(CHAIN);
        let mut clock = 0.0;
        let time_s: Vec<f64> = stamps.iter().map(|t| { clock += if sorted { t.abs().min(1e3) + 1e-6 } else { *t }; clock }).collect();
        let fits = values.len() >= 3 * time_s.len();
        let values = if fits { values[..3 * time_s.len()].to_vec() } else { values };
        let stream = |name: &str, quantity| Stream {
            name: name.into(),
            time_s: time_s.clone().into(),
            channels: vec![Channel { quantity, values: values.clone().into() }],
        };
        let streams = vec![stream("upper", Quantity::Gyro), stream("lower", Quantity::Accel)];
        let config = Config::default();
        if let Ok(run) = track(model, streams, &Calibration::default(), &config, None, &mut |_| true) {
            prop_assert!(run.last().is_none_or(|one| is_sound(&one.belief)));
            let _ = run.smooth(&mut |_| true);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn absurd_samples_of_a_sculler_are_answered(samples in odd_samples(odd(), odd(), [58, 22])) {
        let model = model(SCULLER);
        step_through(&mut tracker(&model, &Config::default()), &samples);
    }
}

#[test]
fn samples_and_beliefs_of_another_model_are_refused() {
    let (chain, config) = (model(CHAIN), Config::default());
    let mut chained = tracker(&chain, &config);
    let foreign = tracker(&model(SCULLER), &config).empty_sample();
    let sample = Sample { time_s: 1.0, ..foreign };
    assert!(matches!(chained.step(&sample), Err(Error::Data(_))));
    let body = body(&chain, &config);
    let n = body.layout.dim();
    let good = fresh(&body, 0.0, vec![0.0; n], &start_std(&body));
    let mut few = good.clone();
    few.belief.covariance = Square::zeros(n - 1);
    let mut without_parts = good.clone();
    without_parts.belief.rejected_since_s.clear();
    for bad in [few, without_parts] {
        assert!(matches!(chained.resume(bad), Err(Error::Data(_))));
    }
    chained.resume(good).unwrap();
    assert!(matches!(chained.step(&sample), Err(Error::Data(_))));
    assert!(chained.belief().is_some(), "a refusal loses nothing");
}

/// A sculler under way.
struct Way {
    model: Arc<Model>,
    body: Body,
    config: Config,
    stroke: Stroke,
}

impl Way {
    fn new(text: &str, config: Config) -> Self {
        let model = model(text);
        let body = body(&model, &config);
        let stroke = Stroke::new(&body, 2.2);
        Way { model, body, config, stroke }
    }

    fn samples(&self, times: &[f64], noise: f64) -> Vec<Sample> {
        let motion = |t| self.stroke.at(t);
        self.scene(&motion, noise).samples(times, &mut Chance::new(3))
    }

    fn scene<'a>(&'a self, motion: &'a dyn Fn(f64) -> support::stroke::Posture, noise: f64) -> Scene<'a> {
        Scene { body: &self.body, motion, surge: &|_| 0.0, azimuth_rad: 0.5, noise }
    }

    /// A tracker that starts at the truth at 0 s.
    fn tracker(&self) -> Tracker {
        let motion = |t| self.stroke.at(t);
        let mean = self.scene(&motion, 1.0).state(0.0);
        started(&self.body, &self.config, mean, &start_std(&self.body))
    }

    fn std(&self, belief: &Belief, joint: usize) -> f64 {
        let slots = self.body.layout.coordinates[joint].unwrap();
        belief.covariance.at(slots.q, slots.q).sqrt()
    }
}

#[test]
fn a_late_sample_changes_nothing() {
    let way = Way::new(SCULLER, Config::default());
    let samples = way.samples(&times(0.01, 0.01, 40), 1.0);
    let (mut one, mut other) = (way.tracker(), way.tracker());
    for (k, sample) in samples.iter().enumerate() {
        one.step(sample).unwrap();
        other.step(sample).unwrap();
        for late in [&samples[k / 2], sample] {
            assert_eq!(other.step(late).unwrap(), Status::OutOfOrder);
        }
        let timeless = Sample { time_s: f64::NAN, ..sample.clone() };
        assert_eq!(other.step(&timeless).unwrap(), Status::OutOfOrder);
        assert_eq!(format!("{:?}", one.hypothesis()), format!("{:?}", other.hypothesis()));
        assert_eq!(format!("{:?}", one.info()), format!("{:?}", other.info()));
    }
}

/// An hour without data: every joint is back to its prior, and a second later the track is found again.
#[test]
fn an_hour_without_data_is_survived() {
    let way = Way::new(SCULLER, Config::default());
    let mut tracker = way.tracker();
    let mut before = way.samples(&times(0.01, 0.01, 200), 1.0);
    // 3,599.2 s are 1,636 strokes.
    let after = way.samples(&times(3_601.2, 0.01, 300), 1.0);
    before.push(Sample { time_s: 3_600.0, ..tracker.empty_sample() });
    for sample in &before {
        assert_eq!(tracker.step(sample).unwrap(), Status::Tracking);
    }
    for (j, joint) in way.model.joints[..16].iter().enumerate() {
        let share = way.std(tracker.belief().unwrap(), j) / way.body.axes[j].prior_std();
        assert!((0.75..1.01).contains(&share), "{}: {share} of its prior", joint.name);
    }
    for sample in &after {
        assert_eq!(tracker.step(sample).unwrap(), Status::Tracking);
        assert!(is_sound(tracker.belief().unwrap()));
    }
    let (end, now) = (after.last().unwrap().time_s, tracker.belief().unwrap());
    let truth = way.stroke.at(end).q;
    let miss = |j: usize| (now.mean[way.body.layout.coordinates[j].unwrap().q] - truth[j]).abs();
    assert!(miss(0) < 0.02 && miss(1) < 0.02, "seat {} m, trunk {} rad", miss(0), miss(1));
}

#[test]
fn a_stamp_from_another_clock_does_not_hang() {
    for time_s in [1e9, 1.7e18, 1e300] {
        let way = Way::new(SCULLER, Config::default());
        let mut tracker = way.tracker();
        let mut samples = way.samples(&times(0.01, 0.01, 20), 1.0);
        samples.push(Sample { time_s, ..samples[19].clone() });
        let last = samples.iter().map(|s| tracker.step(s)).last().unwrap();
        assert!(matches!(last, Ok(Status::Tracking) | Err(Error::Diverged { .. })), "{last:?}");
    }
}

/// Loops and encoders a thousand times tighter than the model's: variances of 1e-12 beside accelerations of 25.
#[test]
fn noise_free_loops_do_not_break_the_covariance() {
    let text = SCULLER
        .replace("std_m = 0.002", "std_m = 1e-6")
        .replace("std_axis = 0.005", "std_axis = 1e-6")
        .replace("std = 0.001  # m", "std = 1e-6");
    assert_eq!(text.matches("1e-6").count(), 5);
    let way = Way::new(&text, Config { gate: false, ..Config::default() });
    let mut tracker = way.tracker();
    let (steps, mut chance) = (20_000, Chance::new(9));
    let motion = |t| way.stroke.at(t);
    let scene = way.scene(&motion, 1.0);
    for k in 1..=steps {
        let time_s = 0.01 * k as f64;
        let mut sample = scene.sample(time_s, &mut chance);
        // The oars' angles without noise, else the loops contradict each other.
        let truth = way.stroke.at(time_s).q;
        sample.inputs.iter_mut().zip(&truth).filter(|(x, _)| !x.is_nan()).for_each(|(x, q)| *x = *q);
        assert_eq!(tracker.step(&sample).unwrap(), Status::Tracking);
    }
    let now = tracker.belief().unwrap();
    assert!(is_sound(now));
    let truth = way.stroke.at(now.time_s).q;
    for (j, q) in truth[..16].iter().enumerate() {
        let miss = (now.mean[way.body.layout.coordinates[j].unwrap().q] - q).abs();
        assert!(miss < 0.01, "{}: {miss}", way.model.joints[j].name);
    }
}

/// How much wider the trunk's band may be with the back's sensor and the seat alone than with everything: the arms' sensors
/// and the loops see the trunk too, so that it cannot be 1. Measured: 2.5.
const TRUNK_ALONE: f64 = 3.0;
/// How far unseen joints may change the trunk's band and, in its bands, its angle: more states lie farther out as sigma
/// points, which is felt where the start is uncertain and hardly behind it.
const HARM: f64 = 0.05;

/// A sculler whose arms are no states at all, with a sensor on the back and one on the seat.
fn armless() -> Arc<Model> {
    let mut model = (*model(&lively_sculler())).clone();
    model.joints[2..16].iter_mut().for_each(|j| j.input = true);
    model.sensors.retain(|s| ["back", "seat"].contains(&s.name.as_str()));
    model.closures.clear();
    Arc::new(model)
}

/// The trunk's angle and its standard deviation, rad.
fn trunk(tracker: &Tracker) -> (f64, f64) {
    let (at, now) = (tracker.body().layout.coordinates[1].unwrap().q, tracker.belief().unwrap());
    (now.mean[at], now.covariance.at(at, at).sqrt())
}

/// Ten minutes with the arms unseen: they keep their priors, and the trunk is known as well as if there were no arms.
#[test]
fn unobserved_joints_stay_bounded_and_harmless() {
    let way = Way::new(&lively_sculler(), Config::default());
    let (mut alone, mut all) = (way.tracker(), way.tracker());
    let motion = |t| way.stroke.at(t);
    let (scene, mut chance) = (way.scene(&motion, 1.0), Chance::new(4));
    let mut bare = tracker(&armless(), &way.config);
    let start = Scene { body: bare.body(), ..way.scene(&motion, 1.0) }.state(0.0);
    bare.resume(fresh(bare.body(), 0.0, start, &start_std(bare.body()))).unwrap();
    let seat = way.body.suite.sources.iter().find(|s| s.name == "seat").unwrap().rows.start;
    let (mut narrow, mut early, mut late, mut harm) = (0.0, 0.0, 0.0, 0.0_f64);
    for k in 1..=12_000 {
        let mut sample = scene.sample(0.05 * k as f64, &mut chance);
        if k <= 600 {
            all.step(&sample).unwrap();
        }
        for (r, z) in sample.z.iter_mut().enumerate() {
            *z = if r < 9 || r == seat { *z } else { f64::NAN };
        }
        sample.inputs.fill(f64::NAN);
        assert_eq!(alone.step(&sample).unwrap(), Status::Tracking);
        let z = [&sample.z[..9], &sample.z[seat..=seat]].concat();
        bare.step(&Sample { z, ..sample.clone() }).unwrap();
        let ((angle, band), (bare_angle, bare_band)) = (trunk(&alone), trunk(&bare));
        if k > 200 {
            harm = worse(harm, worse((angle - bare_angle).abs() / band, (band / bare_band - 1.0).abs()));
        }
        if (201..=600).contains(&k) {
            narrow += trunk(&all).1 / 400.0;
            early += band / 400.0;
        }
        late += if k > 11_600 { band / 400.0 } else { 0.0 };
    }
    let now = alone.belief().unwrap();
    assert!(is_sound(now));
    for (j, joint) in way.model.joints[..16].iter().enumerate().skip(2) {
        let share = way.std(now, j) / way.body.axes[j].prior_std();
        assert!((0.75..1.01).contains(&share), "{}: {share} of its prior", joint.name);
    }
    println!("trunk: {narrow:.5} rad with everything, {early:.5} with back and seat, {late:.5} after ten minutes");
    println!("trunk with and without unseen arms: {harm:.1e} bands apart");
    assert!(early < TRUNK_ALONE * narrow && late < TRUNK_ALONE * narrow, "{narrow} {early} {late}");
    assert!(harm < HARM, "{harm:e}");
    let miss = (trunk(&alone).0 - way.stroke.at(now.time_s).q[1]).abs();
    assert!(miss < 5.0 * late, "trunk off by {miss} rad at a std of {late}");
}

#[test]
fn a_plain_tracker_needs_no_gate_to_refuse_infinity() {
    let way = Way::new(SCULLER, plain(&[]));
    let mut tracker = way.tracker();
    let mut samples = way.samples(&times(0.01, 0.01, 10), 1.0);
    samples[5].z[4] = f64::INFINITY;
    let before: Vec<Status> = samples[..5].iter().map(|s| tracker.step(s).unwrap()).collect();
    assert!(before.iter().all(|&s| s == Status::Tracking));
    let known = format!("{:?}", tracker.hypothesis());
    assert!(matches!(tracker.step(&samples[5]), Err(Error::Data(_))));
    assert_eq!(known, format!("{:?}", tracker.hypothesis()), "a refusal loses nothing");
    assert_eq!(tracker.step(&samples[6]).unwrap(), Status::Tracking);
}

/// Gyroscopes and accelerometers are refused until patience ends; then the posture is sought anew, not bent by a thousand
/// standard deviations at each update.
#[test]
fn a_belief_that_its_sensors_contradict_is_given_up() {
    let (chain, config) = (model(CHAIN), Config::default());
    let body = body(&chain, &config);
    let wave = Wave::random(&chain, 0.8, 0.8, &mut Chance::new(6));
    let motion = |t| wave.at(t);
    let scene = Scene { body: &body, motion: &motion, surge: &|_| 0.0, azimuth_rad: 0.5, noise: 1.0 };
    let mut mean = scene.state(0.0);
    let joints = [0, 1].map(|j| body.layout.coordinates[j].unwrap());
    for slots in joints {
        mean[slots.q] += 1.0;
        mean[slots.rates.unwrap().0] += 5.0;
    }
    let mut tracker = started(&body, &config, mean, &vec![1e-4; body.layout.dim()]);
    let (mut lost_s, mut worst) = (Vec::new(), 0.0_f64);
    for sample in &scene.samples(&times(0.01, 0.01, 200), &mut Chance::new(3)) {
        tracker.step(sample).unwrap();
        lost_s.extend(tracker.info().lost.then_some(sample.time_s));
        let (now, truth) = (tracker.belief().unwrap(), wave.at(sample.time_s));
        assert!(is_sound(now));
        for (j, slots) in joints.iter().enumerate() {
            let error = (now.mean[slots.q] - truth.q[j]).abs();
            let std = now.covariance.at(slots.q, slots.q).sqrt();
            worst = if lost_s.is_empty() { 0.0 } else { worse(worst, error / std) };
        }
    }
    println!("given up at {lost_s:?} s, at worst {worst:.1} sigma from then on");
    assert!(lost_s.len() == 1 && lost_s[0] < 0.1, "{lost_s:?}");
    assert!(worst < 5.0, "{worst}");
}
