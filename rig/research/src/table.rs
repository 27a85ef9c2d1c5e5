//! Data of figures and proofs as CSV.

use serde::Serialize;

/// A header and rows. A row may nest tuples and arrays: each of their values is a column.
///
/// # Panics
/// When a row has not as many columns as the header.
pub(crate) fn csv(header: &str, rows: impl IntoIterator<Item = impl Serialize>) -> String {
    let mut writer = csv::WriterBuilder::new().has_headers(false).from_writer(Vec::new());
    let mut written = writer.write_record(header.split(','));
    written = written.and_then(|()| rows.into_iter().try_for_each(|row| writer.serialize(row)));
    written.expect("rows have the columns of their header");
    String::from_utf8(writer.into_inner().expect("a vector takes all bytes")).expect("all columns are text")
}

/// A number as short as it reads back the same; an empty cell where there is none.
pub(crate) fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

/// An angle in degrees.
pub(crate) fn degrees(angle_rad: f64) -> String {
    number(angle_rad.to_degrees())
}
