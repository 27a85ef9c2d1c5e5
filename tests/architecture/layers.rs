//! Layers: dependencies between the crates of the workspace, and between the folders of a crate.

use std::path::Path;

use super::imports::Crate;
use super::workspace::{crate_roots, list, metadata, text, within};

/// The crates of the workspace that each crate may use, all by their folders. The root package may use all
/// but the programs that a run does not need.
const MAY_USE: [(&str, &[&str]); 33] = [
    ("shared/can", &[]),
    ("shared/model", &[]),
    ("shared/scenario", &["shared/can", "shared/model"]),
    // Asks for features of crates of others, and has no code.
    ("shared/features", &[]),
    ("shared/messages", &["shared/can", "shared/model", "shared/scenario"]),
    ("shared/domain", &["shared/messages", "shared/scenario"]),
    (
        "shared/runtime",
        &[
            "shared/can",
            "shared/domain",
            "shared/features",
            "shared/messages",
            "shared/model",
            "shared/scenario",
        ],
    ),
    // Stands in for a crate of crates.io.
    ("shared/no_bindgen", &[]),
    // Files of motions are read without messages and without the mechanism's solutions.
    ("controller/recorded_motion", &["shared/model", "shared/scenario"]),
    (
        "controller",
        &["shared/can", "shared/model", "shared/scenario", "shared/runtime", "controller/recorded_motion"],
    ),
    ("rig/bindings/c", &["shared/model", "shared/runtime", "shared/scenario", "controller"]),
    ("rig/bindings/drives", &["shared/can", "shared/features", "plant/drives"]),
    (
        "rig/bindings/python",
        &[
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "controller",
            "rig/run/plan",
            "rig/record/recording",
            "rig/judge",
            "rig/run/virtual_time",
            "rig/record/recording",
            // For the source distribution.
            "shared/no_bindgen",
        ],
    ),
    ("plant/drives", &["shared/can"]),
    ("plant", &["shared/can", "shared/model", "shared/scenario", "shared/runtime", "plant/drives"]),
    (
        "plant/commissioning",
        &["shared/can", "shared/model", "shared/scenario", "shared/runtime", "plant/drives", "plant"],
    ),
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
            "controller/recorded_motion",
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
            "rig/record/table",
            "rig/show/charts",
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
        &[
            "shared/model",
            "shared/scenario",
            "shared/runtime",
            "rig/judge",
            "rig/show/page",
            "rig/record/table",
        ],
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

/// What a folder (or a file) of a crate may use beside itself.
pub(super) struct Room<'a> {
    pub(super) folder: &'a str,
    /// Crates of the workspace, by their names in code.
    pub(super) crates: &'a [&'a str],
    /// Folders and files of its own crate.
    pub(super) rooms: &'a [&'a str],
}

/// The rooms of the plant's simulator. The mechanism uses the equations, and reads teeth and food of the scenario. The
/// emulation turns the rest of the scenario into values of drives and mechanism, and uses nothing of the injection of faults.
pub(super) const ROOMS: [Room<'_>; 3] = [
    Room {
        folder: "plant/src/simulator/mechanism",
        // Of the runtime the messages alone.
        crates: &["masseter_model", "masseter_runtime", "masseter_scenario"],
        rooms: &["plant/src/error.rs"],
    },
    Room {
        folder: "plant/src/simulator/emulation",
        crates: &[
            "masseter_can",
            "masseter_drives",
            "masseter_model",
            "masseter_runtime",
            "masseter_scenario",
        ],
        rooms: &["plant/src/error.rs", "plant/src/master", "plant/src/simulator/mechanism"],
    },
    Room {
        folder: "plant/src/simulator/injection.rs",
        crates: &["masseter_runtime", "masseter_scenario"],
        rooms: &["plant/src/error.rs", "plant/src/master"],
    },
];

/// One line for each use that a room's entry does not have, and for each room that is not there.
pub(super) fn room_violations(workspace: &Path, rooms: &[Room<'_>]) -> Vec<String> {
    let mut violations = Vec::new();
    let mut seen = vec![false; rooms.len()];
    for root in crate_roots(workspace) {
        let read = Crate::read(&root);
        let (imports, named) = (read.imports(), read.named_crates());
        for (file, imported) in &imports {
            let name = within(workspace, file);
            let of_file =
                rooms.iter().zip(&mut seen).find(|(room, _)| Path::new(&name).starts_with(room.folder));
            let Some((room, seen)) = of_file else { continue };
            *seen = true;
            let named = named.get(file).into_iter().flatten().filter(|used| !room.crates.contains(used));
            violations.extend(named.map(|used| format!("{name} uses {used}")));
            let may_use = |other: &String| {
                let mut rooms = room.rooms.iter().chain([&room.folder]);
                rooms.any(|folder| Path::new(other).starts_with(folder))
            };
            let others = imported.keys().map(|other| within(workspace, other));
            violations
                .extend(others.filter(|other| !may_use(other)).map(|other| format!("{name} uses {other}")));
        }
    }
    let missing = rooms.iter().zip(seen).filter(|(_, seen)| !seen).map(|(room, _)| room.folder);
    let of_rooms = rooms.iter().flat_map(|room| room.rooms).copied();
    let missing = missing.chain(of_rooms.filter(|used| !workspace.join(used).exists()));
    violations.extend(missing.map(|path| format!("{path} is not there")));
    violations
}

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

/// The folders of a crate of the workspace and of all crates of the workspace that it stands on, sorted.
pub(super) fn folders_below(workspace: &Path, crate_name: &str) -> Vec<String> {
    let metadata = metadata(workspace);
    let packages = list(&metadata["packages"]);
    let (mut folders, mut names) = (Vec::new(), vec![crate_name.to_owned()]);
    while let Some(name) = names.pop() {
        let Some(package) = packages.iter().find(|package| package["name"] == name.as_str()) else {
            continue;
        };
        let manifest = Path::new(text(&package["manifest_path"]));
        let folder = within(workspace, manifest.parent().expect("a manifest is in a folder"));
        if !folders.contains(&folder) {
            folders.push(folder);
            names.extend(dependencies_of(workspace, &name));
        }
    }
    folders.sort();
    folders
}
