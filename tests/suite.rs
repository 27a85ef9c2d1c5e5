//! `masseter test`: suites of real scenario files, their lines, exit codes, JUnit file and kept folders.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use crate::common::{MASSETER, json, stderr, stdout};
use rustix::process::{Pid, Signal, kill_process};

const PASSES: &str = "duration_s = 1.0\n";
const FAILS: &str = "duration_s = 1.0\n[checks]\ntracking_rms_mm = 1e-6\n";
/// The fault would act after the end.
const UNTESTED: &str = "duration_s = 1.0\n[[faults]]\nkind = 'lose'\nbus = 0\nfrom_s = 100.0\n";
const UNREADABLE: &str = "sed = 1\n";

/// A folder with scenarios in `suite`.
struct Suite(tempfile::TempDir);

impl Suite {
    fn of(files: &[(&str, &str)]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("suite")).unwrap();
        for (name, text) in files {
            fs::write(folder.path().join("suite").join(name), text).unwrap();
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(MASSETER);
        command.current_dir(self.0.path()).arg("test").args(arguments);
        command
    }

    fn test(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("masseter starts")
    }
}

fn all_kinds() -> Suite {
    Suite::of(&[
        ("passes.toml", PASSES),
        ("fails.toml", FAILS),
        ("untested.toml", UNTESTED),
        ("unreadable.toml", UNREADABLE),
        ("notes.txt", "no scenario"),
    ])
}

/// The test cases of a JUnit file by suite and name, each with the element in it.
fn junit_cases(xml: &str) -> BTreeMap<(String, String), String> {
    let attribute = |line: &str, name: &str| {
        let rest = line.split_once(&format!(" {name}=\"")).expect("the attribute is there").1;
        rest.split_once('"').expect("the attribute ends").0.to_owned()
    };
    let cases = xml.lines().filter(|line| line.trim_start().starts_with("<testcase "));
    cases
        .map(|line| {
            let inner = line.split_once('>').unwrap().1;
            let element = inner.trim_start_matches('<').split([' ', '/']).next().unwrap();
            ((attribute(line, "classname"), attribute(line, "name")), element.to_owned())
        })
        .collect()
}

#[test]
fn a_suite_lists_its_tests_and_the_reasons_of_those_that_failed() {
    let suite = all_kinds();
    let output = suite.test(&["suite", "--junit", "junit.xml", "--out", "kept"]);
    let said = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{said}{}", stderr(&output));
    for line in [
        "running 4 tests",
        "test passes ... ok",
        "test fails ... FAILED",
        "test untested ... UNTESTED",
        "test unreadable ... FAILED",
        "---- fails ----",
        "FAIL: failed: tracking",
        "again: masseter run suite/fails.toml --clock virtual",
        "report: kept/fails/report.html",
        "suite/unreadable.toml:1:1: unknown key 'sed'",
        "test result: FAILED. 1 passed; 2 failed; 1 untested; finished in ",
    ] {
        assert!(said.lines().any(|found| found.starts_with(line)), "{line}: {said}");
    }
    let mut kept: Vec<_> = fs::read_dir(suite.path("kept")).unwrap().map(|entry| entry.unwrap()).collect();
    kept.sort_by_key(fs::DirEntry::file_name);
    let kept: Vec<_> = kept.iter().map(|entry| entry.file_name().into_string().unwrap()).collect();
    assert_eq!(kept, ["fails", "untested"]);
    for file in ["report.html", "summary.json", "junit.xml", "recording.mcap", "manifest.json"] {
        assert!(suite.path("kept/fails").join(file).is_file(), "{file}");
    }
    assert_eq!(json(&suite.path("kept/fails/summary.json"))["verdict"]["word"], "FAIL");

    let cases = junit_cases(&fs::read_to_string(suite.path("junit.xml")).unwrap());
    let found = |suite: &str, name: &str| cases[&(suite.to_owned(), name.to_owned())].as_str();
    assert_eq!(found("passes", "run"), "");
    assert_eq!(found("fails", "run"), "");
    assert_eq!(found("fails", "tracking"), "failure");
    assert_eq!(found("untested", "faults"), "failure");
    assert_eq!(found("unreadable", "run"), "error");
}

/// The figures of a run without a recording are those of its recording.
#[test]
fn what_fails_without_a_recording_fails_with_it_in_the_same_words() {
    let suite = Suite::of(&[("fails.toml", FAILS)]);
    let output = suite.test(&["suite", "--out", "kept"]);
    let summary = json(&suite.path("kept/fails/summary.json"));
    let reason = summary["verdict"]["reason"].as_str().unwrap();
    assert!(stdout(&output).contains(&format!("FAIL: {reason}\n")), "{}", stdout(&output));
    let again = Command::new(MASSETER)
        .args(["run", "suite/fails.toml", "--clock", "virtual", "--quiet", "--out", "again"])
        .current_dir(suite.0.path())
        .output()
        .unwrap();
    assert_eq!(again.status.code(), Some(1));
    assert_eq!(json(&suite.path("again/summary.json")), summary);
    let bytes = |folder: &str| fs::read(suite.path(folder).join("recording.mcap")).unwrap();
    assert!(bytes("again") == bytes("kept/fails"));
}

#[test]
fn a_suite_passes_if_every_scenario_does() {
    let suite = Suite::of(&[("one.toml", PASSES), ("two.toml", PASSES)]);
    let output = suite.test(&["suite", "--junit", "junit.xml"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    assert!(stdout(&output).contains("test result: ok. 2 passed; 0 failed; 0 untested; finished in"));
    assert!(!suite.path("runs").exists(), "nothing failed");
    let xml = fs::read_to_string(suite.path("junit.xml")).unwrap();
    assert!(xml.contains("failures=\"0\" errors=\"0\""), "{xml}");
}

#[test]
fn what_is_untested_fails_unless_it_is_allowed_and_a_fault_that_did_not_act_fails_always() {
    let idle = "duration_s = 0.5\n[[require]]\nname = 'r'\nwhen = 'safe_stop'\nthen = 'l1.force < 1 N'\n";
    for (scenario, allowed) in [(idle, 0), (UNTESTED, 1)] {
        let suite = Suite::of(&[("untested.toml", scenario)]);
        let arguments: [(&[&str], i32); 2] =
            [(&["suite"], 1), (&["suite", "--allow-untested", "--out", "allowed"], allowed)];
        for (arguments, code) in arguments {
            let output = suite.test(arguments);
            assert_eq!(output.status.code(), Some(code), "{}", stdout(&output));
            assert!(stdout(&output).contains("0 passed; 0 failed; 1 untested"), "{}", stdout(&output));
        }
        assert_eq!(suite.path("allowed").exists(), allowed == 1);
    }
}

/// A knock stops the rig just before the fault would strike: the fault shows nothing, though the rig is stopped as
/// expected.
#[test]
fn a_stop_before_the_fault_tests_nothing_of_the_fault() {
    let scenario = "duration_s = 4.0
        [[stimulus]]
        name = 'knock'
        at_s = 1.79
        for_s = 0.02
        push_n = [0, 0, -80]
        [[faults]]
        kind = 'encoder_stuck'
        axis = 'l2'
        at_s = 1.8
        [[require]]
        name = 'stops after an encoder fault'
        when = 'fault.encoder_stuck'
        then = 'controller.state == safe_stop'
        within = '20 ms'
        [expect]
        verdict = 'safe_stop'";
    let suite = Suite::of(&[("stuck.toml", scenario)]);
    let output = suite.test(&["suite", "--allow-untested", "--out", "kept"]);
    let said = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let why = "0 of 1 declared faults acted, number 1 only after the rig had stopped";
    assert!(said.contains("test stuck ... UNTESTED\n") && said.contains(why), "{said}");
    let summary = json(&suite.path("kept/stuck/summary.json"));
    let checks = summary["verdict"]["checks"].as_array().unwrap();
    let response = checks.iter().find(|check| check["name"] == "stops after an encoder fault").unwrap();
    let finding = response["finding"].as_str().unwrap();
    assert!(finding.contains("the condition held already before 1 trigger"), "{finding}");
}

#[test]
fn a_failure_beside_the_named_one_fails_and_one_without_a_name_is_refused() {
    let planted = "duration_s = 1.0
        checks.tracking_max_mm = 1e-4
        [[require]]
        name = 'must hold'
        signal = 'incisal.x'
        LIMIT
        [expect]
        verdict = 'fail'";
    let with = |limit: &str, failed: &str| planted.replace("LIMIT", limit) + failed;
    let failed = "\nfailed = ['tracking', 'estimated tracking']\n";
    let suite = Suite::of(&[
        ("exact.toml", &with("max = '1000 mm'", failed)),
        ("hides.toml", &with("max = '-1000 mm'", failed)),
        ("unnamed.toml", &with("max = '1000 mm'", "")),
    ]);
    let output = suite.test(&["suite"]);
    let said = stdout(&output);
    assert!(said.contains("test exact ... ok\n"), "{said}");
    let hides =
        "FAIL: expected that tracking, estimated tracking fails and nothing else, but must hold failed";
    assert!(said.contains("test hides ... FAILED\n") && said.contains(hides), "{said}");
    let unnamed = "expect.failed = []: name the checks and requirements that must fail";
    assert!(said.contains("test unnamed ... FAILED\n") && said.contains(unnamed), "{said}");
}

#[test]
fn tags_and_a_matrix_choose_and_an_included_file_is_shared() {
    let cases = "include = ['common/common.toml']\ntags = ['rates']\n[matrix]\nrate_hz = [500, 1000]\n";
    let suite = Suite::of(&[("cases.toml", cases), ("plain.toml", PASSES), ("b.TOML", PASSES)]);
    fs::create_dir(suite.path("suite/common")).unwrap();
    let common = "duration_s = 1.0\n[[require]]\nname = 'small'\nid = 'REQ-12'\nsignal = 'incisal.error'\n\
                  during = 'running'\nmax = '0.5 mm'\n";
    fs::write(suite.path("suite/common/common.toml"), common).unwrap();

    let output = suite.test(&["suite", "--junit", "junit.xml", "--format", "json", "--html", "suite.html"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("left out: suite/b.TOML (its name does not end with .toml)"));
    let result: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    let names = |list: &serde_json::Value, key: &str| {
        list.as_array().unwrap().iter().map(|row| row[key].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let both = ["cases[rate_hz=500]", "cases[rate_hz=1000]"];
    assert_eq!(names(&result["scenarios"], "name"), [both[0], both[1], "plain"]);
    assert_eq!(names(&result["requirements"], "scenario"), both);
    assert_eq!(names(&result["requirements"], "id"), ["REQ-12", "REQ-12"]);
    assert!(fs::read_to_string(suite.path("suite.html")).unwrap().contains("cases[rate_hz=500]"));
    let junit = fs::read_to_string(suite.path("junit.xml")).unwrap();
    assert!(junit.contains("file=\"suite/cases.toml\"") && junit.contains("value=\"REQ-12\""), "{junit}");

    fs::write(suite.path("before.json"), stdout(&output)).unwrap();
    let arguments = ["suite", "--tag", "rates", "-k", "not 500", "--baseline", "before.json"];
    let output = suite.test(&arguments);
    let said = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{said}{}", stderr(&output));
    assert!(said.contains("margins since the baseline: 0 smaller, 0 larger, 1 equal\n"), "{said}");
    assert!(said.contains("1 passed; 0 failed; 0 untested; 2 filtered out"), "{said}");
    let shares = ["1/3", "2/3", "3/3"].map(|share| stdout(&suite.test(&["suite", "--shard", share])));
    assert!(shares.iter().all(|said| said.contains("1 passed; 0 failed")), "{shares:?}");
    for name in ["cases[rate_hz=500]", "cases[rate_hz=1000]", "plain"] {
        let line = format!("test {name} ... ");
        assert_eq!(shares.iter().filter(|said| said.contains(&line)).count(), 1, "{name}: {shares:?}");
    }
    let refused = suite.test(&["suite", "-k", "rates and"]);
    assert!(refused.status.code() == Some(2) && stderr(&refused).contains("a word is missing"));
}

#[test]
fn a_filter_chooses_by_name_and_must_leave_something() {
    let suite = all_kinds();
    let output = suite.test(&["suite", "-k", "passes and not fails"]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
    let said = stdout(&output);
    assert!(said.contains("running 1 test\n") && said.contains("3 filtered out"), "{said}");
    let none = suite.test(&["suite", "-k", "encoder"]);
    assert_eq!(none.status.code(), Some(2));
    let expected = "there are: fails, passes, unreadable, untested";
    assert!(stderr(&none).contains(expected), "{}", stderr(&none));
}

#[test]
fn what_cannot_be_a_suite_is_refused() {
    let suite = Suite::of(&[("one.toml", PASSES)]);
    fs::create_dir(suite.path("empty")).unwrap();
    for (arguments, expected) in [
        (&["empty"][..], "has no scenario"),
        (&["missing"], "cannot read missing"),
        (&[], "required"),
        (&["suite", "--out", "empty"], "exists and is not overwritten"),
    ] {
        let output = suite.test(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stdout(&output));
        assert!(stderr(&output).contains(expected), "{arguments:?}: {}", stderr(&output));
    }
}

#[test]
fn files_can_be_named_and_runs_with_processes_keep_folders_of_failures_alone() {
    let suite = all_kinds();
    let arguments =
        ["suite/passes.toml", "suite/fails.toml", "--clock", "lockstep", "--retries", "1", "--out", "kept"];
    let output = suite.test(&arguments);
    let said = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{said}{}", stderr(&output));
    assert!(said.contains("test passes ... ok\n"), "{said}");
    assert!(said.contains("test fails ... FAILED (also after 1 retry)\n"), "{said}");
    for attempt in ["fails", "fails-retry-1"] {
        assert!(suite.path("kept").join(attempt).join("report.html").is_file(), "{attempt}");
    }
    assert!(!suite.path("kept/passes").exists());
}

#[test]
fn another_result_of_the_same_run_in_simulated_time_is_a_failure_of_its_own() {
    // A controller that gives up in its first run, and attaches in the second.
    let suite = Suite::of(&[("one.toml", PASSES)]);
    let program = suite.path("controller.sh");
    let script = format!(
        "#!/bin/sh\nif [ -e {0} ]; then exec {MASSETER} controller; fi\ntouch {0}\nexit 1\n",
        suite.path("tried").display()
    );
    fs::write(&program, script).unwrap();
    Command::new("chmod").arg("+x").arg(&program).status().unwrap();
    let arguments = ["suite", "--controller", "./controller.sh", "--retries", "2", "--out", "kept"];
    let output = suite.test(&arguments);
    let said = stdout(&output);
    assert_eq!(output.status.code(), Some(1), "{said}{}", stderr(&output));
    assert!(said.contains("test one ... FAILED (also after 1 retry)\n"), "{said}");
    let differ = "runs of the same scenario and seed differ in simulated time: ";
    assert!(said.contains(differ) && said.contains("; then PASS: "), "{said}");
    assert!(suite.path("kept/one-retry-1/report.html").is_file());
}

#[test]
fn a_scenario_that_is_named_twice_runs_once() {
    let suite = Suite::of(&[("one.toml", "duration_s = 0.5\n"), ("two.toml", "duration_s = 0.5\n")]);
    let output = suite.test(&["suite", "suite/one.toml", "suite/../suite/two.toml"]);
    assert!(stdout(&output).contains("running 2 tests\n"), "{}", stdout(&output));
}

#[test]
fn a_report_does_not_replace_a_scenario() {
    let suite = Suite::of(&[("passes.toml", PASSES)]);
    for option in ["--junit", "--html"] {
        let refused = suite.test(&["suite", option, "suite/passes.toml"]);
        assert_eq!(refused.status.code(), Some(2), "{}", stdout(&refused));
        assert!(stderr(&refused).contains("is a scenario of the suite"), "{}", stderr(&refused));
    }
    assert_eq!(fs::read_to_string(suite.path("suite/passes.toml")).unwrap(), PASSES);
}

#[test]
fn a_controller_that_the_suite_does_not_start_is_refused() {
    let suite = Suite::of(&[("one.toml", "duration_s = 0.5\n")]);
    for controller in ["external", "none"] {
        let output = suite.test(&["suite", "--controller", controller]);
        assert_eq!(output.status.code(), Some(2), "{}", stdout(&output));
        assert!(stderr(&output).contains("motion, hold, or a path"), "{}", stderr(&output));
    }
}

#[test]
fn an_interrupt_ends_the_suite_with_the_results_until_then() {
    let files: Vec<_> = (0..400).map(|number| format!("long{number}.toml")).collect();
    let files: Vec<_> = files.iter().map(|name| (name.as_str(), "duration_s = 2.0\n")).collect();
    let suite = Suite::of(&files);
    let mut command = suite.command(&["suite", "--junit", "junit.xml"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    let mut said: Vec<_> = lines.by_ref().take_while(|line| !line.ends_with("... ok")).collect();
    kill_process(Pid::from_child(&child), Signal::INT).unwrap();
    said.extend(lines);
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{said:?}{}", stderr(&output));
    assert!(stderr(&output).contains("interrupted after"), "{}", stderr(&output));
    let result = said.last().unwrap();
    assert!(result.contains("INTERRUPTED. ") && result.contains(" not run; "), "{said:?}");
    // The first one is not in `said`.
    let tested = 1 + said.iter().filter(|line| line.ends_with("... ok")).count();
    let junit = fs::read_to_string(suite.path("junit.xml")).unwrap();
    let count = |text| junit.matches(text).count();
    assert_eq!((count("<testsuite "), count("interrupted before its end")), (400, 400 - tested), "{junit}");
    assert!(!suite.path("runs").exists());
}
