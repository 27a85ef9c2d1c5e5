//! What becomes of results when standard output cannot take them.

mod common;

use std::fs::File;
use std::io;
use std::process::{Command, Stdio};

use common::{MASSETER, Workspace, stderr};

#[test]
fn results_that_cannot_be_written_are_no_success_and_a_reader_that_had_enough_is_no_failure() {
    let workspace = Workspace::new("duration_s = 0.5");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let folder = workspace.run_folder();
    let folder = folder.to_str().unwrap();
    let verbs: [&[&str]; 7] = [
        &["can", "plan"],
        &["can", "dbc"],
        &["log", "info", folder],
        &["log", "verify", folder],
        &["report", folder, folder],
        &["uniqueness", "search", "--inputs", "10"],
        &["bench", "fk", "--rounds", "1", "--format", "json"],
    ];
    for verb in verbs {
        let into = |output: Stdio| {
            let output = Command::new(MASSETER).args(verb).stdout(output).output().unwrap();
            (output.status.code(), stderr(&output))
        };
        let (code, said) = into(File::options().write(true).open("/dev/full").unwrap().into());
        assert_eq!(code, Some(2), "{verb:?}: {said}");
        assert!(said.contains("cannot write standard output: No space left on device"), "{verb:?}: {said}");
        let (reader, writer) = io::pipe().unwrap();
        drop(reader);
        let (code, said) = into(writer.into());
        // The machine may be too disturbed for a bench.
        assert!(matches!(code, Some(0 | 3)), "{verb:?}: {said}");
    }
}
