//! The verdict on the function of a run: by its end, then its recording, then the machine, then its checks.
//!
//! [`Timing`] is judged apart. Lost cycles matter here only where they leave nothing to judge the function by.

use masseter_recording::Manifest;
use masseter_scenario::ExpectedVerdict::{Died, Fail, Incomplete, Interrupted, Pass, SafeStop, Untested};
use masseter_scenario::{ChecksConfig, ExpectConfig, ExpectedVerdict, TimingConfig};
use masseter_terminal::Exit;
use serde::Serialize;

use crate::breach::{Breach, earliest};
use crate::check::{Check, CheckResult, Subject};
use crate::outcome::{
    Outcome, OutcomeReason, account, clock_jump, declared_in_words, ending, excuse, incomplete, overload,
    passed, stopped_by_stimulus, when_died, with_shortfall,
};
use crate::timing::{Timing, TimingWord};
use crate::{checks::checks, figures::Figures, next_step::NextStep};

/// The judgement of a run.
///
/// ```
/// use masseter_judge::{Analysis, Verdict};
/// use masseter_recording::{MachineInfo, Manifest};
/// use masseter_scenario::Scenario;
/// use masseter_runtime::named::Declared;
///
/// let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
/// let manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "virtual", machine);
/// let figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
/// // The supervisor has not entered yet how the run ended.
/// assert_eq!(Verdict::new(&manifest, &figures).word, "DIED");
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// The outcome in a word.
    pub word: &'static str,
    /// The reason in a sentence.
    pub reason: String,
    /// The outcome as the exit code of the program.
    pub exit_code: Exit,
    /// Whether the deadlines were kept.
    pub timing: Timing,
    /// The earliest value beyond its limit; none of a run that did not fail.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_breach: Option<Breach>,
    /// What to do next, with `RUN` for the folder of the run; none of a run that passed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub next_step: Option<String>,
    /// Every check, also those that passed.
    pub checks: Vec<Check>,
    /// What the plan of the run warns of. Warnings decide nothing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// The digest of the run: equal where the rig did the same.
    #[serde(skip)]
    pub digest: String,
    #[serde(skip)]
    pub(crate) outcome: Outcome,
}

impl Verdict {
    /// Judges a run.
    pub fn new(manifest: &Manifest, figures: &Figures) -> Self {
        let timing = Timing::new(manifest, figures);
        let all = checks(manifest, figures, &timing);
        let expect = manifest.scenario.expect.as_ref().filter(|expect| expect.has_outcome());
        let is_beside = |check: &Check| expect.is_some_and(|expect| stands_beside(check, expect));
        let (beside, checks): (Vec<_>, Vec<_>) = all.iter().cloned().partition(is_beside);
        let excuse = excuse(manifest, figures, &timing);
        let is_too_late = figures.path_breach.first.is_some();
        let declared = declared_in_words(manifest, figures);
        let (mut outcome, mut reason) = ending(&manifest.ending, declared, figures)
            .map(|(ending, reason)| match ending {
                Outcome::Named(Died) => (ending, format!("{reason}, {}", when_died(figures))),
                _ => (ending, reason),
            })
            .or_else(|| stopped_by_stimulus(&manifest.scenario, &figures.events))
            // The machine caused the stop, or it came only after the jaw had left its path.
            .filter(|(ending, _)| *ending != Outcome::Named(SafeStop) || (excuse.is_none() && !is_too_late))
            .or_else(|| incomplete(figures))
            .or_else(|| {
                let unjudged = excuse.or_else(|| unjudged(&manifest.scenario.checks, &timing, &checks))?;
                Some((Outcome::Invalid, format!("{unjudged}; {}", account(manifest, figures, &timing))))
            })
            .or_else(|| {
                failed(&checks)
                    .map(|failure| with_shortfall(failure, manifest, figures))
                    .map(|failure| clock_jump(&manifest.usage, &manifest.scenario.can).unwrap_or(failure))
            })
            .or_else(|| untested(&checks, figures.cycles))
            .unwrap_or_else(|| (Outcome::Named(Pass), passed(manifest, figures)));
        if let Some(expect) = expect {
            (outcome, reason) = against(expect, (outcome, reason), [&checks, &beside], figures);
        }
        if matches!(outcome, Outcome::Named(SafeStop | Fail) | Outcome::ChecksFailed) {
            reason += &timing.culprit();
        }
        if outcome != Outcome::Named(Pass) {
            reason += &overload(&manifest.usage, manifest.scenario.rate_hz).unwrap_or_default();
        }
        let first_breach = (outcome.word() == "FAIL").then(|| first_breach(&all, expect, figures)).flatten();
        let next_step = NextStep::of(outcome, manifest, figures, &all, first_breach.as_ref());
        let (word, exit_code) = outcome.word_and_exit();
        Self {
            word,
            first_breach,
            next_step: next_step.map(|step| in_words(step, manifest)),
            reason,
            exit_code,
            timing,
            checks: all,
            warnings: manifest.warnings.clone(),
            digest: figures.digest.clone(),
            outcome,
        }
    }

    /// The reason in words, with the first breach where one shows.
    pub fn in_words(&self) -> String {
        match &self.first_breach {
            None => self.reason.clone(),
            Some(breach) if self.reason == format!("failed: {}", breach.check) => format!("failed: {breach}"),
            Some(breach) => format!("{}; first: {breach}", self.reason),
        }
    }

    /// What to do next with the run in this folder.
    pub fn next_step_in(&self, folder: &str) -> Option<String> {
        Some(self.next_step.as_ref()?.replace("RUN", folder))
    }

    /// What to do about the machine; `None` if the machine disturbed nothing.
    pub fn advice(&self) -> Option<&'static str> {
        // The next step of an INVALID run is the advice.
        let is_advised = self.timing.word == TimingWord::Disturbed && self.exit_code != Exit::Invalid;
        is_advised.then_some(DOCTOR)
    }

    /// Whether a fault or stimulus of the scenario did not act, so that the run tested nothing of what it is about.
    pub fn has_idle_entry(&self) -> bool {
        self.checks.iter().any(|check| is_of_scenario(check) && check.is_untested())
    }

    /// Whether checks alone decided it, so that their findings are the reason.
    pub fn is_by_checks(&self) -> bool {
        matches!(self.outcome, Outcome::Named(Untested) | Outcome::ChecksFailed)
    }
}

/// Why the machine leaves nothing to judge a run by that ended normally; `None` if the run can be judged. What the rig
/// missed by itself fails the run, and where no cycle ran there is nothing to judge.
fn unjudged(limits: &ChecksConfig, timing: &Timing, checks: &[Check]) -> Option<String> {
    let has = |result| checks.iter().any(|check| check.result == result);
    if matches!(timing.word, TimingWord::Missed | TimingWord::Unknown) {
        return None;
    }
    if timing.is_disturbed() && limits.timing == TimingConfig::Strict {
        return Some("checks.timing = \"strict\" allows no lost cycle".to_owned());
    }
    if timing.lost_percent() > limits.machine_lost_percent {
        let (lost, limit) = (timing.lost_percent(), limits.machine_lost_percent);
        return Some(format!("the machine lost {lost:.1} % of the cycles, limit {limit} %"));
    }
    let excused =
        || named(checks, CheckResult::Excused).map(|names| format!("lost cycles may explain: {names}"));
    if has(CheckResult::Failed) { None } else { excused() }
}

/// Where to begin with stalls of the machine.
const DOCTOR: &str = "masseter doctor lists what disturbs this machine";

fn failed(checks: &[Check]) -> Option<OutcomeReason> {
    named(checks, CheckResult::Failed).map(|names| (Outcome::ChecksFailed, format!("failed: {names}")))
}

/// The untested checks with their remedies; without a cycle, all of them.
fn untested(checks: &[Check], cycles: u64) -> Option<OutcomeReason> {
    let idle = checks.iter().filter(|check| check.is_untested());
    let findings: Vec<_> = idle.map(|check| format!("{}: {}", check.name, check.finding)).collect();
    let why = if cycles == 0 { "no cycle ran".to_owned() } else { findings.join("; ") };
    (!why.is_empty()).then_some((Outcome::Named(Untested), why))
}

/// Whether a check counts beside the expected outcome, not towards it: an expected event always does. A requirement counts
/// towards whether the run passes, but says nothing on how it ends.
fn stands_beside(check: &Check, expect: &ExpectConfig) -> bool {
    let is_by_checks = [Pass, Fail, Untested].into_iter().any(|outcome| expect.accepts(outcome));
    check.subject == Subject::ExpectedEvent || (check.is_requirement() && !is_by_checks)
}

/// The outcome of a run that expects one: passed if the outcome is this one, and what stands beside it holds. A run that the
/// machine spoiled stays INVALID.
fn against(
    expect: &ExpectConfig,
    (outcome, reason): OutcomeReason,
    [checks, beside]: [&[Check]; 2],
    figures: &Figures,
) -> OutcomeReason {
    let Some(ending) = outcome.named() else { return (outcome, reason) };
    if !expect.accepts(ending) {
        let reason = if ending == Pass { "every check of the rig passed" } else { reason.as_str() };
        let reason = format!("expected {}, but {}: {reason}", wanted(expect), outcome.word());
        return (Outcome::Named(Fail), reason);
    }
    if let Some(other) = other_failures(expect, [checks, beside]) {
        return other;
    }
    // A fault or stimulus that did not act shows nothing, whatever is expected. The rig's own checks still count, also those of
    // the motion until a process died or the recording ended. What they leave unrecorded follows from the expected end; a gap in
    // an expected loss leaves nothing to compare the jaw with.
    let own = || {
        let is_in_order = matches!(ending, SafeStop | Interrupted);
        let has_gap = ending == Incomplete && (figures.missing_messages() > 0 || !figures.damage.is_empty());
        let follows = |check: &&Check| !is_in_order && (has_gap || check.subject == Subject::Recording);
        let function: Vec<_> = checks.iter().filter(|check| !follows(check)).cloned().collect();
        let short = is_in_order.then(|| incomplete(figures)).flatten();
        let counts =
            |check: &&Check| is_of_scenario(check) || (is_in_order && check.subject == Subject::Sequence);
        let idle: Vec<_> = checks.iter().filter(counts).cloned().collect();
        let failed = || if ending == Fail { None } else { failed(&function) };
        short.or_else(failed).or_else(|| untested(&idle, figures.cycles))
    };
    let lost = || {
        let names = named(beside, CheckResult::Excused)?;
        Some((Outcome::Invalid, format!("lost cycles may explain: {names}")))
    };
    own()
        .or_else(|| failed(beside))
        .or_else(lost)
        .or_else(|| untested(beside, figures.cycles))
        .unwrap_or_else(|| (Outcome::Named(Pass), format!("{}, as expected: {reason}", outcome.word())))
}

/// The outcome where a check did not pass beside the expected failures, or passed instead of them. `None` if the
/// scenario names no failure.
fn other_failures(expect: &ExpectConfig, checks: [&[Check]; 2]) -> Option<OutcomeReason> {
    if expect.failed.is_empty() {
        return None;
    }
    let all = || checks.into_iter().flatten();
    let others = |result, what: &str| {
        let others = all().filter(|check| check.result == result && !check.must_fail(Some(expect)));
        others.map(|check| format!("{} {what}", check.name)).collect::<Vec<_>>()
    };
    let has_failed = |name: &String| all().any(|check| check.result.is_failed() && *name == check.name);
    let idle = expect.failed.iter().filter(|name| !has_failed(name)).map(|name| format!("{name} did not"));
    let is_twice = |name: &&String| all().filter(|check| **name == check.name).count() > 1;
    let twice = expect.failed.iter().filter(is_twice);
    let twice = twice.map(|name| format!("two checks have the name {name}: rename the requirement"));
    let other =
        [others(CheckResult::Failed, "failed"), others(CheckResult::Untested, "is untested")].concat();
    let wrong: Vec<_> = other.into_iter().chain(idle).chain(twice).collect();
    let lost = others(CheckResult::Excused, "may have failed by lost cycles");
    let (outcome, wrong) =
        if wrong.is_empty() { (Outcome::Invalid, lost) } else { (Outcome::Named(Fail), wrong) };
    let named = expect.failed.join(", ");
    let reason = || format!("expected that {named} fails and nothing else, but {}", wrong.join(", "));
    (!wrong.is_empty()).then(|| (outcome, reason()))
}

/// The expected outcome, in words.
fn wanted(expect: &ExpectConfig) -> String {
    let outcomes = ExpectedVerdict::ALL.into_iter().filter(|outcome| expect.accepts(*outcome));
    let words: Vec<_> = outcomes.map(|outcome| Outcome::Named(outcome).word()).collect();
    words.join(" or ")
}

/// Whether it is a check of what the scenario lets happen.
fn is_of_scenario(check: &Check) -> bool {
    matches!(check.subject, Subject::Faults { .. } | Subject::Stimuli)
}

/// The sentence of a step, with the command of this run's machine and the arguments that play the scenario as this run did.
fn in_words(step: NextStep, manifest: &Manifest) -> String {
    let mending = manifest.mending_command.as_deref().unwrap_or_default();
    let controller = manifest.controller.as_ref().map(|name| format!(" --controller '{name}'"));
    let again = manifest.clock.clone() + &controller.unwrap_or_default();
    step.name().replace("MEND", mending).replace("CLOCK", &again)
}

/// The earliest breach, but of the failures that the scenario expects.
fn first_breach(checks: &[Check], expect: Option<&ExpectConfig>, figures: &Figures) -> Option<Breach> {
    let failed = checks.iter().filter(|check| check.result.is_failed() && !check.must_fail(expect));
    let motion_ns = figures.path_breach.motion_ns.map(|[began_ns, _]| began_ns);
    earliest(failed.filter_map(|check| check.breach.clone()), motion_ns)
}

/// The checks of a result by their names; none without such checks.
fn named(checks: &[Check], result: CheckResult) -> Option<String> {
    let names: Vec<_> =
        checks.iter().filter(|check| check.result == result).map(|check| check.name.as_ref()).collect();
    (!names.is_empty()).then(|| names.join(", "))
}

#[cfg(test)]
mod tests;
