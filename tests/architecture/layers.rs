//! Layers: dependencies between the crates of the workspace.

use std::path::Path;

use super::workspace::{list, metadata, text, within};

/// The crates of the workspace that each crate may use, all by their folders. The root package may use all.
const MAY_USE: [(&str, &[&str]); 18] = [
    ("shared/can", &[]),
    ("shared", &["shared/can"]),
    ("controller", &["shared/can", "shared"]),
    ("shared/c", &["shared", "controller"]),
    ("shared/python", &["shared", "controller", "rig/recording"]),
    ("plant", &["shared/can", "shared"]),
    ("rig/terminal", &[]),
    ("rig/charts", &[]),
    ("rig/page", &[]),
    ("rig/table", &[]),
    ("rig/plan", &["shared", "controller", "plant"]),
    ("rig/recording", &["shared"]),
    ("rig/analysis", &["shared/can", "shared", "controller", "rig/recording"]),
    (
        "rig/report",
        &[
            "shared/can",
            "shared",
            "controller",
            "rig/recording",
            "rig/analysis",
            "rig/charts",
            "rig/page",
            "rig/terminal",
        ],
    ),
    ("rig/study", &["shared", "controller", "rig/plan", "rig/charts"]),
    ("rig/campaign", &["shared", "rig/analysis", "rig/charts", "rig/report", "rig/table"]),
    // Its drive is none of the product's, or errors of master and drive could cancel out.
    ("tests/canopen_node", &["shared/can"]),
    ("fuzz", &["shared/can", "shared", "controller", "rig/recording"]),
];

fn may_use(folder: &str, needed: &str) -> bool {
    let mut rows = MAY_USE.iter();
    folder.is_empty() || rows.any(|(user, used)| *user == folder && used.contains(&needed))
}

/// One line for each dependency that the table does not have.
pub(super) fn layer_violations(workspace: &Path) -> Vec<String> {
    let metadata = metadata(workspace);
    let folder_of = |manifest: &Path| within(workspace, manifest.parent().unwrap());
    let mut violations = Vec::new();
    for package in list(&metadata["packages"]) {
        let folder = folder_of(Path::new(text(&package["manifest_path"])));
        for dependency in list(&package["dependencies"]) {
            let Some(path) = dependency["path"].as_str() else { continue };
            let needed = within(workspace, Path::new(path));
            if !may_use(&folder, &needed) {
                let names = [&package["name"], &dependency["name"]].map(text);
                violations.push(format!("{} ({folder}/) depends on {} ({needed}/)", names[0], names[1]));
            }
        }
    }
    violations
}
