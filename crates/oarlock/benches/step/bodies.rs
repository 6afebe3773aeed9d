//! Bodies of several sizes, trackers that run on them, and what their sensors read.

use super::support::chance::Chance;
use super::support::record::{times, Scene};
use super::support::stroke::{Posture, Stroke};
use super::support::{body, SCULLER};
use oarlock::config::FilterKind;
use oarlock::recording::Sample;
use oarlock::track::{Calibration, Tracker};
use oarlock::{Config, Model};
use std::fmt::Write;
use std::sync::Arc;

pub const RATE_HZ: f64 = 125.0;
const SAMPLES: usize = 1_000;
/// Samples of the start and until a belief has settled.
const WARM: usize = 250;

/// A body with its configuration, and what its sensors read.
pub struct Case {
    pub name: &'static str,
    pub model: Arc<Model>,
    pub config: Config,
    pub samples: Vec<Sample>,
}

/// From 26 to 152 states.
pub fn cases() -> Vec<Case> {
    let bare = Config { estimate: Vec::new(), ..Config::default() };
    vec![
        Case::new("arms of 9 hinges", &arms(8, 1, 3, 2, 1), &bare),
        Case::new("sculler", SCULLER, &bare),
        Case::new("sculler with biases and surge", SCULLER, &Config::default()),
        Case::new("arms of 29 hinges", &arms(26, 3, 13, 4, 1), &bare),
        Case::new("arms of 53 hinges", &arms(49, 4, 26, 4, 4), &bare),
    ]
}

impl Case {
    fn new(name: &'static str, text: &str, config: &Config) -> Self {
        let model = super::support::model(text);
        let body = body(&model, config);
        let stroke = (text == SCULLER).then(|| Stroke::new(&body, 2.2));
        let motion = |t: f64| stroke.as_ref().map_or_else(|| sway(&model, t), |stroke| stroke.at(t));
        let scene = Scene { body: &body, motion: &motion, surge: &|_| 0.0, azimuth_rad: 0.3, noise: 1.0 };
        let samples = scene.samples(&times(1.0 / RATE_HZ, 1.0 / RATE_HZ, SAMPLES), &mut Chance::new(1));
        Case { name, model, config: config.clone(), samples }
    }

    pub fn tracker(&self, filter: FilterKind) -> Tracker {
        let config = Config { filter, ..self.config.clone() };
        Tracker::new(self.model.clone(), &Calibration::default(), &config).expect("it tracks")
    }

    /// A tracker that has begun by itself and converged, and the samples that follow.
    pub fn running(&self, filter: FilterKind) -> (Tracker, &[Sample]) {
        let mut tracker = self.tracker(filter);
        let (before, behind) = self.samples.split_at(WARM);
        for sample in before {
            tracker.step(sample).expect("these readings fit the model");
        }
        (tracker, behind)
    }
}

/// All coordinates swing a little about their rest, each at its own time.
fn sway(model: &Model, time_s: f64) -> Posture {
    let swing = |j: usize| (2.0 * time_s + j as f64).sin_cos();
    let rest: Vec<f64> = model.joints.iter().flat_map(|joint| joint.rest.clone()).collect();
    let all = 0..rest.len();
    Posture {
        q: all.clone().map(|j| rest[j] + 0.05 * swing(j).0).collect(),
        qd: all.clone().map(|j| 0.1 * swing(j).1).collect(),
        qdd: all.map(|j| -0.2 * swing(j).0).collect(),
    }
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
