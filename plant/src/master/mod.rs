//! The CAN master: boots the drives and verifies them, exchanges process data with them every cycle, supervises them,
//! and stops them when commands cease.
//!
//! [`Master`] sequences its parts. [`boot`] verifies one drive, [`drive`] keeps what is known of it, [`exchange`] keeps
//! the cycle's times, [`commands`] the controller's commands, [`supervision`] watches enabled drives, and [`interlock`]
//! remembers whether drives may move. The parts return frames and judgements; only the master sends.
//!
//! The master is written against the bus trait alone ([`Buses`]), so that simulated and real wires are the same to it.
//! SDO takes place only with drives that exchange no process data, with one request a bus and cycle, queued after the
//! process data. So a bus never carries more than the [time table](masseter_shared::schedule) allows for.

mod boot;
mod bus_monitor;
mod commands;
mod drive;
mod events;
mod exchange;
mod incoming;
mod interlock;
mod presence;
mod supervision;

#[cfg(test)]
mod tests;

use masseter_can::canopen::{
    Cob, Emergency, Heartbeat, LengthError, Nmt, NmtCommand, NmtState, NmtTarget, NodeId, sync,
};
use masseter_can::{Bus, CanId, Frame, ReceiveError, Received, Tpdo1};
use masseter_shared::config::Scenario;
use masseter_shared::geometry::AXES;
use masseter_shared::messages::codes::{
    BootPhase, Cause, DriveRequest, DriveState, EventKind, Source, drive_state_code,
};
use masseter_shared::messages::{Command, Event, Reading};
use masseter_shared::realtime::Wake;

use crate::error::PlantError;
use crate::link::Buses;
use crate::link::layout::{drive_ports, node_ids};
use bus_monitor::BusMonitor;
use commands::Commands;
use drive::{Finding, RemoteDrive};
use events::{EventLog, Subject};
use exchange::Exchange;
use incoming::{Kind, Message};
use interlock::{Failure, Interlock};
use supervision::Supervision;

pub(crate) use boot::shortest_boot;

/// Frames taken from a bus at once, so that a babbling node cannot stop the cycle.
const FRAMES_AT_ONCE: usize = 512;

/// The master.
#[derive(Debug)]
pub(crate) struct Master {
    id: NodeId,
    drives: [RemoteDrive; AXES],
    buses: Vec<BusMonitor>,
    /// The axis whose SDO request was sent last on each bus.
    last_served: Vec<usize>,
    exchange: Exchange,
    commands: Commands,
    supervision: Supervision,
    interlock: Interlock,
    events: EventLog,
    is_ending: bool,
}

impl Master {
    /// The scenario's master, which begins at `now_ns` without any knowledge of its drives.
    ///
    /// # Errors
    /// [`PlantError`] for buses, node ids and bit rates that cannot be used.
    pub(crate) fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let can = &scenario.can;
        let (ports, ids) = (drive_ports(can)?, node_ids(can)?);
        let addresses = std::array::from_fn(|axis| (ids[axis], ports[axis].bus));
        let drive = |axis: usize| {
            let (id, bus) = addresses[axis];
            RemoteDrive::new(scenario, axis, id, bus, now_ns)
        };
        Ok(Self {
            id: NodeId::MASTER,
            drives: std::array::from_fn(drive),
            buses: vec![BusMonitor::default(); can.buses.len()],
            last_served: vec![0; can.buses.len()],
            exchange: Exchange::new(can, now_ns)?,
            commands: Commands::new(can.command_timeout_cycles),
            supervision: Supervision::default(),
            interlock: Interlock::default(),
            events: EventLog::new(addresses),
            is_ending: false,
        })
    }

    /// Begins a cycle: SYNC on every bus, and the heartbeat when it is due.
    pub(crate) fn begin_cycle(&mut self, wake: Wake, buses: &mut impl Buses) {
        let now_ns = wake.woke_ns;
        self.events.begin_cycle(wake.cycle);
        let is_heartbeat_due = self.exchange.begin_cycle(wake);
        self.drives.iter_mut().for_each(RemoteDrive::begin_cycle);
        self.watch_buses(now_ns, buses);
        for bus in 0..self.buses.len() {
            self.send(now_ns, bus, sync::frame(), buses);
            if is_heartbeat_due {
                let heartbeat = Heartbeat { state: NmtState::Operational }.frame(self.id);
                self.send(now_ns, bus, heartbeat, buses);
            }
        }
    }

    /// Takes the frames that have arrived; returns whether the process data of all drives are in.
    pub(crate) fn collect(&mut self, now_ns: u64, buses: &mut impl Buses) -> bool {
        for bus in 0..self.buses.len() {
            for _ in 0..FRAMES_AT_ONCE {
                match buses.port(bus).receive(now_ns) {
                    Ok(Some(received)) => self.take(bus, &received),
                    // Lost frames show as missing process data; the others are still there.
                    Err(ReceiveError::Overrun { .. }) => {}
                    Ok(None) | Err(ReceiveError::Os { .. }) => break,
                }
            }
        }
        (0..AXES).all(|axis| self.is_fresh(axis))
    }

    /// A SYNC was seen on a wire.
    pub(crate) fn note_sync(&mut self, bus: usize, time_ns: u64) {
        self.exchange.note_sync(bus, time_ns);
    }

    /// Writes this cycle's reading, without the times that only the link knows.
    pub(crate) fn fill_reading(&self, reading: &mut Reading) {
        *reading = Reading { master_fault: u32::from(self.interlock.is_locked()), ..Reading::default() };
        self.exchange.fill_reading(reading);
        self.commands.fill_reading(reading);
        for (axis, drive) in self.drives.iter().enumerate() {
            reading.position_m[axis] = drive.position_m();
            reading.force_n[axis] = drive.force_n();
            reading.drive_state[axis] = drive_state_code(drive.drive_state());
            reading.fresh_axes |= u32::from(self.is_fresh(axis)) << axis;
        }
    }

    /// Judges the cycle, takes the newest command, sends every drive its process data, and then the messages of booting
    /// drives.
    pub(crate) fn apply(&mut self, now_ns: u64, command: Option<&Command>, buses: &mut impl Buses) {
        self.supervise(now_ns);
        self.take_command(now_ns, command);
        self.restore(now_ns);
        let (request, targets_m) = (self.request(), self.commands.targets_m());
        for (axis, target_m) in targets_m.into_iter().enumerate() {
            if let Some(frame) = self.drives[axis].process_data(request, target_m) {
                self.send(now_ns, self.drives[axis].bus, frame, buses);
            }
        }
        self.boot(now_ns, buses);
    }

    /// Stops the drives from the next process data on, for the end: commands are not needed any more.
    pub(crate) fn stop(&mut self) {
        self.is_ending = true;
    }

    /// Cycles since the last command.
    pub(crate) fn silent_cycles(&self) -> u32 {
        self.commands.silent_cycles()
    }

    /// Whether no drive reports voltage. A lost drive reports nothing and is not waited for: it stops by itself.
    pub(crate) fn drives_are_off(&self) -> bool {
        !self.drives.iter().filter_map(RemoteDrive::drive_state).any(DriveState::is_powered)
    }

    /// Reports that tapped frames had no room.
    pub(crate) fn note_lost(&mut self, time_ns: u64, lost: u64) {
        self.events.add_lost(time_ns, lost);
    }

    /// Hands out the events since the last drain.
    pub(crate) fn drain_events(&mut self, out: &mut impl FnMut(Event)) {
        self.events.drain(out);
    }

    /// Whether a drive has answered this cycle's SYNC.
    fn is_fresh(&self, axis: usize) -> bool {
        let drive = &self.drives[axis];
        drive.has_answered_since(self.exchange.answered_after_ns(drive.bus))
    }

    /// The request to the drives: that of the last valid command, unless there is a fault or the end is asked for, and
    /// none that moves before every drive is verified.
    fn request(&self) -> DriveRequest {
        if self.interlock.is_locked() || self.is_ending {
            DriveRequest::QuickStop
        } else if self.drives.iter().all(RemoteDrive::is_ready) {
            self.commands.request()
        } else {
            DriveRequest::Off
        }
    }

    fn supervise(&mut self, now_ns: u64) {
        let is_enable = self.request() == DriveRequest::Enable;
        let mut all_are_enabled = true;
        for axis in 0..AXES {
            let is_fresh = self.is_fresh(axis);
            match self.drives[axis].judge(now_ns, is_fresh) {
                Some(Finding::Absent(failure)) => self.fail_boot(now_ns, axis, &failure),
                Some(Finding::Lost(failure)) => {
                    self.fail(now_ns, Subject::Axis(axis), &failure);
                    self.drives[axis].forget(now_ns);
                    self.report_boot(now_ns, axis, Ok(()));
                }
                None => {}
            }
            let state = self.drives[axis].drive_state();
            all_are_enabled &= state == Some(DriveState::OperationEnabled);
            if let Some(failure) = self.supervision.judge(state, is_enable) {
                self.fail(now_ns, Subject::Axis(axis), &failure);
            }
        }
        self.supervision.end_cycle(is_enable, all_are_enabled);
    }

    /// Reports a bus that goes off and one that returns; the drives of a bus in bus-off stop by themselves.
    fn watch_buses(&mut self, now_ns: u64, buses: &mut impl Buses) {
        for bus in 0..self.buses.len() {
            let status = buses.port(bus).status();
            let (subject, value) = (Subject::Bus(bus), f64::from(status.tec));
            match self.buses[bus].set_error_state(status.state) {
                None => {}
                Some(true) => self.fail(now_ns, subject, &Failure::with(Cause::BusOff, [value, 0.0])),
                Some(false) => {
                    self.events.add(now_ns, subject, Event { value, ..notice(Cause::Recovered) });
                }
            }
        }
    }

    fn take_command(&mut self, now_ns: u64, command: Option<&Command>) {
        // A controller whose drives are off or stopping may be silent: they need no command.
        let needs_command = self.request() == DriveRequest::Enable;
        let can_go_to = |axis: usize, target_m| self.drives[axis].can_go_to(target_m);
        if let Err((subject, failure)) = self.commands.take(now_ns, command, needs_command, can_go_to) {
            self.fail(now_ns, subject, &failure);
        }
    }

    /// Ends a stop once every drive is verified again, none has voltage, and the controller has switched them off: a
    /// controller that still demands motion does not know of the stop.
    fn restore(&mut self, now_ns: u64) {
        let is_restored = self.interlock.awaits_restoration()
            && self.commands.switch_off()
            && !self.buses.iter().any(|bus| bus.is_off())
            && self.drives.iter().all(RemoteDrive::is_ready)
            && self.drives_are_off();
        if is_restored {
            self.interlock.release();
            self.supervision = Supervision::default();
            self.events.add(now_ns, Subject::Rig, notice(Cause::Recovered));
        }
    }

    /// Stops the drives. The first cause is reported, its consequences are not.
    fn fail(&mut self, now_ns: u64, subject: Subject, failure: &Failure) {
        if self.interlock.lock(failure.cause) {
            self.events.add(now_ns, subject, failure.event());
        }
    }

    /// Leaves the drives to another master, permanently.
    fn yield_to_other_master(&mut self, now_ns: u64, bus: usize) {
        if self.interlock.lock_permanently() {
            self.events.add(now_ns, Subject::Bus(bus), Failure::new(Cause::SecondMaster).event());
        }
    }

    fn may_boot(&self) -> bool {
        self.interlock.may_boot(self.drives_are_off())
    }

    /// Advances the boot of all drives and sends its messages.
    fn boot(&mut self, now_ns: u64, buses: &mut impl Buses) {
        for axis in 0..AXES {
            self.drives[axis].complete_boot();
            self.report_boot(now_ns, axis, Ok(()));
        }
        for axis in 0..AXES {
            let result = self.drives[axis].advance_boot(now_ns);
            self.report_boot(now_ns, axis, result);
        }
        if !self.may_boot() {
            return;
        }
        for axis in 0..AXES {
            if let Some(command) = self.drives[axis].boot_command(now_ns) {
                self.send_nmt(now_ns, axis, command, buses);
            }
        }
        for bus in 0..self.buses.len() {
            self.send_sdo(now_ns, bus, buses);
        }
        self.start_drives(now_ns, buses);
    }

    /// Sends one SDO request at most; the drives of a bus take turns.
    fn send_sdo(&mut self, now_ns: u64, bus: usize, buses: &mut impl Buses) {
        let last = self.last_served[bus];
        for axis in (1..=AXES).map(|step| (last + step) % AXES) {
            let drive = &mut self.drives[axis];
            if drive.bus == bus
                && let Some(frame) = drive.sdo_request(now_ns)
            {
                self.last_served[bus] = axis;
                return self.send(now_ns, bus, frame, buses);
            }
        }
    }

    /// Starts the drives once all are verified: none moves beside one that is not.
    fn start_drives(&mut self, now_ns: u64, buses: &mut impl Buses) {
        if !self.drives.iter().all(RemoteDrive::is_verified) {
            return;
        }
        for axis in 0..AXES {
            if self.drives[axis].boot_phase() == BootPhase::Configured {
                self.send_nmt(now_ns, axis, NmtCommand::Start, buses);
                self.drives[axis].start(now_ns);
                self.report_boot(now_ns, axis, Ok(()));
            }
        }
    }

    fn send_nmt(&mut self, now_ns: u64, axis: usize, command: NmtCommand, buses: &mut impl Buses) {
        let drive = &self.drives[axis];
        let frame = Nmt { command, target: NmtTarget::Node(drive.id) }.frame();
        self.send(now_ns, drive.bus, frame, buses);
    }

    fn send(&mut self, now_ns: u64, bus: usize, frame: Frame, buses: &mut impl Buses) {
        if let Err(refusal) = buses.port(bus).send(now_ns, frame)
            && self.buses[bus].is_unexplained(&refusal)
        {
            self.fail(self.exchange.begun_ns(), Subject::Bus(bus), &Failure::new(Cause::BusRefused));
        }
    }

    /// Takes a frame. A malformed one is reported once and has no other effect.
    fn take(&mut self, bus: usize, received: &Received) {
        let Ok(cob) = Cob::try_from(received.frame.id()) else { return };
        let time_ns = received.time_ns;
        // Only a master sends SYNC, and this master does not receive its own frames.
        if cob == Cob::Sync {
            return self.yield_to_other_master(time_ns, bus);
        }
        let Some((kind, id)) = Kind::from_cob(cob) else { return };
        if id == self.id {
            return self.yield_to_other_master(time_ns, bus);
        }
        let Some(axis) = self.drives.iter().position(|drive| drive.id == id && drive.bus == bus) else {
            return self.note_unknown(time_ns, id, bus);
        };
        self.buses[bus].note_drive();
        match Message::decode(kind, received.frame.data()) {
            Ok(Message::Heartbeat(state)) => self.take_heartbeat(axis, state, time_ns),
            Ok(Message::ProcessData(tpdo)) => self.take_process_data(axis, tpdo, time_ns),
            Ok(Message::Emergency(emergency)) => self.note_emergency(axis, emergency, time_ns),
            Ok(Message::SdoAnswer(answer)) => {
                let result = self.drives[axis].take_sdo_answer(time_ns, answer);
                self.report_boot(time_ns, axis, result);
            }
            Ok(Message::Foreign) => {}
            Err(error) => {
                if self.drives[axis].is_first_wrong_length(kind) {
                    self.note_wrong_length(axis, cob, &error, time_ns);
                }
            }
        }
    }

    fn take_heartbeat(&mut self, axis: usize, state: NmtState, time_ns: u64) {
        let may_boot = self.may_boot();
        let result = if state == NmtState::BootUp && self.drives[axis].is_started() {
            self.fail(time_ns, Subject::Axis(axis), &Failure::new(Cause::NodeRestarted));
            self.drives[axis].take_restart(time_ns);
            Ok(())
        } else {
            self.drives[axis].take_heartbeat(time_ns, state, may_boot)
        };
        self.report_boot(time_ns, axis, result);
    }

    fn take_process_data(&mut self, axis: usize, tpdo: Tpdo1, time_ns: u64) {
        let Some([before, after]) = self.drives[axis].take_process_data(time_ns, tpdo) else { return };
        self.exchange.note_answer(time_ns);
        if before != after {
            let event = transition(Source::Drive, drive_state_code(before), drive_state_code(after));
            self.events.add(time_ns, Subject::Axis(axis), event);
        }
    }

    /// Before its boot-up, a drive reports emergencies of a time before this master, which resets it.
    fn note_emergency(&mut self, axis: usize, emergency: Emergency, time_ns: u64) {
        let is_past = emergency.is_reset() || self.drives[axis].boot_phase() == BootPhase::Waiting;
        let kind = if is_past { EventKind::Notice } else { EventKind::Fault };
        let (value, limit) = (f64::from(emergency.code.0), f64::from(emergency.register));
        let event = Event { value, limit, ..Event::new(Source::Drive, kind, Cause::Emergency) };
        self.events.add(time_ns, Subject::Axis(axis), event);
    }

    fn note_wrong_length(&mut self, axis: usize, cob: Cob, error: &LengthError, time_ns: u64) {
        let (value, limit) = (error.actual as f64, error.expected as f64);
        let event = Event { object: CanId::from(cob).number(), value, limit, ..notice(Cause::WrongLength) };
        self.events.add(time_ns, Subject::Axis(axis), event);
    }

    /// Reports a node that nobody configured, once.
    fn note_unknown(&mut self, time_ns: u64, id: NodeId, bus: usize) {
        if self.buses[bus].is_new_unknown(id) {
            let event = Event { node: u16::from(id.get()), ..notice(Cause::UnknownNode) };
            self.events.add(time_ns, Subject::Bus(bus), event);
        }
    }

    /// Reports a change of a drive's boot, or its failure.
    fn report_boot(&mut self, time_ns: u64, axis: usize, result: Result<(), Failure>) {
        if let Err(failure) = result {
            self.drives[axis].give_up();
            self.fail_boot(time_ns, axis, &failure);
        }
        if let Some([before, after]) = self.drives[axis].phase_change() {
            let event = transition(Source::Master, before.code(), after.code());
            self.events.add(time_ns, Subject::Axis(axis), event);
        }
    }

    /// Reports why a drive was given up. The failure of one drive to boot is no consequence of another's, so that each is
    /// reported.
    fn fail_boot(&mut self, now_ns: u64, axis: usize, failure: &Failure) {
        self.interlock.lock(failure.cause);
        self.events.add(now_ns, Subject::Axis(axis), failure.event());
    }
}

fn notice(cause: Cause) -> Event {
    Event::new(Source::Master, EventKind::Notice, cause)
}

fn transition(source: Source, from: u32, to: u32) -> Event {
    Event { from, to, ..Event::new(source, EventKind::Transition, Cause::Sequence) }
}
