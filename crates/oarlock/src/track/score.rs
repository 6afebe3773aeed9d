//! Scores a recording: normal equations of mounts, lengths, sensor positions, encoder zeros and clock delays from
//! innovations. The search for clocks uses them.

mod delays;
mod mount_axes;
mod normal_equations;
mod parameters;
mod scoring;

use super::run::Progress;
use super::{mount_values, Calibration, Tracker};
use crate::config::{Config, FilterKind};
use crate::error::{Error, Result};
use crate::model::{Model, Structure};
use crate::recording::{Gathering, Recording, Stream};
pub use normal_equations::Window;
pub(super) use scoring::Scoring;
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

/// Filters `streams` and collects the normal equations in windows of `window_s`, from `settle_s` after the start on. Whatever `config` says,
/// joint angles are the states and the filter is extended.
pub fn score(
    model: Arc<Model>,
    streams: Vec<Stream>,
    calibration: &Calibration,
    config: &Config,
    (settle_s, window_s): (f64, f64),
    progress: Progress,
) -> Result<Score> {
    let clocks = &calibration.corrections.clocks;
    let config = &Config { structure: Some(Structure::Tree), filter: FilterKind::Ekf, ..config.clone() };
    let config = &Tracker::new(model.clone(), calibration, config)?.settle(&streams, clocks, config)?;
    let mut tracker = Tracker::new(model, calibration, config)?;
    tracker.keep_score(calibration, (settle_s, window_s))?;
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
    let (parameters, windows) = tracker.scoring.map_or_else(Default::default, |scoring| scoring.finish());
    let width = windows.first().map_or(0, |w| w.right.len());
    Ok(Score { parameters, width, windows })
}

impl Tracker {
    /// From now on collects normal equations. The filter must be extended.
    #[doc(hidden)]
    pub fn keep_score(&mut self, calibration: &Calibration, span_s: (f64, f64)) -> Result<()> {
        let body = &self.subject.body;
        let mounts = mount_values(&body.model, &calibration.mounts)?;
        let scoring = Scoring::new(body, &mounts, calibration, &self.config, span_s)?.ok_or_else(|| {
            Error::Data(format!(
                "model '{}': no mount, length or encoder zero is uncertain, so there is nothing to score; give them standard \
                 deviations",
                body.model.name
            ))
        })?;
        self.scoring = Some(Box::new(scoring));
        Ok(())
    }
}
