//! A Parquet file of columns.

use std::fs::File;
use std::io;
use std::sync::Arc;

use masseter_table::{Column, Values};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};

/// A file to which rows are added.
pub(crate) struct ParquetFile {
    writer: SerializedFileWriter<File>,
}

impl ParquetFile {
    /// Begins a file with columns.
    pub(crate) fn begin(to: File, columns: &[Column]) -> anyhow::Result<Self> {
        Ok(Self { writer: writer(to, columns).map_err(plain)? })
    }

    /// Adds all values of columns as a row group.
    pub(crate) fn write(&mut self, columns: &[Column]) -> anyhow::Result<()> {
        self.write_group(columns).map_err(plain)
    }

    fn write_group(&mut self, columns: &[Column]) -> Result<(), ParquetError> {
        let mut rows = self.writer.next_row_group()?;
        for column in columns {
            let Some(mut writer) = rows.next_column()? else { break };
            write_column(column, writer.untyped())?;
            writer.close()?;
        }
        rows.close().map(drop)
    }

    /// Ends the file.
    pub(crate) fn finish(mut self) -> anyhow::Result<()> {
        self.writer.finish().map(drop).map_err(plain)
    }
}

/// An error of the medium as it is, without the words `External` before it.
fn plain(error: ParquetError) -> anyhow::Error {
    match error {
        ParquetError::External(error) => {
            error.downcast::<io::Error>().map_or_else(anyhow::Error::from_boxed, |error| (*error).into())
        }
        other => other.into(),
    }
}

fn writer(to: File, columns: &[Column]) -> Result<SerializedFileWriter<File>, ParquetError> {
    let fields = columns.iter().map(schema).collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("row").with_fields(fields).build()?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata(columns)))
        .build();
    SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties))
}

fn metadata(columns: &[Column]) -> Vec<KeyValue> {
    let by_name = |of: fn(&Column) -> &str| {
        let entries = columns.iter().map(|column| (column.name().to_owned(), of(column).into()));
        serde_json::Value::Object(entries.collect()).to_string()
    };
    vec![
        KeyValue::new("units".to_owned(), by_name(Column::unit)),
        KeyValue::new("columns".to_owned(), by_name(Column::about)),
    ]
}

fn schema(column: &Column) -> Result<TypePtr, ParquetError> {
    let (physical, logical) = match column.values() {
        Values::Numbers(_) => (Physical::DOUBLE, None),
        Values::Whole(_) => (Physical::INT64, None),
        Values::Words(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Values::Truths(_) => (Physical::BOOLEAN, None),
    };
    let column = Type::primitive_type_builder(column.name(), physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical)
        .build()?;
    Ok(Arc::new(column))
}

fn write_column(column: &Column, writer: &mut ColumnWriter<'_>) -> Result<(), ParquetError> {
    let written = match (column.values(), writer) {
        (Values::Numbers(values), ColumnWriter::DoubleColumnWriter(writer)) => {
            writer.write_batch(&there(values), Some(&levels(values)), None)
        }
        (Values::Whole(values), ColumnWriter::Int64ColumnWriter(writer)) => {
            writer.write_batch(&there(values), Some(&levels(values)), None)
        }
        (Values::Truths(values), ColumnWriter::BoolColumnWriter(writer)) => {
            writer.write_batch(&there(values), Some(&levels(values)), None)
        }
        (Values::Words(values), ColumnWriter::ByteArrayColumnWriter(writer)) => {
            let words: Vec<_> = values.iter().flatten().map(|word| ByteArray::from(word.as_str())).collect();
            writer.write_batch(&words, Some(&levels(values)), None)
        }
        _ => Err(ParquetError::General(format!("column {} has another type than its schema", column.name()))),
    };
    written.map(drop)
}

fn there<T: Clone>(values: &[Option<T>]) -> Vec<T> {
    values.iter().flatten().cloned().collect()
}

/// 1 where there is a value.
fn levels<T>(values: &[Option<T>]) -> Vec<i16> {
    values.iter().map(|value| i16::from(value.is_some())).collect()
}
