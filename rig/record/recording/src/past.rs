//! The manifest of a past run, compared with what its recording holds of the beginning: the scenario, the files that it
//! names, and the circumstances.
//!
//! This finds accidents: an edited file, or a recording of another run. Nobody is kept from forging every file.

use std::{io, path::PathBuf};

use masseter_scenario::Scenario;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_bytes};
use serde_json::{Map, Value};

use crate::manifest::{AT_START, Manifest};
use crate::{folder::RunFolder, reader::Reader};

/// Known at the start and of no weight for the verdict.
const BUILD: &str = "masseter";

/// Reads the manifest of a past run.
///
/// # Errors
/// Those of [`Manifest::read`], and when a file of the folder is not that of the recording.
pub fn manifest_of(folder: &RunFolder) -> io::Result<Manifest> {
    let manifest = Manifest::read(folder)?;
    // What of the recording cannot be read, its analysis says.
    let Ok(mut reader) = Reader::open(&folder.recording()) else { return Ok(manifest) };
    let _ = reader.next_message();
    let differs = difference(&manifest, folder, reader.attachments());
    differs.map_or(Ok(manifest), |what| {
        let remedy = "restore the files of the run, or play the scenario again";
        Err(io::Error::other(format!("it is not that of the recording: {what}; {remedy}")))
    })
}

/// The first difference from the files at the recording's beginning.
fn difference(manifest: &Manifest, folder: &RunFolder, attached: &[mcap::Attachment]) -> Option<String> {
    let data = |name: &str| Some(attached.iter().find(|file| file.name == name)?.data.as_ref());
    let mut scenario = manifest.scenario.clone();
    let mut names = Vec::new();
    for (name, file) in scenario.files_mut() {
        *file = PathBuf::from(&name);
        names.push(name);
    }
    let recorded = data("scenario.toml")
        .and_then(|text| Scenario::parse("scenario.toml".as_ref(), str::from_utf8(text).ok()?).ok());
    let of_scenario =
        recorded.and_then(|recorded| difference_of_lines(&recorded.to_toml(), &scenario.to_toml()));
    let is_changed = |name: &&String| {
        let now = read_bytes(&folder.file(name), MOST_KEPT_BYTES).ok();
        data(name).zip(now).is_some_and(|(recorded, now)| recorded != now)
    };
    let of_files = || names.iter().find(is_changed).map(|name| format!("{name} has changed since"));
    let of_circumstances = || {
        let recorded: Map<String, Value> = serde_json::from_slice(data(AT_START)?).ok()?;
        let stated: Value = serde_json::from_str(&manifest.at_start()).ok()?;
        let (key, value) = recorded.iter().find(|(key, value)| *key != BUILD && stated[*key] != **value)?;
        Some(format!("{key} is {} here and {value} there", stated[key]))
    };
    of_scenario.or_else(of_files).or_else(of_circumstances)
}

fn difference_of_lines(recorded: &str, stated: &str) -> Option<String> {
    let mut pairs = stated.lines().zip(recorded.lines());
    match pairs.find(|(stated, recorded)| stated != recorded) {
        Some((stated, recorded)) => Some(format!("the scenario has '{stated}' here and '{recorded}' there")),
        None => (stated != recorded).then(|| "one scenario has keys that the other lacks".to_owned()),
    }
}
