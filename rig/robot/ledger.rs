//! Old values that a jog or a homing owes to a drive: a file for each axis, which only a killed step leaves.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{anyhow, ensure};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::bringup::{Ledger, Line, LineError, OldValue, give_back, object_name, value_text};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{CanConfig, ObjectKey, Scenario};
use masseter_terminal::{Failure, status};
use serde::{Deserialize, Serialize};

use super::damaged::{Damage, DamagedFile, check_old_value, parse};
use super::identity::Identity;
use super::robot_line::failed;
use super::writing::prove_off;

/// How long the line listens for other masters before the drives get their old values, ns.
const LISTEN_NS: u64 = 500 * MILLISECOND_NS;

/// What one drive is owed.
#[derive(Debug, Serialize, Deserialize)]
struct Owed {
    /// The drive.
    drive: Identity,
    /// The oldest change first.
    values: Vec<OldValue>,
}

/// What to do about a damaged file, and about one whose values the drive does not keep. The drive itself returns to its
/// old values when it restarts: no step stores reduced ones.
const REMEDY: &str =
    "remove it, and switch the drive's supply off and on, which brings its stored values back";

impl Owed {
    /// What a file says.
    fn checked(path: &Path) -> Result<Self, Damage> {
        let owed: Self = parse(path)?;
        owed.values.iter().try_for_each(|old| check_old_value(old.object, old.bytes))?;
        Ok(owed)
    }

    /// What the drive of an axis is owed; another drive is owed nothing.
    fn read(folder: &Path, line: &mut Line, can: &CanConfig, axis: usize) -> anyhow::Result<Self> {
        let path = file(folder, axis);
        let owed = Self::checked(&path).map_err(|damage| DamagedFile {
            path: path.clone(),
            damage,
            remedy: REMEDY,
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
        line.keep_old_values_in(Box::new(Files::new(folder, [drive; AXES])));
        let refused = give_back(line, axis, &values).map_err(|error| match error {
            // The value stays owed, and every later try may end in the same way.
            LineError::NotKept { .. } => {
                let path = file(folder, axis);
                anyhow!("{error}; {} keeps this old value: mend the drive, or {REMEDY}", path.display())
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

/// The files in the folder of the bring-up.
#[derive(Debug)]
pub(super) struct Files {
    folder: PathBuf,
    drives: [Identity; AXES],
}

impl Files {
    /// Files for these drives.
    pub(super) fn new(folder: &Path, drives: [Identity; AXES]) -> Self {
        Self { folder: folder.to_owned(), drives }
    }
}

impl Ledger for Files {
    /// Completely or not at all, also after a power cut.
    fn keep(&mut self, axis: usize, values: &[OldValue]) -> io::Result<()> {
        let path = file(&self.folder, axis);
        if values.is_empty() {
            if path.exists() {
                fs::remove_file(path)?;
                File::open(&self.folder)?.sync_all()?;
            }
            return Ok(());
        }
        let owed = Owed { drive: self.drives[axis], values: values.to_vec() };
        let unfinished = path.with_extension("part");
        let mut part = File::create(&unfinished)?;
        part.write_all(serde_json::to_string_pretty(&owed)?.as_bytes())?;
        part.sync_all()?;
        fs::rename(unfinished, path)?;
        File::open(&self.folder)?.sync_all()
    }
}

fn file(folder: &Path, axis: usize) -> PathBuf {
    folder.join(format!("borrowed-{}.json", AXIS_NAMES[axis]))
}

/// The axes whose drives a killed step left with reduced values.
pub(super) fn owed_axes(folder: &Path) -> Vec<usize> {
    (0..AXES).filter(|&axis| file(folder, axis).exists()).collect()
}

/// What to do about such a drive.
pub(super) fn advice(folder: &Path, axis: usize) -> String {
    format!(
        "{}: a killed step left reduced values in the drive ({}); the next jog, home, check-pose, configure or restore \
         writes the old ones back",
        AXIS_NAMES[axis],
        file(folder, axis).display()
    )
}

/// Writes old values back that a killed step left, and says so. Without such values nothing is sent.
///
/// # Errors
/// When a drive is another one, has power, or does not take a value.
pub(super) fn settle(
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
        fs::write(file(folder.path(), L1), owed).unwrap();
        (folder, scenario, line)
    }

    const VELOCITY: &str = r#"{ "object": "6081h", "value": 77, "bytes": 4 }"#;

    #[test]
    fn a_damaged_file_is_refused_and_nothing_is_written() {
        for old in [
            r#"{ "object": "6081h", "value": 77, "bytes": 3 }"#,
            r#"{ "object": "6081h", "value": 77, "bytes": 40 }"#,
            r#"{ "object": "6040h", "value": 15, "bytes": 2 }"#,
            r#"{ "object": "6081h", "value": 77"#,
        ] {
            let (folder, scenario, mut line) = robot("", old);
            let refusal = settle(folder.path(), &scenario, &mut line, false).unwrap_err().error.to_string();
            assert!(refusal.contains("the file is damaged: remove it"), "{refusal}");
            assert_eq!(owed_axes(folder.path()), [L1]);
        }
    }

    #[test]
    fn a_value_that_does_not_return_stays_owed_and_the_refusal_names_the_file() {
        let liar = "[[drives.quirk]]\naxes = ['l1']\nkind = 'shows'\nobjects = ['6081h']\nvalue = 5";
        let (folder, scenario, mut line) = robot(liar, VELOCITY);
        let refusal = settle(folder.path(), &scenario, &mut line, false).unwrap_err().error.to_string();
        assert!(refusal.contains("shows 5; ") && refusal.contains("borrowed-l1.json keeps"), "{refusal}");
        assert_eq!(owed_axes(folder.path()), [L1]);
    }

    #[test]
    fn a_silent_drive_is_no_other_drive() {
        let cable = "[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 4\nfrom_s = 0.0";
        let (folder, scenario, mut line) = robot(cable, VELOCITY);
        let refusal = settle(folder.path(), &scenario, &mut line, false).unwrap_err().error.to_string();
        assert!(refusal.starts_with("l1: object 1018h:01h: no answer; check its power"), "{refusal}");
    }

    #[test]
    fn a_drive_with_power_gets_its_old_values_once_it_may_be_stopped() {
        let (folder, scenario, mut line) = robot("", VELOCITY);
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON] {
            line.control(L1, word).unwrap();
        }
        line.listen(LISTEN_NS).unwrap();
        assert!(settle(folder.path(), &scenario, &mut line, false).is_err());
        settle(folder.path(), &scenario, &mut line, true).unwrap();
        let velocity = masseter_can::canopen::ObjectAddress::new(0x6081, 0);
        assert_eq!(line.read_number(L1, velocity).unwrap(), 77);
        assert!(owed_axes(folder.path()).is_empty());
    }
}
