//! The one gate for arrays: real numbers of any width and layout come in as doubles, anything else is named and refused.

use crate::errors::DataError;
use numpy::{PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// Doubles in C order, with their shape.
pub struct Reals {
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// Reads any real array; `name` is for the error.
pub fn reals(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Reals> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let refuse = |what: String| DataError::new_err(format!("{name}: {what}; expected an array of real numbers"));
    let array = numpy.call_method1("asarray", (value,)).map_err(|e| refuse(e.to_string()))?;
    let dtype = array.getattr("dtype")?;
    let (kind, size): (String, usize) = (dtype.getattr("kind")?.extract()?, dtype.getattr("itemsize")?.extract()?);
    if !matches!(kind.as_str(), "b" | "i" | "u" | "f") || size > 8 {
        return Err(refuse(format!("holds {dtype}")));
    }
    let array = numpy.call_method1("ascontiguousarray", (array, "float64"))?;
    let array = array.cast_into::<PyArrayDyn<f64>>().map_err(|_| refuse("is no array".into()))?;
    let shape = array.shape().to_vec();
    Ok(Reals { shape, values: array.to_vec().map_err(|_| refuse("is not contiguous".into()))? })
}

/// Reads an array whose last axes must be `tail`; gives the number of such items.
pub fn items(value: &Bound<'_, PyAny>, name: &str, tail: &[usize]) -> PyResult<(Reals, usize)> {
    let array = reals(value, name)?;
    let lead = array.shape.len().checked_sub(tail.len());
    match lead {
        Some(lead) if array.shape[lead..] == *tail => {
            let count = array.shape[..lead].iter().product();
            Ok((array, count))
        }
        _ => Err(DataError::new_err(format!(
            "{name}: has shape {:?}; expected (..., {})",
            array.shape,
            tail.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
        ))),
    }
}
