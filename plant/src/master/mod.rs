//! The CAN master boots and verifies the drives, exchanges process data every cycle, supervises the drives, and stops
//! them when commands cease.
//!
//! [`Master`] sequences its parts. [`boot`] verifies one drive, [`drive`] holds the state of one drive, and
//! [`exchange`] the times of the cycle. [`gate`] judges the controller's commands, and [`supervision`] decides
//! whether drives may move. The parts return frames and failures; only the master sends.
//!
//! The master uses the bus trait alone ([`Buses`]), so simulated and real wires need the same code. SDO takes place
//! only with drives that exchange no process data. A bus has one request a cycle, queued after the process data. The
//! heartbeat is the last message of a cycle. So a bus never has more frames than the [time
//! table](masseter_runtime::schedule) allows for.

mod boot;
pub(crate) mod boot_plan;
mod drive;
pub(crate) mod events;
mod exchange;
mod following;
mod gate;
pub(crate) mod link;
mod presence;
pub mod sdo;
pub(crate) mod sockets;
mod supervision;
pub mod wanted;

#[cfg(test)]
mod tests;

use masseter_can::canopen::{Cob, EmergencyCode, Heartbeat, NmtState, sync};
use masseter_can::{Bus, FULL_QUEUE, Frame, ReceiveError, Received, SendError, wire::worst_case_bits};
use masseter_model::geometry::AXES;
use masseter_runtime::messages::codes::{
    BootPhase, Cause, DriveRequest, DriveState, EventKind, Source, drive_state_code,
};
use masseter_runtime::messages::{Command, Event, Reading};
use masseter_runtime::realtime::Wake;
use masseter_scenario::{MASTER_NODE, Scenario};

use crate::error::PlantError;
use drive::{Change, Message, RemoteDrive};
use events::{EventLog, Failure, Subject, notice, transition};
use exchange::{BusMonitor, Exchange};
use following::Following;
use gate::Commands;
use link::{Address, Buses, addresses, sender};
use supervision::{Enabling, Supervision};

/// Most frames taken from a bus at once, so that a babbling node cannot stop the cycle.
const FRAMES_AT_ONCE: usize = 512;

/// The master.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Master {
    drives: [RemoteDrive; AXES],
    buses: Vec<BusMonitor>,
    exchange: Exchange,
    commands: Commands,
    enabling: Enabling,
    supervision: Supervision,
    events: EventLog,
}

impl Master {
    /// The scenario's master, at `now_ns` without any knowledge of its drives.
    ///
    /// # Errors
    /// [`PlantError`] for buses, node ids and bit rates that cannot be used.
    pub(crate) fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let can = &scenario.can;
        let addresses = addresses(can)?;
        let bitrate = can.bitrate()?;
        let rpdo_ns = |&axis: &usize| {
            let length = scenario.profile(axis).pdos.rpdo1().length();
            bitrate.bits_to_ns(worst_case_bits(length as u32, false))
        };
        let drive = |axis: usize| {
            let address = addresses[axis];
            let following = Following::new(scenario, axis, can.buses[address.bus].iter().map(rpdo_ns).sum());
            RemoteDrive::new(scenario, axis, address, following, now_ns)
        };
        let drives = (0..AXES).map(drive).collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            drives: drives.try_into().expect("one drive an axis"),
            buses: vec![BusMonitor::default(); can.buses.len()],
            exchange: Exchange::new(can, now_ns)?,
            commands: Commands::new(scenario),
            enabling: Enabling::new(can),
            supervision: Supervision::default(),
            events: EventLog::new(addresses),
        })
    }

    /// Begins a cycle: SYNC on every bus.
    pub(crate) fn begin_cycle(&mut self, wake: Wake, buses: &mut impl Buses) {
        let now_ns = wake.woke_ns;
        self.events.cycle = wake.cycle;
        self.exchange.begin_cycle(wake);
        self.drives.iter_mut().for_each(|drive| drive.begin_cycle(now_ns));
        self.watch_buses(now_ns, buses);
        for bus in 0..self.buses.len() {
            self.watch_queue(now_ns, bus, buses);
            self.send(now_ns, bus, sync::frame(), buses);
        }
    }

    /// Takes the arrived frames; returns whether the process data of all drives are in.
    pub(crate) fn collect(&mut self, now_ns: u64, buses: &mut impl Buses) -> bool {
        for bus in 0..self.buses.len() {
            for _ in 0..FRAMES_AT_ONCE {
                match buses.port(bus).receive(now_ns) {
                    Ok(Some(received)) => self.take_frame(bus, &received),
                    // Lost frames show as missing process data; the other frames remain.
                    Err(ReceiveError::Overrun { .. }) => {}
                    Ok(None) => break,
                    Err(ReceiveError::Os { errno }) => {
                        self.fail(now_ns, Subject::Bus(bus), &Failure::with(Cause::BusRefused, errno, 0.0));
                        break;
                    }
                }
            }
        }
        (0..AXES).all(|axis| self.is_fresh(axis))
    }

    /// Notes a SYNC on a wire.
    pub(crate) fn note_sync(&mut self, bus: usize, time_ns: u64) {
        self.exchange.note_sync(bus, time_ns);
    }

    /// Time of the drives' sample in this cycle, for the reading, ns.
    pub(crate) fn sampled_ns(&self) -> u64 {
        self.exchange.sampled_ns()
    }

    /// Writes this cycle's reading, without the times of the link.
    pub(crate) fn fill_reading(&self, reading: &mut Reading) {
        *reading = Reading { master_fault: u32::from(self.supervision.is_stopped()), ..Reading::default() };
        self.exchange.fill_reading(reading);
        self.commands.fill_reading(reading);
        for (axis, drive) in self.drives.iter().enumerate() {
            drive.fill_reading(axis, reading);
            reading.fresh_axes |= u32::from(self.is_fresh(axis)) << axis;
        }
    }

    /// Judges the cycle and takes the newest command. Sends every drive its process data, then the messages of booting
    /// drives, and at last a due heartbeat. So the heartbeat delays no process data on an interface that sends in the
    /// order of its queue.
    pub(crate) fn apply(&mut self, now_ns: u64, command: Option<&Command>, buses: &mut impl Buses) {
        for (bus, monitor) in self.buses.iter_mut().enumerate().filter(|(_, monitor)| monitor.is_stuck) {
            monitor.is_stuck = buses.port(bus).unsent() > 0;
        }
        self.supervise(now_ns);
        self.take_command(now_ns, command);
        self.restore(now_ns);
        let (request, targets) = (self.request(), self.commands.gate.targets());
        let may_switch_on = self.enabling.may_switch_on();
        for (axis, target) in targets.into_iter().enumerate() {
            if let Some(frame) = self.drives[axis].process_data(now_ns, request, may_switch_on, target) {
                self.send_to(now_ns, axis, frame, buses);
            }
        }
        self.boot(now_ns, buses);
        if self.exchange.is_heartbeat_due() {
            let heartbeat = Heartbeat { state: NmtState::Operational }.frame(MASTER_NODE);
            (0..self.buses.len()).for_each(|bus| self.send(now_ns, bus, heartbeat, buses));
        }
    }

    /// Stops the drives from the next process data on, for the end of the run. Commands are no longer necessary.
    pub(crate) fn stop(&mut self) {
        self.supervision.is_ending = true;
    }

    /// Cycles since the last command.
    pub(crate) fn silent_cycles(&self) -> u32 {
        self.commands.silent_cycles
    }

    /// Whether no drive reports voltage. A lost drive reports nothing, stops by itself, and does not count.
    pub(crate) fn drives_are_off(&self) -> bool {
        !self.drives.iter().filter_map(RemoteDrive::drive_state).any(DriveState::is_powered)
    }

    /// Hands out the events since the last drain.
    pub(crate) fn drain_events(&mut self, out: &mut impl FnMut(Event)) {
        self.events.journal.drain(out);
    }

    /// Whether a drive has answered this cycle's SYNC.
    fn is_fresh(&self, axis: usize) -> bool {
        let drive = &self.drives[axis];
        drive.presence.has_answered_since(self.exchange.answered_after_ns(drive.address.bus))
    }

    /// The request to the drives.
    fn request(&self) -> DriveRequest {
        self.supervision.request(self.commands.request, self.drives.iter().all(RemoteDrive::is_ready))
    }

    fn supervise(&mut self, now_ns: u64) {
        let is_enable = self.request() == DriveRequest::Enable;
        for axis in 0..AXES {
            let is_fresh = self.is_fresh(axis);
            if let Some(failure) = self.drives[axis].absence(now_ns) {
                self.name(now_ns, axis, &failure);
            }
            if let Some(failure) = self.drives[axis].loss(now_ns, is_fresh) {
                self.fail(now_ns, Subject::Axis(axis), &failure);
                self.drives[axis].forget(now_ns);
                self.report_boot(now_ns, axis, Ok(()));
            }
            let state = self.drives[axis].drive_state();
            let disobedience = self.enabling.disobedience(state, is_enable);
            if let Some(failure) = disobedience.or_else(|| self.drives[axis].following_error(is_fresh)) {
                self.fail(now_ns, Subject::Axis(axis), &failure);
            }
        }
        self.supervise_enabling(now_ns, is_enable);
    }

    /// Names the drives that delay the enabling of the others. Beyond its time, each of them stops all drives.
    fn supervise_enabling(&mut self, now_ns: u64, is_enable: bool) {
        let states = self.drives.each_ref().map(RemoteDrive::drive_state);
        let is_enable = is_enable && self.supervision.may_move();
        for (axis, cause) in self.enabling.end_cycle(now_ns, is_enable, states).into_iter().enumerate() {
            let Some(cause) = cause else { continue };
            let RemoteDrive { statusword, emergency, .. } = &self.drives[axis];
            let failure = Failure::with(cause, statusword.0, emergency.0);
            if cause == Cause::WaitsForDrive {
                self.events.add(now_ns, Subject::Axis(axis), failure.event(EventKind::Notice));
            } else {
                self.name(now_ns, axis, &failure);
            }
        }
    }

    /// Reports a bus that goes off or returns. The drives of a bus in bus-off stop by themselves.
    fn watch_buses(&mut self, now_ns: u64, buses: &mut impl Buses) {
        for bus in 0..self.buses.len() {
            let status = buses.port(bus).status();
            let (subject, value) = (Subject::Bus(bus), f64::from(status.tec));
            match self.buses[bus].set_error_state(status.state) {
                Some(true) => self.fail(now_ns, subject, &Failure::with(Cause::BusOff, value, 0.0)),
                Some(false) => {
                    self.events.add(now_ns, subject, Event { value, ..notice(Cause::Recovered) });
                }
                None => {}
            }
        }
    }

    fn take_command(&mut self, now_ns: u64, command: Option<&Command>) {
        // The controller of drives that are off or stopping may be silent: such drives need no command.
        let needs_command = self.request() == DriveRequest::Enable;
        let may_move = self.supervision.may_move();
        let following_m = self.drives.each_ref().map(|drive| drive.following_m().filter(|_| may_move));
        let cycle = self.exchange.wake.cycle;
        let applied = self.commands.apply_command(cycle, now_ns, command, needs_command, following_m);
        if let Err((subject, failure)) = applied {
            self.fail(now_ns, subject, &failure);
        }
    }

    /// Ends a stop once every drive is verified again, none has voltage, and the controller has switched the drives
    /// off. A command that still demands motion was sent before the report of the stop.
    fn restore(&mut self, now_ns: u64) {
        let is_restored = self.supervision.awaits_restoration()
            && self.commands.switch_off()
            && !self.buses.iter().any(|bus| bus.is_off)
            && self.drives.iter().all(RemoteDrive::is_ready)
            && self.drives_are_off();
        if is_restored {
            self.supervision.restore();
            self.events.add(now_ns, Subject::Rig, notice(Cause::Recovered));
        }
    }

    /// Stops the drives. Reports the first cause, the first refused command and a second master, but no consequences.
    fn fail(&mut self, now_ns: u64, subject: Subject, failure: &Failure) {
        if self.supervision.stop(failure.cause) {
            self.events.add(now_ns, subject, failure.event(EventKind::Fault));
        }
    }

    fn may_boot(&self) -> bool {
        self.supervision.may_boot(self.drives_are_off())
    }

    /// Advances the boot of all drives and sends its messages.
    fn boot(&mut self, now_ns: u64, buses: &mut impl Buses) {
        for axis in 0..AXES {
            let result = self.drives[axis].advance_boot(now_ns);
            self.report_boot(now_ns, axis, result);
        }
        if !self.may_boot() {
            return;
        }
        // A message of the boot counts as sent, and is repeated late.
        for axis in 0..AXES {
            let bus = self.drives[axis].address.bus;
            if !self.buses[bus].is_stuck
                && let Some(frame) = self.drives[axis].boot_command(now_ns)
            {
                self.send(now_ns, bus, frame, buses);
            }
        }
        for bus in 0..self.buses.len() {
            if !self.buses[bus].is_stuck {
                self.send_sdo(now_ns, bus, buses);
            }
        }
        if !self.buses.iter().any(|bus| bus.is_stuck) {
            self.start_drives(now_ns, buses);
        }
    }

    /// Sends one SDO request at most; the drives of a bus take turns.
    fn send_sdo(&mut self, now_ns: u64, bus: usize, buses: &mut impl Buses) {
        for axis in self.buses[bus].turns() {
            let drive = &mut self.drives[axis];
            if drive.address.bus == bus
                && let Some(frame) = drive.sdo_request(now_ns)
            {
                self.buses[bus].last_served = axis;
                return self.send(now_ns, bus, frame, buses);
            }
        }
    }

    /// Starts the drives once all are verified. No drive moves beside an unverified drive.
    fn start_drives(&mut self, now_ns: u64, buses: &mut impl Buses) {
        if !self.drives.iter().all(|drive| drive.boot.is_verified()) {
            return;
        }
        for axis in 0..AXES {
            if self.drives[axis].boot.phase == BootPhase::Configured {
                let frame = self.drives[axis].start(now_ns);
                self.send_to(now_ns, axis, frame, buses);
                self.report_boot(now_ns, axis, Ok(()));
            }
        }
    }

    fn send_to(&mut self, now_ns: u64, axis: usize, frame: Frame, buses: &mut impl Buses) {
        self.send(now_ns, self.drives[axis].address.bus, frame, buses);
    }

    /// Reports once that a bus with drives keeps frames that are older than two cycles.
    fn watch_queue(&mut self, now_ns: u64, bus: usize, buses: &mut impl Buses) {
        let begins = self.buses[bus].note_unsent(buses.port(bus).unsent());
        if begins && self.buses[bus].has_drives {
            let value = f64::from(FULL_QUEUE);
            self.events.add(now_ns, Subject::Bus(bus), Event { value, ..notice(Cause::BusRefused) });
        }
    }

    /// Sends a frame, unless older ones are stuck before it: a drive must not get the frames of many cycles at once.
    fn send(&mut self, now_ns: u64, bus: usize, frame: Frame, buses: &mut impl Buses) {
        if self.buses[bus].is_stuck {
            return;
        }
        match buses.port(bus).send(now_ns, frame) {
            Ok(()) => self.buses[bus].note_handed_over(),
            Err(refusal) if self.buses[bus].is_unexplained(&refusal) => {
                let errno = if let SendError::Os { errno } = refusal { errno } else { FULL_QUEUE };
                let failure = Failure::with(Cause::BusRefused, errno, 0.0);
                self.fail(self.exchange.wake.woke_ns, Subject::Bus(bus), &failure);
            }
            Err(_) => {}
        }
    }

    /// Takes a frame. Reports a malformed frame once, without another effect.
    fn take_frame(&mut self, bus: usize, received: &Received) {
        let Ok(cob) = Cob::try_from(received.frame.id()) else { return };
        let time_ns = received.time_ns;
        let sender = sender(cob);
        // Only a master sends SYNC and NMT, and this master does not receive its own frames.
        if matches!(cob, Cob::Sync | Cob::Nmt) || sender == Some(MASTER_NODE) {
            return self.fail(time_ns, Subject::Bus(bus), &Failure::new(Cause::SecondMaster));
        }
        let Some(id) = sender else { return };
        let Some(axis) = self.drives.iter().position(|drive| drive.address == Address { bus, node: id })
        else {
            if self.buses[bus].is_new_unknown(id) {
                let event = Event { node: u16::from(id.get()), ..notice(Cause::UnknownNode) };
                self.events.add(time_ns, Subject::Bus(bus), event);
            }
            return;
        };
        self.buses[bus].has_drives = true;
        let drive = &mut self.drives[axis];
        match Message::decode(cob, received.frame.data(), &drive.tpdo1) {
            Ok(Message::Heartbeat(state)) => self.take_heartbeat(axis, state, time_ns),
            Ok(Message::ProcessData(tpdo)) => {
                let Some(Change { before, after }) = drive.take_process_data(time_ns, tpdo) else { return };
                self.exchange.note_process_data(time_ns);
                if before != after {
                    let event = transition(Source::Drive, drive_state_code(before), drive_state_code(after));
                    self.events.add(time_ns, Subject::Axis(axis), event);
                }
            }
            Ok(Message::Emergency(emergency)) => {
                // Before its boot-up, a drive reports emergencies from the time before this master. The master resets
                // such a drive.
                let is_past = emergency.is_reset() || drive.boot.phase == BootPhase::Waiting;
                drive.emergency = emergency.code;
                let is_enabled = drive.drive_state() == Some(DriveState::OperationEnabled);
                self.events.add(time_ns, Subject::Axis(axis), events::emergency(emergency, is_past));
                // Such a drive stops by itself and mostly leaves the process data, so no statusword shows the stop.
                let has_lost_master = emergency.code == EmergencyCode::HEARTBEAT && is_enabled;
                if has_lost_master && self.request() == DriveRequest::Enable {
                    let failure = Failure::with(Cause::Emergency, emergency.code.0, emergency.register);
                    self.fail(time_ns, Subject::Axis(axis), &failure);
                }
            }
            Ok(Message::SdoAnswer(answer)) => {
                let result = drive.take_sdo_answer(time_ns, answer);
                self.report_boot(time_ns, axis, result);
            }
            Err(error) if drive.is_first_wrong_length(cob) => {
                self.events.add(time_ns, Subject::Axis(axis), events::wrong_length(cob, &error));
            }
            Ok(Message::Foreign) | Err(_) => {}
        }
    }

    fn take_heartbeat(&mut self, axis: usize, state: NmtState, time_ns: u64) {
        let may_boot = self.may_boot();
        if state == NmtState::BootUp && self.drives[axis].is_started {
            self.fail(time_ns, Subject::Axis(axis), &Failure::new(Cause::NodeRestarted));
        }
        let result = self.drives[axis].take_heartbeat(time_ns, state, may_boot);
        self.report_boot(time_ns, axis, result);
    }

    /// Reports a change of a drive's boot, or its failure.
    fn report_boot(&mut self, time_ns: u64, axis: usize, result: Result<(), Failure>) {
        if let Err(failure) = result {
            self.drives[axis].boot.phase = BootPhase::Failed;
            self.name(time_ns, axis, &failure);
        }
        if let Some(reset) = self.drives[axis].boot.reset_fault.take() {
            self.events.add(time_ns, Subject::Axis(axis), reset.event(EventKind::Notice));
        }
        if let Some(Change { before, after }) = self.drives[axis].phase_change() {
            let event = transition(Source::Master, before.code(), after.code());
            self.events.add(time_ns, Subject::Axis(axis), event);
        }
    }

    /// Reports the reason why a drive cannot be used. The failure of one drive at the start is no consequence of
    /// another failure, so each has a report.
    fn name(&mut self, now_ns: u64, axis: usize, failure: &Failure) {
        self.supervision.stop(failure.cause);
        self.events.add(now_ns, Subject::Axis(axis), failure.event(EventKind::Fault));
    }
}
