//! The frames on the buses of all drives: sent, received and logged. This module waits for no answer.
//!
//! The buses are simulated ones with the emulated drives, or real interfaces, each with its clock.

use std::{collections::BTreeSet, io::Write};

use masseter_can::canopen::{Cob, Emergency, Heartbeat, NmtState, SdoResponse};
use masseter_can::wire::{Bitrate, INTERFRAME_BITS, frame_bits};
use masseter_can::{FULL_QUEUE, Frame, ReceiveError, SendError, Tapped, TappedFrame, candump};
use masseter_model::geometry::AXES;
use masseter_plant::{Address, PlantError, Wires, addresses, sender};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{MASTER_NODE, Scenario};

use crate::line_error::{LineError, MasterSign, OtherMaster};

/// Time between two looks at the buses, ns.
const STEP_NS: u64 = MILLISECOND_NS;

/// The heartbeat of this node: drives that watch this heartbeat stop without it.
#[derive(Debug, Clone, Copy)]
struct Beat {
    every_ns: u64,
    next_ns: u64,
}

/// The buses, with the received messages.
pub(crate) struct Traffic {
    pub(crate) wires: Wires,
    /// Names of the buses in the log.
    pub(crate) names: Vec<String>,
    pub(crate) addresses: [Address; AXES],
    pub(crate) heard: [Heard; AXES],
    /// The signs of other masters and nodes.
    pub(crate) strangers: Strangers,
    beat: Option<Beat>,
    /// Time of the last SYNC on its bus, ns.
    pub(crate) sync_ns: Option<u64>,
    bitrate: Bitrate,
    pub(crate) log: Box<dyn Write + Send>,
}

impl Traffic {
    /// Traffic on the scenario's interfaces, or on simulated buses for a scenario without interfaces.
    ///
    /// # Errors
    /// [`PlantError`] for interfaces that cannot be opened and for buses that cannot be built.
    pub(crate) fn open(scenario: &Scenario, log: Box<dyn Write + Send>) -> Result<Self, PlantError> {
        let can = &scenario.can;
        let addresses = addresses(can)?;
        let simulated = (0..can.buses.len()).map(|bus| format!("can{bus}")).collect();
        Ok(Self {
            wires: Wires::open(scenario)?,
            names: if can.is_virtual() { simulated } else { can.interfaces.clone() },
            addresses,
            heard: Default::default(),
            strangers: Strangers::default(),
            beat: None,
            sync_ns: None,
            bitrate: Bitrate::new(can.bitrate_bps)?,
            log,
        })
    }

    /// Sends the master's heartbeat from now on, with that interval.
    pub(crate) fn beat_every(&mut self, interval_ms: u16) {
        self.beat =
            Some(Beat { every_ns: u64::from(interval_ms) * MILLISECOND_NS, next_ns: self.wires.now_ns() });
    }

    /// Sends no further heartbeat; returns when the last one was queued, ns.
    pub(crate) fn end_heartbeat(&mut self) -> u64 {
        let now_ns = self.wires.now_ns();
        self.beat.take().map_or(now_ns, |beat| beat.next_ns.saturating_sub(beat.every_ns))
    }

    /// Sends a frame to a bus.
    pub(crate) fn send(&mut self, bus: usize, frame: Frame) -> Result<(), LineError> {
        self.wires.send(bus, frame).map_err(|error| match error {
            SendError::Os { errno } => self.failed(bus, errno),
            SendError::QueueFull { .. } if self.wires.are_real() => self.failed(bus, FULL_QUEUE),
            _ => LineError::Send { bus, error },
        })
    }

    fn failed(&self, bus: usize, errno: i32) -> LineError {
        LineError::Interface { bus, interface: self.names[bus].clone(), errno }
    }

    /// A step of time: the heartbeat, and every frame that has come.
    pub(crate) fn step(&mut self) -> Result<(), LineError> {
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
            loop {
                match self.wires.receive(bus) {
                    Ok(Some(received)) => self.note_frame(bus, &received.frame),
                    // Lost frames show as missing answers.
                    Err(ReceiveError::Overrun { .. }) => {}
                    Ok(None) => break,
                    Err(ReceiveError::Os { errno }) => return Err(self.failed(bus, errno)),
                }
            }
        }
        Ok(())
    }

    /// Notes the times of SYNC, of process data and of the master's heartbeat.
    fn note_time(&mut self, bus: usize, tapped: &TappedFrame) {
        let axis_of = |node| self.addresses.iter().position(|at| *at == Address { bus, node });
        match Cob::try_from(tapped.frame.id()) {
            Ok(Cob::Sync) => self.sync_ns = Some(tapped.time_ns),
            Ok(Cob::Heartbeat(MASTER_NODE)) => {
                let on_bus = self.addresses.iter().zip(&mut self.heard).filter(|(at, _)| at.bus == bus);
                on_bus.for_each(|(_, heard)| heard.beat_left_ns = Some(tapped.time_ns));
            }
            Ok(Cob::Rpdo1(node)) => {
                if let Some(axis) = axis_of(node) {
                    self.heard[axis].rpdo_left_ns = Some(tapped.time_ns);
                }
            }
            Ok(Cob::Tpdo1(node)) => {
                let bits = frame_bits(&tapped.frame) - INTERFRAME_BITS;
                let begin_ns = tapped.time_ns.saturating_sub(self.bitrate.bits_to_ns(bits));
                if let Some(axis) = axis_of(node) {
                    self.heard[axis].process_data_ns = Some(begin_ns);
                }
            }
            _ => {}
        }
    }

    fn send_heartbeat(&mut self) -> Result<(), LineError> {
        let now_ns = self.wires.now_ns();
        let Some(beat) = self.beat.as_mut().filter(|beat| now_ns >= beat.next_ns) else { return Ok(()) };
        beat.next_ns = now_ns + beat.every_ns;
        let frame = Heartbeat { state: NmtState::Operational }.frame(MASTER_NODE);
        (0..self.names.len()).try_for_each(|bus| self.send(bus, frame))
    }

    fn note_frame(&mut self, bus: usize, frame: &Frame) {
        let Ok(cob) = Cob::try_from(frame.id()) else { return };
        let sender = sender(cob);
        match self.addresses.iter().position(|at| at.bus == bus && Some(at.node) == sender) {
            Some(axis) => self.heard[axis].note_frame(cob, frame),
            None => self.strangers.note_sender(bus, cob),
        }
    }
}

/// The received messages of one drive.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Heard {
    /// State of its heartbeat.
    pub nmt: Option<NmtState>,
    /// Boot-up messages.
    pub boot_ups: u32,
    /// Its emergencies, the oldest first.
    pub emergencies: Vec<Emergency>,
    /// Start of its last process data, ns.
    pub(crate) process_data_ns: Option<u64>,
    /// Ends of the master's last heartbeat on its bus, and of the last process data for it, ns.
    pub(crate) beat_left_ns: Option<u64>,
    pub(crate) rpdo_left_ns: Option<u64>,
    /// Answers of its SDO server since the last transfer.
    pub(crate) answers: Vec<SdoResponse>,
}

impl Heard {
    /// Takes a frame of the drive. Malformed frames have no effect; the log has them.
    pub(crate) fn note_frame(&mut self, cob: Cob, frame: &Frame) {
        match cob {
            Cob::Heartbeat(_) => {
                if let Ok(Heartbeat { state }) = Heartbeat::decode(frame.data()) {
                    self.boot_ups += u32::from(state == NmtState::BootUp);
                    self.nmt = Some(state);
                }
            }
            Cob::Emergency(_) => self.emergencies.extend(Emergency::decode(frame.data())),
            Cob::SdoResponse(_) => self.answers.extend(SdoResponse::decode(frame.data())),
            _ => {}
        }
    }
}

/// Signs of other masters and of nodes that the scenario does not have.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Strangers {
    /// SYNC, NMT, process data or SDO requests to a drive, or a heartbeat of the master's node id.
    pub masters: BTreeSet<OtherMaster>,
    /// Nodes beside those of the scenario.
    pub nodes: BTreeSet<Address>,
}

impl Strangers {
    /// Refuses to go on after a sign of another master.
    ///
    /// # Errors
    /// [`OtherMaster`].
    pub fn refuse_masters(&self) -> Result<(), OtherMaster> {
        self.masters.first().map_or(Ok(()), |&master| Err(master))
    }

    /// Takes a frame of a node that is no drive of the scenario.
    pub(crate) fn note_sender(&mut self, bus: usize, cob: Cob) {
        let sign = match cob {
            Cob::Sync => MasterSign::Sync,
            Cob::Nmt => MasterSign::Nmt,
            Cob::SdoRequest(_) => MasterSign::SdoRequests,
            Cob::Rpdo1(_) => MasterSign::ProcessData,
            Cob::Heartbeat(node) if node == MASTER_NODE => MasterSign::Heartbeat,
            Cob::Heartbeat(node) | Cob::Emergency(node) | Cob::SdoResponse(node) | Cob::Tpdo1(node) => {
                self.nodes.insert(Address { bus, node });
                return;
            }
        };
        self.masters.insert(OtherMaster { bus, sign });
    }
}
