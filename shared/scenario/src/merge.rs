//! Replacement of values by tables: over a kind of the rig, over the file of a robot, and over a scenario. The values
//! are not checked here.

use std::{collections::BTreeMap, path::Path};

use serde::Deserialize;
use serde::de::{DeserializeOwned, Error};
use toml::{Table, Value, de::Error as TomlError};

use super::error::ScenarioError;
use crate::wording::listed;

/// The lists whose entries have names.
pub(super) const LISTS: [&str; 3] = ["faults", "stimulus", "require"];
/// The tables that describe a robot, not its use. All scenarios with its file in `robot` share these tables.
const TABLES: [&str; 7] = ["mechanism", "jaw", "limits", "can", "drives", "drive_profile", "dynamics"];

/// Replaces the given values, and leaves the other values of their tables. A table of another `kind` replaces the whole
/// table. A table given for a list changes the entries of the list by their names.
///
/// # Errors
/// For the name of an entry that a list does not have.
pub(super) fn merge(whole: &mut Table, given: Table) -> Result<(), String> {
    for (key, value) in given {
        match (whole.get_mut(&key), value) {
            (Some(Value::Table(inner)), Value::Table(given)) if is_of_one_kind(inner, &given) => {
                merge(inner, given)?;
            }
            (Some(Value::Array(list)), Value::Table(given)) => merge_entries(&key, list, given)?,
            (_, value) => {
                whole.insert(key, value);
            }
        }
    }
    Ok(())
}

fn is_of_one_kind(whole: &Table, given: &Table) -> bool {
    given.get("kind").is_none_or(|kind| whole.get("kind") == Some(kind))
}

/// Changes entries of a list, such as `faults`, by their names.
fn merge_entries(list_name: &str, list: &mut [Value], given: Table) -> Result<(), String> {
    for (name, value) in given {
        let names: Vec<_> = list.iter().filter_map(entry_name).map(str::to_owned).collect();
        let named = list.iter_mut().find(|entry| entry_name(entry) == Some(&name));
        match (named, value) {
            (Some(Value::Table(entry)), Value::Table(given)) => merge(entry, given)?,
            (Some(_), _) => return Err(format!("{list_name}.{name} is a table; name one of its keys")),
            (None, _) if names.is_empty() => return Err(format!("{list_name} has no entry")),
            (None, _) => {
                return Err(format!("{list_name} has no entry '{name}'; there are: {}", names.join(", ")));
            }
        }
    }
    Ok(())
}

/// The name of an entry; without one, that of its kind.
fn entry_name(entry: &Value) -> Option<&str> {
    let entry = entry.as_table()?;
    ["name", "kind"].into_iter().find_map(|key| entry.get(key)?.as_str())
}

/// The kinds of one sort of table: names, and TOML texts with their values. The first is that of a table without a `kind`.
pub(super) type Kinds = [(&'static str, &'static str)];

/// A given table. In the manifest's JSON an absent key is null.
#[derive(Deserialize)]
#[serde(transparent)]
pub(super) struct Given(BTreeMap<String, Option<GivenValue>>);

#[derive(Deserialize)]
#[serde(untagged)]
enum GivenValue {
    Table(Given),
    Value(Value),
}

impl Given {
    /// The values of its kind, replaced by the given values.
    pub(super) fn over<T: DeserializeOwned>(self, kinds: &Kinds) -> Result<T, TomlError> {
        over_kind(kinds, self.into_table())
    }

    fn into_table(self) -> Table {
        let value = |given| match given {
            GivenValue::Table(table) => Value::Table(table.into_table()),
            GivenValue::Value(value) => value,
        };
        self.0.into_iter().filter_map(|(key, given)| Some((key, value(given?)))).collect()
    }
}

/// The values of the table's kind, replaced by the other values of the table.
pub(super) fn over_kind<T: DeserializeOwned>(kinds: &Kinds, given: Table) -> Result<T, TomlError> {
    let kind = given.get("kind").and_then(Value::as_str).unwrap_or(kinds[0].0);
    let Some((_, text)) = kinds.iter().find(|(name, _)| *name == kind) else {
        let names = listed(kinds.iter().map(|(name, _)| name));
        return Err(TomlError::custom(format!("there is no kind '{kind}'; use {names}")));
    };
    let mut whole: Table = toml::from_str(text).expect("the rig's kinds are TOML");
    merge(&mut whole, given).map_err(TomlError::custom)?;
    whole.try_into()
}

/// The tables of the robot's file at `path`. Their paths are relative to its folder.
pub(super) fn robot_tables(path: &Path, given: Table) -> Result<Table, ScenarioError> {
    if let Some(other) = given.keys().find(|key| !TABLES.contains(&key.as_str())) {
        let reason = format!("{other} does not describe a robot; a robot's file has {}", TABLES.join(", "));
        return Err(ScenarioError::malformed_file(path, reason));
    }
    Ok(with_absolute_paths(path.parent().unwrap_or(Path::new("")), given))
}

/// The tables of a scenario's file in this folder, with paths that do not depend on the folder.
pub(super) fn with_absolute_paths(folder: &Path, mut given: Table) -> Table {
    const FILES: [[&str; 2]; 4] =
        [["drives", "memory"], ["motion", "path"], ["drive_profile", "dcf"], ["stimulus", "push_table"]];
    given.get_mut("robot").into_iter().for_each(|file| make_absolute(folder, file));
    for [name, key] in FILES {
        let of =
            |table: &mut Value| table.get_mut(key).into_iter().for_each(|file| make_absolute(folder, file));
        match given.get_mut(name) {
            Some(Value::Array(list)) => list.iter_mut().for_each(of),
            Some(table) => of(table),
            None => {}
        }
    }
    given
}

/// Moves the lists of an included file behind those of the scenario. The scenario's entries keep their numbers.
pub(super) fn append_lists(given: &mut Table, included: &mut Table) {
    for list in LISTS.into_iter().chain(["tags"]) {
        let Some(Value::Array(more)) = included.remove(list) else { continue };
        let own = given.entry(list).or_insert_with(|| Value::Array(Vec::new()));
        own.as_array_mut().into_iter().for_each(|own| own.extend(more.iter().cloned()));
    }
}

/// Makes a file's path independent of its folder.
fn make_absolute(folder: &Path, file: &mut Value) {
    if let Some(name) = file.as_str() {
        let whole = folder.join(name);
        let whole = std::path::absolute(&whole).unwrap_or(whole);
        *file = Value::from(whole.to_string_lossy().into_owned());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn merged(whole: &str, given: &str) -> Result<Table, String> {
        let mut whole: Table = toml::from_str(whole).unwrap();
        merge(&mut whole, toml::from_str(given).unwrap())?;
        Ok(whole)
    }

    #[test]
    fn an_entry_of_a_list_is_changed_by_its_name_or_kind() {
        let list =
            "[[faults]]\nkind = 'lose'\nat_s = 1.0\n[[faults]]\nkind = 'lose'\nname = 'late'\nat_s = 2.0";
        let whole = merged(list, "faults.late.at_s = 3.0").unwrap();
        assert_eq!(whole["faults"][0]["at_s"].as_float(), Some(1.0));
        assert_eq!(whole["faults"][1]["at_s"].as_float(), Some(3.0));
        assert_eq!(
            merged(list, "faults.lose.at_s = 3.0").unwrap()["faults"][0]["at_s"].as_float(),
            Some(3.0)
        );
        assert_eq!(
            merged(list, "faults.x.at_s = 3.0").unwrap_err(),
            "faults has no entry 'x'; there are: lose, late"
        );
        assert_eq!(merged("faults = []", "faults.x.at_s = 3.0").unwrap_err(), "faults has no entry");
    }

    #[test]
    fn lists_of_an_included_file_come_behind_and_its_paths_are_of_its_folder() {
        let mut given: Table = toml::from_str("tags = ['own']\n[[require]]\nname = 'a'").unwrap();
        let included = "robot = 'robot.toml'\ntags = ['of all']\nmotion = { kind = 'file', path = 'jaw.csv' }\n\
                        [[require]]\nname = 'b'\n[[stimulus]]\npush_table = '/push.csv'";
        let mut included = with_absolute_paths(Path::new("/common"), toml::from_str(included).unwrap());
        append_lists(&mut given, &mut included);
        assert_eq!(given["tags"].as_array().unwrap().len(), 2);
        assert_eq!(given["require"][1]["name"].as_str(), Some("b"));
        assert_eq!(given["stimulus"][0]["push_table"].as_str(), Some("/push.csv"));
        assert_eq!(included["robot"].as_str(), Some("/common/robot.toml"));
        assert_eq!(included["motion"]["path"].as_str(), Some("/common/jaw.csv"));
        assert!(!included.contains_key("require"));
    }

    #[test]
    fn a_table_of_another_kind_is_replaced_whole() {
        let motion = "[motion]\nkind = 'chewing'\nopening_mm = 20.0";
        let other = merged(motion, "motion = { kind = 'opening' }").unwrap();
        assert_eq!(other["motion"].as_table().unwrap().len(), 1);
        let same = merged(motion, "motion.kind = 'chewing'").unwrap();
        assert_eq!(same["motion"]["opening_mm"].as_float(), Some(20.0));
    }
}
