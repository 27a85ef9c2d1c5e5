//! Which topics of a recording become tables.

use std::collections::BTreeMap;

use anyhow::bail;
use mcap::records::Channel;

use super::columns::Columns;
use masseter_recording::{SCHEMA_ENCODING, Schema};

/// What becomes a table, and what does not.
#[derive(Debug, Default)]
pub(super) struct Choice {
    /// Topics and columns by the number of the channel.
    pub tables: BTreeMap<u16, (String, Columns)>,
    /// Topics that make no table, and why.
    pub left_out: Vec<(String, String)>,
}

impl Choice {
    /// All topics that make a table, or those `wanted`, each of which must make one.
    pub(super) fn of<'a>(
        channels: impl Iterator<Item = (&'a Channel, Option<&'a Schema>)>,
        wanted: &[String],
    ) -> anyhow::Result<Self> {
        let (mut choice, mut topics) = (Self::default(), Vec::new());
        for (channel, schema) in channels {
            topics.push(channel.topic.as_str());
            if !wanted.is_empty() && !wanted.contains(&channel.topic) {
                continue;
            }
            match columns(schema) {
                Ok(columns) => {
                    choice.tables.insert(channel.id, (channel.topic.clone(), columns));
                }
                Err(why) if wanted.is_empty() => choice.left_out.push((channel.topic.clone(), why)),
                Err(why) => bail!("topic '{}' makes no table: {why}", channel.topic),
            }
        }
        match wanted.iter().find(|topic| !topics.contains(&topic.as_str())) {
            Some(unknown) => bail!("the recording has no topic '{unknown}'; it has {}", topics.join(", ")),
            None => Ok(choice),
        }
    }
}

/// The columns of messages with this schema, or why they make no table.
fn columns(schema: Option<&Schema>) -> Result<Columns, String> {
    let Some(Schema { encoding, data, .. }) = schema else {
        return Err("its schema is not known".to_owned());
    };
    if encoding != SCHEMA_ENCODING {
        return Err(format!("its messages are {encoding}"));
    }
    let columns = str::from_utf8(data).ok().and_then(Columns::of);
    columns.ok_or_else(|| "its messages hold more than numbers".to_owned())
}
