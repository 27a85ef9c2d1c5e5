//! Merging of TOML tables.

use toml::{Table, Value};

/// Replaces the values that are given, and leaves the others of their tables. A table of another `kind` is replaced whole. A
/// table given for a list changes the entries of the list by their names.
///
/// # Errors
/// When a list has no entry of a name that is given for it.
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

/// The name of an entry; that of its kind where it has none.
fn entry_name(entry: &Value) -> Option<&str> {
    let entry = entry.as_table()?;
    ["name", "kind"].into_iter().find_map(|key| entry.get(key)?.as_str())
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
    fn a_table_of_another_kind_is_replaced_whole() {
        let motion = "[motion]\nkind = 'chewing'\nopening_mm = 20.0";
        let other = merged(motion, "motion = { kind = 'opening' }").unwrap();
        assert_eq!(other["motion"].as_table().unwrap().len(), 1);
        let same = merged(motion, "motion.kind = 'chewing'").unwrap();
        assert_eq!(same["motion"]["opening_mm"].as_float(), Some(20.0));
    }
}
