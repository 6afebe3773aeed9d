//! Converts the engine's errors to Python exceptions.

use oarlock::Error;
use pyo3::exceptions::{PyKeyboardInterrupt, PyOSError};
use pyo3::import_exception;
use pyo3::prelude::*;
use std::io;
use std::path::Path;

import_exception!(oarlock.storage.errors, ModelError);
import_exception!(oarlock.storage.errors, DataError);
import_exception!(oarlock.storage.errors, DivergedError);

/// The only mapping from engine errors to exceptions.
pub fn raise(py: Python<'_>, error: Error) -> PyErr {
    match error {
        Error::Model(text) => ModelError::new_err(text),
        Error::Data(text) => DataError::new_err(text),
        Error::Diverged { time_s, text } => {
            let e = DivergedError::new_err(text);
            match e.value(py).setattr("time_s", time_s) {
                Ok(()) => e,
                Err(other) => other,
            }
        }
        Error::Stopped => PyKeyboardInterrupt::new_err("stopped"),
    }
}

/// An OSError with number, text and file, as Python's own functions raise it.
pub fn unwritten(error: &io::Error, file: &Path) -> PyErr {
    let text = error.to_string();
    let text = text.split(" (os error").next().unwrap_or_default().to_owned();
    match error.raw_os_error() {
        Some(code) => PyOSError::new_err((code, text, file.to_path_buf())),
        None => PyOSError::new_err(text),
    }
}
