//! The plan of a drive's boot: a list of SDO steps, made once for each drive.
//!
//! No write comes before the checks of the drive's identity and PDOs, and the first write stops the drive.
//! [`WantedDrive`] decides the values of the objects. The plan executes nothing; the [boot](super::boot) executes the
//! plan.

use masseter_can::{canopen::ObjectAddress, cia402::Controlword};
use masseter_runtime::messages::codes::{BootPhase, Cause};
use masseter_scenario::{AccelerationUnit, ObjectKey, ObjectRule};

use crate::master::wanted::{
    PdoSetting, Setting, WantedDrive, WantedIdentity, may_keep, shown_bits, value_bits,
};

/// 6041h.
const STATUSWORD: ObjectAddress = ObjectAddress::new(0x6041, 0);
/// 6060h and 6061h: cyclic synchronous position.
const CYCLIC_POSITION: u32 = 8;
/// 607Ah := 6064h, so that the axis does not jump at the enabling of the drive.
const HOLD_POSITION: [Step; 2] =
    [Step::Read(ObjectAddress::new(0x6064, 0), Check::Keep), Step::WriteKept(ObjectAddress::new(0x607A, 0))];

/// One step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum Step {
    /// The drive enters a phase.
    Enter(BootPhase),
    /// Read the object and check its value.
    Read(ObjectAddress, Check),
    /// Write to the object, and read it back.
    Write(Write),
    /// The same with the kept value.
    WriteKept(ObjectAddress),
}

/// A value for an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) struct Write {
    pub(super) object: ObjectAddress,
    pub(super) value: u32,
    pub(super) bytes: usize,
    pub(super) demand: Demand,
}

/// The required effect of a write. A drive that acknowledges a value without keeping it is never enabled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum Demand {
    /// The drive has the value. A constant object may have the value already.
    Kept,
    /// The drive has the value, or lacks the object.
    KeptIfPresent,
    /// The drive may refuse the value, and then keeps its own value.
    KeptIfTaken,
    /// No effect: the write only makes room for a later write of the same object, which counts.
    Nothing,
}

impl Write {
    /// The bits of the object that must equal those of the value afterwards; none for a proof in a later step.
    pub(super) fn shown_bits(&self) -> Option<u32> {
        let Self { object, value, bytes, demand } = *self;
        if demand == Demand::Nothing { None } else { shown_bits(object, value, bytes) }
    }
}

/// The use of a value that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(super) enum Check {
    /// The bits of `mask` must be those of `value`, now or after repetitions.
    Equals { mask: u32, value: u32, otherwise: Cause },
    /// The object must have that value; for a drive without the object the value must be 0.
    EqualsIfPresent { value: u32, otherwise: Cause },
    /// A unit of acceleration: this unit, or a code unknown to the rig. Drives may lack the object, or use other codes.
    Unit(AccelerationUnit),
    /// The boot keeps the value.
    Keep,
    /// A statusword: without a fault, now or after repetitions.
    NoFault,
    /// The error code of a fault, for which the drive is given up.
    FaultRefused,
    /// A statusword: without voltage, now or after repetitions.
    NoVoltage,
    /// A statusword: skip that many steps for a drive without a fault.
    FaultElseSkip(usize),
    /// A COB-ID, kept and marked as invalid: unless it is that of a valid PDO, skip that many steps.
    PdoElseSkip(usize),
}

/// The steps for a drive, in their order. A fault ends the boot, or is reset.
pub(super) fn plan(wanted: &WantedDrive, resets_faults: bool) -> Vec<Step> {
    let mut steps = vec![Step::Enter(BootPhase::Identifying)];
    steps.extend(wanted.identity.iter().map(|&wanted| compare(wanted, Cause::WrongIdentity)));
    steps.push(Step::Enter(BootPhase::CheckingPdos));
    let pdos = wanted.pdos.iter().flat_map(PdoSetting::compared);
    steps.extend(pdos.map(|entry| compare(entry, Cause::WrongPdo)));
    steps.push(Step::Enter(BootPhase::Configuring));
    // Another master may have left the drive enabled, and a reset of the communication does not change that. The drive
    // stops along its quick-stop ramp, if it allows that option.
    let is_written = |wanted: &&Setting| wanted.object.0.index == 0x605A && wanted.rule != ObjectRule::Expect;
    if let Some(&Setting { object: ObjectKey(object), value, bytes, .. }) =
        wanted.objects.iter().find(is_written)
    {
        steps.push(Step::Write(Write { object, value, bytes, demand: Demand::Nothing }));
    }
    steps.extend([control(Controlword::QUICK_STOP), Step::Read(STATUSWORD, Check::NoVoltage)]);
    for other in wanted.pdos.iter().filter(|pdo| pdo.layout.is_none()) {
        steps.extend([Step::Read(other.part(1), Check::PdoElseSkip(1)), Step::WriteKept(other.part(1))]);
    }
    // Software position limits count from the home position. With another home offset they are not those of the rig.
    if wanted.home.rule != ObjectRule::Absent {
        let check = Check::EqualsIfPresent { value: wanted.home.value, otherwise: Cause::HomeOffset };
        steps.push(Step::Read(wanted.home.object.0, check));
    }
    steps.push(Step::Read(ObjectAddress::new(0x60AA, 0), Check::Unit(wanted.acceleration_unit)));
    steps.extend(configure(&wanted.objects));
    // A drive may begin to follow its target with the mode, and may move before the last step.
    steps.extend(HOLD_POSITION);
    steps.push(write(0x6060, 0, CYCLIC_POSITION, 1));
    let mode = WantedIdentity::new(0x6061, 0, u32::MAX, CYCLIC_POSITION);
    steps.push(compare(mode, Cause::NotAccepted));
    // A person has to look at a fault, so the boot resets a fault only on request: by an edge, if its cause is gone.
    let error_code = ObjectAddress::new(0x603F, 0);
    let with_fault = if resets_faults {
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

/// The least number of SDO exchanges of a drive's boot. Such a drive has no fault and no other PDOs, gives the expected
/// answers at once, and takes every value.
pub(crate) fn shortest_boot(wanted: &WantedDrive) -> usize {
    let steps = plan(wanted, false);
    let (mut exchanges, mut rest) = (0, steps.iter());
    while let Some(step) = rest.next() {
        exchanges += match step {
            Step::Enter(_) => 0,
            Step::Read(_, Check::FaultElseSkip(skipped) | Check::PdoElseSkip(skipped)) => {
                rest.nth(skipped - 1);
                1
            }
            Step::Read(..) => 1,
            Step::Write(write) => 1 + usize::from(write.shown_bits().is_some()),
            Step::WriteKept(_) => 2,
        };
    }
    exchanges
}

const fn compare(WantedIdentity { object, mask, value }: WantedIdentity, otherwise: Cause) -> Step {
    Step::Read(object, Check::Equals { mask, value, otherwise })
}

const fn write(index: u16, subindex: u8, value: u32, bytes: usize) -> Step {
    let object = ObjectAddress::new(index, subindex);
    Step::Write(Write { object, value, bytes, demand: Demand::Kept })
}

const fn control(word: Controlword) -> Step {
    write(0x6040, 0, word.0 as u32, 2)
}

/// Writes and comparisons of the objects. Drives refuse software limits that cross, and the old limits are unknown, so
/// the lower limit is opened first.
fn configure(objects: &[Setting]) -> Vec<Step> {
    let mut steps = Vec::with_capacity(objects.len() + 1);
    let is_lower_written = |wanted: &Setting| {
        wanted.object.0 == ObjectAddress::new(0x607D, 1) && wanted.rule != ObjectRule::Expect
    };
    for &Setting { object: ObjectKey(object), value, bytes, rule, .. } in objects {
        if object == ObjectAddress::new(0x607D, 2) && objects.iter().any(is_lower_written) {
            let (object, value) = (ObjectAddress::new(0x607D, 1), i32::MIN as u32);
            steps.push(Step::Write(Write { object, value, bytes: 4, demand: Demand::Nothing }));
        }
        steps.push(if rule == ObjectRule::Expect {
            compare(WantedIdentity { object, mask: value_bits(bytes), value }, Cause::WrongObject)
        } else {
            Step::Write(Write { object, value, bytes, demand: demand(rule, object) })
        });
    }
    steps
}

fn demand(rule: ObjectRule, object: ObjectAddress) -> Demand {
    match rule {
        _ if may_keep(rule, object) => Demand::KeptIfTaken,
        ObjectRule::Optional => Demand::KeptIfPresent,
        _ => Demand::Kept,
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::NodeId;
    use masseter_scenario::Scenario;

    use super::*;

    #[test]
    fn software_limits_never_cross_while_they_are_written_whatever_they_were() {
        let id = NodeId::new(1).unwrap();
        let mut scenario = Scenario::default();
        let increment_m = scenario.drives.of_axis(0).encoder_resolution_m;
        scenario.mechanism.strokes.slide_m = [-10.0, 20.0].map(|increments| increments * increment_m);
        let wanted = WantedDrive::of_axis(&scenario, 0, id).unwrap();
        for mut limits in [[-500, -400], [-10, 20], [400, 500], [i32::MIN, i32::MAX], [0, 0]] {
            for step in plan(&wanted, false) {
                if let Step::Write(Write { object, value, .. }) = step
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
