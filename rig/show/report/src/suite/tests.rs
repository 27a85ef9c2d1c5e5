use masseter_judge::{Analysis, CheckFigures, CheckResult};
use masseter_recording::{MachineInfo, Manifest};
use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;
use serde_json::Value;

use super::*;
use crate::{html_of_suite, junit_of_suite};

/// What the suite has of a scenario that could be played: a verdict with this word, exit code and digest, and with a requirement of this margin.
#[expect(clippy::unnecessary_wraps, reason = "the suite's results are of this type")]
fn judged(word: &'static str, exit_code: Exit, digest: &str, margin: f64) -> Result<Verdict, String> {
    let text = "[[require]]\nname = 'force'\nid = 'REQ-12'\nsignal = 'l1.force'\nmax = '3 N'";
    let scenario = Scenario::parse("s.toml".as_ref(), text).unwrap();
    let machine = MachineInfo { cpu: String::new(), cores: 2, kernel: String::new(), is_virtual: false };
    let manifest = Manifest::new("0.1.0", scenario, 10.0, "virtual", machine);
    let mut figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
    // Without a cycle there are no checks.
    figures.cycles = 1;
    let mut verdict = Verdict::new(&manifest, &figures);
    verdict.checks.retain(Check::is_requirement);
    let found = &mut verdict.checks[0];
    found.result = CheckResult::Passed;
    let figures = found.figures.take().unwrap();
    found.figures =
        Some(CheckFigures { margin: Some(margin), relative_margin: Some(margin / 3.0), ..figures });
    (verdict.word, verdict.exit_code, verdict.reason) = (word, exit_code, format!("it is {word}"));
    digest.clone_into(&mut verdict.digest);
    Ok(verdict)
}

fn passed(margin: f64) -> Result<Verdict, String> {
    judged("PASS", Exit::Passed, "a", margin)
}

fn tested(name: &str, verdicts: Vec<Result<Verdict, String>>) -> TestedScenario {
    TestedScenario {
        name: name.to_owned(),
        file: format!("suite/{name}.toml").into(),
        tags: vec!["slow".to_owned()],
        attempts: verdicts.into_iter().map(|verdict| Attempt { verdict, folder: None }).collect(),
        is_simulated: true,
        allows_untested: false,
        command: format!("masseter run suite/{name}.toml"),
        took_s: 0.5,
    }
}

fn report(tested: Vec<TestedScenario>, baseline: Option<Baseline>) -> SuiteReport {
    let (unrun, left_out) = (vec!["last".to_owned()], vec!["b.TOML".to_owned()]);
    SuiteReport { masseter: "0.1.0", tested, unrun, filtered_out: 0, left_out, took_s: 1.0, baseline }
}

#[test]
fn warnings_of_the_plan_are_in_every_form_also_where_results_differ() {
    let warned = |digest| {
        let mut verdict = judged("PASS", Exit::Passed, digest, 1.0).unwrap();
        verdict.warnings = ["the first row is away", "a row jumps"].map(str::to_owned).into();
        Ok(verdict)
    };
    for attempts in [vec![warned("a")], vec![warned("a"), warned("b")]] {
        let report = report(vec![tested("one", attempts)], None);
        let xml = junit_of_suite(&report).unwrap();
        let property = "<property name=\"warnings\" value=\"the first row is away; a row jumps\"/>";
        assert!(xml.contains(property), "{xml}");
        let json: Value = serde_json::from_str(&report.to_json().unwrap()).unwrap();
        assert_eq!(json["scenarios"][0]["warnings"][1], "a row jumps");
        let html = html_of_suite(&report, "suite.html".as_ref()).unwrap();
        assert!(html.contains("warning in one: a row jumps"), "{html}");
    }
    let silent = junit_of_suite(&report(vec![tested("one", vec![passed(1.0)])], None)).unwrap();
    assert!(!silent.contains("warnings"), "{silent}");
}

#[test]
fn the_document_of_a_suite_says_what_to_do_next() {
    let mut failed = judged("FAIL", Exit::Failed, "a", -1.0).unwrap();
    failed.next_step = Some("Look there.".to_owned());
    let xml = junit_of_suite(&report(vec![tested("one", vec![Ok(failed)])], None)).unwrap();
    assert!(xml.contains("<property name=\"next step\" value=\"Look there.\"/>"), "{xml}");
}

#[test]
fn a_result_that_changes_in_simulated_time_is_a_failure_of_its_own() {
    let failed = || judged("FAIL", Exit::Failed, "a", -1.0);
    for (attempts, differs) in [
        (vec![failed(), failed()], false),
        (vec![failed(), passed(1.0)], true),
        (vec![failed(), judged("FAIL", Exit::Failed, "b", -1.0)], true),
        (vec![Err("refused".to_owned()), Err("refused".to_owned())], false),
        (vec![Err("refused".to_owned()), passed(1.0)], true),
    ] {
        let found = tested("one", attempts);
        assert_eq!((found.differs(), found.outcome(), found.is_short()), (differs, Outcome::Failed, true));
        let says = "runs of the same scenario and seed differ in simulated time: ";
        assert_eq!(found.reason().starts_with(says), differs, "{}", found.reason());
        let xml = junit_of_suite(&report(vec![found], None)).unwrap();
        assert_eq!(
            (xml.contains("type=\"DIFFERS\""), xml.contains("<rerunError ")),
            (differs, true),
            "{xml}"
        );
    }
    let spoiled = vec![judged("INVALID", Exit::Invalid, "a", 0.0), passed(1.0)];
    let in_real_time = TestedScenario { is_simulated: false, ..tested("one", spoiled) };
    assert_eq!((in_real_time.outcome(), in_real_time.is_short()), (Outcome::Passed, false));
    let xml = junit_of_suite(&report(vec![in_real_time], None)).unwrap();
    assert!(xml.contains("<property name=\"flaky\" value=\"true\"/>"), "{xml}");
    assert!(xml.contains("<flakyError message=\"it is INVALID\" type=\"INVALID\"/>"), "{xml}");
    assert!(xml.contains("name=\"run\" time=\"0.500\" file=\"suite/one.toml\""), "{xml}");
    assert!(xml.contains("<property name=\"requirement\" value=\"REQ-12\"/>"), "{xml}");
}

#[test]
fn a_suite_is_invalid_if_the_machine_spoiled_all_that_did_not_pass() {
    let verdicts =
        [passed(1.0), judged("INVALID", Exit::Invalid, "a", 0.0), judged("FAIL", Exit::Failed, "a", -1.0)];
    let [passed, spoiled, failed] =
        verdicts.map(|verdict| TestedScenario { is_simulated: false, ..tested("one", vec![verdict]) });
    for (tested, exit, word) in [
        (vec![passed.clone()], Exit::Passed, "INTERRUPTED"),
        (vec![passed, spoiled.clone(), spoiled.clone()], Exit::Invalid, "INVALID"),
        (vec![failed, spoiled], Exit::Failed, "FAILED"),
    ] {
        let report = report(tested, None);
        assert_eq!((report.exit(), report.word()), (exit, word));
    }
}

#[test]
fn what_is_untested_may_be_allowed() {
    let untested = || vec![judged("UNTESTED", Exit::Failed, "a", 1.0)];
    for (allows_untested, is_short) in [(false, true), (true, false)] {
        let found = TestedScenario { allows_untested, ..tested("one", untested()) };
        assert_eq!((found.outcome(), found.is_short()), (Outcome::Untested, is_short));
    }
}

#[test]
fn the_json_is_the_baseline_of_a_later_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("before.json");
    let before = report(vec![tested("b", vec![passed(2.0)]), tested("a", vec![passed(1.0)])], None);
    std::fs::write(&path, before.to_json().unwrap()).unwrap();
    assert_eq!(before.trend_in_words(), None);

    let baseline = Baseline::read(&path).unwrap();
    let now = report(vec![tested("a", vec![passed(0.5)]), tested("b", vec![passed(2.0)])], Some(baseline));
    let said = now.trend_in_words().unwrap();
    assert!(said.contains("1 smaller, 0 larger, 1 equal; most of all a: force, 1 → 0.5"), "{said}");
    let mut renamed = passed(1.0).unwrap();
    renamed.checks[0].name = "another".into();
    let renamed = vec![tested("a", vec![Ok(renamed)])];
    let now_without = report(renamed, Some(Baseline::read(&path).unwrap()));
    let said_without = now_without.trend_in_words().unwrap();
    assert!(
        said_without.ends_with("1 not compared; 1 of the baseline gone, such as a: force"),
        "{said_without}"
    );
    let json: Value = serde_json::from_str(&now.to_json().unwrap()).unwrap();
    let row = &json["requirements"][0];
    assert_eq!(
        (&row["id"], &row["scenario"], &row["result"]),
        (&"REQ-12".into(), &"a".into(), &"passed".into())
    );
    assert_eq!((&row["margin"], &row["before"]["margin"]), (&0.5.into(), &1.0.into()));
    assert_eq!((&json["result"], &json["unrun"][0]), (&"INTERRUPTED".into(), &"last".into()));
    assert_eq!(json["scenarios"][0]["attempts"][0]["word"], "PASS");
    let html = html_of_suite(&now, "suite.html".as_ref()).unwrap();
    assert!(["REQ-12", "b.TOML", "-50 %"].iter().all(|text| html.contains(text)));

    std::fs::write(&path, "{\"form\": 2, \"requirements\": []}").unwrap();
    assert!(Baseline::read(&path).unwrap_err().to_string().contains("its form is 2"));
    std::fs::write(&path, "{}").unwrap();
    assert!(Baseline::read(&path).unwrap_err().to_string().contains("is no result of masseter test"));
}
