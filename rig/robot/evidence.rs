//! What the steps of the bring-up leave behind, and whether a further step may rely on it.
//!
//! Each step has a numbered folder with the log of the buses and `result.json`. A result counts for the drives and
//! the profiles with which it was made. It is written as not passed when a step begins, and replaced when the step
//! ends: a killed step proves nothing.

use std::io::{self, BufRead, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::{fs::File, time::UNIX_EPOCH};

use masseter_commissioning::{Identity, Known, NOT_ASKED};
use masseter_model::geometry::AXIS_NAMES;
use masseter_recording::RunFolder;
use masseter_runtime::clock;
use masseter_scenario::{Scenario, input::open_regular};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use sha1::{Digest, Sha1};

use super::basis::{Basis, Difference};
use super::ledger::{Nameless, before_file, parse_file};
use super::step::Step;

/// The log of the buses in the folder of a step.
const LOG: &str = "candump.log";

/// `result.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Evidence {
    /// The folder that it was read from.
    #[serde(skip)]
    pub(crate) folder: PathBuf,
    /// Digest (SHA-1) of the rest and of the log of the buses; empty while the step is under way.
    digest: String,
    pub(crate) step: Step,
    /// When the step began, UTC.
    pub(crate) started: String,
    /// Whether it ended well.
    pub(crate) passed: bool,
    #[serde(flatten)]
    pub(crate) basis: Basis,
    /// Whether the steps before were there. Without them it shows something, but counts for no further step.
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

    /// The digest of result and log in a folder. Whoever edits either by hand shows; no secret keeps anybody from a new digest.
    fn digest_in(&self, folder: &Path) -> anyhow::Result<String> {
        let mut hasher = Sha1::new();
        hasher.update(serde_json::to_vec(&Self { digest: String::new(), ..self.clone() })?);
        match open_regular(&folder.join(LOG)) {
            Ok(log) => {
                let mut log = BufReader::new(log);
                while let bytes = log.fill_buf()?
                    && !bytes.is_empty()
                {
                    let read = bytes.len();
                    hasher.update(bytes);
                    log.consume(read);
                }
            }
            // A dry run has its log in the folder of the run.
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(error.into()),
        }
        Ok(data_encoding::HEXLOWER.encode(&hasher.finalize()))
    }

    /// The step's own data.
    ///
    /// # Errors
    /// When it is not what such a step writes.
    pub(crate) fn result_as<T: DeserializeOwned>(&self) -> serde_json::Result<T> {
        T::deserialize(&self.result)
    }
}

/// The folder of a step under way.
#[derive(Debug)]
pub(crate) struct StepFolder {
    pub(crate) files: RunFolder,
    /// What is written at the end; the step notes here who the drives are.
    pub(crate) evidence: Evidence,
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
        let number = numbered_folders(parent)?.last().map_or(1, |(number, _)| number + 1);
        let files = RunFolder::create(&parent.join(format!("{number:02}-{step}")))?;
        let evidence = Evidence {
            folder: PathBuf::new(),
            step,
            started: humantime::format_rfc3339_seconds(UNIX_EPOCH + clock::wall_time()).to_string(),
            passed: false,
            digest: String::new(),
            basis: Basis::new(scenario, NOT_ASKED),
            in_order: true,
            axes: axes.iter().map(|&axis| AXIS_NAMES[axis].to_owned()).collect(),
            result: Value::Null,
        };
        let begun = Self { files, evidence };
        begun.write_result()?;
        Ok(begun)
    }

    /// The log of the buses, for a line.
    ///
    /// # Errors
    /// When the file cannot be made.
    pub(crate) fn log(&self) -> io::Result<Box<dyn Write + Send>> {
        Ok(Box::new(BufWriter::new(File::create(self.files.file(LOG))?)))
    }

    /// Writes a further file of the step.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn keep(&self, name: &str, text: &str) -> io::Result<()> {
        self.files.keep(&self.files.file(name), text)
    }

    /// Replaces the result by that of the ended step. The log must be complete.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(crate) fn finish_step(mut self, passed: bool, result: &impl Serialize) -> anyhow::Result<()> {
        (self.evidence.passed, self.evidence.result) = (passed, serde_json::to_value(result)?);
        self.evidence.digest = self.evidence.digest_in(self.files.path())?;
        Ok(self.write_result()?)
    }

    fn write_result(&self) -> io::Result<()> {
        self.keep("result.json", &(serde_json::to_string_pretty(&self.evidence)? + "\n"))
    }
}

/// The folders of past steps with their numbers, the oldest first; none where there is no folder yet.
fn numbered_folders(parent: &Path) -> io::Result<Vec<(u32, PathBuf)>> {
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

/// Why a step has no evidence that counts.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Lack {
    /// It was never made.
    #[error("not done")]
    Missing,
    /// The newest one did not pass, or was killed.
    #[error("not passed at {0}")]
    NotPassed(String),
    /// The scenario decides other objects or scales, or the build is another one.
    #[error("outdated: {0}")]
    OtherBasis(Box<Difference>),
    /// The folder does not have its digest.
    #[error("edited: result.json and candump.log are not as the step of {0} left them")]
    Edited(String),
    /// The drive is another one, or its identity has fewer or more numbers.
    #[error("outdated: the drive's {}", .now.differs_from(before))]
    OtherDrive { before: Identity, now: Identity },
    /// Nobody asked the drive then.
    #[error("outdated: nobody knows which drive it was at {0}")]
    NobodyAsked(String),
    /// The drives got their old objects again.
    #[error("outdated: restored at {0}")]
    Restored(String),
    /// An earlier step was made again since then.
    #[error("outdated: {step} again at {at}")]
    Repeated { step: Step, at: String },
    /// It was made with `--out-of-order`.
    #[error("made out of order at {0}")]
    OutOfOrder(String),
}

/// A step that must pass first.
#[derive(Debug, thiserror::Error)]
#[error(
    "{}: {step} {lack} (evidence in {}); run '{}' first", AXIS_NAMES[*axis], .folder.display(), step.command()
)]
pub(crate) struct EarlierStep {
    axis: usize,
    step: Step,
    lack: Lack,
    folder: PathBuf,
}

/// All past steps.
#[derive(Debug)]
pub(crate) struct Past {
    folder: PathBuf,
    /// Oldest first.
    pub(crate) steps: Vec<Evidence>,
    /// Folders without a readable result.
    damaged: Vec<PathBuf>,
}

impl Past {
    /// Reads the evidence in a folder. A folder without a readable result proves nothing and is no step.
    ///
    /// # Errors
    /// When the folder itself cannot be read.
    pub(crate) fn read(parent: &Path) -> anyhow::Result<Self> {
        let mut past = Self { folder: parent.to_owned(), steps: Vec::new(), damaged: Vec::new() };
        for (_, folder) in numbered_folders(parent)? {
            match parse_file::<Evidence>(&folder.join("result.json")) {
                Ok(evidence) => past.steps.push(Evidence { folder, ..evidence }),
                Err(_) => past.damaged.push(folder),
            }
        }
        Ok(past)
    }

    /// Refuses old values of an axis without a readable result: they may be those of another drive.
    ///
    /// # Errors
    /// With the file.
    pub(super) fn check_old_values(&self, axis: usize) -> Result<(), Nameless> {
        let mut files = self.damaged.iter().map(|folder| folder.join(before_file(axis)));
        files.find(|file| file.exists()).map_or(Ok(()), |file| Err(Nameless(file)))
    }

    /// The newest evidence of a step for an axis.
    pub(crate) fn newest(&self, step: Step, axis: usize) -> Option<&Evidence> {
        self.places_of(step, axis).next_back().map(|place| &self.steps[place])
    }

    /// The places of a step for an axis among all, the oldest first.
    fn places_of(&self, step: Step, axis: usize) -> impl DoubleEndedIterator<Item = usize> {
        let is_it = move |evidence: &Evidence| evidence.step == step && evidence.is_about(axis);
        (0..self.steps.len()).filter(move |&place| is_it(&self.steps[place]))
    }

    /// Why the evidence at a place is outdated by what came after, if so: positions follow from objects and home.
    fn outdated(&self, step: Step, axis: usize, place: usize) -> Option<Lack> {
        let since = |earlier: Step| {
            // A step that writes keeps the old values first: without them nothing was written to the drive.
            let may_have_acted = |evidence: &Evidence| {
                !matches!(earlier, Step::Configure | Step::Restore)
                    || evidence.folder.join(before_file(axis)).exists()
            };
            let newer = self.places_of(earlier, axis).filter(|&newer| newer > place);
            let mut steps = newer.map(|newer| &self.steps[newer]);
            Some(steps.rfind(|evidence| may_have_acted(evidence))?.started.clone())
        };
        if step >= Step::Configure
            && let Some(at) = since(Step::Restore)
        {
            return Some(Lack::Restored(at));
        }
        // A jog and a proof of the watchdogs take the mark of power out of the drive, and home sets the zero for good.
        let earlier: &[Step] = match step {
            Step::Watchdog | Step::Home => &[Step::Configure],
            Step::CheckPose => &[Step::Configure, Step::Jog(axis), Step::Watchdog, Step::Home],
            Step::DryRun => &[Step::Configure, Step::Jog(axis), Step::Watchdog, Step::Home, Step::CheckPose],
            _ => &[],
        };
        earlier.iter().find_map(|&step| Some(Lack::Repeated { step, at: since(step)? }))
    }

    /// Why the newest evidence of a step does not count for an axis, if so. A drive that is not asked is not compared.
    ///
    /// # Errors
    /// The reason.
    pub(crate) fn check_step(&self, step: Step, axis: usize, basis: &Basis) -> Result<&Evidence, Lack> {
        let place = self.places_of(step, axis).next_back().ok_or(Lack::Missing)?;
        let evidence = &self.steps[place];
        let at = || evidence.started.clone();
        if let Some(lack) = self.outdated(step, axis, place) {
            return Err(lack);
        }
        if !evidence.passed {
            return Err(Lack::NotPassed(at()));
        }
        if !evidence.in_order {
            return Err(Lack::OutOfOrder(at()));
        }
        if !evidence.digest_in(&evidence.folder).is_ok_and(|digest| digest == evidence.digest) {
            return Err(Lack::Edited(at()));
        }
        if let Some(difference) = evidence.basis.difference(basis) {
            return Err(Lack::OtherBasis(Box::new(difference)));
        }
        match (evidence.basis.drives[axis], basis.drives[axis]) {
            (Known::Is(before), Known::Is(now)) if before != now => Err(Lack::OtherDrive { before, now }),
            (Known::NotAsked, Known::Is(_)) => Err(Lack::NobodyAsked(at())),
            (_, Known::NotAsked) | (Known::Is(_), Known::Is(_)) => Ok(evidence),
        }
    }

    /// Refuses to go on unless an earlier step passed for these axes, with the same drives and profiles.
    ///
    /// # Errors
    /// [`EarlierStep`], which names the command to run first.
    pub(crate) fn require(&self, step: Step, axes: &[usize], basis: &Basis) -> Result<(), EarlierStep> {
        axes.iter().try_for_each(|&axis| {
            let folder = self.folder.clone();
            self.check_step(step, axis, basis).map(drop).map_err(|lack| EarlierStep {
                axis,
                step,
                lack,
                folder,
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use masseter_commissioning::Entry;
    use masseter_model::geometry::AXES;

    use super::*;

    const SERIALS: [Entry; AXES] =
        [Entry::Told(1), Entry::Told(2), Entry::Told(3), Entry::Told(4), Entry::Told(5), Entry::Told(6)];
    const ALL: [usize; AXES] = [0, 1, 2, 3, 4, 5];

    /// Six drives with these serial numbers.
    fn drives(serials: [Entry; AXES]) -> [Known; AXES] {
        let [vendor, product, revision] = [0x004D_5354, 0x402, 0x1_0000].map(Entry::Told);
        let drive =
            |axis| Identity { node: axis as u8 + 1, vendor, product, revision, serial: serials[axis] };
        std::array::from_fn(|axis| Known::Is(drive(axis)))
    }

    fn leave_step(parent: &Path, step: Step, axes: &[usize], passed: Option<bool>) {
        let mut folder = StepFolder::begin(parent, step, axes, &Scenario::default()).unwrap();
        folder.evidence.basis.drives = drives(SERIALS);
        if [Step::Configure, Step::Restore].contains(&step) {
            for &axis in axes {
                folder.keep(&before_file(axis), "").unwrap();
            }
        }
        if let Some(passed) = passed {
            folder.finish_step(passed, &"data").unwrap();
        }
    }

    fn refusal(parent: &Path, step: Step, axes: &[usize], basis: &Basis) -> Option<String> {
        Past::read(parent).unwrap().require(step, axes, basis).err().map(|error| error.lack.to_string())
    }

    #[test]
    fn evidence_counts_for_the_same_drives_and_profiles_alone() {
        let folder = tempfile::tempdir().unwrap();
        let parent = folder.path().join("bringup");
        let basis = Basis::new(&Scenario::default(), drives(SERIALS));
        let check = |basis: &Basis| refusal(&parent, Step::Inspect, &ALL, basis);
        let error =
            Past::read(&parent).unwrap().require(Step::Inspect, &[3], &basis).unwrap_err().to_string();
        assert!(error.starts_with("l1: inspect not done (evidence in"), "{error}");
        assert!(error.ends_with("run 'masseter robot inspect' first"), "{error}");
        leave_step(&parent, Step::Inspect, &ALL, Some(true));
        assert_eq!(check(&basis), None);
        let exchanged = |serial| {
            let serials = [[1, 2, 3, 4, 5].map(Entry::Told).as_slice(), &[serial]].concat();
            check(&Basis { drives: drives(serials.try_into().unwrap()), ..basis.clone() })
        };
        assert_eq!(exchanged(Entry::Told(6)), None);
        for (serial, says) in [(Entry::Told(7), "7"), (Entry::Absent, "none")] {
            let says = format!("outdated: the drive's serial number was 6, and is {says}");
            assert_eq!(exchanged(serial), Some(says));
        }
        let faster = Scenario { rate_hz: 500, ..Scenario::default() };
        assert_eq!(
            check(&Basis::new(&faster, basis.drives)),
            None,
            "a run writes the objects of its rate itself"
        );
        let mut changed = Scenario::default();
        changed.drives.leg.encoder_resolution_m = 2e-6;
        let changed = Basis::new(&changed, basis.drives);
        assert!(check(&changed).unwrap().starts_with("outdated: axes.l1."), "{:?}", check(&changed));
        leave_step(&parent, Step::Inspect, &ALL, None);
        assert!(check(&basis).unwrap().starts_with("not passed at "), "a killed step proves nothing");
        leave_step(&parent, Step::Inspect, &ALL, Some(true));
        assert_eq!(check(&basis), None);
        assert!(parent.join("03-inspect/result.json").exists());
    }

    #[test]
    fn an_edited_folder_is_no_evidence() {
        let folder = tempfile::tempdir().unwrap();
        let basis = Basis::new(&Scenario::default(), NOT_ASKED);
        let check = || refusal(folder.path(), Step::Inspect, &[3], &basis);
        let mut step = StepFolder::begin(folder.path(), Step::Inspect, &ALL, &Scenario::default()).unwrap();
        step.evidence.basis.drives = drives(SERIALS);
        step.keep(LOG, "(0.0) can0 080#\n").unwrap();
        let (result, log) = (step.files.file("result.json"), step.files.file(LOG));
        step.finish_step(false, &"data").unwrap();
        let failed = fs::read_to_string(&result).unwrap();
        fs::write(&result, failed.replace("\"passed\": false", "\"passed\": true")).unwrap();
        assert!(check().unwrap().starts_with("edited: result.json and candump.log are not as the step of "));
        leave_step(folder.path(), Step::Inspect, &ALL, Some(true));
        assert_eq!(check(), None);
        let newest = folder.path().join("02-inspect");
        fs::write(newest.join(LOG), "(0.0) can0 080#\n").unwrap();
        assert!(check().unwrap().starts_with("edited: "), "a log that the step did not write");
        assert!(log.exists());
    }

    /// A pose that was checked before the axes were homed again is no evidence for the new zeros.
    #[test]
    fn a_step_that_is_repeated_outdates_those_after_it_and_one_out_of_order_counts_for_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let basis = Basis::new(&Scenario::default(), NOT_ASKED);
        let check = |step, axis| refusal(folder.path(), step, &[axis], &basis);
        leave_step(folder.path(), Step::Home, &ALL, Some(true));
        leave_step(folder.path(), Step::CheckPose, &ALL, Some(true));
        assert_eq!(check(Step::CheckPose, 3), None);
        leave_step(folder.path(), Step::Home, &[3], Some(false));
        assert!(check(Step::CheckPose, 3).unwrap().starts_with("outdated: home again at "));
        assert_eq!(check(Step::CheckPose, 4), None, "another axis");
        leave_step(folder.path(), Step::Home, &ALL, Some(true));
        for step in [Step::CheckPose, Step::DryRun] {
            leave_step(folder.path(), step, &ALL, Some(true));
        }
        leave_step(folder.path(), Step::Jog(3), &[3], Some(true));
        assert_eq!(check(Step::Home, 3), None, "a jog returns what it changes");
        for step in [Step::CheckPose, Step::DryRun] {
            assert!(check(step, 3).unwrap().starts_with("outdated: jog-l1 again at "));
            assert_eq!(check(step, 4), None, "another axis");
        }
        let mut alone =
            StepFolder::begin(folder.path(), Step::CheckPose, &ALL, &Scenario::default()).unwrap();
        alone.evidence.in_order = false;
        alone.finish_step(true, &"data").unwrap();
        assert!(check(Step::CheckPose, 3).unwrap().starts_with("made out of order at "));
    }

    #[test]
    fn a_step_of_one_axis_says_nothing_of_the_others_and_restore_undoes_configure() {
        let folder = tempfile::tempdir().unwrap();
        let basis = Basis::new(&Scenario::default(), NOT_ASKED);
        let check = |axis| refusal(folder.path(), Step::Configure, &[axis], &basis);
        leave_step(folder.path(), Step::Configure, &[3], Some(true));
        assert_eq!((check(3), check(4)), (None, Some("not done".to_owned())));
        leave_step(folder.path(), Step::Configure, &ALL, Some(true));
        assert_eq!((check(3), check(4)), (None, None));
        let refused = StepFolder::begin(folder.path(), Step::Restore, &ALL, &Scenario::default()).unwrap();
        drop(refused);
        assert_eq!((check(3), check(4)), (None, None), "a refused step has written nothing");
        leave_step(folder.path(), Step::Restore, &[3], Some(true));
        assert!(check(3).unwrap().starts_with("outdated: restored at "));
        assert_eq!(check(4), None);
    }
}
