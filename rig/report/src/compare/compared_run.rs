//! One of two runs: verdict and figures from its summary, circumstances from its manifest.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::summary::FORM;

use super::changes::{flatten, leaves};

use masseter_recording::RunFolder;
use masseter_scenario::input::{MOST_KEPT_BYTES, read_text};

/// Keys of the manifest that must agree for two runs to be comparable.
const CIRCUMSTANCES: [&str; 4] = ["scenario", "clock", "machine", "masseter"];

/// One run.
#[derive(Debug, Serialize)]
pub(super) struct ComparedRun {
    pub path: String,
    pub verdict: StoredVerdict,
    #[serde(skip)]
    pub figures: BTreeMap<String, f64>,
    #[serde(skip)]
    pub circumstances: BTreeMap<String, String>,
}

/// The verdict in a summary.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct StoredVerdict {
    pub word: String,
    pub reason: String,
}

/// A circumstance in which two runs differ; none where one has no such key.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Difference {
    pub key: String,
    pub a: Option<String>,
    pub b: Option<String>,
}

impl ComparedRun {
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        let folder = RunFolder::open(path)?;
        let summary = folder.summary();
        let help = || format!("{}; 'masseter report {}' writes it", summary.display(), path.display());
        let found = json(&summary).with_context(help)?;
        let manifest = folder.manifest();
        let circumstances = json(&manifest).with_context(|| manifest.display().to_string())?;
        Self::new(&path.display().to_string(), &found, &circumstances).with_context(help)
    }

    pub(super) fn new(path: &str, summary: &Value, manifest: &Value) -> anyhow::Result<Self> {
        let form = &summary["form"];
        ensure!(*form == FORM, "it has form {form}, this program compares form {FORM}");
        let Value::Object(_) = &summary["figures"] else { bail!("it has no figures") };
        let verdict = StoredVerdict::deserialize(&summary["verdict"]).context("it has no verdict")?;
        let of_manifest = CIRCUMSTANCES.map(|key| (key.to_owned(), manifest[key].clone()));
        let circumstances = leaves(&Value::Object(of_manifest.into_iter().collect()));
        let in_words = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        Ok(Self {
            path: path.to_owned(),
            verdict,
            figures: flatten(&summary["figures"]),
            circumstances: circumstances.into_iter().map(|(key, value)| (key, in_words(value))).collect(),
        })
    }
}

fn json(path: &Path) -> anyhow::Result<Value> {
    Ok(serde_json::from_str(&read_text(path, MOST_KEPT_BYTES)?)?)
}

pub(super) fn differences(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>) -> Vec<Difference> {
    let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    let differing = keys.into_iter().filter(|key| a.get(*key) != b.get(*key));
    let difference =
        |key: &String| Difference { key: key.clone(), a: a.get(key).cloned(), b: b.get(key).cloned() };
    differing.map(difference).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn what_is_no_summary_of_this_form_is_refused() {
        let verdict = json!({"word": "PASS", "reason": "every check passed"});
        for (summary, why) in [
            (json!({"form": FORM, "verdict": verdict, "figures": {}}), None),
            (json!({"form": 9, "verdict": verdict, "figures": {}}), Some("it has form 9")),
            (json!({"form": FORM, "verdict": verdict, "figures": []}), Some("it has no figures")),
            (json!({"form": FORM, "figures": {}}), Some("it has no verdict")),
            (json!([]), Some("it has form null")),
        ] {
            let refusal = ComparedRun::new("A", &summary, &json!({})).err().map(|error| error.to_string());
            match (&refusal, why) {
                (Some(refusal), Some(why)) => assert!(refusal.contains(why), "{refusal}"),
                _ => assert_eq!((refusal.as_deref(), why), (None, None)),
            }
        }
    }
}
