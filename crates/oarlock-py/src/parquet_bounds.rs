//! Bounds on the lengths that a Parquet file states: the library reserves memory by them before it reads. Used by
//! `parquet`.

use parquet::errors::{ParquetError, Result};

/// Bytes behind the footer: its length, and the mark of the format.
const TAIL: usize = 8;
/// Snappy makes at most 64 bytes of 3.
const MOST_EXPANSION: i64 = 64;
/// Pages of so many bytes are read whatever their compressed size.
const ALWAYS_BYTES: i64 = 1 << 16;
const DEEPEST: usize = 16;

/// Checks the footer of a file.
///
/// # Errors
///
/// It is longer than the file, or states a length that is.
pub fn check_footer(contents: &[u8]) -> Result<()> {
    let Some((rest, tail)) = contents.split_last_chunk::<TAIL>() else {
        return Err(damaged("it is too short"));
    };
    let length = u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]);
    let begin = rest.len().checked_sub(length as usize);
    let begin = begin.ok_or_else(|| damaged("its footer is longer than the file"))?;
    // The children of an element of the schema.
    Thrift(&rest[begin..]).fields(&mut Vec::new(), &mut |path, value| match path {
        [2, 5] if value > i64::from(length) => Err(damaged("its schema has more columns than its footer has bytes")),
        _ => Ok(()),
    })
}

/// Checks the headers of all pages of a part of a column.
///
/// # Errors
///
/// One is damaged, or states a size that it cannot have.
pub fn check_pages(contents: &[u8], begin: i64, length: i64) -> Result<()> {
    let pages = usize::try_from(begin).ok().zip(usize::try_from(length).ok());
    let pages = pages.and_then(|(begin, length)| contents.get(begin..)?.get(..length));
    let mut rest = pages.ok_or_else(|| damaged("a column lies outside of the file"))?;
    while !rest.is_empty() {
        let (mut whole, mut packed, mut words) = (0, 0, 0);
        let mut header = Thrift(rest);
        header.fields(&mut Vec::new(), &mut |path, value| {
            match path {
                [2] => whole = value,
                [3] => packed = value,
                [7, 1] => words = value,
                _ => {}
            }
            Ok(())
        })?;
        let size = usize::try_from(packed).ok();
        rest = size.and_then(|size| header.0.get(size..)).ok_or_else(|| damaged("a page is cut off"))?;
        if whole > ALWAYS_BYTES + MOST_EXPANSION * packed || words > whole {
            return Err(damaged("a page states a size that it cannot have"));
        }
    }
    Ok(())
}

fn damaged(text: &str) -> ParquetError {
    ParquetError::General(text.to_owned())
}

/// Thrift's compact protocol, as far as to find integers and to bound lengths.
struct Thrift<'a>(&'a [u8]);

type Visit<'v> = &'v mut dyn FnMut(&[i64], i64) -> Result<()>;

impl Thrift<'_> {
    /// Calls `visit` with each integer of a structure and the numbers of the fields that it is in.
    fn fields(&mut self, path: &mut Vec<i64>, visit: Visit<'_>) -> Result<()> {
        if path.len() > DEEPEST {
            return Err(damaged("its header is nested too deeply"));
        }
        let mut number = 0;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Ok(());
            }
            number = if head >> 4 == 0 { self.integer()? } else { number + i64::from(head >> 4) };
            path.push(number);
            // A field of a truth value has its value in its type.
            if head & 15 > 2 {
                self.value(head & 15, path, visit)?;
            }
            path.pop();
        }
    }

    fn value(&mut self, kind: u8, path: &mut Vec<i64>, visit: Visit<'_>) -> Result<()> {
        match kind {
            1..=3 => self.skip(1),
            4..=6 => {
                let value = self.integer()?;
                visit(path, value)
            }
            7 => self.skip(8),
            8 => {
                let length = self.unsigned()?;
                self.skip(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.unsigned()? } else { u64::from(head >> 4) };
                (0..count).try_for_each(|_| self.value(head & 15, path, visit))
            }
            12 => self.fields(path, visit),
            _ => Err(damaged("its header has a field of an unknown type")),
        }
    }

    fn byte(&mut self) -> Result<u8> {
        let (&first, rest) = self.0.split_first().ok_or_else(|| damaged("its header ends too early"))?;
        self.0 = rest;
        Ok(first)
    }

    fn skip(&mut self, count: u64) -> Result<()> {
        let count = usize::try_from(count)?;
        self.0 = self.0.get(count..).ok_or_else(|| damaged("its header states a length beyond its end"))?;
        Ok(())
    }

    fn unsigned(&mut self) -> Result<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 127) << shift;
            if byte < 128 {
                return Ok(value);
            }
        }
        Err(damaged("its header has an integer of too many bytes"))
    }

    fn integer(&mut self) -> Result<i64> {
        let value = self.unsigned()?;
        Ok((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }
}
