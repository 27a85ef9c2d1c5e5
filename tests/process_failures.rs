//! Every process is killed, or stopped for a while, at chosen cycles of the controller's sequence. No test here judges
//! speed: `tests/realtime/kill.py` measures at random cycles how soon a rig reacts.

use std::process::{Child, Output};
use std::time::Duration;

use masseter_runtime::clock::{self, MILLISECOND_NS, SECOND_NS};
use masseter_runtime::messages::State;
use masseter_runtime::messages::codes::ControllerState::{
    self, Disabling, Easing, Enabling, Holding, Running, WaitReadings,
};
use masseter_runtime::messages::codes::DriveState::{FaultReactionActive, OperationEnabled, QuickStopActive};
use masseter_runtime::transport::{Domain, Node, Subscriber};

use crate::common::{
    Cores, LENIENT, SharedMemory, Workspace, assert_played, child_of, has_event, masseter, stderr, stdout,
};
use masseter_recording::{Reader, Recorded};
use rustix::process::{Pid, Signal, kill_process};

/// A cycle of the sequence, counted from 1 in its state.
#[derive(Debug, Clone, Copy)]
struct Moment(ControllerState, u64);

impl Moment {
    /// Drives are off a cycle after they were asked to be: at 1 kHz, the signal would seldom come in time.
    fn rate_hz(self) -> u32 {
        if self.0 == Disabling { 200 } else { 1000 }
    }
}

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
/// Far less than the silence after which the lenient rig stops.
const SHORT_STOP: Duration = Duration::from_millis(60);
/// Safely less than the silence after which the lenient rig stops, ns.
const SILENCE_NS: u64 = 300 * MILLISECOND_NS;
/// A machine that stands still may let the moment pass.
const TRIES: usize = 10;
/// No moment is as far off, ns.
const GIVE_UP_NS: u64 = 30 * SECOND_NS;

/// A rig of which one process, the victim, got a signal.
struct Rig {
    name: String,
    memory: SharedMemory,
    workspace: Workspace,
    supervisor: Child,
    victim: Pid,
    /// Just before the signal, ns.
    hit_ns: u64,
}

impl Rig {
    /// A rig whose `role` gets the signal at the moment; none when that was missed.
    fn hit(cores: &Cores, role: &str, signal: Signal, moment: Moment) -> Option<Self> {
        let name = format!("hit-{}", std::process::id());
        let workspace =
            Workspace::new(&format!("rate_hz = {}\nduration_s = 0.5\n{LENIENT}", moment.rate_hz()));
        let supervisor = workspace.start(cores, &["--name", &name]);
        let victim = child_of(&supervisor, role);
        let memory = SharedMemory::of_running(&name);
        let mut rig = Self { name, memory, workspace, supervisor, victim, hit_ns: 0 };
        let states = rig.states();
        let is_there = reaches(&states, moment);
        rig.hit_ns = clock::now_ns();
        let was_hit = is_there && kill_process(victim, signal).is_ok() && stands_in(&states, moment.0);
        if was_hit {
            return Some(rig);
        }
        let _ = kill_process(victim, Signal::CONT);
        rig.wait();
        None
    }

    /// What the controller publishes, as a scope would see it. The rig has claimed its name, as one of its processes runs.
    fn states(&self) -> Subscriber<State> {
        Node::join(&Domain::named(&self.name).unwrap()).unwrap().subscriber().unwrap()
    }

    /// Waits for the rig's end; nothing of the rig stays in shared memory.
    fn wait(self) -> (Workspace, Output) {
        let output = self.supervisor.wait_with_output().unwrap();
        assert_eq!(self.memory.files(), Vec::<String>::new(), "{}{}", stdout(&output), stderr(&output));
        (self.workspace, output)
    }
}

/// A rig whose `role` got the signal at the moment.
fn hit(cores: &Cores, role: &str, signal: Signal, moment: Moment) -> Rig {
    let rig = (0..TRIES).find_map(|_| Rig::hit(cores, role, signal, moment));
    rig.unwrap_or_else(|| panic!("{role}: {moment:?} was missed {TRIES} times"))
}

/// Follows the sequence to the moment; whether it came.
fn reaches(states: &Subscriber<State>, Moment(wanted, cycle): Moment) -> bool {
    let mut entered = None;
    let give_up_ns = clock::now_ns() + GIVE_UP_NS;
    while clock::now_ns() < give_up_ns {
        match states.receive().unwrap() {
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
fn stands_in(states: &Subscriber<State>, wanted: ControllerState) -> bool {
    let newest = std::iter::from_fn(|| states.receive().unwrap()).last();
    newest.is_none_or(|state| state.controller_state == wanted as u32)
}

/// The readable part of a recording whose recorder was killed.
fn is_recovered(workspace: &Workspace) -> bool {
    let [recording, recovered] = ["run/recording.mcap", "recovered.mcap"].map(|name| workspace.file(name));
    let [recording, recovered] = [&recording, &recovered].map(|path| path.to_str().unwrap());
    let codes = [
        masseter(&["recording", "verify", recording]),
        masseter(&["recording", "recover", recording, "--out", recovered]),
        masseter(&["recording", "verify", recovered]),
    ]
    .map(|output| output.status.code());
    codes == [Some(6), Some(0), Some(0)]
}

#[test]
fn the_rig_ends_in_order_whichever_process_is_killed_in_whichever_state() {
    let cores = Cores::take();
    for (role, moment) in ROLES.into_iter().flat_map(|role| MOMENTS.map(|moment| (role, moment))) {
        let rig = hit(&cores, role, Signal::KILL, moment);
        let (workspace, output) = rig.wait();
        let context = format!("{role} {moment:?}: {}{}", stdout(&output), stderr(&output));
        assert_eq!(output.status.code(), Some(4), "{context}");
        let summary = workspace.summary();
        assert_eq!(summary["verdict"]["reason"], format!("the {role} died: SIGKILL (9)"), "{context}");
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
            _ => assert!(is_recovered(&workspace), "{context}"),
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

/// Whether no drive gave force in the end.
fn drives_are_off(workspace: &Workspace) -> bool {
    let mut reader = Reader::open(&workspace.run_folder().join("recording.mcap")).unwrap();
    let mut last = None;
    while let Some(message) = reader.next_message().unwrap() {
        if let Recorded::Reading(reading) = message {
            last = Some(reading);
        }
    }
    let with_force =
        [OperationEnabled, QuickStopActive, FaultReactionActive].map(|condition| condition as u32);
    last.unwrap().drive_state.iter().all(|state| !with_force.contains(state))
}

/// Stops `role` at the moment for a short time; once more where the machine made that time a long one.
fn stop_for_a_moment(cores: &Cores, role: &str, moment: Moment) -> (Workspace, Output) {
    for _ in 0..TRIES {
        let rig = hit(cores, role, Signal::STOP, moment);
        clock::sleep(SHORT_STOP);
        // After a long stop it may have been given up.
        let _ = kill_process(rig.victim, Signal::CONT);
        let stopped_ns = clock::now_ns() - rig.hit_ns;
        let ended = rig.wait();
        if stopped_ns < SILENCE_NS {
            return ended;
        }
    }
    panic!("{role}: {moment:?}: no stop was short in {TRIES} tries")
}

#[test]
fn the_rig_goes_on_whichever_process_is_stopped_for_a_moment_in_whichever_state() {
    let cores = Cores::take();
    for (role, moment) in ROLES.into_iter().flat_map(|role| MOMENTS.map(|moment| (role, moment))) {
        let (workspace, output) = stop_for_a_moment(&cores, role, moment);
        let context = format!("{role} {moment:?}: {}{}", stdout(&output), stderr(&output));
        assert_played(&workspace.run_folder(), output.status, &context);
    }
}
