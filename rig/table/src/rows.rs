//! Rows on their way to the program that writes Parquet.
//!
//! A line names this form, and a line of JSON the columns. Each part is the byte 1, its number of rows, and the values of one
//! column after the other. The byte 0 ends the rows: without it their sender died, and the file must not look whole.

use std::io::{self, BufRead, ErrorKind, Write};

use crate::column::{Column, bytes};
use crate::table::Table;

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
    table.columns().iter().try_for_each(|column| column.values().send(to))
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
        self.part.receive(count, &mut self.from)?;
        Ok(Some(&self.part))
    }
}
