//! Scenarios of a single drive that moves a mass, driven by frames alone.

mod commissioning;
mod communication;
mod modes;
mod objects;
mod process_data;
mod quirks;
mod sdo;

use masseter_can::canopen::{
    AbortCode, Cob, Emergency, EmergencyCode, Expedited, Heartbeat, Nmt, NmtCommand, NmtState, NmtTarget,
    NodeId, ObjectAddress, SdoRequest, SdoResponse, sync,
};
use masseter_can::cia402::{DriveState, StatusBit, Statusword};
use masseter_can::{CanId, ErrorState, Frame};
use masseter_scenario::Scenario;

use super::names;
use super::node::DriveNode;
use crate::simulator::drive::DriveSettings;
use crate::simulator::drive::axis::encoder::Encoder;
use crate::simulator::drive::axis::motion::Shaft;
use crate::simulator::emulation::drives::drive_settings;

const STEP_NS: u64 = 125_000;
const STEPS_PER_MS: u64 = 1_000_000 / STEP_NS;
const MASS_KG: f64 = 0.6;
const LOAD_N: f64 = 5.0;
/// Initial position of the axis, between two reference marks.
const START: i32 = 270_700;
const LIMITS: [i32; 2] = [220_000, 360_000];

const CONTROLWORD: (u16, u8) = (0x6040, 0);
const STATUSWORD: (u16, u8) = (0x6041, 0);
const MODE: (u16, u8) = (0x6060, 0);
const POSITION: (u16, u8) = (0x6064, 0);
const TARGET_POSITION: (u16, u8) = (0x607A, 0);

/// A drive with its axis, and a client of it.
struct Bench {
    drive: DriveNode,
    now_ns: u64,
    position_m: f64,
    velocity_m_s: f64,
    force_n: f64,
    load_n: f64,
    /// Hard stops of the axis.
    stops_m: [f64; 2],
    sent: Vec<Frame>,
}

fn id(number: u8) -> NodeId {
    NodeId::new(number).unwrap()
}

/// A leg's drive, with limits that leave it more room than the default, and with the scenario's quirks.
fn settings(quirks: &str) -> DriveSettings {
    let mut scenario = Scenario::parse(std::path::Path::new("quirks.toml"), quirks).unwrap();
    scenario.validate().unwrap();
    scenario.dynamics.step_ns = STEP_NS;
    scenario.mechanism.strokes.leg_m = LIMITS.map(|end| f64::from(end) * 1e-6);
    let [_, _, _, leg, ..] = drive_settings(&scenario).unwrap();
    assert_eq!(leg.node, id(4));
    leg
}

impl Bench {
    /// A drive that has booted.
    fn new() -> Self {
        Self::with(&settings(""))
    }

    /// The same of a drive with those settings.
    fn with(settings: &DriveSettings) -> Self {
        let mut bench = Self::switched_on(settings);
        bench.run_ms(25);
        bench
    }

    /// A drive that has just been switched on.
    fn switched_on(settings: &DriveSettings) -> Self {
        let increment_m = settings.drive.encoder_resolution_m;
        let position_m = f64::from(START) * increment_m;
        Self {
            drive: DriveNode::new(settings, Encoder::new(increment_m, 0.0, 1, 0), 0, position_m).unwrap(),
            now_ns: 0,
            position_m,
            velocity_m_s: 0.0,
            force_n: 0.0,
            load_n: LOAD_N,
            stops_m: [f64::NEG_INFINITY, f64::INFINITY],
            sent: Vec::new(),
        }
    }

    /// A drive that is operational.
    fn operational() -> Self {
        let mut bench = Self::new();
        bench.nmt(NmtCommand::Start);
        bench
    }

    /// A drive that is enabled in a mode, over SDO alone.
    fn enabled(mode: i8) -> Self {
        let mut bench = Self::new();
        bench.write(MODE, &[mode as u8]).unwrap();
        bench.enable();
        bench
    }

    fn enable(&mut self) {
        for word in [0x06_u16, 0x07, 0x0F] {
            self.control(word);
            self.run_ms(1);
        }
        assert_eq!(self.drive.axis.power, DriveState::OperationEnabled);
    }

    fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms * STEPS_PER_MS {
            let step_s = STEP_NS as f64 * 1e-9;
            let [low_m, high_m] = self.stops_m;
            let stopped_n = 1e6 * ((low_m - self.position_m).max(0.0) - (self.position_m - high_m).max(0.0));
            let damped_n = if stopped_n == 0.0 { 0.0 } else { 1e3 * self.velocity_m_s };
            self.velocity_m_s += (self.force_n - self.load_n + stopped_n - damped_n) / MASS_KG * step_s;
            self.position_m += self.velocity_m_s * step_s;
            self.now_ns += STEP_NS;
            self.force_n =
                self.drive.step(self.now_ns, Shaft { seen_m: self.position_m, is_m: self.position_m });
            self.collect();
        }
    }

    fn collect(&mut self) {
        while let Some(frame) = self.drive.outgoing() {
            self.sent.push(frame);
        }
    }

    fn receive(&mut self, frame: Frame) {
        if frame.id() == CanId::from(Cob::Sync) {
            self.drive.take_sync(self.now_ns, &frame, self.position_m);
        } else {
            self.drive.receive(self.now_ns, &frame);
        }
        self.collect();
    }

    fn nmt(&mut self, command: NmtCommand) {
        self.receive(Nmt { command, target: NmtTarget::All }.frame());
    }

    /// Sends SYNC; returns the drive's answer.
    fn sync(&mut self) -> Vec<Frame> {
        let before = self.sent.len();
        self.receive(sync::frame());
        self.sent[before..].to_vec()
    }

    fn master_beats(&mut self) {
        self.receive(Heartbeat { state: NmtState::Operational }.frame(id(127)));
    }

    /// What the SDO server answers.
    fn ask(&mut self, request: SdoRequest) -> Option<SdoResponse> {
        let before = self.sent.len();
        self.receive(request.frame(id(4)));
        let answers = self.sent[before..].iter().filter(|frame| frame.id() == Cob::SdoResponse(id(4)).into());
        answers.map(|frame| SdoResponse::decode(frame.data()).unwrap()).next()
    }

    fn write(&mut self, (index, subindex): (u16, u8), data: &[u8]) -> Result<(), AbortCode> {
        let object = ObjectAddress::new(index, subindex);
        match self.ask(SdoRequest::Download { object, data: Expedited::new(data).unwrap() }) {
            Some(SdoResponse::Download { .. }) => Ok(()),
            Some(SdoResponse::Abort { code, .. }) => Err(code),
            other => panic!("{object}: {other:?}"),
        }
    }

    fn read(&mut self, (index, subindex): (u16, u8)) -> Result<u32, AbortCode> {
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

    fn control(&mut self, word: u16) {
        self.write(CONTROLWORD, &word.to_le_bytes()).unwrap();
    }

    fn statusword(&mut self) -> Statusword {
        Statusword(self.read(STATUSWORD).unwrap() as u16)
    }

    fn position(&mut self) -> i32 {
        self.read(POSITION).unwrap() as i32
    }

    /// Error register and error code (1001, 603F).
    fn errors(&mut self) -> (u32, u32) {
        (self.read((0x1001, 0)).unwrap(), self.read((0x603F, 0)).unwrap())
    }

    /// Emergency codes sent so far.
    fn emergencies(&self) -> Vec<EmergencyCode> {
        let frames = self.sent.iter().filter(|frame| frame.id() == Cob::Emergency(id(4)).into());
        frames.map(|frame| Emergency::decode(frame.data()).unwrap().code).collect()
    }

    /// States in the heartbeats and boot-up messages sent so far.
    fn heartbeats(&self) -> Vec<NmtState> {
        let frames = self.sent.iter().filter(|frame| frame.id() == Cob::Heartbeat(id(4)).into());
        frames.map(|frame| Heartbeat::decode(frame.data()).unwrap().state).collect()
    }
}

/// A process data object under any identifier.
fn pdo(number: u16, data: &[u8]) -> Frame {
    Frame::new(CanId::standard(number).unwrap(), data).unwrap()
}

/// CiA 301's procedure for changing a mapping; the PDO is `cob_id` afterwards.
fn remap(bench: &mut Bench, communication: u16, cob_id: u32, objects: &[u32]) {
    let mapping = communication + 0x200;
    bench.write((communication, 1), &(cob_id | 1 << 31).to_le_bytes()).unwrap();
    bench.write((mapping, 0), &[0]).unwrap();
    for (place, object) in (1..).zip(objects) {
        bench.write((mapping, place), &object.to_le_bytes()).unwrap();
    }
    bench.write((mapping, 0), &[objects.len() as u8]).unwrap();
    bench.write((communication, 1), &cob_id.to_le_bytes()).unwrap();
}

const PROFILE_POSITION: i8 = 1;
const HOMING: i8 = 6;
const CYCLIC_POSITION: i8 = 8;
const CYCLIC_TORQUE: i8 = 10;

/// RPDO1 as mapped after power-on.
fn command(word: u16, target: i32) -> Frame {
    let [w0, w1] = word.to_le_bytes();
    let [t0, t1, t2, t3] = target.to_le_bytes();
    pdo(0x204, &[w0, w1, t0, t1, t2, t3])
}

impl Bench {
    /// A cycle of a master: process data, SYNC, a millisecond.
    fn cycle(&mut self, word: u16, target: i32) {
        self.receive(command(word, target));
        self.sync();
        self.run_ms(1);
    }

    /// An enabled drive in cyclic synchronous position that moves at 0.1 m/s.
    fn cycling() -> (Self, i32) {
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
    fn set_point(&mut self, target: i32, bits: u16) {
        self.write(TARGET_POSITION, &target.to_le_bytes()).unwrap();
        self.control(0x0F);
        self.control(0x1F | bits);
    }

    fn has(&mut self, bit: StatusBit) -> bool {
        self.statusword().has(bit)
    }

    fn is_near(&mut self, target: i32) -> bool {
        (self.position() - target).abs() <= 10
    }
}

mod cyclic {
    //! What must not happen between the modes, their targets and SYNC: nothing of before moves an axis.

    use super::*;

    const TORQUE: (u16, u8) = (0x6071, 0);
    const TORQUE_ACTUAL: (u16, u8) = (0x6077, 0);
    const POSITION_DEMAND: (u16, u8) = (0x6062, 0);

    /// The motor carries 5 N of 500 N, or the brake does.
    #[test]
    fn an_enabled_axis_holds_its_position_or_waits_behind_its_brake_for_a_cyclic_target() {
        for (mode, permille) in
            [(PROFILE_POSITION, 10), (HOMING, 10), (CYCLIC_POSITION, 0), (CYCLIC_TORQUE, 0)]
        {
            let mut bench = Bench::enabled(mode);
            bench.run_ms(200);
            assert_eq!(bench.read(TORQUE_ACTUAL), Ok(permille), "mode {mode}");
            assert!((bench.position() - START).abs() < 100, "mode {mode}");
        }
    }

    #[test]
    fn a_torque_written_before_the_drive_is_enabled_is_none_of_the_enabled_one() {
        let mut bench = Bench::new();
        bench.write(MODE, &[CYCLIC_TORQUE as u8]).unwrap();
        bench.write(TORQUE, &100_i16.to_le_bytes()).unwrap();
        bench.sync();
        bench.enable();
        for _ in 0..20 {
            bench.sync();
            bench.run_ms(1);
        }
        assert_eq!(bench.read(TORQUE_ACTUAL), Ok(0));
        assert!((bench.position() - START).abs() < 100);
    }

    #[test]
    fn a_stop_forgets_the_set_points() {
        let mut bench = Bench::enabled(PROFILE_POSITION);
        bench.set_point(START + 20_000, 0);
        bench.set_point(START + 30_000, 0);
        bench.run_ms(100);
        bench.control(0x02);
        bench.run_ms(100);
        assert_eq!(bench.drive.axis.power, DriveState::SwitchOnDisabled);
        let stopped_at = bench.position();
        assert!((START + 1000..START + 19_000).contains(&stopped_at));
        bench.enable();
        bench.run_ms(500);
        assert!(bench.is_near(stopped_at), "{}", bench.position() - stopped_at);
        assert!(!bench.has(StatusBit::SETPOINT_ACKNOWLEDGED));
    }

    #[test]
    fn a_sync_within_the_period_does_not_hurry_the_demand() {
        let mut bench = Bench::operational();
        bench.write((0x60C2, 1), &[4]).unwrap();
        for word in [0x06, 0x07, 0x0F] {
            bench.cycle(word, START);
        }
        bench.run_ms(10);
        bench.cycle(0x0F, START + 400);
        for quarters in [1, 2, 3] {
            bench.sync();
            let demand = bench.read(POSITION_DEMAND).unwrap() as i32;
            assert!((demand - START - 100 * quarters).abs() <= 1, "{quarters}: {}", demand - START);
            bench.run_ms(1);
        }
    }

    #[test]
    fn sync_samples_the_position_at_its_own_time() {
        let mut bench = Bench::operational();
        bench.run_ms(1);
        bench.position_m += 40e-6;
        let expected = (bench.position_m * 1e6).round() as i32;
        let answer = bench.sync()[0];
        let sampled = i32::from_le_bytes(answer.data()[2..6].try_into().unwrap());
        assert_eq!(sampled, expected);
    }

    /// Object 6007 and the state at once, before any ramp has ended.
    #[test]
    fn an_aborted_connection_switches_off_or_begins_its_ramp_at_once() {
        let table = [
            (0_u16, DriveState::OperationEnabled),
            (1, DriveState::FaultReactionActive),
            (2, DriveState::SwitchOnDisabled),
            (3, DriveState::QuickStopActive),
        ];
        for (option, state) in table {
            let (mut bench, _) = Bench::cycling();
            bench.write((0x605E, 0), &2_u16.to_le_bytes()).unwrap();
            bench.write((0x6007, 0), &option.to_le_bytes()).unwrap();
            bench.nmt(NmtCommand::EnterPreOperational);
            assert_eq!(bench.drive.axis.power, state, "6007 = {option}");
        }
    }

    #[test]
    fn a_controlword_during_a_fault_reaction_clears_nothing() {
        let (mut bench, _) = Bench::cycling();
        bench.write((0x605E, 0), &2_u16.to_le_bytes()).unwrap();
        bench.write((0x6007, 0), &1_u16.to_le_bytes()).unwrap();
        bench.nmt(NmtCommand::EnterPreOperational);
        for word in [0x0F, 0x80, 0x00] {
            bench.control(word);
            assert_eq!(bench.drive.axis.power, DriveState::FaultReactionActive);
            assert_eq!(bench.errors(), (0x11, 0x8100));
        }
        assert_eq!(bench.emergencies(), [EmergencyCode::COMMUNICATION]);
    }
}

mod homing {
    //! CiA 402: homing, and the axis after homing has moved its origin.

    use super::*;

    #[test]
    fn homing_on_the_actual_position_only_renames_it() {
        for method in [35, 37] {
            let mut bench = Bench::enabled(HOMING);
            bench.write((0x6098, 0), &[method]).unwrap();
            bench.write((0x607C, 0), &1234_i32.to_le_bytes()).unwrap();
            let before_m = bench.position_m;
            bench.control(0x1F);
            assert!(bench.has(StatusBit::HOMING_ATTAINED) && bench.has(StatusBit::TargetReached));
            assert!(bench.is_near(-1234), "zero lies the offset beyond home");
            bench.run_ms(20);
            assert!((bench.position_m - before_m).abs() < 2e-5);
        }
    }

    #[test]
    fn homing_to_a_reference_mark_moves_there_and_puts_zero_the_offset_beyond() {
        for (method, mark) in [(33, 270_000), (34, 272_000)] {
            let mut bench = Bench::enabled(HOMING);
            bench.write((0x6098, 0), &[method]).unwrap();
            bench.write((0x607C, 0), &50_i32.to_le_bytes()).unwrap();
            bench.control(0x1F);
            bench.run_ms(50);
            assert!(!bench.has(StatusBit::HOMING_ATTAINED) && !bench.has(StatusBit::TargetReached));
            assert_eq!(bench.write((0x6098, 0), &[35]), Err(AbortCode::DEVICE_STATE));
            bench.run_ms(500);
            assert!(bench.has(StatusBit::HOMING_ATTAINED) && bench.has(StatusBit::TargetReached));
            let counts = (bench.position_m / 1e-6).round() as i32;
            assert!((bench.position() - (counts - mark - 50)).abs() <= 1, "method {method}");
            assert!((counts - mark).abs() < 50, "it stopped soon behind the mark");
        }
    }

    #[test]
    fn software_limits_count_from_the_home_position() {
        let mut bench = Bench::enabled(HOMING);
        bench.write((0x607C, 0), &1000_i32.to_le_bytes()).unwrap();
        bench.write((0x607D, 1), &(-6000_i32).to_le_bytes()).unwrap();
        bench.write((0x607D, 2), &6000_i32.to_le_bytes()).unwrap();
        bench.control(0x1F);
        let home_m = bench.position_m;
        bench.control(0x00);
        bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
        bench.enable();
        bench.set_point(100_000, 0);
        bench.run_ms(1000);
        assert!(bench.is_near(5000));
        assert!((bench.position_m - home_m - 6000.0 * 1e-6).abs() < 2e-5);
    }

    #[test]
    fn a_home_that_was_attained_stays_so_until_a_restart_or_another_homing() {
        let mut bench = Bench::enabled(HOMING);
        bench.control(0x1F);
        bench.control(0x00);
        bench.write(MODE, &[CYCLIC_POSITION as u8]).unwrap();
        bench.write(MODE, &[HOMING as u8]).unwrap();
        assert!(bench.has(StatusBit::HOMING_ATTAINED) && bench.has(StatusBit::TargetReached));
        bench.write((0x6098, 0), &[34]).unwrap();
        bench.enable();
        bench.control(0x1F);
        assert!(!bench.has(StatusBit::HOMING_ATTAINED), "searching anew");

        let mut bench = Bench::enabled(HOMING);
        bench.control(0x1F);
        bench.nmt(NmtCommand::ResetNode);
        bench.run_ms(25);
        bench.write(MODE, &[HOMING as u8]).unwrap();
        assert!(!bench.has(StatusBit::HOMING_ATTAINED));
    }

    #[test]
    fn homing_fails_without_a_mark_before_the_limit_and_ends_on_command() {
        let mut bench = Bench::enabled(HOMING);
        bench.write((0x6098, 0), &[34]).unwrap();
        bench.write((0x607D, 2), &(START + 500).to_le_bytes()).unwrap();
        bench.control(0x1F);
        bench.run_ms(500);
        assert!(bench.has(StatusBit::HOMING_ERROR) && !bench.has(StatusBit::HOMING_ATTAINED));
        let mut bench = Bench::enabled(HOMING);
        bench.write((0x6098, 0), &[34]).unwrap();
        bench.control(0x1F);
        bench.run_ms(50);
        bench.control(0x0F);
        bench.run_ms(500);
        assert!(!bench.has(StatusBit::HOMING_ERROR) && !bench.has(StatusBit::HOMING_ATTAINED));
        assert!(bench.has(StatusBit::TargetReached), "interrupted");
    }

    impl Bench {
        /// Enabled in homing where its position is called 0, far below the software limits.
        fn homed_below_its_limits() -> Self {
            let mut bench = Self::enabled(HOMING);
            bench.write((0x6098, 0), &[37]).unwrap();
            bench.control(0x1F);
            assert!(bench.has(StatusBit::HOMING_ATTAINED) && bench.is_near(0));
            bench.control(0x0F);
            bench
        }
    }

    #[test]
    fn homing_leaves_the_numbers_of_the_software_limits_which_count_from_home() {
        let mut bench = Bench::homed_below_its_limits();
        assert_eq!([1, 2].map(|end| bench.read((0x607D, end)).unwrap() as i32), LIMITS);
    }

    #[test]
    fn an_axis_outside_its_software_limits_stays_on_command() {
        let mut bench = Bench::homed_below_its_limits();
        bench.write(MODE, &[CYCLIC_POSITION as u8]).unwrap();
        bench.nmt(NmtCommand::Start);
        (0..100).for_each(|_| bench.cycle(0x0F, 0));
        assert!(bench.is_near(0), "{}", bench.position());
    }

    #[test]
    fn an_axis_outside_its_software_limits_may_come_nearer_but_not_go_further() {
        let mut bench = Bench::homed_below_its_limits();
        bench.write(MODE, &[PROFILE_POSITION as u8]).unwrap();
        bench.set_point(-5000, 0);
        bench.run_ms(300);
        assert!(bench.is_near(0) && bench.has(StatusBit::InternalLimit));
        bench.set_point(5000, 0);
        bench.run_ms(300);
        assert!(bench.is_near(5000) && !bench.has(StatusBit::InternalLimit));
        bench.set_point(4000, 0);
        bench.run_ms(300);
        assert!(bench.is_near(5000));
    }

    #[test]
    fn a_search_never_goes_against_its_direction() {
        let mut bench = Bench::homed_below_its_limits();
        bench.write((0x6098, 0), &[33]).unwrap();
        bench.control(0x1F);
        bench.run_ms(100);
        assert!(bench.has(StatusBit::HOMING_ERROR) && bench.is_near(0));
    }

    /// Fast, so that the axis takes 40 ms to stop behind the mark. The controlword may come again meanwhile.
    #[test]
    fn a_home_is_attained_once_the_axis_stands_and_stays_so() {
        let mut bench = Bench::enabled(HOMING);
        bench.write((0x6098, 0), &[34]).unwrap();
        bench.write((0x6099, 2), &100_000_u32.to_le_bytes()).unwrap();
        bench.control(0x1F);
        let attained = (1..1000).find(|_| {
            bench.control(0x1F);
            bench.run_ms(1);
            bench.has(StatusBit::HOMING_ATTAINED)
        });
        assert!(attained.is_some() && bench.velocity_m_s.abs() < 5e-3, "{} m/s", bench.velocity_m_s);
        bench.control(0x0F);
        assert!(bench.has(StatusBit::HOMING_ATTAINED));
    }

    #[test]
    fn homing_that_was_interrupted_reaches_its_target_only_at_rest() {
        let mut bench = Bench::enabled(HOMING);
        bench.write((0x6098, 0), &[34]).unwrap();
        bench.write((0x6099, 2), &50_000_u32.to_le_bytes()).unwrap();
        bench.control(0x1F);
        bench.run_ms(15);
        for word in [0x0F, 0x10F] {
            bench.control(word);
            assert!(!bench.has(StatusBit::TargetReached), "it slows down");
        }
        bench.run_ms(100);
        assert!(bench.has(StatusBit::TargetReached) && !bench.has(StatusBit::HOMING_ATTAINED));
    }

    /// Bit 8 (halt) beside bit 4.
    #[test]
    fn homing_does_not_start_while_it_is_halted_and_ends_at_a_halt() {
        let mut bench = Bench::enabled(HOMING);
        bench.write((0x6098, 0), &[34]).unwrap();
        bench.run_ms(20);
        let start = bench.position();
        bench.control(0x11F);
        bench.run_ms(100);
        assert!(bench.is_near(start), "{}", bench.position() - start);
        bench.control(0x1F);
        bench.run_ms(100);
        assert!(bench.position() > start + 100);
        bench.control(0x11F);
        bench.run_ms(20);
        let halted = bench.position();
        bench.run_ms(400);
        assert!(bench.is_near(halted), "{}", bench.position() - halted);
        assert!(!bench.has(StatusBit::HOMING_ATTAINED) && bench.has(StatusBit::TargetReached));
    }
}
