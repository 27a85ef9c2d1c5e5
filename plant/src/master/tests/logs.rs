//! Recorded exchanges, replayed at the master: every log of the folder `plant/src/master/logs`.
//!
//! The master must send what it sent when the log was recorded, and report the faults that comments of the log name. The
//! commands follow from the process data in the log; [the folder](../logs/README.md) says how a log gets there.

use std::fs;
use std::path::{Path, PathBuf};

use masseter_can::canopen::Cob;
use masseter_can::cia402::Controlword;
use masseter_can::{Bus, CanId, Frame, ReplayBus, Role, Rpdo1, candump};
use masseter_runtime::{clock::MILLISECOND_NS, schedule::CycleSchedule};
use masseter_scenario::MASTER_NODE;

use super::*;
use crate::master::link::{Address, Buses};

/// Periods by which a frame may come early or late: answers come before the look at the bus in a cycle or after it.
const WINDOW_PERIODS: u64 = 3;
/// A comment of the log with a fault that the master must report.
const FAULT: &str = "# fault: ";
/// A comment with the time from the master's start to its first SYNC, ms; 0 without one.
const STARTED: &str = "# started, ms before the first SYNC: ";

struct Wires(Vec<ReplayBus>);

impl Buses for Wires {
    fn port(&mut self, bus: usize) -> impl Bus {
        &mut self.0[bus]
    }
}

/// The master's heartbeat is left out: on a computer in real time it comes a cycle earlier or later.
fn role(id: CanId) -> Role {
    match Cob::try_from(id) {
        Ok(Cob::Heartbeat(MASTER_NODE)) => Role::LeftOut,
        Ok(Cob::Sync | Cob::Nmt | Cob::Rpdo1(_) | Cob::SdoRequest(_)) => Role::Sent,
        _ => Role::Received,
    }
}

/// A replay of a log.
struct Replay<'a> {
    scenario: &'a Scenario,
    master: Master,
    wires: Wires,
    events: Vec<Event>,
    is_enabled: bool,
}

impl<'a> Replay<'a> {
    fn new(log: &str, scenario: &'a Scenario) -> Self {
        let window_ns = WINDOW_PERIODS * scenario.period_ns();
        let bus = |bus: usize| {
            let simulated = format!("can{bus}");
            let interface = scenario.can.interfaces.get(bus).unwrap_or(&simulated);
            ReplayBus::new(log, interface, role).unwrap().within(window_ns)
        };
        let wires = Wires((0..scenario.can.buses.len()).map(bus).collect());
        let before_ms = comments(log, STARTED).next().map_or(0, |ms| ms.parse().unwrap());
        let sync_ns = wires.next_sync_ns().expect("a log with a SYNC of the master");
        let master = Master::new(scenario, sync_ns - before_ms * MILLISECOND_NS).unwrap();
        Self { scenario, master, wires, events: Vec::new(), is_enabled: false }
    }

    /// Plays every cycle of the log.
    fn play(&mut self) {
        let start_ns = self.wires.next_sync_ns().expect("a log with a SYNC of the master");
        let period_ns = self.scenario.period_ns();
        let schedule = CycleSchedule::new(self.scenario).unwrap();
        while let Some(sync_ns) = self.wires.next_sync_ns() {
            let cycle = 1 + (sync_ns - start_ns + period_ns / 2) / period_ns;
            let syncs: Vec<_> = self.wires.0.iter().map(|bus| bus.next_due(Cob::Sync.into())).collect();
            self.master.begin_cycle(Wake::on_time(cycle, sync_ns), &mut self.wires);
            for (bus, sync) in syncs.into_iter().enumerate().filter_map(|(bus, sync)| Some((bus, sync?))) {
                self.master.note_sync(bus, sync.time_ns);
            }
            self.master.collect(sync_ns + schedule.reading_by_ns, &mut self.wires);
            let command = self.command(cycle);
            self.master.apply(sync_ns + schedule.controller_at_ns, command.as_ref(), &mut self.wires);
            self.master.drain_events(&mut |event| self.events.push(event));
            // Without its SYNC the replay goes no further.
            if self.wires.next_sync_ns() == Some(sync_ns) {
                break;
            }
        }
        self.master.collect(u64::MAX, &mut self.wires);
        self.master.drain_events(&mut |event| self.events.push(event));
    }

    /// The command that led to the next process data in the log; none where the log has no further ones. The drives are
    /// to be enabled from the first controlword "shutdown" on.
    fn command(&mut self, cycle: u64) -> Option<Command> {
        let mut command = Command { cycle, version: LAYOUT_VERSION, ..Command::default() };
        for axis in 0..AXES {
            let Address { bus, node } = self.master.drives[axis].address;
            let next = self.wires.0[bus].next_due(Cob::Rpdo1(node).into())?;
            let mapping = self.scenario.profile(axis).pdos.rpdo1();
            let rpdo = Rpdo1::decode(next.frame.data(), &mapping).unwrap();
            let scale = self.scenario.scale(axis);
            command.target_m[axis] = scale.metres(rpdo.target_increments);
            command.force_offset_n[axis] = f64::from(rpdo.torque_offset_permille) * scale.permille_n;
            self.is_enabled |= rpdo.controlword == Controlword::SHUTDOWN;
        }
        let request = if self.is_enabled { DriveRequest::Enable } else { DriveRequest::Off };
        Some(Command { request: request.code(), ..command })
    }

    /// The faults of the master, as a log names them.
    fn faults(&self) -> Vec<String> {
        let faults = self.events.iter().filter(|event| event.kind == EventKind::Fault.code());
        let name = |event: &Event| format!("node {} {}", event.node, Cause::try_from(event.cause).unwrap());
        faults.map(name).collect()
    }
}

impl Wires {
    /// Time of the next SYNC, ns.
    fn next_sync_ns(&self) -> Option<u64> {
        self.0.iter().filter_map(|bus| bus.next_due(Cob::Sync.into())).map(|sync| sync.time_ns).min()
    }
}

/// What the comments of that kind say.
fn comments<'a>(log: &'a str, kind: &str) -> impl Iterator<Item = &'a str> {
    log.lines().filter_map(move |line| line.strip_prefix(kind))
}

/// Replays a log; says what differs first.
fn replay(log: &str, scenario: &Scenario) -> Result<(), String> {
    let mut replay = Replay::new(log, scenario);
    replay.play();
    let differences: Vec<_> = replay.wires.0.iter().filter_map(|bus| bus.finish().err()).collect();
    if !differences.is_empty() {
        let differences: Vec<_> = differences.iter().map(ToString::to_string).collect();
        return Err(format!("{}; faults: {:?}", differences.join("; "), replay.faults()));
    }
    let expected: Vec<_> = comments(log, FAULT).collect();
    let faults = replay.faults();
    if faults == expected { Ok(()) } else { Err(format!("faults {faults:?} instead of {expected:?}")) }
}

/// The logs with their scenarios.
fn corpus() -> Vec<(PathBuf, String, Scenario)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/master/logs");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut logs: Vec<_> = files.filter(|path| path.extension().is_some_and(|end| end == "log")).collect();
    logs.sort();
    let read = |path: PathBuf| {
        let scenario = Scenario::read(&path.with_extension("toml")).unwrap();
        (path.clone(), fs::read_to_string(path).unwrap(), scenario)
    };
    logs.into_iter().map(read).collect()
}

#[test]
fn the_master_sends_what_every_log_says() {
    let differences: Vec<_> = corpus()
        .into_iter()
        .filter_map(|(path, log, scenario)| {
            Some(format!("{}: {}", path.display(), replay(&log, &scenario).err()?))
        })
        .collect();
    assert!(differences.is_empty(), "{}", differences.join("\n"));
}

/// What a change makes of a log: line numbers stay.
fn altered(log: &str, number: usize, alter: impl Fn(&str) -> String) -> String {
    let alter = |(line, at): (&str, usize)| if at == number { alter(line) } else { line.to_owned() };
    log.lines().zip(1..).map(|line| alter(line) + "\n").collect()
}

/// The frame with one bit of a byte inverted.
fn inverted(frame: Frame, byte: usize) -> Frame {
    let mut data = frame.data().to_vec();
    data[byte] ^= 0x10;
    Frame::new(frame.id(), &data).unwrap()
}

/// The frames of a log with their lines.
fn frames(log: &str) -> impl Iterator<Item = (usize, Frame)> {
    candump::read(log).map(Result::unwrap).filter_map(|line| Some((line.number, line.tapped.frame()?.frame)))
}

/// As if the master sent another value, or something that the log does not have: in every log at many places.
#[test]
fn another_behaviour_of_the_master_fails_at_its_line() {
    for (path, log, scenario) in corpus() {
        let own: Vec<_> = frames(&log).filter(|(_, frame)| role(frame.id()) == Role::Sent).collect();
        for &(number, frame) in own.iter().filter(|(_, frame)| !frame.data().is_empty()).step_by(47) {
            // The targets of process data are the commands of the replay; byte 0 has the controlword.
            let is_process_data = matches!(Cob::try_from(frame.id()), Ok(Cob::Rpdo1(_)));
            let other = inverted(frame, if is_process_data { 0 } else { frame.data().len() - 1 });
            let changed = altered(&log, number, |line| line.replace(&frame.to_string(), &other.to_string()));
            let differences = replay(&changed, &scenario).unwrap_err();
            let expected = format!("line {number}: {other} in the log, but {frame} is sent");
            assert!(differences.contains(&expected), "{}: {differences}", path.display());
            let is_last = own.iter().rfind(|(_, last)| last.id() == frame.id()).unwrap().0 == number;
            if !is_last {
                let removed = altered(&log, number, |_| String::new());
                let differences = replay(&removed, &scenario).expect_err("the frame is sent");
                assert!(
                    differences.contains("is sent"),
                    "{}: without line {number}: {differences}",
                    path.display()
                );
            }
        }
    }
}

/// Each drive of each log answers with another vendor (1018h:01h).
#[test]
fn other_answers_of_a_drive_make_other_faults() {
    for (path, log, scenario) in corpus() {
        for node in scenario.can.node_ids {
            let begin = format!("58{node}#43181001");
            let vendor = |&(_, frame): &(usize, Frame)| frame.to_string().starts_with(&begin);
            let (number, frame) = frames(&log).find(vendor).unwrap();
            let other = inverted(frame, 4);
            let changed = altered(&log, number, |line| line.replace(&frame.to_string(), &other.to_string()));
            let differences = replay(&changed, &scenario).unwrap_err();
            assert!(
                differences.contains(&format!("node {node} wrong_identity")),
                "{}: {differences}",
                path.display()
            );
        }
    }
}
