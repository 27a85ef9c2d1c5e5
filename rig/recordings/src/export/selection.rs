//! The selection of the tables that `export` writes.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use masseter_analysis::signals::Registry;
use masseter_recording::{Columns, Description, Reader, Topic};
use masseter_runtime::messages::{FrameTap, Message};
use masseter_scenario::Scenario;
use masseter_scenario::wording::nearest;

use super::cycles::CYCLES;
use super::declared::declared;
use super::topic::Shape;
use crate::recording::survey::Survey;

/// The name of the attached scenario.
const SCENARIO: &str = "scenario.toml";

/// The selected tables.
pub(super) struct Selection {
    pub(super) topics: BTreeMap<Topic, Shape>,
    /// The signals of the table of cycles; none where it is not selected.
    pub(super) registry: Option<Registry>,
}

impl Selection {
    /// The `requested` tables; without any, all that have rows. The recording was read to its end.
    pub(super) fn new(reader: &Reader, survey: &Survey, requested: &[String]) -> anyhow::Result<Self> {
        let has_rows: Vec<_> = survey.topics().collect();
        let shapes = shapes(reader).into_iter().filter(|(topic, _)| has_rows.contains(&topic.name()));
        let mut topics: BTreeMap<_, _> = shapes.collect();
        let has_scenario = reader.attachments().iter().any(|file| file.name == SCENARIO);
        let known: Vec<_> = has_scenario
            .then_some(CYCLES)
            .into_iter()
            .chain(topics.keys().map(|topic| topic.name()))
            .collect();
        if let Some(unknown) = requested.iter().find(|name| !known.contains(&name.as_str())) {
            if unknown == Topic::Frame.name() && !reader.has_frames() {
                bail!("the recording gives no table 'frame': it leaves out the CAN frames");
            }
            let likely = nearest(unknown, known.iter().copied());
            let likely = likely.map_or_else(String::new, |name| format!("; did you mean '{name}'?"));
            bail!("the recording gives no table '{unknown}'; it gives {}{likely}", known.join(", "));
        }
        let is_selected =
            |name: &str| requested.is_empty() || requested.iter().any(|requested| requested == name);
        topics.retain(|topic, _| is_selected(topic.name()));
        let registry = (has_scenario && is_selected(CYCLES)).then(|| registry(reader)).transpose()?;
        Ok(Self { topics, registry })
    }
}

/// The fields of the rig's topics, by the definitions in the recording.
fn shapes(reader: &Reader) -> BTreeMap<Topic, Shape> {
    let mut definitions: BTreeMap<_, _> = reader
        .channels()
        .filter_map(|channel| {
            let definition = str::from_utf8(&channel.schema.as_ref()?.data).ok()?;
            Some((Topic::named(&channel.topic)?, definition.to_owned()))
        })
        .collect();
    let columns = Columns::of_topics(reader.channels());
    // Recordings have many frames in a message.
    definitions.entry(Topic::Frame).or_insert_with(FrameTap::definition);
    let shape = |(topic, columns)| {
        let descriptions = definitions.get(&topic).map(|text| Description::of_fields(text));
        (topic, Shape { columns, descriptions: descriptions.unwrap_or_default() })
    };
    columns.into_iter().map(shape).collect()
}

/// The signals of the run, by the scenario and the definitions in the recording.
fn registry(reader: &Reader) -> anyhow::Result<Registry> {
    let attached = reader.attachments().iter().find(|file| file.name == SCENARIO);
    let text = attached.and_then(|file| str::from_utf8(&file.data).ok());
    let text = text.context("the attached scenario is no text")?;
    let scenario = Scenario::parse(Path::new(SCENARIO), text)?;
    scenario.validate().context("the attached scenario")?;
    Ok(Registry::new(&scenario, &declared(reader.channels())))
}
