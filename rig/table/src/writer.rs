//! Writes a table part by part, so that its length does not matter for the memory.

use std::io::Write;
use std::sync::Arc;

use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::column::Column;
use crate::error::TableError;
use crate::table::Table;

/// The format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Apache Parquet.
    Parquet,
    /// Comma-separated values below a line of names.
    Csv,
}

impl Format {
    /// The ending of files, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Parquet => "parquet",
            Self::Csv => "csv",
        }
    }
}

/// A file that a table is written to.
pub struct TableWriter<W: Write + Send> {
    sink: Sink<W>,
}

enum Sink<W: Write + Send> {
    Parquet(Box<SerializedFileWriter<W>>),
    Csv(Box<csv::Writer<W>>),
}

impl<W: Write + Send> TableWriter<W> {
    /// Begins a file with the columns of a table, and none of its rows.
    ///
    /// # Errors
    /// Those of the medium.
    pub fn new(format: Format, to: W, table: &Table) -> Result<Self, TableError> {
        let sink = match format {
            Format::Parquet => Sink::Parquet(Box::new(parquet_writer(to, &table.columns)?)),
            Format::Csv => {
                let mut writer = csv::Writer::from_writer(to);
                writer.write_record(table.columns.iter().map(|column| &column.name))?;
                Sink::Csv(Box::new(writer))
            }
        };
        Ok(Self { sink })
    }

    /// Appends all rows of a table with the same columns; in Parquet they are a row group.
    ///
    /// # Errors
    /// Those of the medium.
    pub fn write(&mut self, table: &Table) -> Result<(), TableError> {
        match &mut self.sink {
            Sink::Parquet(writer) => {
                let mut rows = writer.next_row_group()?;
                for column in &table.columns {
                    let Some(mut writer) = rows.next_column()? else { break };
                    column.write(writer.untyped())?;
                    writer.close()?;
                }
                rows.close()?;
            }
            Sink::Csv(writer) => {
                for row in 0..table.rows() {
                    writer.write_record(table.columns.iter().map(|column| column.values.text(row)))?;
                }
            }
        }
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// Those of the medium.
    pub fn finish(self) -> Result<(), TableError> {
        match self.sink {
            Sink::Parquet(mut writer) => drop(writer.finish()?),
            Sink::Csv(mut writer) => writer.flush()?,
        }
        Ok(())
    }
}

/// Writes a whole table.
///
/// # Errors
/// Those of the medium.
pub fn write_table(format: Format, to: impl Write + Send, table: &Table) -> Result<(), TableError> {
    let mut writer = TableWriter::new(format, to, table)?;
    writer.write(table)?;
    writer.finish()
}

fn parquet_writer<W: Write + Send>(
    to: W,
    columns: &[Column],
) -> Result<SerializedFileWriter<W>, ParquetError> {
    let fields = columns.iter().map(Column::schema).collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("row").with_fields(fields).build()?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata(columns)))
        .build();
    SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties))
}

fn metadata(columns: &[Column]) -> Vec<KeyValue> {
    let by_name = |of: fn(&Column) -> &str| {
        let entries = columns.iter().map(|column| (column.name.clone(), of(column).into()));
        serde_json::Value::Object(entries.collect()).to_string()
    };
    vec![
        KeyValue::new("units".to_owned(), by_name(|column| &column.unit)),
        KeyValue::new("columns".to_owned(), by_name(|column| &column.about)),
    ]
}
