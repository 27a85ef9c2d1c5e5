//! Two rigs on one machine: side by side, and under one name.

mod common;

use common::{Cores, UNHURRIED, Workspace, check, stderr, stdout, wait_until_it_records};
use rustix::process::{Pid, Signal, kill_process};

#[test]
fn two_rigs_on_one_machine_do_not_meet() {
    let cores = Cores::take();
    let workspaces =
        [1, 2].map(|seed| Workspace::new(&format!("seed = {seed}\nduration_s = 2.0\n{UNHURRIED}")));
    let children: Vec<_> = workspaces.iter().map(|workspace| workspace.start(&cores, &[])).collect();
    for (child, workspace) in children.into_iter().zip(&workspaces) {
        let output = child.wait_with_output().unwrap();
        // Both want the same two cores, so either may be starved into a safe stop; but no message may
        // cross, which a foreign command or a gap in a sequence would show.
        let summary = workspace.summary();
        let code = output.status.code();
        assert!(matches!(code, Some(0 | 3 | 5)), "{code:?} {}{}", stdout(&output), stderr(&output));
        assert!(summary["figures"]["cycles"].as_u64().unwrap() > 0, "{summary}");
        assert!(!stdout(&output).contains("foreign_command"), "{}", stdout(&output));
        assert_eq!(check(&summary, "dropped messages")["result"], "passed", "{summary}");
    }
}

#[test]
fn a_second_rig_of_the_same_name_is_refused() {
    let cores = Cores::take();
    let name = format!("robot-{}", std::process::id());
    let [first, second] = [1, 2].map(|_| Workspace::new(&format!("duration_s = 60.0\n{UNHURRIED}")));
    let running = first.start(&cores, &["--name", &name]);
    wait_until_it_records(&first);
    // The folder for temporary files does not make it another machine.
    let refused = second.command(&cores, &["--name", &name]).env("TMPDIR", second.file("")).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(stderr(&refused).contains(&format!("a rig named '{name}' is running")), "{}", stderr(&refused));
    assert!(!second.run_folder().exists());
    kill_process(Pid::from_child(&running), Signal::INT).unwrap();
    assert_eq!(running.wait_with_output().unwrap().status.code(), Some(130));
    assert_eq!(second.run(&cores, &["--name", "../robot"]).status.code(), Some(2));
}
