//! Layers: dependencies between the crates of the workspace.

use std::path::Path;

use super::workspace::{list, metadata, text, within};

/// The layer of a crate, by its folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layer {
    Can,
    Shared,
    Controller,
    Plant,
    /// Below `rig/`, with its place in `recording ← analysis ← report ← study` if it is one of these.
    Rig(Option<usize>),
    /// The root package: verbs, supervisor, recorder.
    Command,
}

impl Layer {
    fn of_folder(folder: &str) -> Self {
        const RIG: [&str; 4] = ["recording", "analysis", "report", "study"];
        let mut steps = folder.split('/');
        match (steps.next().unwrap_or_default(), steps.next()) {
            ("shared", Some("can")) => Self::Can,
            ("shared", _) => Self::Shared,
            ("controller", _) => Self::Controller,
            ("plant", _) => Self::Plant,
            ("rig", Some(part)) => Self::Rig(RIG.iter().position(|name| *name == part)),
            _ => Self::Command,
        }
    }

    /// Whether a crate of this layer may depend on one of the other.
    fn may_use(self, other: Self) -> bool {
        match (self, other) {
            (Self::Command, _) => true,
            (Self::Can, _) | (_, Self::Command) => false,
            (Self::Rig(Some(place)), Self::Rig(Some(below))) => below < place,
            (_, Self::Can | Self::Shared) | (Self::Rig(_), Self::Controller | Self::Plant | Self::Rig(_)) => {
                true
            }
            _ => self == other,
        }
    }
}

/// One line for each dependency that a layer forbids.
pub(super) fn layer_violations(workspace: &Path) -> Vec<String> {
    let metadata = metadata(workspace);
    let folder_of = |manifest: &Path| within(workspace, manifest.parent().unwrap());
    let mut violations = Vec::new();
    for package in list(&metadata["packages"]) {
        let folder = folder_of(Path::new(text(&package["manifest_path"])));
        for dependency in list(&package["dependencies"]) {
            let Some(path) = dependency["path"].as_str() else { continue };
            let needed = within(workspace, Path::new(path));
            if !Layer::of_folder(&folder).may_use(Layer::of_folder(&needed)) {
                let names = [&package["name"], &dependency["name"]].map(text);
                violations.push(format!("{} ({folder}/) depends on {} ({needed}/)", names[0], names[1]));
            }
        }
    }
    violations
}
