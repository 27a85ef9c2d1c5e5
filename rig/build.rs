//! Tells the command which build it is: version, commit, and whether its sources differ from the commit.
//!
//! The command passes that on to whatever states it, so a new commit recompiles this package and no other.

use std::{env, path::Path, process::Command};

/// What the command is made of. Other files, such as documents and tests, do not make a build "modified".
const SOURCES: [&str; 7] = ["Cargo.lock", "Cargo.toml", "controller", "examples", "plant", "rig", "shared"];
/// Names the commit where there is no repository.
const PACKAGERS_COMMIT: &str = "MASSETER_COMMIT";
/// What git changes with the commit, beside the branch. It rewrites the index more often, such as for `git status`.
const OF_HEAD: [&str; 3] = ["HEAD", "logs/HEAD", "reftable/tables.list"];

fn main() {
    println!("cargo::rerun-if-env-changed={PACKAGERS_COMMIT}");
    let packagers = || env::var(PACKAGERS_COMMIT).ok().filter(|commit| !commit.is_empty());
    let commit = commit_of_repository().or_else(packagers);
    let commit = commit.map_or_else(String::new, |commit| format!(" ({commit})"));
    println!("cargo::rustc-env=MASSETER_BUILD={}{commit}", env!("CARGO_PKG_VERSION"));
}

/// The commit, and whether the sources differ from it. None for an archive of the sources, or without git.
fn commit_of_repository() -> Option<String> {
    let tracked = git(&["ls-files", "-z", "--"], &SOURCES)?;
    if tracked.is_empty() {
        // It is an archive, unpacked in another repository.
        return None;
    }
    let commit = git(&["rev-parse", "--short=10", "HEAD"], &[])?;
    let branch = git(&["rev-parse", "--symbolic-full-name", "HEAD"], &[])?;
    tracked.split_terminator('\0').for_each(watch);
    for name in OF_HEAD.iter().chain([&branch.as_str()]) {
        watch(&git(&["rev-parse", "--git-path", name], &[])?);
    }
    let modified = git(&["diff", "--name-only", "HEAD", "--"], &SOURCES)?;
    Some(if modified.is_empty() { commit } else { commit + ", modified" })
}

/// Runs this script again when the file changes. Cargo would run it every time for a file that does not exist.
fn watch(path: &str) {
    if Path::new(path).exists() {
        println!("cargo::rerun-if-changed={path}");
    }
}

/// What git answers in the folder of this package. It takes no lock, so it disturbs no other git.
fn git(arguments: &[&str], paths: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("--no-optional-locks").args(arguments).args(paths).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim_end().to_owned())
}
