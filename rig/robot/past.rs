//! The past steps of a bring-up, and whether a further step may rely on them.

use std::path::{Path, PathBuf};

use masseter_model::geometry::AXIS_NAMES;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};

use super::before::{Nameless, before_file};
use super::evidence::{Basis, Evidence, numbered};
use super::identity::{Identity, Known};
use super::step::Step;

/// Why a step has no evidence that counts.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Lack {
    /// It was never made.
    #[error("not done")]
    Missing,
    /// The newest one did not pass, or was killed.
    #[error("not passed at {0}")]
    NotPassed(String),
    /// The profiles or the values that decide objects are others.
    #[error("outdated: the profiles changed since {0}")]
    OtherProfile(String),
    /// The drive is another one, or tells less or more of itself.
    #[error("outdated: the drive's {}", .now.differs_from(before))]
    OtherDrive {
        /// The drive then.
        before: Identity,
        /// The drive now.
        now: Identity,
    },
    /// Nobody asked the drive then.
    #[error("outdated: nobody knows which drive it was at {0}")]
    NobodyAsked(String),
    /// The drives got their old objects again.
    #[error("outdated: restored at {0}")]
    Restored(String),
    /// An earlier step was made again since then.
    #[error("outdated: {step} again at {at}")]
    Repeated {
        /// The earlier step.
        step: Step,
        /// When.
        at: String,
    },
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
    steps: Vec<(PathBuf, Evidence)>,
    /// Folders without a readable result.
    damaged: Vec<PathBuf>,
}

impl Past {
    /// Reads the evidence in a folder. A folder without a readable result proves nothing and is no step.
    ///
    /// # Errors
    /// When the folder itself cannot be read.
    pub(crate) fn read(folder: &Path) -> anyhow::Result<Self> {
        let read = |path: &Path| {
            let text = read_text(&path.join("result.json"), MOST_KEPT_BYTES).ok()?;
            serde_json::from_str(&text).ok()
        };
        let (mut steps, mut damaged) = (Vec::new(), Vec::new());
        for (_, path) in numbered(folder)? {
            match read(&path) {
                Some(evidence) => steps.push((path, evidence)),
                None => damaged.push(path),
            }
        }
        Ok(Self { folder: folder.to_owned(), steps, damaged })
    }

    /// Refuses old values of an axis without a readable result: they may be those of another drive.
    ///
    /// # Errors
    /// With the file.
    pub(super) fn check_old_values(&self, axis: usize) -> Result<(), Nameless> {
        let files = self.damaged.iter().map(|path| path.join(before_file(axis)));
        files.filter(|file| file.exists()).map(Nameless).map(Err).next().unwrap_or(Ok(()))
    }

    /// Every past step, the oldest first.
    pub(crate) fn steps(&self) -> impl DoubleEndedIterator<Item = &(PathBuf, Evidence)> {
        self.steps.iter()
    }

    /// The newest evidence of a step for an axis, with its folder.
    pub(crate) fn newest(&self, step: Step, axis: usize) -> Option<&(PathBuf, Evidence)> {
        self.place(step, axis).map(|place| &self.steps[place])
    }

    /// The place of the newest evidence of a step for an axis among all.
    fn place(&self, step: Step, axis: usize) -> Option<usize> {
        self.all_of(step, axis).next_back()
    }

    /// The places of a step for an axis among all, the oldest first.
    fn all_of(&self, step: Step, axis: usize) -> impl DoubleEndedIterator<Item = usize> {
        let name = step.to_string();
        let is_it = move |evidence: &Evidence| evidence.step == name && evidence.is_about(axis);
        (0..self.steps.len()).filter(move |&place| is_it(&self.steps[place].1))
    }

    /// Why the evidence at a place is outdated by what came after, if so: positions follow from objects and home.
    fn outdated(&self, step: Step, axis: usize, place: usize) -> Option<Lack> {
        let since = |earlier: Step| {
            // A step that writes keeps the old values first: without them nothing was written to the drive.
            let may_have_acted = |path: &Path| {
                !matches!(earlier, Step::Configure | Step::Restore) || path.join(before_file(axis)).exists()
            };
            let newer = self.all_of(earlier, axis).filter(|&newer| newer > place);
            let mut steps = newer.map(|newer| &self.steps[newer]);
            Some(steps.rfind(|(path, _)| may_have_acted(path))?.1.started.clone())
        };
        if step >= Step::Configure
            && let Some(at) = since(Step::Restore)
        {
            return Some(Lack::Restored(at));
        }
        // A jog takes the mark of power out of the drive, and home sets the zero for good.
        let earlier: &[Step] = match step {
            Step::Home => &[Step::Configure],
            Step::CheckPose => &[Step::Configure, Step::Jog(axis), Step::Home],
            Step::DryRun => &[Step::Configure, Step::Jog(axis), Step::Home, Step::CheckPose],
            _ => &[],
        };
        earlier.iter().find_map(|&step| Some(Lack::Repeated { step, at: since(step)? }))
    }

    /// Why the newest evidence of a step does not count for an axis, if so. A drive that is not asked is not compared.
    ///
    /// # Errors
    /// The reason.
    pub(crate) fn check(&self, step: Step, axis: usize, basis: &Basis) -> Result<&Evidence, Lack> {
        let place = self.place(step, axis).ok_or(Lack::Missing)?;
        let evidence = &self.steps[place].1;
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
        if evidence.profile_hash != basis.profile_hash {
            return Err(Lack::OtherProfile(at()));
        }
        match (evidence.drives[axis], basis.drives[axis]) {
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
            self.check(step, axis, basis).map(drop).map_err(|lack| EarlierStep { axis, step, lack, folder })
        })
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::AXES;
    use masseter_scenario::Scenario;

    use super::*;
    use crate::robot::evidence::StepFolder;
    use crate::robot::identity::tests::drives;
    use crate::robot::identity::{Entry, NOT_ASKED};

    const SERIALS: [Entry; AXES] =
        [Entry::Told(1), Entry::Told(2), Entry::Told(3), Entry::Told(4), Entry::Told(5), Entry::Told(6)];
    const ALL: [usize; AXES] = [0, 1, 2, 3, 4, 5];

    fn take(parent: &Path, step: Step, axes: &[usize], passed: Option<bool>) {
        let mut folder = StepFolder::begin(parent, step, axes, &Scenario::default()).unwrap();
        folder.note_drives(drives(SERIALS));
        if [Step::Configure, Step::Restore].contains(&step) {
            for &axis in axes {
                folder.keep(&before_file(axis), "").unwrap();
            }
        }
        if let Some(passed) = passed {
            folder.finish(passed, &"data").unwrap();
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
        take(&parent, Step::Inspect, &ALL, Some(true));
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
        assert!(check(&changed).unwrap().starts_with("outdated: the profiles changed"));
        take(&parent, Step::Inspect, &ALL, None);
        assert!(check(&basis).unwrap().starts_with("not passed at "), "a killed step proves nothing");
        take(&parent, Step::Inspect, &ALL, Some(true));
        assert_eq!(check(&basis), None);
        assert!(parent.join("03-inspect/result.json").exists());
    }

    /// A pose that was checked before the axes were homed again says nothing of the new zeros.
    #[test]
    fn a_step_that_is_repeated_outdates_those_after_it_and_one_out_of_order_counts_for_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let basis = Basis::new(&Scenario::default(), NOT_ASKED);
        let check = |step, axis| refusal(folder.path(), step, &[axis], &basis);
        take(folder.path(), Step::Home, &ALL, Some(true));
        take(folder.path(), Step::CheckPose, &ALL, Some(true));
        assert_eq!(check(Step::CheckPose, 3), None);
        take(folder.path(), Step::Home, &[3], Some(false));
        assert!(check(Step::CheckPose, 3).unwrap().starts_with("outdated: home again at "));
        assert_eq!(check(Step::CheckPose, 4), None, "another axis");
        take(folder.path(), Step::Home, &ALL, Some(true));
        for step in [Step::CheckPose, Step::DryRun] {
            take(folder.path(), step, &ALL, Some(true));
        }
        take(folder.path(), Step::Jog(3), &[3], Some(true));
        assert_eq!(check(Step::Home, 3), None, "a jog returns what it changes");
        for step in [Step::CheckPose, Step::DryRun] {
            assert!(check(step, 3).unwrap().starts_with("outdated: jog-l1 again at "));
            assert_eq!(check(step, 4), None, "another axis");
        }
        let mut alone =
            StepFolder::begin(folder.path(), Step::CheckPose, &ALL, &Scenario::default()).unwrap();
        alone.note_out_of_order();
        alone.finish(true, &"data").unwrap();
        assert!(check(Step::CheckPose, 3).unwrap().starts_with("made out of order at "));
    }

    #[test]
    fn a_step_of_one_axis_says_nothing_of_the_others_and_restore_undoes_configure() {
        let folder = tempfile::tempdir().unwrap();
        let basis = Basis::new(&Scenario::default(), NOT_ASKED);
        let check = |axis| refusal(folder.path(), Step::Configure, &[axis], &basis);
        take(folder.path(), Step::Configure, &[3], Some(true));
        assert_eq!((check(3), check(4)), (None, Some("not done".to_owned())));
        take(folder.path(), Step::Configure, &ALL, Some(true));
        assert_eq!((check(3), check(4)), (None, None));
        let refused = StepFolder::begin(folder.path(), Step::Restore, &ALL, &Scenario::default()).unwrap();
        drop(refused);
        assert_eq!((check(3), check(4)), (None, None), "a refused step has written nothing");
        take(folder.path(), Step::Restore, &[3], Some(true));
        assert!(check(3).unwrap().starts_with("outdated: restored at "));
        assert_eq!(check(4), None);
    }
}
