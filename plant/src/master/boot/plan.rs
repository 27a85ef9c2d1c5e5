//! The plan of a drive's boot: a list of SDO steps, made once for each drive.
//!
//! Nothing is written before the identity and the PDOs of the drive are verified, and the first write stops it. The plan
//! executes nothing; the [boot](super) does.

use masseter_can::canopen::{Cob, CobId, NodeId, ObjectAddress};
use masseter_can::cia402::{Controlword, interpolation_period};
use masseter_can::{CanId, EVERY_SYNC, Rpdo1, Tpdo1};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::{MASTER_NODE, Scenario};
use masseter_shared::messages::codes::{BootPhase, Cause};

/// 6041h.
const STATUSWORD: ObjectAddress = ObjectAddress::new(0x6041, 0);
/// 6060h and 6061h: cyclic synchronous position.
const CYCLIC_POSITION: u32 = 8;
/// Abort connection option code (6007h): quick stop.
const QUICK_STOP_AT_ABORT: u32 = 3;
/// Quick stop option code (605Ah): quick-stop ramp, then switch on disabled.
const RAMP_THEN_OFF: u32 = 2;
/// COB-ID without the bit for remote requests, which the master does not send.
const COB_ID_BITS: u32 = !CobId::NO_REMOTE_REQUEST;

/// Communication parameters of the other PDOs with identifiers of CiA 301. Many drives send them as delivered, but the
/// plan of the bus does not include them.
const OTHER_PDOS: [u16; 6] = [0x1401, 0x1402, 0x1403, 0x1801, 0x1802, 0x1803];

/// 607Ah := 6064h, so that nothing jumps when the drive is enabled.
const HOLD_POSITION: [Step; 2] =
    [Step::Read(ObjectAddress::new(0x6064, 0), Check::Keep), Step::WriteKept(ObjectAddress::new(0x607A, 0))];

/// One step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// The drive enters a phase.
    Enter(BootPhase),
    /// Read the object and check its value.
    Read(ObjectAddress, Check),
    /// Write that many bytes to the object; the drive may refuse an optional value.
    Write { object: ObjectAddress, value: u32, bytes: usize, is_optional: bool },
    /// Write that many bytes to the object, if the drive has it.
    WriteIfPresent { object: ObjectAddress, value: u32, bytes: usize },
    /// Write the kept value.
    WriteKept(ObjectAddress),
}

/// The use of a value that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Check {
    /// The bits of `mask` must be those of `value`, now or after repetitions.
    Equals { mask: u32, value: u32, otherwise: Cause },
    /// It must be 0 if the drive has the object.
    Unset { otherwise: Cause },
    /// It is kept.
    Keep,
    /// A statusword: without a fault, now or after repetitions.
    NoFault,
    /// The error code of a fault, for which the drive is given up.
    FaultRefused,
    /// A statusword: without voltage, now or after repetitions.
    NoVoltage,
    /// A statusword: unless the drive is in fault, skip that many steps.
    FaultElseSkip(usize),
    /// A COB-ID, kept and marked as invalid: unless it is that of a valid PDO, skip that many steps.
    PdoElseSkip(usize),
}

/// The steps for a drive, in their order.
pub(super) fn plan(node: NodeId, scenario: &Scenario, axis: usize) -> Vec<Step> {
    let identity = &scenario.can.identity;
    let mut steps = vec![Step::Enter(BootPhase::Identifying)];
    for (index, subindex, value) in [
        (0x1000, 0, identity.device_type),
        (0x1018, 1, identity.vendor_id),
        (0x1018, 2, identity.product_code),
        (0x1018, 3, identity.revision),
    ] {
        steps.push(expect(index, subindex, value, Cause::WrongIdentity));
    }
    steps.push(Step::Enter(BootPhase::CheckingPdos));
    steps.extend(check_pdo(0x1400, Cob::Rpdo1(node), &Rpdo1::MAPPING));
    steps.extend(check_pdo(0x1800, Cob::Tpdo1(node), &Tpdo1::MAPPING));
    steps.push(Step::Enter(BootPhase::Configuring));
    // Another master may have left the drive enabled, and a reset of the communication does not change that. The drive
    // stops along its quick-stop ramp, if it allows that option.
    let object = ObjectAddress::new(0x605A, 0);
    steps.extend([
        Step::Write { object, value: RAMP_THEN_OFF, bytes: 2, is_optional: true },
        control(Controlword::QUICK_STOP),
        Step::Read(STATUSWORD, Check::NoVoltage),
    ]);
    for communication in OTHER_PDOS {
        let cob_id = ObjectAddress::new(communication, 1);
        steps.extend([Step::Read(cob_id, Check::PdoElseSkip(1)), Step::WriteKept(cob_id)]);
    }
    // Software position limits count from the home position. So the home offset must be 0, or the limits are not those
    // of the rig.
    let home_offset = ObjectAddress::new(0x607C, 0);
    steps.push(Step::Read(home_offset, Check::Unset { otherwise: Cause::HomeOffset }));
    let (object, value) = (ObjectAddress::new(0x1400, 5), u32::from(rpdo_timeout_ms(scenario)));
    // Many drives have no such timer; the heartbeat and the master supervise them too.
    steps.push(Step::Write { object, value, bytes: 2, is_optional: true });
    steps.extend(configure(scenario, axis));
    steps.push(limit_force(scenario, axis));
    // A drive may begin to follow its target with the mode, and may have moved before the last step.
    steps.extend(HOLD_POSITION);
    steps.push(write(0x6060, 0, CYCLIC_POSITION, 1));
    steps.push(expect(0x6061, 0, CYCLIC_POSITION, Cause::NotAccepted));
    // A fault tells what somebody has to look at, so it is reset only on request: by an edge, if its cause is gone.
    let error_code = ObjectAddress::new(0x603F, 0);
    let with_fault = if scenario.can.reset_faults {
        vec![
            Step::Read(error_code, Check::Keep),
            control(Controlword::DISABLE_VOLTAGE),
            control(Controlword::FAULT_RESET),
            control(Controlword::DISABLE_VOLTAGE),
            Step::Read(STATUSWORD, Check::NoFault),
        ]
    } else {
        vec![Step::Read(error_code, Check::FaultRefused)]
    };
    steps.push(Step::Read(STATUSWORD, Check::FaultElseSkip(with_fault.len())));
    steps.extend(with_fault);
    steps.extend(HOLD_POSITION);
    steps.push(Step::Enter(BootPhase::Configured));
    steps
}

/// The least number of SDO exchanges that the boot of a drive takes: of a drive without a fault and without other PDOs
/// that gives the expected answers at once.
pub(crate) fn shortest_boot(scenario: &Scenario) -> usize {
    let steps = plan(MASTER_NODE, scenario, 0);
    let without_exchange = |step: &Step| match step {
        Step::Enter(_) => 1,
        Step::Read(_, Check::FaultElseSkip(skipped) | Check::PdoElseSkip(skipped)) => *skipped,
        _ => 0,
    };
    steps.len() - steps.iter().map(without_exchange).sum::<usize>()
}

/// Every run writes the limit of force: a dry run before may have lowered it. A drive without this limit takes part in normal
/// runs only.
fn limit_force(scenario: &Scenario, axis: usize) -> Step {
    let (drive, object, bytes) = (scenario.drives.of_axis(axis), ObjectAddress::new(0x6072, 0), 2);
    let share = drive.max_force_n / drive.rated_force_n * scenario.dry.force_now();
    let value = (share * 1000.0).round().clamp(1.0, f64::from(u16::MAX)) as u32;
    if scenario.dry.is_on {
        Step::Write { object, value, bytes, is_optional: false }
    } else {
        Step::WriteIfPresent { object, value, bytes }
    }
}

const fn expect(index: u16, subindex: u8, value: u32, otherwise: Cause) -> Step {
    let check = Check::Equals { mask: u32::MAX, value, otherwise };
    Step::Read(ObjectAddress::new(index, subindex), check)
}

const fn write(index: u16, subindex: u8, value: u32, bytes: usize) -> Step {
    let object = ObjectAddress::new(index, subindex);
    Step::Write { object, value, bytes, is_optional: false }
}

const fn control(word: Controlword) -> Step {
    write(0x6040, 0, word.0 as u32, 2)
}

/// COB-ID, transmission type, number of mapped objects and each of them.
fn check_pdo(communication: u16, cob: Cob, mapping: &[u32]) -> impl Iterator<Item = Step> {
    let (mask, value) = (COB_ID_BITS, CanId::from(cob).number());
    let cob_id = Check::Equals { mask, value, otherwise: Cause::WrongPdo };
    let head = [
        Step::Read(ObjectAddress::new(communication, 1), cob_id),
        expect(communication, 2, u32::from(EVERY_SYNC), Cause::WrongPdo),
        expect(communication + 0x200, 0, mapping.len() as u32, Cause::WrongPdo),
    ];
    let mapped = move |(place, &entry)| expect(communication + 0x200, place, entry, Cause::WrongPdo);
    head.into_iter().chain((1..).zip(mapping).map(mapped))
}

/// The event timer of a drive's RPDO: a stall of the machine that neither heartbeat nor commands make a fault trips no
/// drive.
fn rpdo_timeout_ms(scenario: &Scenario) -> u16 {
    let can = &scenario.can;
    let commands_ms = u64::from(can.command_timeout_cycles) * scenario.period_ns() / MILLISECOND_NS;
    let longest_ms = u16::try_from(commands_ms).unwrap_or(u16::MAX).max(can.heartbeat_consumer_ms);
    can.rpdo_timeout_ms.unwrap_or(longest_ms)
}

fn configure(scenario: &Scenario, axis: usize) -> [Step; 12] {
    let (can, drive) = (&scenario.can, scenario.drives.of_axis(axis));
    let consumed = u32::from(MASTER_NODE.get()) << 16 | u32::from(can.heartbeat_consumer_ms);
    // Increments/s² are taken to be the drive's unit of acceleration (6097h, 60AAh).
    let quick_stop = drive.increments(drive.quick_stop_deceleration_m_s2) as u32;
    let window = drive.increments(drive.following_error_m) as u32;
    let stroke_m = scenario.mechanism.strokes.of_axis(axis);
    let [lowest, highest] = stroke_m.map(|end_m| drive.increments(end_m) as i32);
    let (period, exponent) = interpolation_period(scenario.period_ns());
    [
        (0x1017, 0, u32::from(can.heartbeat_producer_ms), 2),
        (0x1016, 1, consumed, 4),
        (0x6007, 0, QUICK_STOP_AT_ABORT, 2),
        (0x605A, 0, RAMP_THEN_OFF, 2),
        (0x6085, 0, quick_stop, 4),
        (0x6065, 0, window, 4),
        (0x6066, 0, u32::from(drive.following_error_timeout_ms), 2),
        // Wide at first: drives refuse limits that cross, and the old ones are unknown.
        (0x607D, 1, i32::MIN as u32, 4),
        (0x607D, 2, highest as u32, 4),
        (0x607D, 1, lowest as u32, 4),
        (0x60C2, 1, u32::from(period), 1),
        (0x60C2, 2, u32::from(exponent as u8), 1),
    ]
    .map(|(index, subindex, value, bytes)| write(index, subindex, value, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn software_limits_never_cross_while_they_are_written_whatever_they_were() {
        let id = NodeId::new(1).unwrap();
        let mut scenario = Scenario::default();
        let increment_m = scenario.drives.of_axis(0).encoder_resolution_m;
        scenario.mechanism.strokes.slide_m = [-10.0, 20.0].map(|increments| increments * increment_m);
        for mut limits in [[-500, -400], [-10, 20], [400, 500], [i32::MIN, i32::MAX], [0, 0]] {
            for step in plan(id, &scenario, 0) {
                if let Step::Write { object, value, .. } = step
                    && object.index == 0x607D
                {
                    limits[usize::from(object.subindex) - 1] = value as i32;
                    assert!(limits[0] <= limits[1], "{limits:?}");
                }
            }
            assert_eq!(limits, [-10, 20]);
        }
    }

    #[test]
    fn process_data_may_be_silent_as_long_as_commands_or_the_heartbeat() {
        let timeout_ms = |rate_hz, configured| {
            let mut scenario = Scenario { rate_hz, ..Scenario::default() };
            scenario.can.rpdo_timeout_ms = configured;
            rpdo_timeout_ms(&scenario)
        };
        assert_eq!(timeout_ms(100, None), 200, "20 cycles");
        assert_eq!(timeout_ms(1000, None), Scenario::default().can.heartbeat_consumer_ms);
        assert_eq!(timeout_ms(1000, Some(0)), 0);
    }
}
