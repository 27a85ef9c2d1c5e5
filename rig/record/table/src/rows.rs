//! Rows on their way to the program that writes Parquet.
//!
//! Behind the name of this form comes the table without rows, then part by part its rows: each a length of eight bytes and a
//! table in the encoding of `postcard`. The length 0 ends the rows: without it their sender died, and the file must not look
//! whole.

use std::io::{self, ErrorKind, Read, Write};

use crate::table::{Column, Table};

/// Another build may have another form.
const FORM: &[u8; 22] = b"rows of masseter, v. 2";

/// Writes the columns of a table, and none of its rows.
pub(crate) fn send_columns(table: &Table, to: &mut impl Write) -> io::Result<()> {
    let mut empty = table.clone();
    empty.clear();
    to.write_all(FORM)?;
    send_part(&empty, to)
}

/// Writes all rows of a table as a part.
pub(crate) fn send_part(table: &Table, to: &mut impl Write) -> io::Result<()> {
    let part = postcard::to_stdvec(table).map_err(io::Error::other)?;
    to.write_all(&(part.len() as u64).to_le_bytes())?;
    to.write_all(&part)
}

/// Ends the rows.
pub(crate) fn send_end(to: &mut impl Write) -> io::Result<()> {
    to.write_all(&0_u64.to_le_bytes())
}

/// The rows of a table, part by part, as they come from a program that writes with
/// [`TableWriter`](crate::TableWriter).
#[derive(Debug)]
pub struct Rows<R> {
    from: R,
    empty: Table,
}

impl<R: Read> Rows<R> {
    /// Reads the columns.
    ///
    /// # Errors
    /// Those of reading; [`ErrorKind::InvalidData`] where these are no rows, or those of another build.
    pub fn new(mut from: R) -> io::Result<Self> {
        let mut form = [0; FORM.len()];
        from.read_exact(&mut form)?;
        if form != *FORM {
            return Err(ErrorKind::InvalidData.into());
        }
        let empty = receive_part(&mut from)?.ok_or(ErrorKind::InvalidData)?;
        Ok(Self { from, empty })
    }

    /// The columns, without rows.
    pub fn columns(&self) -> &[Column] {
        self.empty.columns()
    }

    /// The rows of the next part; none after the last one.
    ///
    /// # Errors
    /// Those of reading; [`ErrorKind::UnexpectedEof`] where the sender has not ended the rows.
    pub fn next_part(&mut self) -> io::Result<Option<Table>> {
        receive_part(&mut self.from)
    }
}

fn receive_part(from: &mut impl Read) -> io::Result<Option<Table>> {
    let mut length = [0; 8];
    from.read_exact(&mut length)?;
    let length = u64::from_le_bytes(length);
    if length == 0 {
        return Ok(None);
    }
    let mut part = Vec::new();
    if from.take(length).read_to_end(&mut part)? as u64 != length {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    postcard::from_bytes(&part).map(Some).map_err(|error| io::Error::new(ErrorKind::InvalidData, error))
}
