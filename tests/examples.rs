//! Every scenario in `examples/` plays as it stands.

mod common;

use std::fs;
use std::path::{Path, PathBuf};

use common::{json, masseter, stderr, stdout};

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
        let output = masseter(&["run", "--clock", "virtual", "--duration", "2s", "--out", folder, scenario]);
        assert_eq!(output.status.code(), Some(0), "{scenario}: {}{}", stdout(&output), stderr(&output));
        let samples = &json(&out.join("summary.json"))["figures"]["tracking"]["samples"];
        assert!(samples.as_u64().is_some_and(|samples| samples >= 2000), "{scenario}: {samples} samples");
    }
}
