//! Results that standard output cannot take: a full disk is exit code 6, a closed pipe is no failure.

use std::fs::File;
use std::io;
use std::process::{Command, Stdio};

use crate::common::{MASSETER, Workspace, stderr};

#[test]
fn a_full_disk_behind_standard_output_is_exit_6_and_a_closed_pipe_is_no_failure() {
    let workspace = Workspace::new("duration_s = 0.5");
    assert_eq!(workspace.run_virtual(&[]).status.code(), Some(0));
    let folder = workspace.run_folder();
    let folder = folder.to_str().unwrap();
    let poses = workspace.write("poses.csv", "x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0.27,1,0,0,0\n");
    let verbs: [&[&str]; 10] = [
        &["interface", "c"],
        &["ik", "--input", poses.to_str().unwrap()],
        &["doctor", "--format", "json"],
        &["can", "plan"],
        &["can", "dbc"],
        &["recording", "info", folder],
        &["recording", "verify", folder],
        &["report", folder, folder],
        &["report", folder, "--format", "json"],
        &["report", folder],
    ];
    for verb in verbs {
        let into = |output: Stdio| {
            let output = Command::new(MASSETER).args(verb).stdout(output).output().unwrap();
            (output.status.code(), stderr(&output))
        };
        let (code, said) = into(File::options().write(true).open("/dev/full").unwrap().into());
        assert_eq!(code, Some(6), "{verb:?}: {said}");
        assert!(said.contains("cannot write standard output: No space left on device"), "{verb:?}: {said}");
        let (reader, writer) = io::pipe().unwrap();
        drop(reader);
        let (code, said) = into(writer.into());
        // The machine may be unfit for real time.
        assert!(matches!(code, Some(0 | 3)), "{verb:?}: {said}");
    }
}

#[test]
fn a_run_whose_result_nobody_could_read_is_exit_6_and_leaves_its_files() {
    for format in ["json", "human"] {
        let workspace = Workspace::new("duration_s = 0.5");
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut run = Command::new(MASSETER);
        run.args(["run", "--clock", "virtual", "--format", format, "--out"]).arg(workspace.run_folder());
        let output = run.arg(workspace.file("scenario.toml")).stdout(full).output().unwrap();
        assert_eq!(output.status.code(), Some(6), "{format}: {}", stderr(&output));
        assert_eq!(workspace.summary()["verdict"]["word"], "PASS", "{format}");
    }
}
