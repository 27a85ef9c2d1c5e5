//! Why a table cannot be written.

use std::io;

use parquet::errors::ParquetError;

/// Why a table could not be written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// As Parquet.
    #[error("cannot write the table: {0}")]
    Parquet(#[from] ParquetError),
    /// As CSV.
    #[error("cannot write the table: {0}")]
    Csv(#[from] csv::Error),
    /// The last bytes of it.
    #[error("cannot write the table: {0}")]
    File(#[from] io::Error),
}
