//! Files of source code that no module names: nothing compiles them.

use std::fs;
use std::path::{Path, PathBuf};

/// Folders whose files cargo finds by itself.
const OF_CARGO: [&str; 4] = ["benches", "examples", "fuzz_targets", "tests"];

/// The files below a folder that no `mod` leads to.
pub(super) fn orphans(folder: &Path) -> Vec<PathBuf> {
    let mut orphans = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let is_of_cargo =
            OF_CARGO.iter().any(|name| path.ends_with(name)) && folder.join("Cargo.toml").exists();
        if path.is_dir() && !is_of_cargo && !path.ends_with("target") {
            orphans.extend(self::orphans(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") && !is_named(&path) {
            orphans.push(path);
        }
    }
    orphans
}

/// Whether the file is the root of a crate, or the file of the module above has a `mod` of its name.
fn is_named(path: &Path) -> bool {
    // A `mod.rs` goes by the name of its folder.
    let module = if path.ends_with("mod.rs") { path.parent().unwrap() } else { path };
    let folder = module.parent().unwrap();
    let name = module.file_stem().and_then(|name| name.to_str()).unwrap();
    let is_in_root = [folder, folder.parent().unwrap()].iter().any(|above| above.join("Cargo.toml").exists());
    if is_in_root && ["lib", "main", "build"].contains(&name) {
        return true;
    }
    let above = ["mod.rs", "lib.rs", "main.rs"].map(|root| folder.join(root));
    // The module above may be a block in the file of the one above that.
    let files = folder.ancestors().take(2).map(|folder| folder.with_extension("rs"));
    let text: String =
        above.into_iter().chain(files).filter_map(|file| fs::read_to_string(file).ok()).collect();
    let is_mod = |line: &str| !line.trim_start().starts_with("//") && line.ends_with(&format!("mod {name};"));
    text.lines().any(is_mod)
}
