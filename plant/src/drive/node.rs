//! The drive as a CANopen node: NMT, heartbeats, SYNC-driven process data, CiA 402.
//!
//! Objects whose values are fixed here: 6060 = 8 (cyclic synchronous position), 605A = 2 (quick-stop
//! ramp, then switch on disabled), 605E = 2 (the same ramp on a fault), 6007 = 3 (quick stop on loss of the link), 1029:1 = 0 (then
//! pre-operational). There is no SDO server: everything is set at construction.

use masseter_shared::can::canopen::{
    Cob, Emergency, EmergencyCode, Heartbeat, Nmt, NmtCommand, NmtState, NodeId,
};
use masseter_shared::can::cia402::{Command, Controlword, DriveState, StatusBit, Statusword};
use masseter_shared::can::{Frame, Rpdo1, Tpdo1};
use masseter_shared::config::DriveConfig;

use super::demand::Demand;
use super::servo::Servo;
use crate::encoder::Encoder;

const MS_NS: u64 = 1_000_000;
/// From power-on to the boot-up message, ns.
const BOOT_NS: u64 = 20 * MS_NS;
/// Frames a node may have to send at one instant: boot-up or heartbeat, process data, emergencies.
const OUTBOX: usize = 4;
/// Error register 1001: generic error.
const GENERIC_ERROR: u8 = 0x01;

/// What a node is configured with.
#[derive(Debug, Clone)]
pub(crate) struct DriveSettings {
    /// Its node id.
    pub(crate) node: NodeId,
    /// The master, whose heartbeat it watches (object 1016).
    pub(crate) master: NodeId,
    /// The drive.
    pub(crate) drive: DriveConfig,
    /// Interval of its heartbeat (object 1017), ns.
    pub(crate) heartbeat_ns: u64,
    /// Silence of the master that counts as loss of the link (object 1016), ns.
    pub(crate) link_timeout_ns: u64,
    /// Communication cycle (object 60C2), s.
    pub(crate) period_s: f64,
    /// Step of the servo loops, s.
    pub(crate) step_s: f64,
    /// Software position limit (object 607D): lowest and highest target, increments.
    pub(crate) position_limit_increments: [i32; 2],
}

/// One drive.
#[derive(Debug, Clone)]
pub(crate) struct DriveNode {
    settings: DriveSettings,
    encoder: Encoder,
    servo: Servo,
    demand: Demand,
    force_n: f64,
    nmt: Option<NmtState>,
    power: DriveState,
    controlword: Controlword,
    buffered: Option<Rpdo1>,
    is_cut: bool,
    boot_at_ns: u64,
    next_heartbeat_ns: u64,
    master_heard_ns: Option<u64>,
    straying_since_ns: Option<u64>,
    outbox: [Option<Frame>; OUTBOX],
}

impl DriveNode {
    /// A drive that is switched on at `now_ns` where its axis stands.
    pub(crate) fn new(settings: DriveSettings, encoder: Encoder, now_ns: u64, position_m: f64) -> Self {
        let drive = &settings.drive;
        let boot_at_ns = now_ns + BOOT_NS;
        // Staggered, so that the nodes' heartbeats do not meet.
        let stagger_ns = settings.heartbeat_ns / 8 * u64::from(settings.node.get() % 8);
        Self {
            servo: Servo::new(*drive, settings.step_s, position_m),
            demand: Demand::new(settings.period_s, drive.quick_stop_deceleration_m_s2),
            encoder,
            force_n: 0.0,
            nmt: None,
            power: DriveState::NotReadyToSwitchOn,
            controlword: Controlword::DISABLE_VOLTAGE,
            buffered: None,
            is_cut: false,
            boot_at_ns,
            next_heartbeat_ns: boot_at_ns + stagger_ns,
            master_heard_ns: None,
            straying_since_ns: None,
            outbox: [None; OUTBOX],
            settings,
        }
    }

    /// State of the drive's power.
    #[cfg(test)]
    pub(crate) fn power(&self) -> DriveState {
        self.power
    }

    /// The next frame it wants to send.
    pub(crate) fn outgoing(&mut self) -> Option<Frame> {
        self.outbox.iter_mut().find_map(Option::take)
    }

    fn send(&mut self, frame: Frame) {
        if let Some(place) = self.outbox.iter_mut().find(|place| place.is_none()) {
            *place = Some(frame);
        }
    }

    /// Takes a frame that arrived at `now_ns` while its axis stood at `position_m`. What is not meant
    /// for it, or malformed, has no effect; a process datum of wrong length is reported by EMCY 8210.
    pub(crate) fn receive(&mut self, now_ns: u64, frame: &Frame, position_m: f64) {
        match Cob::try_from(frame.id()) {
            Ok(Cob::Nmt) => {
                if let Ok(nmt) = Nmt::decode(frame.data())
                    && nmt.target.includes(self.settings.node)
                {
                    self.command_nmt(nmt.command, now_ns);
                }
            }
            Ok(Cob::Sync) => self.synchronise(now_ns, position_m),
            Ok(Cob::Rpdo1(node)) if node == self.settings.node => self.buffer(frame),
            Ok(Cob::Heartbeat(node)) if node == self.settings.master => self.master_heard_ns = Some(now_ns),
            _ => {}
        }
    }

    fn command_nmt(&mut self, command: NmtCommand, now_ns: u64) {
        if self.nmt.is_none() {
            return;
        }
        match command {
            NmtCommand::Start => self.nmt = Some(NmtState::Operational),
            NmtCommand::Stop => self.leave_operational(NmtState::Stopped, now_ns),
            NmtCommand::EnterPreOperational => self.leave_operational(NmtState::PreOperational, now_ns),
            NmtCommand::ResetNode | NmtCommand::ResetCommunication => {
                self.leave_operational(NmtState::PreOperational, now_ns);
                (self.nmt, self.boot_at_ns) = (None, now_ns + BOOT_NS);
            }
        }
    }

    /// Without process data nobody guides the drive: it brakes.
    fn leave_operational(&mut self, state: NmtState, now_ns: u64) {
        self.nmt = Some(state);
        self.buffered = None;
        self.command_power(Command::QuickStop, now_ns);
    }

    /// A synchronous RPDO waits for the next SYNC.
    fn buffer(&mut self, frame: &Frame) {
        if self.nmt != Some(NmtState::Operational) {
            return;
        }
        match Rpdo1::decode(frame.data()) {
            Ok(rpdo) => self.buffered = Some(rpdo),
            Err(_) => self.report(EmergencyCode::PDO_LENGTH),
        }
    }

    /// SYNC: buffered process data take effect, actual values are sampled and sent.
    fn synchronise(&mut self, now_ns: u64, position_m: f64) {
        if self.nmt != Some(NmtState::Operational) {
            return;
        }
        if let Some(rpdo) = self.buffered.take() {
            let command = rpdo.controlword.command(self.controlword);
            self.controlword = rpdo.controlword;
            self.command_power(command, now_ns);
            if self.power == DriveState::OperationEnabled {
                self.head_for(now_ns, rpdo.target_increments);
            }
        }
        let tpdo = Tpdo1 {
            statusword: self.statusword(),
            actual_increments: self.encoder.read(position_m),
            torque_permille: (self.force_n / self.settings.drive.rated_force_n * 1000.0).round() as i16,
        };
        self.send(tpdo.frame(self.settings.node));
    }

    /// Follows a target within the software position limit and the velocity limit.
    fn head_for(&mut self, now_ns: u64, target_increments: i32) {
        let [lowest, highest] = self.settings.position_limit_increments;
        let within = target_increments.clamp(lowest, highest);
        let target_m = self.encoder.metres(within);
        let limit_m_s = self.settings.drive.max_velocity_m_s;
        let is_too_fast = self.demand.head_for(now_ns, target_m, self.servo.position_m(), limit_m_s);
        self.is_cut = is_too_fast || within != target_increments;
    }

    fn statusword(&self) -> Statusword {
        let is_enabled = self.power == DriveState::OperationEnabled;
        Statusword::of(self.power)
            .with(StatusBit::VoltageEnabled, true)
            .with(StatusBit::Remote, true)
            .with(StatusBit::TargetFollowed, is_enabled)
            .with(StatusBit::InternalLimit, is_enabled && (self.is_cut || self.servo.is_limited()))
            .with(StatusBit::FollowingError, self.straying_since_ns.is_some())
    }

    fn command_power(&mut self, command: Command, now_ns: u64) {
        let before = self.power;
        self.enter(before.after(command), now_ns);
        if before == DriveState::Fault && self.power != before {
            self.send(Emergency::RESET.frame(self.settings.node));
        }
    }

    fn enter(&mut self, state: DriveState, now_ns: u64) {
        if state == self.power {
            return;
        }
        self.power = state;
        self.straying_since_ns = None;
        match state {
            DriveState::OperationEnabled => {}
            DriveState::QuickStopActive | DriveState::FaultReactionActive => {
                self.demand.slow_down(now_ns, self.servo.velocity_m_s());
            }
            _ => self.demand.release(),
        }
    }

    /// A step of the servo loops with the axis at `position_m`: the force until the next one, N.
    pub(crate) fn step(&mut self, now_ns: u64, position_m: f64) -> f64 {
        self.boot(now_ns);
        self.produce_heartbeat(now_ns);
        self.watch_link(now_ns);
        self.complete(now_ns);
        let measured_m = {
            let increments = self.encoder.read(position_m);
            self.encoder.metres(increments)
        };
        self.force_n = self.servo.step(measured_m, self.demand.task(now_ns));
        self.watch_following(now_ns);
        self.force_n
    }

    fn boot(&mut self, now_ns: u64) {
        if self.nmt.is_none() && now_ns >= self.boot_at_ns {
            self.nmt = Some(NmtState::PreOperational);
            self.send(Heartbeat { state: NmtState::BootUp }.frame(self.settings.node));
        }
    }

    fn produce_heartbeat(&mut self, now_ns: u64) {
        if let Some(state) = self.nmt
            && now_ns >= self.next_heartbeat_ns
        {
            self.next_heartbeat_ns += self.settings.heartbeat_ns;
            self.send(Heartbeat { state }.frame(self.settings.node));
        }
    }

    /// Supervision begins with the master's first heartbeat; its loss quick-stops the drive.
    fn watch_link(&mut self, now_ns: u64) {
        let Some(heard_ns) = self.master_heard_ns else { return };
        if now_ns.saturating_sub(heard_ns) > self.settings.link_timeout_ns {
            self.master_heard_ns = None;
            self.report(EmergencyCode::HEARTBEAT);
            self.leave_operational(NmtState::PreOperational, now_ns);
        }
    }

    /// The drive's own transitions: initialised, quick stop ended, fault reaction ended.
    fn complete(&mut self, now_ns: u64) {
        let ramps = matches!(self.power, DriveState::QuickStopActive | DriveState::FaultReactionActive);
        if !ramps || self.demand.is_at_rest(now_ns) {
            self.enter(self.power.after_completion(), now_ns);
        }
    }

    /// Following error beyond its window (6065) for longer than its time-out (6066): fault.
    fn watch_following(&mut self, now_ns: u64) {
        let drive = &self.settings.drive;
        let error_m =
            self.demand.position_m(now_ns).map_or(0.0, |demand_m| demand_m - self.servo.position_m());
        if error_m.abs() <= drive.following_error_m {
            self.straying_since_ns = None;
            return;
        }
        let since_ns = *self.straying_since_ns.get_or_insert(now_ns);
        if now_ns - since_ns > u64::from(drive.following_error_timeout_ms) * MS_NS {
            self.report(EmergencyCode::FOLLOWING_ERROR);
            self.enter(self.power.after_fault(), now_ns);
        }
    }

    fn report(&mut self, code: EmergencyCode) {
        let emergency = Emergency { code, register: GENERIC_ERROR, vendor: [0; 5] };
        self.send(emergency.frame(self.settings.node));
    }
}
