//! The file with the non-volatile memory of the emulated drives: JSON, by the names of the axes.
//!
//! A drive that a file does not name, and one without a file, has stored nothing.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};

use crate::drive::DriveMemory;
use crate::error::PlantError;

/// The memory of all drives and its file.
#[derive(Debug)]
pub(super) struct MemoryFile {
    path: PathBuf,
    drives: [DriveMemory; AXES],
    /// Whether the file does not have the present values.
    is_stale: bool,
}

impl MemoryFile {
    /// Reads a file; one that does not exist is that of drives that have stored nothing.
    pub(super) fn read(path: &Path) -> Result<Self, PlantError> {
        let text = match read_text(path, MOST_KEPT_BYTES) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => "{}".to_owned(),
            Err(error) => return Err(refused(path, &error)),
        };
        let mut by_name: BTreeMap<String, DriveMemory> =
            serde_json::from_str(&text).map_err(|error| refused(path, &error))?;
        let drives = AXIS_NAMES.map(|name| by_name.remove(name).unwrap_or_default());
        if let Some(name) = by_name.keys().next() {
            return Err(refused(path, &format!("'{name}' is no axis; name axes: {}", AXIS_NAMES.join(", "))));
        }
        Ok(Self { path: path.to_owned(), drives, is_stale: false })
    }

    /// The memory of an axis' drive.
    pub(super) fn of_axis(&self, axis: usize) -> &DriveMemory {
        &self.drives[axis]
    }

    /// A drive has stored something.
    pub(super) fn take(&mut self, axis: usize, memory: DriveMemory) {
        self.drives[axis] = memory;
        self.is_stale = true;
    }

    /// The refusal of what the file says of a drive.
    pub(super) fn refuse(&self, axis: usize, reason: &str) -> PlantError {
        refused(&self.path, &format!("{}: {reason}", AXIS_NAMES[axis]))
    }

    /// Writes the file, if it does not have the present values: as a whole or not at all.
    pub(super) fn write(&mut self) -> Result<(), PlantError> {
        if !self.is_stale {
            return Ok(());
        }
        let by_name: BTreeMap<_, _> = AXIS_NAMES.iter().zip(&self.drives).collect();
        let text = serde_json::to_string_pretty(&by_name).expect("numbers and texts have a JSON form");
        let beside = self.path.with_extension("json.new");
        fs::write(&beside, text + "\n")
            .and_then(|()| fs::rename(&beside, &self.path))
            .map_err(|error| refused(&self.path, &error))?;
        self.is_stale = false;
        Ok(())
    }
}

fn refused(path: &Path, reason: &dyn std::fmt::Display) -> PlantError {
    PlantError::Memory { path: path.to_owned(), reason: reason.to_string() }
}
