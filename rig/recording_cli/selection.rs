//! The selection of topics that `export` writes as CSV tables.

use std::collections::BTreeMap;

use anyhow::bail;
use masseter_recording::{Columns, SCHEMA_ENCODING};
use masseter_shared::wording::nearest;
use mcap::{Channel, Schema};

/// The selected and the skipped topics.
#[derive(Debug, Default)]
pub(super) struct Selection {
    /// Topics and columns by channel id.
    pub tables: BTreeMap<u16, (String, Columns)>,
    /// Topics that cannot become tables, with the reason.
    pub skipped: Vec<(String, String)>,
}

impl Selection {
    /// The `requested` topics, each of which must fit a table; without any, all topics that fit one.
    pub(super) fn new<'a>(
        channels: impl Iterator<Item = &'a Channel<'static>>,
        requested: &[String],
    ) -> anyhow::Result<Self> {
        let (mut selection, mut topics) = (Self::default(), Vec::new());
        for channel in channels {
            topics.push(channel.topic.as_str());
            if !requested.is_empty() && !requested.contains(&channel.topic) {
                continue;
            }
            match columns(channel.schema.as_deref()) {
                Ok(columns) => {
                    selection.tables.insert(channel.id, (channel.topic.clone(), columns));
                }
                Err(reason) if requested.is_empty() => {
                    selection.skipped.push((channel.topic.clone(), reason));
                }
                Err(reason) => bail!("topic '{}' cannot become a table: {reason}", channel.topic),
            }
        }
        match requested.iter().find(|topic| !topics.contains(&topic.as_str())) {
            Some(unknown) => {
                let likely = nearest(unknown, topics.iter().copied());
                let likely = likely.map_or_else(String::new, |topic| format!("; did you mean '{topic}'?"));
                bail!("the recording has no topic '{unknown}'; it has {}{likely}", topics.join(", "))
            }
            None => Ok(selection),
        }
    }
}

/// The columns of messages with this schema, or the reason why there are none.
fn columns(schema: Option<&Schema>) -> Result<Columns, String> {
    let Some(Schema { encoding, data, .. }) = schema else {
        return Err("its schema is missing".to_owned());
    };
    if encoding != SCHEMA_ENCODING {
        return Err(format!("its messages are {encoding}, not {SCHEMA_ENCODING}"));
    }
    let columns = str::from_utf8(data).ok().and_then(Columns::from_definition);
    columns.ok_or_else(|| "its messages hold more than numbers".to_owned())
}
