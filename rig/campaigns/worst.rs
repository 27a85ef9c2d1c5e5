//! The cases of a campaign with the smallest margins: their scenarios, and their runs again with a recording.

use std::fs;
use std::path::Path;

use anyhow::{Context, anyhow};
use masseter_campaign::{Campaign, CampaignFolder, CaseResult, Report, WorstCase};
use masseter_terminal::{Exit, Failure, OrFailure};

use super::player::Player;
use crate::arguments::{ControllerChoice, ControllerKind, name_of};
use crate::run::PreparedRun;
use crate::run::args::{ClockKind, RunArgs};
use crate::shell::word;

/// Folder of the worst cases.
const WORST: &str = "worst";

/// Writes the scenarios of the worst cases. Those that ran are recorded, byte by byte as they ran before.
pub(super) fn keep(
    report: &Report<'_>,
    campaign: &Campaign,
    folder: &CampaignFolder,
    most: usize,
    player: &Player<'_>,
) -> Result<Vec<WorstCase>, Failure> {
    let parent = folder.file(WORST);
    fs::create_dir_all(&parent).with_context(|| format!("cannot make {}", parent.display())).incomplete()?;
    let mut kept = Vec::new();
    for result in report.worst(most) {
        let Ok(scenario) = campaign.case_of(result).scenario else { continue };
        let run = parent.join(format!("case-{}-{}", result.number, result.id));
        let file = run.with_extension("toml");
        let written = fs::write(&file, scenario.to_toml());
        written.with_context(|| format!("cannot write {}", file.display())).incomplete()?;
        if !result.digest.is_empty() && !run.exists() {
            record(&file, &run, result, player)?;
        }
        let command = command(&file, player.controller);
        kept.push(WorstCase { number: result.number, command, run: run.exists().then_some(run) });
    }
    Ok(kept)
}

fn record(file: &Path, run: &Path, result: &CaseResult, player: &Player<'_>) -> Result<(), Failure> {
    let unfinished = run.with_extension("part");
    let _ = fs::remove_dir_all(&unfinished);
    let args = RunArgs {
        scenario: Some(file.to_owned()),
        out: Some(unfinished.clone()),
        clock: ClockKind::Virtual,
        controller: ControllerChoice::Own(player.controller),
        quiet: true,
        ..RunArgs::default()
    };
    let judgement = PreparedRun::new(&args)?.play(player.interrupts)?.judge()?;
    let Some(judgement) = judgement.filter(|_| !player.interrupts.is_stop_requested()) else {
        return Err(Failure::with(Exit::Interrupted, anyhow!("interrupted")));
    };
    if judgement.digest != result.digest {
        let error = anyhow!(
            "case {} with a recording ({}) differs from the one without ({}): report this as a defect of masseter",
            result.number,
            judgement.digest,
            result.digest
        );
        return Err(Failure::with(Exit::Failed, error));
    }
    fs::rename(&unfinished, run).with_context(|| format!("cannot make {}", run.display())).incomplete()
}

/// The command that plays the case again.
fn command(file: &Path, controller: ControllerKind) -> String {
    let is_default = controller == ControllerKind::default();
    let controller =
        if is_default { String::new() } else { format!(" --controller {}", name_of(&controller)) };
    format!("masseter run {} --clock virtual{controller}", word(&file.display().to_string()))
}
