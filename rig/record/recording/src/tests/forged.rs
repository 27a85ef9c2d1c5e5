//! Files that are MCAP and no recording of the rig.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::MAGIC;
use mcap::records::{MessageHeader, op};

use super::*;

/// A record of MCAP.
fn record_of(opcode: u8, body: &[&[u8]]) -> Vec<u8> {
    let body = body.concat();
    [&[opcode], &(body.len() as u64).to_le_bytes()[..], &body].concat()
}

/// A text as MCAP writes it.
fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

/// A chunk without times and checksum.
fn chunk_of(records: &[u8], compression: &str) -> Vec<u8> {
    let size = (records.len() as u64).to_le_bytes();
    record_of(op::CHUNK, &[&[0; 16], &size, &[0; 4], &text(compression), &size, records])
}

#[test]
fn messages_outside_of_chunks_are_named_and_not_passed_over() {
    let mut medium = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().use_chunks(false).create(&mut medium).unwrap();
    let channel = writer.add_channel(0, "reading", "cdr", &BTreeMap::new()).unwrap();
    for sequence in 1..=3 {
        let header = MessageHeader { channel_id: channel, sequence, log_time: 0, publish_time: 0 };
        writer.write_to_known_channel(&header, &[0; 8]).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let read = read(medium.get_ref()).unwrap();
    let [damage] = read.damage.as_slice() else { panic!("{:?}", read.damage) };
    assert!(damage.reason.contains("outside of chunks"), "{damage}");
    assert!(!read.cut_short);
}

#[test]
fn a_chunk_of_impossible_length_is_passed_over() {
    let head = [&[op::CHUNK][..], &100_u64.to_le_bytes(), &[0; 32], &[0xff; 8], &[0; 60]].concat();
    let read = read(&[MAGIC, &[0xff], head.as_slice(), &WHOLE.bytes[MAGIC.len()..]].concat()).unwrap();
    assert!(read.messages == WHOLE.messages);
}

/// 80 MB in one chunk without a checksum, which take some kilobytes in the file.
#[test]
fn a_chunk_that_unpacks_to_more_than_a_record_may_have_is_damaged() {
    let mut medium = Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new().chunk_size(None).calculate_chunk_crcs(false);
    let mut writer = options.create(&mut medium).unwrap();
    let channel = writer.add_channel(0, "reading", "cdr", &BTreeMap::new()).unwrap();
    for sequence in 1..=80 {
        let header = MessageHeader { channel_id: channel, sequence, log_time: 0, publish_time: 0 };
        writer.write_to_known_channel(&header, &vec![0; 1_000_000]).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    assert!(medium.get_ref().len() < 100_000);
    let read = read(medium.get_ref()).unwrap();
    assert!(read.messages.is_empty());
    let [damage] = read.damage.as_slice() else { panic!("{:?}", read.damage) };
    assert!(damage.reason.contains("cannot be unpacked"), "{damage}");
}

/// Counts the bytes that are read.
struct Counted<'a> {
    bytes: Cursor<Vec<u8>>,
    read: &'a Cell<usize>,
}

impl Read for Counted<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.bytes.read(out)?;
        self.read.set(self.read.get() + read);
        Ok(read)
    }
}

impl Seek for Counted<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.bytes.seek(to)
    }
}

#[test]
fn the_index_is_asked_for_lost_definitions_once() {
    let chunk = chunk_of(b"no zstd", "zstd");
    let bytes = [MAGIC.to_vec(), chunk.repeat(1_000)].concat();
    let (size, read) = (bytes.len(), Cell::new(0));
    let mut reader = Reader::new(Counted { bytes: Cursor::new(bytes), read: &read }).unwrap();
    while reader.next_message().unwrap().is_some() {}
    assert_eq!(reader.damage().len(), 1);
    assert!(read.get() <= 3 * size, "{} of {size}", read.get());
}

#[test]
fn a_damaged_end_of_the_data_does_not_let_a_damaged_index_pass() {
    let wrong = 1_u32.to_le_bytes();
    let bytes = [
        MAGIC.to_vec(),
        record_of(op::HEADER, &[&text(""), &text("")]),
        record_of(op::DATA_END, &[&wrong]),
        record_of(op::CHANNEL, &[&[1, 0], &[0; 2], &text("topic"), &text("cdr"), &text("")]),
        record_of(op::FOOTER, &[&[0; 16], &wrong]),
        MAGIC.to_vec(),
    ]
    .concat();
    let mut reader = Reader::new(Cursor::new(bytes)).unwrap();
    assert!(reader.next_entry().unwrap().is_none());
    assert_eq!(reader.channels().count(), 0);
    let [_, index] = reader.damage() else { panic!("{:?}", reader.damage()) };
    assert!(index.reason.contains("the index has checksum"), "{index}");
    assert!(!reader.was_cut_short());
}

/// A chunk's records: channels 1 and 2 that both name a schema, which is defined anew between them, each with a message.
fn chunk_with_schema_twice(schema: u16) -> Vec<u8> {
    let records = (1..=2_u16).flat_map(|channel| {
        let (schema, number) = (schema.to_le_bytes(), channel.to_le_bytes());
        let name = text(&format!("type {channel}"));
        let topic = text(&format!("topic {channel}"));
        let empty = text("");
        [
            record_of(op::SCHEMA, &[&schema, &name, &text("ros2msg"), &empty]),
            record_of(op::CHANNEL, &[&number, &schema, &topic, &text("cdr"), &empty]),
            record_of(op::MESSAGE, &[&number, &[0; 4 + 8 + 8], &number]),
        ]
    });
    let chunk = chunk_of(&records.collect::<Vec<_>>().concat(), "");
    [MAGIC, &record_of(op::HEADER, &[&text(""), &text("")]), &chunk].concat()
}

#[test]
fn messages_are_recovered_however_their_schemas_are_numbered() {
    for schema in [0, 7] {
        let (recovered, bytes) = recovered(&chunk_with_schema_twice(schema));
        assert_eq!(recovered, Recovered { messages: 2, undefined: 0 });
        let mut reader = Reader::new(Cursor::new(bytes)).unwrap();
        let mut kept = Vec::new();
        while let Some(Entry { channel, data, .. }) = reader.next_entry().unwrap() {
            let channel = channel.unwrap();
            kept.push((channel.topic.clone(), channel.schema.as_ref().unwrap().name.clone(), data));
        }
        let expected =
            [1_u8, 2].map(|number| (format!("topic {number}"), format!("type {number}"), vec![number, 0]));
        assert_eq!(kept, expected);
    }
}
