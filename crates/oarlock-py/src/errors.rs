//! Converts the engine's errors to Python exceptions.

use oarlock::Error;
use pyo3::create_exception;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

create_exception!(oarlock, ModelError, PyValueError, "The model file is wrong; the text says where and what to do.");
create_exception!(
    oarlock,
    DataError,
    PyValueError,
    "The data or arguments are wrong; the text says where and what to do."
);
create_exception!(oarlock, DivergedError, PyRuntimeError, "The filter lost the track; `time_s` is the time.");

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
