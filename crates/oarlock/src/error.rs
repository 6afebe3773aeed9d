//! Errors of the engine; the Python binding converts them to exceptions.

use thiserror::Error;

/// Reason of a failed call.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// The model file is wrong; the text names file, line, key and what was expected.
    #[error("{0}")]
    Model(String),
    /// The data or a call's arguments are wrong; the text names sensor, time, numbers and units.
    #[error("{0}")]
    Data(String),
    /// The filter lost the track.
    #[error("{text}")]
    Diverged {
        /// Time on the recording's clock.
        time_s: f64,
        /// Cause and remedy.
        text: String,
    },
    /// The caller stopped the work.
    #[error("stopped on request")]
    Stopped,
}

/// Result type of the crate.
pub type Result<T> = std::result::Result<T, Error>;
