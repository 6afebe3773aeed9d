//! What a recording's innovations say of parameters that the filter takes as given: mounts, lengths, places, zeros, and clocks.

pub use super::consider::Window;
use super::run::Progress;
use super::{Calibration, Tracker};
use crate::config::Config;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::recording::{Recording, Stream};
use std::sync::Arc;

/// Normal equations in windows of a recording.
#[derive(Debug, Clone)]
pub struct Score {
    /// Parameters and the standard deviations they are counted in: `parameters.l_b`, `back.mount_rx`, `seat.zero`, `back.delay`.
    pub parameters: Vec<(String, f64)>,
    /// One row of a window's normal equations has so many numbers; those behind the parameters are nought.
    pub width: usize,
    /// In the order of time.
    pub windows: Vec<Window>,
}

/// Filters `streams` and sums up their innovations in windows of `window_s`, from `settle_s` behind the start on.
pub fn score(
    model: Arc<Model>,
    streams: Vec<Stream>,
    calibration: &Calibration,
    config: &Config,
    (settle_s, window_s): (f64, f64),
    progress: Progress,
) -> Result<Score> {
    let mut tracker = Tracker::new(model.clone(), calibration, config)?;
    let Some(considering) = &mut tracker.considering else {
        return Err(Error::Data(format!("model '{}': nothing is known only roughly", model.name)));
    };
    considering.keep_score(&tracker.subject.body, settle_s, window_s);
    let recording =
        Recording::new(&model, &tracker.body().suite, streams, &calibration.corrections.clocks, config.merge_s)?;
    let Some((begin, end)) = recording.span_s() else {
        return Err(Error::Data("the recording holds no row: nothing to track".into()));
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
