//! A scenario's text as a tree of TOML, with the places of its keys. The refusal of a malformed file has place and key,
//! in the words of the documents.

use std::{borrow::Cow, path::Path};

use serde::{Deserialize, de::DeserializeOwned};
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue, Deserializer, Error};
use toml::value::Datetime;

use super::error::ScenarioError;
use crate::{input::excerpt, wording::question};

/// More keys than any table has.
const MOST_SUSPECTS: usize = 100;
/// Beginning of a message on an unknown key.
const UNKNOWN_KEY: &str = "unknown key";
/// What a value is that should be one of some names.
const NO_NAME: &str = "no name; write it in quotes";
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

    /// The value of a key outside of lists, as it is written.
    fn written(&self, key: &str) -> Option<&'a str> {
        let mut names = key.split('.');
        let value = self.root.get(names.next()?)?;
        let value = names.try_fold(value, |value, name| value.get_ref().as_table()?.get(name))?;
        self.text.get(value.span())
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
    let mut written = error.span().and_then(|span| text.get(span)).unwrap_or_default();
    let key = document.and_then(|document| {
        let key = document.key_at(offset)?;
        let culprit = document.culprit::<T>(&key);
        if let Some(culprit) = &culprit {
            place = document.place_of(culprit, None);
            written = document.written(culprit).unwrap_or_default();
        }
        Some(culprit.unwrap_or(key))
    });
    let mut reason = in_words(error.message().lines().next().unwrap_or_default(), written);
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
/// `written` is the text that the message is about.
fn in_words(message: &str, written: &str) -> String {
    let message = cut_quotations(message);
    let known = [("unknown field", UNKNOWN_KEY), ("unknown variant", "unknown value")];
    let known = known.iter().find_map(|(of_reader, ours)| Some((*ours, message.strip_prefix(of_reader)?)));
    let Some((ours, rest)) = known else {
        return of_type(&message, written).unwrap_or_else(|| message.replace('`', "'"));
    };
    let mut names = rest.split('`').skip(1).step_by(2);
    let question = names.next().map_or_else(String::new, |unknown| question(unknown, names));
    format!("{ours}{}{question}", rest.replace('`', "'"))
}

/// A message of the TOML reader on a wrong value, or on a key that is absent or there twice, without the names of types in
/// Rust.
fn of_type(message: &str, written: &str) -> Option<String> {
    let is_date = written.parse::<Datetime>().is_ok();
    let quoted = if is_date { format!("the date {written}") } else { excerpt(written) };
    match message {
        "duplicate key" => return Some(format!("{quoted}: the key is there already")),
        "wanted string or table" => return Some(format!("{quoted} is {NO_NAME}")),
        "integer number overflowed" => return Some(format!("{quoted} has too many digits")),
        _ => {}
    }
    if let Some(key) = message.strip_prefix("missing field ") {
        return Some(format!("the key {} is missing", key.replace('`', "'")));
    }
    let rest = ["invalid type: ", "invalid value: ", "invalid length "]
        .iter()
        .find_map(|beginning| message.strip_prefix(beginning))?;
    let (given, expected) = rest.rsplit_once(", expected ")?;
    let given = match given {
        _ if is_date => quoted,
        "map" => "a table".to_owned(),
        "sequence" => "a list".to_owned(),
        _ if given.starts_with('"') || given.starts_with("string ") => given.replacen("string ", "", 1),
        _ if given.bytes().all(|byte| byte.is_ascii_digit()) => format!("a list of {given}"),
        _ => given.split('`').nth(1).unwrap_or(given).to_owned(),
    };
    let is_not = no_value_of(expected, &given);
    Some(format!("{given} is {is_not}"))
}

/// Why what was given is no value of a type in Rust. The ranges of those types are wider than those of the keys.
fn no_value_of(expected: &str, given: &str) -> String {
    let is_whole = |digits: &str| digits.bytes().all(|byte| byte.is_ascii_digit());
    let reason = match expected {
        "u8" | "u16" | "u32" | "u64" | "usize" | "i8" | "i16" | "i32" | "i64" => {
            match given.strip_prefix('-') {
                Some(digits) if is_whole(digits) => "too small",
                None if is_whole(given) => "too large",
                _ => "no whole number",
            }
        }
        "f64" => "no number",
        "a string" | "string" => "no text; write it in quotes",
        "a boolean" => "neither true nor false",
        "a sequence" => "no list; write it in brackets, and a list of tables as [[NAME]]",
        "a map" => "no table",
        "variant identifier" | "string or map" => NO_NAME,
        _ if expected.starts_with("struct ") || expected.starts_with("internally tagged ") => "no table",
        _ => match (expected.strip_prefix("an array of length "), expected.strip_prefix("a number ")) {
            (Some(length), _) => return format!("no list of {}", length.split(' ').next().unwrap_or(length)),
            (_, Some(rest)) => return format!("no number {rest}"),
            _ => "no value of this key",
        },
    };
    reason.to_owned()
}

/// A message of the TOML reader with every quotation cut.
fn cut_quotations(message: &str) -> String {
    let quotations = message.split_inclusive(['`', '"']).map(|part| match part.chars().next_back() {
        Some(mark @ ('`' | '"')) => excerpt(&part[..part.len() - 1]) + mark.encode_utf8(&mut [0; 4]),
        _ => excerpt(part),
    });
    quotations.collect::<String>().chars().take(LONGEST_REASON).collect()
}
