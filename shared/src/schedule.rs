//! The schedule of a cycle, from the worst-case frame lengths on the bus.
//!
//! SYNC and the drives' process data (TPDO1) go first, at offset 0. Then the controller computes. Then its targets (RPDO1)
//! go out, to be on the wire before the next SYNC. Heartbeats use the rest of the cycle; an SDO exchange takes the place of
//! its drive's process data. Emergencies (EMCY) are not in the schedule: in a cycle with one, reading or command may be
//! late, as with a disturbed bus.

use std::fmt;

use crate::clock::{MILLISECOND_NS, SECOND_NS};
use crate::config::{CanConfig, MASTER_NODE, RATES_HZ, Scenario};
use masseter_can::canopen::{Cob, NodeId, NodeIdError};
use masseter_can::wire::{INTERFRAME_BITS, unstuffed_bits, worst_case_bits};
use masseter_can::{
    Bitrate, BitrateError, BusPlan, NoReleaser, Overload, PdoMapping, PeriodicMessage, Release,
};

/// SYNC and the controller's deadline keep this clear of whole milliseconds, where the kernel's timer
/// tick falls, ns.
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
/// use masseter_shared::config::Scenario;
/// use masseter_shared::schedule::CycleSchedule;
///
/// let schedule = CycleSchedule::new(&Scenario::default())?;
/// assert!(schedule.reading_by_ns < schedule.controller_at_ns);
/// assert!(schedule.controller_at_ns < schedule.command_by_ns);
/// let refused = CycleSchedule::new(&Scenario { rate_hz: 2000, ..Scenario::default() }).unwrap_err();
/// assert!(refused.to_string().contains("the highest rate_hz that fits"));
/// # Ok::<(), masseter_shared::schedule::ScheduleError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CycleSchedule {
    /// The earliest arrival of the last process data: frames without stuff bits take this long.
    pub reading_from_ns: u64,
    /// The latest arrival of the last process data.
    pub reading_by_ns: u64,
    /// When the controller wakes.
    pub controller_at_ns: u64,
    /// The latest command whose process data are on the wire before the next SYNC.
    pub command_by_ns: u64,
}

/// Why there is no schedule.
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
        /// The rate that fits.
        room: Room,
    },
}

/// The part of a cycle that does not fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Misfit {
    /// Messages that do not arrive in time.
    #[error("the messages of a bus do not fit\n{0}")]
    Overload(#[from] Overload),
    /// The frames fit, but leave the controller no time between reading and command.
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
        let mut plans =
            plans_of(scenario, period_ns, false)?.into_iter().chain(plans_of(scenario, period_ns, true)?);
        if let Some(overload) = plans.find_map(|plan| plan.check().err()) {
            return Ok(Err(overload.into()));
        }
        Ok(Self::offsets(scenario, scenario.can.bitrate()?, period_ns))
    }

    fn offsets(scenario: &Scenario, bitrate: Bitrate, period_ns: u64) -> Result<Self, Misfit> {
        let can = &scenario.can;
        let longest = |length| bitrate.bits_to_ns(worst_case_bits(length, false));
        let shortest = |length| bitrate.bits_to_ns(unstuffed_bits(length, false));
        let axes = can.buses.iter().map(Vec::len).max().unwrap_or(0) as u64;
        let (sync, tpdo) = (0, length(&PdoMapping::TPDO1));
        // A frame has arrived before the interframe space behind it.
        let pause_ns = bitrate.bits_to_ns(INTERFRAME_BITS);
        let reading_from_ns = shortest(sync) + axes * shortest(tpdo) - pause_ns;
        // A heartbeat may have begun just before SYNC is queued.
        let heartbeat_ns = heartbeat_ns(bitrate);
        let up_ns = longest(sync) + axes * longest(tpdo);
        let rpdos_ns = |axes: &Vec<usize>| {
            axes.iter().map(|&axis| longest(length(&scenario.profile(axis).pdos.rpdo1()))).sum()
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

/// The cycle rate that a link has room for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Room {
    /// The highest rate for which there is a time table, Hz; none where no rate is low enough.
    pub max_rate_hz: Option<u32>,
    /// The part of every cycle that the drives take to answer SYNC, ns.
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
    /// The room of a scenario's link, by bisection: whatever fits into a cycle fits into a longer one.
    ///
    /// # Errors
    /// [`ScheduleError`] for unknown bit rates and node ids.
    pub fn for_link(scenario: &Scenario) -> Result<Self, ScheduleError> {
        let can = &scenario.can;
        let fits = |rate_hz: u32| {
            CycleSchedule::fit(scenario, SECOND_NS / u64::from(rate_hz)).map(|fitted| fitted.is_ok())
        };
        let answer_ns = answer_ns(can, heartbeat_ns(can.bitrate()?));
        let (mut max_rate_hz, mut too_high_hz) = (*RATES_HZ.start(), *RATES_HZ.end() + 1);
        if !fits(max_rate_hz)? {
            return Ok(Self { max_rate_hz: None, answer_ns });
        }
        while too_high_hz - max_rate_hz > 1 {
            let between_hz = u32::midpoint(max_rate_hz, too_high_hz);
            if fits(between_hz)? {
                max_rate_hz = between_hz;
            } else {
                too_high_hz = between_hz;
            }
        }
        Ok(Self { max_rate_hz: Some(max_rate_hz), answer_ns })
    }
}

/// The longest time of a heartbeat on the wire, ns.
fn heartbeat_ns(bitrate: Bitrate) -> u64 {
    bitrate.bits_to_ns(worst_case_bits(HEARTBEAT_LENGTH, false))
}

/// The delay of the reading by drives that do not answer SYNC at once, ns: a heartbeat may begin while the bus is idle.
fn answer_ns(can: &CanConfig, heartbeat_ns: u64) -> u64 {
    if can.answer_us > 0 { u64::from(can.answer_us) * 1000 + heartbeat_ns } else { 0 }
}

/// Data bytes of a heartbeat.
const HEARTBEAT_LENGTH: u32 = 1;

/// The plan of every bus: SYNC, process data and heartbeats. SYNC releases the drives' process data. The master releases
/// SYNC and its own process data once a cycle, here without jitter.
///
/// ```
/// use masseter_shared::config::Scenario;
/// use masseter_shared::schedule::plans;
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
    plans_of(scenario, scenario.period_ns(), false)
}

/// The plans while all drives run, or while one of every bus `boots` and the others run: then request and answer of one
/// SDO exchange take the place of its process data. The worst is the drive with the shortest RPDO1. With more drives
/// booting there is still one request in a cycle, and each answer is no longer than the process data that its drive
/// does not send.
///
/// The offsets of the schedule hold as well: an SDO frame blocks the bus for longer than a heartbeat, but for no longer than
/// a heartbeat and the missing process data.
fn plans_of(scenario: &Scenario, period_ns: u64, boots: bool) -> Result<Vec<BusPlan>, ScheduleError> {
    let can = &scenario.can;
    let plan = |(bus, axes): (usize, &Vec<usize>)| {
        let ids = axes.iter().filter_map(|&axis| Some((*can.node_ids.get(axis)?, axis)));
        let drives = ids.map(|(id, axis)| Ok((NodeId::new(id)?, scenario.profile(axis).pdos.rpdo1())));
        let drives = drives.collect::<Result<Vec<_>, NodeIdError>>()?;
        let messages = messages(&drives, can, period_ns, boots);
        Ok(BusPlan::new(bus, can.bitrate()?, period_ns, messages)?)
    };
    can.buses.iter().enumerate().map(plan).collect()
}

/// Data bytes of a PDO.
fn length(mapping: &PdoMapping) -> u32 {
    mapping.length() as u32
}

fn messages(
    drives: &[(NodeId, PdoMapping)],
    can: &CanConfig,
    period_ns: u64,
    boots: bool,
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
    let shortest = drives.iter().min_by_key(|(_, rpdo1)| length(rpdo1)).filter(|_| boots);
    let booting = shortest.map(|&(node, _)| node);
    for &(node, rpdo1) in drives {
        if booting == Some(node) {
            // The answer may take until the end of the next cycle.
            let sdo = |name: &str, cob| PeriodicMessage {
                deadline_ns: 2 * period_ns,
                ..message(format!("{name} {}", node.get()), cob, SDO_LENGTH, period_ns)
            };
            messages.push(sdo("SDO request", Cob::SdoRequest(node)));
            messages.push(sdo("SDO response", Cob::SdoResponse(node)));
            continue;
        }
        let (tpdo, rpdo) = (length(&PdoMapping::TPDO1), length(&rpdo1));
        messages.push(PeriodicMessage {
            release: Some(Release { by: Cob::Sync.into(), within_ns: u64::from(can.answer_us) * 1000 }),
            ..message(format!("TPDO1 {}", node.get()), Cob::Tpdo1(node), tpdo, period_ns)
        });
        messages.push(message(format!("RPDO1 {}", node.get()), Cob::Rpdo1(node), rpdo, period_ns));
    }
    for node in drives.iter().map(|&(node, _)| node).chain([MASTER_NODE]) {
        let name = format!("heartbeat {}", node.get());
        messages.push(message(name, Cob::Heartbeat(node), HEARTBEAT_LENGTH, heartbeat_ns));
    }
    messages
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(can: CanConfig, rate_hz: u32) -> Scenario {
        Scenario { rate_hz, can, ..Scenario::default() }
    }

    /// RPDO1 of eight bytes: three frames of 20 µs more on each bus.
    #[test]
    fn a_torque_offset_lengthens_the_frames_and_the_command_is_due_earlier() {
        let with_offset = |axes: &str, rate_hz| {
            let pdos = "pdos.rpdo1 = ['6040h', '607Ah', '60B2h']";
            let text = format!("rate_hz = {rate_hz}\n[[drive_profile]]\naxes = [{axes}]\n{pdos}");
            Scenario::parse(std::path::Path::new("robot.toml"), &text).unwrap()
        };
        let command_by_ns = |axes| CycleSchedule::new(&with_offset(axes, 500)).unwrap().command_by_ns;
        let [none, one, all] = ["", "'l1'", "'d1', 'd2', 'd3', 'l1', 'l2', 'l3'"].map(command_by_ns);
        assert_eq!([none - one, none - all], [20_000, 60_000], "the busiest bus counts");
        let cycle_ns = |axes| plans(&with_offset(axes, 500)).unwrap().last().unwrap().cycle_time_ns();
        assert_eq!(cycle_ns("'l1'") - cycle_ns(""), 20_000);
        let refusal = CycleSchedule::new(&with_offset("'l1', 'l2', 'l3'", 1000)).unwrap_err().to_string();
        assert!(refusal.ends_with("the highest rate_hz that fits is 970"), "{refusal}");
    }

    #[test]
    fn two_buses_hold_a_kilohertz_and_the_offsets_follow_the_frames() {
        let schedule = CycleSchedule::new(&Scenario::default()).unwrap();
        assert_eq!(schedule.reading_from_ns, (47 + 3 * 111 - 3) * 1000);
        assert_eq!(schedule.reading_by_ns, (65 + 55 + 3 * 135) * 1000);
        assert_eq!(schedule.controller_at_ns, schedule.reading_by_ns + PUBLISH_NS);
        assert_eq!(schedule.command_by_ns, 1_000_000 - (65 + 3 * 115) * 1000);
    }

    #[test]
    fn drives_that_take_time_to_answer_delay_the_reading() {
        let slow = CanConfig { answer_us: 300, ..Default::default() };
        let [at_once, late] = [CanConfig::default(), slow]
            .map(|can| CycleSchedule::new(&scenario(can, 500)).unwrap().reading_by_ns);
        assert_eq!(late, at_once + 300_000 + 65_000, "meanwhile another heartbeat may begin");
    }

    #[test]
    fn a_drive_booted_beside_running_ones_keeps_to_the_offsets() {
        let bits = |length| worst_case_bits(length, false);
        for axes in 1..=6 {
            let [sdo, heartbeat] = [SDO_LENGTH, HEARTBEAT_LENGTH].map(bits);
            let [tpdo, rpdo] = [PdoMapping::TPDO1, PdoMapping::RPDO1].map(|mapping| bits(length(&mapping)));
            assert!(sdo + (axes - 1) * tpdo <= heartbeat + axes * tpdo);
            assert!(sdo + (axes - 1) * rpdo <= heartbeat + axes * rpdo);
        }
        for plan in plans_of(&Scenario::default(), 1_000_000, true).unwrap() {
            assert_eq!(plan.check(), Ok(()));
        }
    }

    /// The frames of the drive that boots go: the worst case keeps the longer ones.
    #[test]
    fn the_drive_with_the_shortest_process_data_boots() {
        let text =
            "rate_hz = 500\n[[drive_profile]]\naxes = ['l1']\npdos.rpdo1 = ['6040h', '607Ah', '60B2h']";
        let scenario = Scenario::parse(std::path::Path::new("robot.toml"), text).unwrap();
        let plan = plans_of(&scenario, 2_000_000, true).unwrap().pop().unwrap();
        let has = |name: &str| plan.messages.iter().any(|planned| planned.message.name == name);
        assert_eq!(["RPDO1 4", "RPDO1 5", "SDO request 5"].map(has), [true, false, true]);
    }

    #[test]
    fn one_bus_at_a_kilohertz_is_refused_with_the_arithmetic() {
        let one = CanConfig { buses: vec![vec![0, 1, 2, 3, 4, 5]], ..Default::default() };
        let error = CycleSchedule::new(&scenario(one.clone(), 1000)).unwrap_err().to_string();
        assert!(error.contains("takes 1555.0 µs at worst;") && error.contains("too late"), "{error}");
        assert!(CycleSchedule::new(&scenario(one, 250)).is_ok());
    }

    #[test]
    fn an_ideal_bus_holds_twenty_kilohertz() {
        let ideal = CanConfig { ideal: true, ..Default::default() };
        let schedule = CycleSchedule::new(&scenario(ideal, 20_000)).unwrap();
        assert!(schedule.reading_by_ns < 1000 && schedule.command_by_ns > 49_000, "{schedule:?}");
    }

    #[test]
    fn the_last_process_data_of_a_cycle_wait_for_all_others_and_a_heartbeat() {
        let plans = plans(&Scenario::default()).unwrap();
        let last = Cob::Rpdo1(NodeId::new(3).unwrap()).into();
        let last = plans[0].messages.iter().find(|planned| planned.message.id == last).unwrap();
        assert_eq!(last.response_ns, Some((65 + 55 + 3 * 135 + 3 * 115) * 1000));
    }

    #[test]
    fn a_cycle_without_time_for_the_controller_is_refused() {
        let error = CycleSchedule::new(&scenario(CanConfig::default(), 1041)).unwrap_err();
        assert!(matches!(error, ScheduleError::Misfit { misfit: Misfit::NoTime { .. }, .. }), "{error}");
    }

    #[test]
    fn the_highest_rate_is_one_that_fits_and_the_next_does_not() {
        let one_bus = vec![vec![0, 1, 2, 3, 4, 5]];
        for can in [
            CanConfig::default(),
            CanConfig { answer_us: 10, ..Default::default() },
            CanConfig { buses: one_bus, ..Default::default() },
        ] {
            let highest_hz = Room::for_link(&scenario(can.clone(), 1000)).unwrap().max_rate_hz.unwrap();
            let fits = |rate_hz: u32| CycleSchedule::new(&scenario(can.clone(), rate_hz)).is_ok();
            assert!(fits(highest_hz) && !fits(highest_hz + 1), "{highest_hz} Hz: {can:?}");
        }
        let ideal = CanConfig { ideal: true, ..Default::default() };
        assert_eq!(Room::for_link(&scenario(ideal, 1000)).unwrap().max_rate_hz, Some(*RATES_HZ.end()));
    }

    #[test]
    fn a_refusal_names_the_highest_rate_and_the_answer_time_of_slow_drives() {
        let slow = CanConfig { answer_us: 10, ..Default::default() };
        let refusal = |can, rate_hz| CycleSchedule::new(&scenario(can, rate_hz)).unwrap_err().to_string();
        let said = refusal(slow, 1000);
        assert!(
            said.ends_with(
                "the highest rate_hz that fits is 956, since can.answer_us takes 75 µs of every cycle"
            ),
            "{said}"
        );
        let said = refusal(CanConfig::default(), 1250);
        assert!(said.ends_with("the highest rate_hz that fits is 1030"), "{said}");
    }
}
