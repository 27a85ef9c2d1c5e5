//! The master's cycle: SYNC and heartbeat, process data in, process data out.

use masseter_can::canopen::{Heartbeat, NmtState, NodeId, sync};
use masseter_can::{Bus, ReceiveError};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::codes::{Cause, DriveRequest, DriveState, drive_request, drive_state_code};
use masseter_shared::messages::{Command, Event, Reading};
use masseter_shared::realtime::Wake;

use super::node::Node;
pub(crate) use super::node::Scale;
use super::plan::Setup;
use super::supervision::Place;
use crate::journal::{Journal, overflow};
use crate::link::Buses;

/// Frames taken from a bus in one go, so that a babbling node cannot hold the cycle up.
const FRAMES_AT_ONCE: usize = 512;

/// One drive, as the master expects it.
#[derive(Debug, Clone)]
pub(crate) struct DriveSettings {
    /// Its node id.
    pub(crate) id: NodeId,
    /// The bus it hangs on.
    pub(crate) bus: usize,
    /// What its process data count.
    pub(crate) scale: Scale,
    /// What it must be, and is configured with.
    pub(crate) setup: Setup,
}

/// What the master is configured with.
#[derive(Debug, Clone)]
pub(crate) struct MasterSettings {
    /// Its own node id, for its heartbeat.
    pub(crate) id: NodeId,
    /// The drives in the order of the axes.
    pub(crate) drives: [DriveSettings; AXES],
    /// Buses.
    pub(crate) buses: usize,
    /// From the first to the last bit of SYNC, which makes the drives sample, ns.
    pub(crate) sync_ns: u64,
    /// Interval of its own heartbeat, ns.
    pub(crate) heartbeat_ns: u64,
    /// Silence of a drive that counts as its loss, ns.
    pub(crate) heartbeat_timeout_ns: u64,
    /// How long the drives may take to become operational, ns.
    pub(crate) boot_timeout_ns: u64,
    /// Cycles without a fresh command before the drives are stopped.
    pub(crate) command_timeout_cycles: u32,
}

/// How long the master refuses to move anything.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stop {
    /// Until every drive is verified again and the controller has switched them off.
    UntilRestored,
    /// For good.
    ForGood,
}

/// What the master remembers of a bus.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BusWatch {
    pub(super) is_off: bool,
    /// When the cycle's SYNC, or the last one seen, was on the wire, as far as the tap tells.
    pub(super) sync_ns: u64,
    /// Whether any drive was ever heard.
    pub(super) is_heard: bool,
    /// Nodes reported as unknown, bit i for node i.
    pub(super) unknown_nodes: u128,
    /// The axis whose SDO request went out last.
    pub(super) last_served: usize,
}

/// The master.
#[derive(Debug)]
pub(crate) struct Master {
    pub(super) settings: MasterSettings,
    pub(super) nodes: [Node; AXES],
    pub(super) buses: Vec<BusWatch>,
    pub(super) wake: Wake,
    pub(super) sync_ns: u64,
    pub(super) complete_ns: u64,
    next_heartbeat_ns: u64,
    pub(super) command: Option<Command>,
    command_received_ns: u64,
    pub(super) silent_cycles: u32,
    pub(super) were_enabled: bool,
    pub(super) fault: Option<Stop>,
    is_ending: bool,
    pub(super) journal: Journal,
}

impl Master {
    /// A master that begins at `now_ns` and knows nothing of its drives yet.
    pub(crate) fn new(settings: MasterSettings, now_ns: u64) -> Self {
        Self {
            nodes: std::array::from_fn(|axis| {
                let DriveSettings { id, bus, scale, setup } = &settings.drives[axis];
                Node::new(*id, *bus, *scale, setup, now_ns)
            }),
            buses: vec![BusWatch::default(); settings.buses],
            settings,
            wake: Wake::on_time(0, 0),
            sync_ns: 0,
            complete_ns: 0,
            next_heartbeat_ns: now_ns,
            command: None,
            command_received_ns: 0,
            silent_cycles: 0,
            were_enabled: false,
            fault: None,
            is_ending: false,
            journal: Journal::new(),
        }
    }

    /// SYNC on every bus, and the heartbeat when it is due.
    pub(crate) fn begin_cycle(&mut self, wake: Wake, buses: &mut impl Buses) {
        (self.wake, self.sync_ns, self.complete_ns) = (wake, wake.woke_ns, 0);
        let beats = wake.woke_ns >= self.next_heartbeat_ns;
        if beats {
            self.next_heartbeat_ns = wake.woke_ns + self.settings.heartbeat_ns;
        }
        for node in &mut self.nodes {
            node.begin_cycle();
        }
        self.watch_buses(wake.woke_ns, buses);
        for bus in 0..self.settings.buses {
            let result = buses.port(bus).send(wake.woke_ns, sync::frame());
            self.check_sent(bus, result);
            if beats {
                let heartbeat = Heartbeat { state: NmtState::Operational }.frame(self.settings.id);
                let result = buses.port(bus).send(wake.woke_ns, heartbeat);
                self.check_sent(bus, result);
            }
        }
    }

    /// Takes what has arrived; whether the process data of all drives are in.
    pub(crate) fn collect(&mut self, now_ns: u64, buses: &mut impl Buses) -> bool {
        for bus in 0..self.settings.buses {
            for _ in 0..FRAMES_AT_ONCE {
                match buses.port(bus).receive(now_ns) {
                    Ok(Some(received)) => self.take(bus, &received),
                    // What it lost is missed as process data; what came before and after it is still there.
                    Err(ReceiveError::Overrun { .. }) => {}
                    Ok(None) | Err(ReceiveError::InterfaceDown { .. } | ReceiveError::Os { .. }) => break,
                }
            }
        }
        (0..AXES).all(|axis| self.is_fresh(axis))
    }

    /// A SYNC was seen on a wire. One that was repeated is answered again, but has its answer already.
    pub(crate) fn note_sync(&mut self, bus: usize, time_ns: u64) {
        let seen_ns = &mut self.buses[bus].sync_ns;
        if *seen_ns < self.sync_ns {
            *seen_ns = time_ns;
        }
    }

    /// Whether a drive has answered this cycle's SYNC. Process data of an earlier one may come late, even between the
    /// moment this one was queued and that in which it was on the wire.
    pub(super) fn is_fresh(&self, axis: usize) -> bool {
        let node = &self.nodes[axis];
        node.has_answered_since(self.sync_ns.max(self.buses[node.bus].sync_ns))
    }

    /// This cycle's reading, without the times that the link alone knows.
    pub(crate) fn fill_reading(&self, reading: &mut Reading) {
        *reading = Reading {
            cycle: self.wake.cycle,
            answers_cycle: self.command.map_or(0, |command| command.cycle),
            sampled_ns: self.sync_ns + self.settings.sync_ns,
            complete_ns: self.complete_ns,
            command_received_ns: self.command_received_ns,
            due_ns: self.wake.due_ns,
            woke_ns: self.wake.woke_ns,
            skipped_cycles: self.wake.skipped,
            stalled_ns: self.wake.account.stalled_ns,
            spun_ns: self.wake.account.spun_ns,
            worked_ns: self.wake.account.worked_ns,
            overlong_ns: self.wake.account.overlong_ns,
            master_fault: u32::from(self.fault.is_some()),
            ..Reading::default()
        };
        for (axis, node) in self.nodes.iter().enumerate() {
            reading.position_m[axis] = node.position_m();
            reading.force_n[axis] = node.force_n();
            reading.drive_state[axis] = drive_state_code(node.drive_state());
            reading.fresh_axes |= u32::from(self.is_fresh(axis)) << axis;
        }
    }

    /// Judges the cycle, takes the newest command, sends every drive its process data, and after them
    /// what drives that have none need to boot.
    pub(crate) fn apply(&mut self, now_ns: u64, command: Option<&Command>, buses: &mut impl Buses) {
        self.supervise(now_ns);
        self.take_command(now_ns, command);
        self.restore(now_ns);
        let request = self.request();
        let targets_m = self.command.map_or([0.0; AXES], |command| command.target_m);
        for (axis, target_m) in targets_m.into_iter().enumerate() {
            let node = &mut self.nodes[axis];
            if node.is_operational() {
                let (bus, frame) = (node.bus, node.process_data(request, target_m).frame(node.id));
                let result = buses.port(bus).send(now_ns, frame);
                self.check_sent(bus, result);
            }
        }
        self.boot(now_ns, buses);
    }

    /// Stops the drives from the next process data on, for the end: commands are not waited for any more.
    pub(crate) fn stop(&mut self) {
        self.is_ending = true;
    }

    /// What is asked of the drives: what the last good command asks, unless something is wrong or the end was asked
    /// for, and nothing that moves before every drive is verified.
    pub(super) fn request(&self) -> DriveRequest {
        if self.fault.is_some() || self.is_ending {
            return DriveRequest::QuickStop;
        }
        if !self.nodes.iter().all(Node::is_ready) {
            return DriveRequest::Off;
        }
        let request = self.command.map(|command| drive_request(command.request));
        request.and_then(Result::ok).unwrap_or(DriveRequest::Off)
    }

    fn take_command(&mut self, now_ns: u64, command: Option<&Command>) {
        let Some(command) = command else {
            self.silent_cycles = self.silent_cycles.saturating_add(1);
            let limit = self.settings.command_timeout_cycles;
            // Who has the drives off or stopping may go: they need nobody for it.
            let is_waited_for = self.request() == DriveRequest::Enable;
            if is_waited_for && self.silent_cycles > limit {
                self.fail(
                    now_ns,
                    Cause::CommandLost,
                    Place::Nowhere,
                    [f64::from(self.silent_cycles), f64::from(limit)],
                );
            }
            return;
        };
        self.silent_cycles = 0;
        if let Some((place, value)) = self.fault_of(command) {
            self.fail(now_ns, Cause::BadMessage, place, [value, 0.0]);
        } else {
            (self.command, self.command_received_ns) = (Some(*command), now_ns);
        }
    }

    /// The first value of a command that no drive can be told, and whose it is.
    fn fault_of(&self, command: &Command) -> Option<(Place, f64)> {
        let bad_target = (0..AXES).find(|&axis| !self.nodes[axis].can_go_to(command.target_m[axis]));
        if let Some(axis) = bad_target {
            return Some((Place::Axis(axis), command.target_m[axis]));
        }
        let is_unknown = drive_request(command.request).is_err();
        is_unknown.then(|| (Place::Nowhere, f64::from(command.request)))
    }

    /// Cycles since the last command.
    pub(crate) fn silent_cycles(&self) -> u32 {
        self.silent_cycles
    }

    /// Whether no drive reports voltage. A lost one reports nothing, and is not waited for: it stops by itself.
    pub(crate) fn drives_are_off(&self) -> bool {
        !self.nodes.iter().filter_map(Node::drive_state).any(DriveState::is_powered)
    }

    /// Notes that so many tapped frames had no room.
    pub(crate) fn note_lost(&mut self, time_ns: u64, lost: u64) {
        self.journal.add(overflow(time_ns, self.wake.cycle, lost));
    }

    /// Hands out the events since the last drain.
    pub(crate) fn drain_events(&mut self, out: &mut impl FnMut(Event)) {
        self.journal.drain(out);
    }
}
