//! The definitions of a recording's channels, which its beginning holds, and its index again.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Read, Seek};
use std::sync::Arc;

use mcap::records::{Record, SchemaHeader, op};
use mcap::{Channel, Schema};

use super::walk::{Step, Walk};

/// Channels by their numbers, with their schemas.
#[derive(Debug, Default)]
pub(super) struct Definitions {
    schemas: BTreeMap<u16, Arc<Schema<'static>>>,
    pub(super) channels: BTreeMap<u16, Arc<Channel<'static>>>,
}

impl Definitions {
    /// Those in the index behind the place of `walk`. Only the checksum in the footer covers them, so either all or none
    /// are taken.
    pub(super) fn from_index<R: Read + Seek>(mut walk: Walk<R>) -> io::Result<Self> {
        let mut found = Self::default();
        loop {
            match walk.step()? {
                Step::Record(op::FOOTER) => return Ok(found),
                Step::Record(opcode) if walk.is_in_index => found.parse(opcode, walk.body()),
                Step::Record(_) => {}
                Step::Damage(_) => found = Self::default(),
                Step::End => return Ok(Self::default()),
            }
        }
    }

    /// Takes a schema or a channel; a damaged one counts as missing.
    pub(super) fn parse(&mut self, opcode: u8, body: &[u8]) {
        if let (op::SCHEMA | op::CHANNEL, Ok(record)) = (opcode, mcap::parse_record(opcode, body)) {
            self.take(record.into_owned());
        }
    }

    /// Takes a record, if it is a schema or a channel.
    pub(super) fn take(&mut self, record: Record<'static>) {
        match record {
            Record::Schema { header: SchemaHeader { id, name, encoding }, data } => {
                let data = Cow::Owned(data.into_owned());
                self.schemas.insert(id, Arc::new(Schema { id, name, encoding, data }));
            }
            Record::Channel(mcap::records::Channel { id, schema_id, topic, message_encoding, metadata }) => {
                let schema = self.schemas.get(&schema_id).cloned();
                let channel = Channel { id, topic, schema, message_encoding, metadata };
                self.channels.insert(id, Arc::new(channel));
            }
            _ => {}
        }
    }
}
