//! Watchdogs of a drive: an axis stands with power, the master falls silent, and the drive must stop by itself and report that.
//!
//! The heartbeat ends first, in pre-operational. Then the process data end, in operational, while the heartbeat goes on. Statuswords
//! come by SDO, milliseconds apart, so the times are no finer than that. How fast a moving axis comes to rest is not part of it.

use masseter_can::canopen::{EmergencyCode, NmtCommand, NodeId, ObjectAddress};
use masseter_can::cia402::{Controlword, DriveState};
use masseter_can::{Frame, Rpdo1};
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_scenario::Scenario;
use serde::{Deserialize, Serialize};

use super::errors::{AxisError, MotionError, Silence};
use super::line::Line;
use super::mover::{Caution, Mover, Operator, POSITIONING};
use super::steps::START_NS;
use super::watch::{MOST_DROP_M, SETTLING_NS, disable_voltage, read_state, wait_for_state};
use super::write::Loan;
use crate::master::wanted::rpdo_timeout_ms;

/// How much longer than its time a drive may take: some drives look every few milliseconds, and the statusword comes by SDO.
const MARGIN_NS: u64 = 50 * MILLISECOND_NS;
/// For how long a silent drive is watched beyond that, so that a late one shows how late it is, ns.
const LATE_NS: u64 = SECOND_NS;
/// How long a drive may take from leaving operation to being without power, ns.
const POWER_OFF_NS: u64 = 2 * SECOND_NS;
/// For how long process data are sent, and how often, before they end.
const SENT_NS: u64 = 200 * MILLISECOND_NS;
const SENT_EVERY_NS: u64 = 5 * MILLISECOND_NS;

/// How a drive reacted to a silence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reaction {
    /// The configured time, ms.
    pub timeout_ms: u16,
    /// From the last frame of the master until a statusword without "operation enabled", ms.
    pub stopped_after_ms: f64,
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
    /// Without process data; none of a drive without an event timer for its RPDO, and where the scenario switches the timer off.
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
    let heartbeat_ms = scenario.can.heartbeat_consumer_ms;
    let heartbeat = prove(line, scenario, axis, operator, Silence::Heartbeat, heartbeat_ms)?;
    let timer_ms = rpdo_timeout_ms(scenario);
    let has_timer = timer_ms > 0 && line.read_if_there(axis, Silence::ProcessData.object())?.is_some();
    let process_data = has_timer
        .then(|| prove(line, scenario, axis, operator, Silence::ProcessData, timer_ms))
        .transpose()?;
    Ok(WatchdogReport { heartbeat, process_data })
}

fn prove(
    line: &mut Line,
    scenario: &Scenario,
    axis: usize,
    operator: &mut Operator<'_>,
    silence: Silence,
    timeout_ms: u16,
) -> Result<Reaction, MotionError> {
    let mut operator = |now_ns| operator(now_ns);
    let mut mover = Mover::prepare(line, scenario, axis, Caution::usual(scenario, axis), &mut operator)?;
    let done = fall_silent(&mut mover, scenario, silence, timeout_ms);
    // Some drives take no configuration in operational.
    let left = mover.line.command(axis, NmtCommand::EnterPreOperational).map_err(MotionError::from);
    mover.end_motion(done.and_then(|reaction| left.map(|()| reaction)))
}

fn fall_silent(
    mover: &mut Mover<'_>,
    scenario: &Scenario,
    silence: Silence,
    timeout_ms: u16,
) -> Result<Reaction, MotionError> {
    let axis = mover.axis;
    if silence == Silence::ProcessData {
        let timer = silence.object();
        mover.borrow(&[Loan::new(timer.index, timer.subindex, timeout_ms.into(), 2)])?;
        check_mapping(mover)?;
    }
    mover.switch_on(POSITIONING)?;
    let from_m = mover.position_m()?;
    let before = mover.line.heard(axis).emergencies.len();
    let last_ns = match silence {
        Silence::Heartbeat => mover.line.end_heartbeat(),
        Silence::ProcessData => send_process_data(mover, scenario)?,
    };
    let limit_ns = last_ns + u64::from(timeout_ms) * MILLISECOND_NS + MARGIN_NS;
    let watched_ns = (limit_ns + LATE_NS).saturating_sub(mover.line.now_ns());
    let state = wait_for_state(mover.line, axis, watched_ns, |state| state != DriveState::OperationEnabled)?;
    let stopped_ns = mover.line.now_ns();
    let stopped_after_ms = (stopped_ns - last_ns) as f64 / MILLISECOND_NS as f64;
    if state == DriveState::OperationEnabled {
        return Err(AxisError::Unwatched { silence, waited_ms: stopped_after_ms, timeout_ms }.of(axis));
    }
    // The drive takes the power away by itself.
    let state = wait_for_state(mover.line, axis, POWER_OFF_NS, |state| !state.is_powered())?;
    if state.is_powered() {
        return Err(AxisError::KeepsPower { silence, state }.of(axis));
    }
    mover.line.listen(SETTLING_NS)?;
    let moved_m = mover.position_m()? - from_m;
    let mut emergencies = mover.line.heard(axis).emergencies[before..].iter();
    let emergency = emergencies.find(|emergency| !emergency.is_reset()).map(|emergency| emergency.code);
    recover(mover, scenario)?;
    if stopped_ns > limit_ns {
        return Err(AxisError::LateWatchdog { silence, stopped_after_ms, timeout_ms }.of(axis));
    }
    if moved_m.abs() > MOST_DROP_M {
        return Err(AxisError::Dropped { moved_m }.of(axis));
    }
    let Some(EmergencyCode(emergency)) = emergency else {
        return Err(AxisError::Unreported { silence }.of(axis));
    };
    Ok(Reaction { timeout_ms, stopped_after_ms, emergency, moved_m })
}

/// The RPDO must hold what the rig sends, which `configure` writes.
fn check_mapping(mover: &mut Mover<'_>) -> Result<(), MotionError> {
    let mapping = mover.profile().pdos.rpdo1();
    let mut entries = (1..).zip(mapping.entries());
    let read = |mover: &mut Mover<'_>, subindex| {
        mover.line.read_if_there(mover.axis, ObjectAddress::new(0x1600, subindex))
    };
    let is_same = read(mover, 0)? == Some(mapping.entries().len() as u32)
        && entries.try_fold(true, |is_same, (subindex, entry)| {
            Ok::<_, MotionError>(is_same && read(mover, subindex)? == Some(*entry))
        })?;
    if is_same { Ok(()) } else { Err(AxisError::OtherMapping.of(mover.axis)) }
}

/// Sends process data that hold the axis, for a while; returns when the last ones were sent, ns.
fn send_process_data(mover: &mut Mover<'_>, scenario: &Scenario) -> Result<u64, MotionError> {
    let (axis, scale) = (mover.axis, mover.scale());
    let target_increments = scale.increments(mover.position_m()?);
    let rpdo =
        Rpdo1 { controlword: Controlword::ENABLE_OPERATION, target_increments, torque_offset_permille: 0 };
    let node = NodeId::new(scenario.can.node_ids[axis]).expect("the line has opened with this id");
    let frame: Frame = rpdo.frame(node, &mover.profile().pdos.rpdo1());
    mover.line.command(axis, NmtCommand::Start)?;
    mover.line.listen(START_NS)?;
    let until_ns = mover.line.now_ns() + SENT_NS;
    loop {
        let sent_ns = mover.line.send_cycle(axis, frame)?;
        if sent_ns >= until_ns {
            return Ok(sent_ns);
        }
        mover.line.listen(SENT_EVERY_NS)?;
        mover.look()?;
    }
}

/// Ends the fault of a drive that has stopped, once the heartbeat is back.
fn recover(mover: &mut Mover<'_>, scenario: &Scenario) -> Result<(), MotionError> {
    let axis = mover.axis;
    mover.line.beat_every(scenario.can.heartbeat_producer_ms);
    mover.line.listen(2 * u64::from(scenario.can.heartbeat_producer_ms) * MILLISECOND_NS)?;
    disable_voltage(mover.line, axis)?;
    if read_state(mover.line, axis)? == DriveState::Fault {
        mover.control(Controlword::FAULT_RESET)?;
        disable_voltage(mover.line, axis)?;
    }
    Ok(())
}
