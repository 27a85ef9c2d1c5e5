//! `masseter shrink`: the smallest scenario that still fails for the same reason.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, ensure};
use masseter_analysis::Figures;
use masseter_campaign::Shrink;
use masseter_plan::{Overrides, scenario_with_overrides};
use masseter_report::{CheckResult, Verdict};
use masseter_runtime::messages::codes::EventKind;
use masseter_scenario::Scenario;
use masseter_terminal::{Exit, Failure, OrFailure, result, status};

use super::args::ShrinkArgs;
use super::listen;
use super::player::Player;

/// Shrinks a scenario, and prints the smallest one.
pub(crate) fn shrink(args: &ShrinkArgs) -> Result<Exit, Failure> {
    let path = scenario_of(&args.path).usage()?;
    let scenario = scenario_with_overrides(Some(&path), &Overrides::default()).usage()?;
    let interrupts = listen()?;
    let player = Player { controller: args.controller, interrupts: &interrupts };
    let reason = reason_of(&player, &scenario, args.requirement.as_deref())?;
    status!("fails by {reason}; shrinking");
    let mut runs = 0;
    let fails = |smaller: &Scenario| {
        runs += 1;
        !interrupts.is_stop_requested()
            && player.judge(smaller).is_ok_and(|(verdict, figures)| reason.is_that_of(&verdict, &figures))
    };
    let text = Shrink::run(fails, &scenario);
    if interrupts.is_stop_requested() {
        return Ok(Exit::Interrupted);
    }
    status!("{runs} runs");
    match &args.out {
        Some(out) => {
            fs::write(out, &text).with_context(|| format!("cannot write {}", out.display())).incomplete()?;
        }
        None => result(&text).incomplete()?,
    }
    Ok(Exit::Passed)
}

/// The scenario of a file, or of a folder of a run or a case.
fn scenario_of(path: &Path) -> anyhow::Result<PathBuf> {
    let inside = path.join("scenario.toml");
    ensure!(!path.is_dir() || inside.is_file(), "{} has no scenario.toml", path.display());
    Ok(if path.is_dir() { inside } else { path.to_owned() })
}

/// Why a scenario fails.
enum Reason {
    /// A check of this name fails.
    Check(String),
    /// The verdict in a word, with the cause of the first fault.
    Verdict(&'static str, Option<String>),
}

impl Reason {
    /// Whether this is the reason of another run, too.
    fn is_that_of(&self, verdict: &Verdict, figures: &Figures) -> bool {
        match self {
            Self::Check(name) => has_failed(verdict, name),
            Self::Verdict(word, cause) => verdict.word == *word && first_cause(figures) == *cause,
        }
    }
}

impl std::fmt::Display for Reason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Check(name) => write!(f, "'{name}'"),
            Self::Verdict(word, Some(cause)) => write!(f, "{word} after {cause}"),
            Self::Verdict(word, None) => f.write_str(word),
        }
    }
}

fn reason_of(player: &Player<'_>, scenario: &Scenario, requirement: Option<&str>) -> Result<Reason, Failure> {
    let (verdict, figures) = player.judge(scenario)?;
    if let Some(name) = requirement {
        let refusal = || anyhow!("'{name}' does not fail: {}: {}", verdict.word, verdict.reason);
        return has_failed(&verdict, name)
            .then(|| Reason::Check(name.to_owned()))
            .ok_or_else(refusal)
            .usage();
    }
    if verdict.exit_code == Exit::Passed {
        return Err(anyhow!("the scenario passes: there is nothing to shrink")).usage();
    }
    let failed = || verdict.checks.iter().filter(|check| check.result == CheckResult::Failed);
    // A requirement of the user says more than a check that every run has; after a safe stop these say nothing of its cause.
    let requirement = failed().find(|check| check.figures.is_some());
    let other = failed().next().filter(|_| verdict.exit_code != Exit::SafeStop);
    Ok(match requirement.or(other) {
        Some(check) => Reason::Check(check.name.to_string()),
        None => Reason::Verdict(verdict.word, first_cause(&figures)),
    })
}

fn has_failed(verdict: &Verdict, name: &str) -> bool {
    verdict.checks.iter().any(|check| check.name == name && check.result == CheckResult::Failed)
}

/// The cause of the first fault that somebody detected.
fn first_cause(figures: &Figures) -> Option<String> {
    let fault = figures.events.iter().find(|event| event.kind == EventKind::Fault)?;
    Some(fault.cause.to_string())
}
