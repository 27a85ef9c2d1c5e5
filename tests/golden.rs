//! Golden runs: the scenarios of `tests/golden` still give the messages that were recorded of them.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Workspace, masseter, stderr, stdout};

/// Bytes that the recordings may take in the repository.
const MOST_BYTES: u64 = 300_000;

fn golden(extension: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    files.filter(|file| file.extension().is_some_and(|found| found == extension)).collect()
}

#[test]
fn every_golden_scenario_gives_the_messages_that_were_recorded() {
    let scenarios = golden("toml");
    assert!(scenarios.len() >= 5, "{scenarios:?}");
    let differences: String = scenarios.iter().filter_map(|scenario| difference(scenario)).collect();
    assert!(
        differences.is_empty(),
        "{differences}If the change is meant: 'scripts/golden --renew' replaces the recordings; name the reason in the commit."
    );
}

/// Plays a scenario; what differs from its recording, if anything does.
fn difference(scenario: &Path) -> Option<String> {
    let workspace = Workspace::new(&fs::read_to_string(scenario).unwrap());
    let played = workspace.run_virtual(&["--quiet"]);
    let (recording, run) = (scenario.with_extension("mcap"), workspace.run_folder());
    let compared = masseter(&["diff", recording.to_str().unwrap(), run.to_str().unwrap()]);
    let name = scenario.file_stem().unwrap().display();
    let said = [stderr(&played), stdout(&compared), stderr(&compared)].concat();
    (compared.status.code() != Some(0)).then(|| format!("{name} (A: golden, B: this build)\n{said}\n"))
}

#[test]
fn the_golden_recordings_are_small() {
    let bytes: u64 = golden("mcap").iter().map(|file| fs::metadata(file).unwrap().len()).sum();
    assert!((1..=MOST_BYTES).contains(&bytes), "{bytes} bytes");
}
