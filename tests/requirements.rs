//! Requirements and expected outcomes of whole runs: verdict, exit code, summary, JUnit, report page.

use std::fs;

use crate::common::{Cores, LENIENT, Workspace, check, stdout};

/// Runs a scenario under virtual time; its exit code, and what it printed.
fn run(workspace: &Workspace) -> (Option<i32>, String) {
    let output = workspace.run_virtual(&[]);
    (output.status.code(), stdout(&output) + &String::from_utf8_lossy(&output.stderr))
}

/// A file of the report.
fn read(workspace: &Workspace, name: &str) -> String {
    fs::read_to_string(workspace.run_folder().join(name)).unwrap()
}

/// A drive that no longer gets its targets, at the fastest moment of the motion.
const LOST_TARGETS: &str = "
duration_s = 4.0
[[faults]]
name = 'deaf'
kind = 'lose'
bus = 1
node = 4
id = 0x204
at_s = 2.0
";

#[test]
fn a_requirement_that_holds_has_its_margin_everywhere() {
    let workspace = Workspace::new(
        "duration_s = 2.0
         [[require]]
         name = 'incisal error while chewing'
         signal = 'incisal.error'
         during = 'running'
         max = '50 um'
         [[require]]
         name = 'the jaw opens'
         signal = 'jaw.opening'
         statistic = 'peak_to_peak'
         min = '15 mm'",
    );
    let (code, text) = run(&workspace);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("incisal error while chewing"), "{text}");
    let summary = workspace.summary();
    let figures = &summary["figures"];
    let check = check(&summary, "incisal error while chewing");
    let worst_mm = figures["tracking"]["incisal_max_mm"].as_f64().unwrap();
    let margin_mm = check["margin"].as_f64().unwrap();
    assert_eq!((check["result"].as_str(), check["margin_unit"].as_str()), (Some("passed"), Some("mm")));
    // The tracking's own peak also counts the moves before and after.
    assert!(margin_mm > 0.0 && (0.05 - margin_mm) <= worst_mm + 1e-9, "{check:?}");
    let at_s = check["worst_at_s"].as_f64().unwrap();
    assert!((0.0..2.0).contains(&at_s), "{check:?}");

    let junit = read(&workspace, "junit.xml");
    assert!(junit.contains("name=\"incisal error while chewing\""), "{junit}");
    assert!(junit.contains("<property name=\"margin\""), "{junit}");
    let page = read(&workspace, "report.html");
    assert!(
        page.contains("\"title\":\"Requirements\"") && page.contains("smallest margin"),
        "no requirement in the page"
    );
}

#[test]
fn a_requirement_that_does_not_hold_fails_the_run_with_its_moment() {
    let workspace = Workspace::new(
        "duration_s = 2.0
         [[require]]
         name = 'impossible'
         signal = 'incisal.error'
         during = { from_s = 0.5, to_s = 1.5 }
         max = '1 um'",
    );
    let (code, text) = run(&workspace);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("FAIL: failed: impossible"), "{text}");
    let summary = workspace.summary();
    let check = check(&summary, "impossible");
    assert!(check["margin"].as_f64().unwrap() < 0.0);
    assert!((0.5..=1.5).contains(&check["worst_at_s"].as_f64().unwrap()), "{check:?}");
    assert!(read(&workspace, "junit.xml").contains("<failure message="));
}

#[test]
fn a_test_that_expects_a_safe_stop_passes_because_of_it() {
    let respond = "
        [[require]]
        name = 'stops after the fault'
        when = 'fault.deaf'
        then = 'controller.state == safe_stop'
        within = '20 ms'
        stays_for = '50 ms'
        [expect]
        verdict = 'safe_stop'
        events = ['master.following_error']";
    let workspace = Workspace::new(&format!("{LOST_TARGETS}{respond}"));
    let (code, text) = run(&workspace);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("PASS: SAFE STOP, as expected"), "{text}");
    let summary = workspace.summary();
    let check = check(&summary, "stops after the fault");
    let detected_ms = summary["figures"]["faults"][0]["detection"]["latency_ms"].as_f64().unwrap();
    let latency_ms = check["latency_ms"].as_f64().unwrap();
    assert!(
        latency_ms >= detected_ms && latency_ms < detected_ms + 3.0,
        "{latency_ms} against {detected_ms}"
    );
    assert!((check["margin"].as_f64().unwrap() - (20.0 - latency_ms)).abs() < 1.1, "{check:?}");
    let junit = read(&workspace, "junit.xml");
    assert!(!junit.contains("<failure") && !junit.contains("<error"), "{junit}");
}

#[test]
fn another_outcome_than_the_expected_one_fails() {
    let workspace = Workspace::new("duration_s = 0.5\n[expect]\nverdict = 'safe_stop'");
    let (code, text) = run(&workspace);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("FAIL: expected SAFE STOP, but "), "{text}");

    let workspace = Workspace::new(&format!(
        "{LOST_TARGETS}\n[expect]\nevents = ['controller.law_failed']\nverdict = 'safe_stop'"
    ));
    let (code, text) = run(&workspace);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("failed: expected event controller.law_failed"), "{text}");
}

#[test]
fn a_planted_bug_passes_by_the_requirement_that_it_fails() {
    let bug = "
        duration_s = 1.0
        [[require]]
        name = 'impossible'
        signal = 'incisal.error'
        max = '1 nm'
        [expect]
        exit_code = 1
        verdict = 'fail'
        failed = ['impossible']";
    let (code, text) = run(&Workspace::new(bug));
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("PASS: FAIL, as expected: failed: impossible"), "{text}");
    let (code, text) = run(&Workspace::new(&bug.replace("1 nm", "1 m")));
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("FAIL: expected FAIL, but PASS"), "{text}");
    let (code, text) = run(&Workspace::new(&bug.replace("'fail'", "'safe_stop'")));
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("expect.exit_code = 1: expect.verdict has the exit code 5"), "{text}");
}

#[test]
fn a_trigger_that_never_came_leaves_the_requirement_untested() {
    let workspace = Workspace::new(
        "duration_s = 0.5
         [[require]]
         name = 'stops'
         when = 'master.following_error'
         then = 'controller.state == safe_stop'
         within = '20 ms'",
    );
    let (code, text) = run(&workspace);
    assert_eq!(code, Some(1), "{text}");
    assert!(
        text.contains("UNTESTED: stops: ") && text.contains("master.following_error never came"),
        "{text}"
    );
    assert!(read(&workspace, "junit.xml").contains("<skipped message=\"untested: "));
}

#[test]
fn a_wrong_requirement_is_refused_before_anything_starts() {
    for (requirement, expected) in [
        (
            "signal = 'incisal.eror'\nmax = '1 mm'",
            "scenario.toml:3:1: require.signal: require 'it': there is no signal 'incisal.eror'",
        ),
        (
            "signal = 'vz'\nmax = 1",
            "there is no signal 'vz'; masseter signals lists them; one that your program declares is 'signal.vz'",
        ),
        ("signal = 'incisal.error'\nmax = '1 N'", "give a number with one of the units m, mm"),
        ("never = 'runing'", "'runing' is no occurrence"),
        (
            "never = 'fault.deaf'",
            "scenario.toml:3:1: require.never: require 'it': 'fault.deaf' is no occurrence",
        ),
        ("signal = 'l1.force'", "scenario.toml:1:1: require.max: require 'it': give min, max or both"),
        (
            "expression = '{l1.force} * {l1.velocity}'\nunit = 'N'\nmax = '1 N'",
            "scenario.toml:3:1: require.expression: require 'it': '{l1.force} * {l1.velocity}': its unit is W, not 'N'",
        ),
    ] {
        let workspace = Workspace::new(&format!("[[require]]\nname = 'it'\n{requirement}"));
        let (code, text) = run(&workspace);
        assert_eq!(code, Some(2), "{requirement}: {text}");
        assert!(text.contains(expected), "{requirement}: {text}");
    }
}

#[test]
fn requirements_can_use_the_signals_and_parameters_of_a_controller() {
    let workspace = Workspace::new(
        "duration_s = 1.0
         [[require]]
         name = 'gain'
         signal = 'parameter.integral_gain_per_s'
         min = 1
         max = 100",
    );
    let (code, text) = run(&workspace);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn the_share_of_a_core_is_a_signal_of_real_time() {
    let requirement = "
        [[require]]
        name = 'the controller is idle'
        signal = 'controller.cpu'
        during = 'running'
        statistic = 'mean'
        max = '90 %'";
    let (code, text) = run(&Workspace::new(&format!("duration_s = 0.5\n{requirement}")));
    assert_eq!(code, Some(1), "{text}");
    let why = "UNTESTED: the controller is idle: ";
    assert!(text.contains(why) && text.contains("simulated time takes no share of a core"), "{text}");
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 0.5\n{LENIENT}\n{requirement}"));
    let output = workspace.run(&cores, &["--quiet"]);
    let summary = workspace.summary();
    let margin = check(&summary, "the controller is idle")["margin"].as_f64();
    assert!(margin.is_some_and(|margin| margin < 90.0), "{margin:?}: {}", stdout(&output));
}

#[test]
fn a_fault_of_a_process_is_an_occurrence() {
    let workspace = Workspace::new(
        "duration_s = 1.0
         [[faults]]
         kind = 'plant_stall'
         size = '5 ms'
         at_s = 0.3
         [[require]]
         name = 'it strikes'
         event = 'fault.plant_stall'
         at_least = 1
         [[require]]
         name = 'it ends'
         order = ['fault.plant_stall', 'fault.plant_stall.ended']",
    );
    let output = workspace.run_simulated("lockstep", &["--quiet"]);
    assert_eq!(output.status.code(), Some(0), "{}", stdout(&output));
}

#[test]
fn a_stimulus_that_never_begins_leaves_the_run_untested() {
    let workspace = Workspace::new("duration_s = 0.5\n[[stimulus]]\nat_s = 50.0\npush_n = [0.0, 0.0, 5.0]");
    let (code, text) = run(&workspace);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains("UNTESTED: stimuli: 0 of 1 stimuli began, number 1 never"), "{text}");
}

/// A CI system that reads the file alone sees what the exit code says.
#[test]
fn junit_agrees_with_the_exit_code() {
    let unmet = Workspace::new("duration_s = 0.5\n[expect]\nverdict = 'safe_stop'");
    assert_eq!(run(&unmet).0, Some(1));
    let junit = read(&unmet, "junit.xml");
    assert!(
        junit.contains("errors=\"1\"") && junit.contains("<error message=\"FAIL: expected SAFE STOP"),
        "{junit}"
    );

    let met = Workspace::new(
        "duration_s = 0.5\nchecks.tracking_max_mm = 0.0001\n[expect]\nverdict = 'fail'\n\
         failed = ['tracking', 'estimated tracking']",
    );
    assert_eq!(run(&met).0, Some(0));
    let junit = read(&met, "junit.xml");
    assert!(
        !junit.contains("<failure") && junit.contains("failures=\"0\"") && junit.contains("as expected: "),
        "{junit}"
    );
}
