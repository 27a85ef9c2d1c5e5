//! Which objects the process data carry.

use masseter_can::canopen::ObjectAddress;
use masseter_can::{PdoMapping, PdoMappingError};

use super::object::ObjectKey;
use crate::error::ScenarioError;

section! {
    /// The objects of the process data in their order. RPDO1 may also carry the torque offset (60B2h).
    pub struct PdosConfig {
        /// Objects of RPDO1.
        pub rpdo1: Vec<ObjectKey> = keys(&PdoMapping::RPDO1),
        /// Objects of TPDO1.
        pub tpdo1: Vec<ObjectKey> = keys(&PdoMapping::TPDO1),
    }
}

fn keys(mapping: &PdoMapping) -> Vec<ObjectKey> {
    mapping.entries().iter().map(|entry| ObjectKey(ObjectAddress::new((entry >> 16) as u16, 0))).collect()
}

type Constructor = fn(&[ObjectAddress]) -> Result<PdoMapping, PdoMappingError>;

fn mapping(keys: &[ObjectKey], of: Constructor) -> Result<PdoMapping, PdoMappingError> {
    of(&keys.iter().map(|&ObjectKey(object)| object).collect::<Vec<_>>())
}

impl PdosConfig {
    /// The mapping of RPDO1; the usual one where the objects are not valid.
    pub fn rpdo1(&self) -> PdoMapping {
        mapping(&self.rpdo1, PdoMapping::rpdo1).unwrap_or(PdoMapping::RPDO1)
    }

    /// The mapping of TPDO1; the usual one where the objects are not valid.
    pub fn tpdo1(&self) -> PdoMapping {
        mapping(&self.tpdo1, PdoMapping::tpdo1).unwrap_or(PdoMapping::TPDO1)
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let places: [(_, _, Constructor); 2] = [
            ("drive_profile.pdos.rpdo1", &self.rpdo1, PdoMapping::rpdo1),
            ("drive_profile.pdos.tpdo1", &self.tpdo1, PdoMapping::tpdo1),
        ];
        for (key, objects, of) in places {
            let shown = objects.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
            mapping(objects, of).map_err(|error| ScenarioError::bad(key, &shown, error.to_string()))?;
        }
        Ok(())
    }
}
