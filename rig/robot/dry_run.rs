//! Evidence of a dry run: `masseter run --dry` leaves it beside the steps of the bring-up.

use std::path::Path;

use masseter_shared::config::Scenario;
use serde_json::json;

use super::evidence::StepFolder;
use super::past::Past;
use super::permission::FOLDER;
use super::step::Step;

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
    folder.finish(passed, &json!({ "run": run }))
}
