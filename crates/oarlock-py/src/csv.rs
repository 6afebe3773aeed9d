//! Functions `read_csv` and `write_csv` of the module: comma-separated tables of plain numbers, for recording folders
//! and exports.

use crate::errors::{unwritten, DataError};
use crate::table::{columns_of, Column};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

/// Numbers of this size are written without an exponent.
const PLAIN: std::ops::Range<f64> = 1e-5..1e16;

/// Columns of numbers under this header; NaN where a cell is empty, `nan` or `NaN`. None where anything else is in the
/// contents.
#[pyfunction]
pub fn read_csv<'py>(py: Python<'py>, contents: &[u8], names: Vec<String>) -> Option<Vec<Bound<'py, PyArray1<f64>>>> {
    let columns = py.detach(|| read(contents, &names))?;
    Some(columns.into_iter().map(|column| PyArray1::from_vec(py, column)).collect())
}

fn read(contents: &[u8], names: &[String]) -> Option<Vec<Vec<f64>>> {
    let text = std::str::from_utf8(contents).ok()?;
    let mut lines = text.strip_prefix('\u{feff}').unwrap_or(text).lines();
    if !lines.next()?.split(',').eq(names.iter().map(String::as_str)) {
        return None;
    }
    let mut columns = vec![Vec::new(); names.len()];
    for line in lines.filter(|line| !line.is_empty()) {
        let mut cells = line.split(',');
        for column in &mut columns {
            column.push(number(cells.next()?)?);
        }
        if cells.next().is_some() {
            return None;
        }
    }
    Some(columns)
}

fn number(cell: &str) -> Option<f64> {
    match cell.trim_matches(' ') {
        "" | "nan" | "NaN" => Some(f64::NAN),
        digits => digits.parse().ok().filter(|value: &f64| value.is_finite()),
    }
}

/// Writes columns of numbers, truth values and texts: shortest digits that give the same double, empty cells for NaN and
/// missing texts, quotes around texts.
///
/// # Errors
///
/// A column has a width, the numbers of rows differ, or the file cannot be written.
#[pyfunction]
pub fn write_csv(py: Python<'_>, file: PathBuf, columns: &Bound<'_, PyDict>) -> PyResult<()> {
    let table = columns_of(columns)?;
    if let Some((name, _)) = table.iter().find(|(_, column)| matches!(column, Column::Wide { .. })) {
        return Err(DataError::new_err(format!("{name}: has several values a row, which a CSV file does not hold")));
    }
    py.detach(|| write(&file, &table)).map_err(|error| unwritten(&error, &file))
}

fn write(file: &PathBuf, table: &[(String, Column)]) -> std::io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 18, File::create(file)?);
    let names: Vec<String> = table.iter().map(|(name, _)| quoted(name)).collect();
    writeln!(out, "{}", names.join(","))?;
    for row in 0..table.first().map_or(0, |(_, column)| column.rows()) {
        for (position, (_, column)) in table.iter().enumerate() {
            if position > 0 {
                out.write_all(b",")?;
            }
            match column {
                Column::Real(v) if v[row].is_nan() => {}
                Column::Real(v) if v[row] == 0.0 || PLAIN.contains(&v[row].abs()) => write!(out, "{}", v[row])?,
                Column::Real(v) => write!(out, "{:e}", v[row])?,
                Column::Whole(v) => write!(out, "{}", v[row])?,
                Column::Flag(v) => write!(out, "{}", v[row])?,
                Column::Text { places, words } => {
                    if let Ok(place) = usize::try_from(places[row]) {
                        out.write_all(always_quoted(&words[place]).as_bytes())?;
                    }
                }
                Column::Wide { .. } => {}
            }
        }
        out.write_all(b"\n")?;
    }
    out.flush()
}

/// A name with quotes only where it needs them.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        always_quoted(name)
    } else {
        name.to_owned()
    }
}

fn always_quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}
