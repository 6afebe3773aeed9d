//! Bodies of several sizes, and trackers that run on them.

use oarlock::estimate::belief::{Belief, MEMORY};
use oarlock::estimate::dense::Square;
use oarlock::estimate::System;
use oarlock::recording::Sample;
use oarlock::track::loops::readings;
use oarlock::track::{Calibration, Tracker};
use oarlock::{Config, Model};
use std::fmt::Write;
use std::sync::Arc;

const SCULLER: &str = include_str!("../../../../python/oarlock/models/sculler.toml");
pub const RATE_HZ: f64 = 125.0;

/// A body with its configuration.
pub struct Case {
    pub name: &'static str,
    pub model: Arc<Model>,
    pub config: Config,
}

/// From 26 to 152 states.
pub fn cases() -> Vec<Case> {
    let bare = Config { estimate: Vec::new(), ..Config::default() };
    let case = |name, text: &str, config: &Config| {
        let model = Model::from_toml(text, name).expect("the model is valid");
        Case { name, model: Arc::new(model), config: config.clone() }
    };
    vec![
        case("arms of 9 hinges", &arms(8, 1, 3, 2, 1), &bare),
        case("sculler", SCULLER, &bare),
        case("sculler with biases and surge", SCULLER, &Config::default()),
        case("arms of 29 hinges", &arms(26, 3, 13, 4, 1), &bare),
        case("arms of 53 hinges", &arms(49, 4, 26, 4, 4), &bare),
    ]
}

/// Arms on one trunk: so many hinges with rates and without, inertial units, position sensors and encoders.
fn arms(driven: usize, walking: usize, units: usize, places: usize, encoders: usize) -> String {
    let mut text = HEAD.to_string();
    let joints = driven + walking;
    for j in 0..joints {
        let walk = "process = { kind = \"walk\", density = 0.2, start_std = [0.1] }";
        let process = if j < driven { "" } else { walk };
        // Four hinges to an arm; what follows walks.
        let parent = if j % 4 == 0 { "root".to_string() } else { format!("f{}", j - 1) };
        write!(
            text,
            "[[joint]]\nname = \"j{j}\"\nkind = \"hinge\"\n{process}\n[[frame]]\nname = \"f{j}\"\nparent = \"{parent}\"\n\
             dh = {{ a = 0.2, alpha = {}, d = 0.05, theta = 0.4 }}\njoint = \"j{j}\"\n",
            ["\"pi/2\"", "\"-pi/2\"", "0.3"][j % 3]
        )
        .expect("text grows");
    }
    for k in 0..units {
        write!(
            text,
            "[[sensor]]\nname = \"u{k}\"\nkind = \"imu\"\nframe = \"f{}\"\n{UNIT}",
            (k + 1) * driven / units - 1
        )
        .expect("text grows");
    }
    for k in 0..places {
        write!(
            text,
            "[[sensor]]\nname = \"p{k}\"\nkind = \"position\"\nframe = \"f{}\"\npoint = [0.1, 0, 0]\nstd_m = 0.002\n",
            joints - 1 - k
        )
        .expect("text grows");
    }
    for k in 0..encoders {
        write!(text, "[[sensor]]\nname = \"e{k}\"\nkind = \"encoder\"\njoint = \"j{}\"\nstd = 0.001\n", 4 * k)
            .expect("text grows");
    }
    text
}

const HEAD: &str = r#"
format = 1
name = "arms"
[world]
up = [0, 1, 0]
forward = [0, 0, 1]
magnetic_norm_ut = 47.0
magnetic_dip_rad = 1.0
magnetic_azimuth_rad = 0.5
azimuth_walk = 0.002
[process]
hinge = { kind = "jerk", density = 5.0, start_std = [0.1, 0.3, 3.0] }
"#;

const UNIT: &str =
    "gyro_std_rad_s = 0.008\naccel_std_m_s2 = 0.02\nmag_std_ut = 1.0\nmount.offset = [-0.1, 0.02, 0.03]\n\
    mount.rpy = [0.3, -0.2, 1.0]\n";

/// Readings of a body that sways a little about its rest posture.
pub fn sample(tracker: &Tracker, index: usize) -> Sample {
    let model = &tracker.body.model;
    let time_s = index as f64 / RATE_HZ;
    let sway = |j: usize| 0.05 * (2.0 * time_s + j as f64).sin();
    let q: Vec<f64> = model.joints.iter().enumerate().map(|(j, joint)| joint.rest[0] + sway(j)).collect();
    let still = vec![0.0; q.len()];
    let mut sample = tracker.empty_sample();
    sample.time_s = time_s;
    sample.z.copy_from_slice(&readings(&tracker.body, &q, &still, &still));
    for (j, joint) in model.joints.iter().enumerate().filter(|(_, j)| j.input) {
        sample.inputs[j] = q[j] + joint.input_std;
    }
    sample
}

/// A tracker that has settled.
pub fn running(case: &Case) -> Tracker {
    let mut tracker = Tracker::new(case.model.clone(), &Calibration::default(), &case.config).expect("it tracks");
    tracker.resume(start(&tracker)).expect("it fits");
    for index in 1..100 {
        let sample = sample(&tracker, index);
        tracker.step(&sample).expect("these readings fit the model");
    }
    tracker
}

/// The sample behind the last one of [`running`].
pub const NEXT: usize = 100;

fn start(tracker: &Tracker) -> Belief {
    let (body, sources) = (&tracker.body, tracker.body.suite.sources.len());
    let (n, parts) = (body.layout.dim(), body.groups().parts.len());
    let (mut mean, mut covariance) = (vec![0.0; n], Square::zeros(n));
    (0..n).for_each(|i| *covariance.at_mut(i, i) = 0.05 * 0.05);
    for (_, axis, slots) in body.moving() {
        mean[slots.q] = axis.rest;
        let std = axis.process.start_std;
        let states = [Some(slots.q), slots.rates.map(|r| r.0), slots.rates.map(|r| r.1)];
        for (state, std) in states.into_iter().zip(std) {
            if let Some(i) = state {
                *covariance.at_mut(i, i) = std * std;
            }
        }
    }
    if let Some(i) = body.layout.azimuth {
        mean[i] = body.model.world.magnetic_azimuth_rad;
    }
    Belief {
        time_s: 0.0,
        mean,
        covariance,
        drive: vec![1.0; body.driven().len()],
        habit: vec![1.0; parts],
        inflation: 1.0,
        surprise: 1.0,
        seen_s: vec![0.0; sources],
        rejected_since_s: vec![f64::NAN; parts],
        memory: vec![[f64::NAN; MEMORY]; sources],
        line: 1,
        score: 0.0,
        rivals: Vec::new(),
    }
}
