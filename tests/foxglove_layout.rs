//! The layout for Foxglove shows topics and fields that recordings and live connections have.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use masseter_recording::{Channel, Columns, Topic, definitions};
use masseter_runtime::named::Declared;
use serde_json::Value;

/// The keys whose texts are paths to messages or fields.
const PATH_KEYS: [&str; 2] = ["value", "topicPath"];

fn layout() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/foxglove-layout.json");
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Every path of the panels.
fn paths(of: &Value) -> Vec<String> {
    match of {
        Value::Object(fields) => fields
            .iter()
            .flat_map(|(key, value)| match value {
                Value::String(path) if PATH_KEYS.contains(&key.as_str()) => vec![path.clone()],
                value => paths(value),
            })
            .collect(),
        Value::Array(values) => values.iter().flat_map(paths).collect(),
        _ => Vec::new(),
    }
}

#[test]
fn every_path_leads_to_a_field() {
    let definitions = definitions(&Declared::default());
    let columns: BTreeMap<Topic, Columns> =
        Columns::of_topics(definitions.iter().map(|(_, channel)| channel));
    let fields: BTreeSet<String> = columns
        .iter()
        .flat_map(|(topic, columns)| {
            let names = columns.fields().iter().flat_map(|field| {
                let name = format!("{}.{}", topic.name(), field.name());
                field.columns().enumerate().map(move |(element, _)| {
                    if field.is_array() { format!("{name}[{element}]") } else { name.clone() }
                })
            });
            names.chain([topic.name().to_owned()])
        })
        .collect();
    let paths = paths(&layout()["configById"]);
    assert!(paths.len() > 20, "{paths:?}");
    for path in paths {
        assert!(fields.contains(&path), "{path}");
    }
}

#[test]
fn the_view_in_3d_shows_the_markers_and_every_panel_has_its_place() {
    let layout = layout();
    let definitions = definitions(&Declared::default());
    let markers = definitions.iter().find(|(channel, _)| *channel == Channel::Markers);
    let topic = markers.map(|(_, channel)| channel.topic.as_str()).unwrap();
    assert_eq!(layout["configById"]["3D!mechanism"]["topics"][topic]["visible"], true);
    let placed = layout["layout"].to_string();
    let panels = layout["configById"].as_object().unwrap();
    assert!(panels.keys().all(|panel| placed.contains(&format!("\"{panel}\""))), "{placed}");
}
