//! Old values that a jog or a homing owes to a drive: a file for each axis, which only a killed step leaves.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use masseter_can::canopen::ObjectAddress;
use masseter_plant::bringup::{Ledger, Line, OldValue, give_back, object_name, prove_no_power, value_text};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::{ObjectKey, Scenario};
use masseter_shared::geometry::{AXES, AXIS_NAMES};
use masseter_terminal::status;
use serde::{Deserialize, Serialize};

/// How long the line listens for other masters before the drives get their old values, ns.
const LISTEN_NS: u64 = 500 * MILLISECOND_NS;

/// What one drive is owed.
#[derive(Debug, Serialize, Deserialize)]
struct Owed {
    /// Its serial number; none where the drive has none.
    serial: Option<u32>,
    /// The oldest change first.
    values: Vec<OldValue>,
}

/// The files in the folder of the bring-up.
#[derive(Debug)]
pub(super) struct Files {
    folder: PathBuf,
    serials: [Option<u32>; AXES],
}

impl Files {
    /// Files for drives with these serial numbers.
    pub(super) fn new(folder: &Path, serials: [Option<u32>; AXES]) -> Self {
        Self { folder: folder.to_owned(), serials }
    }
}

impl Ledger for Files {
    /// Completely or not at all, also after a power cut.
    fn keep(&mut self, axis: usize, values: &[OldValue]) -> io::Result<()> {
        let path = file(&self.folder, axis);
        if values.is_empty() {
            return if path.exists() { fs::remove_file(path) } else { Ok(()) };
        }
        let owed = Owed { serial: self.serials[axis], values: values.to_vec() };
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
pub(super) fn settle(folder: &Path, scenario: &Scenario, line: &mut Line) -> anyhow::Result<()> {
    let axes = owed_axes(folder);
    if axes.is_empty() {
        return Ok(());
    }
    line.listen(LISTEN_NS)?;
    let masters = &line.strangers().masters;
    ensure!(masters.is_empty(), "another master may control the drives; end that master first");
    axes.into_iter().try_for_each(|axis| settle_axis(folder, scenario, line, axis))
}

fn settle_axis(folder: &Path, scenario: &Scenario, line: &mut Line, axis: usize) -> anyhow::Result<()> {
    let (name, path) = (AXIS_NAMES[axis], file(folder, axis));
    let text = fs::read_to_string(&path)?;
    let Owed { serial, values } = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    let found = line.read_number(axis, ObjectAddress::new(0x1018, 4)).ok();
    ensure!(
        found == serial,
        "{name}: {} has the old values of a drive with another serial number (1018h:04); put that drive back, or remove \
         the file",
        path.display()
    );
    let noise = scenario.scale(axis).window(scenario.profile(axis).homing.tolerance_m);
    prove_no_power(line, axis, noise)?;
    line.keep_old_values_in(Box::new(Files::new(folder, std::array::from_fn(|_| serial))));
    give_back(line, axis, scenario.profile(axis), &values)?;
    status!("{name}: a step was killed; the drive has its old values again:");
    for OldValue { object: ObjectKey(object), value, .. } in values {
        status!("  {object} {}: {}", object_name(object), value_text(object, value));
    }
    Ok(())
}
