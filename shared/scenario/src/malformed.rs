//! The refusal of a malformed file: its place, the key, and the TOML reader's message in the words of the documents.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::document::{Document, place};
use super::error::ScenarioError;
use crate::input::excerpt;
use crate::wording::nearest;

/// What a message on an unknown key begins with.
pub(super) const UNKNOWN_KEY: &str = "unknown key";
/// Characters of the longest message of the TOML reader.
const LONGEST_REASON: usize = 2000;

/// The refusal of a text that is no `T`. With a document, the text is TOML, and the message names the key.
pub(super) fn malformed<T: DeserializeOwned>(
    path: &Path,
    text: &str,
    document: Option<&Document>,
    error: &toml::de::Error,
) -> ScenarioError {
    let offset = error.span().map_or(0, |span| span.start);
    let mut place = place(path, text, offset);
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
    if let Some(key) = key.filter(|_| !reason.starts_with(UNKNOWN_KEY)) {
        reason = format!("{}: {reason}", excerpt(&key));
    }
    ScenarioError::Malformed { place, reason }
}

/// A message of the TOML reader in the words of the documents, with the most similar of the keys or values that it
/// expects.
pub(super) fn in_words(message: &str) -> String {
    let message = cut(message);
    let known = [("unknown field", UNKNOWN_KEY), ("unknown variant", "unknown value")];
    let known = known.iter().find_map(|(of_reader, ours)| Some((*ours, message.strip_prefix(of_reader)?)));
    let Some((ours, rest)) = known else { return quoted(&message) };
    let mut names = rest.split('`').skip(1).step_by(2);
    let likely = names.next().and_then(|unknown| nearest(unknown, names));
    let question = likely.map_or_else(String::new, |likely| format!("; did you mean '{likely}'?"));
    format!("{ours}{}{question}", quoted(rest))
}

fn quoted(message: &str) -> String {
    message.replace('`', "'")
}

/// A message of the TOML reader with every quotation cut.
fn cut(message: &str) -> String {
    let quotations = message.split_inclusive(['`', '"']).map(|part| match part.chars().next_back() {
        Some(mark @ ('`' | '"')) => excerpt(&part[..part.len() - 1]) + mark.encode_utf8(&mut [0; 4]),
        _ => excerpt(part),
    });
    quotations.collect::<String>().chars().take(LONGEST_REASON).collect()
}
