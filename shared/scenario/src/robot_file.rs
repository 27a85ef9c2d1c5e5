//! The file of a robot: the tables of a scenario that describe one rig, for all scenarios that name the file in `robot`.
//!
//! A scenario's own keys replace those of the file. A list in a scenario replaces the whole list of the file. The values
//! are not checked here.

use std::path::Path;

use toml::{Table, Value};

use super::error::ScenarioError;

/// The tables that describe a robot and not what is done with it.
const TABLES: [&str; 7] = ["mechanism", "jaw", "limits", "can", "drives", "drive_profile", "dynamics"];

/// The tables of the robot's file at `path`, whose paths are relative to its folder.
pub(super) fn tables(path: &Path, mut given: Table) -> Result<Table, ScenarioError> {
    if let Some(other) = given.keys().find(|key| !TABLES.contains(&key.as_str())) {
        let reason = format!("{other} does not describe a robot; a robot's file has {}", TABLES.join(", "));
        return Err(ScenarioError::Malformed { place: path.display().to_string(), reason });
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    if let Some(file) = given.get_mut("drives").and_then(|drives| drives.get_mut("memory")) {
        put_in(folder, file);
    }
    let profiles = given.get_mut("drive_profile").and_then(Value::as_array_mut);
    for file in profiles.into_iter().flatten().filter_map(|profile| profile.get_mut("dcf")) {
        put_in(folder, file);
    }
    Ok(given)
}

/// Makes a file's path independent of the folder that the path is relative to.
fn put_in(folder: &Path, file: &mut Value) {
    if let Some(name) = file.as_str() {
        let whole = folder.join(name);
        let whole = std::path::absolute(&whole).unwrap_or(whole);
        *file = Value::from(whole.to_string_lossy().into_owned());
    }
}
