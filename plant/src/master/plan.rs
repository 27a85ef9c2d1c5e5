//! What is done to a drive by SDO before it may move: a list of tasks, made once for each drive.
//!
//! The order is the point: who it is, then whether its PDOs are those that will be exchanged, and only
//! then anything is written, first of all what stops it. How tasks are carried out is not here but in
//! [`boot`](super::boot).

use masseter_can::canopen::{Cob, CobId, NodeId, ObjectAddress};
use masseter_can::cia402::Controlword;
use masseter_can::{CanId, EVERY_SYNC, Rpdo1, Tpdo1};
use masseter_shared::config::IdentityConfig;
use masseter_shared::messages::codes::{BootPhase, Cause};

/// Object 6041.
pub(super) const STATUSWORD: ObjectAddress = ObjectAddress::new(0x6041, 0);
/// How a quick stop comes to rest, and what follows.
const QUICK_STOP_OPTION: ObjectAddress = ObjectAddress::new(0x605A, 0);
/// Object 6060 and 6061: cyclic synchronous position.
const CYCLIC_POSITION: u32 = 8;
/// Object 6007: quick stop on loss of the link.
const LINK_LOSS_QUICK_STOP: u32 = 3;
/// Of that: along the quick-stop ramp, then switch on disabled.
const RAMP_THEN_OFF: u32 = 2;
/// Whether a TPDO answers remote requests says nothing about its use here.
const COB_ID_BITS: u32 = !CobId::NO_REMOTE_REQUEST;

/// Object 607C: software limits count from home, which must be the zero of the positions for them to be where the rig
/// has them.
const NO_HOME_OFFSET: Task =
    Task::ExpectUnset { object: ObjectAddress::new(0x607C, 0), otherwise: Cause::HomeOffset };

/// Communication parameters of the PDOs that CiA 301 gives identifiers to beside the first: many drives send them as
/// delivered, and no plan of the bus counts with them.
const OTHER_PDOS: [u16; 6] = [0x1401, 0x1402, 0x1403, 0x1801, 0x1802, 0x1803];

/// What a drive is configured with.
#[derive(Debug, Clone)]
pub(crate) struct Setup {
    /// What device it must be.
    pub(crate) identity: IdentityConfig,
    /// Its heartbeat (1017), ms.
    pub(crate) heartbeat_ms: u16,
    /// The node whose heartbeat it watches and the silence it bears (1016), ms.
    pub(crate) watched: (NodeId, u16),
    /// Communication cycle (60C2): value and power of ten of seconds.
    pub(crate) period: (u8, i8),
    /// Following error window (6065), increments.
    pub(crate) following_error: u32,
    /// How long the window may be left (6066), ms.
    pub(crate) following_error_ms: u16,
    /// Deceleration of the quick-stop ramp (6085), increments/s²: the drive's own unit of acceleration (6097, 60AA) is taken
    /// to be that.
    pub(crate) quick_stop_deceleration: u32,
    /// Software position limits (607D), increments.
    pub(crate) position_limits: [i32; 2],
}

/// What further tasks may depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Condition {
    /// There is a PDO of which that object is the COB-ID, and it is valid; it is kept as one that is not.
    Exchanged(ObjectAddress),
    /// The drive is in fault.
    InFault,
}

/// One thing to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Task {
    /// From here on the node is in that phase.
    Enter(BootPhase),
    /// Read the object; of `mask` it must show `value`, now or within a few repetitions.
    Expect { object: ObjectAddress, mask: u32, value: u32, otherwise: Cause },
    /// Read the object, which must be 0 where the drive has it.
    ExpectUnset { object: ObjectAddress, otherwise: Cause },
    /// Write the object, so many bytes.
    Write { object: ObjectAddress, value: u32, bytes: usize },
    /// Write the object, so many bytes, where the drive lets it.
    Offer { object: ObjectAddress, value: u32, bytes: usize },
    /// Read the object and keep its value.
    Keep(ObjectAddress),
    /// Write the value kept.
    WriteKept(ObjectAddress),
    /// Read what the condition is about; unless it holds, leave out that many tasks.
    If { condition: Condition, otherwise_skip: usize },
    /// Read the statusword, now or within a few repetitions without a fault.
    ExpectNoFault,
    /// Read the statusword, now or within a few repetitions of a drive without voltage.
    ExpectOff,
}

/// The tasks for a node, in their order.
pub(super) fn plan(node: NodeId, setup: &Setup) -> Vec<Task> {
    let mut tasks = vec![Task::Enter(BootPhase::Identifying)];
    tasks.extend(identify(&setup.identity));
    tasks.push(Task::Enter(BootPhase::CheckingPdos));
    tasks.extend(check_pdo(0x1400, Cob::Rpdo1(node), &Rpdo1::MAPPING));
    tasks.extend(check_pdo(0x1800, Cob::Tpdo1(node), &Tpdo1::MAPPING));
    tasks.push(Task::Enter(BootPhase::Configuring));
    tasks.extend(switch_off());
    tasks.extend(OTHER_PDOS.into_iter().flat_map(switch_off_pdo));
    tasks.push(NO_HOME_OFFSET);
    tasks.extend(configure(setup));
    // A drive may begin to follow its target with the mode, and may have moved by the end.
    tasks.extend(hold_position());
    tasks.extend(choose_mode());
    tasks.extend(reset_fault());
    tasks.extend(hold_position());
    tasks.push(Task::Enter(BootPhase::Configured));
    tasks
}

/// SDO exchanges that the tasks take at least: of a drive without a fault and other PDOs that answers as expected at
/// once.
pub(crate) fn exchanges(node: NodeId, setup: &Setup) -> usize {
    let tasks = plan(node, setup);
    let without = |task: &Task| match task {
        Task::Enter(_) => 1,
        Task::If { otherwise_skip, .. } => *otherwise_skip,
        _ => 0,
    };
    tasks.len() - tasks.iter().map(without).sum::<usize>()
}

/// Tasks for a drive of which the condition holds.
fn only_if<const N: usize>(condition: Condition, tasks: [Task; N]) -> impl Iterator<Item = Task> {
    [Task::If { condition, otherwise_skip: N }].into_iter().chain(tasks)
}

fn identify(identity: &IdentityConfig) -> impl Iterator<Item = Task> {
    [
        ((0x1000, 0), identity.device_type),
        ((0x1018, 1), identity.vendor_id),
        ((0x1018, 2), identity.product_code),
        ((0x1018, 3), identity.revision),
    ]
    .into_iter()
    .map(|((index, subindex), value)| Task::Expect {
        object: ObjectAddress::new(index, subindex),
        mask: u32::MAX,
        value,
        otherwise: Cause::WrongIdentity,
    })
}

/// COB-ID, transmission type, number of mapped objects and each of them.
fn check_pdo(communication: u16, cob: Cob, mapping: &[u32]) -> impl Iterator<Item = Task> {
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
    all.map(|(object, mask, value)| Task::Expect { object, mask, value, otherwise: Cause::WrongPdo })
}

/// Somebody else may have left the drive enabled, and a reset of the communication leaves it so. It comes to rest along
/// its ramp where it lets that be chosen, and along another where not.
const fn switch_off() -> [Task; 3] {
    let quick_stop = Task::Offer { object: QUICK_STOP_OPTION, value: RAMP_THEN_OFF, bytes: 2 };
    [quick_stop, control(Controlword::QUICK_STOP), Task::ExpectOff]
}

const fn control(word: Controlword) -> Task {
    Task::Write { object: ObjectAddress::new(0x6040, 0), value: word.0 as u32, bytes: 2 }
}

fn switch_off_pdo(communication: u16) -> impl Iterator<Item = Task> {
    let cob_id = ObjectAddress::new(communication, 1);
    only_if(Condition::Exchanged(cob_id), [Task::WriteKept(cob_id)])
}

fn configure(setup: &Setup) -> [Task; 12] {
    let (watched, silence_ms) = setup.watched;
    let (value, exponent) = setup.period;
    let [lowest, highest] = setup.position_limits;
    let write = |(index, subindex, value, bytes)| Task::Write {
        object: ObjectAddress::new(index, subindex),
        value,
        bytes,
    };
    [
        (0x1017, 0, u32::from(setup.heartbeat_ms), 2),
        (0x1016, 1, u32::from(watched.get()) << 16 | u32::from(silence_ms), 4),
        (0x6007, 0, LINK_LOSS_QUICK_STOP, 2),
        (0x605A, 0, RAMP_THEN_OFF, 2),
        (0x6085, 0, setup.quick_stop_deceleration, 4),
        (0x6065, 0, setup.following_error, 4),
        (0x6066, 0, u32::from(setup.following_error_ms), 2),
        // Wide at first: drives refuse limits that cross, and nobody knows where the old ones are.
        (0x607D, 1, i32::MIN as u32, 4),
        (0x607D, 2, highest as u32, 4),
        (0x607D, 1, lowest as u32, 4),
        (0x60C2, 1, u32::from(value), 1),
        (0x60C2, 2, u32::from(exponent as u8), 1),
    ]
    .map(write)
}

const fn choose_mode() -> [Task; 2] {
    [
        Task::Write { object: ObjectAddress::new(0x6060, 0), value: CYCLIC_POSITION, bytes: 1 },
        Task::Expect {
            object: ObjectAddress::new(0x6061, 0),
            mask: u32::MAX,
            value: CYCLIC_POSITION,
            otherwise: Cause::NotAccepted,
        },
    ]
}

/// A fault that is only remembered is reset by an edge; one that persists is reported with its code.
fn reset_fault() -> impl Iterator<Item = Task> {
    let tasks = [
        Task::Keep(ObjectAddress::new(0x603F, 0)),
        control(Controlword::DISABLE_VOLTAGE),
        control(Controlword::FAULT_RESET),
        control(Controlword::DISABLE_VOLTAGE),
        Task::ExpectNoFault,
    ];
    only_if(Condition::InFault, tasks)
}

/// 607A := 6064, so that nothing jumps when the drive is enabled.
const fn hold_position() -> [Task; 2] {
    [Task::Keep(ObjectAddress::new(0x6064, 0)), Task::WriteKept(ObjectAddress::new(0x607A, 0))]
}

#[cfg(test)]
mod tests {
    use masseter_shared::config::Scenario;

    use super::*;
    use crate::expectation::setup;

    #[test]
    fn software_limits_never_cross_while_they_are_written_whatever_they_were() {
        let id = NodeId::new(1).unwrap();
        let setup = Setup { position_limits: [-10, 20], ..setup(&Scenario::default(), 0) };
        for mut limits in [[-500, -400], [-10, 20], [400, 500], [i32::MIN, i32::MAX], [0, 0]] {
            for task in plan(id, &setup) {
                if let Task::Write { object, value, .. } = task
                    && object.index == 0x607D
                {
                    limits[usize::from(object.subindex) - 1] = value as i32;
                    assert!(limits[0] <= limits[1], "{limits:?}");
                }
            }
            assert_eq!(limits, setup.position_limits);
        }
    }
}
