//! How a run is judged: its end, then its recording, then the machine, then its checks.

use serde::{Deserialize, Serialize};

use crate::analysis::{BusResponse, Figures, Outage, ResponseFigures, Suspicion};
use crate::exit::Exit;
use crate::report::table;
use crate::run::manifest::Manifest;
use crate::run::usage::RunUsage;

/// How a run came to its end.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Ending {
    /// The motion was played to its end.
    Completed,
    /// The controller stopped safely because of a fault.
    SafeStop,
    /// A process died.
    Died {
        /// Which.
        process: String,
        /// Exit code or signal.
        how: String,
    },
    /// The user interrupted it.
    Interrupted,
    /// Real time was required and refused.
    NotStarted,
    /// The logger could not write everything.
    RecordingFailed,
}

impl Ending {
    /// The death of a process.
    pub fn died(process: &str, how: String) -> Self {
        Self::Died { process: process.to_owned(), how }
    }
}

/// Whether what was checked is as it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CheckResult {
    /// It is.
    Passed,
    /// It is not.
    Failed,
    /// This run cannot tell; the finding says why.
    NotJudged,
}

impl CheckResult {
    fn of(passed: bool) -> Self {
        if passed { Self::Passed } else { Self::Failed }
    }

    /// In a word.
    pub fn mark(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAIL",
            Self::NotJudged => "skip",
        }
    }
}

/// One thing that was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What.
    pub name: &'static str,
    /// What was found, with its limit.
    pub finding: String,
    /// Whether it is as it should be.
    pub result: CheckResult,
}

impl Check {
    fn judged(name: &'static str, finding: String, passed: bool) -> Self {
        Self { name, finding, result: CheckResult::of(passed) }
    }

    /// A failure that `excused` explains is none.
    fn unless(self, excused: bool) -> Self {
        match self.result {
            CheckResult::Failed if excused => Self { result: CheckResult::NotJudged, ..self },
            _ => self,
        }
    }

    fn not_judged(name: &'static str, why: String) -> Self {
        Self { name, finding: why, result: CheckResult::NotJudged }
    }
}

/// The judgement of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// PASS, FAIL, INVALID, …
    pub word: &'static str,
    /// The reason in a sentence.
    pub reason: String,
    /// Exit code.
    #[serde(rename = "exit_code")]
    pub exit: Exit,
    /// Every check, also those that passed.
    pub checks: Vec<Check>,
}

impl Verdict {
    /// Judges a run.
    pub fn of(manifest: &Manifest, figures: &Figures) -> Self {
        let disturbed = disturbed(manifest, figures);
        let checks = checks(manifest, figures, disturbed.is_some());
        let (exit, word, mut reason) = ending(&manifest.ending)
            .filter(|(exit, ..)| !(*exit == Exit::SafeStop && disturbed.is_some()))
            .or_else(|| incomplete(figures))
            .or(disturbed)
            .or_else(|| failed(&checks))
            .unwrap_or_else(|| (Exit::Passed, "PASS", "every check passed".to_owned()));
        if exit != Exit::Passed {
            reason += &overload(&manifest.usage, manifest.scenario.rate_hz).unwrap_or_default();
        }
        Self { word, reason, exit, checks }
    }
}

/// What stretches of work that cost deadlines were held against.
fn weighed(suspicion: Suspicion) -> String {
    format!(
        "; {} stretches of work against {} stalls as long while waiting, {:.1} % of the time at work: chance does so \
         with probability {:.2}",
        suspicion.while_working,
        suspicion.while_waiting,
        suspicion.work_share * 100.0,
        suspicion.chance
    )
}

/// Share of its core above which a real-time process is too busy: the kernel throttles at 95 %, by default.
const TOO_BUSY: f64 = 0.9;

/// What to do about a real-time process that hardly ever slept.
fn overload(usage: &RunUsage, rate_hz: u32) -> Option<String> {
    let busy = |name: &'static str| {
        let usage = usage.processes.get(name)?;
        let share = usage.cpu_s / usage.observed_s;
        (share > TOO_BUSY).then_some((name, share))
    };
    let (name, share) = ["controller", "plant"].into_iter().find_map(busy)?;
    Some(format!(
        "; the {name} kept its core busy for {:.0} % of the time, and the kernel throttles real-time tasks at 95 %: \
         use a rate_hz below {rate_hz}",
        share * 100.0
    ))
}

type Judgement = (Exit, &'static str, String);

fn ending(ending: &Ending) -> Option<Judgement> {
    match ending {
        Ending::Completed => None,
        Ending::SafeStop => Some((
            Exit::SafeStop,
            "SAFE STOP",
            "the controller stopped the rig; its event says why".to_owned(),
        )),
        Ending::Died { process, how } => {
            Some((Exit::Died, "DIED", format!("the {process} died: {how}; the others stopped safely")))
        }
        Ending::Interrupted => Some((Exit::Interrupted, "INTERRUPTED", "stopped by the user".to_owned())),
        Ending::NotStarted => {
            Some((Exit::Invalid, "INVALID", "real time was required and refused".to_owned()))
        }
        Ending::RecordingFailed => {
            Some((Exit::Incomplete, "INCOMPLETE", "the logger could not write everything".to_owned()))
        }
    }
}

fn incomplete(figures: &Figures) -> Option<Judgement> {
    let missing = figures.missing_messages();
    let reason = if missing > 0 {
        format!("{missing} messages are missing from the recording")
    } else if figures.cut_short {
        "the recording lacks its end".to_owned()
    } else if let Some(damage) = figures.damage.first() {
        format!("the recording is damaged: {damage}")
    } else {
        return None;
    };
    Some((Exit::Incomplete, "INCOMPLETE", reason))
}

/// Whether too many cycles were missed. When none of them is certainly the rig's doing, there is nothing to judge
/// it by.
fn missed_cycles(manifest: &Manifest, figures: &Figures) -> CheckResult {
    let (skipped, by_machine) = figures.skipped();
    if skipped <= manifest.scenario.checks.missed_cycles {
        CheckResult::Passed
    } else if by_machine == skipped {
        CheckResult::NotJudged
    } else {
        CheckResult::Failed
    }
}

/// Whether the machine kept the rig from too many cycles to judge it. A safe stop is excused only when many of them
/// were missed just before it.
fn disturbed(manifest: &Manifest, figures: &Figures) -> Option<Judgement> {
    if missed_cycles(manifest, figures) != CheckResult::NotJudged {
        return None;
    }
    let stop = excuse(&manifest.ending, figures.outage)?;
    let (skipped, _) = figures.skipped();
    let (controller, plant) = (&figures.controller_skips, &figures.plant_skips);
    let stalled_ms = (controller.stalled_ns + plant.stalled_ns) as f64 / 1e6;
    let while_working = match controller.while_working + plant.while_working {
        0 => String::new(),
        n => format!(", {n} of them while it worked, which the machine may as well have done"),
    };
    let reason = format!(
        "the machine stood still for {stalled_ms:.1} ms while the rig waited, and {skipped} cycles were \
         missed{while_working}{stop}"
    );
    Some((Exit::Invalid, "INVALID", reason))
}

/// What excuses the way a disturbed run ended, in words; nothing to say when it ended as it should, none when there is
/// no excuse.
fn excuse(ending: &Ending, outage: Option<Outage>) -> Option<String> {
    match (ending, outage) {
        (Ending::SafeStop, Some(outage)) if outage.explains_the_stop() => {
            Some(format!(", {} of {} just before the safe stop", outage.missed, outage.of))
        }
        (Ending::SafeStop, _) => None,
        _ => Some(String::new()),
    }
}

fn failed(checks: &[Check]) -> Option<Judgement> {
    let failed: Vec<_> =
        checks.iter().filter(|check| check.result == CheckResult::Failed).map(|check| check.name).collect();
    (!failed.is_empty()).then(|| (Exit::Failed, "FAIL", format!("failed: {}", failed.join(", "))))
}

/// `is_disturbed`: the machine kept the rig from too many cycles to hold its sequence or its tracking against it.
fn checks(manifest: &Manifest, figures: &Figures, is_disturbed: bool) -> Vec<Check> {
    let limits = &manifest.scenario.checks;
    let tracking = &figures.tracking;
    let (skipped, by_machine) = figures.skipped();
    let missing = figures.missing_messages();
    let state = figures.final_state.unwrap_or("none");
    vec![
        Check::judged("sequence", format!("ended in state {state}"), state == "finished")
            .unless(is_disturbed),
        Check::judged(
            "tracking",
            format!(
                "rms {:.4} mm over {} samples, limit {} mm",
                tracking.rms_mm, tracking.samples, limits.tracking_rms_mm
            ),
            tracking.samples > 0 && tracking.rms_mm <= limits.tracking_rms_mm,
        )
        .unless(is_disturbed),
        Check {
            name: "missed cycles",
            finding: format!(
                "{skipped} ({by_machine} by the machine{}), limit {}",
                figures.suspicion.map(weighed).unwrap_or_default(),
                limits.missed_cycles
            ),
            result: missed_cycles(manifest, figures),
        },
        Check::judged("dropped messages", missing.to_string(), missing == 0),
        bus_response(&figures.bus_response, !manifest.scenario.faults.is_empty()),
    ]
}

/// No message may take longer on its bus than the plan allows at worst.
fn bus_response(response: &BusResponse, has_faults: bool) -> Check {
    const NAME: &str = "bus response";
    if has_faults {
        return Check::not_judged(NAME, "the scenario's faults are in no plan".to_owned());
    }
    if let Some(why) = &response.unbounded {
        return Check::not_judged(NAME, why.clone());
    }
    let in_words = |message: &ResponseFigures| {
        let us = |ns: Option<u64>| ns.map_or_else(|| "–".to_owned(), table::microseconds);
        let (max_us, bound_us) = (us(message.max_ns), us(message.bound_ns));
        format!("{} on bus {} took {max_us} µs, bound {bound_us} µs", message.message, message.bus)
    };
    let exceeding: Vec<_> = response.exceeding().map(in_words).collect();
    if exceeding.is_empty() {
        let tightest = response.tightest().map_or_else(|| "no message has a bound".to_owned(), in_words);
        Check::judged(NAME, format!("closest: {tightest}"), response.tightest().is_some())
    } else {
        Check::judged(NAME, exceeding.join("; "), false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::usage::Usage;

    #[test]
    fn a_process_that_hardly_sleeps_is_named_with_what_to_do() {
        let usage = |cpu_s| {
            let plant = Usage { observed_s: 2.0, cpu_s, ..Usage::default() };
            RunUsage { processes: [("plant".to_owned(), plant)].into(), ..RunUsage::default() }
        };
        assert_eq!(overload(&usage(1.0), 20_000), None);
        let said = overload(&usage(1.9), 20_000).unwrap();
        assert!(said.contains("plant kept its core busy for 95 %") && said.contains("below 20000"), "{said}");
    }

    #[test]
    fn a_safe_stop_is_excused_only_by_what_was_missed_just_before_it() {
        let outage = |missed| Some(Outage { missed, of: 100 });
        assert_eq!(excuse(&Ending::SafeStop, outage(9)), None);
        assert_eq!(excuse(&Ending::SafeStop, None), None);
        let said = excuse(&Ending::SafeStop, outage(75)).unwrap();
        assert_eq!(said, ", 75 of 100 just before the safe stop");
        assert_eq!(excuse(&Ending::Completed, None).unwrap(), "");
    }

    #[test]
    fn only_a_failure_is_excused() {
        let check = |passed| Check::judged("tracking", String::new(), passed);
        let cases = [(false, true, "skip"), (false, false, "FAIL"), (true, true, "ok"), (true, false, "ok")];
        for (passed, excused, mark) in cases {
            assert_eq!(check(passed).unless(excused).result.mark(), mark);
        }
    }

    fn response(max_ns: u64, unbounded: Option<&str>) -> BusResponse {
        let sync = ResponseFigures {
            bus: 1,
            message: "SYNC".to_owned(),
            frames: 1,
            max_ns: Some(max_ns),
            bound_ns: Some(190_000),
        };
        BusResponse { messages: vec![sync], unbounded: unbounded.map(str::to_owned) }
    }

    #[test]
    fn a_message_beyond_its_bound_fails_unless_the_bound_does_not_hold() {
        let cases = [
            (190_000, None, false, "ok"),
            (191_000, None, false, "FAIL"),
            (191_000, None, true, "skip"),
            (191_000, Some("bus 0 had 1 errors"), false, "skip"),
        ];
        for (max_ns, unbounded, has_faults, mark) in cases {
            let check = bus_response(&response(max_ns, unbounded), has_faults);
            assert_eq!(check.result.mark(), mark, "{check:?}");
        }
        let failed = bus_response(&response(191_000, None), false);
        assert_eq!(failed.finding, "SYNC on bus 1 took 191.00 µs, bound 190.00 µs");
    }
}
