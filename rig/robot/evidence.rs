//! What a step of the bring-up leaves behind: a numbered folder with the log of the buses and `result.json`.
//!
//! A result counts for the drives and the profiles with which it was made. It is written as not passed when a step begins,
//! and replaced when the step ends: a killed step proves nothing.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use masseter_model::geometry::{AXES, AXIS_NAMES, MechanismConfig};
use masseter_recording::RunFolder;
use masseter_runtime::clock;
use masseter_scenario::Scenario;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::identity::{Known, NOT_ASKED};
use super::step::Step;

/// What a result depends on: another drive or another profile makes it outdated.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Basis {
    /// Hash of everything that decides the objects and the scales of the drives.
    pub(crate) profile_hash: String,
    /// The drives.
    pub(crate) drives: [Known; AXES],
}

impl Basis {
    /// Of the scenario's profiles, interfaces, mechanism and jaw, and of these drives. Limits of a run do not count: a run writes
    /// them itself, and a dry run has others.
    pub(crate) fn new(scenario: &Scenario, drives: [Known; AXES]) -> Self {
        let mut hasher = crc32fast::Hasher::new();
        let mut mechanism = scenario.mechanism.clone();
        mechanism.strokes = MechanismConfig::default().strokes;
        // Evidence of emulated drives is none of real ones.
        let place = format!("{:?}{:?}{:?}", scenario.can.interfaces, scenario.jaw, mechanism);
        hasher.update(place.as_bytes());
        for (axis, node) in scenario.can.node_ids.into_iter().enumerate() {
            let parts = format!("{node}{:?}{:?}", scenario.profile(axis), scenario.scale(axis));
            hasher.update(parts.as_bytes());
        }
        Self { profile_hash: format!("{:08x}", hasher.finalize()), drives }
    }
}

/// `result.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Evidence {
    /// Name of the step.
    pub(crate) step: String,
    /// When it began, UTC.
    pub(crate) started: String,
    /// Whether it ended well.
    pub(crate) passed: bool,
    /// See [`Basis`].
    pub(crate) profile_hash: String,
    /// See [`Basis`].
    pub(crate) drives: [Known; AXES],
    /// Whether the steps before were there.
    pub(crate) in_order: bool,
    /// The axes of which it is evidence.
    pub(crate) axes: Vec<String>,
    /// The step's own data.
    pub(crate) result: Value,
}

impl Evidence {
    /// Whether it is about an axis.
    pub(crate) fn is_about(&self, axis: usize) -> bool {
        self.axes.iter().any(|name| name == AXIS_NAMES[axis])
    }
}

/// The folder of a step under way.
#[derive(Debug)]
pub(crate) struct StepFolder {
    folder: RunFolder,
    evidence: Evidence,
}

impl StepFolder {
    /// Makes the next folder, with a result that is not passed. The drives are not known yet.
    ///
    /// # Errors
    /// When the folder cannot be written, or the scenario has no right profiles.
    pub(crate) fn begin(
        parent: &Path,
        step: Step,
        axes: &[usize],
        scenario: &Scenario,
    ) -> anyhow::Result<Self> {
        let number = numbered(parent)?.last().map_or(1, |(number, _)| number + 1);
        let folder = RunFolder::create(&parent.join(format!("{number:02}-{step}")))?;
        let Basis { profile_hash, drives } = Basis::new(scenario, NOT_ASKED);
        let begun = Self {
            folder,
            evidence: Evidence {
                step: step.to_string(),
                started: humantime::format_rfc3339_seconds(UNIX_EPOCH + clock::wall_time()).to_string(),
                passed: false,
                profile_hash,
                drives,
                in_order: true,
                axes: axes.iter().map(|&axis| AXIS_NAMES[axis].to_owned()).collect(),
                result: Value::Null,
            },
        };
        begun.write()?;
        Ok(begun)
    }

    /// The log of the buses, for a line.
    ///
    /// # Errors
    /// When the file cannot be made.
    pub(crate) fn log(&self) -> io::Result<Box<dyn Write + Send>> {
        Ok(Box::new(BufWriter::new(File::create(self.folder.file("candump.log"))?)))
    }

    /// Writes a further file of the step.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn keep(&self, name: &str, text: &str) -> io::Result<()> {
        self.folder.keep(&self.folder.file(name), text)
    }

    /// The folder itself.
    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// What this step's result depends on, with the drives as far as they are noted.
    pub(crate) fn basis(&self) -> Basis {
        let Evidence { profile_hash, drives, .. } = self.evidence.clone();
        Basis { profile_hash, drives }
    }

    /// Notes that the step was made without the steps before: it shows something, but counts for no further step.
    pub(crate) fn note_out_of_order(&mut self) {
        self.evidence.in_order = false;
    }

    /// Notes who the drives are.
    pub(crate) fn note_drives(&mut self, drives: [Known; AXES]) {
        self.evidence.drives = drives;
    }

    /// Replaces the result by that of the ended step.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn finish(mut self, passed: bool, result: &impl Serialize) -> anyhow::Result<()> {
        (self.evidence.passed, self.evidence.result) = (passed, serde_json::to_value(result)?);
        Ok(self.write()?)
    }

    fn write(&self) -> io::Result<()> {
        self.keep("result.json", &(serde_json::to_string_pretty(&self.evidence)? + "\n"))
    }
}

/// The folders of past steps with their numbers, the oldest first; none where there is no folder yet.
///
/// # Errors
/// When the folder cannot be read.
pub(crate) fn numbered(parent: &Path) -> io::Result<Vec<(u32, PathBuf)>> {
    let entries = match parent.read_dir() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let number = |path: PathBuf| {
        let (number, _) = path.file_name()?.to_str()?.split_once('-')?;
        Some((number.parse().ok()?, path))
    };
    let mut found: Vec<_> = entries.filter_map(|entry| number(entry.ok()?.path())).collect();
    found.sort();
    Ok(found)
}
