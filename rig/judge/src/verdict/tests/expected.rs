//! Runs that expect an outcome other than a pass.

use masseter_scenario::{ExpectConfig, ExpectedVerdict};

use super::*;
use crate::check::CheckFigures;
use crate::requirements::RequirementFigures;

/// A run that stops safely, as its scenario expects.
fn stopped() -> Run {
    let mut run = Run::new();
    run.manifest.ending = Ending::SafeStop;
    run.figures.final_state = Some(Code::Known(ControllerState::SafeStop));
    expect(&mut run, ExpectedVerdict::SafeStop);
    run
}

fn expect(run: &mut Run, verdict: ExpectedVerdict) {
    run.manifest.scenario.expect = Some(ExpectConfig { verdict: Some(verdict), ..ExpectConfig::default() });
}

fn require(run: &mut Run, result: CheckResult, may_be_disturbed: bool) {
    run.figures.requirements.push(RequirementFigures {
        name: "stops".to_owned(),
        id: None,
        must: "after it: safe_stop".to_owned(),
        result,
        finding: "found".to_owned(),
        figures: CheckFigures::default(),
        worst_ns: None,
        breach: None,
        may_be_disturbed,
        is_expected_event: false,
        is_truth: true,
        plot: None,
    });
}

fn judge(run: &Run) -> (&'static str, String) {
    let verdict = Verdict::new(&run.manifest, &run.figures);
    (verdict.word, verdict.reason)
}

#[test]
fn the_expected_outcome_passes_and_any_other_fails() {
    let (word, reason) = judge(&stopped());
    assert_eq!((word, reason.as_str()), ("PASS", "SAFE STOP, as expected: the controller stopped the rig"));

    let mut played = Run::new();
    expect(&mut played, ExpectedVerdict::SafeStop);
    assert_eq!(
        judge(&played),
        ("FAIL", "expected SAFE STOP, but PASS: every check of the rig passed".to_owned())
    );

    let mut died = died();
    assert_eq!(judge(&died).0, "PASS");
    expect(&mut died, ExpectedVerdict::SafeStop);
    assert_eq!(judge(&died).0, "FAIL");
}

fn died() -> Run {
    let mut died = Run::new();
    died.manifest.ending = Ending::died("plant", "signal 9".to_owned());
    expect(&mut died, ExpectedVerdict::Died);
    died
}

/// An axis moves after the stop.
fn fall(run: &mut Run) {
    run.figures.standstill.recorded_s = Some(0.5);
    run.figures.standstill.axes_mm[3] = 20.0;
}

#[test]
fn an_expected_death_or_lost_recording_excuses_what_is_not_recorded_and_no_other_check() {
    let unwritten = || {
        let mut run = Run::new();
        run.manifest.ending = Ending::RecordingFailed;
        expect(&mut run, ExpectedVerdict::Incomplete);
        run
    };
    let cases: [(Change, &str); 4] = [
        (|_| (), "PASS"),
        (|run| run.lose(5), "PASS"),
        (|run| run.figures.tracking.actual.max_mm = Some(0.6), "FAIL"),
        (fall, "FAIL"),
    ];
    for (number, (change, word)) in cases.into_iter().enumerate() {
        for mut run in [died(), unwritten()] {
            change(&mut run);
            assert_eq!(judge(&run).0, word, "case {number}: {}", judge(&run).1);
        }
    }
    // The desired pose stands still in a gap of an expected loss.
    for (mut run, word) in [(died(), "FAIL"), (unwritten(), "PASS")] {
        run.lose(5);
        run.figures.tracking.actual.max_mm = Some(19.0);
        assert_eq!(judge(&run).0, word, "{}", judge(&run).1);
    }
}

#[test]
fn requirements_and_the_rigs_own_checks_count_beside_the_expected_outcome() {
    type Case = (fn(&mut Run), &'static str);
    let cases: [Case; 7] = [
        (|run| require(run, CheckResult::Passed, true), "PASS"),
        (|run| require(run, CheckResult::Failed, true), "FAIL"),
        (|run| require(run, CheckResult::Untested, true), "UNTESTED"),
        (Run::declare_fault, "UNTESTED"),
        (|run| run.lose(5), "INCOMPLETE"),
        (|run| run.figures.plant_skips.skipped = 1, "FAIL"),
        (|run| run.figures.tracking.actual.max_mm = Some(0.6), "FAIL"),
    ];
    for (number, (change, word)) in cases.into_iter().enumerate() {
        let mut run = stopped();
        change(&mut run);
        assert_eq!(judge(&run).0, word, "case {number}: {}", judge(&run).1);
    }
}

#[test]
fn a_requirement_that_lost_cycles_may_have_failed_is_excused() {
    for (may_be_disturbed, word) in [(true, "INVALID"), (false, "FAIL")] {
        let mut run = Run::new();
        run.disturb();
        require(&mut run, CheckResult::Failed, may_be_disturbed);
        assert_eq!(judge(&run).0, word, "{}", judge(&run).1);
    }
}

#[test]
fn a_failure_may_be_expected_of_a_requirement_but_not_of_an_expected_event() {
    for (result, expected, word) in [
        (CheckResult::Failed, ExpectedVerdict::Fail, "PASS"),
        (CheckResult::Untested, ExpectedVerdict::Untested, "PASS"),
        (CheckResult::Failed, ExpectedVerdict::Untested, "FAIL"),
        (CheckResult::Passed, ExpectedVerdict::Fail, "FAIL"),
        (CheckResult::Failed, ExpectedVerdict::Pass, "FAIL"),
    ] {
        let mut run = Run::new();
        expect(&mut run, expected);
        require(&mut run, result, true);
        assert_eq!(judge(&run).0, word, "{expected:?}, {result:?}: {}", judge(&run).1);
    }
    let mut run = Run::new();
    expect(&mut run, ExpectedVerdict::Fail);
    require(&mut run, CheckResult::Failed, true);
    assert_eq!(judge(&run).1, "FAIL, as expected: failed: stops");
    require(&mut run, CheckResult::Failed, true);
    let event = run.figures.requirements.last_mut().unwrap();
    (event.name, event.is_expected_event) = ("expected event it".to_owned(), true);
    assert_eq!(judge(&run), ("FAIL", "failed: expected event it".to_owned()));
}

#[test]
fn an_exit_code_is_expected_as_its_outcome_is() {
    let code = |exit_code| Some(ExpectConfig { exit_code: Some(exit_code), ..ExpectConfig::default() });
    let mut run = stopped();
    run.manifest.scenario.expect = code(5);
    assert_eq!(judge(&run).0, "PASS");
    run.manifest.scenario.expect = code(1);
    let (word, reason) = judge(&run);
    assert!(word == "FAIL" && reason.starts_with("expected FAIL or UNTESTED, but SAFE STOP: "), "{reason}");
    let mut failed = Run::new();
    failed.manifest.scenario.expect = code(1);
    require(&mut failed, CheckResult::Failed, true);
    assert_eq!(judge(&failed).0, "PASS");
}

#[test]
fn an_expected_failure_that_is_named_must_fail_and_no_other_may() {
    let judged = |failed: &[&str], change: Change| {
        let mut run = Run::new();
        run.figures.tracking.actual.rms_mm = Some(0.2);
        let failed = failed.iter().map(|name| (*name).to_owned()).collect();
        let verdict = Some(ExpectedVerdict::Fail);
        run.manifest.scenario.expect = Some(ExpectConfig { verdict, failed, ..ExpectConfig::default() });
        change(&mut run);
        let Verdict { word, reason, .. } = Verdict::new(&run.manifest, &run.figures);
        (word, reason)
    };
    assert_eq!(judged(&["tracking"], |_| ()).0, "PASS");
    assert_eq!(judged(&[], |run| run.figures.motion.missed_in_a_row = 99).0, "PASS", "no failure is named");
    let why = |reason: &str| ("FAIL", reason.to_owned());
    assert_eq!(
        judged(&["tracking"], |run| run.figures.motion.missed_in_a_row = 99),
        why("expected that tracking fails and nothing else, but commands missed failed")
    );
    let untested = |run: &mut Run| require(run, CheckResult::Untested, false);
    assert_eq!(
        judged(&["tracking"], untested),
        why("expected that tracking fails and nothing else, but stops is untested")
    );
    let same_name = |run: &mut Run| {
        require(run, CheckResult::Failed, false);
        run.figures.requirements[0].name = "tracking".to_owned();
    };
    assert_eq!(
        judged(&["tracking"], same_name),
        why(
            "expected that tracking fails and nothing else, but two checks have the name tracking: rename the requirement"
        )
    );
    assert_eq!(
        judged(&["opens"], |_| ()),
        why("expected that opens fails and nothing else, but tracking failed, opens did not")
    );
}

#[test]
fn a_fault_that_never_acted_is_untested_whatever_is_expected() {
    use ExpectedVerdict::{Fail, Untested};
    let idle = |verdict, failed: &[&str], change: Change| {
        let mut run = Run::new();
        run.declare_fault();
        let failed = failed.iter().map(|name| (*name).to_owned()).collect();
        run.manifest.scenario.expect =
            Some(ExpectConfig { verdict: Some(verdict), failed, ..ExpectConfig::default() });
        change(&mut run);
        let verdict = Verdict::new(&run.manifest, &run.figures);
        assert!(verdict.has_idle_entry());
        (verdict.word, verdict.reason)
    };
    let never = "1 of 2 declared faults acted, number 1 never: raise its probability";
    let with_another = |run: &mut Run| {
        run.declare_fault();
        let other = &mut run.figures.faults[1];
        (other.number, other.struck_ns) = (2, Some(1));
        (other.deviation_mm, other.led_off_path) = (9.0, true);
    };
    assert_eq!(idle(Untested, &[], |_| ()).0, "UNTESTED");
    assert_eq!(idle(Untested, &[], |run| require(run, CheckResult::Untested, true)).0, "UNTESTED");
    let (word, reason) = idle(Fail, &["faults"], with_another);
    assert_eq!(word, "UNTESTED");
    assert!(reason.starts_with(&format!("faults: {never}")), "{reason}");
}
