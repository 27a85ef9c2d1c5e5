//! The workspace as cargo describes it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

/// The workspace as `cargo metadata` describes it, without the dependencies' own dependencies.
pub(super) fn metadata(workspace: &Path) -> Value {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .args(["metadata", "--no-deps", "--offline", "--format-version", "1", "--manifest-path"])
        .arg(workspace.join("Cargo.toml"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

pub(super) fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

pub(super) fn text(value: &Value) -> &str {
    value.as_str().expect("a text")
}

/// The file or folder as seen from the workspace.
pub(super) fn within(workspace: &Path, path: &Path) -> String {
    let workspace = workspace.canonicalize().unwrap();
    path.canonicalize().unwrap().strip_prefix(workspace).unwrap().display().to_string()
}

/// The root files of all libraries and programs.
pub(super) fn crate_roots(workspace: &Path) -> BTreeSet<PathBuf> {
    let metadata = metadata(workspace);
    let packages = list(&metadata["packages"]).iter();
    let targets = packages.flat_map(|package| list(&package["targets"]));
    let is_crate = |target: &&Value| list(&target["kind"]).iter().any(|kind| kind == "lib" || kind == "bin");
    targets.filter(is_crate).map(|target| text(&target["src_path"]).into()).collect()
}
