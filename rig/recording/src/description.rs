//! What the comments of a message definition say of its fields: units, meanings, and the names of codes.
//!
//! A comment is `[unit] Meaning. 0 = one_name, 1 = other_name`, of which each part may be missing.

use std::collections::BTreeMap;

/// What a comment says of a field.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Description {
    /// The unit of its values; empty where they have none.
    pub unit: String,
    /// What it is.
    pub meaning: String,
    /// The names of its values by their numbers; empty where it is no enumeration.
    pub codes: BTreeMap<u64, String>,
}

impl Description {
    /// The descriptions of a definition's fields by their names; empty where there is no comment.
    pub fn of_fields(definition: &str) -> BTreeMap<String, Self> {
        let of_line = |line: &str| {
            let (field, comment) = line.split_once('#').unwrap_or((line, ""));
            Some((field.split_whitespace().nth(1)?.to_owned(), Self::parse(comment.trim())))
        };
        definition.lines().filter_map(of_line).collect()
    }

    fn parse(comment: &str) -> Self {
        let unit = comment.strip_prefix('[').and_then(|rest| rest.split_once("] "));
        let (unit, text) = unit.unwrap_or(("", comment));
        let listed = text.rsplit_once(". ").and_then(|(meaning, list)| Some((meaning, codes(list)?)));
        match listed {
            Some((meaning, codes)) => Self { unit: unit.to_owned(), meaning: format!("{meaning}."), codes },
            None => Self { unit: unit.to_owned(), meaning: text.to_owned(), codes: BTreeMap::new() },
        }
    }
}

/// The names of `0 = one_name, 1 = other_name`.
fn codes(list: &str) -> Option<BTreeMap<u64, String>> {
    let code = |part: &str| {
        let (number, name) = part.split_once(" = ")?;
        Some((number.parse().ok()?, name.to_owned()))
    };
    list.split(", ").map(code).collect()
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::codes::{Cause, DriveState};
    use masseter_runtime::messages::{Event, Message, Reading};

    use super::*;

    #[test]
    fn the_table_of_messages_is_found_again_in_its_comments() {
        let reading = Description::of_fields(&Reading::definition());
        assert_eq!(reading.len(), Reading::fields().len());
        assert_eq!(reading["position_m"].unit, "m");
        assert_eq!(reading["position_m"].meaning, "Encoder positions d₁ d₂ d₃ l₁ l₂ l₃, m.");
        assert_eq!(reading["drive_state"].codes[&u64::from(DriveState::Fault.code())], "fault");
        assert!(reading["cycle"].codes.is_empty() && reading["cycle"].unit.is_empty());
        assert_eq!(Description::of_fields(&Event::definition())["cause"].codes.len(), Cause::ALL.len());
    }

    #[test]
    fn parts_of_a_comment_may_be_missing() {
        let found = Description::of_fields("# Any message.\nfloat64 gain  # [1/s] Gain\nuint8 bare\n");
        let gain = Description { unit: "1/s".into(), meaning: "Gain".into(), codes: BTreeMap::new() };
        assert_eq!((&found["gain"], &found["bare"]), (&gain, &Description::default()));
    }
}
