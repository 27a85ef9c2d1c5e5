//! A scenario's text as a tree of TOML: where its keys stand, and which arrays stand for tables.

use std::borrow::Cow;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer, Error};

/// More keys than any table has.
const MOST_SUSPECTS: usize = 100;

/// A parsed text with its name in messages.
pub(super) struct Document<'a> {
    path: &'a Path,
    text: &'a str,
    root: DeTable<'a>,
}

impl<'a> Document<'a> {
    pub(super) fn parse(path: &'a Path, text: &'a str) -> Result<Self, Error> {
        Ok(Self { path, text, root: DeTable::parse(text)?.into_inner() })
    }

    /// The place of a key, or of the innermost table around it that the text has.
    /// `entry` is the number of the table in a list of tables, from 0.
    pub(super) fn place_of(&self, key: &str, entry: Option<usize>) -> String {
        let (mut table, mut found) = (Some(&self.root), None);
        for name in key.split('.') {
            let Some((key_there, value)) = table.and_then(|table| table.get_key_value(name)) else { break };
            let in_list = value.get_ref().as_array().zip(entry).and_then(|(list, at)| list.get(at));
            found = Some(in_list.map_or(key_there.span().start, |value| value.span().start));
            table = in_list.unwrap_or(value).get_ref().as_table();
        }
        found.map_or_else(|| self.path.display().to_string(), |offset| place(self.path, self.text, offset))
    }

    /// The key whose value stands at an offset, with the tables around it.
    pub(super) fn key_at(&self, offset: usize) -> Option<String> {
        key_in(&self.root, offset)
    }

    /// The key of the table `path` without which the whole text is as it must be: serde reads some tables whole, and does
    /// not say which of their keys is wrong.
    pub(super) fn culprit<T: Deserialize<'a>>(&self, path: &str) -> Option<String> {
        let without = |key: Option<&str>| {
            let mut root = self.root.clone();
            let mut table = &mut root;
            for name in path.split('.') {
                let DeValue::Table(inner) = table.get_mut(name)?.get_mut() else { return None };
                table = inner;
            }
            let keys: Vec<_> = table.keys().map(|key| key.get_ref().clone()).collect();
            key.map(|key| table.remove(key));
            Some((root, keys))
        };
        let (_, keys) = without(None)?;
        let is_culprit = |key: &&Cow<str>| {
            let rest = without(Some(key)).map(|(root, _)| Deserializer::from(Spanned::new(0..0, root)));
            rest.is_some_and(|rest| T::deserialize(rest).is_ok())
        };
        let culprit = keys.iter().take(MOST_SUSPECTS).find(is_culprit)?;
        Some(format!("{path}.{culprit}"))
    }

    /// The first array that stands where the scenario as resolved has a table, with its place: serde takes an array for
    /// a table without names.
    pub(super) fn unnamed_table(&self, resolved: &Value) -> Option<(String, String)> {
        let (key, offset) = unnamed_in(&self.root, resolved)?;
        Some((key, place(self.path, self.text, offset)))
    }
}

/// File, line and column, from 1.
pub(super) fn place(path: &Path, text: &str, offset: usize) -> String {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    format!("{}:{line}:{column}", path.display())
}

fn key_in(table: &DeTable<'_>, offset: usize) -> Option<String> {
    table.iter().find_map(|(key, value)| {
        let inner = match value.get_ref() {
            DeValue::Table(inner) => key_in(inner, offset),
            DeValue::Array(list) => list
                .iter()
                .filter_map(|value| value.get_ref().as_table())
                .find_map(|inner| key_in(inner, offset)),
            _ => None,
        };
        let is_here = value.span().contains(&offset);
        match inner {
            Some(inner) => Some(format!("{}.{inner}", key.get_ref())),
            None => is_here.then(|| key.get_ref().to_string()),
        }
    })
}

fn unnamed_in(given: &DeTable<'_>, resolved: &Value) -> Option<(String, usize)> {
    given.iter().find_map(|(key, value)| {
        let (path, offset) = unnamed(value, resolved.get(key.get_ref().as_ref())?)?;
        let separator = if path.is_empty() { "" } else { "." };
        Some((format!("{}{separator}{path}", key.get_ref()), offset))
    })
}

fn unnamed(given: &Spanned<DeValue<'_>>, resolved: &Value) -> Option<(String, usize)> {
    match (given.get_ref(), resolved) {
        (DeValue::Array(_), Value::Object(_)) => Some((String::new(), given.span().start)),
        (DeValue::Table(given), Value::Object(_)) => unnamed_in(given, resolved),
        (DeValue::Array(given), Value::Array(resolved)) => {
            given.iter().zip(resolved).find_map(|(given, resolved)| unnamed(given, resolved))
        }
        _ => None,
    }
}
