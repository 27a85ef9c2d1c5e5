//! Files with old values of drives, which a step writes and a later one reads. Other programs and people may have changed them:
//! what is read is checked before anything is sent.

use std::io;
use std::path::{Path, PathBuf};

use masseter_scenario::ObjectKey;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use serde::de::DeserializeOwned;

/// Controlword: no step keeps a value of this object.
const CONTROLWORD: u16 = 0x6040;

/// A file that no step has written like this.
#[derive(Debug, thiserror::Error)]
#[error("{}: {damage}; the file is damaged: {remedy}", .path.display())]
pub(super) struct DamagedFile {
    pub(super) path: PathBuf,
    pub(super) damage: Damage,
    /// What to do.
    pub(super) remedy: &'static str,
}

/// What is wrong with such a file.
#[derive(Debug, thiserror::Error)]
pub(super) enum Damage {
    /// It cannot be read.
    #[error(transparent)]
    File(#[from] io::Error),
    /// It has not the form of such a file.
    #[error(transparent)]
    Form(#[from] serde_json::Error),
    /// No step changes this.
    #[error("{object} with {bytes} bytes is no old value")]
    Object { object: ObjectKey, bytes: usize },
    /// There is no such PDO.
    #[error("{communication:04X}h with {mapped} objects is no PDO")]
    Pdo { communication: u16, mapped: usize },
}

/// The content of a file.
pub(super) fn parse<T: DeserializeOwned>(path: &Path) -> Result<T, Damage> {
    Ok(serde_json::from_str(&read_text(path, MOST_KEPT_BYTES)?)?)
}

/// Refuses an old value that no step has kept.
pub(super) fn check_old_value(object: ObjectKey, bytes: usize) -> Result<(), Damage> {
    if !matches!(bytes, 1 | 2 | 4) || object.0.index == CONTROLWORD {
        return Err(Damage::Object { object, bytes });
    }
    Ok(())
}
