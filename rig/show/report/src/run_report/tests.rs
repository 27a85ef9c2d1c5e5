//! What every document says of a run that tested too little.

use masseter_judge::CheckResult;
use masseter_recording::{Ending, MachineInfo};
use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;

use super::*;

/// A run to its end, whose motion gave so many samples.
fn run(cycles: u64, samples: u64) -> (Manifest, Figures) {
    let machine = MachineInfo { cpu: "any".into(), cores: 2, kernel: "Linux".into(), is_virtual: false };
    let mut manifest = Manifest::new("0.1.0", Scenario::default(), 10.0, "rt", machine);
    manifest.ending = Ending::Completed;
    let mut figures = Analysis::new(&manifest.scenario, &Declared::default()).finish(false, &[]);
    (figures.cycles, figures.tracking.samples) = (cycles, samples);
    (manifest, figures)
}

#[test]
fn every_document_names_what_was_not_tested() {
    let (manifest, figures) = run(1000, 9);
    let verdict = Verdict::new(&manifest, &figures);
    let count = |result| verdict.checks.iter().filter(|check| check.result == result).count();
    let (failed, untested) = (count(CheckResult::Failed), count(CheckResult::Untested));
    assert!(untested > 0, "{:?}", verdict.checks);
    let xml = junit::xml(&manifest, &figures, &verdict).unwrap();
    assert!(xml.contains(&format!("failures=\"{}\" errors=\"0\"", failed + untested)), "{xml}");
    assert!(xml.contains("<failure message=\"not tested: ") && xml.contains("type=\"untested\""), "{xml}");
    let text = table::table_in_words(&manifest, &figures, &verdict, Detail::Brief);
    assert!(text.contains("\n  UNTESTED "), "{text}");
    let page = page::html(&manifest, &figures, &verdict, None).unwrap();
    assert!(page.contains("{\"mark\":\"UNTESTED\",\"tone\":\"doubtful\"}"), "{page}");
    let word = format!("\"word\":\"{}\"", verdict.word);
    assert!(page.contains(&word) && page.contains("\"tone\":\"bad\""), "{page}");
}

#[test]
fn every_document_of_a_failed_run_names_the_first_breach_and_the_next_step() {
    let (manifest, mut figures) = run(1000, 1000);
    figures.tracking.actual.rms_mm = Some(0.25);
    figures.path_breach.motion_ns = Some([1_000_000_000, 3_000_000_000]);
    figures.disorder = None;
    let verdict = Verdict::new(&manifest, &figures);
    let first = "tracking: platform rms 0.2500 mm, limit 0.1 mm, from 0.000 s to 2.000 s of the motion";
    let next = |page| format!("Compare desired and true motion in {page}, then tune the controller");
    let said = table::verdict_in_words(&verdict, "runs/x".as_ref());
    assert!(said.starts_with(&format!("FAIL: failed: sequence, tracking; first: {first}\nnext: ")), "{said}");
    assert!(said.contains(&next("`runs/x/report.html`")), "{said}");
    let xml = junit::xml(&manifest, &figures, &verdict).unwrap();
    let property = |name, value: &str| format!("<property name=\"{name}\" value=\"{value}");
    assert!(
        xml.contains(&property("first breach", first))
            && xml.contains(&property("next step", &next("`RUN/report.html`"))),
        "{xml}"
    );
    let page = page::html(&manifest, &figures, &verdict, None).unwrap();
    assert!(
        page.contains(&format!("; first: {first}\""))
            && page.contains(&format!("\"next\":\"{}", next("this page"))),
        "no breach"
    );
    let summary: serde_json::Value =
        serde_json::from_str(&summary_json(&verdict, &figures).unwrap()).unwrap();
    let breach = &summary["verdict"]["first_breach"];
    assert_eq!((&breach["value"], &breach["at_s"]), (&"0.2500 mm".into(), &2.0.into()));
    assert!(
        summary["verdict"]["next_step"].as_str().unwrap().starts_with(&next("`RUN/report.html`")),
        "{summary}"
    );
}

#[test]
fn a_run_without_a_cycle_claims_nothing() {
    let (manifest, figures) = run(0, 0);
    let verdict = Verdict::new(&manifest, &figures);
    let said = table::verdict_in_words(&verdict, "runs/latest".as_ref());
    let text = said + &table::table_in_words(&manifest, &figures, &verdict, Detail::Brief);
    assert!(text.starts_with("UNTESTED: no cycle ran\n") && !text.contains("FAIL"), "{text}");
    assert!(text.contains("\ntiming: unknown, because no cycle ran\n"), "{text}");
}
