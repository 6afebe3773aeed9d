//! Functions `read_parquet` and `write_parquet` of the module: tables of recordings and tracks.

use crate::errors::{unwritten, DataError};
use crate::parquet_bounds::{check_footer, check_pages};
use crate::table::{columns_of, Column, Words};
use bytes::Bytes;
use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnDescriptor, ColumnPath, SchemaDescriptor, Type};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyDict;
use std::cell::Cell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs::File;
use std::io::BufWriter;
use std::panic::{catch_unwind, set_hook, take_hook, AssertUnwindSafe};
use std::path::PathBuf;
use std::sync::{Arc, Once};

/// Records that are decoded before the bound on the number of values is checked again.
const BATCH: usize = 1 << 16;
/// Rows of a row group, as of pyarrow.
const GROUP_ROWS: usize = 1 << 20;
/// Values of a column that decide whether it gets a dictionary.
const SAMPLE: usize = 4096;

type Found = (Vec<(String, Column)>, BTreeMap<String, String>);

/// Columns by name, and the texts of the file's metadata. Missing numbers are NaN; lists of one length are (T, N).
///
/// # Errors
///
/// ValueError: the contents are no Parquet, are damaged, have more than `most_values` values, or a column is of a type
/// that no table of Oarlock has. Columns of lists are left out if `without_lists`.
#[pyfunction]
#[pyo3(signature = (contents, most_values, without_lists = false))]
pub fn read_parquet<'py>(
    py: Python<'py>,
    contents: PyBackedBytes,
    most_values: usize,
    without_lists: bool,
) -> PyResult<(Bound<'py, PyDict>, BTreeMap<String, String>)> {
    let contents = Bytes::from_owner(contents);
    let read = py.detach(|| without_a_word(|| read(contents, most_values, without_lists)));
    let (table, about) = match read {
        Ok(Ok(found)) => found,
        Ok(Err(error)) => return Err(refusal(&error)),
        Err(_) => return Err(refusal(&general("a length or a place is damaged"))),
    };
    let columns = PyDict::new(py);
    for (name, column) in table {
        columns.set_item(name, column.into_python(py)?)?;
    }
    Ok((columns, about))
}

thread_local! {
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs what panics on damaged files: in a few places the library takes what a file states for true.
fn without_a_word<T>(run: impl FnOnce() -> T) -> std::thread::Result<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| {
            if !QUIET.get() {
                usual(panic);
            }
        }));
    });
    QUIET.set(true);
    let done = catch_unwind(AssertUnwindSafe(run));
    QUIET.set(false);
    done
}

fn refusal(error: &ParquetError) -> PyErr {
    if matches!(error, ParquetError::General(text) if text == TOO_MANY) {
        return pyo3::exceptions::PyOverflowError::new_err(TOO_MANY);
    }
    let text = match error {
        ParquetError::General(text) | ParquetError::NYI(text) | ParquetError::EOF(text) => text.clone(),
        other => other.to_string(),
    };
    pyo3::exceptions::PyValueError::new_err(text)
}

fn general(text: impl Into<String>) -> ParquetError {
    ParquetError::General(text.into())
}

fn read(contents: Bytes, most_values: usize, without_lists: bool) -> Result<Found, ParquetError> {
    check_footer(&contents)?;
    let file = SerializedFileReader::new(contents.clone())?;
    let about = file.metadata().file_metadata();
    let schema = about.schema_descr();
    let mut left = most_values;
    let mut table = Vec::new();
    let fields = schema.root_schema().get_fields();
    let mut leaves = vec![Vec::new(); fields.len()];
    for leaf in 0..schema.num_columns() {
        leaves[schema.get_column_root_idx(leaf)].push(leaf);
    }
    for (field, leaves) in fields.iter().zip(leaves) {
        if without_lists && !field.is_primitive() {
            continue;
        }
        table.push((field.name().to_owned(), read_column(&file, &contents, schema, &leaves, &mut left)?));
    }
    let rows = table.first().map(|(_, column): &(String, Column)| column.rows());
    if table.iter().any(|(_, column)| Some(column.rows()) != rows) {
        return Err(general("its columns have different numbers of rows"));
    }
    let texts = about.key_value_metadata().into_iter().flatten();
    Ok((table, texts.map(|pair| (pair.key.clone(), pair.value.clone().unwrap_or_default())).collect()))
}

fn read_column(
    file: &SerializedFileReader<Bytes>,
    contents: &[u8],
    schema: &SchemaDescriptor,
    leaves: &[usize],
    left: &mut usize,
) -> Result<Column, ParquetError> {
    let &[leaf] = leaves else {
        return Err(general("a column of structures or maps, which no recording has"));
    };
    let descriptor = schema.column(leaf);
    if descriptor.max_rep_level() > 1 {
        return Err(general("a column of lists of lists, which no recording has"));
    }
    let mut parts = Parts::of(&descriptor)?;
    for group in 0..file.num_row_groups() {
        let group = file.get_row_group(group)?;
        let chunk = group.metadata().columns().get(leaf).ok_or_else(|| general("a part of the rows lacks a column"))?;
        let begin = chunk.dictionary_page_offset().unwrap_or_else(|| chunk.data_page_offset());
        check_pages(contents, begin, chunk.compressed_size())?;
        parts.read(group.get_column_reader(leaf)?, &descriptor, left)?;
    }
    parts.into_column()
}

/// What a column consists of while it is read.
enum Parts {
    Real { values: Vec<f64>, lists: Option<ListLengths> },
    Whole { values: Vec<i64>, rows: Vec<bool>, unsigned: bool },
    Flag { values: Vec<bool>, rows: Vec<bool> },
    Text { places: Vec<i32>, words: Words },
}

impl Parts {
    fn of(descriptor: &ColumnDescriptor) -> Result<Parts, ParquetError> {
        let is_list = descriptor.max_rep_level() == 1;
        let unsigned = match (descriptor.logical_type_ref(), descriptor.converted_type()) {
            (Some(LogicalType::Integer(kind)), _) => Some(!kind.is_signed),
            (None | Some(LogicalType::String), ConvertedType::NONE | ConvertedType::UTF8) => Some(false),
            (None, ConvertedType::INT_8 | ConvertedType::INT_16 | ConvertedType::INT_32 | ConvertedType::INT_64) => {
                Some(false)
            }
            (
                None,
                ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32 | ConvertedType::UINT_64,
            ) => Some(true),
            _ => None,
        };
        Ok(match (descriptor.physical_type(), unsigned) {
            (Physical::DOUBLE | Physical::FLOAT, Some(_)) => {
                Parts::Real { values: Vec::new(), lists: is_list.then(ListLengths::default) }
            }
            (Physical::INT32 | Physical::INT64, Some(unsigned)) if !is_list => {
                Parts::Whole { values: Vec::new(), rows: Vec::new(), unsigned }
            }
            (Physical::BOOLEAN, Some(_)) if !is_list => Parts::Flag { values: Vec::new(), rows: Vec::new() },
            (Physical::BYTE_ARRAY, Some(_)) if !is_list => Parts::Text { places: Vec::new(), words: Words::default() },
            (physical, _) => {
                let logical = descriptor.logical_type_ref().map_or(String::new(), |kind| format!(" ({kind:?})"));
                let list = if is_list { "lists of " } else { "" };
                let name = descriptor.path().string();
                return Err(general(format!(
                    "column \"{name}\" is of type {list}{physical}{logical}; expected numbers or texts"
                )));
            }
        })
    }

    fn read(
        &mut self,
        reader: ColumnReader,
        descriptor: &ColumnDescriptor,
        left: &mut usize,
    ) -> Result<(), ParquetError> {
        match (self, reader) {
            (Parts::Real { values, lists: Some(lists) }, ColumnReader::DoubleColumnReader(r)) => {
                batches(r, descriptor, left, |batch: Batch<'_, f64>| lists.take(&batch, values, |v| *v))
            }
            (Parts::Real { values, lists: Some(lists) }, ColumnReader::FloatColumnReader(r)) => {
                batches(r, descriptor, left, |batch: Batch<'_, f32>| lists.take(&batch, values, |v| f64::from(*v)))
            }
            (Parts::Real { values, .. }, ColumnReader::DoubleColumnReader(r)) => {
                batches(r, descriptor, left, |batch: Batch<'_, f64>| {
                    batch.each(|value| values.push(value.copied().unwrap_or(f64::NAN)));
                    Ok(())
                })
            }
            (Parts::Real { values, .. }, ColumnReader::FloatColumnReader(r)) => {
                batches(r, descriptor, left, |batch: Batch<'_, f32>| {
                    batch.each(|value| values.push(value.map_or(f64::NAN, |v| f64::from(*v))));
                    Ok(())
                })
            }
            (Parts::Whole { values, rows, unsigned }, ColumnReader::Int32ColumnReader(r)) => {
                batches(r, descriptor, left, |batch: Batch<'_, i32>| {
                    batch.each(|value| {
                        let value = value.copied();
                        rows.push(value.is_some());
                        let plain = value.unwrap_or(0);
                        values.push(if *unsigned { i64::from(plain.cast_unsigned()) } else { i64::from(plain) });
                    });
                    Ok(())
                })
            }
            (Parts::Whole { values, rows, unsigned }, ColumnReader::Int64ColumnReader(r)) => {
                batches(r, descriptor, left, |batch: Batch<'_, i64>| {
                    batch.each(|value| {
                        rows.push(value.is_some());
                        values.push(value.copied().unwrap_or(0));
                    });
                    if *unsigned && values.iter().any(|&value| value < 0) {
                        return Err(general("an integer above 9223372036854775807"));
                    }
                    Ok(())
                })
            }
            (Parts::Flag { values, rows }, ColumnReader::BoolColumnReader(r)) => {
                batches(r, descriptor, left, |batch: Batch<'_, bool>| {
                    batch.each(|value| {
                        rows.push(value.is_some());
                        values.push(value.copied().unwrap_or(false));
                    });
                    Ok(())
                })
            }
            (Parts::Text { places, words }, ColumnReader::ByteArrayColumnReader(r)) => {
                batches(r, descriptor, left, |batch: Batch<'_, ByteArray>| text_places(&batch, words, places))
            }
            _ => Err(general("a column's pages have another type than its schema")),
        }
    }

    fn into_column(self) -> Result<Column, ParquetError> {
        let with_gaps = |values: Vec<f64>, rows: &[bool]| {
            Column::Real(values.into_iter().zip(rows).map(|(v, &is)| if is { v } else { f64::NAN }).collect())
        };
        Ok(match self {
            Parts::Real { values, lists: None } => Column::Real(values),
            Parts::Real { values, lists: Some(lists) } => Column::Wide { width: lists.width(values.len())?, values },
            Parts::Whole { values, rows, .. } if rows.iter().all(|&is| is) => Column::Whole(values),
            #[allow(clippy::cast_precision_loss)]
            Parts::Whole { values, rows, .. } => with_gaps(values.iter().map(|&v| v as f64).collect(), &rows),
            Parts::Flag { values, rows } if rows.iter().all(|&is| is) => Column::Flag(values),
            Parts::Flag { values, rows } => with_gaps(values.iter().map(|&v| f64::from(u8::from(v))).collect(), &rows),
            Parts::Text { places, words } => Column::Text { places, words: words.into_words() },
        })
    }
}

/// Values that are there, and the levels that say where.
struct Batch<'a, T> {
    values: &'a [T],
    definitions: &'a [i16],
    repetitions: &'a [i16],
    most: i16,
}

impl<T> Batch<'_, T> {
    /// Calls `row` with each row's value, None where it is missing.
    fn each(&self, mut row: impl FnMut(Option<&T>)) {
        if self.definitions.is_empty() {
            return self.values.iter().for_each(|value| row(Some(value)));
        }
        let mut values = self.values.iter();
        for &level in self.definitions {
            row(if level == self.most { values.next() } else { None });
        }
    }
}

fn batches<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    descriptor: &ColumnDescriptor,
    left: &mut usize,
    mut take: impl FnMut(Batch<'_, T::T>) -> Result<(), ParquetError>,
) -> Result<(), ParquetError> {
    let (mut values, mut definitions, mut repetitions) = (Vec::new(), Vec::new(), Vec::new());
    let most = descriptor.max_def_level();
    let records = if descriptor.max_rep_level() > 0 { BATCH >> 8 } else { BATCH };
    loop {
        values.clear();
        definitions.clear();
        repetitions.clear();
        let (_, _, levels) =
            reader.read_records(records, Some(&mut definitions), Some(&mut repetitions), &mut values)?;
        if levels == 0 {
            return Ok(());
        }
        *left = left.checked_sub(levels).ok_or_else(|| general(TOO_MANY))?;
        take(Batch { values: &values, definitions: &definitions, repetitions: &repetitions, most })?;
    }
}

/// The text of the error that the package explains.
const TOO_MANY: &str = "more values than the size of the file allows";

/// Lengths of a column's lists; all must be the same.
#[derive(Default)]
struct ListLengths {
    rows: usize,
    width: usize,
    /// Elements of the last row so far.
    open: usize,
}

impl ListLengths {
    fn take<T>(
        &mut self,
        batch: &Batch<'_, T>,
        values: &mut Vec<f64>,
        number: impl Fn(&T) -> f64,
    ) -> Result<(), ParquetError> {
        if batch.definitions.len() != batch.repetitions.len() || batch.definitions.iter().any(|&l| l < batch.most - 1) {
            return Err(general(UNEQUAL));
        }
        for &level in batch.repetitions {
            if level == 0 {
                self.close()?;
                self.rows += 1;
                self.open = 0;
            }
            self.open += 1;
        }
        batch.each(|value| values.push(value.map_or(f64::NAN, &number)));
        Ok(())
    }

    fn close(&mut self) -> Result<(), ParquetError> {
        if self.rows == 1 {
            self.width = self.open;
        }
        if self.rows > 0 && self.open != self.width {
            return Err(general(UNEQUAL));
        }
        Ok(())
    }

    fn width(mut self, count: usize) -> Result<usize, ParquetError> {
        self.close()?;
        if self.rows * self.width != count {
            return Err(general(UNEQUAL));
        }
        Ok(self.width.max(1))
    }
}

const UNEQUAL: &str = "a column of lists of different lengths, which no recording has";

fn text_places(batch: &Batch<'_, ByteArray>, words: &mut Words, places: &mut Vec<i32>) -> Result<(), ParquetError> {
    // Texts of a dictionary page share their bytes: each is compared once, however often it is repeated.
    let mut known: HashMap<(*const u8, usize), i32> = HashMap::new();
    let mut damaged = false;
    batch.each(|value| {
        let Some(value) = value else { return places.push(-1) };
        let bytes = value.data();
        let place = known.entry((bytes.as_ptr(), bytes.len())).or_insert_with(|| match std::str::from_utf8(bytes) {
            Ok(text) => words.place(text),
            Err(_) => {
                damaged = true;
                -1
            }
        });
        places.push(*place);
    });
    if damaged {
        return Err(general("a text that is no UTF-8"));
    }
    Ok(())
}

/// Writes columns as Parquet with Snappy. Texts are stored once; arrays (T, N) are lists.
///
/// # Errors
///
/// DataError: the columns have different numbers of rows. OSError: the file cannot be written.
#[pyfunction]
#[pyo3(signature = (file, columns, about = BTreeMap::new()))]
pub fn write_parquet(
    py: Python<'_>,
    file: PathBuf,
    columns: &Bound<'_, PyDict>,
    about: BTreeMap<String, String>,
) -> PyResult<()> {
    let table = columns_of(columns)?;
    py.detach(|| write(&file, &table, about)).map_err(|error| {
        let cause = match &error {
            ParquetError::External(cause) => cause.downcast_ref::<std::io::Error>(),
            _ => None,
        };
        match cause {
            Some(cause) => unwritten(cause, &file),
            None => DataError::new_err(format!("{}: cannot be written ({error})", file.display())),
        }
    })
}

fn write(file: &PathBuf, table: &[(String, Column)], about: BTreeMap<String, String>) -> Result<(), ParquetError> {
    let fields = table.iter().map(|(name, column)| field(name, column).map(Arc::new)).collect::<Result<_, _>>()?;
    let schema = Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?);
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_dictionary_enabled(false)
        .set_key_value_metadata(Some(about.into_iter().map(|(key, text)| KeyValue::new(key, text)).collect()));
    for (name, column) in table {
        if repeats(column) {
            properties = properties.set_column_dictionary_enabled(ColumnPath::new(vec![name.clone()]), true);
        }
    }
    let out = BufWriter::new(File::create(file)?);
    let mut writer = SerializedFileWriter::new(out, schema, Arc::new(properties.build()))?;
    let rows = table.first().map_or(0, |(_, column)| column.rows());
    for first in (0..rows).step_by(GROUP_ROWS) {
        let mut group = writer.next_row_group()?;
        let last = rows.min(first + GROUP_ROWS);
        for (_, column) in table {
            let Some(mut one) = group.next_column()? else { break };
            write_rows(one.untyped(), column, first, last)?;
            one.close()?;
        }
        group.close()?;
    }
    writer.close()?;
    Ok(())
}

/// Whether values recur, as those of converters do, so that a dictionary makes the file smaller.
fn repeats(column: &Column) -> bool {
    match column {
        Column::Real(values) => {
            let sample = values.iter().step_by(values.len() / SAMPLE + 1);
            let count = sample.len();
            sample.map(|value| value.to_bits()).collect::<HashSet<_>>().len() * 10 < count * 9
        }
        Column::Whole(_) | Column::Text { .. } => true,
        Column::Flag(_) | Column::Wide { .. } => false,
    }
}

fn field(name: &str, column: &Column) -> Result<Type, ParquetError> {
    let physical = match column {
        Column::Real(_) | Column::Wide { .. } => Physical::DOUBLE,
        Column::Whole(_) => Physical::INT64,
        Column::Flag(_) => Physical::BOOLEAN,
        Column::Text { .. } => Physical::BYTE_ARRAY,
    };
    let leaf = |name| Type::primitive_type_builder(name, physical);
    match column {
        Column::Wide { .. } => {
            let element = leaf("element").with_repetition(Repetition::REQUIRED).build()?;
            let list = Type::group_type_builder("list")
                .with_repetition(Repetition::REPEATED)
                .with_fields(vec![Arc::new(element)])
                .build()?;
            Type::group_type_builder(name)
                .with_repetition(Repetition::REQUIRED)
                .with_logical_type(Some(LogicalType::List))
                .with_fields(vec![Arc::new(list)])
                .build()
        }
        Column::Text { .. } => {
            leaf(name).with_repetition(Repetition::OPTIONAL).with_logical_type(Some(LogicalType::String)).build()
        }
        _ => leaf(name).with_repetition(Repetition::REQUIRED).build(),
    }
}

fn write_rows(writer: &mut ColumnWriter<'_>, column: &Column, first: usize, last: usize) -> Result<(), ParquetError> {
    match (writer, column) {
        (ColumnWriter::DoubleColumnWriter(w), Column::Real(v)) => w.write_batch(&v[first..last], None, None)?,
        (ColumnWriter::Int64ColumnWriter(w), Column::Whole(v)) => w.write_batch(&v[first..last], None, None)?,
        (ColumnWriter::BoolColumnWriter(w), Column::Flag(v)) => w.write_batch(&v[first..last], None, None)?,
        (ColumnWriter::DoubleColumnWriter(w), Column::Wide { values, width }) => {
            let repetitions: Vec<i16> = (0..*width).map(|i| i16::from(i > 0)).collect();
            let definitions = vec![1; *width];
            for row in values[first * width..last * width].chunks(*width) {
                w.write_batch(row, Some(&definitions), Some(&repetitions))?;
            }
            0
        }
        (ColumnWriter::ByteArrayColumnWriter(w), Column::Text { places, words }) => {
            let words: Vec<ByteArray> = words.iter().map(|word| word.as_str().into()).collect();
            let there = places[first..last].iter().filter_map(|&place| usize::try_from(place).ok());
            let values: Vec<ByteArray> = there.map(|place| words[place].clone()).collect();
            let levels: Vec<i16> = places[first..last].iter().map(|&place| i16::from(place >= 0)).collect();
            w.write_batch(&values, Some(&levels), None)?
        }
        _ => return Err(general("a column has another type than its schema")),
    };
    Ok(())
}
