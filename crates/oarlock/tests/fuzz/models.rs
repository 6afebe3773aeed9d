//! Model files with wounds: read, described, tracked with; or refused with a reason.

use super::campaign::campaign;
use super::mutate::mutated;
use super::numbers::{index, one_in, pick};
use super::streams::{samples, step_through};
use super::support::extended::extended;
use super::support::{CHAIN, SCULLER};
use oarlock::body::Body;
use oarlock::config::Config;
use oarlock::describe::describe;
use oarlock::model::Model;
use oarlock::track::{Calibration, Tracker};
use oarlock::Error;
use std::fmt::Write;
use std::sync::{Arc, LazyLock};

macro_rules! shipped {
    ($($name:literal),*) => { [$(include_str!(concat!("../../../../python/oarlock/model/shipped/", $name, ".toml"))),*] };
}

/// Every kind of joint, sensor and loop that model files have.
pub static TEXTS: LazyLock<[&str; 9]> = LazyLock::new(|| {
    [
        CHAIN,
        SCULLER,
        extended(SCULLER, shipped!("sculler_ball")[0]).leak(),
        extended(SCULLER, shipped!("sculler_boat")[0]).leak(),
        shipped!("pendulum3")[0],
        shipped!("arm7")[0],
        shipped!("qmt_full_body")[0],
        shipped!("openaxes_ur5")[0],
        shipped!("broad")[0],
    ]
});

/// Refused with a text that says where, or read.
pub fn answered<T>(result: oarlock::Result<T>) -> Option<T> {
    match result {
        Ok(value) => Some(value),
        Err(Error::Model(text) | Error::Data(text) | Error::Diverged { text, .. }) => {
            assert!(text.trim().len() > 10, "an error that says nothing: '{text}'");
            None
        }
        Err(Error::Stopped) => panic!("nobody stopped it"),
    }
}

#[test]
fn model_files_are_read_or_refused() {
    campaign("models", 150, |chance, fed| {
        let text = pick(chance, &*TEXTS);
        *fed = mutated(chance, text, &*TEXTS);
        let Some(model) = answered(Model::from_toml(fed, "wounded.toml")) else { return };
        let model = Arc::new(model);
        let config = Config::default();
        let mounts = vec![None; model.sensors.len()];
        if let Some(body) = answered(Body::new(model.clone(), &model.default_parameters(), &mounts, &config)) {
            let told = describe(&body, "wounded.toml");
            assert_eq!(told["joints"].as_array().map(Vec::len), Some(model.joints.len()));
        }
        let Some(mut tracker) = answered(Tracker::new(model, &Calibration::default(), &config)) else { return };
        if tracker.body().suite.len() < 40 || one_in(chance, 8) {
            let samples = samples(chance, &tracker, 6);
            write!(fed, "{samples:?}").unwrap();
            step_through(&mut tracker, &samples);
        }
    });
}

/// Bytes of any kind that happen to be UTF-8, and texts that begin like a model.
#[test]
fn texts_that_are_no_model_are_refused() {
    campaign("texts", 300, |chance, fed| {
        *fed = (0..index(chance, 400)).map(|_| char::from_u32(index(chance, 0x3ff) as u32).unwrap_or('x')).collect();
        if one_in(chance, 2) {
            fed.insert_str(0, "format = 1\nname = \"x\"\n[[frame]]\n");
        }
        assert!(answered(Model::from_toml(fed, "noise.toml")).is_none());
    });
}
