//! A scenario's text as a tree of TOML, with the places of its keys. The refusal of a malformed file has place and key,
//! in the words of the documents.

use std::{borrow::Cow, path::Path};

use serde::{Deserialize, de::DeserializeOwned};
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer, Error};

use super::error::ScenarioError;
use crate::{input::excerpt, wording::question};

/// More keys than any table has.
const MOST_SUSPECTS: usize = 100;
/// Beginning of a message on an unknown key.
const UNKNOWN_KEY: &str = "unknown key";
/// Characters of the longest message of the TOML reader.
const LONGEST_REASON: usize = 2000;

/// A parsed text and its name in messages.
pub(super) struct Document<'a> {
    path: &'a Path,
    text: &'a str,
    root: DeTable<'a>,
}

impl<'a> Document<'a> {
    pub(super) fn parse(path: &'a Path, text: &'a str) -> Result<Self, Error> {
        Ok(Self { path, text, root: DeTable::parse(text)?.into_inner() })
    }

    /// The place of a key, or of the innermost table around the key in the text. `entry` is the number of the table in
    /// a list of tables, from 0.
    pub(super) fn place_of(&self, key: &str, entry: Option<usize>) -> String {
        let (mut table, mut found) = (Some(&self.root), None);
        for name in key.split('.') {
            let Some((key_there, value)) = table.and_then(|table| table.get_key_value(name)) else { break };
            let in_list = value.get_ref().as_array().zip(entry).and_then(|(list, at)| list.get(at));
            found = Some(in_list.map_or(key_there.span().start, |value| value.span().start));
            table = in_list.unwrap_or(value).get_ref().as_table();
        }
        found.map_or_else(|| self.path.display().to_string(), |offset| place_in(self.path, self.text, offset))
    }

    /// The key of the value at an offset, with the tables around.
    pub(super) fn key_at(&self, offset: usize) -> Option<String> {
        key_in(&self.root, offset)
    }

    /// The key of the table `path` whose removal makes the whole text valid. Serde reads some tables whole, and its
    /// error names no key of them.
    pub(super) fn culprit<T: Deserialize<'a>>(&self, path: &str) -> Option<String> {
        let keys: Vec<_> =
            table_at(&mut self.root.clone(), path)?.keys().map(Spanned::get_ref).cloned().collect();
        let is_culprit = |key: &&Cow<str>| {
            let mut rest = self.root.clone();
            table_at(&mut rest, path).map(|table| table.remove(&***key));
            T::deserialize(Deserializer::from(Spanned::new(0..0, rest))).is_ok()
        };
        let culprit = keys.iter().take(MOST_SUSPECTS).find(is_culprit)?;
        Some(format!("{path}.{culprit}"))
    }

    /// The first array in the place of a table, with its position. Serde accepts an array as a table without names.
    pub(super) fn unnamed_table(&self, resolved: &Value) -> Option<(String, String)> {
        let (key, offset) = unnamed_in(&self.root, resolved)?;
        Some((key, place_in(self.path, self.text, offset)))
    }
}

fn table_at<'t, 'a>(root: &'t mut DeTable<'a>, path: &str) -> Option<&'t mut DeTable<'a>> {
    path.split('.').try_fold(root, |table, name| match table.get_mut(name)?.get_mut() {
        DeValue::Table(inner) => Some(inner),
        _ => None,
    })
}

/// The value of nested keys: in the table of that number for a key of a list of tables, and null where that table lacks
/// it.
pub(super) fn value_at(values: &Value, key: &str, entry: Option<usize>) -> Option<Value> {
    let at = |key: &str| values.pointer(&format!("/{}", key.replace('.', "/"))).cloned();
    let Some(number) = entry else { return at(key) };
    let (list, key) = key.split_once('.').unwrap_or((key, ""));
    let table = at(&format!("{list}.{number}"))?;
    Some(if key.is_empty() { table } else { at(&format!("{list}.{number}.{key}")).unwrap_or_default() })
}

/// File, line and column, from 1.
pub(super) fn place_in(path: &Path, text: &str, offset: usize) -> String {
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

/// The value of a text in TOML; `path` is for messages only.
///
/// # Errors
/// [`ScenarioError::Malformed`] with file, line, column and key.
pub fn parse_toml<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, ScenarioError> {
    let document = Document::parse(path, text).map_err(|error| malformed::<T>(path, text, None, &error))?;
    toml::from_str(text).map_err(|error| malformed::<T>(path, text, Some(&document), &error))
}

/// The refusal of a text that is no `T`. With a document the text is TOML, and the message names the key.
pub(super) fn malformed<T: DeserializeOwned>(
    path: &Path,
    text: &str,
    document: Option<&Document>,
    error: &Error,
) -> ScenarioError {
    let offset = error.span().map_or(0, |span| span.start);
    let mut place = place_in(path, text, offset);
    let mut reason = in_words(error.message().lines().next().unwrap_or_default());
    if let Some(twice) = error.span().filter(|_| reason == "duplicate key").and_then(|span| text.get(span)) {
        reason = format!("{}: the key is there already", excerpt(twice));
    }
    let key = document.and_then(|document| {
        let key = document.key_at(offset)?;
        let culprit = document.culprit::<T>(&key);
        if let Some(culprit) = &culprit {
            place = document.place_of(culprit, None);
        }
        Some(culprit.unwrap_or(key))
    });
    if let Some(key) = key {
        match (reason.strip_prefix(UNKNOWN_KEY), document) {
            // Serde reads some tables whole, and places their keys at the table.
            (Some(unknown), Some(document)) => {
                let unknown = unknown.split('\'').nth(1).unwrap_or_default();
                let inner = document.place_of(&format!("{key}.{unknown}"), None);
                place = if inner == document.place_of(&key, None) { place } else { inner };
            }
            (Some(_), None) => {}
            (None, _) => reason = format!("{}: {reason}", excerpt(&key)),
        }
    }
    ScenarioError::Malformed { place, reason }
}

/// A message of the TOML reader in the words of the documents, with the most similar of the expected keys or values.
fn in_words(message: &str) -> String {
    let message = cut_quotations(message);
    let known = [("unknown field", UNKNOWN_KEY), ("unknown variant", "unknown value")];
    let known = known.iter().find_map(|(of_reader, ours)| Some((*ours, message.strip_prefix(of_reader)?)));
    let Some((ours, rest)) = known else {
        return of_type(&message).unwrap_or_else(|| message.replace('`', "'"));
    };
    let mut names = rest.split('`').skip(1).step_by(2);
    let question = names.next().map_or_else(String::new, |unknown| question(unknown, names));
    format!("{ours}{}{question}", rest.replace('`', "'"))
}

/// A message of the TOML reader on a value of another type, or on an absent key, without the names of types in Rust.
fn of_type(message: &str) -> Option<String> {
    if let Some(key) = message.strip_prefix("missing field ") {
        return Some(format!("the key {} is missing", key.replace('`', "'")));
    }
    let rest = ["invalid type: ", "invalid value: ", "invalid length "]
        .iter()
        .find_map(|beginning| message.strip_prefix(beginning))?;
    let (given, expected) = rest.rsplit_once(", expected ")?;
    let given = match given {
        "map" => "a table".to_owned(),
        "sequence" => "a list".to_owned(),
        _ if given.starts_with('"') || given.starts_with("string ") => given.replacen("string ", "", 1),
        _ if given.bytes().all(|byte| byte.is_ascii_digit()) => format!("a list of {given}"),
        _ => given.split('`').nth(1)?.to_owned(),
    };
    Some(format!("{given} is {}", no_value_of(expected)?))
}

/// That something is no value of a type in Rust.
fn no_value_of(expected: &str) -> Option<String> {
    let whole = |least: i64, most: u64| format!("no whole number from {least} to {most}");
    Some(match expected {
        "u8" => whole(0, u8::MAX.into()),
        "u16" => whole(0, u16::MAX.into()),
        "u32" => whole(0, u32::MAX.into()),
        "u64" | "usize" => whole(0, u64::MAX),
        "i8" => whole(i8::MIN.into(), 127),
        "i16" => whole(i16::MIN.into(), 32_767),
        "i32" => whole(i32::MIN.into(), 2_147_483_647),
        "i64" => "no whole number".to_owned(),
        "f64" => "no number".to_owned(),
        "a string" | "string" => "no text; write it in quotes".to_owned(),
        "a boolean" => "neither true nor false".to_owned(),
        "a sequence" => "no list; write it in brackets, and a list of tables as [[NAME]]".to_owned(),
        "a map" => "no table".to_owned(),
        _ if expected.starts_with("struct ") || expected.starts_with("internally tagged ") => {
            "no table".to_owned()
        }
        _ => {
            let length = expected.strip_prefix("an array of length ")?;
            format!("no list of {}", length.split(' ').next()?)
        }
    })
}

/// A message of the TOML reader with every quotation cut.
fn cut_quotations(message: &str) -> String {
    let quotations = message.split_inclusive(['`', '"']).map(|part| match part.chars().next_back() {
        Some(mark @ ('`' | '"')) => excerpt(&part[..part.len() - 1]) + mark.encode_utf8(&mut [0; 4]),
        _ => excerpt(part),
    });
    quotations.collect::<String>().chars().take(LONGEST_REASON).collect()
}
