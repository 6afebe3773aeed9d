//! Converts numpy arrays for the engine: real numbers of any type and layout become doubles; anything else is refused
//! with its name.

use crate::errors::DataError;
use numpy::{IxDyn, PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use oarlock::rotation::Mat3;
use pyo3::prelude::*;
use std::collections::BTreeMap;

/// Any Python object.
pub type Any<'py> = Bound<'py, PyAny>;
/// Doubles of any shape.
pub type Array<'py> = Bound<'py, PyArrayDyn<f64>>;

/// Doubles in C order, with their shape.
pub struct Reals {
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// Doubles represent every integer up to here.
const LARGEST_EXACT_INTEGER: f64 = 9_007_199_254_740_992.0;

/// Reads any real array; `name` is for the error. Masked values become NaN.
pub fn reals(value: &Any<'_>, name: &str) -> PyResult<Reals> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let refuse = |what: String| DataError::new_err(format!("{name}: {what}; expected an array of real numbers"));
    let given = numpy.call_method1("asanyarray", (value,)).map_err(|e| refuse(e.to_string()))?;
    let dtype = given.getattr("dtype")?;
    let (kind, size): (String, usize) = (dtype.getattr("kind")?.extract()?, dtype.getattr("itemsize")?.extract()?);
    if !matches!(kind.as_str(), "i" | "u" | "f") || size > 8 {
        return Err(refuse(format!("holds {dtype}")));
    }
    let seen = match given.getattr_opt("filled")? {
        Some(_) => given.call_method1("astype", ("float64",))?.call_method1("filled", (f64::NAN,))?,
        None => given.clone(),
    };
    let array = numpy.call_method1("ascontiguousarray", (seen, "float64"))?;
    let array = array.cast_into::<PyArrayDyn<f64>>().map_err(|_| refuse("is no array".into()))?;
    let shape = array.shape().to_vec();
    let values = array.to_vec().map_err(|_| refuse("is not contiguous".into()))?;
    if kind != "f" && size == 8 {
        check_exact(&given, &values, name)?;
    }
    Ok(Reals { shape, values })
}

/// Refuses integers that doubles cannot represent.
fn check_exact(given: &Any<'_>, values: &[f64], name: &str) -> PyResult<()> {
    for (i, value) in values.iter().enumerate().filter(|(_, v)| v.abs() >= LARGEST_EXACT_INTEGER) {
        let number = given.getattr("flat")?.get_item(i)?.call_method0("item")?;
        if !number.eq(value)? {
            return Err(DataError::new_err(format!(
                "{name}: {number} cannot be held exactly by float64; subtract an offset first"
            )));
        }
    }
    Ok(())
}

/// Reads an array whose last dimensions must be `tail`; returns the number of such items.
pub fn items(value: &Any<'_>, name: &str, tail: &[usize]) -> PyResult<(Reals, usize)> {
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

/// An array whose first axes are `lead` and last ones `tail`.
pub fn shaped<'py>(py: Python<'py>, values: Vec<f64>, lead: &[usize], tail: &[usize]) -> PyResult<Array<'py>> {
    PyArray1::from_vec(py, values).reshape(IxDyn(&[lead, tail].concat()))
}

/// The values of a mapping in the attribute `field`, by name; `read` takes the name too, for errors.
pub fn by_name<'py, T>(
    object: &Any<'py>,
    field: &str,
    read: impl Fn(&str, &Any<'py>) -> PyResult<T>,
) -> PyResult<BTreeMap<String, T>> {
    let one = |item: PyResult<Any<'py>>| {
        let (name, value): (String, Any<'py>) = item?.extract()?;
        let value = read(&name, &value)?;
        Ok((name, value))
    };
    object.getattr(field)?.call_method0("items")?.try_iter()?.map(one).collect()
}

/// Three numbers.
pub fn three(value: &Any<'_>, name: &str) -> PyResult<[f64; 3]> {
    let (v, _) = items(value, name, &[3])?;
    Ok([v.values[0], v.values[1], v.values[2]])
}

/// One matrix (3, 3).
pub fn matrix(value: &Any<'_>, name: &str) -> PyResult<Mat3<f64>> {
    let (nine, _) = items(value, name, &[3, 3])?;
    if nine.values.len() != 9 {
        return Err(DataError::new_err(format!("{name}: expected one matrix (3, 3)")));
    }
    Ok(matrix_of(&nine.values))
}

/// A matrix of nine numbers, row-major.
pub fn matrix_of(v: &[f64]) -> Mat3<f64> {
    Mat3([0, 3, 6].map(|i| [v[i], v[i + 1], v[i + 2]]))
}
