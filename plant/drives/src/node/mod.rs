//! The drive as a CANopen node (CiA 301).
//!
//! [`DriveNode`] sequences its parts: network management, process data, heartbeats, errors and the SDO server. Each
//! part keeps its own state and returns the due actions. The profile (CiA 402) is the [axis](super::axis).

mod access;
mod block;
mod pdo;
mod sdo;
mod state;

use masseter_can::canopen::{
    Cob, CobId, Emergency, EmergencyCode, Heartbeat, Nmt as NmtMessage, NmtCommand, NmtState, NodeId,
    ObjectAddress,
};
use masseter_can::cia402::{Controlword, DriveState};
use masseter_can::{ErrorState, Frame};

use crate::axis::Axis;
use crate::axis::encoder::Look;
use crate::dictionary::{Objects, Overlay};
use crate::faults::{DriveFault, DriveFaults};
use crate::memory::DriveMemory;
use crate::names;
use crate::quirks::{Delivered, NodeQuirks};
use crate::settings::{DriveSettings, SettingsError};
use crate::table::PDOS;
use crate::{MILLISECOND_NS, SECOND_NS};
use access::{DictionaryAccess, Storage};
use pdo::{Effects, Outbox, ProcessData, Rpdo, Tpdo};
use sdo::{Response, SdoServer};
use state::{BOOT_NS, Consumer, Errors, Nmt, Producer, clear_history};

/// The emergency of a storm: a device emergency without a lasting error (CiA 301: FFxxh).
const STORM: EmergencyCode = EmergencyCode(0xFF00);

/// Longest wait of a heartbeat for the process data in answer to SYNC, ns: a heartbeat never comes just before them.
const HEARTBEAT_WAIT_NS: u64 = MILLISECOND_NS;

/// One drive. A clone, or the drive's serialised form, is a snapshot.
///
/// The drive has no bus, no clock and no mechanics. Its caller calls [`step`](Self::step) once each step of the servo
/// loops, and delivers frames by [`receive`](Self::receive) and [`take_sync`](Self::take_sync) in the order of time. After
/// each call the caller sends the frames of [`outgoing`](Self::outgoing). [`Stand`](crate::Stand) does all of this on a
/// simulated wire.
///
/// ```
/// use masseter_can::canopen::{NmtState, NodeId};
/// use masseter_can::cia402::DriveState;
/// use masseter_drives::{DriveNode, DriveSettings, Look};
///
/// let settings = DriveSettings::new(NodeId::new(4)?);
/// let mut drive = DriveNode::new(&settings, 0, 0.1)?;
/// for step in 1..=200 {
///     // An axis that stands still, and its encoder.
///     drive.step(step * settings.step_ns, 0.1, Look::exact);
/// }
/// let boot_up = drive.outgoing().ok_or("no boot-up message")?;
/// assert_eq!(boot_up.data(), [NmtState::BootUp.code()]);
/// assert_eq!(drive.state(), DriveState::SwitchOnDisabled);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct DriveNode {
    id: NodeId,
    pub(super) objects: Objects,
    overlay: Overlay,
    quirks: NodeQuirks,
    /// The fault after the start (603Fh).
    due_fault: Option<u16>,
    /// Time of a restart by itself, ns.
    restarts_at_ns: Option<u64>,
    storage: Storage,
    pub(crate) axis: Axis,
    nmt: Nmt,
    errors: Errors,
    /// Last known error state of its CAN controller.
    error_state: ErrorState,
    producer: Producer,
    consumer: Consumer,
    process_data: ProcessData,
    sdo: SdoServer,
    /// The content of 2010h, which a reset of the node empties.
    user_data: Vec<u8>,
    outbox: Outbox,
    /// Whether the supply is off.
    is_off: bool,
    /// Interval of the present storm of emergencies, and due time of the next, ns.
    storm_every_s: Option<f64>,
    next_storm_ns: u64,
}

impl DriveNode {
    /// A drive that is switched on at `now_ns` with its axis at a position.
    ///
    /// # Errors
    /// [`SettingsError`] for a quirk about no object, and for a stored value that the drive does not take.
    pub fn new(settings: &DriveSettings, now_ns: u64, position_m: f64) -> Result<Self, SettingsError> {
        let Delivered { objects: factory, overlay, node: quirks, axis } = settings.delivered()?;
        let mut objects = factory.clone();
        settings.memory.restore(&mut objects, &overlay)?;
        // Staggered, so that the heartbeats of several nodes do not coincide.
        let heartbeat_ns = u64::from(objects.get(names::PRODUCER_HEARTBEAT_TIME_MS)) * MILLISECOND_NS;
        let stagger_ns = heartbeat_ns / 8 * u64::from(settings.node.get() % 8);
        Ok(Self {
            id: settings.node,
            storage: Storage::new(&factory, &objects, quirks.save_ns),
            axis: Axis::new(settings, axis, now_ns, position_m, &objects),
            nmt: Nmt::booting(now_ns, quirks.boot_ups),
            errors: Errors::new(quirks.fault),
            quirks,
            due_fault: quirks.fault,
            restarts_at_ns: quirks.restart_ns.map(|after_ns| now_ns + after_ns),
            overlay,
            error_state: ErrorState::Active,
            producer: Producer::new(&objects, now_ns + BOOT_NS + stagger_ns),
            consumer: Consumer::new(&objects),
            process_data: ProcessData::new(&objects),
            sdo: SdoServer::default(),
            user_data: Vec::new(),
            outbox: Outbox::new(),
            is_off: false,
            storm_every_s: None,
            next_storm_ns: 0,
            objects,
        })
    }

    /// Its state under CiA 402, whether the statusword has been sent or not.
    #[inline]
    pub fn state(&self) -> DriveState {
        self.axis.power.state
    }

    /// The faults that act on the drive, and those that have struck.
    #[inline]
    pub fn faults(&self) -> &DriveFaults {
        &self.axis.faults
    }

    /// Sets the size of an acting fault (0 for a kind without a size), or ends the fault.
    pub fn set_fault(&mut self, kind: DriveFault, size: Option<f64>) {
        self.axis.faults.set(kind, size);
    }

    /// The non-volatile memory, if changed since the last call.
    pub fn changed_memory(&mut self) -> Option<DriveMemory> {
        let has_changed = std::mem::take(&mut self.storage.has_changed);
        has_changed.then(|| DriveMemory::of(&self.storage.stored, &self.storage.factory))
    }

    /// The next frame that the drive transmits.
    #[inline]
    pub fn outgoing(&mut self) -> Option<Frame> {
        self.outbox.0.pop_front()
    }

    /// Takes a frame other than SYNC that arrived at `now_ns`. Frames for others and malformed frames have no effect;
    /// process data of a wrong length are reported by EMCY.
    pub fn receive(&mut self, now_ns: u64, frame: &Frame) {
        if self.is_off {
            return;
        }
        match Cob::try_from(frame.id()) {
            Ok(Cob::Nmt) => {
                if let Some(message) = NmtMessage::decode(frame.data())
                    && message.target.includes(self.id)
                {
                    self.obey_nmt(message.command, now_ns);
                }
            }
            Ok(Cob::SdoRequest(node)) if node == self.id && self.nmt.is_served() => {
                self.serve(now_ns, frame.data());
            }
            Ok(Cob::Heartbeat(node)) if self.nmt.state.is_some() => {
                self.take_heartbeat(now_ns, node, frame.data());
            }
            _ => self.take_process_data(now_ns, frame),
        }
    }

    /// Takes a SYNC that arrives at `now_ns` with the shaft at `position_m`. Buffered process data take effect, and the
    /// drive samples and sends actual values. `look` gives the encoder's output at its own position. A due heartbeat
    /// follows.
    pub fn take_sync(
        &mut self,
        now_ns: u64,
        frame: &Frame,
        position_m: f64,
        mut look: impl FnMut(f64) -> Look,
    ) {
        self.synchronise(now_ns, frame, position_m, &mut look);
    }

    // Compiled here, where the compiler sees the whole drive, and not where somebody calls it: a step takes 5 % less.
    fn synchronise(
        &mut self,
        now_ns: u64,
        frame: &Frame,
        position_m: f64,
        look: &mut dyn FnMut(f64) -> Look,
    ) {
        if self.is_off || !self.nmt.is_served() {
            return;
        }
        let counter = match (frame.data(), self.objects.get(names::SYNC_OVERFLOW)) {
            ([], 0) => 0,
            ([counter], 2..) => *counter,
            _ => return self.raise(EmergencyCode::SYNC_LENGTH),
        };
        self.clear(EmergencyCode::SYNC_LENGTH);
        let is_operational = self.nmt.is_operational();
        if is_operational {
            for number in 0..PDOS {
                self.apply_process_data(number, now_ns);
            }
        }
        self.axis.synchronise(now_ns, std::mem::take(&mut self.process_data.new_targets), &self.objects);
        if is_operational {
            self.axis.sample(now_ns, position_m, look);
            self.axis.show(now_ns, &mut self.objects);
            self.process_data.send(&mut self.outbox, |tpdo| tpdo.at_sync(now_ns, counter, &self.objects));
            self.beat(now_ns, 0);
        }
    }

    /// A step of the servo loops with the shaft at `position_m`; returns the force until the next step, N. `look` gives
    /// the encoder's output at its own position.
    pub fn step(&mut self, now_ns: u64, position_m: f64, mut look: impl FnMut(f64) -> Look) -> f64 {
        self.advance(now_ns, position_m, &mut look)
    }

    fn advance(&mut self, now_ns: u64, position_m: f64, look: &mut dyn FnMut(f64) -> Look) -> f64 {
        self.follow_supply(now_ns);
        if self.restarts_at_ns.take_if(|at_ns| now_ns >= *at_ns).is_some() {
            self.reset_node(now_ns);
        }
        if self.is_off {
            return self.axis.step(now_ns, position_m, look).0;
        }
        if self.nmt.boot(now_ns) {
            self.outbox.add(Heartbeat { state: NmtState::BootUp }.frame(self.id));
            self.fail_at_power_on(now_ns);
        }
        self.storage.end_saving(now_ns, &mut self.objects);
        self.supervise_connection(now_ns);
        if let Some(response) = self.sdo.step(now_ns) {
            self.respond(response);
        }
        let (force_n, error) = self.axis.step(now_ns, position_m, look);
        if let Some(error) = error {
            self.raise(error);
        }
        if !self.axis.faults.is_empty() {
            self.fail_as_injected(now_ns);
        }
        if self.nmt.is_operational() && self.process_data.is_event_driven() {
            self.axis.show(now_ns, &mut self.objects);
            self.process_data.send(&mut self.outbox, |tpdo| tpdo.at_event(now_ns, &self.objects));
        }
        let wait_ns = if self.nmt.is_operational() { HEARTBEAT_WAIT_NS } else { 0 };
        self.beat(now_ns, wait_ns);
        force_n
    }

    /// Compares the encoder, as the last step read it, with a second one at the joint, where the drive has one.
    #[inline]
    pub fn compare_encoders(&mut self, now_ns: u64, joint_m: f64) {
        let has_booted = !self.is_off && self.nmt.state.is_some();
        if has_booted && self.axis.compare_encoders(now_ns, joint_m) {
            self.raise(EmergencyCode::POSITION_SENSOR);
        }
    }

    /// Sends a heartbeat that has been due for `wait_ns`.
    fn beat(&mut self, now_ns: u64, wait_ns: u64) {
        if let Some(state) = self.nmt.state
            && self.producer.is_due(now_ns, wait_ns)
        {
            self.outbox.add(Heartbeat { state }.frame(self.id));
        }
    }

    /// Loses the supply, or boots when it is back. Without it the node is silent and the brake closed.
    fn follow_supply(&mut self, now_ns: u64) {
        let is_off = self.axis.faults.strike(DriveFault::Reboot);
        match (std::mem::replace(&mut self.is_off, is_off), is_off) {
            (false, true) => {
                self.axis.restart(now_ns, &self.objects);
                self.outbox.0.clear();
            }
            (true, false) => self.reset_node(now_ns),
            _ => {}
        }
    }

    /// Goes into the fault that is present when the drive has started.
    fn fail_at_power_on(&mut self, now_ns: u64) {
        if self.nmt.state.is_some()
            && let Some(code) = self.due_fault.take()
        {
            self.axis.fail(now_ns);
            self.raise(EmergencyCode(code));
        }
    }

    /// Injected faults of the node: its logic supply is too low, or it sends emergencies again and again.
    fn fail_as_injected(&mut self, now_ns: u64) {
        let has_booted = self.nmt.state.is_some();
        if has_booted && self.axis.faults.has(DriveFault::Fault) && self.axis.fail(now_ns) {
            self.axis.faults.strike(DriveFault::Fault);
            self.raise(EmergencyCode::LOGIC_SUPPLY);
        }
        let every_s = self.axis.faults.size(DriveFault::EmcyStorm);
        let is_another = std::mem::replace(&mut self.storm_every_s, every_s) != every_s;
        if let Some(every_s) = every_s
            && self.nmt.is_served()
            && (is_another || now_ns >= self.next_storm_ns)
        {
            self.axis.faults.strike(DriveFault::EmcyStorm);
            self.next_storm_ns = now_ns.saturating_add((every_s * SECOND_NS as f64) as u64);
            let register = self.objects.get(names::ERROR_REGISTER);
            self.send_emergency(Some(Emergency { code: STORM, register, vendor: [0; 5] }));
        }
    }

    /// Takes the error state of the drive's CAN controller. Bus-off is a failure of the communication; an emergency
    /// reports the failure after the return of the bus.
    #[inline]
    pub fn set_error_state(&mut self, now_ns: u64, state: ErrorState) {
        if self.is_off || state == self.error_state {
            return;
        }
        let before = std::mem::replace(&mut self.error_state, state);
        if before == ErrorState::BusOff {
            self.raise(EmergencyCode::WAS_BUS_OFF);
            self.clear(EmergencyCode::WAS_BUS_OFF);
        }
        match state {
            ErrorState::Active => self.clear(EmergencyCode::ERROR_PASSIVE),
            ErrorState::Passive => self.raise(EmergencyCode::ERROR_PASSIVE),
            ErrorState::BusOff => {
                self.clear(EmergencyCode::ERROR_PASSIVE);
                self.fail_communication(now_ns);
            }
        }
    }

    /// Obeys a command of network management, once the node has booted.
    fn obey_nmt(&mut self, command: NmtCommand, now_ns: u64) {
        if self.nmt.state.is_none() {
            return;
        }
        match command {
            NmtCommand::Start => {
                if !self.nmt.is_operational() {
                    self.process_data.tpdos.iter_mut().for_each(Tpdo::clear);
                }
                self.nmt.state = Some(NmtState::Operational);
            }
            NmtCommand::Stop => self.leave_operational(NmtState::Stopped, now_ns),
            NmtCommand::EnterPreOperational => self.leave_operational(NmtState::PreOperational, now_ns),
            NmtCommand::ResetCommunication => {
                // A booting node receives nothing, so nobody controls the axis.
                self.abort_connection(now_ns);
                self.reset_communication(now_ns);
            }
            NmtCommand::ResetNode => self.reset_node(now_ns),
        }
    }

    /// Leaves operational. Without process data nobody controls the axis.
    fn leave_operational(&mut self, state: NmtState, now_ns: u64) {
        if self.nmt.is_operational() || state == NmtState::Stopped {
            self.abort_connection(now_ns);
        }
        self.nmt.state = Some(state);
        self.process_data.discard_received();
        self.sdo = SdoServer::default();
    }

    /// Restores the stored communication objects and boots. The history of errors (1003h) and the faults stay.
    fn reset_communication(&mut self, now_ns: u64) {
        self.objects.copy_range(&self.storage.stored, 0x1000..=0x1002);
        self.objects.copy_range(&self.storage.stored, 0x1004..=0x1FFF);
        self.errors.forget_communication(&mut self.objects);
        self.producer.configure(&self.objects, now_ns + BOOT_NS);
        self.consumer = Consumer::new(&self.objects);
        self.process_data = ProcessData::new(&self.objects);
        self.sdo = SdoServer::default();
        self.nmt = Nmt::booting(now_ns, self.quirks.boot_ups);
    }

    /// The state after power-on: the brake closes, every object has its stored value, the node boots.
    fn reset_node(&mut self, now_ns: u64) {
        self.storage.saved_at_ns = None;
        self.objects = self.storage.stored.clone();
        self.user_data.clear();
        self.errors = Errors::new(self.quirks.fault);
        self.due_fault = self.quirks.fault;
        self.axis.restart(now_ns, &self.objects);
        self.reset_communication(now_ns);
    }

    /// Process data wait for the next SYNC, or take effect at once where their PDO is event-driven.
    fn take_process_data(&mut self, now_ns: u64, frame: &Frame) {
        if !self.nmt.is_operational() {
            return;
        }
        let Some(number) = self.process_data.receive(now_ns, frame) else { return };
        self.judge_process_data();
        if !self.process_data.rpdos[number].is_synchronous {
            self.apply_process_data(number, now_ns);
        }
    }

    fn apply_process_data(&mut self, number: usize, now_ns: u64) {
        if let Some(effects) = self.process_data.rpdos[number].apply(&mut self.objects) {
            self.act(effects, now_ns);
        }
    }

    /// Raises and clears the errors of process data; one is present as long as any RPDO has it.
    fn judge_process_data(&mut self) {
        for (error, is_present) in self.process_data.errors() {
            if is_present { self.raise(error) } else { self.clear(error) }
        }
    }

    /// Supervision begins with a heartbeat, not with a boot-up message.
    fn take_heartbeat(&mut self, now_ns: u64, node: NodeId, data: &[u8]) {
        if Heartbeat::decode(data).is_ok_and(|heartbeat| heartbeat.state != NmtState::BootUp) {
            self.consumer.hear(now_ns, node);
            if self.consumer.hears_all() {
                self.clear(EmergencyCode::HEARTBEAT);
            }
        }
    }

    /// A lost heartbeat is a failure of the communication. When the event timer of an RPDO has run out, nobody controls
    /// the axis either.
    fn supervise_connection(&mut self, now_ns: u64) {
        if self.consumer.loses(now_ns.saturating_sub(self.quirks.heartbeat_late_ns)) {
            self.raise(EmergencyCode::HEARTBEAT);
            self.fail_communication(now_ns);
        }
        if self.process_data.expires(now_ns.saturating_sub(self.quirks.process_data_late_ns)) {
            self.judge_process_data();
            self.abort_connection(now_ns);
        }
    }

    /// Reacts to a failure of the communication: abort connection option (6007h) and error behaviour (1029h).
    fn fail_communication(&mut self, now_ns: u64) {
        self.abort_connection(now_ns);
        if self.nmt.is_operational() {
            match self.objects.get(names::COMMUNICATION_ERROR) {
                0 => self.leave_operational(NmtState::PreOperational, now_ns),
                2 => self.leave_operational(NmtState::Stopped, now_ns),
                _ => {}
            }
        }
    }

    /// Reacts by 6007h to the loss of control over the axis. A fault outlasts its cause.
    fn abort_connection(&mut self, now_ns: u64) {
        if self.axis.abort_connection(now_ns) {
            self.raise(EmergencyCode::COMMUNICATION);
        }
    }

    /// Answers a request to the SDO server.
    fn serve(&mut self, now_ns: u64, data: &[u8]) {
        let mut access = DictionaryAccess {
            now_ns,
            objects: &mut self.objects,
            storage: &mut self.storage,
            user_data: &mut self.user_data,
            axis: &self.axis,
            overlay: &self.overlay,
            is_operational: self.nmt.is_operational(),
            locks_pdos: self.quirks.locks_pdos && self.nmt.is_operational(),
            written: None,
        };
        let answer = self.sdo.answer(data, &mut access);
        if let Some(object) = access.written {
            self.apply_written(object, now_ns);
        }
        if let Some(response) = answer {
            self.respond(response);
        }
    }

    /// Sends an answer of the SDO server.
    fn respond(&mut self, response: Response) {
        self.outbox.add(Frame::fixed(Cob::SdoResponse(self.id).into(), response));
    }

    /// Applies the effect of an object written by SDO.
    fn apply_written(&mut self, object: ObjectAddress, now_ns: u64) {
        let number = usize::from(object.index & 0xFF);
        match object.index {
            0x1003 => clear_history(&mut self.objects),
            0x1016 => {
                // Supervision begins anew, and no heartbeat counts as lost.
                self.consumer = Consumer::new(&self.objects);
                self.clear(EmergencyCode::HEARTBEAT);
            }
            0x1017 => self.producer.configure(&self.objects, now_ns),
            0x1400..0x1800 => {
                self.process_data.rpdos[number] = Rpdo::new(&self.objects, number);
                self.judge_process_data();
            }
            0x1800..0x1C00 => self.process_data.tpdos[number] = Tpdo::new(&self.objects, number),
            index => self.act(Effects::of([index]), now_ns),
        }
    }

    /// Objects of the profile take effect: cyclic targets wait for SYNC, a new configuration comes before the
    /// controlword, and the controlword before the targets of profiles.
    fn act(&mut self, Effects { targets, configures, commands }: Effects, now_ns: u64) {
        self.process_data.add_targets(targets);
        if configures {
            self.axis.configure(now_ns, &self.objects);
        }
        let word = Controlword(self.objects.get(names::CONTROLWORD));
        if commands && self.axis.control(now_ns, word, &self.objects) {
            for error in self.errors.faults() {
                self.clear(error);
            }
        }
        self.axis.retarget(now_ns, &self.objects);
    }

    fn raise(&mut self, error: EmergencyCode) {
        let emergency = self.errors.raise(error, &mut self.objects);
        self.send_emergency(emergency);
    }

    fn clear(&mut self, error: EmergencyCode) {
        let emergency = self.errors.clear(error, &mut self.objects);
        self.send_emergency(emergency);
    }

    /// Sends an emergency message, in the states in which nodes send them and unless 1014h forbids it.
    fn send_emergency(&mut self, emergency: Option<Emergency>) {
        let cob_id = CobId(self.objects.get(names::EMERGENCY_COB_ID));
        if let Some(emergency) = emergency
            && self.nmt.is_served()
            && let Some(id) = cob_id.identifier()
        {
            self.outbox.add(Frame::fixed(id, emergency.encode()));
        }
    }
}
