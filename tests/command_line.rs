//! What the command line offers besides its verbs' work: units, colour, completions, manual pages.

use std::fs;
use std::io::Write;
use std::process::{Command, Stdio};

use crate::common::{MASSETER, Workspace, masseter, stderr, stdout};

#[test]
fn a_duration_without_a_unit_is_in_seconds() {
    for (duration, expected_s) in [("1", 1.0), ("1.5", 1.5), ("1500ms", 1.5)] {
        let workspace = Workspace::new("");
        let output = workspace.run_virtual(&["--duration", duration]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert_eq!(workspace.manifest()["motion_s"], expected_s, "{duration}");
    }
}

#[test]
fn the_similar_table_is_suggested() {
    let workspace = Workspace::new("duration_s = 0.5");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let (run, out) = (workspace.run_folder(), workspace.file("tables"));
    let arguments = ["export", run.to_str().unwrap(), "--table", "States", "--out"];
    let output = masseter(&[&arguments[..], &[out.to_str().unwrap()]].concat());
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("did you mean 'state'?"), "{}", stderr(&output));
}

#[test]
fn words_are_coloured_where_that_is_asked_for() {
    let is_coloured = |arguments: &[&str], force: &str| {
        let mut doctor = Command::new(MASSETER);
        let output =
            doctor.args(arguments).env_remove("NO_COLOR").env("CLICOLOR_FORCE", force).output().unwrap();
        assert!(stdout(&output).contains("ok"), "{}", stderr(&output));
        stdout(&output).contains("\u{1b}[32mok\u{1b}[0m")
    };
    for (arguments, force, expected) in [
        (&["doctor"][..], "", false),
        (&["doctor"], "1", true),
        (&["doctor", "--color", "always"], "", true),
        (&["--color=never", "doctor"], "1", false),
        (&["doctor", "--format", "json", "--color", "always"], "", false),
    ] {
        assert_eq!(is_coloured(arguments, force), expected, "{arguments:?}, CLICOLOR_FORCE={force}");
    }
}

#[test]
fn completions_are_a_script_of_their_shell() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = stdout(&masseter(&["completions", shell]));
        assert!(script.contains("campaign") && script.contains("duration"), "{shell}: {script}");
    }
    let mut bash = Command::new("bash").arg("-n").stdin(Stdio::piped()).spawn().unwrap();
    let script = masseter(&["completions", "bash"]).stdout;
    bash.stdin.take().unwrap().write_all(&script).unwrap();
    assert!(bash.wait().unwrap().success());
}

#[test]
fn every_visible_verb_has_a_manual_page() {
    let workspace = Workspace::new("");
    let folder = workspace.file("man1");
    for _ in 0..2 {
        let output = masseter(&["man", "--out", folder.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    }
    let has = |name: &str| folder.join(name).exists();
    assert!(has("masseter.1") && has("masseter-run.1") && has("masseter-can-plan.1"));
    assert!(!has("masseter-recorder.1") && !has("masseter-campaign-case.1"));
    let page = fs::read_to_string(folder.join("masseter-run.1")).unwrap();
    assert!(
        page.contains("CHOOSE WHAT TO PLAY") && page.contains("masseter run \\-\\-duration 30"),
        "{page}"
    );
    assert!(stdout(&masseter(&["man"])).contains(".TH masseter 1"));
}
