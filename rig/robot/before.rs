//! The file with the values of a drive from before `configure`. Other programs and people may have changed it: what is read
//! is checked before anything is sent.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use masseter_plant::bringup::{Setting, Settings};
use masseter_shared::config::ObjectKey;
use masseter_shared::geometry::AXIS_NAMES;

/// Most objects of a PDO (CiA 301).
const MAPPED_MAX: usize = 64;
/// Controlword: no step writes this object.
const CONTROLWORD: u16 = 0x6040;

/// A file whose values no drive had.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: {damage}; the file is damaged: bring it back from a backup, or remove it and write the values by hand that \
     result.json beside it shows",
    path.display()
)]
pub(super) struct Damaged {
    path: PathBuf,
    damage: Damage,
}

/// What is wrong with such a file.
#[derive(Debug, thiserror::Error)]
enum Damage {
    /// It cannot be read.
    #[error(transparent)]
    File(#[from] io::Error),
    /// It has not the form of such a file.
    #[error(transparent)]
    Form(#[from] serde_json::Error),
    /// No step writes this.
    #[error("{object} with {bytes} bytes is no old value")]
    Object { object: ObjectKey, bytes: usize },
    /// There is no such PDO.
    #[error("{communication:04X}h with {mapped} objects is no PDO")]
    Pdo { communication: u16, mapped: usize },
}

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
/// [`Damaged`].
pub(super) fn read(path: &Path) -> Result<Settings, Damaged> {
    parse(path).map_err(|damage| Damaged { path: path.to_owned(), damage })
}

fn parse(path: &Path) -> Result<Settings, Damage> {
    let settings: Settings = serde_json::from_str(&fs::read_to_string(path)?)?;
    let is_strange = |one: &&Setting| !matches!(one.bytes, 1 | 2 | 4) || one.object.0.index == CONTROLWORD;
    if let Some(one) = settings.objects.iter().find(is_strange) {
        return Err(Damage::Object { object: one.object, bytes: one.bytes });
    }
    for pdo in &settings.pdos {
        let (communication, mapped) =
            (pdo.communication, pdo.layout.as_ref().map_or(0, |layout| layout.mapping.len()));
        if !matches!(communication, 0x1400..0x1600 | 0x1800..0x1A00) || mapped > MAPPED_MAX {
            return Err(Damage::Pdo { communication, mapped });
        }
    }
    Ok(settings)
}
