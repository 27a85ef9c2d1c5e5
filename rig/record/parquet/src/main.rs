//! The program `masseter-parquet`: takes the rows of a table from standard input, and writes a Parquet file to standard
//! output. `masseter` starts it; it is a program of its own, since the crate `parquet` would lengthen every first build.

use std::io::{self, ErrorKind, IsTerminal};
use std::{fs::File, os::fd::AsFd, process::ExitCode, sync::Arc};

use anyhow::{anyhow, bail};
use masseter_table::{Column, Rows, Values};
use masseter_terminal::{Exit, OrFailure, status};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::column::writer::{ColumnWriter, ColumnWriterImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};

fn main() -> ExitCode {
    // A write beyond the limit on the size of files is then an error, not the end.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    match write_file().usage() {
        Ok(()) => Exit::Passed.into(),
        Err(failure) => {
            status!("{:#}", failure.error);
            failure.exit.into()
        }
    }
}

fn write_file() -> anyhow::Result<()> {
    if std::env::args_os().len() > 1 || io::stdin().is_terminal() || io::stdout().is_terminal() {
        bail!("masseter starts this program: masseter export RUN --format parquet");
    }
    let rows = Rows::new(io::stdin().lock());
    let mut rows = rows.map_err(|error| match error.kind() {
        ErrorKind::InvalidData | ErrorKind::UnexpectedEof => {
            anyhow!(
                "these are no rows of this build of masseter: `cargo build --release` builds both programs"
            )
        }
        _ => error.into(),
    })?;
    let to = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    let mut file = begin_file(to, rows.columns()).map_err(plain)?;
    while let Some(part) = rows.next_part().map_err(unended)? {
        write_group(&mut file, part.columns()).map_err(plain)?;
    }
    file.finish().map(drop).map_err(plain)
}

/// Only a sender that died leaves rows without an end.
fn unended(error: io::Error) -> anyhow::Error {
    let is_cut = error.kind() == ErrorKind::UnexpectedEof;
    let error = anyhow::Error::from(error);
    if is_cut { error.context("the rows have no end") } else { error }
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

/// Begins a file with columns.
fn begin_file(to: File, columns: &[Column]) -> Result<SerializedFileWriter<File>, ParquetError> {
    let fields = columns.iter().map(schema).collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("row").with_fields(fields).build()?;
    let properties = parquet::file::properties::WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(metadata(columns)))
        .build();
    SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties))
}

/// Adds all values of columns as a row group.
fn write_group(file: &mut SerializedFileWriter<File>, columns: &[Column]) -> Result<(), ParquetError> {
    let mut rows = file.next_row_group()?;
    for column in columns {
        let Some(mut writer) = rows.next_column()? else { break };
        write_column(column, writer.untyped())?;
        writer.close()?;
    }
    rows.close().map(drop)
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

fn schema(column: &Column) -> Result<TypePtr, ParquetError> {
    let (physical, logical) = match &column.values {
        Values::Numbers(_) => (Physical::DOUBLE, None),
        Values::Whole(_) => (Physical::INT64, None),
        Values::Words(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        Values::Truths(_) => (Physical::BOOLEAN, None),
    };
    let column = Type::primitive_type_builder(&column.name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical)
        .build()?;
    Ok(Arc::new(column))
}

fn write_column(column: &Column, writer: &mut ColumnWriter<'_>) -> Result<(), ParquetError> {
    match (&column.values, writer) {
        (Values::Numbers(values), ColumnWriter::DoubleColumnWriter(writer)) => write_values(values, writer),
        (Values::Whole(values), ColumnWriter::Int64ColumnWriter(writer)) => write_values(values, writer),
        (Values::Truths(values), ColumnWriter::BoolColumnWriter(writer)) => write_values(values, writer),
        (Values::Words(words), ColumnWriter::ByteArrayColumnWriter(writer)) => {
            let values: Vec<_> = words.iter().map(|word| word.as_deref().map(ByteArray::from)).collect();
            write_values(&values, writer)
        }
        _ => Err(ParquetError::General(format!("column {} has another type than its schema", column.name))),
    }
}

fn write_values<T: DataType>(
    values: &[Option<T::T>],
    writer: &mut ColumnWriterImpl<'_, T>,
) -> Result<(), ParquetError> {
    let there: Vec<_> = values.iter().flatten().cloned().collect();
    // 1 where there is a value.
    let levels: Vec<_> = values.iter().map(|value| i16::from(value.is_some())).collect();
    writer.write_batch(&there, Some(&levels), None).map(drop)
}
