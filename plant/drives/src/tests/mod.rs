//! Scenarios of a single drive that moves a mass, driven by frames alone.

mod blocks;
mod commissioning;
mod communication;
mod cyclic;
mod homing;
mod memory;
mod modes;
mod objects;
mod process_data;
mod quirks;
mod sdo;
mod velocity;

use masseter_can::canopen::{
    AbortCode, Cob, Emergency, EmergencyCode, Expedited, Heartbeat, Nmt, NmtCommand, NmtState, NmtTarget,
    NodeId, ObjectAddress, SdoRequest, SdoResponse, sync,
};
use masseter_can::cia402::{DriveState, StatusBit, Statusword};
use masseter_can::{CanId, ErrorState, Frame};

use super::*;

pub(crate) const STEP_NS: u64 = 125_000;
pub(crate) const STEPS_PER_MS: u64 = 1_000_000 / STEP_NS;
pub(crate) const MASS_KG: f64 = 0.6;
pub(crate) const LOAD_N: f64 = 5.0;
/// Initial position of the axis, between two reference marks.
pub(crate) const START: i32 = 270_700;
pub(crate) const LIMITS: [i32; 2] = [220_000, 360_000];

pub(crate) const CONTROLWORD: (u16, u8) = (0x6040, 0);
pub(crate) const STATUSWORD: (u16, u8) = (0x6041, 0);
pub(crate) const MODE: (u16, u8) = (0x6060, 0);
pub(crate) const POSITION: (u16, u8) = (0x6064, 0);
pub(crate) const TARGET_POSITION: (u16, u8) = (0x607A, 0);

/// A drive with its axis, and a client of it.
pub(crate) struct Bench {
    pub(crate) drive: DriveNode,
    pub(crate) now_ns: u64,
    pub(crate) position_m: f64,
    pub(crate) velocity_m_s: f64,
    pub(crate) force_n: f64,
    pub(crate) load_n: f64,
    /// By how much the encoder shows too much.
    pub(crate) offset_m: f64,
    /// Where the encoder began to count the other way.
    pub(crate) turned_at_m: Option<f64>,
    /// Hard stops of the axis.
    pub(crate) stops_m: [f64; 2],
    pub(crate) sent: Vec<Frame>,
}

pub(crate) fn id(number: u8) -> NodeId {
    NodeId::new(number).unwrap()
}

/// Node 4: a drive without quirks, with controlword and target in RPDO1, statusword, position and torque in TPDO1.
pub(crate) fn settings() -> DriveSettings {
    DriveSettings { stroke_m: LIMITS.map(|end| f64::from(end) * 1e-6), ..DriveSettings::new(id(4)) }
}

impl Bench {
    /// A drive that has booted.
    pub(crate) fn new() -> Self {
        Self::with(&settings())
    }

    /// The same of a drive with those settings.
    pub(crate) fn with(settings: &DriveSettings) -> Self {
        let mut bench = Self::switched_on(settings);
        bench.run_ms(25);
        bench
    }

    /// A drive that has just been switched on.
    pub(crate) fn switched_on(settings: &DriveSettings) -> Self {
        let increment_m = settings.ratings.encoder_resolution_m;
        let position_m = f64::from(START) * increment_m;
        Self {
            drive: DriveNode::new(settings, 0, position_m).unwrap(),
            now_ns: 0,
            position_m,
            velocity_m_s: 0.0,
            force_n: 0.0,
            load_n: LOAD_N,
            offset_m: 0.0,
            turned_at_m: None,
            stops_m: [f64::NEG_INFINITY, f64::INFINITY],
            sent: Vec::new(),
        }
    }

    /// A drive that is operational.
    pub(crate) fn operational() -> Self {
        let mut bench = Self::new();
        bench.nmt(NmtCommand::Start);
        bench
    }

    /// A drive that is enabled in a mode, over SDO alone.
    pub(crate) fn enabled(mode: i8) -> Self {
        let mut bench = Self::new();
        bench.write(MODE, &[mode as u8]).unwrap();
        bench.enable();
        bench
    }

    pub(crate) fn enable(&mut self) {
        for word in [0x06_u16, 0x07, 0x0F] {
            self.control(word);
            self.run_ms(1);
        }
        assert_eq!(self.drive.state(), DriveState::OperationEnabled);
    }

    pub(crate) fn run_ms(&mut self, ms: u64) {
        self.run_steps(ms * STEPS_PER_MS);
    }

    fn run_steps(&mut self, steps: u64) {
        for _ in 0..steps {
            let step_s = STEP_NS as f64 * 1e-9;
            let [low_m, high_m] = self.stops_m;
            let stopped_n = 1e6 * ((low_m - self.position_m).max(0.0) - (self.position_m - high_m).max(0.0));
            let damped_n = if stopped_n == 0.0 { 0.0 } else { 1e3 * self.velocity_m_s };
            self.velocity_m_s += (self.force_n - self.load_n + stopped_n - damped_n) / MASS_KG * step_s;
            self.position_m += self.velocity_m_s * step_s;
            self.now_ns += STEP_NS;
            let (offset_m, turned_at_m) = (self.offset_m, self.turned_at_m);
            let look =
                |at_m: f64| Look::exact(offset_m + turned_at_m.map_or(at_m, |from_m| 2.0 * from_m - at_m));
            self.force_n = self.drive.step(self.now_ns, self.position_m, look);
            self.collect();
        }
    }

    pub(crate) fn collect(&mut self) {
        while let Some(frame) = self.drive.outgoing() {
            self.sent.push(frame);
        }
    }

    pub(crate) fn receive(&mut self, frame: Frame) {
        if frame.id() == CanId::from(Cob::Sync) {
            self.drive.take_sync(self.now_ns, &frame, self.position_m, Look::exact);
        } else {
            self.drive.receive(self.now_ns, &frame);
        }
        self.collect();
    }

    pub(crate) fn nmt(&mut self, command: NmtCommand) {
        self.receive(Nmt { command, target: NmtTarget::All }.frame());
    }

    /// Sends SYNC; returns the drive's answer.
    pub(crate) fn sync(&mut self) -> Vec<Frame> {
        let before = self.sent.len();
        self.receive(sync::frame());
        self.sent[before..].to_vec()
    }

    pub(crate) fn master_beats(&mut self) {
        self.receive(Heartbeat { state: NmtState::Operational }.frame(id(127)));
    }

    /// The answer of the SDO server.
    pub(crate) fn ask(&mut self, request: SdoRequest) -> Option<SdoResponse> {
        let before = self.sent.len();
        self.receive(request.frame(id(4)));
        let answers = self.sent[before..].iter().filter(|frame| frame.id() == Cob::SdoResponse(id(4)).into());
        answers.map(|frame| SdoResponse::decode(frame.data()).unwrap()).next()
    }

    pub(crate) fn write(&mut self, (index, subindex): (u16, u8), data: &[u8]) -> Result<(), AbortCode> {
        let object = ObjectAddress::new(index, subindex);
        match self.ask(SdoRequest::Download { object, data: Expedited::new(data).unwrap() }) {
            Some(SdoResponse::Download { .. }) => Ok(()),
            Some(SdoResponse::Abort { code, .. }) => Err(code),
            other => panic!("{object}: {other:?}"),
        }
    }

    pub(crate) fn read(&mut self, (index, subindex): (u16, u8)) -> Result<u32, AbortCode> {
        let object = ObjectAddress::new(index, subindex);
        match self.ask(SdoRequest::InitiateUpload { object }) {
            Some(SdoResponse::Upload { data, .. }) => {
                let mut word = [0; 4];
                word[..data.data().len()].copy_from_slice(data.data());
                Ok(u32::from_le_bytes(word))
            }
            Some(SdoResponse::Abort { code, .. }) => Err(code),
            other => panic!("{object}: {other:?}"),
        }
    }

    pub(crate) fn control(&mut self, word: u16) {
        self.write(CONTROLWORD, &word.to_le_bytes()).unwrap();
    }

    pub(crate) fn statusword(&mut self) -> Statusword {
        Statusword(self.read(STATUSWORD).unwrap() as u16)
    }

    pub(crate) fn position(&mut self) -> i32 {
        self.read(POSITION).unwrap() as i32
    }

    /// Error register and error code (1001, 603F).
    pub(crate) fn errors(&mut self) -> (u32, u32) {
        (self.read((0x1001, 0)).unwrap(), self.read((0x603F, 0)).unwrap())
    }

    /// Emergency codes sent so far.
    pub(crate) fn emergencies(&self) -> Vec<EmergencyCode> {
        let frames = self.sent.iter().filter(|frame| frame.id() == Cob::Emergency(id(4)).into());
        frames.map(|frame| Emergency::decode(frame.data()).unwrap().code).collect()
    }

    /// States in the heartbeats and boot-up messages sent so far.
    pub(crate) fn heartbeats(&self) -> Vec<NmtState> {
        let frames = self.sent.iter().filter(|frame| frame.id() == Cob::Heartbeat(id(4)).into());
        frames.map(|frame| Heartbeat::decode(frame.data()).unwrap().state).collect()
    }
}

/// A process data object under any identifier.
pub(crate) fn pdo(number: u16, data: &[u8]) -> Frame {
    Frame::new(CanId::standard(number).unwrap(), data).unwrap()
}

/// CiA 301's procedure for changing a mapping; the PDO is `cob_id` afterwards.
pub(crate) fn remap(bench: &mut Bench, communication: u16, cob_id: u32, objects: &[u32]) {
    let mapping = communication + 0x200;
    bench.write((communication, 1), &(cob_id | 1 << 31).to_le_bytes()).unwrap();
    bench.write((mapping, 0), &[0]).unwrap();
    for (place, object) in (1..).zip(objects) {
        bench.write((mapping, place), &object.to_le_bytes()).unwrap();
    }
    bench.write((mapping, 0), &[objects.len() as u8]).unwrap();
    bench.write((communication, 1), &cob_id.to_le_bytes()).unwrap();
}

pub(crate) const PROFILE_POSITION: i8 = 1;
pub(crate) const HOMING: i8 = 6;
pub(crate) const CYCLIC_POSITION: i8 = 8;
pub(crate) const CYCLIC_TORQUE: i8 = 10;
pub(crate) const PROFILE_VELOCITY: i8 = 3;
pub(crate) const PROFILE_TORQUE: i8 = 4;
pub(crate) const CYCLIC_VELOCITY: i8 = 9;

/// RPDO1 as mapped after power-on.
pub(crate) fn command(word: u16, target: i32) -> Frame {
    let [w0, w1] = word.to_le_bytes();
    let [t0, t1, t2, t3] = target.to_le_bytes();
    pdo(0x204, &[w0, w1, t0, t1, t2, t3])
}

impl Bench {
    /// A cycle of a master: process data, SYNC, a millisecond.
    pub(crate) fn cycle(&mut self, word: u16, target: i32) {
        self.receive(command(word, target));
        self.sync();
        self.run_ms(1);
    }

    /// An enabled drive in cyclic synchronous position that moves at 0.1 m/s.
    pub(crate) fn cycling() -> (Self, i32) {
        let mut bench = Self::operational();
        for word in [0x06, 0x07, 0x0F] {
            bench.cycle(word, START);
        }
        let mut target = START;
        for step in 0..200 {
            target += step.min(100);
            bench.cycle(0x0F, target);
        }
        assert!((bench.velocity_m_s - 0.1).abs() < 0.01, "{}", bench.velocity_m_s);
        (bench, target)
    }

    /// Starts the motion to a set-point: target, then the rising edge of bit 4.
    pub(crate) fn set_point(&mut self, target: i32, bits: u16) {
        self.write(TARGET_POSITION, &target.to_le_bytes()).unwrap();
        self.control(0x0F);
        self.control(0x1F | bits);
    }

    pub(crate) fn has(&mut self, bit: StatusBit) -> bool {
        self.statusword().has(bit)
    }

    pub(crate) fn is_near(&mut self, target: i32) -> bool {
        (self.position() - target).abs() <= 10
    }
}
