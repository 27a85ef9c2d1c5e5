//! Tells the rig a digest of the sources that a state and its bytes depend on: files of snapshots carry it.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Where these sources are, from this package: its own, and those of the plant and of every crate below the plant.
const FOLDERS: [&str; 10] = [
    "src",
    "../../../plant/drives/src",
    "../../../plant/src",
    "../../../shared/can/src",
    "../../../shared/domain/src",
    "../../../shared/features/src",
    "../../../shared/messages/src",
    "../../../shared/model/src",
    "../../../shared/runtime/src",
    "../../../shared/scenario/src",
];
/// The releases of the crates below.
const LOCK: &str = "../../../Cargo.lock";

fn main() -> io::Result<()> {
    let mut files = vec![PathBuf::from(LOCK)];
    for folder in FOLDERS {
        add_files(Path::new(folder), &mut files)?;
    }
    files.sort();
    let mut digest = DefaultHasher::new();
    for file in files {
        println!("cargo::rerun-if-changed={}", file.display());
        fs::read(&file)?.hash(&mut digest);
    }
    println!("cargo::rustc-env=MASSETER_SOURCES={:016x}", digest.finish());
    Ok(())
}

/// The files below a folder, but for those of tests.
fn add_files(folder: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.file_stem().is_some_and(|stem| stem == "tests") {
            continue;
        }
        if path.is_dir() {
            add_files(&path, files)?;
        } else {
            files.push(path);
        }
    }
    Ok(())
}
