//! Every scenario in `examples/` plays as it stands, also where `masseter init` lays it down.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Workspace, json, masseter, stderr, stdout};

fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files.filter(|path| path.extension().is_some_and(|extension| extension == "toml")).collect()
}

#[test]
fn every_example_passes_under_virtual_time() {
    let examples = examples();
    assert!(!examples.is_empty());
    for example in examples {
        let place = tempfile::tempdir().unwrap();
        let out = place.path().join("run");
        let [scenario, folder] = [&example, &out].map(|path| path.to_str().unwrap());
        let output = masseter(&["run", "--clock", "virtual", "--out", folder, scenario]);
        assert_eq!(output.status.code(), Some(0), "{scenario}: {}{}", stdout(&output), stderr(&output));
        let samples = &json(&out.join("summary.json"))["figures"]["tracking"]["samples"];
        assert!(samples.as_u64().is_some_and(|samples| samples >= 500), "{scenario}: {samples} samples");
    }
}

#[test]
fn init_lays_down_what_its_next_command_plays() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("new").join("rig");
    let output = masseter(&["init", folder.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let said = stdout(&output);
    let next = said.lines().last().and_then(|line| line.strip_prefix("next: masseter ")).expect(&said);
    let out = place.path().join("run");
    let clock = ["--clock", "lockstep", "--out", out.to_str().unwrap()];
    let output = masseter(&[&next.split_whitespace().collect::<Vec<_>>()[..], &clock].concat());
    assert_eq!(output.status.code(), Some(0), "{next}: {}{}", stdout(&output), stderr(&output));
    assert_eq!(json(&out.join("summary.json"))["verdict"]["word"], "PASS");
}

#[test]
fn init_replaces_nothing() {
    let workspace = Workspace::new("seed = 7");
    let folder = workspace.file("");
    let output = masseter(&["init", folder.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("is not empty") && stderr(&output).contains("name a new folder"));
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
    assert_eq!(fs::read_to_string(workspace.file("scenario.toml")).unwrap(), "seed = 7");
    let empty = workspace.file("empty");
    fs::create_dir(&empty).unwrap();
    assert_eq!(masseter(&["init", empty.to_str().unwrap()]).status.code(), Some(0));
    let file = workspace.file("scenario.toml");
    assert_eq!(masseter(&["init", file.to_str().unwrap()]).status.code(), Some(2), "a file is no folder");
}
