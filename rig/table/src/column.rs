//! Columns of a table and their cells.

use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
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

/// The value of one row in a column of its kind.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A real number.
    Number(Option<f64>),
    /// A whole number.
    Whole(Option<i64>),
    /// A text.
    Word(Option<String>),
}

impl Values {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Numbers(values) => values.len(),
            Self::Whole(values) => values.len(),
            Self::Words(values) => values.len(),
            Self::Truths(values) => values.len(),
        }
    }

    fn push(&mut self, cell: Cell) {
        match (self, cell) {
            (Self::Numbers(values), Cell::Number(value)) => values.push(value),
            (Self::Whole(values), Cell::Whole(value)) => values.push(value),
            (Self::Words(values), Cell::Word(value)) => values.push(value),
            (_, cell) => panic!("{cell:?} does not fit its column"),
        }
    }

    fn clear(&mut self) {
        match self {
            Self::Numbers(values) => values.clear(),
            Self::Whole(values) => values.clear(),
            Self::Words(values) => values.clear(),
            Self::Truths(values) => values.clear(),
        }
    }

    /// The value of a row as text with as many digits as give the same number again; empty where there is none.
    pub(crate) fn text(&self, row: usize) -> String {
        fn text(value: Option<&impl ToString>) -> String {
            value.map(ToString::to_string).unwrap_or_default()
        }
        match self {
            Self::Numbers(values) => text(values[row].as_ref()),
            Self::Whole(values) => text(values[row].as_ref()),
            Self::Words(values) => text(values[row].as_ref()),
            Self::Truths(values) => text(values[row].as_ref()),
        }
    }

    /// The kind of values in words.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::Numbers(_) => "number",
            Self::Whole(_) => "whole number",
            Self::Words(_) => "text",
            Self::Truths(_) => "true or false",
        }
    }
}

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) about: String,
    pub(crate) values: Values,
}

impl Column {
    /// A column; the unit is empty where the values have none.
    pub fn new(name: &str, unit: &str, about: &str, values: Values) -> Self {
        Self { name: name.to_owned(), unit: unit.to_owned(), about: about.to_owned(), values }
    }

    pub(crate) fn push(&mut self, cell: Cell) {
        self.values.push(cell);
    }

    pub(crate) fn clear(&mut self) {
        self.values.clear();
    }

    pub(crate) fn schema(&self) -> Result<TypePtr, ParquetError> {
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

    pub(crate) fn write(&self, writer: &mut ColumnWriter<'_>) -> Result<(), ParquetError> {
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
