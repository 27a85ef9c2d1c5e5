//! A scripted drive, and wires on which frames arrive at once. The drive has the part of CANopen that the master uses,
//! with a table of objects that a test may change.

use std::collections::{BTreeMap, VecDeque};

use masseter_can::canopen::{
    AbortCode, Cob, Expedited, Heartbeat, Nmt, NmtCommand, NmtState, NodeId, ObjectAddress, SdoRequest,
    SdoResponse,
};
use masseter_can::cia402::{Controlword, DriveState, Statusword};
use masseter_can::{
    Bus, BusStatus, ErrorState, Frame, PdoMapping, ReceiveError, Received, Rpdo1, SendError, Tpdo1,
};
use masseter_model::geometry::AXES;
use masseter_scenario::IdentityConfig;

use super::PERIOD_NS;
use crate::master::link::Buses;

const HEARTBEAT_NS: u64 = 50 * PERIOD_NS;
/// Position of every drive as it is switched on, increments.
pub(super) const POSITION: i32 = 1234;

/// A drive.
pub(super) struct Peer {
    pub(super) id: NodeId,
    pub(super) objects: BTreeMap<(u16, u8), Vec<u8>>,
    pub(super) nmt: Option<NmtState>,
    pub(super) power: DriveState,
    /// The state that the drive does not leave.
    stuck_in: Option<DriveState>,
    /// Whether its fault reaction goes on.
    pub(super) is_reacting: bool,
    /// Whether it is without power.
    pub(super) is_dead: bool,
    /// Servers that answer to its id.
    pub(super) servers: usize,
    /// Position that another drive of its id reports, increments.
    pub(super) twin_position: Option<i32>,
    /// An object with refused reads and writes.
    pub(super) refuses: Option<((u16, u8), AbortCode)>,
    /// Objects with refused writes.
    pub(super) constants: Vec<(u16, u8)>,
    /// An object that it acknowledges and does not keep.
    pub(super) forgets: Option<(u16, u8)>,
    /// SDO requests received, each with its time.
    pub(super) requests: Vec<(u64, SdoRequest)>,
    controlword: Controlword,
    buffered: Option<Rpdo1>,
    /// What its RPDO1 carries.
    pub(super) rpdo1: PdoMapping,
    /// The torque offset that it received last, ‰ of the rated torque.
    pub(super) torque_offset_permille: i16,
    /// Its torque, ‰ of the rated one.
    pub(super) torque_permille: i16,
    /// Its position, increments.
    pub(super) position: i32,
    /// Whether targets may differ from the position.
    pub(super) may_move: bool,
    /// The targets it received, each with the state that it was in.
    pub(super) targets: Vec<(DriveState, i32)>,
    pub(super) next_beat_ns: u64,
}

impl Peer {
    pub(super) fn new(id: NodeId, identity: &IdentityConfig) -> Self {
        let node = u32::from(id.get());
        let long = |address, value: u32| (address, value.to_le_bytes().to_vec());
        let objects = BTreeMap::from([
            long((0x1000, 0), identity.device_type),
            long((0x1018, 1), identity.vendor_id),
            long((0x1018, 2), identity.product_code),
            long((0x1018, 3), identity.revision),
            long((0x1400, 1), 0x200 + node),
            ((0x1400, 2), vec![1]),
            ((0x1600, 0), vec![2]),
            long((0x1600, 1), 0x6040_0010),
            long((0x1600, 2), 0x607A_0020),
            long((0x1800, 1), 0x4000_0180 + node),
            ((0x1800, 2), vec![1]),
            ((0x1A00, 0), vec![3]),
            long((0x1A00, 1), 0x6041_0010),
            long((0x1A00, 2), 0x6064_0020),
            long((0x1A00, 3), 0x6077_0010),
            ((0x603F, 0), vec![0x20, 0x73]),
            ((0x6061, 0), vec![1]),
            ((0x6064, 0), POSITION.to_le_bytes().to_vec()),
        ]);
        Self {
            id,
            objects,
            nmt: None,
            power: DriveState::SwitchOnDisabled,
            stuck_in: None,
            is_reacting: false,
            is_dead: false,
            servers: 1,
            twin_position: None,
            refuses: None,
            constants: Vec::new(),
            forgets: None,
            requests: Vec::new(),
            controlword: Controlword::DISABLE_VOLTAGE,
            buffered: None,
            rpdo1: PdoMapping::RPDO1,
            torque_offset_permille: 0,
            torque_permille: 0,
            position: POSITION,
            may_move: false,
            targets: Vec::new(),
            next_beat_ns: 0,
        }
    }

    /// The value written to an object, as a number.
    pub(super) fn written(&self, index: u16, subindex: u8) -> u32 {
        let mut word = [0; 4];
        let value = &self.objects[&(index, subindex)];
        word[..value.len()].copy_from_slice(value);
        u32::from_le_bytes(word)
    }

    /// Is in a state that it does not leave.
    pub(super) fn get_stuck_in(&mut self, state: DriveState) {
        (self.power, self.stuck_in) = (state, Some(state));
    }

    /// Leaves every state again that it is told to leave.
    pub(super) fn be_free(&mut self) {
        self.stuck_in = None;
    }

    /// Power off and on: it comes back as it left the factory.
    pub(super) fn cycle_power(&mut self) {
        (self.nmt, self.power, self.buffered) = (None, DriveState::SwitchOnDisabled, None);
    }

    fn live(&mut self, now_ns: u64, out: &mut Vec<Frame>) {
        if self.is_dead {
            return;
        }
        if self.nmt != Some(NmtState::Operational) {
            self.complete();
        }
        if self.nmt.is_none() {
            self.nmt = Some(NmtState::PreOperational);
            self.next_beat_ns = now_ns + HEARTBEAT_NS;
            out.push(Heartbeat { state: NmtState::BootUp }.frame(self.id));
        } else if let Some(state) = self.nmt.filter(|_| now_ns >= self.next_beat_ns) {
            self.next_beat_ns = now_ns + HEARTBEAT_NS;
            out.push(Heartbeat { state }.frame(self.id));
        }
    }

    fn receive(&mut self, now_ns: u64, frame: &Frame, out: &mut Vec<Frame>) {
        if self.is_dead || self.nmt.is_none() {
            return;
        }
        match Cob::try_from(frame.id()).unwrap() {
            Cob::Nmt => self.obey(Nmt::decode(frame.data()).unwrap()),
            Cob::Sync if self.nmt == Some(NmtState::Operational) => self.synchronise(out),
            Cob::Rpdo1(id) if id == self.id => {
                let rpdo = Rpdo1::decode(frame.data(), &self.rpdo1).unwrap();
                self.targets.push((self.power, rpdo.target_increments));
                self.torque_offset_permille = rpdo.torque_offset_permille;
                self.buffered = Some(rpdo);
            }
            Cob::SdoRequest(id) if id == self.id => {
                let request = SdoRequest::decode(frame.data()).unwrap();
                self.requests.push((now_ns, request));
                if !matches!(request, SdoRequest::Abort { .. }) {
                    let answer = self.serve(request);
                    out.extend(std::iter::repeat_n(answer.frame(self.id), self.servers));
                }
            }
            _ => {}
        }
    }

    fn obey(&mut self, nmt: Nmt) {
        if nmt.target.includes(self.id) {
            match nmt.command {
                NmtCommand::Start => self.nmt = Some(NmtState::Operational),
                // What the drive does with its motor is another matter.
                NmtCommand::ResetCommunication => (self.nmt, self.buffered) = (None, None),
                other => panic!("{other:?} is no expected command"),
            }
        }
    }

    fn synchronise(&mut self, out: &mut Vec<Frame>) {
        if let Some(rpdo) = self.buffered.take() {
            assert!(self.may_move || rpdo.target_increments == self.position, "no request moves it");
            self.control(rpdo.controlword);
        }
        self.complete();
        let statusword = Statusword::for_state(self.power);
        for actual_increments in self.twin_position.into_iter().chain([self.position]) {
            let tpdo = Tpdo1 { statusword, actual_increments, torque_permille: self.torque_permille };
            out.push(tpdo.frame(self.id, &PdoMapping::TPDO1));
        }
    }

    /// Its own transitions.
    fn complete(&mut self) {
        self.power = match self.power {
            _ if self.is_reacting => DriveState::FaultReactionActive,
            power if self.stuck_in == Some(power) => power,
            power => power.after_completion(),
        };
    }

    fn control(&mut self, word: Controlword) {
        let after = self.power.after(word.command(self.controlword, self.power));
        self.controlword = word;
        if self.stuck_in != Some(self.power) {
            self.power = after;
        }
    }

    fn serve(&mut self, request: SdoRequest) -> SdoResponse {
        match request {
            SdoRequest::InitiateUpload { object } => self.read(object),
            SdoRequest::Download { object, data } => self.write(object, data.data()),
            other => panic!("{other:?}: the master uses short values only"),
        }
    }

    fn read(&mut self, object: ObjectAddress) -> SdoResponse {
        if let Some(refusal) = self.refusal(object) {
            return refusal;
        }
        let statusword = Statusword::for_state(self.power).0.to_le_bytes().to_vec();
        let value = match (object.index, object.subindex) {
            (0x6041, 0) => Some(&statusword),
            address => self.objects.get(&address),
        };
        match value {
            Some(value) => {
                let size = Some(value.len() as u32);
                Expedited::new(value).map_or(SdoResponse::InitiateUpload { object, size }, |data| {
                    SdoResponse::Upload { object, data }
                })
            }
            None => SdoResponse::Abort { object, code: AbortCode::NO_OBJECT },
        }
    }

    fn refusal(&self, object: ObjectAddress) -> Option<SdoResponse> {
        let is_refused = |(refused, _): &((u16, u8), AbortCode)| *refused == (object.index, object.subindex);
        self.refuses.filter(is_refused).map(|(_, code)| SdoResponse::Abort { object, code })
    }

    fn write(&mut self, object: ObjectAddress, data: &[u8]) -> SdoResponse {
        let address = (object.index, object.subindex);
        if let Some(refusal) = self.refusal(object) {
            return refusal;
        }
        if self.constants.contains(&address) {
            return SdoResponse::Abort { object, code: AbortCode::READ_ONLY };
        }
        let is_powered = self.power.is_powered();
        let stops = matches!(address, (0x605A | 0x6040, 0));
        assert!(stops || !is_powered, "{object} of a drive that is {}", self.power);
        let data = if self.forgets == Some(address) {
            // Another value of the same length.
            data.iter().map(|byte| !byte).collect()
        } else {
            data.to_vec()
        };
        self.objects.insert(address, data.clone());
        match address {
            (0x6040, 0) => self.control(Controlword(u16::from_le_bytes(data.try_into().unwrap()))),
            (0x6060, 0) => drop(self.objects.insert((0x6061, 0), data)),
            _ => {}
        }
        SdoResponse::Download { object }
    }
}

/// One wire with its drives.
pub(super) struct Wire {
    peers: Vec<Peer>,
    arrived: VecDeque<Received>,
    /// Whether the master's controller is off the bus.
    pub(super) is_off: bool,
    /// Whether its adapter hangs: it keeps the master's frames.
    pub(super) hangs: bool,
    pub(super) kept: Vec<Frame>,
    /// Error of the system for every call.
    pub(super) errno: Option<i32>,
    /// Frames lost for want of room, reported once.
    pub(super) lost: u64,
}

/// Both wires, three drives each.
pub(super) struct Wires([Wire; 2]);

impl Wires {
    pub(super) fn new(peers: [Peer; AXES]) -> Self {
        let mut peers = Vec::from(peers);
        let second = peers.split_off(AXES / 2);
        Self([peers, second].map(|peers| Wire {
            peers,
            arrived: VecDeque::new(),
            is_off: false,
            hangs: false,
            kept: Vec::new(),
            errno: None,
            lost: 0,
        }))
    }

    pub(super) fn peer(&mut self, axis: usize) -> &mut Peer {
        &mut self.0[axis / 3].peers[axis % 3]
    }

    pub(super) fn wire(&mut self, bus: usize) -> &mut Wire {
        &mut self.0[bus]
    }

    /// The drives' own transitions, before the cycle's SYNC.
    pub(super) fn begin(&mut self, now_ns: u64) {
        for wire in &mut self.0 {
            let mut out = Vec::new();
            wire.peers.iter_mut().for_each(|peer| peer.live(now_ns, &mut out));
            for frame in out {
                wire.arrive(now_ns, frame);
            }
        }
    }
}

impl Wire {
    /// A frame that somebody sends to the master.
    pub(super) fn arrive(&mut self, now_ns: u64, frame: Frame) {
        if !self.is_off {
            self.arrived.push_back(Received { frame, time_ns: now_ns + 1000 });
        }
    }
}

impl Bus for &mut Wire {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        if self.is_off {
            return Err(SendError::BusOff { tec: 256 });
        }
        if let Some(errno) = self.errno {
            return Err(SendError::Os { errno });
        }
        if self.hangs {
            self.kept.push(frame);
            return Ok(());
        }
        let mut out = Vec::new();
        self.peers.iter_mut().for_each(|peer| peer.receive(now_ns, &frame, &mut out));
        for frame in out {
            self.arrive(now_ns, frame);
        }
        Ok(())
    }

    fn receive(&mut self, _now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        if let Some(errno) = self.errno {
            return Err(ReceiveError::Os { errno });
        }
        match std::mem::take(&mut self.lost) {
            0 => Ok(self.arrived.pop_front()),
            lost => Err(ReceiveError::Overrun { lost }),
        }
    }

    fn status(&self) -> BusStatus {
        let (state, tec) = if self.is_off { (ErrorState::BusOff, 256) } else { (ErrorState::Active, 0) };
        BusStatus { state, tec, rec: 0 }
    }

    fn unsent(&self) -> usize {
        self.kept.len()
    }
}

impl Buses for Wires {
    fn port(&mut self, bus: usize) -> impl Bus {
        &mut self.0[bus]
    }
}
