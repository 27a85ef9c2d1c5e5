//! Shrinking: the smallest scenario that still fails for the same reason.

use std::fmt;

use masseter_judge::{CheckResult, Figures, Verdict};

use crate::prelude::*;
use crate::run::runner::{Judged, Runner, Source};

/// The smallest scenario that fails for this reason, as TOML, and the number of runs that it took.
pub(crate) fn shrink(runner: &Runner, scenario: &Scenario, reason: &Reason) -> (String, usize) {
    let mut runs = 0;
    let fails = |smaller: &Scenario| {
        runs += 1;
        !runner.is_interrupted()
            && runner.play(Source::Scenario(smaller)).is_ok_and(|judged| reason.is_that_of(&judged))
    };
    let text = masseter_campaign::Shrink::run(fails, scenario);
    (text, runs)
}

/// Why a scenario fails.
pub(crate) enum Reason {
    /// A check of this name fails.
    Check(String),
    /// The verdict in a word, with the cause of the first fault.
    Verdict(&'static str, Option<String>),
}

impl Reason {
    /// Why the scenario fails, or that the check of this name does; refuses one that passes.
    pub(crate) fn of(
        runner: &Runner,
        scenario: &Scenario,
        requirement: Option<&str>,
    ) -> Result<Self, Failure> {
        let Judged { verdict, figures } = runner.play(Source::Scenario(scenario))?;
        if let Some(name) = requirement {
            let refusal = || anyhow!("'{name}' does not fail: {}: {}", verdict.word, verdict.reason);
            let is_reason = has_failed(&verdict, name);
            return is_reason.then(|| Self::Check(name.to_owned())).ok_or_else(refusal).usage();
        }
        if verdict.exit_code == Exit::Passed {
            return Err(anyhow!("the scenario passes: there is nothing to shrink")).usage();
        }
        let failed = || verdict.checks.iter().filter(|check| check.result == CheckResult::Failed);
        // A requirement of the user says more than a check that every run has. After a safe stop these say nothing of its
        // cause.
        let requirement = failed().find(|check| check.figures.is_some());
        let other = failed().next().filter(|_| verdict.exit_code != Exit::SafeStop);
        Ok(match requirement.or(other) {
            Some(check) => Self::Check(check.name.to_string()),
            None => Self::Verdict(verdict.word, first_cause(&figures)),
        })
    }

    /// Whether this is the reason of another run, too.
    fn is_that_of(&self, Judged { verdict, figures }: &Judged) -> bool {
        match self {
            Self::Check(name) => has_failed(verdict, name),
            Self::Verdict(word, cause) => verdict.word == *word && first_cause(figures) == *cause,
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Check(name) => write!(f, "'{name}'"),
            Self::Verdict(word, Some(cause)) => write!(f, "{word} after {cause}"),
            Self::Verdict(word, None) => f.write_str(word),
        }
    }
}

fn has_failed(verdict: &Verdict, name: &str) -> bool {
    verdict.checks.iter().any(|check| check.name == name && check.result == CheckResult::Failed)
}

/// The cause of the first fault that somebody reports of the stop.
fn first_cause(figures: &Figures) -> Option<String> {
    Some(figures.first_fault()?.cause.to_string())
}
