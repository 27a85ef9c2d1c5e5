//! The definitions of a recording's channels, which its beginning holds, and its index again.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek};

use mcap::records::{Channel, Record, SchemaHeader, op};

use super::encoding::Definition;
use super::schema::Schema;
use super::walk::{Step, Walk};

/// Channels and schemas by their numbers.
#[derive(Debug, Default)]
pub(super) struct Definitions {
    schemas: BTreeMap<u16, Schema>,
    channels: BTreeMap<u16, Channel>,
}

impl Definitions {
    /// Those in the index, from the current place of `walk` on. Only the checksum in the footer covers them, so either all
    /// or none are taken.
    pub(super) fn from_index<R: Read + Seek>(walk: &mut Walk<R>) -> io::Result<Self> {
        let mut found = Self::default();
        loop {
            match walk.step()? {
                Step::Record(op::FOOTER) => return Ok(found),
                Step::Record(opcode) if walk.is_in_index() => found.take(opcode, walk.body()),
                Step::Record(_) => {}
                Step::Damage(_) => found = Self::default(),
                Step::End => return Ok(Self::default()),
            }
        }
    }

    /// Those of every recording that this version of the program writes.
    pub(super) fn for_this_version() -> Self {
        let mut known = Self::default();
        for (number, definition) in (1..).zip(Definition::all()) {
            known.schemas.insert(number, definition.schema);
            let channel = Channel {
                id: number,
                schema_id: number,
                topic: definition.topic.to_owned(),
                message_encoding: definition.message_encoding,
                metadata: BTreeMap::new(),
            };
            known.channels.insert(number, channel);
        }
        known
    }

    /// Takes a schema or a channel; a damaged one counts as missing.
    pub(super) fn take(&mut self, opcode: u8, body: &[u8]) {
        if !matches!(opcode, op::SCHEMA | op::CHANNEL) {
            return;
        }
        match mcap::parse_record(opcode, body) {
            Ok(Record::Schema { header: SchemaHeader { id, name, encoding }, data }) => {
                self.schemas.insert(id, Schema { name, encoding, data: data.into_owned() });
            }
            Ok(Record::Channel(channel)) => {
                self.channels.insert(channel.id, channel);
            }
            _ => {}
        }
    }

    /// Takes those of others.
    pub(super) fn add(&mut self, others: Self) {
        self.schemas.extend(others.schemas);
        self.channels.extend(others.channels);
    }

    /// Whether no channel is defined.
    pub(super) fn is_empty(&self) -> bool {
        self.channels.is_empty()
    }

    /// The channel of this number and its schema.
    pub(super) fn channel(&self, channel: u16) -> Option<(&Channel, Option<&Schema>)> {
        self.channels.get(&channel).map(|channel| self.with_schema(channel))
    }

    /// All of them, by their numbers.
    pub(super) fn channels(&self) -> impl Iterator<Item = (&Channel, Option<&Schema>)> {
        self.channels.values().map(|channel| self.with_schema(channel))
    }

    fn with_schema<'a>(&'a self, channel: &'a Channel) -> (&'a Channel, Option<&'a Schema>) {
        (channel, self.schemas.get(&channel.schema_id))
    }
}
