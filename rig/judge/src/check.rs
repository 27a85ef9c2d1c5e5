//! One thing that a run is checked for: its finding, and whether that is as it should be. Among the checks of this
//! file is whether the platform followed its path: its errors while the motion played, and where each fault led it.

use std::borrow::Cow;

use masseter_scenario::{ChecksConfig, ExpectConfig, FaultConfig, Scenario, wording::counted};
use serde::Serialize;

use crate::breach::{Bound, Breach, is_within};
use crate::{declared_faults::FaultFigures, tracking::PoseErrors};

/// The result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CheckResult {
    /// It is.
    Passed,
    /// It is not.
    Failed,
    /// It is not, and the machine may be the cause.
    Excused,
    /// It could not show: what it needs did not happen. The finding names the remedy.
    Untested,
    /// It does not apply to this run; the finding has the reason.
    NotJudged,
}

impl CheckResult {
    pub(crate) fn is_failed(self) -> bool {
        self == Self::Failed
    }

    /// The word in tables.
    pub fn mark(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAIL",
            Self::Excused => "lost",
            Self::Untested => "UNTESTED",
            Self::NotJudged => "skip",
        }
    }
}

/// The figures of a requirement.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CheckFigures {
    /// How far the requirement is from failing, in `margin_unit`; negative where it fails; `None` if there is no number.
    pub margin: Option<f64>,
    /// Unit of the margin.
    pub margin_unit: &'static str,
    /// The margin as a share of the limit.
    pub relative_margin: Option<f64>,
    /// The moment of the smallest margin, s since the motion began.
    pub worst_at_s: Option<f64>,
    /// The longest time from a trigger to its response, ms.
    pub latency_ms: Option<f64>,
}

/// One thing that was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What.
    pub name: Cow<'static, str>,
    /// The requirement of the user's own list that it shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// The finding, with its limit.
    pub finding: String,
    /// Whether it is as it should be.
    pub result: CheckResult,
    /// The figures, where it is a requirement of the scenario.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub figures: Option<CheckFigures>,
    #[serde(skip)]
    pub(crate) subject: Subject,
    /// The value beyond its limit, where it failed.
    #[serde(skip)]
    pub(crate) breach: Option<Breach>,
}

/// What a check is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Subject {
    Rig,
    /// Which motion was played, and how it ended.
    Sequence,
    /// Whether everything was recorded.
    Recording,
    /// The faults that the scenario declares.
    Faults {
        have_all_acted: bool,
    },
    /// The stimuli that the scenario declares.
    Stimuli,
    /// A requirement of the scenario.
    Requirement,
    /// An event that the scenario expects of the run.
    ExpectedEvent,
}

impl Check {
    pub(crate) fn new(name: impl Into<Cow<'static, str>>, finding: String, result: CheckResult) -> Self {
        let (id, figures, breach) = (None, None, None);
        Self { name: name.into(), id, finding, result, figures, subject: Subject::Rig, breach }
    }

    /// Whether it is a requirement of the scenario, or an event that it expects.
    pub fn is_requirement(&self) -> bool {
        matches!(self.subject, Subject::Requirement | Subject::ExpectedEvent)
    }

    /// Whether the scenario names it as one that must fail.
    pub(crate) fn must_fail(&self, expect: Option<&ExpectConfig>) -> bool {
        expect.is_some_and(|expect| expect.failed.iter().any(|name| *name == self.name))
    }

    /// Whether it could not show. A declared fault that never acted stays untested, also where another one fails the check.
    pub(crate) fn is_untested(&self) -> bool {
        self.result == CheckResult::Untested || self.subject == Subject::Faults { have_all_acted: false }
    }

    pub(crate) fn judged(name: &'static str, finding: String, passed: bool) -> Self {
        let result = if passed { CheckResult::Passed } else { CheckResult::Failed };
        Self::new(name, finding, result)
    }

    /// With what was beyond its limit.
    pub(crate) fn with_breach(self, breach: impl Into<Option<Breach>>) -> Self {
        let breach = breach.into().map(|breach| breach.of(self.name.clone()));
        Self { breach, ..self }
    }

    /// A failure that the machine may explain is excused.
    pub(crate) fn unless(self, is_explained: bool) -> Self {
        match self.result {
            CheckResult::Failed if is_explained => Self { result: CheckResult::Excused, ..self },
            _ => self,
        }
    }

    pub(crate) fn untested(name: &'static str, why: String) -> Self {
        Self::new(name, why, CheckResult::Untested)
    }

    pub(crate) fn not_judged(name: &'static str, why: String) -> Self {
        Self::new(name, why, CheckResult::NotJudged)
    }
}

/// Unlike the mean, the largest error is also that of the moves around the motion.
const AROUND: &str = ", approach and hold included";

/// Fewer samples of a motion show nothing.
const FEWEST_SAMPLES: u64 = 10;

/// The error nearest to its limit, or all that exceed theirs; untested if the motion left too little to compare.
pub(crate) fn tracking(name: &'static str, errors: &PoseErrors, limits: &ChecksConfig) -> Check {
    let ChecksConfig { tracking_rms_mm, tracking_max_mm, tracking_rms_deg, tracking_max_deg, .. } = *limits;
    let samples = errors.samples;
    let figures = [
        ("incisal point rms", errors.incisal_rms_mm, tracking_rms_mm, " mm"),
        ("incisal point max", errors.incisal_max_mm, tracking_max_mm, " mm"),
        ("platform rms", errors.rms_mm, tracking_rms_mm, " mm"),
        ("platform max", errors.max_mm, tracking_max_mm, " mm"),
        ("platform rms", errors.rms_deg, tracking_rms_deg, "°"),
        ("platform max", errors.max_deg, tracking_max_deg, "°"),
    ];
    let figures = figures.into_iter();
    let mut found: Vec<_> = figures
        .filter_map(|(what, value, limit, unit)| Some(Bound { what, value: value?, limit, unit, digits: 4 }))
        .collect();
    found.sort_by(|one, other| other.share().total_cmp(&one.share()));
    let exceeding: Vec<_> = found.iter().filter(|bound| bound.is_beyond()).collect();
    match found.first() {
        _ if !exceeding.is_empty() => {
            let finding: Vec<_> = exceeding.iter().map(ToString::to_string).collect();
            Check::judged(name, finding.join("; "), false).with_breach(exceeding[0].breach(""))
        }
        Some(closest) if samples >= FEWEST_SAMPLES => {
            let around = if closest.what.ends_with("max") { AROUND } else { "" };
            Check::judged(name, format!("{closest}; {samples} samples{around}"), true)
        }
        _ => {
            let samples = counted(samples, "sample");
            let why =
                format!("{samples} to compare, at least {FEWEST_SAMPLES} needed: play more of the motion");
            Check::untested(name, why)
        }
    }
}

/// A test with faults that passes without them has tested nothing, also where one struck only after the rig had
/// stopped, unless it waits for the stop. A fault that leads the jaw beyond the limits must be detected before. None
/// where no fault is declared. `lasted_s`: how long the run lasted since the motion began, and since the rig was switched on.
pub(crate) fn faults(
    scenario: &Scenario,
    found: &[FaultFigures],
    last_act_ns: Option<u64>,
    lasted_s: [Option<f64>; 2],
) -> Option<Check> {
    let Scenario { faults: declared, checks, .. } = scenario;
    let ChecksConfig { tracking_max_mm, tracking_max_deg, .. } = *checks;
    let behind_end = |fault: &FaultConfig| {
        let at_s = fault.at_s.filter(|_| fault.after.is_none());
        let mut begins_s = [at_s, fault.from_s].into_iter().zip(lasted_s);
        let [begins_s, lasted_s] = begins_s.find_map(|(begins_s, lasted_s)| Some([begins_s?, lasted_s?]))?;
        (begins_s > lasted_s).then(|| format!("{begins_s} s, after the run's end at {lasted_s:.3} s"))
    };
    let (mut acted, mut late, mut never) = (0, Vec::new(), Vec::new());
    let (mut behind, mut beyond) = (Vec::new(), Vec::new());
    for (fault, found) in declared.iter().zip(found) {
        let FaultFigures { number, struck_ns, deviation_mm, deviation_deg, led_off_path, detection } = found;
        let waits = waits_for_stop(scenario, fault.after.as_deref());
        match (struck_ns, behind_end(fault)) {
            (None, None) => never.push(number.to_string()),
            (None, Some(when)) => {
                behind.push(format!(
                    ", number {number} at {when}: let the fault begin earlier, or play longer"
                ));
            }
            (Some(_), _) if !waits && last_act_ns.is_some_and(|ns| *struck_ns > Some(ns)) => {
                late.push(number.to_string());
            }
            (Some(_), _) => acted += 1,
        }
        let is_beyond =
            !is_within(*deviation_mm, tracking_max_mm) || !is_within(*deviation_deg, tracking_max_deg);
        if is_beyond && *led_off_path {
            let until = if detection.is_some() { "before it was detected" } else { "undetected" };
            beyond.push(format!(
                "; number {number}, {fault}, moved the jaw {deviation_mm:.3} mm and {deviation_deg:.3}° from its path {until}, \
                 limit {tracking_max_mm} mm and {tracking_max_deg}°"
            ));
        }
    }
    let which = |numbers: &[String], what: &str| match numbers {
        [] => String::new(),
        numbers => format!(", number {} {what}", numbers.join(", ")),
    };
    let never = which(&never, "never: raise its probability, or let the fault act earlier or longer");
    let after = which(&late, "only after the rig had stopped");
    let have_all_acted = acted == declared.len();
    let result = match (beyond.is_empty(), have_all_acted) {
        (true, true) => CheckResult::Passed,
        (true, false) => CheckResult::Untested,
        (false, _) => CheckResult::Failed,
    };
    let finding = format!("{acted} of {} declared faults acted{after}{never}", declared.len());
    let check = Check::new("faults", finding + &behind.concat() + &beyond.concat(), result);
    (!declared.is_empty()).then_some(Check { subject: Subject::Faults { have_all_acted }, ..check })
}

/// A test with stimuli of which one never began, began only after the rig had stopped, or changes nothing, has not tested what it
/// should. None without stimuli. `began_ns`: when each began.
pub(crate) fn stimuli(
    scenario: &Scenario,
    began_ns: &[Option<u64>],
    last_act_ns: Option<u64>,
) -> Option<Check> {
    let declared = &scenario.stimulus;
    let (mut never, mut late, mut idle) = (Vec::new(), Vec::new(), Vec::new());
    for (place, (stimulus, began_ns)) in declared.iter().zip(began_ns).enumerate() {
        let is_late = |began_ns| last_act_ns.is_some_and(|last_ns| began_ns > last_ns);
        let list = match began_ns {
            None => &mut never,
            Some(_) if stimulus.changes_nothing() => &mut idle,
            Some(began_ns) if is_late(*began_ns) && !waits_for_stop(scenario, stimulus.after.as_deref()) => {
                &mut late
            }
            Some(_) => continue,
        };
        list.push((place + 1).to_string());
    }
    let began = declared.len() - never.len();
    let parts = [
        (never, "never: let the stimulus begin earlier, or play longer"),
        (late, "only after the rig had stopped"),
        (idle, "without a force or a mass"),
    ];
    let parts: Vec<_> = parts.into_iter().filter(|(numbers, _)| !numbers.is_empty()).collect();
    let which = parts.iter().map(|(numbers, what)| format!(", number {} {what}", numbers.join(", ")));
    let finding = format!("{began} of {} stimuli began{}", declared.len(), which.collect::<String>());
    let result = if parts.is_empty() { CheckResult::Passed } else { CheckResult::Untested };
    let check = Check::new("stimuli", finding, result);
    (!declared.is_empty()).then_some(Check { subject: Subject::Stimuli, ..check })
}

/// Whether an entry that counts from this occurrence waits for a stop: for a state behind the motion, for an operator's stop, or
/// for another entry that waits for one.
fn waits_for_stop(scenario: &Scenario, after: Option<&str>) -> bool {
    let Some((list, name)) = after.and_then(|after| after.split_once('.')) else { return false };
    let named = |own: &str| own == name;
    match list {
        "controller" => ["holding", "disabling", "finished", "safe_stop"].contains(&name),
        "fault" => scenario
            .faults
            .iter()
            .any(|fault| named(fault.name()) && waits_for_stop(scenario, fault.after.as_deref())),
        _ => scenario.stimulus.iter().any(|stimulus| {
            named(stimulus.name()) && (stimulus.stop || waits_for_stop(scenario, stimulus.after.as_deref()))
        }),
    }
}

#[cfg(test)]
mod tests;
