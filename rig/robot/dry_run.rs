//! Evidence of a dry run: `masseter run --dry` leaves it beside the steps of the bring-up.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use masseter_shared::config::{MotionConfig, Scenario};
use serde_json::json;

use super::evidence::StepFolder;
use super::past::Past;
use super::step::Step;

/// Where the evidence of a run's robot is.
pub(super) const FOLDER: &str = "bringup";

/// Notes in the folder of the bring-up, if there is one, whether a dry run passed. The drives are those of the pose check, which
/// a dry run on real interfaces has compared; one without bring-up has compared nothing and counts for nothing.
pub(crate) fn keep_dry_run(
    scenario: &Scenario,
    run: &Path,
    passed: bool,
    is_waived: bool,
) -> anyhow::Result<()> {
    let parent = Path::new(FOLDER);
    if !scenario.dry.is_on || is_waived || !parent.is_dir() {
        return Ok(());
    }
    let past = Past::read(parent)?;
    let serial = |axis| past.newest(Step::CheckPose, axis).and_then(|(_, evidence)| evidence.serials[axis]);
    let mut folder = StepFolder::begin(parent, Step::DryRun, &Step::DryRun.axes(), scenario)?;
    folder.note_serials(std::array::from_fn(serial));
    folder.finish(passed, &json!({ "run": run, "motion": motion_hash(scenario)? }))
}

/// Refuses another motion than that of the newest dry run.
pub(super) fn check_motion(past: &Past, scenario: &Scenario) -> anyhow::Result<()> {
    let Some((_, evidence)) = past.newest(Step::DryRun, 0) else { return Ok(()) };
    ensure!(
        evidence.result["motion"].as_str() == Some(&motion_hash(scenario)?),
        "the dry run of {} played another motion; run 'masseter run --dry' with this one first",
        evidence.started
    );
    Ok(())
}

/// Hash of what moves: motion with its file, rate of the cycles, lead, parameters and what happens meanwhile. The mechanism is part
/// of the basis of all evidence.
fn motion_hash(scenario: &Scenario) -> anyhow::Result<String> {
    let (mut motion, mut hasher) = (scenario.motion.clone(), crc32fast::Hasher::new());
    if let MotionConfig::File(file) = &mut motion {
        hasher.update(&fs::read(&file.path).with_context(|| file.path.display().to_string())?);
        // A run plays its copy of the file.
        file.path = PathBuf::new();
    }
    let Scenario { rate_hz, controller, parameters, stimulus, .. } = scenario;
    let lead_cycles = controller.lead_cycles;
    hasher.update(format!("{motion:?}{rate_hz}{lead_cycles}{parameters:?}{stimulus:?}").as_bytes());
    Ok(format!("{:08x}", hasher.finalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hash(text: &str) -> String {
        motion_hash(&Scenario::parse(Path::new("robot.toml"), text).unwrap()).unwrap()
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

    #[test]
    fn a_dry_run_is_evidence_for_its_motion_alone() {
        let folder = tempfile::tempdir().unwrap();
        let scenario = Scenario::default();
        let dry = StepFolder::begin(folder.path(), Step::DryRun, &Step::DryRun.axes(), &scenario).unwrap();
        dry.finish(true, &json!({ "motion": motion_hash(&scenario).unwrap() })).unwrap();
        let past = Past::read(folder.path()).unwrap();
        assert!(check_motion(&past, &Scenario { duration_s: Some(1.0), ..scenario.clone() }).is_ok());
        let refusal = check_motion(&past, &Scenario { rate_hz: 500, ..scenario }).unwrap_err().to_string();
        assert!(refusal.contains("played another motion; run 'masseter run --dry'"), "{refusal}");
    }
}
