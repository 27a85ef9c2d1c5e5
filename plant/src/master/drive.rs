//! One drive for the master: its boot and its process data.
//!
//! A [`RemoteDrive`] sends nothing; it returns frames and judgements. [`Message`] decodes frames; the master decides the
//! effect of a message.

use masseter_can::canopen::{
    Cob, Emergency, EmergencyCode, Heartbeat, HeartbeatError, LengthError, Nmt, NmtCommand, NmtState,
    NmtTarget, SdoError, SdoResponse,
};
use masseter_can::cia402::{Controlword, DriveRequest, DriveState, Statusword, next_controlword};
use masseter_can::{CanId, Frame, PdoMapping, Rpdo1, Tpdo1};
use masseter_runtime::messages::codes::{BootPhase, Cause, drive_state_code};
use masseter_runtime::{clock::MILLISECOND_NS, messages::Reading};
use masseter_scenario::{AxisScale, Scenario};

use super::boot::{Boot, late};
use super::presence::{MISSING_CYCLES, Presence};
use super::{events::Failure, following::Following, gate::Target, link::Address, wanted::WantedDrive};
use crate::error::PlantError;

/// One drive.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct RemoteDrive {
    pub(super) address: Address,
    scale: AxisScale,
    rpdo1: PdoMapping,
    pub(super) tpdo1: PdoMapping,
    heartbeat_timeout_ns: u64,
    boot_timeout_ns: u64,
    pub(super) boot: Boot,
    /// The last reported phase of the boot.
    reported_phase: BootPhase,
    pub(super) presence: Presence,
    following: Following,
    nmt: Option<NmtState>,
    /// Whether the drive has been started after its verification: only then its process data count.
    pub(super) is_started: bool,
    /// Whether its absence was reported, or it was lost.
    is_absence_known: bool,
    /// The function codes of its objects that had a wrong length, bit i for function code i.
    wrong_lengths: u16,
    power: Option<DriveState>,
    pub(super) statusword: Statusword,
    /// The report of its last emergency message.
    pub(super) emergency: EmergencyCode,
    actual_increments: i32,
    torque_permille: i16,
    controlword: Controlword,
}

impl RemoteDrive {
    /// The drive of an axis, unknown at `now_ns`.
    ///
    /// # Errors
    /// [`PlantError::Scenario`] for values that its profile does not allow.
    pub(super) fn new(
        scenario: &Scenario,
        axis: usize,
        address: Address,
        following: Following,
        now_ns: u64,
    ) -> Result<Self, PlantError> {
        let (can, pdos) = (&scenario.can, &scenario.profile(axis).pdos);
        let boot = Boot::new(&WantedDrive::of_axis(scenario, axis, address.node)?, can.reset_faults, now_ns);
        Ok(Self {
            address,
            scale: scenario.scale(axis),
            rpdo1: pdos.rpdo1(),
            tpdo1: pdos.tpdo1(),
            heartbeat_timeout_ns: u64::from(can.heartbeat_consumer_ms) * MILLISECOND_NS,
            boot_timeout_ns: u64::from(can.boot_timeout_ms) * MILLISECOND_NS,
            reported_phase: boot.phase,
            boot,
            presence: Presence::new(now_ns),
            following,
            nmt: None,
            is_started: false,
            is_absence_known: false,
            wrong_lengths: 0,
            power: None,
            statusword: Statusword(0),
            emergency: EmergencyCode::RESET,
            actual_increments: 0,
            torque_permille: 0,
            controlword: Controlword::DISABLE_VOLTAGE,
        })
    }

    /// The reported phase of its boot and the present one, once after a change.
    pub(super) fn phase_change(&mut self) -> Option<Change<BootPhase>> {
        let after = self.boot.phase;
        let before = std::mem::replace(&mut self.reported_phase, after);
        (before != after).then_some(Change { before, after })
    }

    /// Whether it exchanges process data.
    pub(super) fn is_operational(&self) -> bool {
        self.is_started && self.nmt == Some(NmtState::Operational)
    }

    /// Whether it is verified and exchanges process data.
    pub(super) fn is_ready(&self) -> bool {
        self.is_operational() && self.boot.phase == BootPhase::Ready
    }

    /// State of its power stage, if known.
    pub(super) fn drive_state(&self) -> Option<DriveState> {
        self.power.filter(|_| self.is_operational())
    }

    /// Writes its actual values and its state.
    pub(super) fn fill_reading(&self, axis: usize, reading: &mut Reading) {
        reading.position_m[axis] = self.position_m();
        reading.force_n[axis] = f64::from(self.torque_permille) * self.scale.permille_n;
        reading.drive_state[axis] = drive_state_code(self.drive_state());
    }

    fn position_m(&self) -> f64 {
        self.scale.metres(self.actual_increments)
    }

    /// Its position, if it follows targets.
    pub(super) fn following_m(&self) -> Option<f64> {
        let is_enabled = self.drive_state() == Some(DriveState::OperationEnabled);
        is_enabled.then(|| self.position_m())
    }

    /// SYNC goes out: the drive takes its target and answers with new process data.
    pub(super) fn begin_cycle(&mut self, now_ns: u64) {
        self.presence.begin_cycle();
        self.following.synchronise(now_ns);
    }

    /// Takes a heartbeat, given whether drives may be booted now.
    pub(super) fn take_heartbeat(
        &mut self,
        time_ns: u64,
        state: NmtState,
        may_boot: bool,
    ) -> Result<(), Failure> {
        self.hear_state(time_ns, state);
        if state == NmtState::BootUp && self.is_started {
            self.stop_exchange();
            self.forget(time_ns);
        } else if may_boot {
            return self.boot.hear(time_ns, state);
        } else if state == NmtState::BootUp {
            // The configuration of the drive is lost. Another reset follows after the stop.
            self.boot.forget(time_ns);
        }
        Ok(())
    }

    /// Takes process data, which only an operational drive sends. A statusword without a meaning keeps the last state.
    /// Returns the state before and after; none while process data do not count.
    pub(super) fn take_process_data(
        &mut self,
        time_ns: u64,
        tpdo: Tpdo1,
    ) -> Option<Change<Option<DriveState>>> {
        self.hear_state(time_ns, NmtState::Operational);
        self.presence.missing_cycles = 0;
        if !self.is_started {
            return None;
        }
        let before = self.drive_state();
        self.statusword = tpdo.statusword;
        if let Ok(state) = tpdo.statusword.state() {
            self.power = Some(state);
        }
        let data = (tpdo.actual_increments, tpdo.torque_permille);
        self.presence.answer(time_ns, data != (self.actual_increments, self.torque_permille));
        (self.actual_increments, self.torque_permille) = data;
        Some(Change { before, after: self.drive_state() })
    }

    /// Takes an answer of its SDO server.
    pub(super) fn take_sdo_answer(&mut self, time_ns: u64, answer: SdoResponse) -> Result<(), Failure> {
        self.presence.heard_ns = time_ns;
        self.boot.take_answer(time_ns, answer)
    }

    /// Whether this object has a wrong length for the first time.
    pub(super) fn is_first_wrong_length(&mut self, cob: Cob) -> bool {
        let function_code = CanId::from(cob).number() >> 7;
        let known = self.wrong_lengths;
        self.wrong_lengths |= 1 << function_code;
        known != self.wrong_lengths
    }

    /// The reason for the drive's absence, if absent: the drive has never come.
    pub(super) fn absence(&mut self, now_ns: u64) -> Option<Failure> {
        let (waited_ns, limit_ns) = (self.boot.waited_ns(now_ns), self.boot_timeout_ns);
        let is_absent = self.boot.phase == BootPhase::Waiting && waited_ns > limit_ns;
        let is_new = is_absent && !std::mem::replace(&mut self.is_absence_known, true);
        is_new.then(|| late(waited_ns, limit_ns))
    }

    /// The reason for the loss of the drive, if lost, given its answer to SYNC. A verified drive must send messages,
    /// and an operational drive must answer every SYNC once.
    pub(super) fn loss(&mut self, now_ns: u64, is_fresh: bool) -> Option<Failure> {
        if !matches!(self.boot.phase, BootPhase::Configured | BootPhase::Ready) {
            return None;
        }
        if !is_fresh && self.is_operational() {
            self.presence.missing_cycles += 1;
        }
        let may_miss = self.following.may_miss_cycles(MISSING_CYCLES);
        self.presence.loss(now_ns, self.heartbeat_timeout_ns, may_miss).or_else(|| self.stop_by_itself())
    }

    /// The loss of a started drive that left operational by itself.
    fn stop_by_itself(&self) -> Option<Failure> {
        let state = self.nmt.filter(|&state| self.is_started && state != NmtState::Operational)?;
        Some(Failure::with(Cause::NodeStopped, state.code(), NmtState::Operational.code()))
    }

    /// The failure of a drive that does not follow its targets, given its answer to SYNC.
    pub(super) fn following_error(&mut self, is_fresh: bool) -> Option<Failure> {
        let position_m = self.following_m().filter(|_| is_fresh)?;
        self.following.following_failure(position_m)
    }

    /// Discards all knowledge of the drive, which has to boot again.
    pub(super) fn forget(&mut self, now_ns: u64) {
        self.boot.forget(now_ns);
        self.presence.restart();
        (self.is_absence_known, self.power) = (true, None);
    }

    /// Discards process data until the drive is started anew.
    fn stop_exchange(&mut self) {
        self.following.stop();
        self.presence.answered_ns = 0;
        (self.is_started, self.power) = (false, None);
        (self.controlword, self.emergency) = (Controlword::DISABLE_VOLTAGE, EmergencyCode::RESET);
    }

    /// Completes its boot if it was started and has become operational; otherwise continues it after some time.
    pub(super) fn advance_boot(&mut self, now_ns: u64) -> Result<(), Failure> {
        if self.boot.phase == BootPhase::Starting && self.is_operational() {
            self.boot.phase = BootPhase::Ready;
        }
        self.boot.expire(now_ns)
    }

    /// The message of network management that its boot needs, if any.
    pub(super) fn boot_command(&mut self, now_ns: u64) -> Option<Frame> {
        let command = self.boot.command(now_ns)?;
        self.stop_exchange();
        Some(self.nmt_frame(command))
    }

    /// The SDO request that its boot needs, if one is due.
    pub(super) fn sdo_request(&mut self, now_ns: u64) -> Option<Frame> {
        self.boot.client.poll(now_ns).map(|request| request.frame(self.address.node))
    }

    /// The message that starts the drive.
    pub(super) fn start(&mut self, now_ns: u64) -> Frame {
        self.boot.start(now_ns);
        self.presence.missing_cycles = 0;
        self.is_started = true;
        self.nmt_frame(NmtCommand::Start)
    }

    fn nmt_frame(&self, command: NmtCommand) -> Frame {
        Nmt { command, target: NmtTarget::Node(self.address.node) }.frame()
    }

    /// The process data for a request and a target, if the drive exchanges any. A drive that may not be switched on
    /// goes to "ready to switch on" only. Before the drive follows targets, its target is its position (607Ah :=
    /// 6064h), so that its first motion has no jump.
    pub(super) fn process_data(
        &mut self,
        now_ns: u64,
        request: DriveRequest,
        may_switch_on: bool,
        target: Option<Target>,
    ) -> Option<Frame> {
        if !self.is_operational() {
            return None;
        }
        let state = self.power.unwrap_or(DriveState::NotReadyToSwitchOn);
        let word = next_controlword(state, request, self.controlword);
        let switches_on = matches!(word, Controlword::SWITCH_ON | Controlword::ENABLE_OPERATION);
        self.controlword = if switches_on && !may_switch_on { Controlword::SHUTDOWN } else { word };
        let follows = state == DriveState::OperationEnabled && request == DriveRequest::Enable;
        let (target_increments, torque_offset_permille) = if let Some(target) = target.filter(|_| follows) {
            self.following.follow(now_ns, self.position_m(), target.position_m);
            (self.scale.increments(target.position_m), self.scale.permille(target.force_offset_n))
        } else {
            self.following.stop();
            (self.actual_increments, 0)
        };
        let rpdo = Rpdo1 { controlword: self.controlword, target_increments, torque_offset_permille };
        Some(rpdo.frame(self.address.node, &self.rpdo1))
    }

    fn hear_state(&mut self, time_ns: u64, state: NmtState) {
        self.presence.heard_ns = time_ns;
        self.nmt = Some(state);
    }
}

/// What was, and what is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change<T> {
    pub(super) before: T,
    pub(super) after: T,
}

/// The content of an object that the master receives from a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Message {
    Heartbeat(NmtState),
    ProcessData(Tpdo1),
    Emergency(Emergency),
    SdoAnswer(SdoResponse),
    /// Node guarding of somebody else, or a message of a service that the master does not use.
    Foreign,
}

impl Message {
    /// Decodes the data of an object, process data by that mapping.
    pub(super) fn decode(cob: Cob, data: &[u8], tpdo1: &PdoMapping) -> Result<Self, LengthError> {
        match cob {
            Cob::Heartbeat(_) => match Heartbeat::decode(data) {
                Ok(Heartbeat { state }) => Ok(Self::Heartbeat(state)),
                Err(HeartbeatError::Length(error)) => Err(error),
                Err(HeartbeatError::UnknownState { .. }) => Ok(Self::Foreign),
            },
            Cob::Tpdo1(_) => Tpdo1::decode(data, tpdo1).map(Self::ProcessData),
            Cob::Emergency(_) => Emergency::decode(data).map(Self::Emergency),
            Cob::SdoResponse(_) => match SdoResponse::decode(data) {
                Ok(answer) => Ok(Self::SdoAnswer(answer)),
                Err(SdoError::Length(error)) => Err(error),
                Err(SdoError::UnknownCommand { .. }) => Ok(Self::Foreign),
            },
            _ => Ok(Self::Foreign),
        }
    }
}

#[cfg(test)]
mod drive_tests {
    use masseter_can::canopen::NodeId;

    use super::*;

    #[test]
    fn a_drive_is_absent_once_beyond_its_time() {
        let scenario = Scenario::default();
        let address = Address { bus: 0, node: NodeId::new(1).unwrap() };
        let mut drive =
            RemoteDrive::new(&scenario, 0, address, Following::new(&scenario, 0, 0), 500).unwrap();
        let limit_ns = u64::from(scenario.can.boot_timeout_ms) * MILLISECOND_NS;
        assert_eq!(drive.absence(500 + limit_ns), None);
        assert_eq!(drive.absence(501 + limit_ns), Some(late(limit_ns + 1, limit_ns)));
        assert_eq!(drive.absence(502 + limit_ns), None);
    }
}
