//! The plan of a drive's boot: a list of SDO steps, made once for each drive.
//!
//! Nothing is written before the identity and the PDOs of the drive are verified, and the first write stops it. The plan
//! executes nothing; the [boot](super) does.

use masseter_can::canopen::{Cob, CobId, NodeId, ObjectAddress};
use masseter_can::cia402::{Controlword, interpolation_period};
use masseter_can::{CanId, EVERY_SYNC, Rpdo1, Tpdo1};
use masseter_shared::config::{IdentityConfig, Scenario};
use masseter_shared::messages::codes::{BootPhase, Cause};

/// 6041h.
pub(super) const STATUSWORD: ObjectAddress = ObjectAddress::new(0x6041, 0);
/// 605Ah.
const QUICK_STOP_OPTION: ObjectAddress = ObjectAddress::new(0x605A, 0);
/// 6060h and 6061h: cyclic synchronous position.
const CYCLIC_POSITION: u32 = 8;
/// Abort connection option code (6007h): quick stop.
const QUICK_STOP_AT_ABORT: u32 = 3;
/// Quick stop option code (605Ah): quick-stop ramp, then switch on disabled.
const RAMP_THEN_OFF: u32 = 2;
/// COB-ID without the bit for remote requests, which the master does not send.
const COB_ID_BITS: u32 = !CobId::NO_REMOTE_REQUEST;

/// Software position limits count from the home position. So the home offset (607Ch) must be 0, or the limits are not
/// those of the rig.
const NO_HOME_OFFSET: Step =
    Step::ExpectUnset { object: ObjectAddress::new(0x607C, 0), otherwise: Cause::HomeOffset };

/// Communication parameters of the other PDOs with identifiers of CiA 301. Many drives send them as delivered, but the
/// plan of the bus does not include them.
const OTHER_PDOS: [u16; 6] = [0x1401, 0x1402, 0x1403, 0x1801, 0x1802, 0x1803];

/// A condition for further steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Condition {
    /// The object is the COB-ID of a valid PDO. Its value is kept, marked as invalid.
    Exchanged(ObjectAddress),
    /// The drive is in fault.
    InFault,
}

/// One step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// The drive enters a phase.
    Enter(BootPhase),
    /// Read the object: the bits of `mask` must be those of `value`, now or after repetitions.
    Expect { object: ObjectAddress, mask: u32, value: u32, otherwise: Cause },
    /// Read the object, which must be 0 if the drive has it.
    ExpectUnset { object: ObjectAddress, otherwise: Cause },
    /// Write that many bytes to the object.
    Write { object: ObjectAddress, value: u32, bytes: usize },
    /// Write that many bytes to the object, if the drive allows it.
    Offer { object: ObjectAddress, value: u32, bytes: usize },
    /// Read the object and keep its value.
    Keep(ObjectAddress),
    /// Write the kept value.
    WriteKept(ObjectAddress),
    /// Read the object of the condition; unless it holds, skip that many steps.
    If { condition: Condition, otherwise_skip: usize },
    /// Read the statusword: without a fault, now or after repetitions.
    ExpectNoFault,
    /// Read the statusword: without voltage, now or after repetitions.
    ExpectOff,
}

/// The steps for a drive, in their order.
pub(super) fn plan(node: NodeId, scenario: &Scenario, axis: usize) -> Vec<Step> {
    let mut steps = vec![Step::Enter(BootPhase::Identifying)];
    steps.extend(identify(&scenario.can.identity));
    steps.push(Step::Enter(BootPhase::CheckingPdos));
    steps.extend(check_pdo(0x1400, Cob::Rpdo1(node), &Rpdo1::MAPPING));
    steps.extend(check_pdo(0x1800, Cob::Tpdo1(node), &Tpdo1::MAPPING));
    steps.push(Step::Enter(BootPhase::Configuring));
    steps.extend(switch_off());
    steps.extend(OTHER_PDOS.into_iter().flat_map(switch_off_pdo));
    steps.push(NO_HOME_OFFSET);
    steps.extend(configure(scenario, axis));
    // A drive may begin to follow its target with the mode, and may have moved before the last step.
    steps.extend(hold_position());
    steps.extend(choose_mode());
    steps.extend(reset_fault());
    steps.extend(hold_position());
    steps.push(Step::Enter(BootPhase::Configured));
    steps
}

/// The least number of SDO exchanges that the boot of a drive takes: of a drive without a fault and without other PDOs
/// that gives the expected answers at once.
pub(crate) fn shortest_boot(scenario: &Scenario) -> usize {
    let steps = plan(NodeId::MASTER, scenario, 0);
    let without_exchange = |step: &Step| match step {
        Step::Enter(_) => 1,
        Step::If { otherwise_skip, .. } => *otherwise_skip,
        _ => 0,
    };
    steps.len() - steps.iter().map(without_exchange).sum::<usize>()
}

/// Steps for a drive that fulfils a condition.
fn only_if<const N: usize>(condition: Condition, steps: [Step; N]) -> impl Iterator<Item = Step> {
    [Step::If { condition, otherwise_skip: N }].into_iter().chain(steps)
}

fn identify(identity: &IdentityConfig) -> impl Iterator<Item = Step> {
    [
        ((0x1000, 0), identity.device_type),
        ((0x1018, 1), identity.vendor_id),
        ((0x1018, 2), identity.product_code),
        ((0x1018, 3), identity.revision),
    ]
    .into_iter()
    .map(|((index, subindex), value)| Step::Expect {
        object: ObjectAddress::new(index, subindex),
        mask: u32::MAX,
        value,
        otherwise: Cause::WrongIdentity,
    })
}

/// COB-ID, transmission type, number of mapped objects and each of them.
fn check_pdo(communication: u16, cob: Cob, mapping: &[u32]) -> impl Iterator<Item = Step> {
    let parameter = move |subindex, mask, value| (ObjectAddress::new(communication, subindex), mask, value);
    let mapped = move |(place, &entry): (usize, &u32)| {
        (ObjectAddress::new(communication + 0x200, place as u8 + 1), u32::MAX, entry)
    };
    let head = [
        parameter(1, COB_ID_BITS, CanId::from(cob).number()),
        parameter(2, u32::MAX, u32::from(EVERY_SYNC)),
        (ObjectAddress::new(communication + 0x200, 0), u32::MAX, mapping.len() as u32),
    ];
    let all = head.into_iter().chain(mapping.iter().enumerate().map(mapped));
    all.map(|(object, mask, value)| Step::Expect { object, mask, value, otherwise: Cause::WrongPdo })
}

/// Another master may have left the drive enabled, and a reset of the communication does not change that. The drive stops
/// along its quick-stop ramp, if it allows that option.
const fn switch_off() -> [Step; 3] {
    let quick_stop = Step::Offer { object: QUICK_STOP_OPTION, value: RAMP_THEN_OFF, bytes: 2 };
    [quick_stop, control(Controlword::QUICK_STOP), Step::ExpectOff]
}

const fn control(word: Controlword) -> Step {
    Step::Write { object: ObjectAddress::new(0x6040, 0), value: word.0 as u32, bytes: 2 }
}

fn switch_off_pdo(communication: u16) -> impl Iterator<Item = Step> {
    let cob_id = ObjectAddress::new(communication, 1);
    only_if(Condition::Exchanged(cob_id), [Step::WriteKept(cob_id)])
}

fn configure(scenario: &Scenario, axis: usize) -> [Step; 12] {
    let (can, drive) = (&scenario.can, scenario.drives.of_axis(axis));
    let consumed = u32::from(NodeId::MASTER.get()) << 16 | u32::from(can.heartbeat_consumer_ms);
    // Increments/s² are taken to be the drive's unit of acceleration (6097h, 60AAh).
    let quick_stop = drive.increments(drive.quick_stop_deceleration_m_s2) as u32;
    let window = drive.increments(drive.following_error_m) as u32;
    let stroke_m = scenario.mechanism.strokes.of_axis(axis);
    let [lowest, highest] = stroke_m.map(|end_m| drive.increments(end_m) as i32);
    let (period, exponent) = interpolation_period(scenario.period_ns());
    let write = |(index, subindex, value, bytes)| Step::Write {
        object: ObjectAddress::new(index, subindex),
        value,
        bytes,
    };
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
    .map(write)
}

const fn choose_mode() -> [Step; 2] {
    [
        Step::Write { object: ObjectAddress::new(0x6060, 0), value: CYCLIC_POSITION, bytes: 1 },
        Step::Expect {
            object: ObjectAddress::new(0x6061, 0),
            mask: u32::MAX,
            value: CYCLIC_POSITION,
            otherwise: Cause::NotAccepted,
        },
    ]
}

/// A fault whose cause is gone is reset by an edge; one that persists is reported with its code.
fn reset_fault() -> impl Iterator<Item = Step> {
    let steps = [
        Step::Keep(ObjectAddress::new(0x603F, 0)),
        control(Controlword::DISABLE_VOLTAGE),
        control(Controlword::FAULT_RESET),
        control(Controlword::DISABLE_VOLTAGE),
        Step::ExpectNoFault,
    ];
    only_if(Condition::InFault, steps)
}

/// 607Ah := 6064h, so that nothing jumps when the drive is enabled.
const fn hold_position() -> [Step; 2] {
    [Step::Keep(ObjectAddress::new(0x6064, 0)), Step::WriteKept(ObjectAddress::new(0x607A, 0))]
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
}
