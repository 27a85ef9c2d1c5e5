//! The frames on the buses of all drives: sent, heard and logged. Nothing here waits for an answer.

use std::io::Write;

use masseter_can::canopen::{Cob, Heartbeat, NmtState, NodeId, SdoResponse};
use masseter_can::wire::{Bitrate, INTERFRAME_BITS, frame_bits};
use masseter_can::{Frame, Tapped, TappedFrame, candump};
use masseter_model::geometry::AXES;
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{MASTER_NODE, Scenario};

use super::heard::{Heard, Strangers};
use super::line_error::LineError;
use super::wires::Wires;
use crate::error::PlantError;
use crate::link::layout::{drive_ports, node_ids};

/// Time between two looks at the buses, ns.
const STEP_NS: u64 = MILLISECOND_NS;

/// The heartbeat of this node: drives that watch it stop without it.
#[derive(Debug, Clone, Copy)]
struct Beat {
    every_ns: u64,
    next_ns: u64,
}

/// The buses, and what was heard on them.
pub(super) struct Traffic {
    wires: Wires,
    /// Names of the buses in the log.
    names: Vec<String>,
    addresses: [(usize, NodeId); AXES],
    heard: [Heard; AXES],
    strangers: Strangers,
    beat: Option<Beat>,
    /// When the last SYNC was on its bus, ns.
    sync_ns: Option<u64>,
    bitrate: Bitrate,
    log: Box<dyn Write + Send>,
}

impl Traffic {
    /// On the scenario's interfaces, or on simulated buses where it names none.
    ///
    /// # Errors
    /// [`PlantError`] for interfaces that cannot be opened and for buses that cannot be built.
    pub(super) fn open(scenario: &Scenario, log: Box<dyn Write + Send>) -> Result<Self, PlantError> {
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
            log,
        })
    }

    /// The present time, ns.
    pub(super) fn now_ns(&self) -> u64 {
        self.wires.now_ns()
    }

    /// Names of the buses.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Bus and node id of the drive of an axis.
    pub(super) fn address(&self, axis: usize) -> (usize, NodeId) {
        self.addresses[axis]
    }

    /// What was heard of a drive.
    pub(super) fn heard(&self, axis: usize) -> &Heard {
        &self.heard[axis]
    }

    /// The answer of a drive that nobody has taken.
    pub(super) fn take_answer(&mut self, axis: usize) -> Option<SdoResponse> {
        self.heard[axis].answer.take()
    }

    /// Who else was heard.
    pub(super) fn strangers(&self) -> &Strangers {
        &self.strangers
    }

    /// Forgets the last SYNC, and the process data of a drive.
    pub(super) fn forget_sync(&mut self, axis: usize) {
        (self.sync_ns, self.heard[axis].process_data_ns) = (None, None);
    }

    /// Time from the end of the last SYNC until a drive began to transmit process data, ns; none where one of them was not heard.
    pub(super) fn sync_answer_ns(&self, axis: usize) -> Option<u64> {
        let (begin_ns, sync_ns) = self.heard[axis].process_data_ns.zip(self.sync_ns)?;
        Some(begin_ns.saturating_sub(sync_ns))
    }

    /// Sends the master's heartbeat from now on, with that interval.
    pub(super) fn beat_every(&mut self, interval_ms: u16) {
        self.beat = Some(Beat { every_ns: u64::from(interval_ms) * MILLISECOND_NS, next_ns: self.now_ns() });
    }

    /// Sends a frame to a bus.
    pub(super) fn send(&mut self, bus: usize, frame: Frame) -> Result<(), LineError> {
        self.wires.send(bus, frame).map_err(|error| LineError::Send { bus, error })
    }

    /// Everything of the log is on its way to its file.
    pub(super) fn flush(&mut self) -> Result<(), LineError> {
        Ok(self.log.flush()?)
    }

    /// A step of time: the heartbeat, and every frame that has come.
    pub(super) fn step(&mut self) -> Result<(), LineError> {
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
