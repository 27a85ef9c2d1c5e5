//! Runs that the machine disturbed: the judged checks, the excused checks, and the reason in words.

use masseter_scenario::TimingConfig;

use super::*;

/// A run that the machine disturbed, with one more change.
fn disturbed(change: Change) -> Verdict {
    let mut run = Run::new();
    run.disturb();
    change(&mut run);
    Verdict::new(&run.manifest, &run.figures)
}

/// A failure where no lost cycle acted on the jaw is the rig's; any other may be the machine's.
#[test]
fn a_failure_is_excused_only_if_the_undisturbed_rest_passes() {
    let cases: [(Change, Exit, &str); 7] = [
        (|_| (), Exit::Passed, "every check passed"),
        (
            |run| run.figures.tracking.actual.rms_mm = Some(3.0),
            Exit::Invalid,
            "lost cycles may explain: tracking; 3 cycles lost; ",
        ),
        (
            |run| {
                run.figures.tracking.estimated.max_deg = Some(3.0);
                run.figures.tracking.undisturbed.actual.samples = 9;
            },
            Exit::Invalid,
            "lost cycles may explain: estimated tracking; ",
        ),
        (
            |run| {
                run.figures.tracking.actual.rms_mm = Some(3.0);
                run.figures.tracking.undisturbed.actual.rms_mm = Some(2.0);
            },
            Exit::Failed,
            "failed: tracking",
        ),
        (
            |run| {
                run.figures.tracking.actual.rms_mm = Some(3.0);
                run.figures.tracking.estimated.max_deg = Some(3.0);
                run.figures.tracking.undisturbed.estimated.max_deg = Some(3.0);
            },
            Exit::Failed,
            "failed: estimated tracking",
        ),
        (|run| run.figures.final_state = None, Exit::Failed, "failed: sequence"),
        (Run::declare_fault, Exit::Failed, "faults: 0 of 1 declared faults acted"),
    ];
    for (change, outcome, reason) in cases {
        let verdict = disturbed(change);
        assert_eq!(verdict.exit_code, outcome);
        assert!(verdict.reason.starts_with(reason), "{}", verdict.reason);
    }
}

#[test]
fn what_the_scenario_stalls_excuses_nothing_and_is_no_miss() {
    let mut run = Run::new();
    run.figures.plant_skips = SkipFigures { skipped: 50, by_scenario: 50, ..SkipFigures::default() };
    let verdict = Verdict::new(&run.manifest, &run.figures);
    assert_eq!(verdict.exit_code, Exit::Passed);
    assert_eq!(verdict.timing.to_string(), "stalled by faults of the scenario (50 cycles)");
    run.figures.tracking.actual.rms_mm = Some(3.0);
    assert_eq!(Verdict::new(&run.manifest, &run.figures).exit_code, Exit::Failed);
    run.disturb();
    let verdict = Verdict::new(&run.manifest, &run.figures);
    assert_eq!(verdict.exit_code, Exit::Invalid);
    let said = verdict.timing.to_string();
    assert!(
        said.starts_with("disturbed by the machine (3 of ") && said.ends_with("stalled 50 more"),
        "{said}"
    );
}

#[test]
fn too_many_lost_cycles_leave_nothing_to_judge() {
    let lose = |lost: u64| {
        let mut run = Run::new();
        run.figures.cycles = 500 - lost / 2;
        (run.figures.controller_skips.skipped, run.figures.controller_skips.by_machine) = (lost, lost);
        run.figures.tracking.undisturbed.actual.rms_mm = Some(3.0);
        run.figures.tracking.actual.rms_mm = Some(3.0);
        Verdict::new(&run.manifest, &run.figures)
    };
    assert_eq!(lose(50).exit_code, Exit::Failed);
    let verdict = lose(52);
    assert_eq!(verdict.exit_code, Exit::Invalid);
    assert!(
        verdict.reason.starts_with("the machine lost 5.2 % of the cycles, limit 5 %; "),
        "{}",
        verdict.reason
    );
}

#[test]
fn strict_timing_allows_no_lost_cycle() {
    let strict = |change: Change| {
        let mut run = Run::new();
        run.manifest.scenario.checks.timing = TimingConfig::Strict;
        change(&mut run);
        Verdict::new(&run.manifest, &run.figures)
    };
    assert_eq!(strict(|_| ()).exit_code, Exit::Passed);
    let verdict = strict(Run::disturb);
    assert_eq!(verdict.exit_code, Exit::Invalid);
    assert!(
        verdict.reason.starts_with("checks.timing = \"strict\" allows no lost cycle; "),
        "{}",
        verdict.reason
    );
    let missed = strict(|run| {
        run.disturb();
        run.figures.plant_skips.skipped = 1;
    });
    assert_eq!(missed.exit_code, Exit::Failed, "the rig missed one by itself");
}

#[test]
fn an_invalid_run_says_what_the_machine_lost_and_what_helps() {
    let reason = |change: Change| {
        let mut run = Run::new();
        run.disturb();
        run.manifest.scenario.checks.timing = TimingConfig::Strict;
        run.figures.plant_skips.stalled_ns = 1_250_000;
        change(&mut run);
        let reason = Verdict::new(&run.manifest, &run.figures).reason;
        reason.split_once("; ").map(|(_, account)| account.to_owned()).unwrap()
    };
    assert_eq!(reason(|_| ()), "3 cycles lost; the machine stalled for 4.8 ms while the rig waited");
    let said = reason(|run| {
        run.overruns(1, 0.5);
        run.figures.controller_skips.while_working = 5;
        run.figures.controller_skips.skipped = 8;
        run.figures.plant_skips.stalled_ns = 1_250_000;
    });
    let stalled = "7 of them during work; the machine stalled for 4.8 ms while the rig waited";
    assert_eq!(said, format!("10 cycles lost, {stalled}"));
    let said = reason(|run| {
        run.refuse();
        (run.figures.controller_skips.skipped, run.figures.controller_skips.while_working) = (9, 6);
    });
    assert_eq!(said, "9 cycles lost without real time; controller: no priority");
}

#[test]
fn an_invalid_run_names_the_best_remedy_alone() {
    let next = |change: Change| {
        let mut run = Run::new();
        run.disturb();
        run.manifest.scenario.checks.timing = TimingConfig::Strict;
        change(&mut run);
        let verdict = Verdict::new(&run.manifest, &run.figures);
        assert_eq!((verdict.exit_code, verdict.advice()), (Exit::Invalid, None));
        assert!(!verdict.reason.contains("masseter doctor"), "{}", verdict.reason);
        verdict.next_step.unwrap()
    };
    assert!(next(|_| ()).starts_with("Run `masseter doctor` and remove what it lists, "));
    let mend = next(|run| run.manifest.mending_command = Some("echo full".to_owned()));
    assert!(mend.starts_with("Run `echo full`, then repeat the run: ") && !mend.contains("doctor"), "{mend}");
    assert!(next(Run::refuse).contains("missing permission"));
}

#[test]
fn a_passed_run_that_was_disturbed_says_what_to_do() {
    let verdict = disturbed(|_| ());
    assert_eq!((verdict.word, verdict.timing.word), ("PASS", TimingWord::Disturbed));
    assert!(verdict.advice().is_some_and(|advice| advice.contains("masseter doctor")));
    assert_eq!(Run::with(|_| ()).advice(), None);
}

#[test]
fn checks_that_the_machine_may_explain_are_marked() {
    let verdict = disturbed(|run| run.figures.tracking.actual.rms_mm = Some(3.0));
    assert_eq!(verdict.exit_code, Exit::Invalid);
    let expected = [
        ("sequence", "ok"),
        ("tracking", "lost"),
        ("estimated tracking", "ok"),
        ("motion lag", "ok"),
        ("commands missed", "ok"),
        ("timing", "skip"),
        ("commands late", "ok"),
        ("dropped messages", "ok"),
        ("bus response", "ok"),
    ];
    assert_eq!(results(&verdict), expected);
}

#[test]
fn without_real_time_only_lost_cycles_are_excused() {
    assert_eq!(Run::with(Run::refuse).exit_code, Exit::Passed);
    let refused_and_off = Run::with(|run| {
        run.refuse();
        run.figures.tracking.actual.rms_mm = Some(0.2);
    });
    assert_eq!(refused_and_off.reason, "failed: tracking");
    let unexplained = Run::with(|run| {
        run.refuse();
        run.figures.plant_skips.skipped = 1;
    });
    assert_eq!(unexplained.reason, "failed: timing", "neither a stall nor overlong work came before");
}

#[test]
fn a_jump_of_the_clock_excuses_failures_and_nothing_else() {
    let jumped = |change: Change| {
        let mut run = Run::new();
        run.manifest.usage.clock_jump_s = 2.0;
        run.manifest.scenario.can.interfaces = vec!["can0".to_owned()];
        change(&mut run);
        Verdict::new(&run.manifest, &run.figures).exit_code
    };
    assert_eq!(jumped(|_| ()), Exit::Passed);
    assert_eq!(jumped(|run| run.figures.tracking.actual.rms_mm = Some(0.2)), Exit::Invalid);
    assert_eq!(jumped(|run| run.manifest.ending = Ending::SafeStop), Exit::SafeStop);
}

#[test]
fn a_busy_core_is_a_remark_on_a_run_that_does_not_pass() {
    let busy = |share: f64, rms_mm: f64| {
        let mut run = Run::new();
        let usage = Usage { observed_s: 2.0, cpu_s: 2.0 * share, ..Usage::default() };
        run.manifest.usage.processes.insert("controller".to_owned(), usage);
        run.figures.tracking.actual.rms_mm = Some(rms_mm);
        Verdict::new(&run.manifest, &run.figures).reason
    };
    assert_eq!(busy(1.0, 0.05), "every check passed");
    assert_eq!(busy(0.9, 0.2), "failed: tracking");
    let said = busy(0.92, 0.2);
    assert!(said.starts_with("failed: tracking; the controller kept its core busy for 92 %"), "{said}");
}

/// One stretch of work is enough where the counters show whose fault it was.
#[test]
fn a_stretch_of_work_with_a_certain_cause_is_no_matter_of_chance() {
    use OverrunCause::{Computed, Machine, Slept, Unknown};
    let verdict = |cause, is_stopped| {
        let mut run = Run::new();
        run.overrun(cause);
        // Ten times as many cycles, so that the machine may lose these.
        run.figures.cycles = 10_000;
        if is_stopped {
            run.manifest.ending = Ending::SafeStop;
            run.figures.outage = Some(Outage { missed: 99, of: 100 });
        }
        Verdict::new(&run.manifest, &run.figures)
    };
    for (cause, exit, stopped) in [
        (Slept, Exit::Failed, Exit::SafeStop),
        (Computed, Exit::Failed, Exit::SafeStop),
        (Machine, Exit::Passed, Exit::Invalid),
        (Unknown, Exit::Passed, Exit::Invalid),
    ] {
        let found = [false, true].map(|is_stopped| verdict(cause, is_stopped).exit_code);
        assert_eq!(found, [exit, stopped], "{cause:?}");
    }
    let culprit = "the controller slept or waited for 100.0 ms in cycle 700 (of 120.0 ms: CPU time 6.0 ms, ";
    let failed = verdict(Slept, false);
    assert!(failed.reason.starts_with(&format!("failed: timing; {culprit}")), "{}", failed.reason);
    assert_eq!(failed.timing.to_string(), "missed by the controller (99)");
    assert!(verdict(Slept, true).reason.contains(culprit));
    let uncertain = verdict(Unknown, true).reason;
    assert!(
        uncertain.contains("whose fault is not certain: the controller worked, slept or had no core"),
        "{uncertain}"
    );
    let without_real_time = |cause| {
        let mut run = Run::new();
        run.refuse();
        run.overrun(cause);
        run.figures.cycles = 10_000;
        Verdict::new(&run.manifest, &run.figures).exit_code
    };
    assert_eq!(without_real_time(Slept), Exit::Failed, "a sleep needs no priority");
    assert_eq!(without_real_time(Unknown), Exit::Passed);
}

#[test]
fn late_commands_are_told_and_judged_by_the_tracking() {
    let late = |commands: u64| {
        let mut run = Run::new();
        run.figures.motion.late_commands = commands;
        Verdict::new(&run.manifest, &run.figures)
    };
    let found = |verdict: &Verdict| {
        let check = verdict.checks.iter().find(|check| check.name == "commands late").unwrap();
        (check.result, check.finding.clone())
    };
    assert_eq!(found(&late(20)), (CheckResult::Passed, "20 commands".to_owned()));
    assert_eq!(late(20).reason, "every check passed");
    let always = late(9999);
    assert_eq!(found(&always).0, CheckResult::NotJudged);
    assert!(found(&always).1.starts_with("9999 commands used a cycle late: "), "{:?}", found(&always));
    assert_eq!(always.reason, "every check passed; 9999 commands used a cycle late");
}

#[test]
fn lost_cycles_may_explain_a_stop_by_the_master_and_a_controller_without_its_time() {
    let verdict = |ending, stopped_by, overdue_s| {
        let mut run = Run::new();
        run.disturb();
        run.manifest.scenario.controller.overdue_s = overdue_s;
        (run.manifest.ending, run.figures.stopped_by) = (ending, stopped_by);
        (run.figures.outage, run.figures.has_begun) = (Some(Outage { missed: 99, of: 100 }), true);
        Verdict::new(&run.manifest, &run.figures)
    };
    let (lost_s, master) = (3.0 * Scenario::default().period_s(), Some(StoppedBy::Master));
    let stop = "lost cycles may explain the safe stop: 99 of 100 just before it; ";
    let late = "lost cycles may explain the late controller: ";
    let overdue = "failed: sequence; the controller did not end within ";
    for (ending, stopped_by, overdue_s, exit, reason) in [
        (Ending::Completed, master, 10.0, Exit::Invalid, stop),
        (Ending::Overdue, master, 10.0, Exit::Invalid, stop),
        (Ending::Overdue, Some(StoppedBy::QuickStop), 10.0, Exit::Failed, overdue),
        (Ending::Overdue, Some(StoppedBy::QuickStop), lost_s, Exit::Invalid, late),
    ] {
        let found = verdict(ending.clone(), stopped_by, overdue_s);
        assert_eq!(found.exit_code, exit, "{ending:?}, {stopped_by:?}: {}", found.reason);
        assert!(found.reason.starts_with(reason), "{ending:?}, {stopped_by:?}: {}", found.reason);
    }
}
