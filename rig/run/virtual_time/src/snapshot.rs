//! The state of a rig at an instant, in memory and in files.
//!
//! A file has the magic number, the version of its format, a checksum of the rest, and what it belongs to: the sources of
//! the build, the scenario's name, seed and keys. Then follows the state, in the encoding of postcard. A file is read into
//! a rig of its scenario alone.

#[cfg(test)]
mod tests;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::{fs::Permissions, os::unix::fs::PermissionsExt, sync::Arc};

use masseter_scenario::{Scenario, input::read_bytes};
use serde::{Deserialize, Serialize};

use crate::{log::Latest, stepper::StepperState};

/// What a file begins with.
const MAGIC: [u8; 8] = *b"MASSETER";
/// The version of the format: of the bytes before the state.
const FORMAT: u32 = 1;
/// The digest of the sources of this build.
const SOURCES: &str = env!("MASSETER_SOURCES");
/// No state is as large: a delay of an encoder keeps most.
const MOST_BYTES: u64 = 64 << 20;

/// A snapshot is one of another scenario or seed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OtherScenario {
    /// Of another name or seed.
    #[error(
        "the snapshot is of scenario '{snapshot}', seed {snapshot_seed}, the rig of scenario '{rig}', seed {rig_seed}; \
         make a rig of the snapshot's scenario and seed"
    )]
    Other {
        /// Name of the snapshot's scenario.
        snapshot: String,
        /// Its seed.
        snapshot_seed: u64,
        /// Name of the rig's scenario.
        rig: String,
        /// Its seed.
        rig_seed: u64,
    },
    /// Of the same name and seed.
    #[error(
        "the snapshot is of a scenario '{name}' with other values of its keys than the rig's; make a rig of the \
         snapshot's scenario"
    )]
    OtherKeys {
        /// Name of both scenarios.
        name: String,
    },
}

impl OtherScenario {
    /// Refuses a snapshot of another scenario than the rig's.
    pub(crate) fn refuse(rig: &Arc<Scenario>, snapshot: &Arc<Scenario>) -> Result<(), Self> {
        let is_same = Arc::ptr_eq(rig, snapshot) || Belonging::to(rig) == Belonging::to(snapshot);
        if is_same { Ok(()) } else { Err(Self::new(rig, &snapshot.name, snapshot.seed)) }
    }

    /// The refusal of a snapshot of a scenario with this name and seed.
    fn new(rig: &Scenario, name: &str, seed: u64) -> Self {
        if (&*rig.name, rig.seed) == (name, seed) {
            return Self::OtherKeys { name: name.to_owned() };
        }
        Self::Other {
            snapshot: name.to_owned(),
            snapshot_seed: seed,
            rig: rig.name.clone(),
            rig_seed: rig.seed,
        }
    }
}

/// A snapshot cannot be written into a file, or read from one.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct SnapshotError {
    /// The file.
    pub path: PathBuf,
    /// The defect.
    pub problem: SnapshotProblem,
}

/// A defect of the file of a snapshot.
#[derive(Debug, thiserror::Error)]
pub enum SnapshotProblem {
    /// The file cannot be read or written.
    #[error("{0}; check the path")]
    File(#[from] io::Error),
    /// The file is another one.
    #[error("the file is no snapshot of a rig; name one that `write_to` has written")]
    NoSnapshot,
    /// The format is another one.
    #[error(
        "the snapshot has version {0} of the format, and this build reads version {FORMAT}; take it again"
    )]
    Version(u32),
    /// The content is not as it was written.
    #[error("the snapshot is cut short or damaged; take it again")]
    Damaged,
    /// The sources of the build that wrote it are others.
    #[error("another build of the rig has written the snapshot; take it again with this one")]
    OtherBuild,
    /// The rig is another one.
    #[error(transparent)]
    OtherScenario(#[from] OtherScenario),
    /// A table of the scenario is another one.
    #[error(
        "a file that the scenario names has changed since the snapshot; restore the file, or take the snapshot again"
    )]
    OtherTable,
}

/// The state of a rig at an instant, to go on from there again and again. It holds mechanism, drives, buses with
/// their error counters, master, faults and random streams, and what the rig published last.
///
/// It does not hold the caller's controller, nor any file. A rig reads tables of pushes and the memory of the drives
/// when it is made and at a reset. It writes no file, so what drives store stays in the rig.
///
/// ```
/// use masseter_runtime::messages::Command;
/// use masseter_scenario::Scenario;
/// use masseter_virtual_time::Rig;
///
/// let scenario = Scenario::default();
/// let mut rig = Rig::new(&scenario, 7)?;
/// for _ in 0..100 {
///     rig.step(&Command::default())?;
/// }
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("after-100-steps.snapshot");
/// rig.snapshot().write_to(&path)?;
/// let reading = *rig.step(&Command::default())?;
///
/// let mut other = Rig::new(&scenario, 7)?;
/// let snapshot = other.read_snapshot(&path)?;
/// other.restore(&snapshot)?;
/// assert_eq!(*other.step(&Command::default())?, reading);
/// # Ok::<(), anyhow::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Snapshot {
    pub(crate) scenario: Arc<Scenario>,
    pub(crate) stepper: StepperState,
    pub(crate) latest: Latest,
    pub(crate) has_failed: bool,
}

impl Snapshot {
    /// Writes the snapshot into a file, as a whole or not at all. [`Rig::read_snapshot`](crate::Rig::read_snapshot)
    /// reads it.
    ///
    /// # Errors
    /// When the file cannot be written.
    #[inline]
    pub fn write_to(&self, path: &Path) -> Result<(), SnapshotError> {
        let failed = |error: io::Error| SnapshotError { path: path.to_owned(), problem: error.into() };
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let as_other_files = Permissions::from_mode(0o666);
        let unfinished = tempfile::Builder::new().permissions(as_other_files).tempfile_in(folder);
        let mut unfinished = unfinished.map_err(failed)?;
        unfinished.write_all(&self.encode()).map_err(failed)?;
        unfinished.persist(path).map_err(|error| failed(error.error))?;
        Ok(())
    }

    /// The snapshot of a file, in place of this one of the same scenario and seed.
    #[inline]
    pub(crate) fn replaced_by(self, path: &Path) -> Result<Self, SnapshotError> {
        let bytes = read_bytes(path, MOST_BYTES).map_err(SnapshotProblem::File);
        let replaced = bytes.and_then(|bytes| self.decoded(&bytes));
        replaced.map_err(|problem| SnapshotError { path: path.to_owned(), problem })
    }

    /// The bytes of a file.
    #[inline]
    pub(crate) fn encode(&self) -> Vec<u8> {
        let Self { scenario, stepper, latest, has_failed } = self;
        let content = postcard::to_allocvec(&(Belonging::to(scenario), stepper, latest, has_failed));
        framed(FORMAT, &content.expect("every value has an encoding"))
    }

    /// The snapshot of these bytes, in place of this one.
    #[inline]
    pub(crate) fn decoded(self, bytes: &[u8]) -> Result<Self, SnapshotProblem> {
        let (own, content) = (Belonging::to(&self.scenario), content(bytes)?);
        let damaged = |_| SnapshotProblem::Damaged;
        let (found, state) = postcard::take_from_bytes::<Belonging>(content).map_err(damaged)?;
        if found.sources != own.sources {
            return Err(SnapshotProblem::OtherBuild);
        }
        if found != own {
            return Err(OtherScenario::new(&self.scenario, &found.name, found.seed).into());
        }
        let ((mut stepper, latest, has_failed), rest) =
            postcard::take_from_bytes::<(StepperState, Latest, bool)>(state).map_err(damaged)?;
        if !rest.is_empty() {
            return Err(SnapshotProblem::Damaged);
        }
        if !stepper.take_tables_of(&self.stepper) {
            return Err(SnapshotProblem::OtherTable);
        }
        Ok(Self { stepper, latest, has_failed, ..self })
    }
}

/// The bytes of a file with that content.
fn framed(format: u32, content: &[u8]) -> Vec<u8> {
    [&MAGIC[..], &format.to_le_bytes(), &crc32fast::hash(content).to_le_bytes(), content].concat()
}

/// What the checksum of a file is of.
fn content(bytes: &[u8]) -> Result<&[u8], SnapshotProblem> {
    let rest = bytes.strip_prefix(&MAGIC).ok_or(SnapshotProblem::NoSnapshot)?;
    let (version, rest) = rest.split_first_chunk().ok_or(SnapshotProblem::Damaged)?;
    let version = u32::from_le_bytes(*version);
    if version != FORMAT {
        return Err(SnapshotProblem::Version(version));
    }
    let (checksum, content) = rest.split_first_chunk().ok_or(SnapshotProblem::Damaged)?;
    let is_whole = crc32fast::hash(content) == u32::from_le_bytes(*checksum);
    if is_whole { Ok(content) } else { Err(SnapshotProblem::Damaged) }
}

/// What a file belongs to.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Belonging {
    sources: String,
    name: String,
    seed: u64,
    /// Checksum of all keys of the scenario.
    keys: u32,
}

impl Belonging {
    fn to(scenario: &Scenario) -> Self {
        Self {
            sources: SOURCES.to_owned(),
            name: scenario.name.clone(),
            seed: scenario.seed,
            keys: crc32fast::hash(scenario.to_toml().as_bytes()),
        }
    }
}
