//! Two rigs on one machine: side by side, and under one name.

use crate::common::{
    Cores, LENIENT, Workspace, assert_played, check, has_event, stderr, stdout, wait_until_it_records,
};
use rustix::process::{Pid, Signal, kill_process};

#[test]
fn no_message_of_one_rig_reaches_another() {
    let cores = Cores::take();
    // Both rigs share two cores: at this rate there is time for both.
    let workspaces = [1, 2]
        .map(|seed| Workspace::new(&format!("seed = {seed}\nrate_hz = 100\nduration_s = 2.0\n{LENIENT}")));
    let children: Vec<_> = workspaces.iter().map(|workspace| workspace.start(&cores, &[])).collect();
    for (child, workspace) in children.into_iter().zip(&workspaces) {
        let output = child.wait_with_output().unwrap();
        assert_played(&workspace.run_folder(), output.status, &(stdout(&output) + &stderr(&output)));
        // A command of the other rig is a fault; any other message of that rig is a gap in a sequence.
        let summary = workspace.summary();
        assert!(!has_event(&summary, "fault", "foreign_command"), "{summary}");
        assert_eq!(check(&summary, "dropped messages")["result"], "passed", "{summary}");
    }
}

#[test]
fn two_rigs_in_lockstep_leave_the_bytes_of_virtual_time() {
    let seeds = ["1", "2"];
    let expected = seeds.map(|seed| {
        let workspace = Workspace::new("duration_s = 2.0");
        assert_eq!(workspace.run_virtual(&["--seed", seed]).status.code(), Some(0));
        workspace.recording()
    });
    assert!(expected[0] != expected[1]);
    let rigs = seeds.map(|seed| {
        let workspace = Workspace::new("duration_s = 2.0");
        let child = workspace.start_lockstep(&["--seed", seed]);
        (workspace, child)
    });
    for ((workspace, child), expected) in rigs.into_iter().zip(expected) {
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
        assert!(workspace.recording() == expected);
    }
}

#[test]
fn a_second_rig_of_the_same_name_is_refused() {
    let cores = Cores::take();
    let name = format!("robot-{}", std::process::id());
    let [first, second] = [1, 2].map(|_| Workspace::new(&format!("duration_s = 60.0\n{LENIENT}")));
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
