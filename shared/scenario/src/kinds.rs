//! Tables over a kind: a `kind` names values that come with the rig, and the other keys of the table replace them.

use std::collections::BTreeMap;

use serde::de::{DeserializeOwned, Error};
use serde::{Deserialize, Deserializer};
use toml::Table;
use toml::de::Error as TomlError;

use super::merge::merge;

/// The kinds of one sort of table: names, and TOML texts with their values. The first is that of a table without a `kind`.
pub(super) type Kinds = [(&'static str, &'static str)];

/// A table as it is given. In the manifest's JSON a key that is not given is null.
#[derive(Deserialize)]
#[serde(transparent)]
pub(super) struct Given(BTreeMap<String, Option<GivenValue>>);

#[derive(Deserialize)]
#[serde(untagged)]
enum GivenValue {
    Table(Given),
    Value(toml::Value),
}

impl Given {
    /// The values of its kind, replaced by those that are given.
    pub(super) fn over<T: DeserializeOwned>(self, kinds: &Kinds) -> Result<T, TomlError> {
        over_kind(kinds, self.into_table())
    }

    fn into_table(self) -> Table {
        let value = |given| match given {
            GivenValue::Table(table) => toml::Value::Table(table.into_table()),
            GivenValue::Value(value) => value,
        };
        self.0.into_iter().filter_map(|(key, given)| Some((key, value(given?)))).collect()
    }
}

/// Reads a table that may be absent.
pub(super) fn over_kind_if_given<'de, T: DeserializeOwned, D: Deserializer<'de>>(
    kinds: &Kinds,
    table: D,
) -> Result<Option<T>, D::Error> {
    let given = Option::<Given>::deserialize(table)?;
    given.map(|given| given.over(kinds)).transpose().map_err(D::Error::custom)
}

/// The values of the kind that a table names, replaced by the other values of the table.
pub(super) fn over_kind<T: DeserializeOwned>(kinds: &Kinds, given: Table) -> Result<T, TomlError> {
    let kind = given.get("kind").and_then(toml::Value::as_str).unwrap_or(kinds[0].0);
    let Some((_, text)) = kinds.iter().find(|(name, _)| *name == kind) else {
        let names = kinds.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
        return Err(TomlError::custom(format!("there is no kind '{kind}'; use {names}")));
    };
    let mut whole: Table = toml::from_str(text).expect("the rig's kinds are TOML");
    merge(&mut whole, given).map_err(TomlError::custom)?;
    whole.try_into()
}
