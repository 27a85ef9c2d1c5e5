//! Whether `masseter run` may move a real robot: only with proved watchdogs and a passed pose check of the same drives and
//! profiles, and at full speed only after a passed dry run. `masseter run --dry` leaves its evidence beside the steps of the
//! bring-up.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use masseter_commissioning::{Identity, Known, Line, NOT_ASKED};
use masseter_scenario::{FileConfig, Scenario, input::read_bytes};
use serde::{Deserialize, Serialize};
use sha1::{Digest, Sha1};

use super::evidence::{Past, StepFolder};
use super::ledger::{owed_advice, owed_axes};
use super::power_mark::{check_marks, marks_of_pose_check};
use super::robot_line::{warn_of_gaps, warn_of_interfaces};
use super::{basis::Basis, step::Step};

/// Where the evidence of a run's robot is.
const FOLDER: &str = "bringup";
/// Durations that differ by less are equal, s.
const SAME_S: f64 = 1e-6;

/// What a run plays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Played<'a> {
    pub(crate) scenario: &'a Scenario,
    /// Name of the controller; none for the rig's own.
    pub(crate) controller: Option<&'a str>,
    /// Duration of the motion in this run, s.
    pub(crate) motion_s: f64,
    /// Whether the robot moves without the evidence of a bring-up.
    pub(crate) is_waived: bool,
}

/// What a dry run keeps.
#[derive(Debug, Serialize, Deserialize)]
struct DryRun {
    /// Folder of the run.
    run: PathBuf,
    /// Hash of what it played.
    motion: String,
    /// How much of the motion it played, in seconds at full speed.
    motion_s: f64,
}

/// Refuses another motion than that of the newest dry run, and a longer one.
fn check_motion(past: &Past, played: &Played<'_>) -> anyhow::Result<()> {
    let evidence = past.newest(Step::DryRun, 0).context("there is no dry run")?;
    let dry: DryRun = evidence.result_as().with_context(|| {
        format!(
            "the result of the dry run at {} cannot be read; run 'masseter run --dry' again",
            evidence.started
        )
    })?;
    ensure!(
        dry.motion == played.hash(None)?,
        "the dry run of {} played another motion; run 'masseter run --dry' with this one first",
        evidence.started
    );
    let (dry_s, run_s) = (dry.motion_s, played.full_speed_s());
    ensure!(
        dry_s >= run_s - SAME_S,
        "the dry run of {} played the first {dry_s:.3} s of a motion of {run_s:.3} s; run 'masseter run --dry' \
         with the whole motion first",
        evidence.started
    );
    Ok(())
}

impl Played<'_> {
    /// Refuses a run on real interfaces without its earlier steps. The files are read before anything is sent; then the
    /// drives tell who they are.
    pub(crate) fn check_bring_up(&self) -> anyhow::Result<()> {
        let scenario = self.scenario;
        if scenario.can.is_virtual() {
            return Ok(());
        }
        warn_of_interfaces(&scenario.can);
        if self.is_waived {
            masseter_terminal::status!(
                "WITHOUT BRING-UP: signs, scales and zeros are not proved, and a wrong one can drive an axis into its end"
            );
            return Ok(());
        }
        let refused = "a run needs proved watchdogs and a passed pose check of this robot, and at full speed also a passed dry run; \
                       --without-bring-up skips all three: a wrong sign, scale or zero can then drive an axis into its end";
        let folder = Path::new(FOLDER);
        if let Some(&axis) = owed_axes(folder).first() {
            bail!(owed_advice(folder, axis));
        }
        let past = Past::read(folder)?;
        let unknown = Basis::new(scenario, NOT_ASKED);
        let all = [Step::Watchdog, Step::CheckPose, Step::DryRun];
        let steps = if scenario.dry.is_on { &all[..2] } else { &all };
        let require = |basis: &Basis| {
            steps.iter().try_for_each(|&step| past.require(step, &Step::DryRun.axes(), basis))
        };
        require(&unknown).context(refused)?;
        if !scenario.dry.is_on {
            check_motion(&past, self).context(refused)?;
        }
        let mut line = Line::open(scenario, Box::new(std::io::sink()))?;
        let drives = Identity::read_all(&mut line, &scenario.can).context(refused)?.map(Known::Is);
        require(&Basis { drives, ..unknown }).context(refused)?;
        warn_of_gaps(&drives);
        let checked = past.newest(Step::CheckPose, 0).context("there is no pose check")?;
        let marks = marks_of_pose_check(checked).context(refused)?;
        check_marks(scenario, &marks, &checked.started, &mut line).context(refused)
    }

    /// Notes in the folder of the bring-up, if there is one, whether a dry run passed. The drives are those of the pose
    /// check, with which a dry run on real interfaces has compared them. A dry run without bring-up has compared nothing,
    /// and counts for nothing.
    pub(crate) fn keep_dry_run(&self, run: &Path, passed: bool) -> anyhow::Result<()> {
        let (parent, scenario) = (Path::new(FOLDER), self.scenario);
        if !scenario.dry.is_on || self.is_waived || !parent.is_dir() {
            return Ok(());
        }
        let past = Past::read(parent)?;
        let checked = |axis| past.newest(Step::CheckPose, axis);
        let drive = |axis| checked(axis).map_or(Known::NotAsked, |checked| checked.basis.drives[axis]);
        let mut folder = StepFolder::begin(parent, Step::DryRun, &Step::DryRun.axes(), scenario)?;
        folder.evidence.basis.drives = std::array::from_fn(drive);
        let (motion, motion_s) = (self.hash(Some(run))?, self.full_speed_s());
        folder.finish_step(passed, &DryRun { run: run.to_owned(), motion, motion_s })
    }

    /// Duration of the motion at full speed, s.
    fn full_speed_s(&self) -> f64 {
        self.motion_s * self.scenario.dry.speed_now()
    }

    /// Hash of what moves: motion and stimuli with their files, rate of the cycles, controller, lead, ease and
    /// parameters. The files are those of the scenario, or their copies in a run's folder. The mechanism is part of the
    /// basis of all evidence.
    fn hash(&self, copies: Option<&Path>) -> anyhow::Result<String> {
        let (mut scenario, mut hasher) = (self.scenario.clone(), Sha1::new());
        for (name, file) in scenario.files_mut() {
            let path = copies.map_or_else(|| file.clone(), |folder| folder.join(&name));
            let bytes = read_bytes(&path, FileConfig::MOST_BYTES);
            hasher.update(bytes.with_context(|| path.display().to_string())?);
            file.clear();
        }
        // A dry run has a longer ease.
        let ease_s = scenario.controller.ease_s * scenario.dry.speed_now();
        let Scenario { rate_hz, controller, parameters, stimulus, motion, .. } = &scenario;
        let (lead_cycles, own) = (controller.lead_cycles, self.controller);
        let ease_us = (ease_s * 1e6).round();
        let played = (motion, rate_hz, own, lead_cycles, ease_us, parameters, stimulus);
        hasher.update(serde_json::to_vec(&played)?);
        Ok(data_encoding::HEXLOWER.encode(&hasher.finalize()))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const fn played(scenario: &Scenario) -> Played<'_> {
        Played { scenario, controller: None, motion_s: 3.0, is_waived: false }
    }

    fn hash(text: &str) -> String {
        played(&Scenario::parse(Path::new("robot.toml"), text).unwrap()).hash(None).unwrap()
    }

    #[test]
    fn what_moves_counts_and_how_long_or_how_it_is_judged_does_not() {
        let motion = hash("[motion]\nkind = 'opening'");
        for same in ["duration_s = 3.0", "name = 'other'", "checks.missed_cycles = 9"] {
            assert_eq!(hash(&format!("{same}\n[motion]\nkind = 'opening'")), motion, "{same}");
        }
        for other in [
            "[motion]\nkind = 'protrusion'",
            "[motion]\nkind = 'opening'\namplitude_mm = 30.0",
            "[motion]\nkind = 'opening'\ncycle_rate_hz = 0.6",
            "rate_hz = 500\n[motion]\nkind = 'opening'",
            "[motion]\nkind = 'opening'\n[controller]\nlead_cycles = 3.0",
            "[motion]\nkind = 'opening'\n[controller]\nease_s = 0.5",
        ] {
            assert_ne!(hash(other), motion, "{other}");
        }
    }

    #[test]
    fn a_recorded_motion_counts_by_its_rows_and_not_by_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let of = |name: &str, rows: &str| {
            let path = folder.path().join(name);
            fs::write(&path, rows).unwrap();
            hash(&format!("[motion]\nkind = 'file'\npath = '{}'", path.display()))
        };
        assert_eq!(of("a.csv", "1,2"), of("b.csv", "1,2"));
        assert_ne!(of("a.csv", "1,2"), of("a.csv", "1,3"));
    }

    /// The user may change the file while the dry run plays its copy.
    #[test]
    fn a_dry_run_counts_by_the_copy_that_it_played() {
        let folder = tempfile::tempdir().unwrap();
        let [file, copies] = ["jaw.csv", "run"].map(|name| folder.path().join(name));
        fs::create_dir(&copies).unwrap();
        fs::write(copies.join("motion.csv"), "1,2").unwrap();
        fs::write(&file, "1,2").unwrap();
        let text = format!("[motion]\nkind = 'file'\npath = '{}'", file.display());
        let scenario = Scenario::parse(Path::new("robot.toml"), &text).unwrap();
        let dry = played(&scenario).hash(Some(&copies)).unwrap();
        assert_eq!(dry, played(&scenario).hash(None).unwrap());
        fs::write(&file, "1,9").unwrap();
        assert_eq!(dry, played(&scenario).hash(Some(&copies)).unwrap());
        assert_ne!(dry, played(&scenario).hash(None).unwrap());
    }

    #[test]
    fn the_ease_of_a_dry_run_is_that_of_its_run_and_another_controller_is_another_motion() {
        let mut scenario = Scenario::default();
        let run = played(&scenario).hash(None).unwrap();
        assert_ne!(Played { controller: Some("external"), ..played(&scenario) }.hash(None).unwrap(), run);
        scenario.dry.is_on = true;
        scenario.controller.ease_s /= scenario.dry.speed;
        assert_eq!(played(&scenario).hash(None).unwrap(), run);
    }

    #[test]
    fn a_dry_run_is_evidence_for_its_motion_alone() {
        let folder = tempfile::tempdir().unwrap();
        let scenario = Scenario::default();
        let dry = StepFolder::begin(folder.path(), Step::DryRun, &Step::DryRun.axes(), &scenario).unwrap();
        let motion = played(&scenario).hash(None).unwrap();
        dry.finish_step(true, &DryRun { run: PathBuf::new(), motion, motion_s: 3.0 }).unwrap();
        let past = Past::read(folder.path()).unwrap();
        let refusal = |played: Played<'_>| check_motion(&past, &played).err().map(|error| error.to_string());
        assert_eq!(refusal(played(&scenario)), None);
        assert_eq!(refusal(Played { motion_s: 1.0, ..played(&scenario) }), None, "a part of it");
        let longer = refusal(Played { motion_s: 3.5, ..played(&scenario) }).unwrap();
        assert!(longer.contains("played the first 3.000 s of a motion of 3.500 s"), "{longer}");
        let other = refusal(played(&Scenario { rate_hz: 500, ..scenario.clone() })).unwrap();
        assert!(other.contains("played another motion; run 'masseter run --dry'"), "{other}");
    }
}
