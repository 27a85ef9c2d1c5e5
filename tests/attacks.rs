//! Hostile peers of a run: with any of them, an interrupt and a death end the run as without them, and the honest are served.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use masseter_runtime::clock;
use masseter_runtime::lifecycle::attach::socket;
use masseter_runtime::named::access;
use masseter_runtime::transport::Domain;

use crate::common::{
    MASSETER, Workspace, child_of, ended, masseter, stderr, wait_until, wait_until_it_records,
};
use rustix::process::{Pid, Signal, kill_process};

/// Longest time to the end of a run on a machine that has other work. A supervisor that waits for a peer takes half a minute.
const LONGEST_END: Duration = Duration::from_secs(20);

/// What a hostile program does at a socket, again and again.
#[derive(Debug, Clone, Copy)]
enum Attack {
    /// A byte now and then.
    Drip,
    /// A hundred connections without a byte.
    Silent,
    /// Connects and leaves.
    Reconnect,
    /// A greeting that is refused.
    Refused,
    /// Lines without an end.
    Flood,
}

impl Attack {
    const ALL: [Self; 5] = [Self::Drip, Self::Silent, Self::Reconnect, Self::Refused, Self::Flood];

    /// One round. A refused write or connection is what the rig is for.
    fn strike(self, path: &Path, held: &mut Vec<UnixStream>) {
        held.retain_mut(|peer| !matches!(self, Self::Drip) || peer.write_all(b"x").is_ok());
        if held.len() > 100 {
            held.clear();
        }
        let Ok(mut peer) = UnixStream::connect(path) else { return };
        match self {
            Self::Drip | Self::Silent => held.push(peer),
            Self::Reconnect => {}
            Self::Refused => {
                let _ = peer.write_all(b"hello\n");
                let _ = peer.read(&mut [0; 4096]);
            }
            Self::Flood => {
                let _ = peer.write_all(&b"x".repeat(65_536));
            }
        }
    }
}

/// Threads that make every attack on a socket until they are dropped.
struct Attackers {
    is_over: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Attackers {
    fn of(path: &Path) -> Self {
        let is_over = Arc::new(AtomicBool::new(false));
        let threads = [Attack::ALL; 3].into_iter().flatten().map(|attack| {
            let (is_over, path) = (Arc::clone(&is_over), path.to_owned());
            thread::spawn(move || {
                let mut held = Vec::new();
                while !is_over.load(Ordering::Relaxed) {
                    attack.strike(&path, &mut held);
                    thread::sleep(Duration::from_millis(5));
                }
            })
        });
        let threads = threads.collect();
        Self { is_over, threads }
    }
}

impl Drop for Attackers {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| thread.join().unwrap());
    }
}

/// A run of two minutes in simulated time with a program as its controller, and its socket for programs.
fn running(workspace: &Workspace, name: &str) -> (Child, Child, PathBuf) {
    let arguments = ["--controller", "external", "--duration", "120", "--name", name, "--patience", "none"];
    let rig = workspace.start_lockstep(&arguments);
    let path = socket(&Domain::named(name).unwrap());
    wait_until("the rig waits", || UnixStream::connect(&path).is_ok());
    let mut controller = Command::new(MASSETER);
    let controller = controller.args(["controller", "--rig", name]).stderr(Stdio::null()).spawn().unwrap();
    wait_until_it_records(workspace);
    (rig, controller, path)
}

/// One attack of each kind and one hit: `tests/realtime/attacked.py` mixes them at random, in real time, with a live page.
#[test]
fn an_interrupt_and_a_death_end_the_run_under_attack_as_without_one() {
    for (name, code) in [("interrupted", 130), ("bereft", 4)] {
        let workspace = Workspace::new("");
        let (rig, mut controller, path) = running(&workspace, &format!("{name}-{}", std::process::id()));
        let attackers = Attackers::of(&path);
        thread::sleep(Duration::from_millis(300));
        let began_ns = clock::now_ns();
        match code {
            130 => kill_process(Pid::from_child(&rig), Signal::INT).unwrap(),
            _ => kill_process(child_of(&rig, "plant"), Signal::KILL).unwrap(),
        }
        let said = ended(rig, code);
        let taken = Duration::from_nanos(clock::now_ns() - began_ns);
        drop(attackers);
        controller.wait().unwrap();
        assert!(taken < LONGEST_END, "{name}: {taken:?}");
        assert!(code == 130 || said.contains("the plant died: SIGKILL (9)"), "{said}");
        let refusals = said.lines().filter(|line| line.contains("refused")).count();
        // One line a second, whatever the number of attacks.
        assert!(refusals <= taken.as_secs() as usize + 3, "{name}: {said}");
    }
}

#[test]
fn a_value_that_was_refused_is_not_set_later() {
    let workspace = Workspace::new("");
    let name = format!("frozen-{}", std::process::id());
    let (rig, controller, _) = running(&workspace, &name);
    let domain = Domain::named(&name).unwrap();
    wait_until("the controller takes parameters", || access::list(&domain).is_ok());
    kill_process(Pid::from_child(&controller), Signal::STOP).unwrap();
    let refused = masseter(&["param", "set", "motion_rate=0.25", "--rig", &name]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("the request has expired"), "{}", stderr(&refused));
    kill_process(Pid::from_child(&controller), Signal::CONT).unwrap();
    wait_until("the controller goes on", || access::list(&domain).is_ok());
    let parameters = access::list(&domain).unwrap();
    let rate = parameters.iter().find(|parameter| parameter.name == "motion_rate").unwrap();
    assert!((rate.value - 1.0).abs() < f64::EPSILON, "{rate:?}");
    kill_process(Pid::from_child(&rig), Signal::INT).unwrap();
    rig.wait_with_output().unwrap();
}
