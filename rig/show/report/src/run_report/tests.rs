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
    let page = page::html(&manifest, &figures, &verdict).unwrap();
    assert!(page.contains("{\"mark\":\"UNTESTED\",\"tone\":\"doubtful\"}"), "{page}");
    let word = format!("\"word\":\"{}\"", verdict.word);
    assert!(page.contains(&word) && page.contains("\"tone\":\"bad\""), "{page}");
}

#[test]
fn a_run_without_a_cycle_claims_nothing() {
    let (manifest, figures) = run(0, 0);
    let verdict = Verdict::new(&manifest, &figures);
    let said = table::verdict_in_words(&manifest, &verdict);
    let text = said + &table::table_in_words(&manifest, &figures, &verdict, Detail::Brief);
    assert!(text.starts_with("UNTESTED: no cycle ran\n") && !text.contains("FAIL"), "{text}");
    assert!(text.contains("\ntiming: unknown, because no cycle ran\n"), "{text}");
}
