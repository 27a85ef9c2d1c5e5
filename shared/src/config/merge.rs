//! Merging of TOML tables.

use toml::{Table, Value};

/// Replaces the values that are given, and leaves the others of their tables.
pub(super) fn merge(whole: &mut Table, given: Table) {
    for (key, value) in given {
        match (whole.get_mut(&key), value) {
            (Some(Value::Table(inner)), Value::Table(given)) => merge(inner, given),
            (_, value) => {
                whole.insert(key, value);
            }
        }
    }
}
