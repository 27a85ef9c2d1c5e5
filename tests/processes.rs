//! Runs in real time: three processes, and what they leave. At chosen cycles of the controller's sequence one of them dies, hangs
//! or is stopped for a moment. Nothing here judges speed: `tests/realtime/disturbed.py` hits
//! processes at random moments, and measures how soon a rig reacts.

use std::fs;
use std::path::Path;
use std::process::{Child, Output};
use std::time::Duration;

use masseter_recording::{Reader, Recorded};
use masseter_runtime::clock::{self, MILLISECOND_NS, SECOND_NS};
use masseter_runtime::messages::State;
use masseter_runtime::messages::codes::ControllerState::{
    self, Disabling, Easing, Enabling, Holding, Running, WaitReadings,
};
use masseter_runtime::messages::codes::DriveState::{FaultReactionActive, OperationEnabled, QuickStopActive};
use masseter_runtime::transport::{Domain, Node, Subscriber};
use rustix::process::{Pid, Signal, kill_process};

use crate::common::{
    Cores, LENIENT, SharedMemory, Workspace, assert_played, check, child_of, ended, has_event, masseter,
    stderr, stdout, wait_until, wait_until_it_records,
};

/// A cycle of the sequence, counted from 1 in its state.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Moment(ControllerState, u64);

/// Every state that ends by itself.
const MOMENTS: [Moment; 7] = [
    Moment(WaitReadings, 30),
    Moment(Enabling, 1),
    Moment(Easing, 1),
    Moment(Running, 1),
    Moment(Running, 200),
    Moment(Holding, 1),
    Moment(Disabling, 1),
];
const ROLES: [&str; 3] = ["controller", "plant", "recorder"];
/// Drives are off a cycle after they were asked to be: at 1 kHz, the signal would seldom come in time.
const SLOW_HZ: u32 = 200;
/// Far less than the silence after which the lenient rig stops.
const SHORT_STOP: Duration = Duration::from_millis(60);
/// Safely less than the silence after which the lenient rig stops, ns.
const SILENCE_NS: u64 = 300 * MILLISECOND_NS;
/// A machine that stands still may let a moment pass.
const TRIES: usize = 10;
/// No moment is as far off, ns.
const GIVE_UP_NS: u64 = 30 * SECOND_NS;

/// A rig of which one process, the victim, gets signals.
struct Rig {
    memory: SharedMemory,
    workspace: Workspace,
    supervisor: Child,
    victim: Pid,
    /// What the controller publishes, as a scope would see it.
    states: Subscriber<State>,
}

impl Rig {
    fn start(cores: &Cores, role: &str, rate_hz: u32) -> Self {
        let name = format!("hit-{}", std::process::id());
        // The moment within the motion comes before its end at any of the rates.
        let duration_s = 500.0 / f64::from(rate_hz);
        let scenario = format!("rate_hz = {rate_hz}\nduration_s = {duration_s:?}\n{LENIENT}");
        let workspace = Workspace::new(&scenario);
        let supervisor = workspace.start(cores, &["--name", &name]);
        // The rig has claimed its name, as one of its processes runs.
        let victim = child_of(&supervisor, role);
        let memory = SharedMemory::of_running(&name);
        let states = Subscriber::open(&Node::join(&Domain::named(&name).unwrap()).unwrap()).unwrap();
        Self { memory, workspace, supervisor, victim, states }
    }

    /// Sends the victim a signal at the moment; when that was, just before, ns. None when the moment was missed.
    fn hit(&self, signal: Signal, moment: Moment) -> Option<u64> {
        let is_there = self.reaches(moment);
        let hit_ns = clock::now_ns();
        (is_there && kill_process(self.victim, signal).is_ok() && self.stands_in(moment.0)).then_some(hit_ns)
    }

    /// Lets a stopped process go on. After a long stop it may have been given up.
    fn go_on(&self) {
        let _ = kill_process(self.victim, Signal::CONT);
    }

    /// Follows the sequence to the moment; whether it came.
    fn reaches(&self, Moment(wanted, cycle): Moment) -> bool {
        let mut entered = None;
        let give_up_ns = clock::now_ns() + GIVE_UP_NS;
        while clock::now_ns() < give_up_ns {
            match self.states.receive().unwrap() {
                Some(state) if state.controller_state > wanted as u32 => return false,
                Some(state) if state.controller_state == wanted as u32 => {
                    if state.cycle + 1 >= *entered.get_or_insert(state.cycle) + cycle {
                        return true;
                    }
                }
                Some(_) => {}
                None => clock::sleep(Duration::from_micros(100)),
            }
        }
        false
    }

    /// Whether no later state has been published meanwhile.
    fn stands_in(&self, wanted: ControllerState) -> bool {
        let newest = std::iter::from_fn(|| self.states.receive().unwrap()).last();
        newest.is_none_or(|state| state.controller_state == wanted as u32)
    }

    /// Waits for the rig's end; nothing of the rig stays in shared memory.
    fn wait(self) -> (Workspace, Output) {
        let output = self.supervisor.wait_with_output().unwrap();
        assert_eq!(self.memory.files(), Vec::<String>::new(), "{}{}", stdout(&output), stderr(&output));
        (self.workspace, output)
    }
}

/// A run whose `role` was killed at the moment, and when that was, ns.
fn killed(cores: &Cores, role: &str, moment: Moment) -> (Workspace, Output, u64) {
    for _ in 0..TRIES {
        let rig = Rig::start(cores, role, if moment.0 == Disabling { SLOW_HZ } else { 1000 });
        let killed_ns = rig.hit(Signal::KILL, moment);
        let (workspace, output) = rig.wait();
        if let Some(killed_ns) = killed_ns {
            return (workspace, output, killed_ns);
        }
    }
    panic!("{role}: {moment:?} was missed {TRIES} times")
}

#[test]
fn the_rig_ends_in_order_whichever_process_is_killed_in_whichever_state() {
    let cores = Cores::take();
    // Each state for one of the loops at least; scripts/nightly kills all roles at random moments. The recorder knows nothing of
    // the sequence.
    let is_tried = |role, Moment(state, cycle)| match role {
        "controller" => matches!((state, cycle), (Enabling | Holding | Disabling, _) | (Running, 200)),
        "plant" => matches!((state, cycle), (WaitReadings | Easing, _) | (Running, 1)),
        _ => matches!((state, cycle), (WaitReadings, _) | (Running, 200)),
    };
    let hits = ROLES.into_iter().flat_map(|role| MOMENTS.map(|moment| (role, moment)));
    for (role, moment) in hits.filter(|&(role, moment)| is_tried(role, moment)) {
        let (workspace, output, killed_ns) = killed(&cores, role, moment);
        let context = format!("{role} {moment:?}: {}{}", stdout(&output), stderr(&output));
        assert_eq!(output.status.code(), Some(4), "{context}");
        let summary = workspace.summary();
        let reason = summary["verdict"]["reason"].as_str().unwrap();
        assert!(reason.starts_with(&format!("the {role} died: SIGKILL (9), ")), "{context}: {reason}");
        let is_moving = matches!(moment.0, Easing | Running | Holding);
        match role {
            "controller" => {
                assert!(drives_are_off(&workspace), "{context}");
                assert!(!is_moving || has_event(&summary, "fault", "command_lost"), "{context}");
            }
            "plant" => {
                let last = summary["figures"]["final_state"].as_str().unwrap();
                assert!(ends_without_plant(moment.0).contains(&last), "{last}: {context}");
                assert!(!is_moving || has_event(&summary, "fault", "stale_reading"), "{context}");
            }
            _ => assert_recovered(&workspace, moment, killed_ns, &context),
        }
    }
}

/// How a controller may end that has lost its plant.
fn ends_without_plant(state: ControllerState) -> &'static [&'static str] {
    match state {
        // Nothing moves yet.
        WaitReadings => &["finished"],
        // The drives may be off, as far as it knows.
        Enabling | Disabling => &["finished", "safe_stop"],
        _ => &["safe_stop"],
    }
}

fn messages(recording: &Path) -> Vec<Recorded> {
    let mut reader = Reader::open(recording).unwrap();
    std::iter::from_fn(|| reader.next_message().unwrap()).collect()
}

/// Whether no drive gave force in the end.
fn drives_are_off(workspace: &Workspace) -> bool {
    let reading = |message| if let Recorded::Reading(reading) = message { Some(reading) } else { None };
    let recorded = messages(&workspace.run_folder().join("recording.mcap"));
    let last = recorded.into_iter().filter_map(reading).next_back().unwrap();
    let with_force =
        [OperationEnabled, QuickStopActive, FaultReactionActive].map(|condition| condition as u32);
    last.drive_state.iter().all(|state| !with_force.contains(state))
}

/// What a killed recorder leaves lacks its end, at most the last second, and is recovered to the last message.
fn assert_recovered(workspace: &Workspace, moment: Moment, killed_ns: u64, context: &str) {
    let [recording, recovered] = ["run/recording.mcap", "recovered.mcap"].map(|name| workspace.file(name));
    let run = |arguments: &[&str], code| {
        let output = masseter(&[&["recording"], arguments].concat());
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}: {context}", stdout(&output));
        stdout(&output)
    };
    let [from, to] = [&recording, &recovered].map(|path| path.to_str().unwrap());
    assert!(run(&["verify", from], 6).contains("lacks its end"), "{context}");
    run(&["recover", from, "--out", to], 0);
    assert!(run(&["verify", to], 0).contains("the file has its end"), "{context}");
    let saved = messages(&recording);
    assert!(messages(&recovered) == saved, "{context}");
    let published = |message: &Recorded| match message {
        Recorded::Reading(reading) => Some(reading.published_ns),
        _ => None,
    };
    // A recorder that is killed in its first second may leave nothing.
    let newest_ns =
        saved.iter().filter_map(published).max().or((moment.0 == WaitReadings).then_some(killed_ns));
    let lost_ns = killed_ns.saturating_sub(newest_ns.expect("a reading"));
    assert!(lost_ns <= SECOND_NS, "{lost_ns} ns are lost: {context}");
}

/// One rig serves all moments that it does not miss; the next one those that are left.
#[test]
fn the_rig_goes_on_whichever_process_is_stopped_for_a_moment_in_whichever_state() {
    let cores = Cores::take();
    for role in ROLES {
        let mut left = MOMENTS.to_vec();
        for _ in 0..TRIES {
            let rig = Rig::start(&cores, role, SLOW_HZ);
            let mut longest_ns = 0;
            let mut missed = Vec::new();
            for &moment in &left {
                let hit_ns = rig.hit(Signal::STOP, moment);
                clock::sleep(if hit_ns.is_some() { SHORT_STOP } else { Duration::ZERO });
                rig.go_on();
                match hit_ns {
                    Some(hit_ns) => longest_ns = longest_ns.max(clock::now_ns() - hit_ns),
                    None => missed.push(moment),
                }
            }
            let (workspace, output) = rig.wait();
            // The machine may make a stop a long one.
            if longest_ns < SILENCE_NS {
                let context = format!("{role}: {}{}", stdout(&output), stderr(&output));
                assert_played(&workspace.run_folder(), output.status, &context);
                left = missed;
            }
            if left.is_empty() {
                break;
            }
        }
        assert_eq!(left, [], "{role}: missed {TRIES} times");
    }
}

/// Nobody reads what it says.
#[test]
fn a_run_plays_through_three_processes_and_leaves_nothing_in_shared_memory() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 2.0\n{LENIENT}"));
    let mut child = workspace.start(&cores, &[]);
    drop((child.stdout.take(), child.stderr.take()));
    let memory = SharedMemory::of_running(&format!("{}-", child.id()));
    assert_played(&workspace.run_folder(), child.wait().unwrap(), "nobody read what it said");
    let summary = workspace.summary();
    assert_eq!(check(&summary, "dropped messages")["result"], "passed", "{summary}");
    let scheduling = &workspace.manifest()["scheduling"];
    for role in ROLES {
        assert!(scheduling[role]["requested"].is_object(), "{scheduling}");
    }
    assert_eq!(memory.files(), Vec::<String>::new());
    let log = fs::read_to_string(workspace.run_folder().join("can0.log")).unwrap();
    let (_, last_cycle) = log.rsplit_once(" 080#").unwrap();
    assert!(last_cycle.contains(" 201#"), "what it ended with is recorded too: {last_cycle}");
    assert_logged_in_order(&fs::read(workspace.run_folder().join("recording.mcap")).unwrap());
}

/// Nothing is logged before it was published, nor before what stands above it.
fn assert_logged_in_order(recording: &[u8]) {
    let mut last_ns = 0;
    for message in mcap::MessageStream::new(recording).unwrap() {
        let message = message.unwrap();
        let [published_ns, logged_ns] = [message.publish_time, message.log_time];
        let topic = &message.channel.topic;
        assert!(logged_ns >= published_ns.max(last_ns), "{topic}: {published_ns} {logged_ns}");
        last_ns = logged_ns;
    }
}

#[test]
fn another_controller_runs_through_three_processes() {
    let cores = Cores::take();
    let workspace = Workspace::new(&format!("duration_s = 1.0\n{LENIENT}"));
    let output = workspace.run(&cores, &["--controller", "hold"]);
    assert_played(&workspace.run_folder(), output.status, &(stdout(&output) + &stderr(&output)));
}

#[test]
fn a_motion_that_is_broken_off_does_not_pass() {
    let cores = Cores::take();
    let (workspace, child) = Workspace::running(&cores, LENIENT);
    kill_process(child_of(&child, "controller"), Signal::TERM).unwrap();
    ended(child, 1);
    let summary = workspace.summary();
    assert_eq!(check(&summary, "sequence")["result"], "failed", "{summary}");
    assert!(has_event(&summary, "transition", "stop_requested"), "{summary}");
}

#[test]
fn a_controller_that_hangs_is_killed_by_its_silence_or_once_it_does_not_end_when_asked_to() {
    let cores = Cores::take();
    for (is_asked, how) in [(false, "stopped sending commands"), (true, "did not end when it was asked to")] {
        let (workspace, child) = Workspace::running(&cores, LENIENT);
        kill_process(child_of(&child, "controller"), Signal::STOP).unwrap();
        if is_asked {
            kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
        }
        ended(child, 4);
        let reason = &workspace.summary()["verdict"]["reason"];
        let died = format!("the controller died: it {how}, and was killed, ");
        assert!(reason.as_str().is_some_and(|reason| reason.starts_with(&died)), "{reason}");
    }
}

#[test]
fn the_processes_of_a_killed_supervisor_end_and_clean_removes_their_files() {
    let cores = Cores::take();
    for is_real in [true, false] {
        let workspace = Workspace::new(&format!("duration_s = 60.0\n{LENIENT}"));
        let mut child = if is_real { workspace.start(&cores, &[]) } else { workspace.start_lockstep(&[]) };
        wait_until_it_records(&workspace);
        let memory = SharedMemory::of_running(&format!("{}-", child.id()));
        child.kill().unwrap();
        child.wait().unwrap();
        wait_until("all is swept", || {
            assert_eq!(masseter(&["clean"]).status.code(), Some(0));
            memory.files().is_empty()
        });
        let report = masseter(&["report", workspace.run_folder().to_str().unwrap()]);
        assert_eq!(report.status.code(), Some(4), "{}{}", stdout(&report), stderr(&report));
        assert!(stdout(&report).contains("the supervisor died"), "{}", stdout(&report));
    }
}
