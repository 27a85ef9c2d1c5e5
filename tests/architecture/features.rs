//! Features: cargo compiles a crate once for each set of features that the command, the C library and the Python package ask
//! for together with what they depend on.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

/// Crates of others with every set of features that a build compiles them with.
type Features = BTreeMap<String, BTreeSet<String>>;

/// One line for each crate of others that a binding compiles with other features than the command does.
pub(super) fn other_features(workspace: &Path, binding: &str) -> Vec<String> {
    let mut differing = Vec::new();
    // Programs that run while compiling have features of their own.
    for edges in ["normal,build", "normal,no-proc-macro"] {
        let command = features(workspace, "masseter", edges).expect("the command is compiled for its tests");
        // `None` if the crates of the binding were never downloaded.
        for (name, sets) in features(workspace, binding, edges).into_iter().flatten() {
            let Some(known) = command.get(&name) else { continue };
            differing
                .extend(sets.difference(known).map(|set| format!("{name}: {set} in {binding}, {known:?}")));
        }
    }
    differing
}

fn features(workspace: &Path, package: &str, edges: &str) -> Option<Features> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["tree", "--offline", "--prefix", "none", "--format", "{p}|{f}|", "--package", package])
        .args(["--edges", edges])
        .current_dir(workspace)
        .output()
        .unwrap();
    let tree = String::from_utf8(output.stdout).unwrap();
    let mut features = Features::new();
    for line in tree.lines() {
        let mut parts = line.split('|');
        if let (Some(name), Some(set)) = (parts.next(), parts.next()) {
            features.entry(name.replace(" (proc-macro)", "")).or_default().insert(set.to_owned());
        }
    }
    output.status.success().then_some(features)
}
