//! The documents lead to files that exist, and ARCHITECTURE.md to code that exists. What their console blocks show is
//! what a user sees.

#[path = "documents/console.rs"]
mod console;
#[path = "documents/interface.rs"]
mod interface;

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::thread;

use crate::common::demand_parquet;

fn project() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn documents() -> Vec<PathBuf> {
    let folders = [".", "docs", "docs/tutorials", "shared/can"].map(|folder| project().join(folder));
    let files =
        folders.iter().flat_map(|folder| fs::read_dir(folder).unwrap()).map(|entry| entry.unwrap().path());
    files.filter(|path| path.extension().is_some_and(|extension| extension == "md")).collect()
}

/// Text and target of every link.
fn links(text: &str) -> impl Iterator<Item = (&str, &str)> {
    text.match_indices("](").map(|(at, mark)| {
        let start = text[..at].rfind('[').map_or(0, |start| start + 1);
        let target = text[at + mark.len()..].split(')').next().unwrap();
        (&text[start..at], target)
    })
}

#[test]
fn every_link_leads_to_a_file_and_its_heading() {
    let documents = documents();
    assert!(documents.len() > 10, "{documents:?}");
    for document in documents {
        let text = fs::read_to_string(&document).unwrap();
        for (_, target) in links(&text).filter(|(_, target)| !target.contains("://")) {
            let (file, heading) = target.split_once('#').unwrap_or((target, ""));
            let path = if file.is_empty() { document.clone() } else { document.with_file_name(file) };
            assert!(path.exists(), "{}: {target}", document.display());
            assert!(heading.is_empty() || has_heading(&path, heading), "{}: {target}", document.display());
        }
    }
}

/// Whether a heading has this name in a link: lower case, hyphens for blanks, no other signs.
fn has_heading(document: &Path, name: &str) -> bool {
    let text = fs::read_to_string(document).unwrap();
    let headings =
        text.lines().filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches(['#', ' ']));
    let as_name = |heading: &str| -> String {
        let kept = heading.chars().filter(|sign| sign.is_alphanumeric() || matches!(sign, ' ' | '-' | '_'));
        kept.collect::<String>().to_lowercase().replace(' ', "-")
    };
    headings.map(as_name).any(|heading| heading == name)
}

/// "Follow one cycle through the code" names a function before the link to the file that has it.
#[test]
fn every_function_of_the_architecture_is_in_the_file_beside_it() {
    let text = fs::read_to_string(project().join("ARCHITECTURE.md")).unwrap();
    assert!(text.lines().count() <= 145, "{} lines", text.lines().count());
    let (_, walk) = text.split_once("## Follow one cycle through the code").unwrap();
    let (walk, _) = walk.split_once("\n## ").unwrap();
    let mut checked = 0;
    for (at, mark) in walk.match_indices("` in\n").chain(walk.match_indices("` in [")) {
        let name = walk[..at].rsplit('`').next().unwrap();
        let (_, target) = links(&walk[at + mark.len() - 1..]).next().unwrap();
        let code = fs::read_to_string(project().join(target)).unwrap();
        let function = name.rsplit("::").next().unwrap();
        let is_there = ["fn ", "struct "].iter().any(|kind| code.contains(&format!("{kind}{function}")));
        assert!(is_there, "{name} is not in {target}");
        checked += 1;
    }
    assert!(checked >= 15, "only {checked} functions were found");
}

/// The document whose commands install the Python package, which only CI's step `controllers` prepares.
const OF_CONTROLLERS: &str = "your-controller.md";

/// The commands of a document run one after the other in a folder of its own, beside the project's examples.
fn run(document: &Path) -> usize {
    let masseter = Path::new(env!("CARGO_BIN_EXE_masseter"));
    let steps = console::steps(&fs::read_to_string(document).unwrap());
    let folder = tempfile::tempdir().unwrap();
    symlink(project().join("examples"), folder.path().join("examples")).unwrap();
    let differences = console::differences(&steps, folder.path(), masseter.parent().unwrap());
    assert!(differences.is_empty(), "{}:\n{}", document.display(), differences.join("\n"));
    steps.len()
}

#[test]
fn every_console_block_shows_what_a_user_sees() {
    demand_parquet();
    let documents = documents().into_iter().filter(|document| !document.ends_with(OF_CONTROLLERS));
    let documents = Mutex::new(documents);
    let commands = AtomicUsize::new(0);
    // Two at a time: each document has a folder of its own.
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(document) = { documents.lock().unwrap().next() } {
                    commands.fetch_add(run(&document), Relaxed);
                }
            });
        }
    });
    let commands = commands.into_inner();
    assert!(commands >= 20, "only {commands} commands were found");
}

#[test]
#[ignore = "builds and installs the Python package"]
fn the_tutorial_of_a_controller_shows_what_a_user_sees() {
    let commands = run(&project().join("docs/tutorials").join(OF_CONTROLLERS));
    assert!(commands >= 10, "only {commands} commands were found");
}
