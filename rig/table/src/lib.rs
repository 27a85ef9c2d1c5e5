//! Tables of columns, each with its unit and meaning, written as Parquet or CSV, and their codebook. This crate holds no
//! figures of its own.
//!
//! The metadata `units` and `columns` of a Parquet file are JSON objects: from the name of a column to its unit, and to its
//! meaning. A CSV file has no room for them; the codebook has.
//!
//! ```
//! use masseter_table::{Column, Format, Table, Values, write_table};
//!
//! let force_n = Values::Numbers(vec![Some(12.5), None]);
//! let mut file = Vec::new();
//! let table = Table::new(vec![Column::new("force_n", "N", "bite force", force_n)]);
//! write_table(Format::Parquet, &mut file, &table)?;
//! assert!(file.starts_with(b"PAR1"));
//! # Ok::<(), masseter_table::TableError>(())
//! ```

mod column;
mod error;
mod table;
#[cfg(test)]
mod tests;
mod writer;

pub use column::{Cell, Column, Values};
pub use error::TableError;
pub use table::Table;
pub use writer::{Format, TableWriter, write_table};
