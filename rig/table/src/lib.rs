//! Tables of columns, each with its unit and meaning, written as Parquet. This crate holds no figures of its own.
//!
//! The metadata `units` and `columns` of the file are JSON objects: from the name of a column to its unit, and to its meaning.
//!
//! ```
//! use masseter_table::{Column, Table, Values};
//!
//! let force_n = Values::Numbers(vec![Some(12.5), None]);
//! let mut file = Vec::new();
//! Table::new(vec![Column::new("force_n", "N", "bite force", force_n)]).write_parquet(&mut file)?;
//! assert!(file.starts_with(b"PAR1"));
//! # Ok::<(), masseter_table::TableError>(())
//! ```

use std::io::Write;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};

/// The values of a column; none where a row has none.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Real numbers.
    Numbers(Vec<Option<f64>>),
    /// Whole numbers.
    Whole(Vec<Option<i64>>),
    /// Texts.
    Words(Vec<Option<String>>),
    /// True or false.
    Truths(Vec<Option<bool>>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Whole(values) => values.len(),
            Self::Words(values) => values.len(),
            Self::Truths(values) => values.len(),
        }
    }
}

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    name: String,
    unit: String,
    about: String,
    values: Values,
}

impl Column {
    /// A column; the unit is empty where the values have none.
    pub fn new(name: &str, unit: &str, about: &str, values: Values) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), about: about.to_owned(), values }
    }

    fn schema(&self) -> Result<TypePtr, ParquetError> {
        let (physical, logical) = match self.values {
            Values::Numbers(_) => (Physical::DOUBLE, None),
            Values::Whole(_) => (Physical::INT64, None),
            Values::Words(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Values::Truths(_) => (Physical::BOOLEAN, None),
        };
        let column = Type::primitive_type_builder(&self.name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical)
            .build()?;
        Ok(Arc::new(column))
    }

    fn write(&self, writer: &mut ColumnWriter<'_>) -> Result<(), ParquetError> {
        let written = match (&self.values, writer) {
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
                let words: Vec<_> =
                    values.iter().flatten().map(|word| ByteArray::from(word.as_str())).collect();
                writer.write_batch(&words, Some(&levels(values)), None)
            }
            _ => Err(ParquetError::General(format!("column {} has another type than its schema", self.name))),
        };
        written.map(drop)
    }
}

fn there<T: Clone>(values: &[Option<T>]) -> Vec<T> {
    values.iter().flatten().cloned().collect()
}

/// 1 where there is a value.
fn levels<T>(values: &[Option<T>]) -> Vec<i16> {
    values.iter().map(|value| i16::from(value.is_some())).collect()
}

/// Columns of one length.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    columns: Vec<Column>,
}

/// Why a table could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write the table: {0}")]
pub struct TableError(#[from] ParquetError);

impl Table {
    /// A table. A second column of the same name gets a number behind the name.
    ///
    /// # Panics
    /// When the columns differ in length.
    pub fn new(columns: Vec<Column>) -> Self {
        let rows = columns.first().map_or(0, |column| column.values.len());
        assert!(columns.iter().all(|column| column.values.len() == rows), "all columns have the same length");
        let mut named: Vec<Column> = Vec::new();
        for mut column in columns {
            let is_taken = |name: &str| named.iter().any(|other| other.name == name);
            if is_taken(&column.name) {
                let others = (2..).map(|number| format!("{} ({number})", column.name));
                column.name = others.into_iter().find(|name| !is_taken(name)).unwrap_or_default();
            }
            named.push(column);
        }
        Self { columns: named }
    }

    /// Writes the table as Parquet, compressed by zstd.
    ///
    /// # Errors
    /// Those of the writer.
    pub fn write_parquet(&self, to: impl Write + Send) -> Result<(), TableError> {
        let fields = self.columns.iter().map(Column::schema).collect::<Result<Vec<_>, _>>()?;
        let schema = Type::group_type_builder("row").with_fields(fields).build()?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(ZstdLevel::default()))
            .set_key_value_metadata(Some(self.metadata()))
            .build();
        let mut writer = SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties))?;
        let mut rows = writer.next_row_group()?;
        for column in &self.columns {
            let Some(mut writer) = rows.next_column()? else { break };
            column.write(writer.untyped())?;
            writer.close()?;
        }
        rows.close()?;
        writer.close()?;
        Ok(())
    }

    fn metadata(&self) -> Vec<KeyValue> {
        let by_name = |of: fn(&Column) -> &str| {
            let entries = self.columns.iter().map(|column| (column.name.clone(), of(column).into()));
            serde_json::Value::Object(entries.collect()).to_string()
        };
        vec![
            KeyValue::new("units".to_owned(), by_name(|column| &column.unit)),
            KeyValue::new("columns".to_owned(), by_name(|column| &column.about)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::RowAccessor;

    use super::*;

    #[test]
    fn a_table_is_read_back_with_its_gaps_and_units() {
        let table = Table::new(vec![
            Column::new("case", "", "number", Values::Whole(vec![Some(0), Some(1)])),
            Column::new("margin", "mm", "distance from the limit", Values::Numbers(vec![None, Some(0.5)])),
            Column::new("verdict", "", "word", Values::Words(vec![Some("PASS".to_owned()), None])),
            Column::new("passed", "", "truth", Values::Truths(vec![Some(true), Some(false)])),
        ]);
        let mut file = tempfile::tempfile().unwrap();
        table.write_parquet(&mut file).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let metadata = reader.metadata().file_metadata().key_value_metadata().unwrap();
        let units: serde_json::Value = serde_json::from_str(metadata[0].value.as_ref().unwrap()).unwrap();
        assert_eq!((metadata[0].key.as_str(), units["margin"].as_str()), ("units", Some("mm")));
        let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
        assert_eq!((rows[1].get_long(0).unwrap(), rows[1].get_double(1).unwrap()), (1, 0.5));
        assert!(rows[0].get_double(1).is_err() && rows[0].get_bool(3).unwrap());
        assert_eq!(rows[0].get_string(2).unwrap(), "PASS");
    }
}
