//! Rows on their way to the program that writes Parquet.
//!
//! A line names this form, and a line of JSON the columns. Each part is the byte 1, its number of rows, and the values of one
//! column after the other. The byte 0 ends the rows: without it their sender died, and the file must not look whole.

use std::io::{self, BufRead, ErrorKind, Read, Write};

use crate::table::{Column, Table, Values};

/// Another build may have another form.
const FORM: &[u8; 22] = b"rows of masseter, v. 1";
const PART: [u8; 1] = [1];
const END: [u8; 1] = [0];

/// Writes the columns of a table, and none of its rows.
pub(crate) fn send_columns(table: &Table, to: &mut impl Write) -> io::Result<()> {
    let mut empty = table.clone();
    empty.clear();
    to.write_all(FORM)?;
    serde_json::to_writer(&mut *to, empty.columns())?;
    to.write_all(b"\n")
}

/// Writes all rows of a table as a part.
pub(crate) fn send_part(table: &Table, to: &mut impl Write) -> io::Result<()> {
    to.write_all(&PART)?;
    to.write_all(&(table.rows() as u64).to_le_bytes())?;
    table.columns().iter().try_for_each(|column| send_values(&column.values, to))
}

/// Ends the rows.
pub(crate) fn send_end(to: &mut impl Write) -> io::Result<()> {
    to.write_all(&END)
}

/// The rows of a table, part by part, as they come from a program that writes with
/// [`TableWriter`](crate::TableWriter).
#[derive(Debug)]
pub struct Rows<R> {
    from: R,
    part: Table,
}

impl<R: BufRead> Rows<R> {
    /// Reads the columns.
    ///
    /// # Errors
    /// Those of reading; [`ErrorKind::InvalidData`] where these are no rows, or those of another build.
    pub fn new(mut from: R) -> io::Result<Self> {
        if bytes(&mut from)? != *FORM {
            return Err(ErrorKind::InvalidData.into());
        }
        let mut line = String::new();
        from.read_line(&mut line)?;
        let columns: Vec<Column> = serde_json::from_str(&line)?;
        Ok(Self { from, part: Table::new(columns) })
    }

    /// The columns, without rows until [`Self::next_part`] reads some.
    pub fn columns(&self) -> &[Column] {
        self.part.columns()
    }

    /// The rows of the next part; none after the last one.
    ///
    /// # Errors
    /// Those of reading; [`ErrorKind::UnexpectedEof`] where the sender has not ended the rows.
    pub fn next_part(&mut self) -> io::Result<Option<&Table>> {
        match bytes(&mut self.from)? {
            END => return Ok(None),
            PART => {}
            _ => return Err(ErrorKind::InvalidData.into()),
        }
        let count = u64::from_le_bytes(bytes(&mut self.from)?);
        self.part.clear();
        self.part.values_mut().try_for_each(|values| receive_values(values, count, &mut self.from))?;
        Ok(Some(&self.part))
    }
}

/// Writes each value as a byte that says whether there is one, and the value, little-endian; a text after its length.
fn send_values(values: &Values, to: &mut impl Write) -> io::Result<()> {
    match values {
        Values::Numbers(values) => send(values, to, |value, to| to.write_all(&value.to_le_bytes())),
        Values::Whole(values) => send(values, to, |value, to| to.write_all(&value.to_le_bytes())),
        Values::Words(values) => send(values, to, |value, to| {
            to.write_all(&(value.len() as u64).to_le_bytes())?;
            to.write_all(value.as_bytes())
        }),
        Values::Truths(values) => send(values, to, |value, to| to.write_all(&[u8::from(*value)])),
    }
}

/// Adds so many values, bit by bit as [`send_values`] wrote them.
fn receive_values(values: &mut Values, count: u64, from: &mut impl Read) -> io::Result<()> {
    match values {
        Values::Numbers(values) => receive(values, count, from, |from| Ok(f64::from_le_bytes(bytes(from)?))),
        Values::Whole(values) => receive(values, count, from, |from| Ok(i64::from_le_bytes(bytes(from)?))),
        Values::Words(values) => receive(values, count, from, |from| {
            let length = u64::from_le_bytes(bytes(from)?);
            let mut text = String::new();
            from.take(length).read_to_string(&mut text)?;
            if text.len() as u64 != length {
                return Err(ErrorKind::UnexpectedEof.into());
            }
            Ok(text)
        }),
        Values::Truths(values) => receive(values, count, from, |from| Ok(bytes(from)? == [1])),
    }
}

fn send<T, W: Write>(
    values: &[Option<T>],
    to: &mut W,
    write: impl Fn(&T, &mut W) -> io::Result<()>,
) -> io::Result<()> {
    for value in values {
        to.write_all(&[u8::from(value.is_some())])?;
        value.as_ref().map_or(Ok(()), |value| write(value, to))?;
    }
    Ok(())
}

fn receive<T, R: Read>(
    values: &mut Vec<Option<T>>,
    count: u64,
    from: &mut R,
    read: impl Fn(&mut R) -> io::Result<T>,
) -> io::Result<()> {
    for _ in 0..count {
        let is_there = bytes(from)? == [1];
        values.push(is_there.then(|| read(from)).transpose()?);
    }
    Ok(())
}

/// The next bytes, as many as the type has.
fn bytes<const COUNT: usize>(from: &mut impl Read) -> io::Result<[u8; COUNT]> {
    let mut bytes = [0; COUNT];
    from.read_exact(&mut bytes)?;
    Ok(bytes)
}
