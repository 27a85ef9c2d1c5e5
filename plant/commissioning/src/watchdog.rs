//! Watchdogs of a drive: an axis stands with power, the master's frames end, and the drive must stop by itself and report that.
//!
//! The heartbeat ends first. Then the process data end, while heartbeat and SYNC go on. Statuswords come by SDO, milliseconds apart, so
//! the times are no finer than that. They count from the moment when the last frame left, as the bus shows it. The step does not prove how
//! fast a moving axis comes to rest.

use masseter_can::canopen::{
    AbortCode, Emergency, EmergencyCode, NmtCommand, NmtState, NodeId, ObjectAddress, sync,
};
use masseter_can::cia402::{Controlword, DriveState};
use masseter_can::{Frame, Rpdo1};
use masseter_model::geometry::AXES;
use masseter_plant::sdo::SdoReason;
use masseter_plant::wanted::{PdoSetting, WantedDrive, WantedIdentity, rpdo_timeout_ms};
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::Scenario;
use serde::{Deserialize, Serialize};

use crate::motion_error::{AxisError, MotionError, Silence, StopCause};
use crate::mover::{Mover, Operator, POSITIONING, Wish};
use crate::watch::{
    Caution, TRANSITION_NS, disable_voltage, read_error_code, read_state, stop_drive, wait_for_state,
    watch_unpowered,
};
use crate::{line::Line, line_error::LineError, loan::Loan, steps::START_NS};

/// How much longer than its time a drive may take: some drives look every few milliseconds, and the statusword comes by SDO.
const MARGIN_NS: u64 = 50 * MILLISECOND_NS;
/// The share of its time after which a stop may be that of the watchdog. An earlier one has another cause.
const EARLIEST: f64 = 0.8;
/// How long a drive is watched beyond its time, so that a late one shows how late it is, ns.
const LATE_NS: u64 = SECOND_NS;
/// How long a drive may take from leaving operation to being without power, ns.
const POWER_OFF_NS: u64 = 2 * SECOND_NS;
/// For how long process data are sent before they end, and how often at most: a slow bus has the cycle of its run, ns.
const SENT_NS: u64 = 200 * MILLISECOND_NS;
const SENT_EVERY_NS: u64 = 2 * MILLISECOND_NS;
/// Objects that decide what the drive does without a master. The proof uses the values of the run.
const REACTIONS: [u16; 3] = [0x6007, 0x605A, 0x605E];

/// From when a silence counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LastFrame {
    /// The end of the master's last frame on the bus.
    Left,
    /// The moment when that frame was queued, on an interface that does not show it.
    Queued,
}

/// How a drive reacted to a silence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reaction {
    /// The configured time, ms.
    pub timeout_ms: u16,
    /// From the last frame of the master until a statusword without "operation enabled", ms.
    pub stopped_after_ms: f64,
    /// What the time counts from.
    pub last_frame: LastFrame,
    /// Error code of the drive's emergency message.
    pub emergency: u16,
    /// How far the axis moved until a second after its power went, m.
    pub moved_m: f64,
}

/// What the watchdogs of a drive did.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WatchdogReport {
    /// Without the master's heartbeat.
    pub heartbeat: Reaction,
    /// Without process data. None of a drive without an event timer for its RPDO, and in a scenario without that time.
    pub process_data: Option<Reaction>,
}

/// Proves both watchdogs of a drive, whose axis stands meanwhile.
///
/// # Errors
/// [`MotionError`]; the axis is off then, unless the error says that this is not proved.
pub fn prove_watchdogs(
    line: &mut Line,
    scenario: &Scenario,
    axis: usize,
    operator: &mut Operator<'_>,
) -> Result<WatchdogReport, MotionError> {
    let heartbeat = prove(line, scenario, axis, operator, Silence::Heartbeat)?;
    let has_timer = rpdo_timeout_ms(scenario) > 0 && has_timer(line, axis)?;
    let process_data =
        has_timer.then(|| prove(line, scenario, axis, operator, Silence::ProcessData)).transpose()?;
    Ok(WatchdogReport { heartbeat, process_data })
}

/// Whether a drive has an event timer for its RPDO.
fn has_timer(line: &mut Line, axis: usize) -> Result<bool, LineError> {
    match line.read_number(axis, Silence::ProcessData.object()) {
        Err(error) if matches!(error.abort_code(), Some(AbortCode::NO_OBJECT | AbortCode::NO_SUBINDEX)) => {
            Ok(false)
        }
        read => read.map(|_| true),
    }
}

fn prove(
    line: &mut Line,
    scenario: &Scenario,
    axis: usize,
    operator: &mut Operator<'_>,
    silence: Silence,
) -> Result<Reaction, MotionError> {
    if operator(line.now_ns()) == Wish::Stop {
        return Err(AxisError::Stopped(StopCause::Requested).of(axis));
    }
    let mut operator = |now_ns| operator(now_ns);
    let mut mover = Mover::prepare(line, scenario, axis, Caution::usual(scenario, axis), &mut operator)?;
    let done = Proof::begin(&mut mover, scenario, silence).and_then(|proof| proof.play(&mut mover));
    // Some drives take no configuration in operational.
    let left = mover.line.command(axis, NmtCommand::EnterPreOperational).map_err(MotionError::from);
    mover.end_motion(done.and_then(|reaction| left.map(|()| reaction)))
}

/// One silence.
struct Proof<'a> {
    scenario: &'a Scenario,
    silence: Silence,
    timeout_ms: u16,
    node: NodeId,
    /// The drives in fault before.
    in_fault: [bool; AXES],
}

impl<'a> Proof<'a> {
    /// Gives the drive the objects of a run.
    fn begin(mover: &mut Mover<'_>, scenario: &'a Scenario, silence: Silence) -> Result<Self, MotionError> {
        let axis = mover.axis;
        let node = NodeId::new(scenario.can.node_ids[axis]).expect("the line has opened with this id");
        let timeout_ms = match silence {
            Silence::Heartbeat => scenario.can.heartbeat_consumer_ms,
            Silence::ProcessData => rpdo_timeout_ms(scenario),
        };
        let mut in_fault = [false; AXES];
        for (axis, in_fault) in in_fault.iter_mut().enumerate() {
            *in_fault = read_state(mover.line, axis)? == DriveState::Fault;
        }
        let wanted = WantedDrive::of_axis(scenario, axis, node).map_err(LineError::from)?;
        let is_needed = |object: ObjectAddress| {
            REACTIONS.contains(&object.index) || silence == Silence::ProcessData && object == silence.object()
        };
        let of_run = wanted.objects.iter().filter(|setting| is_needed(setting.object.0)).map(|setting| {
            let ObjectAddress { index, subindex } = setting.object.0;
            Loan { may_lack: true, ..Loan::new(index, subindex, setting.value, setting.bytes) }
        });
        let loans: Vec<_> = of_run.collect();
        mover.borrow(&loans)?;
        if silence == Silence::ProcessData {
            check_pdo(mover, &wanted.pdos[0])?;
        }
        Ok(Self { scenario, silence, timeout_ms, node, in_fault })
    }

    fn play(&self, mover: &mut Mover<'_>) -> Result<Reaction, MotionError> {
        let &Self { silence, timeout_ms, .. } = self;
        let axis = mover.axis;
        mover.switch_on(POSITIONING)?;
        let from_m = mover.position_m()?;
        let before = mover.line.heard(axis).emergencies.len();
        // A run is in operational, too.
        mover.line.command(axis, NmtCommand::Start)?;
        let queued_ns = match silence {
            Silence::Heartbeat => {
                mover.line.listen(START_NS)?;
                mover.line.traffic.end_heartbeat()
            }
            Silence::ProcessData => self.send_process_data(mover)?,
        };
        let limit_ns = u64::from(timeout_ms) * MILLISECOND_NS + MARGIN_NS;
        let stopped_ns = self.wait_for_stop(mover, from_m, queued_ns + limit_ns + LATE_NS)?;
        let left_ns = match silence {
            Silence::Heartbeat => mover.line.heard(axis).beat_left_ns,
            Silence::ProcessData => mover.line.heard(axis).rpdo_left_ns,
        };
        let (last_ns, last_frame) = match left_ns {
            Some(left_ns) if left_ns >= queued_ns => (left_ns, LastFrame::Left),
            _ => (queued_ns, LastFrame::Queued),
        };
        let since_ms = |now_ns: u64| now_ns.saturating_sub(last_ns) as f64 / MILLISECOND_NS as f64;
        let Some(stopped_ns) = stopped_ns else {
            let waited_ms = since_ms(mover.line.now_ns());
            return self.take_power(mover, AxisError::Unwatched { silence, waited_ms, timeout_ms });
        };
        // The drive takes the power away by itself.
        let state = wait_for_state(mover.line, axis, POWER_OFF_NS, |state| !state.is_powered())?;
        if state.is_powered() {
            return self.take_power(mover, AxisError::KeepsPower { silence, state });
        }
        let scale = mover.scale();
        let held = match watch_unpowered(mover.line, axis, &scale, from_m) {
            Err(error @ MotionError::Line(_)) => return Err(error),
            held => held,
        };
        let emergencies = &mover.line.heard(axis).emergencies[before..];
        let emergency = emergencies.iter().map(|emergency| emergency.code).find(|code| self.explains(*code));
        let is_silent = emergencies.iter().all(Emergency::is_reset);
        let recovered = self.recover(mover);
        let stopped_after_ms = since_ms(stopped_ns);
        let is_early = stopped_after_ms < EARLIEST * f64::from(timeout_ms);
        let wrong = match (held, emergency) {
            (Err(unheld), _) => unheld,
            _ if stopped_ns.saturating_sub(last_ns) > limit_ns => {
                AxisError::LateWatchdog { silence, stopped_after_ms, timeout_ms }.of(axis)
            }
            (Ok(_), None) if is_silent && !is_early => AxisError::Unreported { silence }.of(axis),
            (Ok(moved_m), Some(EmergencyCode(emergency))) if !is_early => {
                let reaction = Reaction { timeout_ms, stopped_after_ms, last_frame, emergency, moved_m };
                return recovered.map(|()| reaction);
            }
            _ => AxisError::OtherStop { silence, stopped_after_ms, timeout_ms }.of(axis),
        };
        Err(with_faults(wrong, recovered))
    }

    /// Takes the power from a drive that keeps it, and then ends the faults of the silence. The proof has failed for that reason.
    fn take_power<T>(&self, mover: &mut Mover<'_>, reason: AxisError) -> Result<T, MotionError> {
        stop_drive(mover.line, mover.axis, &mover.profile().brake)?;
        Err(with_faults(reason.of(mover.axis), self.recover(mover)))
    }

    /// Whether an error code is one of the communication (81xxh, 82xxh), and not that of the other watchdog.
    fn explains(&self, EmergencyCode(code): EmergencyCode) -> bool {
        let is_of_other = self.silence == Silence::ProcessData && code == EmergencyCode::HEARTBEAT.0;
        matches!(code >> 8, 0x81 | 0x82) && !is_of_other
    }

    /// Sends process data that hold the axis, for a while; returns when the last ones were queued, ns.
    fn send_process_data(&self, mover: &mut Mover<'_>) -> Result<u64, MotionError> {
        let target_increments = mover.scale().increments(mover.position_m()?);
        let controlword = Controlword::ENABLE_OPERATION;
        let rpdo = Rpdo1 { controlword, target_increments, torque_offset_permille: 0 };
        let frame: Frame = rpdo.frame(self.node, &mover.profile().pdos.rpdo1());
        let until_ns = mover.line.now_ns() + SENT_NS;
        loop {
            mover.line.send(mover.axis, sync::frame())?;
            mover.line.send(mover.axis, frame)?;
            let queued_ns = mover.line.now_ns();
            if queued_ns >= until_ns {
                return Ok(queued_ns);
            }
            mover.line.listen(SENT_EVERY_NS.max(self.scenario.period_ns()))?;
        }
    }

    /// Watches the axis until the drive leaves operation; returns when that was seen, ns, and none if it never was.
    fn wait_for_stop(
        &self,
        mover: &mut Mover<'_>,
        from_m: f64,
        until_ns: u64,
    ) -> Result<Option<u64>, MotionError> {
        let axis = mover.axis;
        loop {
            if self.silence == Silence::ProcessData {
                mover.line.send(axis, sync::frame())?;
            }
            let state = match read_state(mover.line, axis) {
                // 1029h may stop the node, whose SDO server is silent then.
                Err(MotionError::Line(LineError::Sdo { reason: SdoReason::Silent, .. }))
                    if mover.line.heard(axis).nmt == Some(NmtState::Stopped) =>
                {
                    mover.line.command(axis, NmtCommand::EnterPreOperational)?;
                    mover.line.listen(START_NS)?;
                    read_state(mover.line, axis)?
                }
                state => state?,
            };
            let now_ns = mover.line.now_ns();
            if state != DriveState::OperationEnabled {
                return Ok(Some(now_ns));
            }
            let moved_m = (mover.position_m()? - from_m).abs();
            if moved_m > mover.caution.still_m {
                return mover.stopped(StopCause::Restless { moved_m });
            }
            mover.watch.check_undisturbed(mover.line)?;
            if let Some(cause) = mover.watch.look_at_another(mover.line)? {
                return mover.stopped(cause);
            }
            if (mover.operator)(now_ns) == Wish::Stop {
                return mover.stopped(StopCause::Requested);
            }
            if now_ns >= until_ns {
                return Ok(None);
            }
        }
    }

    /// Ends the faults that the silence has made, once the heartbeat is back: also drives without power may go into fault.
    fn recover(&self, mover: &mut Mover<'_>) -> Result<(), MotionError> {
        let beat_ms = self.scenario.can.heartbeat_producer_ms;
        mover.line.traffic.beat_every(beat_ms);
        mover.line.command(mover.axis, NmtCommand::EnterPreOperational)?;
        mover.line.listen(2 * u64::from(beat_ms) * MILLISECOND_NS)?;
        disable_voltage(mover.line, mover.axis)?;
        for axis in (0..AXES).filter(|&axis| !self.in_fault[axis]) {
            if read_state(mover.line, axis)? != DriveState::Fault {
                continue;
            }
            mover.line.control(axis, Controlword::FAULT_RESET)?;
            let state = wait_for_state(mover.line, axis, TRANSITION_NS, |state| state != DriveState::Fault)?;
            // The next reset needs a rising edge.
            mover.line.control(axis, Controlword::DISABLE_VOLTAGE)?;
            if state == DriveState::Fault {
                let error_code = read_error_code(mover.line, axis);
                return Err(AxisError::KeepsFault { error_code }.of(axis));
            }
        }
        Ok(())
    }
}

/// What went wrong first, with the fault that it has left.
fn with_faults(cause: MotionError, recovered: Result<(), MotionError>) -> MotionError {
    match (cause, recovered) {
        (MotionError::OfAxis { axis, reason }, Err(left)) => {
            AxisError::Unrecovered { cause: Box::new(reason), left: Box::new(left) }.of(axis)
        }
        (cause, _) => cause,
    }
}

/// RPDO1 must exist and hold what the rig sends, which `configure` writes. Its transmission type does not matter here.
fn check_pdo(mover: &mut Mover<'_>, rpdo1: &PdoSetting) -> Result<(), MotionError> {
    for WantedIdentity { object, mask, value } in rpdo1.compared().filter(|one| one.object != rpdo1.part(2)) {
        let found = mover.line.read_if_there(mover.axis, object)?;
        if found.is_none_or(|found| (found ^ value) & mask != 0) {
            return Err(AxisError::OtherMapping { index: object.index }.of(mover.axis));
        }
    }
    Ok(())
}
