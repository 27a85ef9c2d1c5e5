//! One object of a drive as the rig needs it.

use masseter_can::canopen::ObjectAddress;
use masseter_shared::config::ObjectRule;

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

/// Offsets of position, velocity and torque, with the bytes of each. A drive keeps the last value of its process data.
pub(crate) const OFFSETS: [(u16, usize); 3] = [(0x60B0, 4), (0x60B1, 4), TORQUE_OFFSET];
/// The only offset that process data of the rig may carry.
pub(super) const TORQUE_OFFSET: (u16, usize) = (0x60B2, 2);

/// Whether a drive that has an object may keep another value. An offset moves the axis or loads it: the drive may lack
/// it, and no more.
pub(crate) fn may_keep(rule: ObjectRule, object: ObjectAddress) -> bool {
    rule == ObjectRule::Optional && OFFSETS.iter().all(|(index, _)| *index != object.index)
}
