//! Tables of columns, each with its unit and meaning, written as Parquet or CSV, and their codebook. This crate holds no
//! figures of its own. Another program writes Parquet (`rig/record/parquet`).
//!
//! The metadata `units` and `columns` of a Parquet file are JSON objects: from the name of a column to its unit, and to its
//! meaning. A CSV file has no room for them; the codebook has.
//!
//! ```
//! use masseter_table::{Column, Format, Table, Values, write_table};
//!
//! let force_n = Values::Numbers(vec![Some(12.5), None]);
//! let table = Table::new(vec![Column::new("force_n", "N", "bite force", force_n)]);
//! let file = tempfile::NamedTempFile::new()?;
//! write_table(&Format::Csv, file.reopen()?, &table)?;
//! assert_eq!(std::fs::read_to_string(file)?, "force_n\n12.5\n\"\"\n");
//! # Ok::<(), masseter_table::TableError>(())
//! ```

mod rows;
mod table;
#[cfg(test)]
mod tests;
mod writer;

pub use rows::Rows;
pub use table::{Cell, Column, Table, Values};
pub use writer::{Format, ParquetProgram, TableError, TableWriter, write_table};
