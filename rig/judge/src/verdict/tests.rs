//! Verdicts on figures made by hand, each differing in one thing from those of a run that passes.

use masseter_recording::{Damage, Ending, MachineInfo, Usage};
use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, ControllerState, EventKind, Source};
use masseter_runtime::named::Declared;
use masseter_runtime::realtime::scheduling::{Obtained, SchedulingRequest};
use masseter_scenario::{BusFault, FaultConfig, Scenario};

use super::*;
use crate::{
    Analysis, Code, FaultFigures, LoopCounts, MotionFigures, Outage, Overrun, OverrunAttribution,
    OverrunCause, PoseErrors, ResponseFigures, SkipFigures, StoppedBy, TopicFigures, TrackingFigures,
    UndisturbedFigures,
};

mod disturbed;
mod expected;
mod untested;

/// A run that passes.
struct Run {
    manifest: Manifest,
    figures: Figures,
}

type Change = fn(&mut Run);

impl Run {
    fn new() -> Self {
        let scenario = Scenario::default();
        let mut figures = Analysis::new(&scenario, &Declared::default()).finish(false, &[]);
        figures.final_state = Some(Code::Known(ControllerState::Finished));
        let on_path = PoseErrors { samples: 1000, rms_mm: Some(0.05), ..PoseErrors::default() };
        figures.disorder = None;
        let undisturbed = UndisturbedFigures { samples: 900, actual: on_path, estimated: on_path };
        (figures.cycles, figures.running_s, figures.duration_s) = (1000, 10.0, 11.5);
        figures.motion = MotionFigures {
            way_mm: Some(900.0),
            played: Some(0.999),
            rest_s: Some(0.0),
            lag_ms: Some(0.0),
            late_ns: None,
            ahead_ms: None,
            lag_causes_ms: [0.0; 2],
            missed_commands: 0,
            missed_in_a_row: 0,
            late_commands: 0,
        };
        figures.tracking = TrackingFigures {
            samples: 1000,
            actual: on_path,
            estimated: on_path,
            undisturbed,
            ..figures.tracking
        };
        figures.bus_response.unbounded = None;
        figures.bus_response.messages = vec![ResponseFigures {
            bus: 0,
            message: "SYNC".to_owned(),
            frames: 1000,
            max_ns: Some(150_000),
            bound_ns: Some(190_000),
        }];
        let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
        let mut manifest = Manifest::new("0.1.0", scenario, 10.0, "rt", machine);
        manifest.ending = Ending::Completed;
        Self { manifest, figures }
    }

    fn with(change: Change) -> Verdict {
        let mut run = Self::new();
        change(&mut run);
        Verdict::new(&run.manifest, &run.figures)
    }

    /// The controller skipped deadlines because the machine stalled.
    fn disturb(&mut self) {
        self.figures.controller_skips =
            SkipFigures { skipped: 3, by_machine: 3, stalled_ns: 3_500_000, ..SkipFigures::default() };
    }

    fn refuse(&mut self) {
        let requested = SchedulingRequest { core: Some(0), fifo_priority: Some(80), locked_memory: true };
        let refusals = vec!["no priority".to_owned()];
        let obtained =
            Obtained { requested, core: None, fifo_priority: None, locked_memory: false, refusals };
        self.manifest.scheduling.insert("controller".to_owned(), obtained);
    }

    fn lose(&mut self, missing: u64) {
        self.figures.topics =
            [1, missing - 1].map(|missing| TopicFigures { topic: "state", messages: 9, missing }).to_vec();
    }

    /// It never struck.
    fn declare_fault(&mut self) {
        let idle = FaultFigures {
            number: 1,
            struck_ns: None,
            deviation_mm: 0.0,
            deviation_deg: 0.0,
            led_off_path: false,
            detection: None,
        };
        self.figures.faults.push(idle);
        self.manifest.scenario.faults.push(FaultConfig {
            bus: Some(0),
            from_s: Some(1.0),
            ..FaultConfig::new(BusFault::Lose)
        });
    }

    fn overruns(&mut self, while_working: u64, chance: f64) {
        self.figures.plant_skips = SkipFigures { skipped: 2, while_working: 2, ..SkipFigures::default() };
        self.figures.overrun_attribution =
            Some(OverrunAttribution { while_working, while_waiting: 1, work_share: 0.25, chance });
    }

    /// The controller took 100 ms for a cycle, for this reason.
    fn overrun(&mut self, cause: OverrunCause) {
        let deadlines = |is_so| if is_so { 99 } else { 0 };
        self.figures.controller_skips = SkipFigures {
            skipped: 99,
            while_working: 99,
            working_by_loop: deadlines(cause.is_own()),
            working_by_machine: deadlines(cause == OverrunCause::Machine),
            ..SkipFigures::default()
        };
        let lasted_ns = 100_000_000;
        let counts =
            LoopCounts { looked_over_ns: 120_000_000, cpu_ns: Some(6_000_000), ..LoopCounts::default() };
        let overrun = Overrun { process: "controller", cycle: 700, lasted_ns, skipped: 99, cause, counts };
        self.figures.overruns.push(overrun);
        self.figures.overrun_attribution = (cause == OverrunCause::Unknown).then_some(OverrunAttribution {
            while_working: 1,
            while_waiting: 0,
            work_share: 0.25,
            chance: 0.25,
        });
    }
}

fn results(verdict: &Verdict) -> Vec<(&str, &'static str)> {
    verdict.checks.iter().map(|check| (check.name.as_ref(), check.result.mark())).collect()
}

#[test]
fn a_run_without_anything_wrong_passes_every_check() {
    let verdict = Run::with(|_| ());
    assert_eq!((verdict.exit_code, verdict.reason.as_str()), (Exit::Passed, "every check passed"));
    let expected = [
        "sequence",
        "tracking",
        "estimated tracking",
        "motion lag",
        "commands missed",
        "timing",
        "commands late",
        "dropped messages",
        "bus response",
    ]
    .map(|name| (name, "ok"));
    assert_eq!(results(&verdict), expected);
    let findings: Vec<_> = verdict.checks.iter().map(|check| check.finding.as_str()).collect();
    assert_eq!(
        findings,
        [
            "ended in state finished",
            "platform rms 0.0500 mm, limit 0.1 mm; 1000 samples",
            "platform rms 0.0500 mm, limit 0.1 mm; 1000 samples",
            "0.0 ms, limit 20 ms",
            "0 cycles, 0 in a row, limit 20",
            "held, limit of the rig 0",
            "0 commands",
            "0",
            "closest to its bound: SYNC on bus 0 took 150 µs, bound 190 µs",
        ]
    );
}

#[test]
fn each_thing_that_is_wrong_has_its_verdict() {
    let cases: [(Change, Exit, &str); 18] = [
        (|run| run.figures.controller_skips.skipped = 3, Exit::Failed, "failed: timing"),
        (|run| run.figures.plant_skips.skipped = 1, Exit::Failed, "failed: timing"),
        (|run| run.figures.tracking.actual.rms_mm = Some(0.11), Exit::Failed, "failed: tracking"),
        (
            |run| run.figures.tracking.estimated.max_deg = Some(0.51),
            Exit::Failed,
            "failed: estimated tracking",
        ),
        (|run| run.figures.final_state = None, Exit::Failed, "failed: sequence"),
        (
            |run| {
                run.figures.motion.played = Some(0.4);
            },
            Exit::Failed,
            "failed: sequence; the scenario's motion was not played: 40 % of its way of 900.0 mm; a controller with a motion of \
             its own declares it",
        ),
        (
            |run| run.figures.final_state = Some(Code::Known(ControllerState::Disabling)),
            Exit::Failed,
            "failed: sequence",
        ),
        (
            |run| {
                let stop = Event::new(Source::Controller, EventKind::Transition, Cause::StopRequested);
                run.figures.events.push((&stop).into());
            },
            Exit::Failed,
            "failed: sequence",
        ),
        (
            |run| run.figures.bus_response.messages[0].max_ns = Some(190_001),
            Exit::Failed,
            "failed: bus response",
        ),
        (|run| run.figures.bus_response.messages.clear(), Exit::Failed, "failed: bus response"),
        (
            Run::declare_fault,
            Exit::Failed,
            "faults: 0 of 1 declared faults acted, number 1 never: raise its probability, or let the fault act earlier or \
             longer",
        ),
        (
            |run| {
                run.figures.tracking.actual.rms_mm = Some(0.2);
                run.figures.plant_skips.skipped = 1;
            },
            Exit::Failed,
            "failed: tracking, timing",
        ),
        (|run| run.lose(5), Exit::Incomplete, "5 messages are missing from the recording"),
        (|run| run.figures.cut_short = true, Exit::Incomplete, "the recording lacks its end"),
        (
            |run| run.figures.damage.push(Damage { from: 7, to: 9, reason: "a wrong checksum".to_owned() }),
            Exit::Incomplete,
            "the recording is damaged: bytes 7 to 9: a wrong checksum",
        ),
        (
            |run| run.manifest.ending = Ending::died("plant", "signal 9".to_owned()),
            Exit::Died,
            "the plant died: signal 9, before the motion",
        ),
        (|run| run.manifest.ending = Ending::Interrupted, Exit::Interrupted, "stopped by the user"),
        (
            |run| run.manifest.ending = Ending::RecordingFailed,
            Exit::Incomplete,
            "the recorder could not write everything",
        ),
    ];
    for (change, outcome, reason) in cases {
        let verdict = Run::with(change);
        assert_eq!((verdict.exit_code, verdict.reason.as_str()), (outcome, reason));
    }
}

#[test]
fn what_the_jaw_and_the_master_show_fails_a_run_and_a_short_delay_is_told() {
    let delayed = Run::with(|run| run.figures.motion.lag_ms = Some(11.2));
    let told = (delayed.exit_code, delayed.reason.as_str());
    assert_eq!(told, (Exit::Passed, "every check passed; motion delayed by 11 ms"));
    let late = Run::with(|run| run.figures.motion.lag_ms = Some(20.5));
    assert_eq!((late.exit_code, late.reason.as_str()), (Exit::Failed, "failed: motion lag"));
    let missed = Run::with(|run| run.figures.motion.missed_in_a_row = 21);
    assert_eq!((missed.exit_code, missed.reason.as_str()), (Exit::Failed, "failed: commands missed"));
    let still = Run::with(|run| (run.figures.motion.way_mm, run.figures.motion.played) = (Some(0.0), None));
    assert_eq!(still.word, "UNTESTED", "{}", still.reason);
}

#[test]
fn a_damaged_recording_is_incomplete_whatever_its_figures_say() {
    let damages: [Change; 3] = [
        |run| run.lose(5),
        |run| run.figures.cut_short = true,
        |run| run.figures.damage.push(Damage { from: 7, to: 9, reason: String::new() }),
    ];
    for damage in damages {
        let mut run = Run::new();
        damage(&mut run);
        (run.figures.plant_skips.skipped, run.figures.tracking.actual.rms_mm) = (5, Some(1.0));
        assert_eq!(Verdict::new(&run.manifest, &run.figures).exit_code, Exit::Incomplete);
        run.figures.plant_skips.skipped = 0;
        run.disturb();
        assert_eq!(Verdict::new(&run.manifest, &run.figures).exit_code, Exit::Incomplete);
    }
}

#[test]
fn cycles_that_the_rig_missed_fail_a_run_and_those_that_the_machine_lost_do_not() {
    use Exit::{Failed as Fail, Passed as Pass};
    use TimingWord::{Disturbed, Held, Missed};
    let cases: [(Change, Exit, TimingWord, &str); 10] = [
        (|_| (), Pass, Held, "held"),
        (Run::disturb, Pass, Disturbed, "disturbed by the machine (3 of 2,003 cycles of both loops, 0.15 %)"),
        (
            |run| {
                run.disturb();
                run.figures.controller_skips.skipped = 4;
            },
            Fail,
            Missed,
            "missed by the controller (1)",
        ),
        (
            |run| {
                run.disturb();
                run.figures.plant_skips.skipped = 1;
            },
            Fail,
            Missed,
            "missed by the plant (1)",
        ),
        (
            |run| {
                run.disturb();
                (run.figures.plant_skips.skipped, run.figures.plant_skips.by_machine) = (2, 2);
            },
            Pass,
            Disturbed,
            "disturbed by the machine (5 of 2,005 cycles of both loops, 0.25 %)",
        ),
        (
            |run| {
                run.disturb();
                (run.figures.plant_skips.skipped, run.figures.plant_skips.unknown_cause) = (2, 2);
            },
            Pass,
            Disturbed,
            "disturbed by the machine (5 of 2,005 cycles of both loops, 0.25 %)",
        ),
        (
            |run| run.overruns(5, 0.02),
            Pass,
            Disturbed,
            "disturbed by the machine (2 of 2,002 cycles of both loops, 0.10 %)",
        ),
        (|run| run.overruns(5, 0.002), Fail, Missed, "missed by the plant (2)"),
        (
            |run| {
                run.manifest.scenario.checks.missed_cycles = 4;
                (run.figures.controller_skips.skipped, run.figures.plant_skips.skipped) = (1, 3);
            },
            Pass,
            Held,
            "held (4 cycles missed, as allowed)",
        ),
        (
            |run| {
                run.manifest.scenario.checks.missed_cycles = 3;
                (run.figures.controller_skips.skipped, run.figures.plant_skips.skipped) = (1, 3);
            },
            Fail,
            Missed,
            "missed by controller (1) and plant (3)",
        ),
    ];
    for (change, outcome, word, timing) in cases {
        let verdict = Run::with(change);
        let found = (verdict.exit_code, verdict.timing.word, verdict.timing.to_string());
        assert_eq!(found, (outcome, word, timing.to_owned()));
    }
}

#[test]
fn the_evidence_on_overlong_work_is_part_of_the_finding() {
    let verdict = Run::with(|run| run.overruns(5, 0.002));
    assert_eq!(
        verdict.checks[5].finding,
        "missed by the plant (2); 5 stretches of work too long, 1 stall of that length while waiting, work is 25.0 % of the \
         time: probability by chance 0.00, limit of the rig 0"
    );
}

#[test]
fn simulated_time_has_no_deadlines_to_keep() {
    let verdict = Run::with(|run| run.manifest.clock = "virtual".to_owned());
    assert_eq!((verdict.exit_code, verdict.timing.to_string().as_str()), (Exit::Passed, "simulated"));
    assert!(verdict.checks.iter().all(|check| check.name != "timing"));
}

#[test]
fn a_safe_stop_is_one_unless_the_machine_alone_explains_it() {
    let stop = |change: Change| {
        let mut run = Run::new();
        run.manifest.ending = Ending::SafeStop;
        run.disturb();
        run.figures.outage = Some(Outage { missed: 30, of: 100 });
        change(&mut run);
        let Verdict { exit_code: outcome, reason, .. } = Verdict::new(&run.manifest, &run.figures);
        (outcome, reason)
    };
    let (outcome, reason) = stop(|_| ());
    assert_eq!(outcome, Exit::Invalid);
    let said = "lost cycles may explain the safe stop: 30 of 100 just before it; 3 cycles lost; ";
    assert!(reason.starts_with(said), "{reason}");
    let stopped = (Exit::SafeStop, "the controller stopped the rig".to_owned());
    assert_eq!(stop(|run| run.figures.outage = None), stopped);
    assert_eq!(stop(|run| run.figures.outage = Some(Outage { missed: 9, of: 100 })), stopped);
    for (cause, missed, exit_code) in [
        (Cause::OrientationLost, 1, Exit::Invalid),
        (Cause::TrackingLost, 1, Exit::Invalid),
        (Cause::TrackingLost, 0, Exit::SafeStop),
        (Cause::StrokeLimit, 1, Exit::SafeStop),
    ] {
        let mut run = Run::new();
        run.manifest.ending = Ending::SafeStop;
        run.disturb();
        run.figures.outage = Some(Outage { missed, of: 100 });
        run.figures.events.push(stop_by(Source::Controller, cause));
        let found = Verdict::new(&run.manifest, &run.figures);
        assert_eq!(found.exit_code, exit_code, "{cause:?} after {missed} missed: {}", found.reason);
    }
    assert_eq!(stop(|run| run.figures.controller_skips.by_machine = 2), stopped, "one was the rig's");
    let (outcome, _) = stop(|run| {
        (run.figures.controller_skips.by_machine, run.figures.controller_skips.while_working) = (2, 1);
        run.refuse();
    });
    assert_eq!(outcome, Exit::Invalid, "the rig never had real time");
}

/// One lost cycle explains a stop off the path alone: not a report beside a later stop, nor one of somebody else.
#[test]
fn a_report_of_a_deviation_that_stops_nothing_excuses_no_later_stop() {
    let reported = Event::new(Source::Controller, EventKind::Fault, Cause::TrackingLost);
    for event in [(&reported).into(), stop_by(Source::Master, Cause::TrackingLost)] {
        let mut run = Run::new();
        run.manifest.ending = Ending::SafeStop;
        run.disturb();
        run.figures.outage = Some(Outage { missed: 1, of: 100 });
        run.figures.events.push(event);
        assert_eq!(Verdict::new(&run.manifest, &run.figures).exit_code, Exit::SafeStop);
    }
}

fn stop_by(source: Source, cause: Cause) -> crate::EventRecord {
    let [from, to] = [ControllerState::Running, ControllerState::SafeStop].map(ControllerState::code);
    (&Event { from, to, ..Event::new(source, EventKind::Fault, cause) }).into()
}

/// An average beyond its limit may be what the stop came for.
#[test]
fn a_safe_stop_that_comes_too_late_fails_the_run() {
    fn leave(run: &mut Run) {
        run.figures.tracking.actual.max_mm = Some(8.0);
        run.figures.path_breach.first = Some(crate::Breach::new("platform from its path", "8 mm", "0.5 mm"));
    }
    let cases: [(Change, Exit, &str); 4] = [
        (leave, Exit::Failed, "failed: sequence, tracking"),
        (
            |run| {
                // While easing.
                run.figures.tracking.actual.samples = 0;
                leave(run);
            },
            Exit::Failed,
            "failed: sequence, tracking",
        ),
        (
            |run| run.figures.tracking.actual.rms_mm = Some(0.2),
            Exit::SafeStop,
            "the controller stopped the rig",
        ),
        (
            |run| run.figures.tracking.estimated.max_mm = Some(8.0),
            Exit::SafeStop,
            "the controller stopped the rig",
        ),
    ];
    for (change, outcome, reason) in cases {
        let mut run = Run::new();
        run.manifest.ending = Ending::SafeStop;
        run.figures.final_state = Some(Code::Known(ControllerState::SafeStop));
        change(&mut run);
        let verdict = Verdict::new(&run.manifest, &run.figures);
        assert_eq!((verdict.exit_code, verdict.reason.as_str()), (outcome, reason));
    }
}

#[test]
fn a_verdict_is_written_with_its_word_and_exit_code() {
    let verdict = Run::with(|run| run.figures.tracking.actual.rms_mm = Some(0.2));
    let written = serde_json::to_value(&verdict).unwrap();
    assert_eq!((&written["word"], &written["exit_code"]), (&"FAIL".into(), &1.into()));
    assert_eq!(written["reason"], "failed: tracking");
    assert_eq!(written["checks"].as_array().map(Vec::len), Some(9));
}

#[test]
fn a_failed_run_names_the_first_breach_that_it_does_not_expect() {
    let mut run = Run::new();
    run.figures.path_breach.motion_ns = Some([0, 10_000_000_000]);
    run.figures.tracking.actual.rms_mm = Some(0.2);
    run.figures.motion.lag_ms = Some(30.0);
    let first =
        |run: &Run| Verdict::new(&run.manifest, &run.figures).first_breach.map(|first| first.to_string());
    let tracking = "tracking: platform rms 0.2000 mm, limit 0.1 mm, from 0.000 s to 10.000 s of the motion";
    assert_eq!(first(&run).as_deref(), Some(tracking));
    let failed = vec!["tracking".to_owned()];
    run.manifest.scenario.expect = Some(masseter_scenario::ExpectConfig {
        verdict: Some(Fail),
        failed,
        ..masseter_scenario::ExpectConfig::default()
    });
    assert_eq!(first(&run).as_deref(), Some("motion lag: delay 30.0 ms, limit 20 ms"));
    assert_eq!(first(&Run::new()), None);
}
