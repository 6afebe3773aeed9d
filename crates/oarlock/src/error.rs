//! The three ways in which a request can fail.

use thiserror::Error;

/// Why a request could not be carried out.
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
        /// When, on the recording's clock.
        time_s: f64,
        /// What happened and what to try.
        text: String,
    },
    /// Whoever asked for the work asked to stop it.
    #[error("stopped on request")]
    Stopped,
}

/// The crate's result.
pub type Result<T> = std::result::Result<T, Error>;
