//! Kinds of drives whose profiles come with the rig.

use serde::de::Error;
use serde::{Deserialize, Deserializer};

use super::DriveProfile;
use crate::kinds::Given;

/// The kinds with their profiles.
const KINDS: [(&str, &str); 3] =
    [("emulated", ""), ("epos4", include_str!("kinds/epos4.toml")), ("n5", include_str!("kinds/n5.toml"))];

/// Reads profiles: what a table has replaces the values of its kind.
pub(crate) fn over_kinds<'de, D: Deserializer<'de>>(list: D) -> Result<Vec<DriveProfile>, D::Error> {
    let tables = Vec::<Given>::deserialize(list)?;
    tables.into_iter().map(|table| table.over(&KINDS).map_err(D::Error::custom)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinds::over_kind;

    #[test]
    fn every_kind_has_its_own_name_and_a_source() {
        for (name, _) in KINDS {
            let table = format!("kind = '{name}'\nunits.lead_m = 0.005").parse().unwrap();
            let profile: DriveProfile = over_kind(&KINDS, table).unwrap();
            assert_eq!(profile.kind, name);
            assert!(!profile.source.is_empty());
            DriveProfile::validate_all(&[profile]).unwrap();
        }
    }
}
