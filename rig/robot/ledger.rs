//! Files with old values of drives. `configure` keeps the values from before it. A jog or a homing reduces some
//! values for its own duration, and keeps the old ones in a file for each axis. Only a killed step leaves that file.
//!
//! Other programs and people may have changed such a file: what is read is checked before anything is sent.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{anyhow, ensure};
use masseter_commissioning::{
    Identity, Ledger, Line, LineError, OldValue, Settings, give_back, object_name, value_text,
};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_recording::write_whole;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};
use masseter_scenario::{CanConfig, ObjectKey, Scenario};
use masseter_terminal::{Failure, status};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::robot_line::{LISTEN_NS, failed, prove_off};

/// Controlword: no step keeps a value of this object.
const CONTROLWORD: u16 = 0x6040;
/// Most objects of a PDO (CiA 301).
const MAPPED_MAX: usize = 64;
/// What to do about a damaged file with values from before `configure`.
const BEFORE_REMEDY: &str =
    "bring it back from a backup, or remove it and write the values by hand that result.json beside it shows";
/// What to do about a damaged file with owed values, and about one whose values the drive does not keep. The drive
/// itself returns to its old values when it restarts: no step stores reduced ones.
const OWED_REMEDY: &str =
    "remove it, and switch the drive's supply off and on, which brings its stored values back";

/// A file that no step has written like this.
#[derive(Debug, thiserror::Error)]
#[error("{}: {damage}; the file is damaged: {remedy}", .path.display())]
pub(super) struct DamagedFile {
    path: PathBuf,
    damage: Damage,
    /// What to do.
    remedy: &'static str,
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
pub(super) fn parse_file<T: DeserializeOwned>(path: &Path) -> Result<T, Damage> {
    Ok(serde_json::from_str(&read_text(path, MOST_KEPT_BYTES)?)?)
}

/// The content of a file with old values, if they pass the check.
fn read_checked<T: DeserializeOwned>(
    path: &Path,
    remedy: &'static str,
    check: impl Fn(&T) -> Result<(), Damage>,
) -> Result<T, DamagedFile> {
    let read = parse_file(path).and_then(|values| check(&values).map(|()| values));
    read.map_err(|damage| DamagedFile { path: path.to_owned(), damage, remedy })
}

/// Refuses an old value that no step has kept.
fn check_old_value(object: ObjectKey, bytes: usize) -> Result<(), Damage> {
    if !matches!(bytes, 1..=4) || object.0.index == CONTROLWORD {
        return Err(Damage::Object { object, bytes });
    }
    Ok(())
}

/// Name of the file with the values of an axis from before `configure`.
pub(super) fn before_file(axis: usize) -> String {
    format!("before-{}.json", AXIS_NAMES[axis])
}

/// Such a file without a readable result beside it.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: result.json beside it is missing or damaged, so that nobody knows whose values these are; bring it \
     back from a backup, or move the file away and write its values by hand",
    .0.display()
)]
pub(super) struct Nameless(pub(super) PathBuf);

/// The values in such a file.
///
/// # Errors
/// [`DamagedFile`].
pub(super) fn read_before(path: &Path) -> Result<Settings, DamagedFile> {
    read_checked(path, BEFORE_REMEDY, |settings: &Settings| {
        settings.objects.iter().try_for_each(|one| check_old_value(one.object, one.bytes))?;
        for pdo in &settings.pdos {
            let communication = pdo.communication;
            let mapped = pdo.layout.as_ref().map_or(0, |layout| layout.mapping.len());
            if !matches!(communication, 0x1400..0x1600 | 0x1800..0x1A00) || mapped > MAPPED_MAX {
                return Err(Damage::Pdo { communication, mapped });
            }
        }
        Ok(())
    })
}

/// What one drive is owed.
#[derive(Debug, Serialize, Deserialize)]
struct Owed {
    /// The drive.
    drive: Identity,
    /// The oldest change first.
    values: Vec<OldValue>,
}

impl Owed {
    /// What the drive of an axis is owed; another drive is owed nothing.
    fn read(folder: &Path, line: &mut Line, can: &CanConfig, axis: usize) -> anyhow::Result<Self> {
        let path = owed_file(folder, axis);
        let owed = read_checked(&path, OWED_REMEDY, |owed: &Self| {
            owed.values.iter().try_for_each(|old| check_old_value(old.object, old.bytes))
        })?;
        let now = Identity::read(line, can, axis)?;
        ensure!(
            now == owed.drive,
            "{}: {} has the old values of another drive ({}); put that drive back, or remove the file",
            AXIS_NAMES[axis],
            path.display(),
            now.differs_from(&owed.drive)
        );
        Ok(owed)
    }

    /// Writes the values into a drive without power, and says so.
    fn return_to(self, folder: &Path, line: &mut Line, axis: usize) -> anyhow::Result<()> {
        let (Self { drive, values }, name) = (self, AXIS_NAMES[axis]);
        line.keep_old_values_in(Box::new(OwedFiles { folder: folder.to_owned(), drives: [drive; AXES] }));
        let refused = give_back(line, axis, &values).map_err(|error| match error {
            // The value stays owed, and every later try may end in the same way.
            LineError::NotKept { .. } => {
                let path = owed_file(folder, axis);
                anyhow!("{error}; {} keeps this old value: mend the drive, or {OWED_REMEDY}", path.display())
            }
            error => error.into(),
        })?;
        status!("{name}: a step was killed; the drive has its old values again:");
        for old in values {
            let OldValue { object: ObjectKey(object), value, .. } = old;
            let taken =
                if refused.contains(&old) { "; warning: the drive refuses it, look at it" } else { "" };
            status!("  {object} {}: {}{taken}", object_name(object), value_text(object, value));
        }
        Ok(())
    }
}

/// The files with owed values in the folder of the bring-up, for these drives.
#[derive(Debug)]
pub(super) struct OwedFiles {
    pub(super) folder: PathBuf,
    pub(super) drives: [Identity; AXES],
}

impl Ledger for OwedFiles {
    /// Completely or not at all, also after a power cut.
    fn keep(&mut self, axis: usize, values: &[OldValue]) -> io::Result<()> {
        let path = owed_file(&self.folder, axis);
        if values.is_empty() {
            if path.exists() {
                fs::remove_file(path)?;
                File::open(&self.folder)?.sync_all()?;
            }
            return Ok(());
        }
        let owed = Owed { drive: self.drives[axis], values: values.to_vec() };
        write_whole(&path, &serde_json::to_string_pretty(&owed)?)?;
        // No drive is changed before its old values outlast a power cut.
        File::open(&self.folder)?.sync_all()
    }
}

fn owed_file(folder: &Path, axis: usize) -> PathBuf {
    folder.join(format!("borrowed-{}.json", AXIS_NAMES[axis]))
}

/// The axes whose drives a killed step left with reduced values.
pub(super) fn owed_axes(folder: &Path) -> Vec<usize> {
    (0..AXES).filter(|&axis| owed_file(folder, axis).exists()).collect()
}

/// What to do about such a drive.
pub(super) fn owed_advice(folder: &Path, axis: usize) -> String {
    format!(
        "{}: a killed step left reduced values in the drive ({}); the next jog, home, check-pose, configure or restore \
         writes the old ones back",
        AXIS_NAMES[axis],
        owed_file(folder, axis).display()
    )
}

/// Writes old values back that a killed step left, and says so. Without such values nothing is sent.
///
/// # Errors
/// When a drive is another one, has power, or does not take a value.
pub(super) fn return_owed_values(
    folder: &Path,
    scenario: &Scenario,
    line: &mut Line,
    may_stop: bool,
) -> Result<(), Failure> {
    let axes = owed_axes(folder);
    if axes.is_empty() {
        return Ok(());
    }
    line.listen(LISTEN_NS).map_err(failed)?;
    line.strangers().refuse_masters().map_err(failed)?;
    for axis in axes {
        let owed = Owed::read(folder, line, &scenario.can, axis).map_err(failed)?;
        prove_off(line, scenario, axis, may_stop)?;
        owed.return_to(folder, line, axis).map_err(failed)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use masseter_can::cia402::Controlword;

    use super::*;

    const L1: usize = 3;

    /// Emulated drives of a scenario, and a file with that old value of l1.
    fn robot(text: &str, old: &str) -> (tempfile::TempDir, Scenario, Line) {
        let folder = tempfile::tempdir().unwrap();
        let scenario = Scenario::parse(Path::new("robot.toml"), text).unwrap();
        let mut line = Line::open(&scenario, Box::new(io::sink())).unwrap();
        line.listen(LISTEN_NS).unwrap();
        let sound = Line::open(&Scenario::default(), Box::new(io::sink()));
        let mut sound = sound.unwrap();
        sound.listen(LISTEN_NS).unwrap();
        let drive = Identity::read(&mut sound, &scenario.can, L1).unwrap();
        let drive = serde_json::to_string(&drive).unwrap();
        let owed = format!(r#"{{ "drive": {drive}, "values": [{old}] }}"#);
        fs::write(owed_file(folder.path(), L1), owed).unwrap();
        (folder, scenario, line)
    }

    const VELOCITY: &str = r#"{ "object": "6081h", "value": 77, "bytes": 4 }"#;

    #[test]
    fn a_damaged_file_is_refused_and_nothing_is_written() {
        for old in [
            r#"{ "object": "6081h", "value": 77, "bytes": 5 }"#,
            r#"{ "object": "6081h", "value": 77, "bytes": 40 }"#,
            r#"{ "object": "6040h", "value": 15, "bytes": 2 }"#,
            r#"{ "object": "6081h", "value": 77"#,
        ] {
            let (folder, scenario, mut line) = robot("", old);
            let refusal =
                return_owed_values(folder.path(), &scenario, &mut line, false).unwrap_err().error.to_string();
            assert!(refusal.contains("the file is damaged: remove it"), "{refusal}");
            assert_eq!(owed_axes(folder.path()), [L1]);
        }
    }

    #[test]
    fn a_value_that_does_not_return_stays_owed_and_the_refusal_names_the_file() {
        let liar = "[[drives.quirk]]\naxes = ['l1']\nkind = 'shows'\nobjects = ['6081h']\nvalue = 5";
        let (folder, scenario, mut line) = robot(liar, VELOCITY);
        let refusal =
            return_owed_values(folder.path(), &scenario, &mut line, false).unwrap_err().error.to_string();
        assert!(refusal.contains("shows 5; ") && refusal.contains("borrowed-l1.json keeps"), "{refusal}");
        assert_eq!(owed_axes(folder.path()), [L1]);
    }

    #[test]
    fn a_silent_drive_is_no_other_drive() {
        let cable = "[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 4\nfrom_s = 0.0";
        let (folder, scenario, mut line) = robot(cable, VELOCITY);
        let refusal =
            return_owed_values(folder.path(), &scenario, &mut line, false).unwrap_err().error.to_string();
        assert!(refusal.starts_with("l1: object 1018h:01h: no answer; check its power"), "{refusal}");
    }

    #[test]
    fn a_drive_with_power_gets_its_old_values_once_it_may_be_stopped() {
        let (folder, scenario, mut line) = robot("", VELOCITY);
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON] {
            line.control(L1, word).unwrap();
        }
        line.listen(LISTEN_NS).unwrap();
        assert!(return_owed_values(folder.path(), &scenario, &mut line, false).is_err());
        return_owed_values(folder.path(), &scenario, &mut line, true).unwrap();
        let velocity = masseter_can::canopen::ObjectAddress::new(0x6081, 0);
        assert_eq!(line.read_number(L1, velocity).unwrap(), 77);
        assert!(owed_axes(folder.path()).is_empty());
    }
}
