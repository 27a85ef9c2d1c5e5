//! Layers: dependencies between the crates of the workspace.

use std::path::Path;

use super::workspace::{list, metadata, text, within};

/// The crates of the workspace that each crate may use, all by their folders. The root package may use all
/// but the programs that a run does not need.
const MAY_USE: [(&str, &[&str]); 26] = [
    ("shared/can", &[]),
    ("shared/model", &[]),
    ("shared/scenario", &["shared/can", "shared/model"]),
    ("shared/runtime", &["shared/can", "shared/model", "shared/scenario"]),
    // Stands in for a crate of crates.io.
    ("shared/no_bindgen", &[]),
    ("controller", &["shared/can", "shared/model", "shared/scenario", "shared/runtime"]),
    ("shared/c", &["shared/model", "shared/runtime", "controller"]),
    ("shared/python", &["shared/model", "shared/scenario", "shared/runtime", "controller", "rig/recording"]),
    ("plant", &["shared/can", "shared/model", "shared/scenario", "shared/runtime"]),
    ("rig/terminal", &[]),
    ("rig/charts", &[]),
    ("rig/page", &[]),
    ("rig/table", &[]),
    ("rig/parquet", &["rig/table", "rig/terminal"]),
    ("rig/plan", &["shared/model", "shared/scenario", "shared/runtime", "controller", "plant"]),
    ("rig/recording", &["shared/model", "shared/scenario", "shared/runtime"]),
    (
        "rig/analysis",
        &["shared/can", "shared/model", "shared/scenario", "shared/runtime", "controller", "rig/recording"],
    ),
    (
        "rig/report",
        &[
            "shared/can",
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "controller",
            "rig/recording",
            "rig/analysis",
            "rig/page",
            "rig/terminal",
        ],
    ),
    ("rig/machine", &["shared/scenario", "shared/runtime", "rig/recording"]),
    (
        "rig/recorder",
        &[
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "rig/machine",
            "rig/recording",
            "rig/analysis",
            "rig/report",
            "rig/page",
            "rig/terminal",
        ],
    ),
    (
        "rig/recordings",
        &[
            "shared/scenario",
            "shared/runtime",
            "rig/recording",
            "rig/analysis",
            "rig/report",
            "rig/table",
            "rig/terminal",
        ],
    ),
    (
        "rig/virtual_time",
        &[
            "shared/scenario",
            "shared/runtime",
            "controller",
            "plant",
            "rig/plan",
            "rig/recording",
            "rig/analysis",
            "rig/terminal",
        ],
    ),
    (
        "rig/research",
        &[
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "controller",
            "rig/plan",
            "rig/machine",
            "rig/recording",
            "rig/analysis",
            "rig/virtual_time",
            "rig/charts",
            "rig/terminal",
        ],
    ),
    (
        "rig/campaign",
        &["shared/scenario", "shared/runtime", "rig/analysis", "rig/charts", "rig/report", "rig/table"],
    ),
    // Its drive is none of the product's, or errors of master and drive could cancel out.
    ("tests/canopen_node", &["shared/can"]),
    (
        "fuzz",
        &["shared/can", "shared/model", "shared/scenario", "shared/runtime", "controller", "rig/recording"],
    ),
];

fn may_use(folder: &str, needed: &str) -> bool {
    if folder.is_empty() {
        return !["rig/parquet", "rig/research"].contains(&needed);
    }
    let mut rows = MAY_USE.iter();
    rows.any(|(user, used)| *user == folder && used.contains(&needed))
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
