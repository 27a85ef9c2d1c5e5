//! One object of a drive as the rig needs it.

use masseter_can::canopen::{AbortCode, CobId, ObjectAddress};
use masseter_scenario::ObjectRule;

use super::process_data::COB_ID_BITS;

/// One object as it must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WantedObject {
    /// Its address.
    pub object: ObjectAddress,
    /// Its value, as the lowest bytes in the drive's order.
    pub value: u32,
    /// Bytes of the value.
    pub bytes: usize,
    /// What the master does with it; never [`ObjectRule::Absent`].
    pub rule: ObjectRule,
    /// The key of the scenario that decides the value.
    pub key: &'static str,
}

impl WantedObject {
    /// Whether a drive that refuses to show a written object with this code proves the write by its acknowledgement alone.
    /// Nothing else can prove it: nobody can read a write-only object.
    pub(crate) fn is_write_only(code: AbortCode) -> bool {
        code == AbortCode::WRITE_ONLY
    }
}

/// Objects that do not show what was written to them, with what proves the write instead.
const SHOWN_ELSEWHERE: [(u16, &str); 4] = [
    (0x1010, "a signature starts the saving, and a reset shows what was saved"),
    (0x1011, "as 1010h"),
    (0x6040, "a command, whose effect the statusword (6041h) shows"),
    (0x6060, "drives after DSP 402 2.0 do not show it; 6061h shows the mode"),
];

/// The bits of an object that must be those that were written to it; none where something else proves the write.
pub(crate) fn shown_bits(object: ObjectAddress, value: u32, bytes: usize) -> Option<u32> {
    let is_cob_id = matches!(object.index, 0x1400..0x1600 | 0x1800..0x1A00) && object.subindex == 1;
    match SHOWN_ELSEWHERE.iter().find(|(index, _)| *index == object.index) {
        Some(_) => None,
        // The number of a PDO that does not exist means nothing.
        None if is_cob_id && !CobId(value).is_valid() => Some(CobId::NOT_VALID),
        // A drive decides itself whether it answers remote requests, which nobody sends.
        None if is_cob_id => Some(COB_ID_BITS),
        None => Some(u32::MAX >> (32 - 8 * bytes)),
    }
}

/// Offsets of position, velocity and torque, with the bytes of each. A drive keeps the last value of its process data.
pub(crate) const OFFSETS: [(u16, usize); 3] = [(0x60B0, 4), (0x60B1, 4), TORQUE_OFFSET];
/// The only offset that process data of the rig may carry.
pub(super) const TORQUE_OFFSET: (u16, usize) = (0x60B2, 2);

/// Whether a drive that has an object may keep another value. An offset moves the axis or loads it: the drive may lack
/// it, and no more.
pub(crate) fn may_keep(rule: ObjectRule, object: ObjectAddress) -> bool {
    rule == ObjectRule::Optional && OFFSETS.iter().all(|(index, _)| *index != object.index)
}
