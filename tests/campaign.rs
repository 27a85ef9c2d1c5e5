//! `masseter campaign`, `search` and `shrink` as a user meets them. Kills and foreign readers: `tests/foreign/campaign.py`.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::common::{self, MASSETER, json, stderr, stdout};
use serde_json::Value;
use tempfile::TempDir;

const SCENARIO: &str = "\
duration_s = 1.0
[[require]]
name = 'incisal'
signal = 'incisal.error'
during = 'running'
max = '60 um'
";
/// More friction than the limit allows in the upper part of the range.
const CAMPAIGN: &str = "\
scenario = 'chewing.toml'
sampler = 'sobol'
runs = 6
[[factor]]
key = 'dynamics.slide_friction_n'
range = [2.0, 40.0]
";

fn folder(campaign: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("chewing.toml"), SCENARIO).unwrap();
    fs::write(folder.path().join("friction.toml"), campaign).unwrap();
    folder
}

fn masseter(folder: &TempDir, arguments: &[&str]) -> Output {
    Command::new(MASSETER).current_dir(folder.path()).args(arguments).output().expect("masseter starts")
}

fn results(out: &Path) -> Vec<Value> {
    let cases = fs::read_dir(out.join("cases")).unwrap();
    cases.map(|case| json(&case.unwrap().path().join("result.json"))).collect()
}

#[test]
fn a_scheduler_runs_the_cases_of_a_plan_and_the_campaign_reports_them() {
    let folder = folder(CAMPAIGN);
    let plan = || {
        let output = masseter(&folder, &["campaign", "friction.toml", "--out", "out", "--plan"]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        stdout(&output)
    };
    let case = |number: &str| masseter(&folder, &["campaign-case", "out", number]).status.code();
    assert_eq!(plan(), "0\n1\n2\n3\n4\n5\n");
    assert_eq!(["4", "0", "2"].map(case), [Some(0); 3]);
    assert_eq!(plan(), "1\n3\n5\n");
    assert_eq!(case("6"), Some(2), "there is none");
    // What no scheduler has run is run here.
    let output = masseter(&folder, &["campaign", "friction.toml", "--out", "out", "--record", "0"]);
    assert!(stdout(&output).starts_with("FAIL: 6 cases of 6: "), "{}{}", stdout(&output), stderr(&output));
    assert_eq!(plan(), "");
    fs::write(folder.path().join("friction.toml"), format!("{CAMPAIGN}[stop_after]\nfailures = 1\n"))
        .unwrap();
    let refused = masseter(&folder, &["campaign", "friction.toml", "--out", "other", "--plan"]);
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(stderr(&refused).contains("stop_after"), "{}", stderr(&refused));
}

#[test]
fn a_campaign_judges_every_case_and_records_the_worst() {
    common::demand_parquet();
    let folder = folder(CAMPAIGN);
    let output = masseter(&folder, &["campaign", "friction.toml", "--out", "out", "--record", "2"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    let said = stdout(&output);
    assert!(said.starts_with("FAIL: 6 cases of 6: ") && said.contains("success rate: "), "{said}");
    let out = folder.path().join("out");
    let results = results(&out);
    assert_eq!(results.len(), 6);
    let failed = |result: &&Value| result["word"] == "FAIL";
    let friction_n = |result: &Value| result["settings"][0]["value"].as_f64().unwrap();
    let of_failed = results.iter().filter(failed).map(friction_n).fold(f64::INFINITY, f64::min);
    let of_passed =
        results.iter().filter(|result| result["word"] == "PASS").map(friction_n).fold(0.0, f64::max);
    assert!(of_passed < of_failed && of_failed.is_finite(), "{of_passed} and {of_failed}");
    assert!(fs::read(out.join("cases.parquet")).unwrap().starts_with(b"PAR1"));
    let worst: Vec<_> =
        fs::read_dir(out.join("worst")).unwrap().flatten().map(|entry| entry.path()).collect();
    assert_eq!(worst.iter().filter(|path| path.join("report.html").is_file()).count(), 2);
    let page = fs::read_to_string(out.join("campaign.html")).unwrap();
    for scenario in worst.iter().filter(|path| path.extension().is_some_and(|ending| ending == "toml")) {
        let command = format!("masseter run out/worst/{} ", scenario.file_name().unwrap().to_string_lossy());
        assert!(page.contains(&command), "{command}");
    }
}

#[test]
fn a_campaign_that_has_ended_runs_nothing_again_and_a_changed_one_is_refused() {
    let folder = folder(CAMPAIGN);
    let run = || masseter(&folder, &["campaign", "friction.toml", "--out", "out", "--record", "0"]);
    let first = stdout(&run());
    let written = || {
        let cases = fs::read_dir(folder.path().join("out/cases")).unwrap().flatten();
        let mut times: Vec<_> = cases
            .map(|case| case.path().join("result.json").metadata().unwrap().modified().unwrap())
            .collect();
        times.sort();
        times
    };
    let before = written();
    assert_eq!(stdout(&run()), first);
    assert_eq!(written(), before);
    fs::write(folder.path().join("friction.toml"), CAMPAIGN.replace("40.0", "41.0")).unwrap();
    let refused = run();
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("the file of the campaign has changed; choose another --out"));
}

#[test]
fn without_the_program_that_writes_parquet_the_table_is_csv_and_one_line_says_why() {
    let folder = folder(CAMPAIGN);
    let lone = folder.path().join("masseter");
    common::copy_program(&lone);
    let mut command = Command::new(&lone);
    command.current_dir(folder.path()).args(["campaign", "friction.toml", "--out", "out", "--record", "0"]);
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stdout(&output).contains("table: out/cases.csv\n"), "{}", stdout(&output));
    let said = stderr(&output);
    let lines: Vec<_> = said.lines().filter(|line| line.contains("masseter-parquet")).collect();
    assert!(
        matches!(lines[..], [line] if line.contains("cargo build --release") && line.contains("--out out")),
        "{said}"
    );
    let table = fs::read_to_string(folder.path().join("out/cases.csv")).unwrap();
    assert!(table.starts_with("case,id,") && table.lines().count() == 7, "{table}");
    assert!(!folder.path().join("out/cases.parquet").exists());
}

#[test]
fn a_campaign_passes_with_the_share_of_successes_that_it_demands() {
    let folder = folder(&CAMPAIGN.replace("runs = 6", "runs = 6\nleast_success = 0.1"));
    let output = masseter(&folder, &["campaign", "friction.toml", "--out", "out", "--record", "0"]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
}

#[test]
fn wrong_campaigns_are_refused_before_anything_runs() {
    for (campaign, reason) in [
        (CAMPAIGN.replace("slide_friction_n", "slide_frictio_n"), "did you mean 'slide_friction_n'?"),
        (CAMPAIGN.replace("runs = 6\n", ""), "runs: give the number of points"),
        (CAMPAIGN.replace("'sobol'", "'halton'"), "halton"),
        (CAMPAIGN.replace("[2.0, 40.0]", "[40.0, 2.0]"), "the smaller first"),
        (CAMPAIGN.replace("chewing.toml", "nothing.toml"), "nothing.toml"),
    ] {
        let folder = folder(&campaign);
        let output = masseter(&folder, &["campaign", "friction.toml", "--out", "out"]);
        assert_eq!(output.status.code(), Some(2), "{campaign}");
        assert!(stderr(&output).contains(reason), "{}", stderr(&output));
        assert!(!folder.path().join("out").exists(), "{campaign}");
    }
}

#[test]
fn a_search_finds_a_failure_and_shrink_leaves_what_it_needs() {
    let folder = folder(&CAMPAIGN.replace("sobol", "random"));
    let search = [
        "search",
        "friction.toml",
        "--minimise",
        "incisal.margin",
        "--runs",
        "40",
        "--out",
        "found",
        "--record",
        "1",
    ];
    let output = masseter(&folder, &search);
    assert_eq!(output.status.code(), Some(1), "{}{}", stdout(&output), stderr(&output));
    assert!(stdout(&output).starts_with("below zero after "), "{}", stdout(&output));
    let worst = fs::read_dir(folder.path().join("found/worst")).unwrap().flatten();
    let worst =
        worst.map(|entry| entry.path()).find(|path| path.is_dir()).expect("the worst case is recorded");
    let output = masseter(&folder, &["shrink", worst.to_str().unwrap(), "--out", "small.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let small = fs::read_to_string(folder.path().join("small.toml")).unwrap();
    assert!(
        small.contains("slide_friction_n") && small.contains("60 um") && !small.contains("[can]"),
        "{small}"
    );
    let again = masseter(&folder, &["run", "small.toml", "--clock", "virtual", "--quiet", "--out", "again"]);
    assert_eq!(again.status.code(), Some(1), "{}", stdout(&again));
    let summary = json(&folder.path().join("again/summary.json"));
    assert_eq!(summary["verdict"]["reason"], "failed: incisal");
}

#[test]
fn a_scenario_that_passes_cannot_be_shrunk() {
    let folder = folder(CAMPAIGN);
    let output = masseter(&folder, &["shrink", "chewing.toml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("there is nothing to shrink"), "{}", stderr(&output));
}
