//! What the master compares before it exchanges process data: the identity of a drive, and its PDOs.

use masseter_can::canopen::{Cob, CobId, NodeId, ObjectAddress};
use masseter_can::{CanId, EVERY_SYNC, PdoMapping};
use masseter_scenario::DriveProfile;

/// COB-ID without the bit for remote requests, which the master does not send.
pub(crate) const COB_ID_BITS: u32 = !CobId::NO_REMOTE_REQUEST;
/// Communication parameters of the other PDOs with identifiers of CiA 301. Many drives send them as delivered, but the
/// plan of the bus does not include them.
pub(crate) const OTHER_PDOS: [u16; 6] = [0x1401, 0x1402, 0x1403, 0x1801, 0x1802, 0x1803];

/// A value of the identity: the bits of `mask` must be equal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WantedIdentity {
    /// Its address.
    pub object: ObjectAddress,
    /// Bits that count.
    pub mask: u32,
    /// The value.
    pub value: u32,
}

/// A PDO as the rig exchanges it: sent or taken with every SYNC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WantedPdo {
    /// Index of its communication parameter; that of its mapping is 200h higher.
    pub communication: u16,
    /// Its COB-ID.
    pub cob_id: u32,
    /// The mapped objects: index, sub-index, bits.
    pub mapping: PdoMapping,
}

/// The identity of a drive with this profile.
pub(super) fn identity(profile: &DriveProfile) -> [WantedIdentity; 4] {
    let identity = &profile.identity;
    let value = |index, subindex, value, mask| WantedIdentity {
        object: ObjectAddress::new(index, subindex),
        mask,
        value,
    };
    [
        value(0x1000, 0, identity.device_type, u32::MAX),
        value(0x1018, 1, identity.vendor_id, u32::MAX),
        value(0x1018, 2, identity.product_code, identity.product_mask),
        value(0x1018, 3, identity.revision, identity.revision_mask),
    ]
}

/// The PDOs of a node with this profile.
pub(super) fn pdos(profile: &DriveProfile, node: NodeId) -> [WantedPdo; 2] {
    let pdo = |communication, cob: Cob, mapping| {
        let cob_id = CanId::from(cob).number();
        WantedPdo { communication, cob_id, mapping }
    };
    [pdo(0x1400, Cob::Rpdo1(node), profile.pdos.rpdo1()), pdo(0x1800, Cob::Tpdo1(node), profile.pdos.tpdo1())]
}

impl WantedPdo {
    /// Every object of the PDO with the bits that count and their value, in the order in which the master compares them.
    pub fn entries(&self) -> impl Iterator<Item = WantedIdentity> {
        let Self { communication, cob_id, .. } = *self;
        let mapping = self.mapping.entries();
        let entry = |index, subindex, mask, value| WantedIdentity {
            object: ObjectAddress::new(index, subindex),
            mask,
            value,
        };
        let head = [
            entry(communication, 1, COB_ID_BITS, cob_id),
            entry(communication, 2, u32::MAX, u32::from(EVERY_SYNC)),
            entry(communication + 0x200, 0, u32::MAX, mapping.len() as u32),
        ];
        let mapped = (1..).zip(mapping);
        head.into_iter()
            .chain(mapped.map(move |(place, &object)| entry(communication + 0x200, place, u32::MAX, object)))
    }
}
