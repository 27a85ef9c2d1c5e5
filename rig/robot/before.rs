//! The file with the values of a drive from before `configure`.

use std::path::{Path, PathBuf};

use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::bringup::Settings;

use super::damaged::{Damage, DamagedFile, check_old_value, parse};

/// Most objects of a PDO (CiA 301).
const MAPPED_MAX: usize = 64;
/// What to do about a damaged file.
const REMEDY: &str =
    "bring it back from a backup, or remove it and write the values by hand that result.json beside it shows";

/// Name of the file for an axis.
pub(super) fn before_file(axis: usize) -> String {
    format!("before-{}.json", AXIS_NAMES[axis])
}

/// A file without a readable result beside it.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: result.json beside it is missing or damaged, so that nobody knows whose values these are; bring it back from a \
     backup, or move the file away and write its values by hand",
    .0.display()
)]
pub(super) struct Nameless(pub(super) PathBuf);

/// The values in a file.
///
/// # Errors
/// [`DamagedFile`].
pub(super) fn read(path: &Path) -> Result<Settings, DamagedFile> {
    checked(path).map_err(|damage| DamagedFile { path: path.to_owned(), damage, remedy: REMEDY })
}

fn checked(path: &Path) -> Result<Settings, Damage> {
    let settings: Settings = parse(path)?;
    settings.objects.iter().try_for_each(|one| check_old_value(one.object, one.bytes))?;
    for pdo in &settings.pdos {
        let (communication, mapped) =
            (pdo.communication, pdo.layout.as_ref().map_or(0, |layout| layout.mapping.len()));
        if !matches!(communication, 0x1400..0x1600 | 0x1800..0x1A00) || mapped > MAPPED_MAX {
            return Err(Damage::Pdo { communication, mapped });
        }
    }
    Ok(settings)
}
