//! One drive as the master sees it: its boot, its presence, and its process data.
//!
//! A [`RemoteDrive`] sends nothing; it returns frames and judgements.

use masseter_can::canopen::{NmtCommand, NmtState, NodeId, SdoResponse};
use masseter_can::cia402::{Controlword, DriveRequest, DriveState, next_controlword};
use masseter_can::{Frame, Rpdo1, Tpdo1};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::{DriveConfig, Scenario};
use masseter_shared::messages::codes::{BootPhase, Cause};

use super::boot::{Boot, late};
use super::incoming::Kind;
use super::interlock::Failure;
use super::presence::Presence;

/// A judgement that needs a reaction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Finding {
    /// The drive never came.
    Absent(Failure),
    /// The drive was lost, with the value and the limit that explain it.
    Lost(Failure),
}

/// One drive.
#[derive(Debug, Clone)]
pub(super) struct RemoteDrive {
    pub(super) id: NodeId,
    pub(super) bus: usize,
    config: DriveConfig,
    heartbeat_timeout_ns: u64,
    boot_timeout_ns: u64,
    boot: Boot,
    /// The phase of the boot that was reported last.
    reported_phase: BootPhase,
    presence: Presence,
    nmt: Option<NmtState>,
    /// Whether it was started as a verified drive: only then its process data are used.
    is_started: bool,
    /// Whether its absence was reported, or it was lost.
    is_absence_known: bool,
    has_wrong_length: [bool; Kind::COUNT],
    power: Option<DriveState>,
    actual_increments: i32,
    torque_permille: i16,
    controlword: Controlword,
}

impl RemoteDrive {
    /// The drive of an axis, of which nothing is known at `now_ns`.
    pub(super) fn new(scenario: &Scenario, axis: usize, id: NodeId, bus: usize, now_ns: u64) -> Self {
        let (can, config) = (&scenario.can, scenario.drives.of_axis(axis));
        let boot = Boot::new(id, scenario, axis, now_ns);
        Self {
            id,
            bus,
            config,
            heartbeat_timeout_ns: u64::from(can.heartbeat_consumer_ms) * MILLISECOND_NS,
            boot_timeout_ns: u64::from(can.boot_timeout_ms) * MILLISECOND_NS,
            reported_phase: boot.phase(),
            boot,
            presence: Presence::new(now_ns),
            nmt: None,
            is_started: false,
            is_absence_known: false,
            has_wrong_length: [false; Kind::COUNT],
            power: None,
            actual_increments: 0,
            torque_permille: 0,
            controlword: Controlword::DISABLE_VOLTAGE,
        }
    }

    /// Phase of its boot.
    pub(super) fn boot_phase(&self) -> BootPhase {
        self.boot.phase()
    }

    /// The reported phase of its boot and the present one, once after a change.
    pub(super) fn phase_change(&mut self) -> Option<[BootPhase; 2]> {
        let now = self.boot.phase();
        let before = std::mem::replace(&mut self.reported_phase, now);
        (before != now).then_some([before, now])
    }

    /// Whether its identity and configuration are verified.
    pub(super) fn is_verified(&self) -> bool {
        self.boot.is_verified()
    }

    /// Whether it was told to exchange process data.
    pub(super) fn is_started(&self) -> bool {
        self.is_started
    }

    /// Whether it exchanges process data.
    pub(super) fn is_operational(&self) -> bool {
        self.is_started && self.nmt == Some(NmtState::Operational)
    }

    /// Whether it is verified and exchanges process data.
    pub(super) fn is_ready(&self) -> bool {
        self.is_operational() && self.boot.phase() == BootPhase::Ready
    }

    /// Whether its newest process data came after that time.
    pub(super) fn has_answered_since(&self, time_ns: u64) -> bool {
        self.presence.has_answered_since(time_ns)
    }

    /// State of its power stage, as far as it is known.
    pub(super) fn drive_state(&self) -> Option<DriveState> {
        self.power.filter(|_| self.is_operational())
    }

    /// Position actual value, m.
    pub(super) fn position_m(&self) -> f64 {
        f64::from(self.actual_increments) * self.config.encoder_resolution_m
    }

    /// Force actual value, N.
    pub(super) fn force_n(&self) -> f64 {
        f64::from(self.torque_permille) / 1000.0 * self.config.rated_force_n
    }

    /// Whether 607Ah can hold a target; NaN has no increments.
    pub(super) fn can_go_to(&self, target_m: f64) -> bool {
        (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&self.increments(target_m))
    }

    fn increments(&self, position_m: f64) -> f64 {
        (position_m / self.config.encoder_resolution_m).round()
    }

    /// SYNC demands new process data.
    pub(super) fn begin_cycle(&mut self) {
        self.presence.begin_cycle();
    }

    /// Takes a heartbeat; `may_boot` says whether drives may be booted now.
    pub(super) fn take_heartbeat(
        &mut self,
        time_ns: u64,
        state: NmtState,
        may_boot: bool,
    ) -> Result<(), Failure> {
        self.hear_state(time_ns, state);
        if may_boot {
            return self.boot.hear(time_ns, state);
        }
        if state == NmtState::BootUp {
            // Its configuration is lost. The drive is reset once more when the stop is over.
            self.boot.forget(time_ns);
        }
        Ok(())
    }

    /// A started drive has restarted by itself.
    pub(super) fn take_restart(&mut self, time_ns: u64) {
        self.hear_state(time_ns, NmtState::BootUp);
        self.stop_exchange();
        self.forget(time_ns);
    }

    /// Takes process data, which only an operational drive sends; a statusword without a meaning keeps the last state.
    /// Returns its state before and after; none while its process data are not used.
    pub(super) fn take_process_data(&mut self, time_ns: u64, tpdo: Tpdo1) -> Option<[Option<DriveState>; 2]> {
        self.hear_state(time_ns, NmtState::Operational);
        self.presence.end_missing();
        if !self.is_started {
            return None;
        }
        let before = self.drive_state();
        if let Ok(state) = tpdo.statusword.state() {
            self.power = Some(state);
        }
        let data = (tpdo.actual_increments, tpdo.torque_permille);
        self.presence.answer(time_ns, data != (self.actual_increments, self.torque_permille));
        (self.actual_increments, self.torque_permille) = data;
        Some([before, self.drive_state()])
    }

    /// Takes an answer of its SDO server.
    pub(super) fn take_sdo_answer(&mut self, time_ns: u64, answer: SdoResponse) -> Result<(), Failure> {
        self.presence.hear(time_ns);
        self.boot.take(time_ns, answer)
    }

    /// Whether this is its first object of that kind with a wrong length.
    pub(super) fn is_first_wrong_length(&mut self, kind: Kind) -> bool {
        !std::mem::replace(&mut self.has_wrong_length[kind as usize], true)
    }

    /// Judges a cycle of the drive; `is_fresh` says whether it has answered SYNC. A verified drive must be received, and an
    /// operational one must answer every SYNC once.
    pub(super) fn judge(&mut self, now_ns: u64, is_fresh: bool) -> Option<Finding> {
        match self.boot.phase() {
            BootPhase::Waiting => {
                let (waited_ns, limit_ns) = (self.boot.waited_ns(now_ns), self.boot_timeout_ns);
                let is_new = waited_ns > limit_ns && !std::mem::replace(&mut self.is_absence_known, true);
                is_new.then(|| Finding::Absent(late(waited_ns, limit_ns)))
            }
            BootPhase::Configured | BootPhase::Ready => {
                if !is_fresh && self.is_operational() {
                    self.presence.miss_cycle();
                }
                let loss = self.presence.judge(now_ns, self.heartbeat_timeout_ns);
                loss.or_else(|| self.stop_by_itself()).map(Finding::Lost)
            }
            _ => None,
        }
    }

    /// The loss of a started drive that left operational by itself.
    fn stop_by_itself(&self) -> Option<Failure> {
        let state = self.nmt.filter(|&state| self.is_started && state != NmtState::Operational)?;
        let states = [state, NmtState::Operational].map(|state| f64::from(state.code()));
        Some(Failure::with(Cause::NodeStopped, states))
    }

    /// Discards everything found out about the drive; it has to boot again.
    pub(super) fn forget(&mut self, now_ns: u64) {
        self.boot.forget(now_ns);
        self.presence.restart();
        (self.is_absence_known, self.power) = (true, None);
    }

    /// Discards process data until the drive is started anew.
    fn stop_exchange(&mut self) {
        self.presence.forget_answer();
        (self.is_started, self.power) = (false, None);
        self.controlword = Controlword::DISABLE_VOLTAGE;
    }

    /// Continues its boot after some time.
    pub(super) fn advance_boot(&mut self, now_ns: u64) -> Result<(), Failure> {
        self.boot.expire(now_ns)
    }

    /// Completes its boot, if it was started and has become operational.
    pub(super) fn complete_boot(&mut self) {
        if self.boot.phase() == BootPhase::Starting && self.is_operational() {
            self.boot.complete();
        }
    }

    /// Gives it up until it boots again.
    pub(super) fn give_up(&mut self) {
        self.boot.give_up();
    }

    /// The command of network management that its boot needs, if any.
    pub(super) fn boot_command(&mut self, now_ns: u64) -> Option<NmtCommand> {
        let command = self.boot.command(now_ns)?;
        self.stop_exchange();
        Some(command)
    }

    /// The SDO request that its boot needs, if any.
    pub(super) fn sdo_request(&mut self, now_ns: u64) -> Option<Frame> {
        let request = self.boot.request(now_ns)?;
        Some(request.frame(self.id))
    }

    /// The drive is told to become operational.
    pub(super) fn start(&mut self, now_ns: u64) {
        self.boot.start(now_ns);
        self.presence.end_missing();
        self.is_started = true;
    }

    /// The process data for a request and a target, if the drive exchanges any. Until the drive follows targets, its
    /// target is its position, so that nothing jumps when it begins to (607Ah := 6064h).
    pub(super) fn process_data(&mut self, request: DriveRequest, target_m: f64) -> Option<Frame> {
        if !self.is_operational() {
            return None;
        }
        let state = self.power.unwrap_or(DriveState::NotReadyToSwitchOn);
        self.controlword = next_controlword(state, request, self.controlword);
        let follows = state == DriveState::OperationEnabled && request == DriveRequest::Enable;
        let target_increments =
            if follows { self.increments(target_m) as i32 } else { self.actual_increments };
        Some(Rpdo1 { controlword: self.controlword, target_increments }.frame(self.id))
    }

    fn hear_state(&mut self, time_ns: u64, state: NmtState) {
        self.presence.hear(time_ns);
        self.nmt = Some(state);
    }
}
