//! Runs that tested too little.

use masseter_runtime::named::Declared;

use super::*;

#[test]
fn what_was_not_tested_is_neither_passed_nor_failed() {
    let untested: [Change; 3] = [
        Run::declare_fault,
        |run| run.figures.tracking.actual.rms_mm = None,
        |run| run.figures.tracking.actual.samples = 9,
    ];
    for change in untested {
        let mut run = Run::new();
        change(&mut run);
        let verdict = Verdict::new(&run.manifest, &run.figures);
        assert_eq!((verdict.word, verdict.exit_code), ("UNTESTED", Exit::Failed));
        let written = serde_json::to_value(&verdict).unwrap();
        assert!(written["checks"].as_array().unwrap().iter().any(|check| check["result"] == "untested"));
    }
}

#[test]
fn every_other_outcome_than_a_pass_goes_before_untested() {
    let cases: [(Change, &str); 6] = [
        (|run| run.figures.plant_skips.skipped = 1, "FAIL"),
        (|run| run.manifest.ending = Ending::SafeStop, "SAFE STOP"),
        (|run| run.manifest.ending = Ending::died("plant", "signal 9".to_owned()), "DIED"),
        (|run| run.manifest.ending = Ending::Interrupted, "INTERRUPTED"),
        (|run| run.lose(5), "INCOMPLETE"),
        (
            |run| {
                run.disturb();
                run.manifest.scenario.checks.machine_lost_percent = 0.0;
            },
            "INVALID",
        ),
    ];
    for (change, word) in cases {
        let mut run = Run::new();
        run.declare_fault();
        change(&mut run);
        assert_eq!(Verdict::new(&run.manifest, &run.figures).word, word);
    }
}

#[test]
fn a_run_without_a_cycle_claims_nothing() {
    let endings = [
        (Ending::NotStarted, "INVALID", "real time was required and refused"),
        (Ending::died("plant", "signal 9".to_owned()), "DIED", "the plant died: signal 9, before the motion"),
        (Ending::Completed, "UNTESTED", "no cycle ran"),
    ];
    for (ending, word, reason) in endings {
        let mut run = Run::new();
        run.figures = Analysis::new(&run.manifest.scenario, &Declared::default()).finish(false, &[]);
        run.figures.plant_skips = SkipFigures { skipped: 1, by_machine: 1, ..SkipFigures::default() };
        run.manifest.ending = ending;
        let verdict = Verdict::new(&run.manifest, &run.figures);
        assert_eq!((verdict.word, verdict.reason.as_str()), (word, reason));
        assert_eq!((verdict.timing.word, verdict.checks.len()), (TimingWord::Unknown, 0));
    }
}
