//! A table on its way to a file: rows are gathered, and written in groups.

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::Context;
use masseter_table::{Cell, Format, Table, TableWriter};

/// Rows of a group: some 30 MB of the widest table.
const GROUP_ROWS: usize = 1 << 14;

/// A file with the rows that are not in it yet.
pub(super) struct TableFile {
    name: String,
    path: PathBuf,
    writer: TableWriter,
    group: Table,
    rows: u64,
}

impl TableFile {
    /// Creates a file in `folder` for rows of an empty table.
    pub(super) fn create(folder: &Path, name: &str, format: &Format, empty: Table) -> anyhow::Result<Self> {
        let path = folder.join(format!("{name}.{}", format.extension()));
        let file = File::create_new(&path).with_context(|| format!("cannot create {}", path.display()))?;
        let writer = TableWriter::new(format, file, &empty);
        let writer = writer.with_context(|| path.display().to_string())?;
        Ok(Self { name: name.to_owned(), path, writer, group: empty, rows: 0 })
    }

    pub(super) fn push(&mut self, row: impl IntoIterator<Item = Cell>) -> anyhow::Result<()> {
        self.group.push(row);
        if self.group.rows() < GROUP_ROWS { Ok(()) } else { self.write() }
    }

    fn write(&mut self) -> anyhow::Result<()> {
        self.rows += self.group.rows() as u64;
        self.writer.write(&self.group).with_context(|| self.path.display().to_string())?;
        self.group.clear();
        Ok(())
    }

    /// Ends the file. Returns its name, its number of rows, and its columns.
    pub(super) fn finish(mut self) -> anyhow::Result<(String, u64, Table)> {
        if self.group.rows() > 0 {
            self.write()?;
        }
        self.writer.finish().with_context(|| self.path.display().to_string())?;
        Ok((self.name, self.rows, self.group))
    }
}
