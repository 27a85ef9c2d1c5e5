//! The schedule of a cycle, from the worst-case frame lengths on the bus.
//!
//! SYNC and the drives' process data (TPDO1) go first, at offset 0. Then the controller computes. Then its targets
//! (RPDO1) go out, before the next SYNC. The heartbeat is the last message of a node in its cycle. A drive's heartbeat
//! follows its TPDO1; the master's heartbeat follows the RPDO1 and any SDO request. The offsets also hold for
//! interfaces that send in the order of their queue, if SYNC waits for one heartbeat at most. [`queued`] has the bounds for
//! heartbeats that meet, and for emergencies (EMCY). An SDO exchange takes the place of its drive's process data.
//! Emergencies are not in the schedule: in a cycle with an emergency, reading or command may be late, as with a disturbed
//! bus.

pub mod queued;

use std::fmt;

use masseter_scenario::{CanConfig, MASTER_NODE, RATES_HZ, Scenario};

use crate::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_can::canopen::{Cob, NodeId, NodeIdError};
use masseter_can::wire::{INTERFRAME_BITS, unstuffed_bits, worst_case_bits};
use masseter_can::{
    Bitrate, BitrateError, BusPlan, NoReleaser, Overload, PdoMapping, PeriodicMessage, Release,
};

/// Distance of SYNC and of the controller's deadline from whole milliseconds, the times of the kernel's timer tick, ns.
pub const OFF_TICK_NS: u64 = 230_000;

/// From the latest reading to the controller's deadline, ns: publishing takes some microseconds.
const PUBLISH_NS: u64 = 15_000;
/// Data bytes of every SDO message.
const SDO_LENGTH: u32 = 8;
/// The least time between the controller's deadline and the latest command, ns.
const COMPUTE_NS: u64 = 20_000;

/// Offsets from SYNC within one cycle, ns.
///
/// # Examples
/// ```
/// use masseter_scenario::Scenario;
/// use masseter_runtime::schedule::CycleSchedule;
///
/// let schedule = CycleSchedule::new(&Scenario::default())?;
/// assert!(schedule.reading_by_ns < schedule.controller_at_ns);
/// assert!(schedule.controller_at_ns < schedule.command_by_ns);
/// let refused = CycleSchedule::new(&Scenario { rate_hz: 2000, ..Scenario::default() }).unwrap_err();
/// assert!(refused.to_string().contains("the highest rate_hz that fits"));
/// # Ok::<(), masseter_runtime::schedule::ScheduleError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CycleSchedule {
    /// The earliest arrival of the last process data: frames without stuff bits take this long.
    pub reading_from_ns: u64,
    /// The latest arrival of the last process data.
    pub reading_by_ns: u64,
    /// When the controller wakes.
    pub controller_at_ns: u64,
    /// The latest command with process data on the wire before the next SYNC.
    pub command_by_ns: u64,
}

/// The reason for a missing schedule.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScheduleError {
    /// Unknown bit rate.
    #[error("can.bitrate_bps: {0}")]
    Bitrate(#[from] BitrateError),
    /// Unknown node id.
    #[error("can.node_ids: {0}")]
    NodeId(#[from] NodeIdError),
    /// A message without a releaser.
    #[error(transparent)]
    NoReleaser(#[from] NoReleaser),
    /// The cycle is too short.
    #[error("can.buses: {misfit}; {room}")]
    Misfit {
        /// The part that does not fit.
        misfit: Misfit,
        /// The highest rate that fits.
        room: Room,
    },
}

/// The part of a cycle that does not fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Misfit {
    /// Messages that do not arrive in time.
    #[error("the messages of a bus do not fit\n{0}")]
    Overload(#[from] Overload),
    /// The frames fit, without time for the controller between reading and command.
    #[error(
        "the reading may take until {reading_by_ns} ns and the command must be there by {command_by_ns} ns of a cycle \
         of {period_ns} ns, which leaves the controller no time; use a lower rate_hz or more buses"
    )]
    NoTime {
        /// Offset of the reading.
        reading_by_ns: u64,
        /// Offset of the latest command.
        command_by_ns: u64,
        /// The cycle.
        period_ns: u64,
    },
}

impl CycleSchedule {
    /// The schedule of a scenario's cycles, by the busiest bus.
    ///
    /// # Errors
    /// [`ScheduleError`] for cycles that are too short, with the highest rate that fits.
    pub fn new(scenario: &Scenario) -> Result<Self, ScheduleError> {
        match Self::fit(scenario, scenario.period_ns())? {
            Ok(schedule) => Ok(schedule),
            Err(misfit) => Err(ScheduleError::Misfit { misfit, room: Room::for_link(scenario)? }),
        }
    }

    fn fit(scenario: &Scenario, period_ns: u64) -> Result<Result<Self, Misfit>, ScheduleError> {
        let mut plans = plans_of(scenario, period_ns, Drives::AllRun)?;
        plans.extend(plans_of(scenario, period_ns, Drives::OneBoots)?);
        if let Some(overload) = plans.iter().find_map(|plan| plan.check().err()) {
            return Ok(Err(overload.into()));
        }
        Ok(Self::offsets(scenario, scenario.can.bitrate()?, period_ns))
    }

    fn offsets(scenario: &Scenario, bitrate: Bitrate, period_ns: u64) -> Result<Self, Misfit> {
        let can = &scenario.can;
        let longest = |length| bitrate.bits_to_ns(worst_case_bits(length, false));
        let shortest = |length| bitrate.bits_to_ns(unstuffed_bits(length, false));
        let axes = can.buses.iter().map(Vec::len).max().unwrap_or(0) as u64;
        let (sync, tpdo) = (0, pdo_bytes(&PdoMapping::TPDO1));
        // A frame has arrived before the interframe space behind it.
        let pause_ns = bitrate.bits_to_ns(INTERFRAME_BITS);
        let reading_from_ns = shortest(sync) + axes * shortest(tpdo) - pause_ns;
        // A heartbeat may begin just before SYNC is queued.
        let heartbeat_ns = heartbeat_ns(bitrate);
        let up_ns = longest(sync) + axes * longest(tpdo);
        let rpdos_ns = |axes: &Vec<usize>| {
            axes.iter().map(|&axis| longest(pdo_bytes(&scenario.profile(axis).pdos.rpdo1()))).sum()
        };
        let down_ns = can.buses.iter().map(rpdos_ns).max().unwrap_or(0);
        let reading_by_ns = heartbeat_ns + up_ns + answer_ns(can, heartbeat_ns);
        let command_by_ns = period_ns.saturating_sub(heartbeat_ns + down_ns);
        let controller_at_ns = reading_by_ns + PUBLISH_NS;
        if controller_at_ns + COMPUTE_NS > command_by_ns {
            return Err(Misfit::NoTime { reading_by_ns, command_by_ns, period_ns });
        }
        Ok(Self { reading_from_ns, reading_by_ns, controller_at_ns, command_by_ns })
    }
}

/// The highest cycle rate of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// The highest rate with a time table, Hz; none if no rate is low enough.
    pub max_rate_hz: Option<u32>,
    /// Time of the drives' answer to SYNC in every cycle, ns.
    pub answer_ns: u64,
}

impl fmt::Display for Room {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.max_rate_hz {
            Some(rate_hz) => write!(f, "the highest rate_hz that fits is {rate_hz}")?,
            None => write!(f, "no rate_hz fits")?,
        }
        match self.answer_ns {
            0 => Ok(()),
            _ => write!(f, ", since can.answer_us takes {} µs of every cycle", self.answer_ns / 1000),
        }
    }
}

impl Room {
    /// The room of a scenario's link, by bisection: frames that fit into a cycle fit into a longer cycle.
    ///
    /// # Errors
    /// [`ScheduleError`] for unknown bit rates and node ids.
    pub fn for_link(scenario: &Scenario) -> Result<Self, ScheduleError> {
        let can = &scenario.can;
        let fits = |rate_hz: u32| {
            CycleSchedule::fit(scenario, SECOND_NS / u64::from(rate_hz)).map(|fitted| fitted.is_ok())
        };
        let answer_ns = answer_ns(can, heartbeat_ns(can.bitrate()?));
        // An error does not depend on the rate.
        fits(*RATES_HZ.start())?;
        let rates_hz: Vec<u32> = RATES_HZ.collect();
        let fitting = rates_hz.partition_point(|&rate_hz| fits(rate_hz).unwrap_or(false));
        Ok(Self { max_rate_hz: fitting.checked_sub(1).map(|place| rates_hz[place]), answer_ns })
    }
}

/// The longest time of a heartbeat on the wire, ns.
fn heartbeat_ns(bitrate: Bitrate) -> u64 {
    bitrate.bits_to_ns(worst_case_bits(HEARTBEAT_LENGTH, false))
}

/// The delay of the reading by drives that do not answer SYNC at once, ns. A heartbeat may begin in the idle time
/// before the answer.
fn answer_ns(can: &CanConfig, heartbeat_ns: u64) -> u64 {
    if can.answer_us > 0 { u64::from(can.answer_us) * 1000 + heartbeat_ns } else { 0 }
}

/// Data bytes of a heartbeat.
const HEARTBEAT_LENGTH: u32 = 1;

/// The plan of every bus: SYNC, process data and heartbeats. SYNC releases the drives' process data. The master releases
/// SYNC and its own process data once a cycle, here without jitter.
///
/// ```
/// use masseter_scenario::Scenario;
/// use masseter_runtime::schedule::plans;
///
/// for plan in plans(&Scenario::default())? {
///     plan.check()?;
///     println!("{:.0} % of the bus in use", plan.utilisation() * 100.0);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ScheduleError`] for unknown bit rates, node ids and releasers. [`BusPlan::check`] finds messages that do not fit.
pub fn plans(scenario: &Scenario) -> Result<Vec<BusPlan>, ScheduleError> {
    plans_of(scenario, scenario.period_ns(), Drives::AllRun)
}

/// The activity of the drives of every bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Drives {
    AllRun,
    OneBoots,
}

/// The plans with all drives running, or with one booting drive on every bus. Request and answer of one SDO exchange
/// take the place of the booting drive's process data. The worst case is the drive with the shortest RPDO1. With more
/// booting drives a cycle still has one request. Each answer is no longer than the missing process data of its drive.
///
/// The offsets of the schedule hold as well. An SDO frame blocks the bus for longer than a heartbeat, but not for
/// longer than a heartbeat and the missing process data.
fn plans_of(scenario: &Scenario, period_ns: u64, drives: Drives) -> Result<Vec<BusPlan>, ScheduleError> {
    let bitrate = scenario.can.bitrate()?;
    let of_buses = messages_of(scenario, period_ns, drives)?.into_iter().enumerate();
    of_buses.map(|(bus, messages)| Ok(BusPlan::new(bus, bitrate, period_ns, messages)?)).collect()
}

/// The messages of every bus, those of the master in the order in which it queues them.
fn messages_of(
    scenario: &Scenario,
    period_ns: u64,
    drives: Drives,
) -> Result<Vec<Vec<PeriodicMessage>>, ScheduleError> {
    let can = &scenario.can;
    let messages = |axes: &Vec<usize>| {
        let ids = axes.iter().filter_map(|&axis| Some((*can.node_ids.get(axis)?, axis)));
        let nodes = ids.map(|(id, axis)| Ok((NodeId::new(id)?, scenario.profile(axis).pdos.rpdo1())));
        let nodes = nodes.collect::<Result<Vec<_>, NodeIdError>>()?;
        let shortest = nodes.iter().min_by_key(|(_, rpdo1)| pdo_bytes(rpdo1));
        let booting = shortest.filter(|_| drives == Drives::OneBoots).map(|&(node, _)| node);
        Ok(bus_messages(&nodes, can, period_ns, booting))
    };
    can.buses.iter().map(messages).collect()
}

/// Data bytes of a PDO.
fn pdo_bytes(mapping: &PdoMapping) -> u32 {
    mapping.length() as u32
}

/// The messages of a bus with these drives, at most one of them booting.
fn bus_messages(
    drives: &[(NodeId, PdoMapping)],
    can: &CanConfig,
    period_ns: u64,
    booting: Option<NodeId>,
) -> Vec<PeriodicMessage> {
    let heartbeat_ns = u64::from(can.heartbeat_producer_ms) * MILLISECOND_NS;
    let message = |name: String, cob: Cob, data_length: u32, period_ns: u64| PeriodicMessage {
        name,
        id: cob.into(),
        data_length,
        period_ns,
        deadline_ns: period_ns,
        release: None,
    };
    let mut messages = vec![message("SYNC".to_owned(), Cob::Sync, 0, period_ns)];
    for &(node, rpdo1) in drives.iter().filter(|(node, _)| booting != Some(*node)) {
        let (tpdo, rpdo) = (pdo_bytes(&PdoMapping::TPDO1), pdo_bytes(&rpdo1));
        messages.push(PeriodicMessage {
            release: Some(Release { by: Cob::Sync.into(), within_ns: u64::from(can.answer_us) * 1000 }),
            ..message(format!("TPDO1 {}", node.get()), Cob::Tpdo1(node), tpdo, period_ns)
        });
        messages.push(message(format!("RPDO1 {}", node.get()), Cob::Rpdo1(node), rpdo, period_ns));
    }
    if let Some(node) = booting {
        // The answer may take until the end of the next cycle.
        let sdo = |name: &str, cob| PeriodicMessage {
            deadline_ns: 2 * period_ns,
            ..message(format!("{name} {}", node.get()), cob, SDO_LENGTH, period_ns)
        };
        messages.push(sdo("SDO request", Cob::SdoRequest(node)));
        messages.push(sdo("SDO response", Cob::SdoResponse(node)));
    }
    for node in drives.iter().map(|&(node, _)| node).chain([MASTER_NODE]) {
        let name = format!("heartbeat {}", node.get());
        messages.push(message(name, Cob::Heartbeat(node), HEARTBEAT_LENGTH, heartbeat_ns));
    }
    messages
}

#[cfg(test)]
mod tests;
