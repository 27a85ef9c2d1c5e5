//! The build that `masseter --version` prints: what states it, and how it follows the repository.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::SystemTime;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::{Workspace, masseter, stderr, stdout};

const VERSION: &str = env!("CARGO_PKG_VERSION");

#[test]
fn whatever_states_the_build_says_what_the_command_says() {
    let said = stdout(&masseter(&["--version"]));
    let build = said.trim_end().strip_prefix("masseter ").unwrap();
    assert!(build.starts_with(VERSION), "{said}");

    let workspace = Workspace::new("duration_s = 0.1");
    let played = workspace.run_virtual(&[]);
    assert_eq!(played.status.code(), Some(0), "{}", stderr(&played));
    assert_eq!(workspace.manifest()["masseter"], build);
    let in_run = |name: &str| fs::read_to_string(workspace.run_folder().join(name)).unwrap();
    let property = format!("<property name=\"masseter\" value=\"{build}\"/>");
    assert!(in_run("report.html").contains(&format!(" UTC, masseter {build}, virtual clock.")));
    assert!(in_run("junit.xml").contains(&property), "{}", in_run("junit.xml"));

    let (scenario, junit) = (workspace.file("scenario.toml"), workspace.file("suite.xml"));
    let out = workspace.file("suite");
    let [scenario, to, out] = [&scenario, &junit, &out].map(|path| path.to_str().unwrap());
    masseter(&["test", scenario, "--junit", to, "--out", out]);
    let junit = fs::read_to_string(junit).unwrap();
    assert!(junit.contains(&property), "{junit}");

    let examined: Value = serde_json::from_str(&stdout(&masseter(&["doctor", "--format", "json"]))).unwrap();
    assert_eq!(examined["masseter"], build);
    assert!(stdout(&masseter(&["doctor"])).starts_with(&said));
}

#[test]
fn a_run_of_another_build_is_replayed_and_named() {
    let workspace = Workspace::new("duration_s = 0.1");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let (run, manifest) = (workspace.run_folder(), workspace.run_folder().join("manifest.json"));
    let replay = || masseter(&["replay", run.to_str().unwrap()]);
    assert!(!stdout(&replay()).contains("recorded by"), "{}", stdout(&replay()));

    let mut known = workspace.manifest_without_digest();
    known["masseter"] = "0.1.0 (0123456789)".into();
    fs::write(manifest, known.to_string()).unwrap();
    let said = stdout(&masseter(&["--version"]));
    let replayed = replay();
    assert_eq!(replayed.status.code(), Some(0), "{}", stderr(&replayed));
    let named = format!(
        "; recorded by masseter 0.1.0 (0123456789), replayed by {}",
        said.strip_prefix("masseter ").unwrap()
    );
    assert!(stdout(&replayed).contains(&named), "{}", stdout(&replayed));
}

/// A small package with the command's build script, which cargo builds in a moment.
struct Planted {
    folder: TempDir,
    /// Where the sources are.
    sources: PathBuf,
}

impl Planted {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let sources = folder.path().join("sources");
        fs::create_dir_all(sources.join("rig")).unwrap();
        let package = format!(
            "[package]\nname = \"planted\"\nversion = \"{VERSION}\"\nedition = \"2024\"\nbuild = \"rig/build.rs\"\n\
             [[bin]]\nname = \"planted\"\npath = \"rig/main.rs\"\n[workspace]\n"
        );
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("rig/build.rs");
        fs::copy(script, sources.join("rig/build.rs")).unwrap();
        let planted = Self { folder, sources };
        planted.write("Cargo.toml", &package);
        planted.write("README.md", "");
        planted.write("rig/main.rs", "fn main() { print!(\"{}\", env!(\"MASSETER_BUILD\")) }\n");
        planted
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.sources.join(name), text).unwrap();
    }

    fn program(&self) -> PathBuf {
        self.folder.path().join("target/debug/planted")
    }

    /// Builds the program, and returns which build it says it is.
    fn build(&self, packagers_commit: Option<&str>) -> String {
        let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
        cargo.args(["build", "--quiet", "--offline"]).current_dir(&self.sources);
        cargo.env("CARGO_TARGET_DIR", self.folder.path().join("target")).env_remove("CARGO_BUILD_TARGET");
        match packagers_commit {
            Some(commit) => cargo.env("MASSETER_COMMIT", commit),
            None => cargo.env_remove("MASSETER_COMMIT"),
        };
        let built = cargo.output().unwrap();
        assert!(built.status.success(), "{}", stderr(&built));
        stdout(&Command::new(self.program()).output().unwrap())
    }

    /// Builds the program, and returns when it was compiled.
    fn compiled(&self) -> SystemTime {
        self.build(None);
        fs::metadata(self.program()).unwrap().modified().unwrap()
    }

    fn git(&self, arguments: &[&str]) -> String {
        let mut git = Command::new("git");
        let settings = ["user.name=a", "user.email=a@b", "commit.gpgsign=false", "core.autocrlf=false"];
        git.args(settings.iter().flat_map(|setting| ["-c", setting]));
        let output = git.args(arguments).current_dir(&self.sources).output().expect("git is installed");
        assert!(output.status.success(), "git {arguments:?}: {}", stderr(&output));
        stdout(&output).trim_end().to_owned()
    }

    /// Commits everything; returns the build that a program of this commit is.
    fn commit(&self) -> String {
        self.git(&["add", "--all"]);
        self.git(&["commit", "--quiet", "--message", "a commit"]);
        format!("{VERSION} ({})", self.git(&["rev-parse", "--short=10", "HEAD"]))
    }
}

fn modified(build: &str) -> String {
    build.replace(')', ", modified)")
}

#[test]
fn a_build_names_its_commit_and_whether_its_sources_differ_from_it() {
    let mut planted = Planted::new();
    assert_eq!(planted.build(None), VERSION, "an archive has no commit");
    assert_eq!(planted.build(Some("v1-3")), format!("{VERSION} (v1-3)"), "its packager names one");

    planted.git(&["init", "--quiet"]);
    let first = planted.commit();
    assert_eq!(planted.build(None), first);
    assert_eq!(planted.build(Some("v1-3")), first, "the repository knows better");

    planted.write("rig/main.rs", "// Edited.\nfn main() { print!(env!(\"MASSETER_BUILD\")) }\n");
    assert_eq!(planted.build(None), modified(&first));
    planted.git(&["add", "rig/main.rs"]);
    assert_eq!(planted.build(None), modified(&first), "a staged change is no commit");
    let second = planted.commit();
    assert_eq!(planted.build(None), second);

    planted.write("rig/main.rs", "fn main() {}\n");
    planted.build(None);
    planted.git(&["checkout", "--quiet", "rig/main.rs"]);
    assert_eq!(planted.build(None), second, "the change was taken back");

    planted.git(&["worktree", "add", "--quiet", "../worktree"]);
    planted.sources = planted.folder.path().join("worktree");
    assert_eq!(planted.build(None), second);
    planted.write("rig/more.rs", "");
    planted.git(&["pack-refs", "--all"]);
    let third = planted.commit();
    assert_eq!(planted.build(None), third);
}

#[test]
fn nothing_is_compiled_again_while_commit_and_sources_stay_the_same() {
    let planted = Planted::new();
    planted.git(&["init", "--quiet"]);
    planted.commit();
    let compiled = planted.compiled();
    assert_eq!(planted.compiled(), compiled);
    planted.write("README.md", "A document.");
    planted.git(&["add", "README.md"]);
    planted.git(&["status"]);
    assert_eq!(planted.compiled(), compiled);
    planted.commit();
    assert_ne!(planted.compiled(), compiled, "the build has a new commit");
}
