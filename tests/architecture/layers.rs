//! Layers: dependencies between the crates of the workspace.

use std::path::Path;

use super::workspace::{list, metadata, text, within};

/// The crates of the workspace that each crate may use, all by their folders. The root package may use all
/// but the programs that a run does not need.
const MAY_USE: [(&str, &[&str]); 27] = [
    ("shared/can", &[]),
    ("shared/model", &[]),
    ("shared/scenario", &["shared/can", "shared/model"]),
    // Asks for features of crates of others, and has no code.
    ("shared/features", &[]),
    ("shared/runtime", &["shared/can", "shared/features", "shared/model", "shared/scenario"]),
    // Stands in for a crate of crates.io.
    ("shared/no_bindgen", &[]),
    ("controller", &["shared/can", "shared/model", "shared/scenario", "shared/runtime"]),
    ("rig/bindings/c", &["shared/model", "shared/runtime", "controller"]),
    (
        "rig/bindings/python",
        &["shared/model", "shared/scenario", "shared/runtime", "controller", "rig/record/recording"],
    ),
    ("plant", &["shared/can", "shared/model", "shared/scenario", "shared/runtime"]),
    ("rig/show/terminal", &[]),
    ("rig/show/charts", &[]),
    ("rig/show/page", &[]),
    ("rig/record/table", &[]),
    ("rig/record/parquet", &["rig/record/table", "rig/show/terminal"]),
    ("rig/run/plan", &["shared/model", "shared/scenario", "shared/runtime", "controller", "plant"]),
    ("rig/record/recording", &["shared/model", "shared/scenario", "shared/runtime"]),
    (
        "rig/judge",
        &[
            "shared/can",
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "controller",
            "rig/record/recording",
            // Exit codes.
            "rig/show/terminal",
        ],
    ),
    (
        "rig/show/report",
        &[
            "shared/can",
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "controller",
            "rig/record/recording",
            "rig/judge",
            "rig/show/page",
            "rig/show/terminal",
        ],
    ),
    ("rig/run/machine", &["shared/scenario", "shared/runtime", "rig/record/recording"]),
    (
        "rig/run/recorder",
        &[
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "rig/run/machine",
            "rig/record/recording",
            "rig/judge",
            "rig/show/report",
            "rig/show/page",
            "rig/show/terminal",
        ],
    ),
    (
        "rig/record/verbs",
        &[
            "shared/scenario",
            "shared/runtime",
            "rig/record/recording",
            "rig/judge",
            "rig/show/report",
            "rig/record/table",
            "rig/show/terminal",
        ],
    ),
    (
        "rig/run/virtual_time",
        &[
            "shared/scenario",
            "shared/runtime",
            "controller",
            "plant",
            "rig/run/plan",
            "rig/record/recording",
            "rig/judge",
            "rig/show/terminal",
        ],
    ),
    (
        "rig/research",
        &[
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "controller",
            "rig/run/plan",
            "rig/run/machine",
            "rig/record/recording",
            "rig/judge",
            "rig/run/virtual_time",
            "rig/show/terminal",
        ],
    ),
    (
        "rig/vary/campaign",
        &["shared/scenario", "shared/runtime", "rig/judge", "rig/show/charts", "rig/record/table"],
    ),
    // Its drive is none of the product's, or errors of master and drive could cancel out.
    ("tests/canopen_node", &["shared/can"]),
    (
        "fuzz",
        &[
            "shared/can",
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "controller",
            "rig/record/recording",
        ],
    ),
];

fn may_use(folder: &str, needed: &str) -> bool {
    if folder.is_empty() {
        return !["rig/record/parquet", "rig/research"].contains(&needed);
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

/// What a crate depends on outside of its tests.
pub(super) fn dependencies_of(workspace: &Path, crate_name: &str) -> Vec<String> {
    let metadata = metadata(workspace);
    let mut packages = list(&metadata["packages"]).iter();
    let package = packages.find(|package| package["name"] == crate_name).expect("a crate of the workspace");
    let for_use = list(&package["dependencies"]).iter().filter(|dependency| dependency["kind"] != "dev");
    for_use.map(|dependency| text(&dependency["name"]).to_owned()).collect()
}
