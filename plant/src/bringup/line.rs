//! A line to all drives: SDO, NMT and the heartbeat, one question at a time.
//!
//! The line keeps one promise for every step of the bring-up: while it has switched on one drive, it refuses to switch on another.

use std::fmt::{self, Debug, Formatter};
use std::io::{self, Write};

use masseter_can::canopen::{
    AbortCode, Cob, Expedited, Heartbeat, Nmt, NmtCommand, NmtState, NmtTarget, NodeId, ObjectAddress,
    SdoRequest, SdoResponse, sync,
};
use masseter_can::cia402::Controlword;
use masseter_can::wire::{Bitrate, INTERFRAME_BITS, frame_bits};
use masseter_can::{Frame, SendError, Tapped, TappedFrame, candump};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::{MASTER_NODE, Scenario};
use masseter_shared::geometry::{AXES, AXIS_NAMES};

use super::heard::{Heard, Strangers};
use super::ledger::{Ledger, OldValue};
use super::wires::Wires;
use crate::error::PlantError;
use crate::link::layout::{drive_ports, node_ids};

/// Time between two looks at the buses, ns.
const STEP_NS: u64 = MILLISECOND_NS;
/// Silence of a server after which a request is repeated, and how often that is done.
const TIMEOUT_NS: u64 = 500 * MILLISECOND_NS;
/// The same while a drive has power: a motion nobody sees must be short.
const POWERED_TIMEOUT_NS: u64 = 100 * MILLISECOND_NS;
const ATTEMPTS: u32 = 3;
/// Time that a node has to answer a scan, ns.
const SCAN_NS: u64 = 10 * MILLISECOND_NS;
/// Longest time for which an answer to SYNC is waited for, ns.
const SYNC_NS: u64 = 20 * MILLISECOND_NS;
/// Bytes of the longest value that is read: no text of an identity is longer.
const LONGEST_VALUE: usize = 256;

/// Why a question had no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SdoReason {
    /// The drive refused the transfer.
    #[error("{0}")]
    Aborted(AbortCode),
    /// Nothing came.
    #[error("no answer; check its power, wiring, bit rate and node id")]
    Silent,
    /// The answers do not follow the protocol, or never end.
    #[error("answers beside the protocol; check whether two nodes have this id")]
    Malformed,
}

/// Why a line cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// A transfer failed.
    #[error("{}: object {object}: {reason}", AXIS_NAMES[*axis])]
    Sdo {
        /// The axis.
        axis: usize,
        /// The object.
        object: ObjectAddress,
        /// The reason.
        reason: SdoReason,
    },
    /// A second drive would be switched on.
    #[error("{}: not switched on, because {} still is; end that step first", AXIS_NAMES[*axis], AXIS_NAMES[*other])]
    SecondAxis {
        /// The axis to be switched on.
        axis: usize,
        /// The axis that is.
        other: usize,
    },
    /// A frame could not be sent.
    #[error("bus {bus}: {error}")]
    Send {
        /// The bus.
        bus: usize,
        /// The reason.
        error: SendError,
    },
    /// The emulated mechanism failed, or the memory of emulated drives cannot be written.
    #[error(transparent)]
    Emulation(#[from] PlantError),
    /// Old values could not be kept.
    #[error("old values of {} cannot be kept, so that no further value is written: {source}; free the disk", AXIS_NAMES[*axis])]
    Ledger {
        /// The axis.
        axis: usize,
        /// The reason.
        source: io::Error,
    },
    /// The log could not be written.
    #[error("the log of the bus cannot be written: {0}")]
    Log(#[from] io::Error),
}

impl LineError {
    /// The code with which a drive refused a transfer.
    pub fn abort_code(&self) -> Option<AbortCode> {
        match self {
            Self::Sdo { reason: SdoReason::Aborted(code), .. } => Some(*code),
            _ => None,
        }
    }
}

/// The heartbeat of this node: drives that watch it stop without it.
#[derive(Debug, Clone, Copy)]
struct Beat {
    every_ns: u64,
    next_ns: u64,
}

/// The line.
pub struct Line {
    wires: Wires,
    /// Names of the buses in the log.
    names: Vec<String>,
    addresses: [(usize, NodeId); AXES],
    heard: [Heard; AXES],
    strangers: Strangers,
    beat: Option<Beat>,
    /// When the last SYNC of this line was on its bus, ns.
    sync_ns: Option<u64>,
    bitrate: Bitrate,
    /// The axis whose drive this line has switched on.
    switched_on: Option<usize>,
    log: Box<dyn Write + Send>,
    /// Where old values are kept; none where nobody needs them after a kill.
    ledger: Option<Box<dyn Ledger>>,
}

impl Debug for Line {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.debug_struct("Line")
            .field("names", &self.names)
            .field("switched_on", &self.switched_on)
            .finish_non_exhaustive()
    }
}

impl Line {
    /// A line on the scenario's interfaces, or on simulated buses where it names none. Every frame on the buses goes to `log`, in
    /// the format of candump. The line sends nothing yet.
    ///
    /// # Errors
    /// [`PlantError`] for interfaces that cannot be opened and for buses that cannot be built.
    pub fn open(scenario: &Scenario, log: Box<dyn Write + Send>) -> Result<Self, PlantError> {
        let can = &scenario.can;
        let (ports, ids) = (drive_ports(can)?, node_ids(can)?);
        let simulated = (0..can.buses.len()).map(|bus| format!("can{bus}")).collect();
        Ok(Self {
            wires: Wires::open(scenario)?,
            names: if can.is_virtual() { simulated } else { can.interfaces.clone() },
            addresses: std::array::from_fn(|axis| (ports[axis].bus, ids[axis])),
            heard: Default::default(),
            strangers: Strangers::default(),
            beat: None,
            sync_ns: None,
            bitrate: Bitrate::new(can.bitrate_bps)?,
            switched_on: None,
            log,
            ledger: None,
        })
    }

    /// Keeps old values of drives in this ledger from now on.
    pub fn keep_old_values_in(&mut self, ledger: Box<dyn Ledger>) {
        self.ledger = Some(ledger);
    }

    /// Keeps the old values of a drive.
    pub(super) fn keep_old_values(&mut self, axis: usize, values: &[OldValue]) -> Result<(), LineError> {
        let Some(ledger) = &mut self.ledger else { return Ok(()) };
        ledger.keep(axis, values).map_err(|source| LineError::Ledger { axis, source })
    }

    /// The present time, ns: simulated from 0, or the machine's.
    pub fn now_ns(&self) -> u64 {
        self.wires.now_ns()
    }

    /// What was heard of a drive.
    pub fn heard(&self, axis: usize) -> &Heard {
        &self.heard[axis]
    }

    /// Who else was heard.
    pub fn strangers(&self) -> &Strangers {
        &self.strangers
    }

    /// Sends the master's heartbeat from now on, with that interval.
    pub fn beat_every(&mut self, interval_ms: u16) {
        self.beat = Some(Beat { every_ns: u64::from(interval_ms) * MILLISECOND_NS, next_ns: self.now_ns() });
    }

    /// Listens for that long.
    ///
    /// # Errors
    /// [`LineError`] except those of transfers.
    pub fn listen(&mut self, for_ns: u64) -> Result<(), LineError> {
        let until_ns = self.now_ns() + for_ns;
        while self.now_ns() < until_ns {
            self.step()?;
        }
        Ok(())
    }

    /// Listens until a condition holds; returns whether it did within that time.
    ///
    /// # Errors
    /// [`LineError`] except those of transfers.
    pub fn listen_until(
        &mut self,
        within_ns: u64,
        mut holds: impl FnMut(&Self) -> bool,
    ) -> Result<bool, LineError> {
        let until_ns = self.now_ns() + within_ns;
        while !holds(self) {
            if self.now_ns() >= until_ns {
                return Ok(false);
            }
            self.step()?;
        }
        Ok(true)
    }

    /// Reads an object, however long.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn read(&mut self, axis: usize, object: ObjectAddress) -> Result<Vec<u8>, LineError> {
        let failed = |reason| LineError::Sdo { axis, object, reason };
        match self.ask(axis, object, SdoRequest::InitiateUpload { object })? {
            SdoResponse::Upload { data, .. } => return Ok(data.data().to_vec()),
            SdoResponse::InitiateUpload { .. } => {}
            _ => return Err(failed(SdoReason::Malformed)),
        }
        let (mut value, mut toggle) = (Vec::new(), false);
        for _ in 0..LONGEST_VALUE {
            match self.ask(axis, object, SdoRequest::UploadSegment { toggle })? {
                SdoResponse::UploadSegment { toggle: answered, data, is_last } if answered == toggle => {
                    value.extend_from_slice(data.data());
                    if is_last {
                        return Ok(value);
                    }
                    toggle = !toggle;
                }
                _ => return Err(failed(SdoReason::Malformed)),
            }
        }
        Err(failed(SdoReason::Malformed))
    }

    /// Reads an object of at most four bytes as a number without a sign.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn read_number(&mut self, axis: usize, object: ObjectAddress) -> Result<u32, LineError> {
        let value = self.read(axis, object)?;
        if value.len() > Expedited::MAX {
            return Err(LineError::Sdo { axis, object, reason: SdoReason::Malformed });
        }
        Ok(value.iter().rfold(0, |number, &byte| number << 8 | u32::from(byte)))
    }

    /// Writes the lowest bytes of a value to an object. The controlword has [its own function](Self::control).
    ///
    /// # Errors
    /// [`LineError`].
    ///
    /// # Panics
    /// For 6040h, and for other than one to four bytes.
    pub fn write(
        &mut self,
        axis: usize,
        object: ObjectAddress,
        value: u32,
        bytes: usize,
    ) -> Result<(), LineError> {
        assert!(object.index != 0x6040, "controlwords go through control");
        self.download(axis, object, value, bytes)
    }

    /// Sends a controlword by SDO. One that switches a drive on is refused while another drive is on.
    ///
    /// # Errors
    /// [`LineError`].
    pub fn control(&mut self, axis: usize, word: Controlword) -> Result<(), LineError> {
        let switches_on = word.0 & Controlword::SWITCH_ON.0 == Controlword::SWITCH_ON.0;
        match self.switched_on {
            Some(other) if other != axis && switches_on => return Err(LineError::SecondAxis { axis, other }),
            _ if switches_on => self.switched_on = Some(axis),
            _ => {}
        }
        self.download(axis, ObjectAddress::new(0x6040, 0), word.0.into(), 2)
    }

    /// The drive of an axis has no voltage any more, as its statusword showed: another one may be switched on.
    pub fn note_off(&mut self, axis: usize) {
        self.switched_on = self.switched_on.filter(|&on| on != axis);
    }

    /// Sends a command of network management to the node of an axis.
    ///
    /// # Errors
    /// [`LineError::Send`].
    pub fn command(&mut self, axis: usize, command: NmtCommand) -> Result<(), LineError> {
        let (bus, node) = self.addresses[axis];
        self.send(bus, Nmt { command, target: NmtTarget::Node(node) }.frame())
    }

    /// Asks every node id for its device type. Nodes that are none of the scenario's show as [strangers](Self::strangers).
    ///
    /// # Errors
    /// [`LineError`] except those of transfers.
    pub fn scan(&mut self) -> Result<(), LineError> {
        let request = SdoRequest::InitiateUpload { object: ObjectAddress::new(0x1000, 0) };
        for id in 1..=MASTER_NODE.get() {
            let node = NodeId::new(id).expect("the id is in range");
            for bus in 0..self.names.len() {
                self.send(bus, request.frame(node))?;
            }
            self.listen(SCAN_NS)?;
        }
        Ok(())
    }

    /// Sends SYNC to the bus of an axis. Returns the time from its end until the drive began to transmit its process data, ns;
    /// none where nothing came.
    pub(super) fn sync_answer_ns(&mut self, axis: usize) -> Result<Option<u64>, LineError> {
        let (bus, _) = self.addresses[axis];
        (self.sync_ns, self.heard[axis].process_data_ns) = (None, None);
        self.send(bus, sync::frame())?;
        self.listen_until(SYNC_NS, |line| line.heard[axis].process_data_ns.is_some())?;
        Ok(self.heard[axis]
            .process_data_ns
            .zip(self.sync_ns)
            .map(|(begin_ns, sync_ns)| begin_ns.saturating_sub(sync_ns)))
    }

    /// Everything of the log is on its way to its file.
    ///
    /// # Errors
    /// [`LineError::Log`].
    pub fn flush(&mut self) -> Result<(), LineError> {
        Ok(self.log.flush()?)
    }

    fn download(
        &mut self,
        axis: usize,
        object: ObjectAddress,
        value: u32,
        bytes: usize,
    ) -> Result<(), LineError> {
        let data = Expedited::new(&value.to_le_bytes()[..bytes]).expect("one to four bytes");
        match self.ask(axis, object, SdoRequest::Download { object, data })? {
            SdoResponse::Download { .. } => Ok(()),
            _ => Err(LineError::Sdo { axis, object, reason: SdoReason::Malformed }),
        }
    }

    /// Sends a request and waits for its answer. A segment is not asked for twice: its answer would be another one.
    fn ask(
        &mut self,
        axis: usize,
        object: ObjectAddress,
        request: SdoRequest,
    ) -> Result<SdoResponse, LineError> {
        let (bus, node) = self.addresses[axis];
        let failed = |reason| LineError::Sdo { axis, object, reason };
        let attempts = if matches!(request, SdoRequest::UploadSegment { .. }) { 1 } else { ATTEMPTS };
        let timeout_ns = if self.switched_on.is_some() { POWERED_TIMEOUT_NS } else { TIMEOUT_NS };
        for _ in 0..attempts {
            self.heard[axis].answer = None;
            self.send(bus, request.frame(node))?;
            self.listen_until(timeout_ns, |line| line.heard[axis].answer.is_some())?;
            match self.heard[axis].answer.take() {
                Some(SdoResponse::Abort { code, .. }) => return Err(failed(SdoReason::Aborted(code))),
                Some(answer) if answers(&answer, object) => return Ok(answer),
                // An answer to an earlier request: this one is repeated.
                _ => {}
            }
        }
        let code = AbortCode::TIMED_OUT;
        self.send(bus, SdoRequest::Abort { object, code }.frame(node))?;
        Err(failed(SdoReason::Silent))
    }

    fn send(&mut self, bus: usize, frame: Frame) -> Result<(), LineError> {
        self.wires.send(bus, frame).map_err(|error| LineError::Send { bus, error })
    }

    /// A step of time: the heartbeat, and every frame that has come.
    fn step(&mut self) -> Result<(), LineError> {
        self.wires.pass(STEP_NS)?;
        self.send_heartbeat()?;
        for bus in 0..self.names.len() {
            while let Some(tapped) = self.wires.tap(bus) {
                let mut text = String::new();
                candump::write(&mut text, &self.names[bus], &tapped).expect("a text takes everything");
                writeln!(self.log, "{text}")?;
                if let Tapped::Frame(tapped) = tapped {
                    self.note_time(bus, &tapped);
                }
            }
            while let Some(received) = self.wires.receive(bus) {
                self.take(bus, &received.frame);
            }
        }
        Ok(())
    }

    /// Notes the times of SYNC and of process data.
    fn note_time(&mut self, bus: usize, tapped: &TappedFrame) {
        match Cob::try_from(tapped.frame.id()) {
            Ok(Cob::Sync) => self.sync_ns = Some(tapped.time_ns),
            Ok(Cob::Tpdo1(node)) => {
                let bits = frame_bits(&tapped.frame) - INTERFRAME_BITS;
                let begin_ns = tapped.time_ns.saturating_sub(self.bitrate.bits_to_ns(bits));
                let axis = self.addresses.iter().position(|at| *at == (bus, node));
                if let Some(axis) = axis {
                    self.heard[axis].process_data_ns = Some(begin_ns);
                }
            }
            _ => {}
        }
    }

    fn send_heartbeat(&mut self) -> Result<(), LineError> {
        let now_ns = self.now_ns();
        let Some(beat) = self.beat.as_mut().filter(|beat| now_ns >= beat.next_ns) else { return Ok(()) };
        beat.next_ns = now_ns + beat.every_ns;
        let frame = Heartbeat { state: NmtState::Operational }.frame(MASTER_NODE);
        (0..self.names.len()).try_for_each(|bus| self.send(bus, frame))
    }

    fn take(&mut self, bus: usize, frame: &Frame) {
        let Ok(cob) = Cob::try_from(frame.id()) else { return };
        let sender = match cob {
            Cob::Heartbeat(node) | Cob::Emergency(node) | Cob::SdoResponse(node) | Cob::Tpdo1(node) => {
                Some(node)
            }
            _ => None,
        };
        match self.addresses.iter().position(|&(at, node)| at == bus && Some(node) == sender) {
            Some(axis) => self.heard[axis].take(cob, frame),
            None => self.strangers.take(bus, cob),
        }
    }
}

/// Whether an answer belongs to a request for that object. Segments name no object.
fn answers(answer: &SdoResponse, asked: ObjectAddress) -> bool {
    match answer {
        SdoResponse::Download { object }
        | SdoResponse::Upload { object, .. }
        | SdoResponse::InitiateUpload { object, .. } => *object == asked,
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bringup::test_log::Log;

    fn line() -> (Line, Log) {
        let log = Log::default();
        (Line::open(&Scenario::default(), Box::new(log.clone())).unwrap(), log)
    }

    #[test]
    fn objects_of_every_length_are_read_and_written() {
        let (mut line, _) = line();
        line.listen(100 * MILLISECOND_NS).unwrap();
        let name = line.read(3, ObjectAddress::new(0x1008, 0)).unwrap();
        assert_eq!(String::from_utf8(name).unwrap(), "Masseter emulated drive");
        let window = ObjectAddress::new(0x6065, 0);
        line.write(3, window, 123, 4).unwrap();
        assert_eq!(line.read_number(3, window).unwrap(), 123);
        let missing = line.read(3, ObjectAddress::new(0x2000, 0)).unwrap_err();
        assert_eq!(missing.abort_code(), Some(AbortCode::NO_OBJECT));
        assert_eq!(missing.to_string(), "l1: object 2000h:00h: 06020000h (object does not exist)");
        assert_eq!((line.heard(3).boot_ups, line.strangers().is_empty()), (1, true));
    }

    #[test]
    fn a_second_drive_is_not_switched_on() {
        let (mut line, log) = line();
        line.listen(100 * MILLISECOND_NS).unwrap();
        for word in [Controlword::SHUTDOWN, Controlword::SWITCH_ON] {
            line.control(3, word).unwrap();
        }
        line.control(4, Controlword::SHUTDOWN).unwrap();
        let refusal = line.control(4, Controlword::ENABLE_OPERATION).unwrap_err().to_string();
        assert_eq!(refusal, "l2: not switched on, because l1 still is; end that step first");
        line.control(3, Controlword::DISABLE_VOLTAGE).unwrap();
        line.note_off(3);
        line.control(4, Controlword::SWITCH_ON).unwrap();
        let log = log.text();
        assert_eq!(log.matches(" can1 605#2B40600007").count(), 1, "{log}");
    }
}
