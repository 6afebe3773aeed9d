//! Borrows numpy arrays without a copy. A recording's arrays are backed by `bytes`, which are immutable.

use crate::array::{reals, Any};
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use oarlock::recording::column::{Column, Lender};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;

const WIDTH: usize = size_of::<f64>();

/// Doubles in C order owned by a Python object, which is kept alive.
#[derive(Debug)]
struct Lent(PyBackedBytes);

impl Lender for Lent {
    fn count(&self) -> usize {
        self.0.len() / WIDTH
    }

    fn read(&self, first: usize, to: &mut [f64]) {
        let (numbers, _) = self.0.as_chunks::<WIDTH>();
        let from = &numbers[first..first + to.len()];
        to.iter_mut().zip(from).for_each(|(to, &bytes)| *to = f64::from_ne_bytes(bytes));
    }
}

/// The numbers of any real array with its shape; copied unless the array is backed by `bytes`; `name` is for the error.
pub fn column(value: &Any<'_>, name: &str) -> PyResult<(Column, Vec<usize>)> {
    if let Some((bytes, shape)) = bytes_below(value)? {
        return Ok((Column::lent(Lent(bytes.into())), shape));
    }
    let array = reals(value, name)?;
    Ok((array.values.into(), array.shape))
}

/// The `bytes` object that backs a whole array of doubles in C order, and the array's shape.
fn bytes_below<'py>(value: &Any<'py>) -> PyResult<Option<(Bound<'py, PyBytes>, Vec<usize>)>> {
    let Ok(array) = value.cast::<PyArrayDyn<f64>>() else { return Ok(None) };
    let (shape, whole) = (array.shape().to_vec(), WIDTH * array.len());
    let mut base = value.getattr("base")?;
    while let Some(below) = base.getattr_opt("base")? {
        base = below;
    }
    let bytes = base.cast_into::<PyBytes>().ok();
    let bytes = bytes.filter(|bytes| array.is_c_contiguous() && bytes.as_bytes().len() == whole);
    Ok(bytes.map(|bytes| (bytes, shape)))
}
