//! The time table of a cycle, from the worst-case frame lengths on the bus.
//!
//! SYNC and process data go first, at offset 0; then the controller computes; then its targets go out,
//! to be on the wire before the next SYNC. Heartbeats and emergencies use what is left.

use crate::can::wire::worst_case_bits;
use crate::can::{Bitrate, BitrateError, CycleLoad, FrameGroup, Overload, Rpdo1, Tpdo1};
use crate::config::CanConfig;

/// From the reading's worst case to the controller's deadline: publishing takes some microseconds, ns.
const PUBLISH_NS: u64 = 15_000;
/// The least time between the controller's deadline and the latest command, ns.
const COMPUTE_NS: u64 = 20_000;

/// Offsets from SYNC within one cycle, ns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CycleSchedule {
    /// When the process data of all drives have arrived in the worst case.
    pub reading_by_ns: u64,
    /// When the controller wakes.
    pub controller_at_ns: u64,
    /// When the command must be there, so that its process data are on the wire before the next SYNC.
    pub command_by_ns: u64,
}

/// A cycle that does not fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScheduleError {
    /// No such bit rate.
    #[error("can.bitrate_bps: {0}")]
    Bitrate(#[from] BitrateError),
    /// More bits than a cycle has.
    #[error("can.buses: {0}")]
    Overload(#[from] Overload),
    /// The bits fit, but leave the controller no time between reading and command.
    #[error(
        "can.buses: the reading may take until {reading_by_ns} ns and the command must be there by \
         {command_by_ns} ns of a cycle of {period_ns} ns, which leaves the controller no time; \
         use a lower rate_hz or more buses"
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
    /// The time table for cycles of `period_ns`, by the busiest bus.
    pub fn new(can: &CanConfig, period_ns: u64) -> Result<Self, ScheduleError> {
        let bitrate = Bitrate::new(can.bitrate_bps)?;
        for (bus, axes) in can.buses.iter().enumerate() {
            load(bus, bitrate, period_ns, axes.len() as u32).check()?;
        }
        let axes = can.buses.iter().map(Vec::len).max().unwrap_or(0) as u32;
        let time = |bits| bitrate.bits_to_ns(bits);
        // A heartbeat may just have begun when the bus is wanted.
        let blocking = worst_case_bits(1, false);
        let up = worst_case_bits(0, false) + axes * worst_case_bits(Tpdo1::LENGTH as u32, false);
        let down = axes * worst_case_bits(Rpdo1::LENGTH as u32, false);
        let reading_by_ns = time(blocking + up) + u64::from(can.answer_us) * 1000;
        let command_by_ns = period_ns.saturating_sub(time(blocking + down));
        let controller_at_ns = reading_by_ns + PUBLISH_NS;
        if controller_at_ns + COMPUTE_NS > command_by_ns {
            return Err(ScheduleError::NoTime { reading_by_ns, command_by_ns, period_ns });
        }
        Ok(Self { reading_by_ns, controller_at_ns, command_by_ns })
    }
}

fn load(bus: usize, bitrate: Bitrate, period_ns: u64, axes: u32) -> CycleLoad {
    let groups = vec![
        FrameGroup { name: "SYNC", count: 1, data_length: 0 },
        FrameGroup { name: "RPDO", count: axes, data_length: Rpdo1::LENGTH as u32 },
        FrameGroup { name: "TPDO", count: axes, data_length: Tpdo1::LENGTH as u32 },
    ];
    CycleLoad::new(bus, bitrate, period_ns, groups)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_buses_hold_a_kilohertz_and_the_offsets_follow_the_frames() {
        let schedule = CycleSchedule::new(&CanConfig::default(), 1_000_000).unwrap();
        assert_eq!(schedule.reading_by_ns, (65 + 55 + 3 * 135) * 1000);
        assert_eq!(schedule.controller_at_ns, schedule.reading_by_ns + PUBLISH_NS);
        assert_eq!(schedule.command_by_ns, 1_000_000 - (65 + 3 * 115) * 1000);
    }

    #[test]
    fn drives_that_take_time_to_answer_delay_the_reading() {
        let slow = CanConfig { answer_us: 300, ..Default::default() };
        let [at_once, late] = [CanConfig::default(), slow]
            .map(|can| CycleSchedule::new(&can, 2_000_000).unwrap().reading_by_ns);
        assert_eq!(late, at_once + 300_000);
    }

    #[test]
    fn one_bus_at_a_kilohertz_is_refused_with_the_arithmetic() {
        let one = CanConfig { buses: vec![vec![0, 1, 2, 3, 4, 5]], ..Default::default() };
        let error = CycleSchedule::new(&one, 1_000_000).unwrap_err().to_string();
        assert!(error.contains("= 1555 bits of 1000 bits a cycle") && error.contains("643 Hz"), "{error}");
        assert!(CycleSchedule::new(&one, 4_000_000).is_ok());
    }

    #[test]
    fn a_cycle_without_time_for_the_controller_is_refused() {
        let error = CycleSchedule::new(&CanConfig::default(), 900_000).unwrap_err();
        assert!(matches!(error, ScheduleError::NoTime { .. }), "{error}");
    }
}
