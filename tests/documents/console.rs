//! The console blocks of a document: what a user types after `$ `, and what the user then sees.
//!
//! A line that begins with `> ` continues a command. The output is that of the document, sign by sign; `…` takes the place
//! of any text, and alone in a line that of any lines.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};

const ANY: &str = "…";
/// Ends the output of a command, before the command's exit code.
const MARK: &str = "\u{1}exit code ";

/// A command, and the output below it.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Step {
    command: String,
    shown: String,
}

/// The steps of all console blocks, in their order.
pub(super) fn steps(document: &str) -> Vec<Step> {
    let blocks = document.split("```console\n").skip(1);
    let lines = blocks.flat_map(|block| block.split("```").next().unwrap().lines());
    let mut steps: Vec<Step> = Vec::new();
    for line in lines {
        if let Some(command) = line.strip_prefix("$ ") {
            steps.push(Step { command: command.to_owned(), shown: String::new() });
            continue;
        }
        let step = steps.last_mut().expect("a console block begins with a command");
        match line.strip_prefix("> ") {
            Some(more) if step.shown.is_empty() => write!(step.command, "\n{more}").unwrap(),
            _ if line == ANY => step.shown += ANY,
            _ => writeln!(step.shown, "{line}").unwrap(),
        }
    }
    steps
}

/// Runs the steps in one shell, in this folder. Returns what went otherwise than the document says.
pub(super) fn differences(steps: &[Step], folder: &Path, programs: &Path) -> Vec<String> {
    let mut script = "exec 2>&1\n".to_owned();
    for step in steps {
        writeln!(script, "{}\nprintf '{MARK}%d\\n' $?", step.command).unwrap();
    }
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    let mut shell = Command::new("sh");
    shell.args(["-c", &script]).current_dir(folder).stdin(Stdio::null());
    shell.env("PATH", path).env("NO_COLOR", "1");
    // The reader's cargo compiles as cargo does: another compiler would compile every dependency again.
    shell.env_remove("RUSTC_WORKSPACE_WRAPPER").env_remove("CLIPPY_ARGS");
    let output = shell.output().expect("a shell starts");
    let text = String::from_utf8_lossy(&output.stdout);
    let mut rest = text.as_ref();
    let mut next = || {
        let (output, after) = rest.split_once(MARK)?;
        let (code, after) = after.split_once('\n')?;
        rest = after;
        Some((output, code))
    };
    let difference = |step: &Step| match next() {
        Some((output, "0")) if is_shown(&step.shown, output) => None,
        Some((output, code)) => Some(format!("$ {}\n{output}(exit code {code})", step.command)),
        None => Some(format!("$ {}\n(the shell ended before it)", step.command)),
    };
    steps.iter().filter_map(difference).collect()
}

/// Whether the document shows this output.
fn is_shown(shown: &str, output: &str) -> bool {
    let pieces: Vec<_> = shown.split(ANY).collect();
    let [first, between @ .., last] = &pieces[..] else { return shown == output };
    let Some(mut rest) = output.strip_prefix(first) else { return false };
    for piece in between {
        let Some(at) = rest.find(piece) else { return false };
        rest = &rest[at + piece.len()..];
    }
    rest.ends_with(last)
}

#[test]
fn a_transcript_that_differs_is_found() {
    let document = "Text\n```console\n$ echo one; echo two\none\n…\n$ echo \\\n>   three\nthree\n```\n\
        ```sh\n$ ignored\n```\n\n```console\n$ false\n$ echo 4; exit 9\n$ echo never\n```\n";
    let found = steps(document);
    assert_eq!(found[1].command, "echo \\\n  three");
    assert_eq!(found.len(), 5, "{found:?}");
    let differences = differences(&found, &std::env::temp_dir(), Path::new("/"));
    let expected = [
        "$ false\n(exit code 1)",
        "$ echo 4; exit 9\n(the shell ended before it)",
        "$ echo never\n(the shell ended before it)",
    ];
    assert_eq!(differences, expected);
}

#[test]
fn an_ellipsis_takes_the_place_of_any_text() {
    for (shown, output, expected) in [
        ("", "", true),
        ("", "a\n", false),
        ("a\nb\n", "a\nb\n", true),
        ("a\n", "a\nb\n", false),
        ("b\n", "a\nb\n", false),
        ("a\n…", "a\nb\nc\n", true),
        ("a\n…", "a\n", true),
        ("a\n…", "ab\n", false),
        ("a\n…b\n", "a\nb\n", true),
        ("…b\n…", "a\nb\n\nc\n", true),
        ("rms … mm, limit …\n", "rms 0.1 mm, limit 2\n", true),
        ("rms … mm, limit …1\n", "rms 0.1 mm, limit 2\n", false),
        ("a…a\n", "a\n", false),
    ] {
        assert_eq!(is_shown(shown, output), expected, "{shown:?}, {output:?}");
    }
}
