//! The data behind a figure, as CSV.

use std::path::Path;

/// Columns with their units in their names, and rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    /// File name without its extension.
    pub name: &'static str,
    pub header: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn new(name: &'static str, header: &[&str], rows: Vec<Vec<String>>) -> Self {
        let header: Vec<_> = header.iter().map(|&column| column.to_owned()).collect();
        debug_assert!(rows.iter().all(|row| row.len() == header.len()), "{name}: a row has other columns");
        Self { name, header, rows }
    }

    /// Writes `<folder>/<name>.csv`.
    pub(super) fn write(&self, folder: &Path) -> csv::Result<()> {
        let mut writer = csv::Writer::from_path(folder.join(self.name).with_extension("csv"))?;
        writer.write_record(&self.header)?;
        for row in &self.rows {
            writer.write_record(row)?;
        }
        Ok(writer.flush()?)
    }
}

/// A number as short as it reads back the same; an empty cell where there is none.
pub(super) fn number(value: f64) -> String {
    if value.is_finite() { value.to_string() } else { String::new() }
}

/// Angles in degrees.
pub(super) fn degrees(angles_rad: &[f64]) -> impl Iterator<Item = String> {
    angles_rad.iter().map(|angle| number(angle.to_degrees()))
}

/// Yes or no as the other verbs write it.
pub(super) fn flag(holds: bool) -> String {
    u8::from(holds).to_string()
}
