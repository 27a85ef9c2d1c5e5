//! A program as the controller: started by the rig or by hand, in lockstep and in real time. The rig watches and judges it as
//! its own; programs that cannot take part are refused with the reason.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;

use masseter_runtime::control::{Session, Waited};
use masseter_runtime::conversation::line;
use masseter_runtime::lifecycle::Report;
use masseter_runtime::lifecycle::attach::{self, Hello, socket};
use masseter_runtime::messages::{self, State};
use masseter_runtime::named::{self, Declared, Parameter};
use masseter_runtime::realtime::scheduling::{SchedulingRequest, obtain};
use masseter_runtime::transport::Domain;

use crate::common::{
    self, Cores, LENIENT, MASSETER, PASSED_OR_INVALID, Workspace, is_dead, masseter, stderr, stdout,
    wait_until,
};
use rustix::process::{Pid, Signal, kill_process, kill_process_group};

const SCENARIO: &str = "duration_s = 1.0\n";

/// An executable script in the workspace.
fn script(workspace: &Workspace, text: &str) -> PathBuf {
    let path = workspace.write("controller.sh", &format!("#!/bin/sh\n{text}\n"));
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

/// A rig in lockstep that waits for a controller.
fn waiting(workspace: &Workspace, name: &str) -> Child {
    let child = workspace.start_lockstep(&["--controller", "external", "--name", name]);
    let socket = socket(&Domain::named(name).unwrap());
    wait_until("the rig waits", || UnixStream::connect(&socket).is_ok());
    child
}

/// The rig's own controller as a program.
fn program(arguments: &[&str]) -> Command {
    let mut command = Command::new(MASSETER);
    command.arg("controller").args(arguments).env_remove("MASSETER_RIG");
    command
}

fn unique(name: &str) -> String {
    format!("{name}-{}", std::process::id())
}

fn run(workspace: &Workspace, controller: &Path, clock: &str) -> Output {
    let controller = controller.to_str().unwrap();
    workspace.run_simulated(clock, &["--quiet", "--controller", controller])
}

#[test]
fn a_program_leaves_the_bytes_of_the_rigs_own_controller() {
    let own = Workspace::new(SCENARIO);
    assert_eq!(own.run_virtual(&["--quiet"]).status.code(), Some(0));

    let by_hand = Workspace::new(SCENARIO);
    let name = unique("by-hand");
    let rig = waiting(&by_hand, &name);
    assert_eq!(program(&["--rig", &name]).status().unwrap().code(), Some(0));
    let output = rig.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(by_hand.recording() == own.recording());

    for clock in ["lockstep", "virtual"] {
        let started = Workspace::new(SCENARIO);
        let program = script(&started, &format!("echo a line of the program\nexec {MASSETER} controller"));
        let output = run(&started, &program, clock);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(started.recording() == own.recording(), "{clock}");
        assert_eq!(started.manifest()["clock"], "lockstep");
        assert_eq!(started.manifest()["controller"], program.to_str().unwrap());
        assert!(stdout(&output).contains(&format!("controller: {}", program.display())));
        let printed =
            (stdout(&output).contains("of the program"), stderr(&output).contains("of the program"));
        assert_eq!(printed, (false, true), "standard output is the rig's");
    }
}

#[test]
fn a_program_controls_the_robot_in_real_time() {
    let cores = Cores::take();
    // It plays no motion of the scenario.
    let required =
        "[[require]]\nname = 'holds'\nsignal = 'jaw.rotation'\nduring = 'running'\nmax = '1 deg'\n";
    let workspace = Workspace::new(&format!("{SCENARIO}{LENIENT}{required}"));
    let program = script(&workspace, &format!("exec {MASSETER} controller --kind hold"));
    let controller = program.to_str().unwrap();
    let output = workspace.run(&cores, &["--quiet", "--controller", controller]);
    assert!(PASSED_OR_INVALID.contains(&output.status.code()), "{}{}", stdout(&output), stderr(&output));
    assert!(workspace.manifest()["scheduling"]["controller"].is_object());
}

#[test]
fn a_program_that_waits_for_ever_in_real_time_ends_at_a_deadline() {
    let cores = Cores::take();
    let waits = "[controller]\nstart_timeout_s = 1.0\noverdue_s = 0.2\n[can]\nready_timeout_ms = 500\n";
    let workspace = Workspace::new(&format!("{SCENARIO}{waits}"));
    let name = unique("waits");
    let rig = workspace.start(&cores, &["--controller", "external", "--name", &name, "--quiet"]);
    let socket = socket(&Domain::named(&name).unwrap());
    wait_until("the rig waits", || UnixStream::connect(&socket).is_ok());
    // The thread ends with the priority that the session asks for.
    let program = thread::spawn(move || {
        let mut session = Session::start(attach::attach(Some(&name)).unwrap(), Declared::default()).unwrap();
        while !session.is_stop_requested() {
            let Ok(Waited::Cycle { tick, .. }) = session.wait(None) else { continue };
            let command = messages::Command { cycle: tick.cycle, ..Default::default() };
            // The rig may have given it up meanwhile.
            let _ = session.publish(&command, &State { cycle: tick.cycle, ..State::default() });
        }
    });
    let output = rig.wait_with_output().unwrap();
    program.join().unwrap();
    let said = stdout(&output) + &stderr(&output);
    assert_eq!(workspace.manifest()["ending"]["kind"], "overdue", "{said}");
    // A machine that loses many cycles leaves nothing to judge.
    assert!(matches!(output.status.code(), Some(1 | 3)), "{said}");
}

#[test]
fn a_program_that_dies_hangs_or_never_attaches_is_named_with_its_end() {
    let workspace = Workspace::new(SCENARIO);
    let output = run(&workspace, &script(&workspace, "exit 3"), "lockstep");
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(4), "{said}");
    assert!(said.contains("ended (exit code 3) before it was ready"), "{said}");

    for (signal, reason) in [(Signal::KILL, "SIGKILL (9)"), (Signal::STOP, "it did not answer in cycle ")] {
        let workspace = Workspace::new("duration_s = 60.0\n");
        let pid = workspace.file("pid");
        let text = format!("echo $$ > {}\nexec {MASSETER} controller", pid.display());
        let program = script(&workspace, &text);
        let controller = program.to_str().unwrap();
        let rig = workspace.start_lockstep(&["--controller", controller, "--patience", "1s"]);
        common::wait_until_it_records(&workspace);
        let pid: i32 = fs::read_to_string(pid).unwrap().trim().parse().unwrap();
        kill_process(Pid::from_raw(pid).unwrap(), signal).unwrap();
        let said = common::ended(rig, 4);
        assert!(said.contains(&format!("the controller died: {reason}")), "{said}");
    }
}

/// The supervisor sees both ends at once: the plant has ended because the program has left.
#[test]
fn a_program_that_leaves_is_named_though_the_plant_has_ended_too() {
    let workspace = Workspace::new(SCENARIO);
    let name = unique("leaves");
    let rig = waiting(&workspace, &name);
    let session = Session::start(attach::attach(Some(&name)).unwrap(), Declared::default()).unwrap();
    let plant = common::child_of(&rig, "plant").as_raw_nonzero().get();
    kill_process(Pid::from_child(&rig), Signal::STOP).unwrap();
    session.fail("no more ideas").unwrap();
    wait_until("the plant has ended", || is_dead(plant));
    kill_process(Pid::from_child(&rig), Signal::CONT).unwrap();
    let output = rig.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", stderr(&output));
    let reason = &workspace.summary()["verdict"]["reason"];
    assert!(reason.as_str().unwrap().starts_with("the controller died: no more ideas, "), "{reason}");
}

#[test]
fn a_program_of_the_user_that_hangs_is_left_to_its_user_and_the_run_ends() {
    let workspace = Workspace::new("duration_s = 60.0\n");
    let name = unique("hangs");
    let arguments = ["--controller", "external", "--name", &name, "--patience", "1s"];
    let rig = workspace.start_lockstep(&arguments);
    let socket = socket(&Domain::named(&name).unwrap());
    wait_until("the rig waits", || UnixStream::connect(&socket).is_ok());
    let mut program = program(&["--rig", &name]).spawn().unwrap();
    common::wait_until_it_records(&workspace);
    kill_process(Pid::from_child(&program), Signal::STOP).unwrap();
    let output = rig.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4), "{}", stdout(&output));
    assert!(stdout(&output).contains("and was left to its user"), "{}", stdout(&output));
    assert!(program.try_wait().unwrap().is_none(), "the rig has killed it");
    program.kill().unwrap();
    program.wait().unwrap();
}

#[test]
fn a_program_that_ignores_everything_dies_with_the_rig() {
    // One never attaches; the other one takes part, and is then stopped.
    let deaf = "trap '' HUP INT QUIT TERM PIPE\necho $$ > $PIDS\nwhile :; do sleep 0.1; done";
    let attached = format!("echo $$ > $PIDS\nexec {MASSETER} controller");
    for (text, records) in [(deaf, false), (&attached, true)] {
        let workspace = Workspace::new("duration_s = 60.0\n");
        let pids = workspace.file("pid");
        let program = script(&workspace, &format!("PIDS={}\n{text}", pids.display()));
        let controller = program.to_str().unwrap();
        let mut rig = workspace.start_lockstep(&["--controller", controller, "--patience", "none"]);
        let read = || fs::read_to_string(&pids).ok()?.trim().parse().ok();
        wait_until("the program runs", || read().is_some());
        let pid: i32 = read().unwrap();
        if records {
            common::wait_until_it_records(&workspace);
            kill_process(Pid::from_raw(pid).unwrap(), Signal::STOP).unwrap();
        }
        assert!(!is_dead(pid), "{text}");
        rig.kill().unwrap();
        rig.wait().unwrap();
        wait_until("the program is gone", || is_dead(pid));
    }
}

/// A script that prepares the surroundings of a program may start more than that.
#[test]
fn nothing_that_a_program_has_started_outlives_the_run() {
    let workspace = Workspace::new(SCENARIO);
    let pid = workspace.file("pid");
    let text = format!("sleep 1000 &\necho $! > {}\n{MASSETER} controller", pid.display());
    let output = run(&workspace, &script(&workspace, &text), "lockstep");
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    let pid = fs::read_to_string(pid).unwrap().trim().parse().unwrap();
    wait_until("the script's child is gone", || is_dead(pid));
}

#[test]
fn a_program_that_cannot_be_executed_is_named_with_the_reason() {
    let workspace = Workspace::new(SCENARIO);
    let path = workspace.write("controller.sh", "#!/no/such/interpreter\n");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    let output = run(&workspace, &path, "lockstep");
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(4), "{said}");
    let reason = format!("the controller {} cannot be started: No such file", path.display());
    assert!(said.contains(&reason) && said.contains("ended (exit code 2) before it was ready"), "{said}");
}

#[test]
fn a_terminals_interrupt_ends_the_motion_of_a_program_in_order() {
    let workspace = Workspace::new("duration_s = 60.0\n");
    // Unlike the rig's own processes, this program would end at once.
    let program = script(&workspace, &format!("exec {MASSETER} controller"));
    let mut rig = Command::new(MASSETER);
    rig.args(["run", "--clock", "lockstep", "--quiet", "--out"]).arg(workspace.run_folder());
    rig.args(["--controller", program.to_str().unwrap()]).arg(workspace.file("scenario.toml"));
    let rig = rig.process_group(0).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    common::wait_until_it_records(&workspace);
    kill_process_group(Pid::from_child(&rig), Signal::INT).unwrap();
    let output = rig.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}{}", stdout(&output), stderr(&output));
    assert_eq!(workspace.manifest()["ending"]["kind"], "interrupted");
    assert!(common::has_event(&workspace.summary(), "transition", "stop_requested"));
}

#[test]
fn a_rig_whose_plant_dies_while_it_waits_for_a_controller_waits_no_longer() {
    let workspace = Workspace::new(SCENARIO);
    let name = unique("no-plant");
    let mut rig = workspace.start_lockstep(&["--controller", "external", "--name", &name]);
    let mut said = BufReader::new(rig.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert!(said.any(|line| line.contains("waiting for a controller")), "plant and recorder are ready");
    kill_process(common::child_of(&rig, "plant"), Signal::KILL).unwrap();
    let rest: Vec<_> = said.collect();
    assert_eq!(rig.wait().unwrap().code(), Some(4), "{rest:?}");
    assert!(rest.join(" ").contains("the plant ended (SIGKILL (9)) before the start"), "{rest:?}");
}

#[test]
fn a_second_program_another_version_and_a_stranger_are_refused_and_the_run_goes_on() {
    let workspace = Workspace::new(SCENARIO);
    let name = unique("strangers");
    let rig = waiting(&workspace, &name);
    let path = socket(&Domain::named(&name).unwrap());
    let answer_to = |greeting: &str| {
        let mut stream = UnixStream::connect(&path).unwrap();
        writeln!(stream, "{greeting}").unwrap();
        let mut answer = String::new();
        BufReader::new(stream).read_line(&mut answer).unwrap();
        answer
    };
    let other = answer_to(r#"{"layouts":["masseter/Reading/0000000000000000"]}"#);
    assert!(other.contains("refused") && other.contains("build it against this version"), "{other}");
    let stranger = answer_to("GET / HTTP/1.1");
    assert!(stranger.contains("refused") && stranger.contains("greeting"), "{stranger}");

    let hello = serde_json::to_string(&attach::Hello::default()).unwrap();
    let mut first = UnixStream::connect(&path).unwrap();
    writeln!(first, "{hello}").unwrap();
    let mut answer = String::new();
    BufReader::new(&first).read_line(&mut answer).unwrap();
    assert!(answer.contains("invited"), "{answer}");
    let second = program(&["--rig", &name]).output().unwrap();
    assert_eq!(second.status.code(), Some(2));
    assert!(stderr(&second).contains("has its controller"), "{}", stderr(&second));

    // The first one leaves before it is ready: the rig waits for the next.
    drop(first);
    wait_until("another program is admitted", || {
        program(&["--rig", &name]).stderr(Stdio::null()).status().unwrap().success()
    });
    let output = rig.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    assert!(stderr(&output).contains("is refused"), "{}", stderr(&output));
}

#[test]
fn without_such_a_rig_those_that_wait_are_listed() {
    let workspace = Workspace::new(SCENARIO);
    let name = unique("listed");
    let rig = waiting(&workspace, &name);
    let output = program(&["--rig", "nowhere"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let said = stderr(&output);
    assert!(said.contains("no rig named 'nowhere' takes a controller") && said.contains(&name), "{said}");
    let id = Pid::from_child(&rig);
    kill_process(id, Signal::INT).unwrap();
    let output = rig.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", stderr(&output));
}

#[test]
fn a_file_that_is_no_executable_is_refused_before_anything_starts() {
    let workspace = Workspace::new(SCENARIO);
    let plain = workspace.write("plain.txt", "no program");
    for (controller, expected) in [
        (plain.to_str().unwrap(), "chmod +x"),
        (workspace.file("none").to_str().unwrap(), "motion, hold, external"),
        (std::env::temp_dir().to_str().unwrap(), "it is a folder"),
        ("/dev/zero", "it is no regular file"),
        ("moton", "motion, hold, external"),
    ] {
        let output = masseter(&["run", "--controller", controller]);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(expected), "{}", stderr(&output));
    }
}

#[test]
fn without_a_controller_plant_and_recorder_run_for_the_length_of_the_motion() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{LENIENT}"));
    let output = workspace.run(&cores, &["--controller", "none", "--quiet"]);
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stdout(&output).contains("UNTESTED: no cycle ran"), "{}", stdout(&output));
    let figures = &workspace.summary()["figures"];
    let topics = &figures["topics"];
    let messages = |name: &str| {
        let topic = topics.as_array().unwrap().iter().find(|topic| topic["topic"] == name);
        topic.map_or(0, |topic| topic["messages"].as_u64().unwrap())
    };
    let plant_cycles = messages("reading") + figures["plant_skips"]["skipped"].as_u64().unwrap();
    assert!(plant_cycles > 900 && messages("command") == 0 && messages("state") == 0, "{topics}");
    let refused = workspace.run_virtual(&["--controller", "none"]);
    assert!(refused.status.code() == Some(2) && stderr(&refused).contains("needs --clock rt"));
}

/// The answers of the rig to a program that greets as it should and then sends this line.
fn answer_to(name: &str, report: &str) -> String {
    let stream = UnixStream::connect(socket(&Domain::named(name).unwrap())).unwrap();
    let mut input = BufReader::new(&stream);
    let mut answers = String::new();
    for said in [line(&Hello::default()), format!("{report}\n")] {
        (&stream).write_all(said.as_bytes()).unwrap();
        input.read_line(&mut answers).unwrap();
    }
    answers
}

/// What a program declares stands in schemas, pages and terminals.
#[test]
fn a_program_that_declares_what_cannot_be_shown_is_refused_and_the_next_one_taken() {
    let workspace = Workspace::new(SCENARIO);
    let name = unique("declares");
    let rig = waiting(&workspace, &name);
    let signal = |name: &str, unit: &str, about: &str| named::Signal {
        name: name.to_owned(),
        unit: unit.to_owned(),
        about: about.to_owned(),
    };
    let of = |signals: Vec<named::Signal>| Declared { signals, ..Declared::default() };
    let reversed = Parameter { range: [9.0, 1.0], ..Parameter::new("gain", 5.0) };
    let scheduling = obtain(SchedulingRequest { core: None, fifo_priority: None, locked_memory: false });
    for (declared, limit) in [
        (of((0..65).map(|number| signal(&format!("s{number}"), "mm", "")).collect()), "up to 64"),
        (of(vec![signal("a", "mm", ""), signal("a", "mm", "")]), "are named 'a'"),
        (of(vec![signal("</script>", "", "")]), "lower-case letters"),
        (of(vec![signal("a", "m\nfloat64 evil", "")]), "printable characters"),
        (of(vec![signal("a", "", "\u{1b}]0;evil\u{7}")]), "printable characters"),
        (of(vec![signal("a", "", &"x".repeat(100_000))]), "at most 65536 bytes"),
        (
            Declared { parameters: vec![reversed], ..Declared::default() },
            "parameter 'gain' has no valid range",
        ),
    ] {
        let report = Report::Ready { scheduling: scheduling.clone(), declared };
        let answers = answer_to(&name, line(&report).trim_end());
        assert!(answers.contains("refused") && answers.contains(limit), "{answers}");
    }
    assert!(answer_to(&name, "\u{1b}[2J").contains("no report of this version"));
    // This one never ends its line, and is out as soon as it has said too much.
    let endless = UnixStream::connect(socket(&Domain::named(&name).unwrap())).unwrap();
    (&endless).write_all(line(&Hello::default()).as_bytes()).unwrap();
    while (&endless).write_all(&b"x".repeat(65_536)).is_ok() {}
    assert_eq!(program(&["--rig", &name]).status().unwrap().code(), Some(0));
    let output = rig.wait_with_output().unwrap();
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    // The first one is named at once, and those of the next second together.
    assert!(said.contains("is refused: ") && said.contains("up to 64"), "{said}");
    assert!(said.contains("it sent more than 1048576 bytes"), "{said}");
    assert!(said.matches("refused").count() < 8, "{said}");
    assert!(!said.contains(['\u{1b}', '\u{7}']) && said.len() < 8000, "{said}");
}

/// Neither an FMU nor the Python package of the rig is there.
#[test]
fn an_fmu_that_cannot_be_played_leads_to_its_document() {
    let workspace = Workspace::new(SCENARIO);
    let fmu = workspace.write("law.fmu", "no FMU");
    let out = workspace.run_folder();
    let controller = format!("fmu:{}", fmu.display());
    let output = masseter(&[
        "run",
        "--clock",
        "lockstep",
        "--controller",
        &controller,
        "--out",
        out.to_str().unwrap(),
    ]);
    assert_eq!(output.status.code(), Some(4));
    assert!(stderr(&output).contains("docs/fmu.md"), "{}", stderr(&output));
}
