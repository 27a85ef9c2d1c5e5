//! What Python gives as settings, and the settings of a drive that follow.
//!
//! The defaults are those of the drives; profiles are the Python part's.

use masseter_drives::{DriveSettings, Identity, Quirk, Ratings};
use pyo3::prelude::*;
use serde_json::{Map, Value, json};

use crate::setting_error;

/// The settings of one drive. What is not given keeps its default.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    node: i64,
    #[serde(default)]
    quirks: Vec<Map<String, Value>>,
    #[serde(default)]
    identity: Identity,
    #[serde(default)]
    ratings: Ratings,
    stroke_m: Option<[f64; 2]>,
    heartbeat_ms: Option<u16>,
    master_timeout_ms: Option<u16>,
}

/// The settings of all drives of a JSON text.
///
/// # Errors
/// `SettingError` of Python.
pub(crate) fn settings_of_all(text: &str) -> PyResult<Vec<DriveSettings>> {
    let list: Vec<Value> =
        serde_json::from_str(text).map_err(|error| setting_error("settings", text, &error))?;
    let mut all: Vec<DriveSettings> = Vec::new();
    for one in list {
        let of_node = format!("of node {}", one["node"]);
        let given: Given =
            serde_json::from_value(one).map_err(|error| setting_error("settings", of_node, &error))?;
        let settings = given.settings()?;
        if all.iter().any(|other| other.node == settings.node) {
            return Err(setting_error(
                "nodes",
                settings.node,
                &"two drives have this id; name each node once",
            ));
        }
        all.push(settings);
    }
    if all.is_empty() { Err(setting_error("nodes", "[]", &"name at least one node")) } else { Ok(all) }
}

impl Given {
    fn settings(self) -> PyResult<DriveSettings> {
        let id = u8::try_from(self.node).ok().and_then(|id| masseter_can::canopen::NodeId::new(id).ok());
        let no_id = || setting_error("nodes", self.node, &"no node id of CANopen; use 1 to 127");
        let default = DriveSettings::new(id.ok_or_else(no_id)?);
        let settings = DriveSettings {
            identity: self.identity,
            ratings: checked_ratings(self.ratings)?,
            stroke_m: self.stroke_m.unwrap_or(default.stroke_m),
            heartbeat_ms: self.heartbeat_ms.unwrap_or(default.heartbeat_ms),
            master_timeout_ms: self.master_timeout_ms.unwrap_or(default.master_timeout_ms),
            quirks: self.quirks.into_iter().map(quirk).collect::<PyResult<_>>()?,
            ..default
        };
        let [low_m, high_m] = settings.stroke_m;
        if low_m >= high_m {
            let value = format!("[{low_m}, {high_m}]");
            return Err(setting_error("stroke_m", value, &"give the lower end first"));
        }
        settings.objects().map_err(|error| setting_error("quirks", settings.node, &error))?;
        Ok(settings)
    }
}

/// A drive without force, speed or increments does not move.
fn checked_ratings(ratings: Ratings) -> PyResult<Ratings> {
    let numbers = json!(ratings);
    for (key, value) in numbers.as_object().into_iter().flatten() {
        let number = value.as_f64().unwrap_or_default();
        if number < 0.0 || (number == 0.0 && key != "encoder_noise_m") {
            return Err(setting_error(key, value, &"use a number above 0"));
        }
    }
    Ok(ratings)
}

/// A quirk of `{"kind": …}` with its values.
fn quirk(mut given: Map<String, Value>) -> PyResult<Quirk> {
    let shown = Value::from(given.clone());
    let kind = given.remove("kind").and_then(|kind| kind.as_str().map(str::to_owned));
    let kind = kind.ok_or_else(|| setting_error("quirks", &shown, &"name its kind"))?;
    // A kind that takes no values has the form of a name.
    let name = serde_json::from_value(json!(kind)).ok().filter(|_| given.is_empty());
    let read = name.map_or_else(|| serde_json::from_value(json!({ kind: given })), Ok);
    read.map_err(|error| setting_error("quirks", shown, &error))
}
