//! Writes a table part by part, so that its length does not matter for the memory.

use std::fs::File;

use crate::column::Column;
use crate::error::TableError;
use crate::parquet_program::{ParquetFile, ParquetProgram};
use crate::table::Table;

/// The format of a file.
#[derive(Debug, Clone)]
pub enum Format {
    /// Apache Parquet, which this program writes.
    Parquet(ParquetProgram),
    /// Comma-separated values below a line of names.
    Csv,
}

impl Format {
    /// The ending of files, without the dot.
    pub fn extension(&self) -> &'static str {
        match self {
            Self::Parquet(_) => "parquet",
            Self::Csv => "csv",
        }
    }
}

/// A file that a table is written to.
pub struct TableWriter {
    sink: Sink,
}

enum Sink {
    Parquet(ParquetFile),
    Csv(Box<csv::Writer<File>>),
}

impl TableWriter {
    /// Begins a file with the columns of a table, and none of its rows.
    ///
    /// # Errors
    /// Those of the medium, and of the program that writes Parquet.
    pub fn new(format: &Format, file: File, table: &Table) -> Result<Self, TableError> {
        let sink = match format {
            Format::Parquet(program) => Sink::Parquet(program.begin(file, table)?),
            Format::Csv => {
                let mut writer = csv::Writer::from_writer(file);
                writer.write_record(table.columns().iter().map(Column::name))?;
                Sink::Csv(Box::new(writer))
            }
        };
        Ok(Self { sink })
    }

    /// Appends all rows of a table with the same columns; in Parquet they are a row group.
    ///
    /// # Errors
    /// Those of the medium, and of the program that writes Parquet.
    pub fn write(&mut self, table: &Table) -> Result<(), TableError> {
        match &mut self.sink {
            Sink::Parquet(file) => file.write(table)?,
            Sink::Csv(writer) => {
                for row in 0..table.rows() {
                    writer.write_record(table.columns().iter().map(|column| column.values().text(row)))?;
                }
            }
        }
        Ok(())
    }

    /// Ends the file. Without this it is no valid Parquet file.
    ///
    /// # Errors
    /// Those of the medium, and of the program that writes Parquet.
    pub fn finish(self) -> Result<(), TableError> {
        match self.sink {
            Sink::Parquet(file) => file.finish(),
            Sink::Csv(mut writer) => Ok(writer.flush()?),
        }
    }
}

/// Writes a whole table.
///
/// # Errors
/// Those of the medium, and of the program that writes Parquet.
pub fn write_table(format: &Format, file: File, table: &Table) -> Result<(), TableError> {
    let mut writer = TableWriter::new(format, file, table)?;
    writer.write(table)?;
    writer.finish()
}
