//! The verdict on a run: by its end, then its recording, then the machine, then its checks.

use masseter_analysis::{EventRecord, Figures, Outage};
use masseter_recording::{DmaLatency, Ending, Manifest, RunUsage};
use masseter_shared::config::CanConfig;
use masseter_shared::messages::codes::EventKind;
use masseter_terminal::Exit;
use serde::Serialize;

use crate::check::{Check, CheckResult};
use crate::checks::{checks, missed_cycles};
use crate::motion_checks::{FAULTS, left_its_path};
use crate::text;

/// The judgement of a run.
///
/// ```
/// use masseter_analysis::Analysis;
/// use masseter_recording::{MachineInfo, Manifest};
/// use masseter_report::Verdict;
/// use masseter_shared::config::Scenario;
///
/// let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
/// let manifest = Manifest::new(Scenario::default(), 10.0, "virtual", machine);
/// let figures = Analysis::new(&manifest.scenario).finish(false, &[]);
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
    /// Every check, also those that passed.
    pub checks: Vec<Check>,
}

impl Verdict {
    /// Judges a run.
    pub fn new(manifest: &Manifest, figures: &Figures) -> Self {
        let disturbed = disturbed(manifest, figures);
        let checks = checks(manifest, figures, disturbed.is_some());
        let is_too_late = left_its_path(&figures.tracking.actual, &manifest.scenario.checks)
            || checks.iter().any(|check| check.name == FAULTS && check.result == CheckResult::Failed);
        let (exit_code, mut reason) = ending(&manifest.ending, &figures.events)
            // The machine caused the stop, or it came only after the jaw had left its path.
            .filter(|(exit, _)| !(*exit == Exit::SafeStop && (disturbed.is_some() || is_too_late)))
            .or_else(|| incomplete(figures))
            .or(disturbed)
            .or_else(|| {
                failed(&checks)
                    .map(|failure| clock_jump(&manifest.usage, &manifest.scenario.can).unwrap_or(failure))
            })
            .unwrap_or_else(|| (Exit::Passed, "every check passed".to_owned()));
        if exit_code != Exit::Passed {
            reason += &overload(&manifest.usage, manifest.scenario.rate_hz).unwrap_or_default();
        }
        Self { word: word(exit_code), reason, exit_code, checks }
    }

    pub(crate) fn is_passed(&self) -> bool {
        self.exit_code == Exit::Passed
    }

    /// Whether the checks decided it.
    pub(crate) fn is_judged(&self) -> bool {
        matches!(self.exit_code, Exit::Passed | Exit::Failed)
    }
}

/// The word for an outcome in reports.
fn word(outcome: Exit) -> &'static str {
    match outcome {
        Exit::Passed => "PASS",
        Exit::Failed => "FAIL",
        Exit::Usage => "NOT RUN",
        Exit::Invalid => "INVALID",
        Exit::Died => "DIED",
        Exit::SafeStop => "SAFE STOP",
        Exit::Incomplete => "INCOMPLETE",
        Exit::Interrupted => "INTERRUPTED",
    }
}

/// Share of its core above which a real-time process is too busy: the kernel throttles at 95 %, by default.
const TOO_BUSY: f64 = 0.9;

/// The remedy for a real-time process that hardly ever slept.
fn overload(usage: &RunUsage, rate_hz: u32) -> Option<String> {
    let busy = |name: &'static str| {
        let share = usage.processes.get(name)?.share();
        (share > TOO_BUSY).then_some((name, share))
    };
    let (name, share) = ["controller", "plant"].into_iter().find_map(busy)?;
    Some(format!(
        "; the {name} kept its core busy for {:.0} % of the time, and the kernel throttles real-time tasks at 95 %: \
         use a rate_hz below {rate_hz}",
        share * 100.0
    ))
}

type ExitReason = (Exit, String);

fn ending(ending: &Ending, events: &[EventRecord]) -> Option<ExitReason> {
    match ending {
        Ending::Completed => None,
        Ending::SafeStop => Some((Exit::SafeStop, stopped(events))),
        Ending::Died { process, how } => Some((Exit::Died, format!("the {process} died: {how}"))),
        Ending::Interrupted => Some((Exit::Interrupted, "stopped by the user".to_owned())),
        Ending::NotStarted => Some((Exit::Invalid, "real time was required and refused".to_owned())),
        Ending::RecordingFailed => {
            Some((Exit::Incomplete, "the recorder could not write everything".to_owned()))
        }
    }
}

/// The first fault explains the stop: the controller's own event often names only the master.
fn stopped(events: &[EventRecord]) -> String {
    let first = events.iter().find(|event| event.kind == EventKind::Fault);
    let why = first.map_or_else(String::new, |fault| format!("; first fault: {}", text::event(fault)));
    format!("the controller stopped the rig{why}")
}

fn incomplete(figures: &Figures) -> Option<ExitReason> {
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
    Some((Exit::Incomplete, reason))
}

/// Whether the machine kept the rig from too many cycles to judge it, or never granted it real time. A safe stop is
/// excused only when many of them were missed just before it, and is so however many may be missed.
fn disturbed(manifest: &Manifest, figures: &Figures) -> Option<ExitReason> {
    let refusal = manifest.refusal();
    let (skipped, by_machine) = figures.skipped();
    let stop = excuse(
        &manifest.ending,
        missed_cycles(manifest, figures),
        figures.outage,
        by_machine == skipped || refusal.is_some(),
    )?;
    let reason = if let Some((process, refusal)) = refusal {
        format!("{skipped} cycles were missed without real time{stop}; {process}: {refusal}")
    } else {
        format!("{}{stop}; {}", withheld(figures), remedy(manifest))
    };
    Some((Exit::Invalid, reason))
}

/// The time for which the machine stalled, and the cycles missed.
fn withheld(figures: &Figures) -> String {
    let (controller, plant) = (&figures.controller_skips, &figures.plant_skips);
    let stalled_ms = (controller.stalled_ns + plant.stalled_ns) as f64 / 1e6;
    let (skipped, _) = figures.skipped();
    let while_working = match controller.while_working + plant.while_working {
        0 => String::new(),
        n => format!(", {n} of them during work, possibly also by a stall"),
    };
    format!(
        "the machine stalled for {stalled_ms:.1} ms while the rig waited, and {skipped} cycles were \
         missed{while_working}"
    )
}

/// Real interfaces stamp frames by the wall clock: once it was set, these times are useless. Simulated ones do not use it.
fn clock_jump(usage: &RunUsage, can: &CanConfig) -> Option<ExitReason> {
    let jump_s = usage.clock_jump_s;
    (jump_s != 0.0 && !can.is_virtual()).then(|| {
        let reason = format!(
            "the wall clock jumped by {jump_s:.3} s, as it does when it is set or the machine was suspended; repeat the run"
        );
        (Exit::Invalid, reason)
    })
}

/// The remedy against stalls of the machine.
fn remedy(manifest: &Manifest) -> &'static str {
    match &manifest.cpu_dma_latency {
        Some(DmaLatency { limit_us: None, .. }) => {
            "`realtime.cpu_dma_latency = \"hold\"` may help; `masseter bench loop` measures that"
        }
        _ => "`masseter doctor` shows the remedies",
    }
}

/// The excuse for the end of a disturbed run, in words: empty when it ended normally, none without an excuse.
fn excuse(
    ending: &Ending,
    missed: CheckResult,
    outage: Option<Outage>,
    is_excusable: bool,
) -> Option<String> {
    match (ending, outage) {
        (Ending::SafeStop, Some(outage)) if is_excusable && outage.explains_the_stop() => {
            Some(format!(", {} of {} just before the safe stop", outage.missed, outage.of))
        }
        (Ending::SafeStop, _) => None,
        _ => (missed == CheckResult::NotJudged).then(String::new),
    }
}

fn failed(checks: &[Check]) -> Option<ExitReason> {
    let failed: Vec<_> =
        checks.iter().filter(|check| check.result == CheckResult::Failed).map(|check| check.name).collect();
    (!failed.is_empty()).then(|| (Exit::Failed, format!("failed: {}", failed.join(", "))))
}

#[cfg(test)]
mod tests {
    mod figures;

    use masseter_shared::messages::Event;
    use masseter_shared::messages::codes::{Cause, Source};

    use super::*;
    use masseter_recording::Usage;

    #[test]
    fn a_safe_stop_is_explained_by_what_went_wrong_first() {
        let event = |source, kind, cause| Event::new(source, kind, cause);
        let lost = event(Source::Master, EventKind::Fault, Cause::ProcessDataLost);
        let events = [
            event(Source::Wire, EventKind::Notice, Cause::FaultInjected),
            Event { axis: 0, node: 1, value: 4.0, ..lost },
            event(Source::Controller, EventKind::Fault, Cause::MasterFault),
        ];
        let (outcome, reason) = ending(&Ending::SafeStop, &events.map(|event| (&event).into())).unwrap();
        assert_eq!(outcome, Exit::SafeStop);
        assert_eq!(
            reason,
            "the controller stopped the rig; first fault: master: process_data_lost \
             (axis d1 (node 1 on bus 0): process data missing for 4 cycles)"
        );
        assert_eq!(ending(&Ending::SafeStop, &[]).unwrap().1, "the controller stopped the rig");
    }

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
    fn a_jump_of_the_clock_excuses_runs_on_real_interfaces_alone() {
        let simulated = CanConfig::default();
        let real = CanConfig { interfaces: vec!["can0".to_owned()], ..simulated.clone() };
        let jump = |clock_jump_s, can| clock_jump(&RunUsage { clock_jump_s, ..RunUsage::default() }, can);
        assert_eq!(jump(0.0, &real), None);
        assert_eq!(jump(-3.5, &simulated), None);
        let (outcome, reason) = jump(-3.5, &real).unwrap();
        assert_eq!(outcome, Exit::Invalid);
        assert!(reason.contains("jumped by -3.500 s"), "{reason}");
    }

    #[test]
    fn what_the_machine_did_excuses_missed_cycles_and_a_safe_stop_that_follows_them() {
        use CheckResult::{Failed, NotJudged, Passed};
        use Ending::{Completed, SafeStop};
        let short = Some(Outage { missed: 9, of: 100 });
        let long = Some(Outage { missed: 75, of: 100 });
        let explained = Some(", 75 of 100 just before the safe stop");
        let cases = [
            (Completed, NotJudged, None, true, Some("")),
            (Completed, Passed, None, true, None),
            (Completed, Failed, None, false, None),
            (SafeStop, NotJudged, long, true, explained),
            (SafeStop, Passed, long, true, explained),
            (SafeStop, Passed, long, false, None),
            (SafeStop, Failed, long, false, None),
            (SafeStop, NotJudged, short, true, None),
            (SafeStop, NotJudged, None, true, None),
        ];
        for (ending, missed, outage, is_excusable, expected) in cases {
            let excuse = excuse(&ending, missed, outage, is_excusable);
            assert_eq!(excuse.as_deref(), expected, "{ending:?} {missed:?} {outage:?} {is_excusable}");
        }
    }
}
