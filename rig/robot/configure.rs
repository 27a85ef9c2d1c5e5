//! `masseter robot configure` and `restore`: the rig's objects into drives without power, and the old ones back.
//!
//! All drives are read and judged before the first one is written, and the old values of a drive are kept before it
//! is. The drive that refuses a value ends the step: the drives after it are not touched, and no drive ever gets
//! power.

use std::fmt::Write;

use anyhow::{Context, anyhow, ensure};
use masseter_commissioning::{
    BootUps, Change, Deviation, Identity, Known, NOT_ASKED, Outcome, Settings, Survey, Writer, check_present,
    check_undisturbed, reset, store,
};
use masseter_model::geometry::AXIS_NAMES;
use masseter_scenario::{Scenario, wording::counted};
use masseter_terminal::{Exit, Failure, OrFailure, Tone, result, result_with_tones, status};
use serde::{Deserialize, Serialize};

use super::evidence::{Evidence, Past, StepFolder};
use super::ledger::{before_file, read_before, return_owed_values};
use super::robot_line::{
    LISTEN_NS, RobotLine, Surveys, deviations_table, drives, failed, prove_off, warn_of_interfaces,
};
use super::{args::WriteArgs, basis::Basis, step::Step};

/// Configures the drives, and lists the changes.
pub(crate) fn configure(args: &WriteArgs) -> Result<Exit, Failure> {
    let (scenario, axes) = (args.robot.scenario().usage()?, args.axes());
    let past = Past::read(&args.robot.folder).usage()?;
    // A refused step makes no folder: it would replace the evidence of the same step from before.
    past.require(Step::Inspect, &axes, &Basis::new(&scenario, NOT_ASKED)).usage()?;
    let mut writing = Writing::begin(args, Step::Configure, scenario)?;
    let targets: Vec<_> = axes.iter().map(|&axis| (axis, writing.robot.settings[axis].clone())).collect();
    let surveys = writing.robot.surveys(&targets, writing.boot_ups).map_err(failed)?;
    let drives = drives(&surveys, &writing.robot.scenario.can);
    writing.folder.evidence.basis.drives = drives;
    past.require(Step::Inspect, &axes, &writing.folder.evidence.basis).usage()?;
    let refused = refused(&writing.robot, &surveys);
    if refused.is_empty() {
        return writing.write_all(&targets, &surveys);
    }
    let (count, table) = (counted(refused.len() as u64, "deviation"), deviations_table(&refused));
    result(&format!("{table}failed: configure cannot mend {count}; nothing was written\n")).usage()?;
    let refused: Vec<_> = refused.iter().map(|(_, deviation)| deviation).collect();
    writing.folder.finish_step(false, &refused).incomplete()?;
    Ok(Exit::Failed)
}

/// What no writing can mend.
fn refused(robot: &RobotLine, surveys: &Surveys) -> Vec<(usize, Deviation)> {
    let surveyed = surveys.iter().enumerate().filter_map(|(axis, survey)| Some((axis, survey.as_ref()?)));
    let of_drive = |(axis, survey)| robot.deviations(axis, survey).into_iter().map(move |one| (axis, one));
    surveyed.flat_map(of_drive).filter(|(_, deviation)| deviation.outcome == Outcome::Refused).collect()
}

/// Restores the old objects, and lists the changes.
pub(crate) fn restore(args: &WriteArgs) -> Result<Exit, Failure> {
    let scenario = args.robot.scenario().usage()?;
    let past = Past::read(&args.robot.folder).usage()?;
    let mut writing = Writing::begin(args, Step::Restore, scenario)?;
    let mut drives = NOT_ASKED;
    for axis in args.axes() {
        let RobotLine { line, scenario, .. } = &mut writing.robot;
        drives[axis] = Known::Is(Identity::read(line, &scenario.can, axis).map_err(failed)?);
    }
    writing.folder.evidence.basis.drives = drives;
    let mut targets = Vec::new();
    for axis in args.axes() {
        match old_values(&past, axis, drives[axis]).usage()? {
            Some(target) => targets.push((axis, target)),
            // A configuration that failed has not reached the drives after the failed one.
            None => status!("{}: configure wrote nothing to this drive", AXIS_NAMES[axis]),
        }
    }
    if targets.is_empty() {
        return Err(anyhow!("there is nothing to restore")).usage();
    }
    let surveys = writing.robot.surveys(&targets, writing.boot_ups).map_err(failed)?;
    writing.write_all(&targets, &surveys)
}

/// The values of a drive from before the first `configure` since they were last restored for good; none where
/// `configure` has not begun with it. Values that were restored without `--store` last until a reset.
fn old_values(past: &Past, axis: usize, drive: Known) -> anyhow::Result<Option<Settings>> {
    past.check_old_values(axis)?;
    let is_of_drive = |past: &&Evidence| past.is_about(axis) && past.basis.drives[axis] == drive;
    let steps: Vec<_> = past.steps.iter().filter(is_of_drive).collect();
    let is_restored = |past: &&Evidence| past.passed && past.step == Step::Restore && has_stored(past, axis);
    let restored = steps.iter().rposition(is_restored).map_or(0, |place| place + 1);
    let mut files = steps[restored..].iter().map(|step| step.folder.join(before_file(axis)));
    Ok(files.find(|file| file.exists()).map(|file| read_before(&file)).transpose()?)
}

/// What became of one drive.
#[derive(Debug, Serialize)]
struct Written {
    axis: &'static str,
    changes: Vec<Change>,
    stored: bool,
    error: Option<String>,
    /// Number of the axis, and the boot-ups when its turn ended.
    #[serde(skip)]
    end: (usize, BootUps),
}

impl Written {
    fn to_text(&self) -> String {
        let Self { axis, changes, stored, error, .. } = self;
        let count = counted(changes.len() as u64, "value");
        let mut text = format!("{axis}: {count} written{}\n", if *stored { ", stored" } else { "" });
        for Change { object, name, before, after } in changes {
            let before = before.as_deref().unwrap_or("unreadable");
            let _ = writeln!(text, "  {object} {name}: {before} -> {after}");
        }
        if let Some(error) = error {
            let _ = writeln!(text, "failed: {error}");
        }
        text
    }
}

/// What a later step reads of it.
#[derive(Debug, Deserialize)]
struct Stored {
    axis: String,
    stored: bool,
}

/// Whether a drive has stored what a step wrote to it. A step that wrote nothing has another result.
fn has_stored(evidence: &Evidence, axis: usize) -> bool {
    let all: Vec<Stored> = evidence.result_as().unwrap_or_default();
    all.iter().any(|written| written.axis == AXIS_NAMES[axis] && written.stored)
}

/// A step under way that writes settings into drives.
struct Writing<'a> {
    args: &'a WriteArgs,
    folder: StepFolder,
    robot: RobotLine,
    /// Boot-ups before the drives were surveyed.
    boot_ups: BootUps,
}

impl<'a> Writing<'a> {
    /// Makes the folder, opens the line, and writes back what a killed step owes the drives.
    fn begin(args: &'a WriteArgs, step: Step, scenario: Scenario) -> Result<Self, Failure> {
        let folder = StepFolder::begin(&args.robot.folder, step, &args.axes(), &scenario).usage()?;
        let mut robot = RobotLine::open(scenario, folder.log().usage()?).usage()?;
        warn_of_interfaces(&robot.scenario.can);
        return_owed_values(&args.robot.folder, &robot.scenario, &mut robot.line, args.take_over)?;
        // All drives may boot until then. After a restart a survey is no more than a memory.
        robot.line.listen(LISTEN_NS).map_err(failed)?;
        let boot_ups = BootUps::until_now(&robot.line);
        Ok(Self { args, folder, robot, boot_ups })
    }

    /// Writes settings to drives without power, one after the other, up to the first that does not take them; then
    /// prints and keeps the result.
    fn write_all(mut self, targets: &[(usize, Settings)], surveys: &Surveys) -> Result<Exit, Failure> {
        self.prove_all_off(targets)?;
        let mut all: Vec<Written> = Vec::new();
        for (axis, target) in targets {
            let survey = surveys[*axis].as_ref().expect("every axis was surveyed");
            all.push(self.write(*axis, target, survey)?);
            if all.last().is_some_and(|written| written.error.is_some()) {
                break;
            }
        }
        self.finish_writing(all)
    }

    /// Proves that none of these drives has power, before anything is written to one of them.
    fn prove_all_off(&mut self, targets: &[(usize, Settings)]) -> Result<(), Failure> {
        let RobotLine { line, scenario, .. } = &mut self.robot;
        line.strangers().refuse_masters().context("nothing was written").map_err(failed)?;
        targets.iter().try_for_each(|&(axis, _)| prove_off(line, scenario, axis, self.args.take_over))
    }

    /// Keeps the old values of a drive in a file, writes the new ones, and reads everything again; stores on request.
    /// A drive that does not take them is part of the result.
    fn write(&mut self, axis: usize, target: &Settings, survey: &Survey) -> Result<Written, Failure> {
        let before = serde_json::to_string_pretty(&target.found(survey)).incomplete()?;
        self.folder.keep(&before_file(axis), &(before + "\n")).incomplete()?;
        let profile = self.robot.scenario.profile(axis).clone();
        let mut writer = Writer::new(&mut self.robot.line, axis, &profile);
        let applied = writer.apply(target, survey);
        let changes = writer.into_changes();
        let written = match applied {
            Err(error) => Err(error.into()),
            Ok(()) => self.check_written(axis, target, "after writing"),
        };
        let done = match self.unless_disturbed(axis, self.boot_ups, written) {
            Ok(()) if self.args.store => self.store_and_check(axis, target),
            written => written,
        };
        let (stored, error) = (self.args.store && done.is_ok(), done.err().map(|error| error.to_string()));
        let end = (axis, BootUps::until_now(&self.robot.line));
        Ok(Written { axis: AXIS_NAMES[axis], changes, stored, error, end })
    }

    /// Stores, resets, and reads everything again. No restart but this reset counts as a proof.
    fn store_and_check(&mut self, axis: usize, target: &Settings) -> anyhow::Result<()> {
        let stored = store(&mut self.robot.line, axis, self.robot.scenario.profile(axis).store);
        self.unless_disturbed(axis, self.boot_ups, stored.map_err(Into::into))?;
        reset(&mut self.robot.line, axis)?;
        let after = BootUps::until_now(&self.robot.line);
        let checked = self.check_written(axis, target, "after the reset, so the drive did not store it");
        self.unless_disturbed(axis, after, checked)
    }

    /// What was done, unless the drive restarted since then or another master was heard: that is the cause of
    /// whatever else failed.
    fn unless_disturbed(&self, axis: usize, since: BootUps, done: anyhow::Result<()>) -> anyhow::Result<()> {
        check_undisturbed(&self.robot.line, &[axis], since)?;
        done
    }

    /// Reads everything again; refuses what is not as it was written.
    fn check_written(&mut self, axis: usize, target: &Settings, when: &str) -> anyhow::Result<()> {
        let differences = target.differences(&self.robot.whole_survey(axis, target)?);
        // An optional object may keep a value of its own.
        let wrong = differences.iter().filter(|difference| !difference.may_stay());
        let wrong: Vec<_> = wrong.map(|difference| difference.wanted.object.0.to_string()).collect();
        ensure!(wrong.is_empty(), "{}: {} differ {when}", AXIS_NAMES[axis], wrong.join(", "));
        Ok(())
    }

    /// Judges all drives once more, since values that are not stored may be lost; prints and keeps the result.
    fn finish_writing(mut self, mut all: Vec<Written>) -> Result<Exit, Failure> {
        let (RobotLine { line, scenario, .. }, basis) = (&mut self.robot, &self.folder.evidence.basis);
        for Written { error, end: (axis, boot_ups), .. } in &mut all {
            if error.is_none() {
                let present = check_present(line, &scenario.can, &[*axis], *boot_ups, &basis.drives);
                *error = present.err().map(|error| error.to_string());
            }
        }
        line.flush().incomplete()?;
        let mut text: String = all.iter().map(Written::to_text).collect();
        let failed = all.iter().any(|written| written.error.is_some());
        text += match (failed, self.args.store) {
            (true, _) => {
                "drives without a line here were not written; 'masseter robot restore' writes the old values back\n"
            }
            (false, true) => "passed: the values are stored\n",
            (false, false) => "passed: the values last until a reset; --store keeps them\n",
        };
        self.folder.finish_step(!failed, &all).incomplete()?;
        result_with_tones(&text, &[("passed", Tone::Good), ("failed", Tone::Bad)]).usage()?;
        Ok(if failed { Exit::Failed } else { Exit::Passed })
    }
}
