//! Columns of tables between numpy and the files that `parquet` and `csv` read and write.

use crate::array::reals;
use crate::errors::DataError;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::collections::HashMap;

/// Values of one column, one for each row; texts as places in their list, -1 where there is none.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    Real(Vec<f64>),
    Whole(Vec<i64>),
    Flag(Vec<bool>),
    Text { places: Vec<i32>, words: Vec<String> },
    Wide { values: Vec<f64>, width: usize },
}

impl Column {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        match self {
            Column::Real(v) => v.len(),
            Column::Whole(v) => v.len(),
            Column::Flag(v) => v.len(),
            Column::Text { places, .. } => places.len(),
            Column::Wide { values, width } => values.len() / width,
        }
    }

    /// Arrays (T,) or (T, width); of texts the tuple (places, words).
    pub fn into_python<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(match self {
            Column::Real(v) => PyArray1::from_vec(py, v).into_any(),
            Column::Whole(v) => PyArray1::from_vec(py, v).into_any(),
            Column::Flag(v) => PyArray1::from_vec(py, v).into_any(),
            Column::Wide { values, width } => {
                let rows = values.len() / width;
                PyArray1::from_vec(py, values).reshape([rows, width])?.into_any()
            }
            Column::Text { places, words } => (PyArray1::from_vec(py, places), words).into_pyobject(py)?.into_any(),
        })
    }

    /// An array of numbers (T,) or (T, width), of truth values (T,), or a tuple (places, words).
    fn from_python(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Column> {
        if value.is_instance_of::<PyTuple>() {
            let (places, words): (Bound<'_, PyAny>, Vec<String>) = value.extract()?;
            let places: Vec<i32> = vector(&places, "int32")?;
            let last = i32::try_from(words.len()).unwrap_or(i32::MAX);
            if places.iter().any(|&place| place >= last) {
                return Err(DataError::new_err(format!("{name}: a row has a place that no text has")));
            }
            return Ok(Column::Text { places, words });
        }
        let kind: String = value.getattr("dtype")?.getattr("kind")?.extract()?;
        let shape: Vec<usize> = value.getattr("shape")?.extract()?;
        match (kind.as_str(), shape.as_slice()) {
            ("i" | "u", [_]) => Ok(Column::Whole(vector(value, "int64")?)),
            ("b", [_]) => Ok(Column::Flag(vector(value, "bool")?)),
            (_, [_]) => Ok(Column::Real(reals(value, name)?.values)),
            (_, &[_, width]) if width > 0 => Ok(Column::Wide { values: reals(value, name)?.values, width }),
            _ => Err(DataError::new_err(format!("{name}: has shape {shape:?}; expected (T,) or (T, N) with N > 0"))),
        }
    }
}

/// A numpy array as a vector of this type.
fn vector<T: numpy::Element + Copy>(value: &Bound<'_, PyAny>, dtype: &str) -> PyResult<Vec<T>> {
    let numpy = value.py().import("numpy")?;
    let array = numpy.call_method1("ascontiguousarray", (value, dtype))?.cast_into::<PyArray1<T>>()?;
    Ok(array.to_vec()?)
}

/// Columns by name, in the order of the dict.
///
/// # Errors
///
/// They have different numbers of rows, or one is no column.
pub fn columns_of(columns: &Bound<'_, PyDict>) -> PyResult<Vec<(String, Column)>> {
    let mut table: Vec<(String, Column)> = Vec::with_capacity(columns.len());
    for (name, value) in columns {
        let name: String = name.extract()?;
        let column = Column::from_python(&name, &value)?;
        if let Some((first, rows)) = table.first().map(|(first, column)| (first, column.rows())) {
            if column.rows() != rows {
                let text = format!("{name}: has {} rows, {first} has {rows}", column.rows());
                return Err(DataError::new_err(text));
            }
        }
        table.push((name, column));
    }
    Ok(table)
}

/// Texts that were met, each once.
#[derive(Default)]
pub struct Words {
    places: HashMap<String, i32>,
    words: Vec<String>,
}

impl Words {
    /// The place of a text; it is added if it is new.
    pub fn place(&mut self, text: &str) -> i32 {
        if let Some(&place) = self.places.get(text) {
            return place;
        }
        let place = i32::try_from(self.words.len()).unwrap_or(i32::MAX);
        self.places.insert(text.to_owned(), place);
        self.words.push(text.to_owned());
        place
    }

    /// All texts in the order in which they were met.
    pub fn into_words(self) -> Vec<String> {
        self.words
    }
}
