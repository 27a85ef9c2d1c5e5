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
    let folders =
        [".", "docs", "docs/tutorials", "notes", "plant/drives", "plant/src/master/logs", "shared/can"]
            .map(|folder| project().join(folder));
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
        let pictures = text.split("src=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
        let targets = links(&text).map(|(_, target)| target).chain(pictures);
        for target in targets.filter(|target| !target.contains("://")) {
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

#[test]
fn the_readme_is_short_and_the_contents_lead_to_every_document() {
    let readme = fs::read_to_string(project().join("README.md")).unwrap();
    let words = readme.split_whitespace().count();
    assert!(words <= 700, "{words} words");
    let contents = project().join("docs/README.md");
    let text = fs::read_to_string(&contents).unwrap();
    let linked: Vec<_> = links(&text).map(|(_, target)| target.split('#').next().unwrap()).collect();
    for document in documents() {
        let Ok(name) = document.strip_prefix(project().join("docs")) else { continue };
        let is_linked = document == contents || linked.iter().any(|target| Path::new(target) == name);
        assert!(is_linked, "docs/README.md has no link to {}", name.display());
    }
}

/// The Rust files of the product, each with its broken string literals joined.
fn sources(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension() == Some("rs".as_ref()) && !path.ends_with("tests.rs") {
            let text = fs::read_to_string(&path).unwrap();
            let product = text.split("\n#[cfg(test)]\nmod tests {").next().unwrap();
            let mut pieces = product.split("\\\n");
            let first = pieces.next().unwrap().to_owned();
            found.push(pieces.fold(first, |joined, piece| joined + piece.trim_start()));
        }
    }
    found
}

/// Whether the text has these pieces one after the other, close together.
fn has_in_order(text: &str, pieces: &[&str]) -> bool {
    const FARTHEST: usize = 400;
    let [first, others @ ..] = pieces else { return false };
    text.match_indices(first).any(|(at, _)| {
        let mut rest = &text[at + first.len()..];
        others.iter().all(|piece| match rest.find(piece) {
            Some(at) if at < FARTHEST => {
                rest = &rest[at + piece.len()..];
                true
            }
            _ => false,
        })
    })
}

/// The first column of a row is a message as the code writes it; `…` takes the place of values.
#[test]
fn every_message_of_the_troubleshooting_is_one_of_the_code() {
    let folders = ["shared", "controller", "plant", "rig"];
    let sources: Vec<_> = folders.iter().flat_map(|folder| sources(&project().join(folder))).collect();
    let text = fs::read_to_string(project().join("docs/troubleshooting.md")).unwrap();
    let rows: Vec<_> = text.lines().filter_map(|line| line.strip_prefix("| `")).collect();
    for row in &rows {
        let message = row.split('`').next().unwrap();
        let pieces: Vec<_> = message.split('…').filter(|piece| !piece.trim().is_empty()).collect();
        let is_there = sources.iter().any(|source| has_in_order(source, &pieces));
        assert!(is_there, "no file has the message: {message}");
    }
    assert!(rows.len() >= 30, "only {} messages were found", rows.len());
}

/// The text of all files in a folder.
fn code(path: &Path) -> String {
    if path.is_dir() {
        fs::read_dir(path).unwrap().map(|entry| code(&entry.unwrap().path())).collect()
    } else {
        fs::read_to_string(path).unwrap_or_default()
    }
}

#[test]
fn every_cell_of_the_table_of_services_is_a_test() {
    let text = fs::read_to_string(project().join("docs/can.md")).unwrap();
    let of_masters: [&[&str]; 3] =
        [&["plant/src", "plant/commissioning/src"], &["tests/drives"], &["plant/drives/tests"]];
    let of_masters =
        of_masters.map(|paths| paths.iter().map(|path| code(&project().join(path))).collect::<String>());
    let mut checked = 0;
    for row in interface::table(&text, "| service |") {
        assert_eq!(row.len(), 4, "{row:?}");
        for (cell, code) in row[1..].iter().zip(&of_masters) {
            for name in cell.split('`').skip(1).step_by(2) {
                let is_test = |place: usize| code[..place].trim_end().ends_with("#[test]");
                let of_rust = code.find(&format!("fn {name}(")).is_some_and(is_test);
                let of_python = name.starts_with("test_") && code.contains(&format!("def {name}("));
                assert!(of_rust || of_python, "{}: no test has the name {name}", row[0]);
                checked += 1;
            }
        }
    }
    assert!(checked >= 45, "only {checked} tests were found");
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
