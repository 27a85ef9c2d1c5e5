//! Kinds of drives whose profiles come with the rig.

use std::collections::BTreeMap;

use serde::de::Error;
use serde::{Deserialize, Deserializer};
use toml::Table;

use super::DriveProfile;
use crate::config::merge::merge;

/// The kinds with their profiles.
const KINDS: [(&str, &str); 3] =
    [("emulated", ""), ("epos4", include_str!("kinds/epos4.toml")), ("n5", include_str!("kinds/n5.toml"))];

/// Reads profiles: what a table has replaces the values of its kind.
pub(in crate::config) fn over_kinds<'de, D: Deserializer<'de>>(
    list: D,
) -> Result<Vec<DriveProfile>, D::Error> {
    let tables = Vec::<BTreeMap<String, Option<Given>>>::deserialize(list)?;
    tables.into_iter().map(|table| over_kind(without_null(table)).map_err(D::Error::custom)).collect()
}

/// A value of TOML, or of the manifest's JSON, where a key that is not given is null.
#[derive(Deserialize)]
#[serde(untagged)]
enum Given {
    Table(BTreeMap<String, Option<Given>>),
    Value(toml::Value),
}

fn without_null(table: BTreeMap<String, Option<Given>>) -> Table {
    let value = |given| match given {
        Given::Table(table) => toml::Value::Table(without_null(table)),
        Given::Value(value) => value,
    };
    table.into_iter().filter_map(|(key, given)| Some((key, value(given?)))).collect()
}

fn over_kind(given: Table) -> Result<DriveProfile, toml::de::Error> {
    let kind = given.get("kind").and_then(toml::Value::as_str).unwrap_or(KINDS[0].0);
    let Some((_, text)) = KINDS.iter().find(|(name, _)| *name == kind) else {
        let names = KINDS.map(|(name, _)| name).join(", ");
        return Err(toml::de::Error::custom(format!("there is no kind '{kind}'; use {names}")));
    };
    let mut whole: Table = toml::from_str(text).expect("the rig's profiles are TOML");
    merge(&mut whole, given);
    whole.try_into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_its_own_name_and_a_source() {
        for (name, _) in KINDS {
            let table = format!("kind = '{name}'\nunits.lead_m = 0.005").parse().unwrap();
            let profile = over_kind(table).unwrap();
            assert_eq!(profile.kind, name);
            assert!(!profile.source.is_empty());
            DriveProfile::validate_all(&[profile]).unwrap();
        }
    }
}
