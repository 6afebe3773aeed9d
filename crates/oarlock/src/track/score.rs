//! Scores a recording: normal equations of mounts, lengths, sensor positions, encoder zeros and clock delays from
//! innovations. The motion calibration uses them.

pub use super::consider::Window;
use super::run::Progress;
use super::{Calibration, Tracker};
use crate::config::Config;
use crate::error::{Error, Result};
use crate::model::{Model, Structure};
use crate::recording::{Gathering, Recording, Stream};
use std::sync::Arc;

/// Normal equations in windows of a recording.
#[derive(Debug, Clone)]
pub struct Score {
    /// Names of parameters: `parameters.l_b`, `back.mount_rx`, `seat.zero`, `back.delay`; and the standard deviations
    /// that are their units.
    pub parameters: Vec<(String, f64)>,
    /// Length of a row of the normal equations; entries beyond the parameters are zero.
    pub width: usize,
    /// Windows in order of time.
    pub windows: Vec<Window>,
}

/// Filters `streams` and collects the normal equations in windows of `window_s`, from `settle_s` after the start on.
pub fn score(
    model: Arc<Model>,
    streams: Vec<Stream>,
    calibration: &Calibration,
    config: &Config,
    (settle_s, window_s): (f64, f64),
    progress: Progress,
) -> Result<Score> {
    let clocks = &calibration.corrections.clocks;
    // Normal equations are those of joint angles as states.
    let config = &Config { structure: Some(Structure::Tree), ..config.clone() };
    let config = &Tracker::new(model.clone(), calibration, config)?.settle(&streams, clocks, config)?;
    let mut tracker = Tracker::new(model.clone(), calibration, config)?;
    let Some(considering) = &mut tracker.considering else {
        return Err(Error::Data(format!(
            "model '{}': no mount, length or encoder zero is uncertain, so there is nothing to score; give them standard \
             deviations",
            model.name
        )));
    };
    considering.keep_score(&tracker.subject.body, settle_s, window_s);
    tracker.filter.leave_covariance_form(); // It has no factor of S.
    let body = tracker.body();
    let recording = Recording::new(&body.model, &body.suite, streams, clocks, Gathering::of(config))?;
    let Some((begin, end)) = recording.span_s() else {
        return Err(Error::Data("the recording contains no rows: nothing to track; check the streams".into()));
    };
    let (mut cursor, mut sample, mut count) = (recording.start(), tracker.empty_sample(), 0_usize);
    while recording.next(&mut cursor, &mut sample) {
        tracker.step(&sample)?;
        count += 1;
        if count.is_multiple_of(64) && !progress((sample.time_s - begin) / (end - begin)) {
            return Err(Error::Stopped);
        }
    }
    let (parameters, windows) = tracker.considering.as_mut().map_or_else(Default::default, |c| c.score());
    let width = windows.first().map_or(0, |w| w.right.len());
    Ok(Score { parameters, width, windows })
}
